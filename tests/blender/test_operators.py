# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators, blocking as scripts call them, in a closed room with a lamp."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from ivg_addon.core import IrradianceVectorGrid

SMALL = {"photons": 2_000, "resolution": (2, 3, 4)}


@pytest.fixture
def room(extension: str, tmp_path: Path) -> Iterator[Any]:
    """Return a scene: a white room around the origin, four metres wide, with a lamp."""
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.mesh.primitive_cube_add(size=4.0)
    bpy.ops.object.light_add(type="POINT")
    scene = bpy.context.scene
    scene.ivg.filepath = str(tmp_path / "room.ivg.npz")
    yield scene
    bpy.ops.wm.read_homefile(use_empty=True)


def files(folder: Path) -> dict[str, bytes]:
    """Return every file of a folder, hidden ones too."""
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def summary(scene: Any) -> dict[str, Any]:
    """Return what a scene keeps of its last bake."""
    last_bake = scene.ivg.last_bake
    return {
        "filepath": last_bake.filepath,
        "rows": [(row.name, row.value) for row in last_bake.rows],
        "notices": [notice.name for notice in last_bake.notices],
    }


def test_bake_writes_the_grid_and_remembers_what_it_did(room: Any, tmp_path: Path) -> None:
    assert bpy.ops.ivg.bake(**SMALL) == {"FINISHED"}
    assert set(files(tmp_path)) == {"room.ivg.npz", "room.ivg.vdb"}
    grid = IrradianceVectorGrid.load(tmp_path / "room.ivg.npz")
    assert grid.resolution == (2, 3, 4)
    assert grid.record.settings.photons == 2_000
    assert grid.vectors.any()
    np.testing.assert_allclose([grid.bounds_min, grid.bounds_max], [[-2] * 3, [2] * 3], atol=1e-6)
    kept = summary(room)
    assert kept["filepath"] == str(tmp_path / "room.ivg.npz")
    assert dict(kept["rows"])["Grid"].startswith("2 × 3 × 4 voxels")


def test_overrides_are_for_one_call(room: Any, tmp_path: Path) -> None:
    room.ivg.photons = 1_000
    room.ivg.longest_side = 3
    bpy.ops.ivg.bake(seed=5, filepath=str(tmp_path / "other"), **SMALL)
    bpy.ops.ivg.bake()
    first = IrradianceVectorGrid.load(tmp_path / "other.ivg.npz").record.settings
    second = IrradianceVectorGrid.load(tmp_path / "room.ivg.npz").record.settings
    assert (first.seed, first.photons, first.resolution) == (5, 2_000, (2, 3, 4))
    assert (second.seed, second.photons, second.resolution) == (0, 1_000, (3, 3, 3))
    assert room.ivg.photons == 1_000


def test_bounds_as_numbers_and_as_an_object(room: Any, tmp_path: Path) -> None:
    bpy.ops.ivg.bake(bounds_min=(-1, -1, -1), bounds_max=(1, 0, 1), **SMALL)
    grid = IrradianceVectorGrid.load(tmp_path / "room.ivg.npz")
    assert (*grid.bounds_min, *grid.bounds_max) == (-1, -1, -1, 1, 0, 1)
    box = bpy.data.objects.new("Box", None)
    box.empty_display_size = 0.5
    box.location = (1, 0, 0)
    room.collection.objects.link(box)
    room.ivg.margin = 0.25
    bpy.ops.ivg.bake(bounds_object="Box", **SMALL)
    grid = IrradianceVectorGrid.load(tmp_path / "room.ivg.npz")
    assert (*grid.bounds_min, *grid.bounds_max) == (0.25, -0.75, -0.75, 1.75, 0.75, 0.75)


