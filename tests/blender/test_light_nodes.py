# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes of lights, measured by Cycles: constants stay constants, all else becomes a pattern."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from ivg_addon.blender import light_nodes  # noqa: E402
from ivg_addon.blender.export_lights import export_lights  # noqa: E402
from ivg_addon.blender.light_nodes import NodeLight, light_node_steps  # noqa: E402
from ivg_addon.core.progress import finish  # noqa: E402

IES = """IESNA:LM-63-1995
TILT=NONE
1 1000 1 7 1 1 2 0 0 0
1 1 1
0 15 30 45 60 75 90
0
1000 900 650 850 300 50 0
"""


@pytest.fixture(autouse=True)
def _empty_session() -> Iterator[None]:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    light_nodes._known.clear()
    yield
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def lamp(kind: str, node: str, output: str, *, into: str = "Strength", **settings: object) -> bpy.types.Node:
    """Add a light at a place and turn of its own, with a node that is linked to its Emission; return the node."""
    data = bpy.data.lights.new("Key", kind)
    for name, value in settings.items():
        setattr(data, name, value)
    item = bpy.data.objects.new("Key", data)
    item.location, item.rotation_euler = (3.0, -2.0, 1.0), (0.3, -0.2, 0.5)
    bpy.context.scene.collection.objects.link(item)
    if data.node_tree is None:
        data.use_nodes = True
    tree = data.node_tree
    emission = tree.get_output_node("CYCLES").inputs["Surface"].links[0].from_node
    made = tree.nodes.new(node)
    tree.links.new(made.outputs[output], emission.inputs[into])
    return made


def found() -> dict[str, NodeLight]:
    return finish(light_node_steps(bpy.context.scene, bpy.context.view_layer))


def measured() -> NodeLight:
    (light,) = found().values()
    return light


def exported() -> tuple:
    return export_lights(bpy.context.evaluated_depsgraph_get(), evaluated=found())


KINDS = [
    ("POINT", {}),
    ("SPOT", {"spot_size": 1.2, "spot_blend": 0.3}),
    ("AREA", {"shape": "ELLIPSE", "size": 0.5, "size_y": 2.0}),
    ("AREA", {"size": 0.001, "spread": 0.3}),
    ("SUN", {"angle": 0.1}),
]


@pytest.mark.parametrize(("kind", "settings"), KINDS)
def test_a_constant_that_cycles_computes_is_a_constant(kind: str, settings: dict[str, object]) -> None:
    node = lamp(kind, "ShaderNodeMath", "Value", **settings)
    node.operation = "MULTIPLY"
    node.inputs[0].default_value, node.inputs[1].default_value = 1.5, 0.5
    light = measured()
    assert light.pattern is None
    # Single precision.
    np.testing.assert_allclose(light.colour, 0.75, rtol=1e-5)
    assert light.notices == exported()[1] == ()


def test_ies_profile_follows_its_candelas_and_the_lamp() -> None:
    node = lamp("POINT", "ShaderNodeTexIES", "Factor" if bpy.app.version < (5, 0) else "Fac")
    text = bpy.data.texts.new("Profile")
    text.write(IES)
    node.mode, node.ies = "INTERNAL", text
    factor = measured().pattern.factor
    assert factor.shape == (180, 360, 3)
    # From one angle of the file to the next; the ratios are those of its candelas.
    middle = factor[:, 0, 0].astype(float)
    angles = np.arange(180) + 0.5
    at = np.interp([15, 30, 45, 60, 75], angles, middle) / np.interp(0.5, angles, middle)
    np.testing.assert_allclose(at, np.array([900, 650, 850, 300, 50]) / 1000, rtol=0.02)
    assert not factor[91:].any()
    assert np.ptp(factor, axis=1).max() < 1e-3 * factor.max()
    lights, notices = exported()
    assert notices == ()
    np.testing.assert_array_equal(lights.point.pattern, [0])
    matrix = np.array(bpy.data.objects["Key"].matrix_world)[:3, :3]
    np.testing.assert_allclose(lights.point.axes[0], matrix, atol=1e-6)
    np.testing.assert_allclose(lights.point.cos_half_angle, [-1.0])


@pytest.mark.parametrize("size", [0.002, 3.0])
def test_area_light_shows_its_texture_coordinates(size: float) -> None:
    lamp("AREA", "ShaderNodeTexCoord", "UV", into="Color", shape="DISK", size=size, spread=1.0)
    factor = measured().pattern.factor
    ramp = (np.arange(256) + 0.5) / 256
    np.testing.assert_allclose(factor[..., 1], np.broadcast_to(ramp[:, None], (256, 256)), atol=2e-3)
    np.testing.assert_allclose(factor[..., 0], np.broadcast_to(ramp, (256, 256)), atol=2e-3)


def test_cone_of_a_spot_bounds_its_pattern() -> None:
    lamp("SPOT", "ShaderNodeTexCoord", "UV", into="Color", spot_size=1.0, spot_blend=0.2)
    bpy.data.objects["Key"].scale = (1.0, 2.0, 1.0)
    lights, _ = exported()
    np.testing.assert_allclose(lights.point.cos_half_angle, [math.cos(math.atan(2.0 * math.tan(0.5)))], rtol=1e-6)
    np.testing.assert_allclose(lights.point.axes[0].T @ lights.point.axes[0], np.eye(3), atol=1e-6)
    np.testing.assert_array_equal(lights.point.blend, [0.0])
    # Across the axis that is not stretched the cone ends earlier.
    ends = (lights.patterns[0].factor.max(axis=2) > 0.0).sum(axis=0)
    assert ends[90] > 175
    assert 90 < ends[0] < 120


