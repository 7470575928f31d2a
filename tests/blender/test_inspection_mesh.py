# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that show a grid: what they hold, what a render makes of them, and that they are no part of the scene."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.blender import storage
from ivg_addon.blender.bounds import scene_box
from ivg_addon.blender.cycles_stage import cycles_stage
from ivg_addon.core import inspection
from ivg_addon.core.exr import read_exr
from ivg_addon.core.false_color import light_colors, linear, luminance
from ivg_addon.core.inspection_slice import Quantity, sample_slice, slice_surface
from ivg_addon.core.settings import Spatial
from tests.core.grids import LATTICE, UNIFORM, grid, own_weights

from .export_scenes import add_object, cube_mesh, empty_scene
from .stored_grids import module, store

KINDS = ("SPHERES", "ARROWS", "SLICE")
SIDE = 32


@pytest.fixture
def scene(extension: str, tmp_path: Path) -> Iterator[bpy.types.Scene]:
    """Return a scene with a grid: light of radiance 1 + x/5 in three colours."""
    made = empty_scene()
    ramp = 1.0 + 0.2 * LATTICE.vertex_positions()[..., 0]
    colors = np.array((1.0, 0.5, 0.25))[:, None]
    tilted = UNIFORM * colors + np.array((0.3, 0.2, -0.1))
    store(extension, "Room", grid(tilted * ramp[..., None, None, None], lit_weights=own_weights()), tmp_path)
    yield made
    bpy.ops.wm.read_homefile(use_empty=True)


def made_objects() -> dict[str, bpy.types.Object]:
    return {shown["ivg"]["kind"]: shown for shown in bpy.data.objects if shown.get("ivg")}


def read(mesh: bpy.types.Mesh, name: str) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return a mesh's positions and colours, (n, 3) each."""
    positions = np.empty((len(mesh.vertices), 3), dtype=np.float32)
    mesh.vertices.foreach_get("co", positions.reshape(-1))
    colors = np.empty((len(mesh.vertices), 4), dtype=np.float32)
    mesh.color_attributes[name].data.foreach_get("color", colors.reshape(-1))
    return positions, colors[:, :3]


def test_meshes_hold_the_irradiance(scene: bpy.types.Scene) -> None:
    """What is not given is as the panel has it."""
    scene.ivg.inspection.every, scene.ivg.inspection.vectors = 2, "NZ"
    for kind in KINDS:
        assert bpy.ops.ivg.inspection_mesh(kind=kind, sphere_size=0.25, slice_axis="X", quantity="PY") == {"FINISHED"}
    baked = storage.load_grid(scene.ivg.grid)
    vertices = inspection.choose_vertices(baked, 2, 1000)
    expected = {
        "SPHERES": inspection.spheres(baked, vertices, 0.25),
        "ARROWS": inspection.arrows(baked, vertices, inspection.Vectors.NZ, 1.0),
        "SLICE": slice_surface(sample_slice(baked, 0, 0.5, Quantity.PY, Spatial.TRILINEAR)),
    }
    for kind, shown in made_objects().items():
        positions, values = read(shown.data, "irradiance")
        np.testing.assert_array_equal(positions, expected[kind].positions)
        np.testing.assert_array_equal(values, expected[kind].values)
        assert len(shown.data.polygons) == len(expected[kind].faces)
        assert shown.visible_camera
        assert not any(getattr(shown, f"visible_{ray}") for ray in ("diffuse", "glossy", "transmission", "shadow"))
    assert set(made_objects()) == set(KINDS)
    assert [shown.name for shown in bpy.data.collections["IVG Inspection"].objects] == [
        "Room Spheres",
        "Room Arrows",
        "Room Slice",
    ]


def test_made_again_it_replaces_the_earlier_one(extension: str, scene: bpy.types.Scene, tmp_path: Path) -> None:
    bpy.ops.ivg.inspection_mesh(kind="SPHERES")
    bpy.ops.ivg.inspection_mesh(kind="SLICE")
    shown = made_objects()["SPHERES"]
    shown.location.x = 7.0
    first = len(shown.data.vertices)
    bpy.ops.ivg.inspection_mesh(kind="SPHERES", every=3)
    counts = len(bpy.data.objects), len(bpy.data.meshes), len(bpy.data.materials), len(bpy.data.collections)
    assert counts == (2, 2, 2, 1)
    assert (made_objects()["SPHERES"], shown.location.x) == (shown, 7.0)
    assert 0 < len(shown.data.vertices) < first
    assert (shown.data.name, shown.data.materials[0].name) == ("Room Spheres", "Room Spheres")
    store(extension, "Other", grid(UNIFORM), tmp_path)
    bpy.ops.ivg.inspection_mesh(kind="SPHERES")
    assert {found.name for found in bpy.data.objects} == {"Room Spheres", "Room Slice", "Other Spheres"}