def test_scene_box_is_that_of_the_triangles_that_are_baked(room: Any, tmp_path: Path) -> None:
    """A turned room: what the panel shows before a bake is what the bake then fills."""
    bpy.data.objects["Cube"].rotation_euler = (0.3, 0.2, 0.1)
    bounds = importlib.import_module("ivg_addon.blender.bounds")
    shown = bounds.scene_box(bpy.context.evaluated_depsgraph_get())
    bpy.ops.ivg.bake(**SMALL)
    grid = IrradianceVectorGrid.load(tmp_path / "room.ivg.npz")
    np.testing.assert_allclose([shown.low, shown.high], [grid.bounds_min, grid.bounds_max], atol=1e-5)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"bounds_min": (0, 0, 0), "bounds_max": (0, 1, 1)}, "bounds are empty along x"),
        ({"bounds_min": (0, 0, 0)}, "bounds need both corners"),
        ({"bounds_object": "Nobody"}, "there is no object 'Nobody'"),
        ({"bounds_object": "Point"}, "is a light"),
        ({"bounds_mode": "OBJECT"}, "no bounds object is chosen"),
        ({"filepath": "/nowhere/room.ivg.npz"}, "cannot write /nowhere/room.ivg.npz"),
        ({"resolution": (1024, 1024, 1024)}, "of memory"),
    ],
)
def test_a_failed_bake_leaves_the_last_one(room: Any, tmp_path: Path, overrides: dict[str, Any], message: str) -> None:
    bpy.ops.ivg.bake(**SMALL)
    before = files(tmp_path), summary(room)
    with pytest.raises(RuntimeError, match=message) as raised:
        bpy.ops.ivg.bake(**SMALL | overrides)
    assert len(str(raised.value).strip().splitlines()) == 1
    assert (files(tmp_path), summary(room)) == before


def test_nothing_to_bake_is_said(room: Any, tmp_path: Path) -> None:
    bpy.data.objects["Cube"].hide_render = True
    with pytest.raises(RuntimeError, match="show it in renders"):
        bpy.ops.ivg.bake(**SMALL)
    assert files(tmp_path) == {}


@pytest.mark.parametrize("task", ["Evaluating", "Placing", "Preparing", "Tracing", "Measuring", "Writing"])
def test_cancel_at_any_time_leaves_the_last_bake(extension: str, room: Any, tmp_path: Path, task: str) -> None:
    bpy.ops.ivg.bake(**SMALL)
    before = files(tmp_path), summary(room)
    jobs = importlib.import_module(f"{extension}.ivg_addon.blender.jobs")
    bake_job = importlib.import_module(f"{extension}.ivg_addon.blender.bake_job")
    job = bake_job.bake_job(bpy.context, SMALL | {"seed": 1}, jobs.in_foreground)
    while task not in job.progress.task:
        assert job.running, f"never came to {task}"
        job.advance(0.0)
    job.cancel()
    assert (files(tmp_path), summary(room)) == before


def test_a_removed_scene_fails_and_leaves_the_file(extension: str, room: Any, tmp_path: Path) -> None:
    bpy.ops.ivg.bake(**SMALL)
    before = files(tmp_path)
    jobs = importlib.import_module(f"{extension}.ivg_addon.blender.jobs")
    bake_job = importlib.import_module(f"{extension}.ivg_addon.blender.bake_job")
    job = bake_job.bake_job(bpy.context, SMALL | {"seed": 1}, jobs.in_foreground)
    while "Tracing" not in job.progress.task:
        job.advance(0.0)
    bpy.context.window.scene = bpy.data.scenes.new("Other")
    bpy.data.scenes.remove(room)
    with pytest.raises(Exception, match="was removed while it was baked"):
        jobs.run_blocking(job, lambda progress: None)
    assert files(tmp_path) == before


def test_a_bounds_object_that_was_deleted_is_not_used(room: Any) -> None:
    """The setting keeps the object alive after it has left the scene."""
    bpy.ops.ivg.bounds_add()
    bpy.ops.object.delete()
    assert room.ivg.bounds_object is not None
    with pytest.raises(RuntimeError, match="'IVG Bounds' is not in scene"):
        bpy.ops.ivg.bake(**SMALL)


def test_compare_needs_a_bake_and_a_camera(room: Any) -> None:
    assert not bpy.ops.ivg.compare.poll()
    bpy.ops.ivg.bake(**SMALL)
    assert not bpy.ops.ivg.compare.poll()


