# SPDX-License-Identifier: GPL-3.0-or-later
"""A grid whose scene has changed says so; what does not change the light does not."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy
import pytest

from ivg_addon.blender import storage
from ivg_addon.blender.staleness import Freshness

from .stored_grids import in_fresh_process, module

SMALL = {"photons": 2_000, "resolution": (2, 3, 4)}


@pytest.fixture
def room(extension: str, tmp_path: Path) -> Iterator[Any]:
    """Return a scene with a grid: a white room with a lamp, a camera and an empty."""
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.context.scene.world = bpy.data.worlds.new("World")
    bpy.ops.mesh.primitive_cube_add(size=4.0)
    bpy.data.meshes["Cube"].materials.append(bpy.data.materials.new("White"))
    collection = bpy.data.collections.new("Room")
    bpy.context.scene.collection.children.link(collection)
    bpy.ops.mesh.primitive_cube_add(size=1.0)
    collection.objects.link(bpy.context.object)
    bpy.context.scene.collection.objects.unlink(bpy.context.object)
    bpy.ops.object.light_add(type="POINT", location=(1.0, 1.0, 1.0))
    bpy.ops.object.camera_add()
    bpy.ops.object.empty_add()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"))
    bpy.ops.ivg.bake(**SMALL)
    bpy.context.view_layer.update()
    yield bpy.context.scene
    bpy.ops.wm.read_homefile(use_empty=True)


def state(extension: str) -> str:
    """Return what the panel tells, after Blender has evaluated what was changed."""
    bpy.context.view_layer.update()
    return str(module(extension, "staleness").freshness(bpy.context.scene).name)


def test_a_bake_is_up_to_date(extension: str, room: Any) -> None:
    assert state(extension) == "FRESH"
    assert bpy.ops.ivg.check() == {"FINISHED"}
    assert state(extension) == "FRESH"


def move_lamp() -> None:
    bpy.data.objects["Point"].location.x += 0.5


def brighten_lamp() -> None:
    bpy.data.lights["Point"].energy *= 2.0


def edit_mesh() -> None:
    bpy.data.meshes["Cube"].vertices[0].co.x -= 0.5
    bpy.data.meshes["Cube"].update()


def new_material() -> None:
    material = bpy.data.materials.new("Red")
    material.diffuse_color = (1.0, 0.0, 0.0, 1.0)
    bpy.data.meshes["Cube"].materials.append(material)


def add_cube() -> None:
    bpy.ops.mesh.primitive_cube_add(size=1.0)


def delete_lamp() -> None:
    bpy.data.objects.remove(bpy.data.objects["Point"])


def hide_from_renders() -> None:
    bpy.data.objects["Cube"].hide_render = True


def hide_collection() -> None:
    bpy.data.collections["Room"].hide_render = True


def exclude_collection() -> None:
    bpy.context.view_layer.layer_collection.children["Room"].exclude = True


def let_light_through() -> None:
    bpy.data.objects["Cube"].visible_shadow = False


def colour_surface() -> None:
    material = bpy.data.meshes["Cube"].materials[0]
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (1.0, 0.0, 0.0, 1.0)


def colour_world() -> None:
    bpy.context.scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 3.0


def subdivide() -> None:
    bpy.data.objects["Cube"].modifiers.new("Subdivision", "SUBSURF")


def new_world() -> None:
    bpy.context.scene.world = bpy.data.worlds.new("Sky")


@pytest.mark.parametrize(
    "edit",
    [
        *(move_lamp, brighten_lamp, edit_mesh, new_material, colour_surface, add_cube, delete_lamp, subdivide),
        *(hide_from_renders, hide_collection, exclude_collection, let_light_through, new_world, colour_world),
    ],
)
def test_what_could_change_the_light_marks_the_grid(extension: str, room: Any, edit: Callable[[], None]) -> None:
    edit()
    assert state(extension) == "CHANGED"


def test_the_check_tells_whether_the_light_did_change(extension: str, room: Any) -> None:
    move_lamp()
    bpy.ops.ivg.check()
    assert state(extension) == "STALE"
    bpy.data.objects["Point"].location.x -= 0.5
    assert state(extension) == "CHANGED"
    bpy.ops.ivg.check()
    assert state(extension) == "FRESH"
    move_lamp()
    bpy.ops.ivg.bake(**SMALL)
    assert state(extension) == "FRESH"


def move_camera() -> None:
    bpy.data.objects["Camera"].location.x += 1.0


def move_empty() -> None:
    bpy.data.objects["Empty"].location.x += 1.0


def select() -> None:
    bpy.data.objects["Cube"].select_set(False)
    bpy.context.view_layer.objects.active = bpy.data.objects["Point"]


def change_settings() -> None:
    bpy.context.scene.ivg.photons = 7
    bpy.context.scene.render.resolution_x = 7


def export() -> None:
    bpy.ops.ivg.export_vdb(filepath="//room.vdb")


def restore() -> None:
    bpy.ops.ivg.restore()


def save() -> None:
    bpy.ops.wm.save_mainfile()


@pytest.mark.parametrize("act", [move_camera, move_empty, select, change_settings, export, restore, save])
def test_what_cannot_change_the_light_does_not(extension: str, room: Any, act: Callable[[], None]) -> None:
    act()
    assert state(extension) == "FRESH"


def test_a_failed_bake_leaves_what_is_known(extension: str, room: Any) -> None:
    move_lamp()
    with pytest.raises(RuntimeError):
        bpy.ops.ivg.bake(photons=1_000, resolution=(1024, 1024, 1024))
    assert state(extension) == "CHANGED"


def test_edits_during_a_bake_count(extension: str, room: Any) -> None:
    jobs, bake_job = module(extension, "jobs"), module(extension, "bake_job")
    job = bake_job.bake_job(bpy.context, SMALL, jobs.in_foreground)
    while "Tracing" not in job.progress.task:
        job.advance(0.0)
    move_lamp()
    bpy.context.view_layer.update()
    jobs.run_blocking(job, lambda progress: None)
    assert state(extension) == "CHANGED"


def test_a_grid_of_another_bake_is_compared_with_the_same_export(extension: str, room: Any) -> None:
    first = room.ivg.grid
    move_lamp()
    bpy.ops.ivg.bake(grid="Second", **SMALL)
    assert room.ivg.grid.name == "Second"
    assert state(extension) == "FRESH"
    room.ivg.grid = first
    assert state(extension) == "STALE"


def test_without_a_grid_nothing_is_told(extension: str, room: Any) -> None:
    bpy.ops.ivg.grid_remove()
    assert module(extension, "staleness").freshness(room) is None


def test_what_is_known_is_saved_and_the_scene_is_still_the_same(extension: str, room: Any) -> None:
    """The checksum of the scene is the same in another process, and so is the grid's image."""
    bpy.ops.wm.save_mainfile()
    code = """
from ivg_addon.blender import jobs, staleness
from ivg_addon.blender.check_job import check_job
bpy.ops.wm.open_mainfile(filepath=arguments[0])
before = staleness.freshness(bpy.context.scene)
job = check_job(bpy.context, jobs.in_foreground)
jobs.run_blocking(job, lambda progress: None)
print(before.name, job.message)
"""
    told = in_fresh_process(code, bpy.data.filepath)
    assert told == f"FRESH IVG Scene: {Freshness.FRESH.value}"
    move_lamp()
    bpy.context.view_layer.update()
    bpy.ops.wm.save_mainfile()
    told = in_fresh_process(code, bpy.data.filepath)
    assert told == f"CHANGED IVG Scene: {Freshness.STALE.value}"