def test_lamps_that_share_their_data_share_a_pattern() -> None:
    lamp("POINT", "ShaderNodeNewGeometry", "Parametric", into="Color")
    for index in range(30):
        copy = bpy.data.objects["Key"].copy()
        copy.location, copy.rotation_euler = (index, 0.0, 0.0), (0.0, 0.1 * index, 0.0)
        bpy.context.scene.collection.objects.link(copy)
    lights, _ = exported()
    assert len(lights.patterns) == 1
    np.testing.assert_array_equal(lights.point.pattern, np.zeros(31))


def test_unchanged_lights_are_not_measured_again(monkeypatch: pytest.MonkeyPatch) -> None:
    node = lamp("POINT", "ShaderNodeBlackbody", "Color", into="Color")
    count = 0
    bake = light_nodes.bake_irradiance

    def counted(*arguments: object) -> object:
        nonlocal count
        count += 1
        return bake(*arguments)

    monkeypatch.setattr(light_nodes, "bake_irradiance", counted)
    first, again = measured(), measured()
    np.testing.assert_array_equal(first.colour, again.colour)
    bpy.data.objects["Key"].location.x += 1.0
    measured()
    assert count == 1
    node.inputs[0].default_value += 1000.0
    assert (measured().colour != first.colour).any()
    assert count == 2


def test_the_file_is_left_as_it_was() -> None:
    def everything() -> list[list[str]]:
        kinds = (bpy.data.scenes, bpy.data.objects, bpy.data.lights, bpy.data.meshes, bpy.data.materials)
        return [[block.name for block in kind] for kind in kinds]

    lamp("AREA", "ShaderNodeTexCoord", "UV", into="Color")
    before = everything()
    for _ in light_node_steps(bpy.context.scene, bpy.context.view_layer):
        assert everything() == before
    assert everything() == before


@pytest.mark.parametrize(
    ("kind", "node", "output", "message"),
    [
        ("AREA", "ShaderNodeLayerWeight", "Facing", "from all sides as bright as its nodes make it straight on"),
        ("SUN", "ShaderNodeTexNoise", "Fac", "all of its disc as bright as its nodes make the middle"),
    ],
)
def test_what_a_pattern_cannot_hold_is_named(kind: str, node: str, output: str, message: str) -> None:
    made = lamp(kind, node, output)
    if kind == "SUN":
        bpy.data.lights["Key"].angle = 0.1
    assert made.outputs[output].is_linked
    texts = [str(notice) for notice in measured().notices]
    assert any(text.startswith(f"simplified: light 'Key': {message}") for text in texts)


@pytest.mark.parametrize(("output", "power"), [("Quadratic", 0), ("Linear", 1), ("Constant", 2)])
@pytest.mark.parametrize("kind", ["POINT", "AREA"])
def test_falloff_is_read(kind: str, output: str, power: int) -> None:
    node = lamp(kind, "ShaderNodeLightFalloff", output)
    node.inputs["Strength"].default_value, node.inputs["Smooth"].default_value = 3.0, 0.5
    light = measured()
    assert (light.falloff, light.smooth, light.notices) == (power, 0.5, ())
    np.testing.assert_allclose(light.colour, 3.0 / 1.5, rtol=1e-5)
    lights, _ = exported()
    one = lights.point if kind == "POINT" else lights.area
    assert (one.falloff.tolist(), one.smooth.tolist()) == ([power], [0.5])


def test_a_strength_that_is_the_distance_falls_off_linearly() -> None:
    lamp("POINT", "ShaderNodeLightPath", "Ray Length")
    light = measured()
    assert (light.falloff, light.smooth, light.notices) == (1, 0.0, ())
    np.testing.assert_allclose(light.colour, 1.0, rtol=1e-3)


@pytest.mark.parametrize(("kind", "output"), [("LightFalloff", "Linear"), ("LightPath", "Ray Length")])
def test_falloff_that_is_not_all_of_the_strength_is_named(kind: str, output: str) -> None:
    node = lamp("POINT", f"ShaderNode{kind}", output)
    tree = node.id_data
    emission = node.outputs[output].links[0].to_node
    tree.links.new(node.outputs[output], emission.inputs["Color"])
    light = measured()
    assert (light.falloff, light.smooth) == (0, 0.0)
    assert "falls off with the square of the distance" in str(light.notices[0])


def test_plain_falloff_needs_no_word() -> None:
    lamp("POINT", "ShaderNodeLightFalloff", "Quadratic").inputs[0].default_value = 3.0
    light = measured()
    np.testing.assert_allclose(light.colour, 3.0, rtol=1e-5)
    assert light.notices == ()


def test_lights_that_nodes_make_endless_or_black_are_left_out() -> None:
    node = lamp("POINT", "ShaderNodeMath", "Value")
    node.operation = "MULTIPLY"
    node.inputs[0].default_value, node.inputs[1].default_value = 1e30, 1e30
    assert "left out: light 'Key'" in str(exported()[1][0])
    node.inputs[1].default_value = 0.0
    assert str(exported()[1][0]).startswith("left out: light 'Key': emits nothing")