def test_compare_writes_the_picture_and_keeps_the_numbers(room: Any, tmp_path: Path) -> None:
    bpy.ops.object.camera_add(location=(0, 0, 1))
    room.camera = bpy.context.object
    room.render.resolution_x = room.render.resolution_y = 8
    room.cycles.samples = 2
    bpy.ops.ivg.bake(**SMALL)
    assert bpy.ops.ivg.compare() == {"FINISHED"}
    assert set(files(tmp_path)) == {"room.ivg.npz", "room.ivg.vdb", "room.compare.png", "room.compare.exr"}
    kept = {row.name: row.value for row in room.ivg.last_compare.rows}
    assert "relative RMSE" in kept["Error"]
    assert room.ivg.last_compare.filepath == str(tmp_path / "room.compare.png")
    bpy.ops.ivg.bake(**SMALL)
    assert not room.ivg.last_compare.rows, "the numbers of the grid before are not this one's"


def test_compare_reads_the_grid_that_the_blend_keeps(room: Any, tmp_path: Path) -> None:
    """The file may be gone; an image that was painted on is named."""
    bpy.ops.object.camera_add(location=(0, 0, 1))
    room.camera = bpy.context.object
    room.render.resolution_x = room.render.resolution_y = 8
    room.cycles.samples = 2
    bpy.ops.ivg.bake(**SMALL)
    (tmp_path / "room.ivg.npz").unlink()
    assert bpy.ops.ivg.compare() == {"FINISHED"}
    room.ivg.grid.pixels[0] = 1.0
    with pytest.raises(RuntimeError, match="image 'IVG Scene' was painted on or changed"):
        bpy.ops.ivg.compare()
    bpy.ops.ivg.grid_remove()
    with pytest.raises(RuntimeError, match="does not exist"):
        bpy.ops.ivg.compare()


def test_bounds_add_fits_an_empty_to_the_scene(room: Any) -> None:
    assert bpy.ops.ivg.bounds_add() == {"FINISHED"}
    added = room.ivg.bounds_object
    assert (room.ivg.bounds_mode, room.ivg.show_bounds) == ("OBJECT", True)
    assert (added.type, added.empty_display_type) == ("EMPTY", "CUBE")
    assert bpy.context.selected_objects == [added] == [bpy.context.object]
    bounds = importlib.import_module("ivg_addon.blender.bounds")
    depsgraph = bpy.context.evaluated_depsgraph_get()
    assert bounds.object_box(added, depsgraph) == bounds.scene_box(depsgraph)


def test_bounds_add_without_a_surface_says_so(room: Any) -> None:
    bpy.data.objects.remove(bpy.data.objects["Cube"])
    with pytest.raises(RuntimeError, match="no surface that is rendered"):
        bpy.ops.ivg.bounds_add()


def test_clear_forgets_the_bake_but_not_its_file(room: Any, tmp_path: Path) -> None:
    assert not bpy.ops.ivg.clear.poll()
    bpy.ops.ivg.bake(**SMALL)
    assert bpy.ops.ivg.clear() == {"FINISHED"}
    assert summary(room) == {"filepath": "", "rows": [], "notices": []}
    assert set(files(tmp_path)) == {"room.ivg.npz", "room.ivg.vdb"}


def test_grid_is_kept_beside_the_blend_under_its_name(room: Any, tmp_path: Path) -> None:
    room.ivg.filepath = ""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "house.blend"))
    bpy.ops.ivg.bake(**SMALL)
    assert (tmp_path / "house.ivg.npz").is_file()
    assert room.ivg.last_bake.filepath == "//house.ivg.npz"


def test_unsaved_blend_keeps_its_grid_in_the_users_folder(extension: str, room: Any) -> None:
    room.ivg.filepath = ""
    bpy.ops.ivg.bake(**SMALL)
    path = Path(room.ivg.last_bake.filepath)
    assert path.name == "unsaved.ivg.npz"
    assert path.is_file()
    assert path.is_relative_to(bpy.utils.extension_path_user(extension))


@pytest.mark.parametrize(
    ("size", "longest", "expected"),
    [
        ((2.0, 2.0, 2.0), 24, (24, 24, 24)),
        ((4.0, 2.0, 1.0), 20, (20, 10, 5)),
        ((100.0, 1.0, 0.1), 10, (10, 1, 1)),
        ((1.0, 1.0, 1.0), 1024, (124, 124, 124)),
    ],
)
def test_automatic_resolution(size: Any, longest: int, expected: tuple[int, int, int]) -> None:
    bounds = importlib.import_module("ivg_addon.blender.bounds")
    assert bounds.automatic_resolution(size, longest) == expected
    assert np.prod(np.add(expected, 1)) <= bounds.AUTOMATIC_VERTICES
