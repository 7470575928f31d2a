# SPDX-License-Identifier: GPL-3.0-or-later
"""Worlds of any nodes leave Blender as Cycles has them, are asked for once, and leave nothing behind."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from benchmarks.lights import FALSE_ALARM, QUICK, prove  # noqa: E402
from benchmarks.world_cases import WORLD_CASES, gradient, picture, sky, world  # noqa: E402
from ivg_addon.blender import world_map  # noqa: E402
from ivg_addon.blender.export import export_render_steps  # noqa: E402
from ivg_addon.blender.world_content import world_key  # noqa: E402
from ivg_addon.blender.world_map import WorldLight, world_steps  # noqa: E402
from ivg_addon.core.errors import SceneError  # noqa: E402
from ivg_addon.core.progress import finish  # noqa: E402

from .cycles_scenes import snapshot  # noqa: E402

PROVED = ("sky, multiple scattering, disc", "disc of 0.1°", "no disc, shadow", "picture with a bright spot", "gradient")


@pytest.fixture(autouse=True)
def _empty_session() -> Iterator[None]:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    world_map._known.clear()
    yield
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


@pytest.fixture
def coarse(monkeypatch: pytest.MonkeyPatch) -> None:
    """Render maps of so few texels that it takes no time."""
    monkeypatch.setattr(world_map, "_WIDTH", 64)
    monkeypatch.setattr(world_map, "_SEARCH_WIDTH", 64)
    monkeypatch.setattr(world_map, "_SPOT_TEXELS", 256)


def evaluated() -> WorldLight | None:
    return finish(world_steps(bpy.context.scene, bpy.context.view_layer))


def notices() -> str:
    light = evaluated()
    assert light is not None
    return " | ".join(map(str, light.notices))


@pytest.mark.parametrize("name", PROVED)
def test_world_shines_as_in_cycles(name: str) -> None:
    """Irradiance of 245 dual cells towards six axes; false alarms as stated in `benchmarks.lights`."""
    case = next(case for case in WORLD_CASES if name in case.name)
    verdict = prove(case, QUICK)
    assert verdict.p >= FALSE_ALARM, verdict


def test_a_sun_turned_by_a_degree_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    """What the proof above can see: the whole map a little aside."""
    case = WORLD_CASES[0]
    right = world_map.world_steps

    def aside(scene, view_layer, ask):
        light = yield from right(scene, view_layer, ask)
        turned = [replace(one, longitude=(one.longitude[0] + 0.05, one.longitude[1] + 0.05)) for one in light.maps]
        return replace(light, maps=tuple(turned))

    monkeypatch.setattr("ivg_addon.blender.export.world_steps", aside)
    assert prove(case, QUICK).p < FALSE_ALARM


def test_unchanged_world_is_not_asked_again(coarse: None, monkeypatch: pytest.MonkeyPatch) -> None:
    world(sky("SINGLE_SCATTERING", disc=True))()
    first = evaluated()
    assert first is not None
    assert first.seconds > 0.0
    monkeypatch.setattr(world_map, "_render", lambda *_: pytest.fail("rendered again"))
    again = evaluated()
    assert again is not None
    assert again.seconds == 0.0
    assert again.maps is first.maps


def _node(kind: str) -> bpy.types.Node:
    return next(node for node in bpy.context.scene.world.node_tree.nodes if node.type == kind)


def _keys_of(change) -> tuple[str, str]:
    scene = bpy.context.scene
    before = world_key(scene.world, scene)
    assert world_key(scene.world, scene) == before
    change()
    return before, world_key(scene.world, scene)


def test_every_change_that_matters_makes_another_key(tmp_path: Path) -> None:
    world(sky("SINGLE_SCATTERING", disc=True))()
    tree = bpy.context.scene.world.node_tree
    background, texture = _node("BACKGROUND"), _node("TEX_SKY")
    changes = [
        lambda: setattr(background.inputs["Strength"], "default_value", 0.7),
        lambda: setattr(texture, "sun_elevation", 0.3),
        lambda: setattr(texture.texture_mapping, "rotation", (0, 0, 1)),
        lambda: setattr(texture, "mute", True),
        lambda: tree.links.clear(),
    ]
    for change in changes:
        before, after = _keys_of(change)
        assert before != after
    world(gradient)()
    ramp = _node("VALTORGB")
    before, after = _keys_of(lambda: setattr(ramp.color_ramp.elements[1], "position", 0.9))
    assert before != after
    world(picture)()
    image = _node("TEX_ENVIRONMENT").image
    before, after = _keys_of(lambda: image.pixels.foreach_set(np.zeros(len(image.pixels), np.float32)))
    assert before != after
    image.filepath_raw, image.file_format = str(tmp_path / "picture.exr"), "OPEN_EXR"
    image.save()
    image.source = "FILE"
    before, after = _keys_of(lambda: (tmp_path / "picture.exr").write_bytes(b"another"))
    assert before != after
    before, after = _keys_of(lambda: setattr(_node("BACKGROUND"), "location", (500, 0)))
    assert before == after, "where a node stands in the editor changes no light"


def test_group_inside_counts_and_its_light_path_is_replaced(coarse: None) -> None:
    """A group tells camera rays from others: the camera would see 9, diffuse rays see the sky's gradient."""
    world(gradient)()
    plain = evaluated()
    world(gradient)()
    tree = bpy.context.scene.world.node_tree
    group = bpy.data.node_groups.new("Rays", "ShaderNodeTree")
    group.interface.new_socket("Camera", in_out="OUTPUT", socket_type="NodeSocketFloat")
    path, output = group.nodes.new("ShaderNodeLightPath"), group.nodes.new("NodeGroupOutput")
    group.links.new(path.outputs["Is Camera Ray"], output.inputs[0])
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    tree.links.new(node.outputs[0], _node("MIX").inputs[0])
    before = {item.name for item in bpy.data.node_groups}
    grouped = evaluated()
    assert plain is not None
    assert grouped is not None
    assert plain.maps[0].radiance.max() < 2.0
    np.testing.assert_allclose(grouped.maps[0].radiance, plain.maps[0].radiance, rtol=1e-5)
    assert {item.name for item in bpy.data.node_groups} == before
    assert [node.type for node in group.nodes] == ["LIGHT_PATH", "GROUP_OUTPUT"]
    key = world_key(bpy.context.scene.world, bpy.context.scene)
    group.links.clear()
    assert world_key(bpy.context.scene.world, bpy.context.scene) != key