def test_bakes_go_to_the_scenes_grid_unless_told_otherwise(extension: str, room: Any, tmp_path: Path) -> None:
    first = room.ivg.grid
    assert first.name == "IVG Scene"
    bpy.ops.ivg.bake(seed=1, **SMALL)
    assert storage.grids(bpy.data) == [first]
    room.ivg.grid = None
    bpy.ops.ivg.bake(**SMALL)
    assert [image.name for image in storage.grids(bpy.data)] == ["IVG Scene", "IVG Scene.001"]
    assert {path.name for path in tmp_path.glob("*.npz")} == {"room.ivg.npz", "room.IVG_Scene_001.ivg.npz"}
    for image in storage.grids(bpy.data):
        assert storage.problem(image) == ""
        storage.load_grid(image)


def test_a_cancelled_bake_leaves_datablocks_and_files(extension: str, room: Any, tmp_path: Path) -> None:
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    jobs, bake_job = module(extension, "jobs"), module(extension, "bake_job")
    job = bake_job.bake_job(bpy.context, SMALL | {"seed": 1}, jobs.in_foreground)
    while job.progress.task != "Writing the grid" or job.progress.fraction < 1.0:
        job.advance(0.0)
    job.advance(0.0)
    job.cancel()
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    assert storage.load_grid(room.ivg.grid).record.settings.seed == 0


def test_a_grid_deleted_during_a_bake_is_made_anew(extension: str, room: Any) -> None:
    jobs, bake_job = module(extension, "jobs"), module(extension, "bake_job")
    job = bake_job.bake_job(bpy.context, SMALL | {"seed": 1}, jobs.in_foreground)
    while "Tracing" not in job.progress.task:
        job.advance(0.0)
    bpy.ops.ivg.grid_remove()
    jobs.run_blocking(job, lambda progress: None)
    assert storage.load_grid(room.ivg.grid).record.settings.seed == 1


def test_a_grid_deleted_during_a_comparison_or_check(extension: str, room: Any) -> None:
    """A comparison has read the grid by then; a check has nothing left to tell of."""
    jobs = module(extension, "jobs")
    job = module(extension, "check_job").check_job(bpy.context, jobs.in_foreground)
    job.advance(0.0)
    bpy.ops.ivg.grid_remove()
    with pytest.raises(Exception, match="was removed while it was checked"):
        jobs.run_blocking(job, lambda progress: None)


def test_a_grid_too_large_for_an_image_stays_in_its_file(
    extension: str, room: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import importlib

    bpy.ops.ivg.grid_remove()
    atlas = importlib.import_module(f"{extension}.ivg_addon.core.grid_atlas")
    monkeypatch.setattr(atlas, "LARGEST_SIDE", 16)
    bpy.ops.ivg.bake(**SMALL)
    (notice,) = (n for n in room.ivg.last_bake.notices if "its grid is in its file" in n.message)
    assert (notice.kind, notice.subject) == ("left out", "scene 'Scene'")
    assert room.ivg.grid is None
    assert (tmp_path / "room.ivg.npz").is_file()