def test_undo_takes_it_away(scene: bpy.types.Scene) -> None:
    bpy.ops.ed.undo_push(message="before")
    bpy.ops.ivg.inspection_mesh(kind="SLICE")
    bpy.ops.ed.undo_push(message="made")
    bpy.ops.ed.undo()
    assert (len(bpy.data.objects), len(bpy.data.meshes), len(bpy.data.materials)) == (0, 0, 0)
    bpy.ops.ed.redo()
    assert set(made_objects()) == {"SLICE"}


def test_without_light_or_an_intact_grid_it_says_so(extension: str, scene: bpy.types.Scene, tmp_path: Path) -> None:
    scene.ivg.grid.pixels[0] = 3.0
    with pytest.raises(RuntimeError, match="was painted on or changed"):
        bpy.ops.ivg.inspection_mesh(kind="SLICE")
    store(extension, "Dark", grid(UNIFORM, 0.0), tmp_path)
    for kind in KINDS:
        with pytest.raises(RuntimeError, match="'Dark' has nothing to show there"):
            bpy.ops.ivg.inspection_mesh(kind=kind)
    assert not bpy.data.objects
    scene.ivg.grid = None
    assert not bpy.ops.ivg.inspection_mesh.poll()


@pytest.mark.parametrize("look", [{}, {"false_color": True}, {"quantity": "LIT"}])
def test_cycles_renders_it_as_bright_as_told(scene: bpy.types.Scene, tmp_path: Path, look: dict[str, Any]) -> None:
    """Without the extension: light of 1 + x/5 grows to the right, at one stop less than the mean's grey."""
    bpy.ops.ivg.inspection_mesh(kind="SLICE", slice_axis="Z", exposure=-1.0, **({"quantity": "PZ"} | look))
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", 0.5
    scene.camera = add_object("Camera", camera, location=(0.5, 2.5, 9.0))
    scene.render.resolution_x = scene.render.resolution_y = SIDE
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(tmp_path / "a.exr")
    bpy.ops.render.render(write_still=True)
    channels = read_exr(tmp_path / "a.exr")
    found = np.stack([channels[name] for name in "RGB"], axis=-1)[SIDE // 2]
    baked = storage.load_grid(scene.ivg.grid)
    x = 0.5 + ((np.arange(SIDE) + 0.5) / SIDE - 0.5) * 0.5
    points = np.stack([x, np.full(SIDE, 2.5), np.full(SIDE, 2.25)], axis=-1)
    light = baked.irradiance(points, np.broadcast_to((0.0, 0.0, 1.0), points.shape))
    light *= inspection.gain(inspection.mean_irradiance(baked), -1.0)
    if "quantity" in look:
        np.testing.assert_allclose(found, 1.0, rtol=1e-5)
    elif look:
        # The ramp of nine colours is linear between them where display colours are.
        np.testing.assert_allclose(found, linear(light_colors(luminance(light))), atol=0.01)
    else:
        # A pixel's filter is a few pixels wide, of 1.6 cm.
        np.testing.assert_allclose(found, light, rtol=0.01)


def test_it_is_no_part_of_the_scene(extension: str, tmp_path: Path) -> None:
    """Bakes, checks, the automatic bounds and comparisons go on as if it were not there."""
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    add_object("Cube", cube_mesh(size=4.0))
    add_object("Lamp", bpy.data.lights.new("Lamp", "POINT"), location=(1.0, 2.0, 3.0))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"))
    bpy.ops.ivg.bake(photons=2_000, resolution_mode="MANUAL", resolution=(2, 3, 4))
    staleness, before = module(extension, "staleness"), storage.load_grid(scene.ivg.grid)
    bpy.context.view_layer.update()
    box = scene_box(bpy.context.evaluated_depsgraph_get())
    assert staleness.freshness(scene).name == "FRESH"
    for kind in KINDS:
        bpy.ops.ivg.inspection_mesh(kind=kind, sphere_size=3.0, arrow_size=9.0)
    assert scene_box(bpy.context.evaluated_depsgraph_get()) == box
    shown = made_objects()["SPHERES"]
    for edit in (
        lambda: None,
        lambda: setattr(shown.location, "x", 1.0),
        lambda: setattr(shown, "hide_render", True),
        lambda: setattr(shown, "hide_render", False),
        lambda: shown.active_material.node_tree.nodes["Emission"].inputs["Strength"].__setattr__("default_value", 9.0),
        lambda: scene.collection.objects.link(shown),
        lambda: bpy.data.collections["IVG Inspection"].objects.unlink(shown),
        lambda: bpy.data.objects.remove(made_objects()["ARROWS"]),
    ):
        edit()
        bpy.context.view_layer.update()
        assert staleness.freshness(scene).name == "FRESH"
    with cycles_stage(scene, bpy.context.view_layer, samples=1, bounces=1, seed=0):
        assert shown.hide_render
    assert not shown.hide_render
    bpy.ops.ivg.bake(photons=2_000, resolution_mode="MANUAL", resolution=(2, 3, 4))
    after = storage.load_grid(scene.ivg.grid)
    assert after.record.checksum == before.record.checksum
    np.testing.assert_array_equal(after.vectors, before.vectors)
    assert staleness.freshness(scene).name == "FRESH"
    bpy.ops.wm.read_homefile(use_empty=True)