def test_one_colour_and_unseen_worlds_are_not_rendered(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(world_map, "_render", lambda *_: pytest.fail("rendered"))
    assert evaluated() is None
    bpy.context.scene.world = bpy.data.worlds.new("Grey")
    assert evaluated() is None
    world(gradient)()
    bpy.context.scene.world.cycles_visibility.diffuse = False
    assert evaluated() is None


def test_render_leaves_the_file_as_it_was(coarse: None) -> None:
    world(sky("SINGLE_SCATTERING", disc=True, size=0.1))()
    before = snapshot(bpy.context.scene)
    steps = world_steps(bpy.context.scene, bpy.context.view_layer)
    for _ in steps:
        assert snapshot(bpy.context.scene) == before
    assert snapshot(bpy.context.scene) == before


def test_cancelled_render_leaves_the_file_as_it_was(coarse: None) -> None:
    world(gradient)()
    before = snapshot(bpy.context.scene)
    steps = export_render_steps(bpy.context.scene, bpy.context.view_layer)
    assert "world" in next(steps).task
    steps.close()
    assert snapshot(bpy.context.scene) == before
    assert not world_map._known


def test_world_removed_between_steps_is_an_error_that_names_it(coarse: None) -> None:
    world(gradient)()
    steps = world_steps(bpy.context.scene, bpy.context.view_layer)
    next(steps)
    bpy.data.worlds.remove(bpy.context.scene.world)
    with pytest.raises(SceneError, match="world 'World' was removed"):
        next(steps)


def test_exported_scene_has_the_maps(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(world_map, "_WIDTH", 512)
    world(sky("SINGLE_SCATTERING", disc=True))()
    scene = finish(export_render_steps(bpy.context.scene, bpy.context.view_layer))
    assert not scene.lights.world.any()
    assert len(scene.lights.environment) == 2, "the sky, and its sun"
    assert scene.lights.world_shines
    assert scene.notices == ()


def test_missing_image_is_named(coarse: None, tmp_path: Path) -> None:
    world(picture)()
    image = bpy.data.images.new("Gone", 4, 4)
    image.source, image.filepath = "FILE", str(tmp_path / "gone.exr")
    _node("TEX_ENVIRONMENT").image = image
    assert "warning: world 'World': image 'Gone' is missing" in notices()


def test_movie_is_named_and_its_frame_counts(coarse: None) -> None:
    world(picture)()
    image = _node("TEX_ENVIRONMENT").image
    image.source = "SEQUENCE"
    assert "simplified: world 'World': image 'Picture' moves: its light is that of the current frame" in notices()
    before, after = _keys_of(lambda: bpy.context.scene.frame_set(7))
    assert before != after


def test_negative_light_is_cut_off_and_named(coarse: None) -> None:
    world(lambda tree: tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"])()
    light = evaluated()
    assert light is not None
    assert light.maps[0].radiance.min() == 0.0
    assert "simplified: world 'World': takes light away" in notices()


def test_maps_lie_as_blender_has_directions(coarse: None) -> None:
    """Colour is the direction itself: where a texel says it lies, light comes from."""
    world(lambda tree: tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"])()
    light = evaluated()
    assert light is not None
    (one,) = light.maps
    rows, columns = (0.5 * (edges[1:] + edges[:-1]) for edges in (one.row_edges, one.column_edges))
    b, turned = rows[:, None], columns[None, :]
    w = np.stack(np.broadcast_arrays(np.cos(b) * np.cos(turned), -np.cos(b) * np.sin(turned), np.sin(b)), axis=-1)
    # A texel is the mean of directions within three degrees.
    np.testing.assert_allclose(one.radiance, np.maximum(w, 0.0), atol=0.05)
