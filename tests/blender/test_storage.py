# SPDX-License-Identifier: GPL-3.0-or-later
"""Grids in a .blend: the same bits after saving, appending, linking and undo; whatever else becomes of them is said."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from ivg_addon.blender import grid_image, storage
from ivg_addon.core import IrradianceVectorGrid, vdb_grid
from ivg_addon.core.errors import GridFileError
from ivg_addon.core.grid_parts import digest

from .stored_grids import in_fresh_process, module, random_grid, store

Image = bpy.types.Image


@pytest.fixture
def file(extension: str, tmp_path: Path) -> Iterator[Path]:
    """Return the path of an empty .blend that is open."""
    bpy.ops.wm.read_homefile(use_empty=True)
    path = tmp_path / "room.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    yield path
    bpy.ops.wm.read_homefile(use_empty=True)


@pytest.fixture
def image(extension: str, file: Path) -> Image:
    """Return the image of a grid."""
    return store(extension, "Room", random_grid(), file.parent)


def assert_same(a: IrradianceVectorGrid, b: IrradianceVectorGrid) -> None:
    for name in ("vectors", "validity", "lit_weights"):
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes()
    assert (a.lattice, a.record) == (b.lattice, b.record)


def refused(image: Image) -> str:
    """Return the one line with which a grid is refused, and that tells the cure."""
    with pytest.raises(GridFileError) as caught:
        storage.load_grid(image)
    message = str(caught.value)
    assert "\n" not in message
    assert "'Room'" in message
    return message


# --- What is stored comes back ----------------------------------------------------------------------------------------


def test_the_grid_comes_back_to_the_bit(image: Image) -> None:
    back = storage.load_grid(image)
    assert_same(back, random_grid())
    points = np.random.default_rng(1).uniform(back.bounds_min, back.bounds_max, (20, 3))
    np.testing.assert_array_equal(back.irradiance(points, points), random_grid().irradiance(points, points))
    assert storage.grids(bpy.data) == [image]
    assert storage.problem(image) == ""


def test_what_shaders_read_is_floats_and_packed(image: Image) -> None:
    assert (image.is_float, image.depth, image.use_half_precision) == (True, 96, False)
    assert (image.colorspace_settings.name, image.alpha_mode) == ("Non-Color", "NONE")
    assert image.packed_file is not None
    assert image.use_fake_user, "Blender does not save what nothing uses"


SAVED = "bpy.ops.wm.open_mainfile(filepath=arguments[0]); image = bpy.data.images['Room']\n"
OTHER = """
bpy.ops.wm.read_homefile(use_empty=True)
with bpy.data.libraries.load(arguments[0], link=LINK, relative=True) as (there, here):
    here.images = ['Room']
image = bpy.data.images['Room']
image.use_fake_user = not LINK
bpy.context.scene.ivg.grid = image
bpy.ops.wm.save_as_mainfile(filepath=arguments[1])
bpy.ops.wm.open_mainfile(filepath=arguments[1])
image = bpy.data.images['Room']
"""
TELL = "print(digest(storage.load_grid(image)), storage.problem(image) or 'intact')\n"


@pytest.mark.parametrize(
    "code", [SAVED, OTHER.replace("LINK", "False"), OTHER.replace("LINK", "True")], ids=["saved", "appended", "linked"]
)
def test_saved_appended_and_linked_grids_are_the_same_to_the_bit(image: Image, file: Path, code: str) -> None:
    bpy.ops.wm.save_mainfile()
    elsewhere = file.parent / "elsewhere"
    elsewhere.mkdir()
    assert in_fresh_process(code + TELL, file, elsewhere / "other.blend") == f"{digest(random_grid())} intact"


def test_an_appended_scene_brings_its_grid_and_volume(image: Image, file: Path) -> None:
    bpy.ops.wm.save_mainfile()
    code = """
bpy.ops.wm.read_homefile(use_empty=True)
with bpy.data.libraries.load(arguments[0]) as (there, here):
    here.scenes = there.scenes
image = here.scenes[0].ivg.grid
print(digest(storage.load_grid(image)), storage.problem(image) or 'intact', [v.name for v in bpy.data.volumes])
"""
    assert in_fresh_process(code, file) == f"{digest(random_grid())} intact ['Room']"


def test_blend_and_volume_file_can_move_together(image: Image, file: Path) -> None:
    bpy.ops.wm.save_mainfile()
    assert bpy.data.volumes["Room"].filepath == "//room.ivg.vdb"
    moved = file.parent / "moved"
    moved.mkdir()
    for path in (file, file.with_name("room.ivg.vdb")):
        path.rename(moved / path.name)
    assert in_fresh_process(SAVED + TELL, moved / file.name).endswith(" intact")


def test_two_grids_each_have_a_name_and_a_file(extension: str, image: Image, file: Path) -> None:
    other = store(extension, "Hall", random_grid(1), file.parent)
    assert storage.grids(bpy.data) == [other, image]
    assert bpy.context.scene.ivg.grid == other
    assert_same(storage.load_grid(image), random_grid(0))
    assert_same(storage.load_grid(other), random_grid(1))
    assert storage.problem(image) == storage.problem(other) == ""
    assert {path.name for path in file.parent.glob("*.vdb")} == {"room.ivg.vdb", "room.2.ivg.vdb"}


# --- Storing again, undo, deleting ------------------------------------------------------------------------------------


def test_storing_again_keeps_the_datablocks_and_their_users(extension: str, image: Image, file: Path) -> None:
    volume = bpy.data.volumes["Room"]
    again = store(extension, "Room", random_grid(1), file.parent)
    assert (again, list(bpy.data.volumes)) == (image, [volume])
    assert_same(storage.load_grid(image), random_grid(1))
    assert storage.problem(image) == ""


def test_the_file_before_goes_when_the_blend_is_saved(extension: str, image: Image, file: Path) -> None:
    """Until then the .blend on disk needs it, and undo."""
    bpy.ops.wm.save_mainfile()
    store(extension, "Room", random_grid(1), file.parent)
    bpy.ops.wm.save_as_mainfile(filepath=str(file.with_name("copy.blend")), copy=True)
    assert {path.name for path in file.parent.glob("*.vdb")} == {"room.ivg.vdb", "room.2.ivg.vdb"}
    bpy.ops.wm.save_mainfile()
    assert {path.name for path in file.parent.glob("*.vdb")} == {"room.2.ivg.vdb"}


def test_blender_reads_the_new_volume_after_storing_again(extension: str, image: Image, file: Path) -> None:
    """Of a path that it has read, Blender keeps what it read."""
    volume = bpy.data.volumes["Room"]
    assert volume.grids.load()
    assert len(volume.grids) == 18 + 6 + 2 + 15
    before = volume.filepath
    store(extension, "Room", random_grid(1), file.parent)
    assert volume.filepath != before


def test_undo_and_redo_bring_back_either_grid(extension: str, image: Image, file: Path) -> None:
    bpy.ops.ed.undo_push(message="first")
    store(extension, "Room", random_grid(1), file.parent)
    bpy.ops.ed.undo_push(message="second")
    for act, seed in ((bpy.ops.ed.undo, 0), (bpy.ops.ed.redo, 1), (bpy.ops.ed.undo, 0)):
        act()
        found = bpy.data.images["Room"]
        assert_same(storage.load_grid(found), random_grid(seed))
        assert storage.problem(found) == ""
        assert bpy.context.scene.ivg.grid == found


def test_a_deleted_grid_is_gone_and_undo_brings_it_back(image: Image, file: Path) -> None:
    bpy.ops.ed.undo_push(message="stored")
    assert bpy.ops.ivg.grid_remove() == {"FINISHED"}
    bpy.ops.ed.undo_push(message="removed")
    assert (len(bpy.data.images), len(bpy.data.volumes), bpy.context.scene.ivg.grid) == (0, 0, None)
    for operator in ("check", "restore", "grid_remove", "export_vdb"):
        assert not getattr(bpy.ops.ivg, operator).poll(), operator
    bpy.ops.ed.undo()
    assert_same(storage.load_grid(bpy.context.scene.ivg.grid), random_grid())
    assert storage.problem(bpy.context.scene.ivg.grid) == ""


def test_an_image_deleted_by_hand_leaves_no_reference(image: Image) -> None:
    bpy.data.images.remove(image)
    assert bpy.context.scene.ivg.grid is None
    assert storage.grids(bpy.data) == []


# --- What was done to the datablocks ----------------------------------------------------------------------------------


def paint(image: Image) -> None:
    image.pixels[0] = 0.5


def paint_and_pack(image: Image) -> None:
    image.pixels[0] = 0.5
    image.pack()


def resize(image: Image) -> None:
    image.scale(10, 10)


def resize_and_pack(image: Image) -> None:
    image.scale(10, 10)
    image.pack()


def unpack(image: Image) -> None:
    image.unpack(method="USE_LOCAL")


def unpack_and_lose(image: Image) -> None:
    image.unpack(method="USE_LOCAL")
    Path(bpy.path.abspath(image.filepath)).unlink()
    image.reload()


def read_as_colour(image: Image) -> None:
    image.colorspace_settings.name = "sRGB"


def halve_precision(image: Image) -> None:
    image.use_half_precision = True


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (paint, "was painted on or changed"),
        (paint_and_pack, "was painted on or changed"),
        (resize, "has 10 × 10 pixels"),
        (resize_and_pack, "has 10 × 10 pixels"),
        (unpack, "is no longer packed"),
        (unpack_and_lose, "is no longer packed"),
        (read_as_colour, "as a picture and not as numbers"),
        (halve_precision, "as a picture and not as numbers"),
    ],
)
def test_a_changed_image_is_refused_and_can_be_restored(
    image: Image, change: Callable[[Image], None], says: str
) -> None:
    change(image)
    message = refused(image)
    assert says in message
    assert "bpy.ops.ivg.restore()" in message
    with pytest.raises(RuntimeError, match="'Room'"):
        bpy.ops.ivg.check()
    assert bpy.ops.ivg.restore() == {"FINISHED"}
    assert_same(storage.load_grid(image), random_grid())
    assert storage.problem(image) == ""
    assert bpy.data.volumes["Room"].filepath == "//room.ivg.vdb", "nothing was wrong with the volume"


def test_an_image_that_is_no_grid_is_refused(file: Path) -> None:
    picture = bpy.data.images.new("Room", 4, 4)
    assert "holds no irradiance vector grid" in refused(picture)
    assert storage.grids(bpy.data) == []


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("version", 3, "newer Irradiance Vector Grid (layout 3, this version has 2): update"),
        ("version", "one", "no layout that is known"),
        ("record", "{", "damaged properties"),
        ("record", "{}", "damaged header"),
        ("bounds_max", (0.0, 0.0, 0.0), "damaged header"),
        ("arrays", {}, "has no 'lit_weights', an older version stored it: bake it again"),
    ],
)
def test_damaged_and_foreign_properties_are_refused(image: Image, key: str, value: object, says: str) -> None:
    image[grid_image.KEY][key] = value
    assert says in refused(image)


def test_arrays_of_another_version_are_refused(image: Image) -> None:
    stored = image[grid_image.KEY]["arrays"]
    stored["colour"] = stored["validity"].to_dict()
    assert "holds 'colour', which this version does not know: update" in refused(image)


def test_a_bake_never_replaces_what_a_newer_version_stored(image: Image) -> None:
    image[grid_image.KEY]["version"] = 3
    bpy.ops.mesh.primitive_cube_add()
    with pytest.raises(RuntimeError, match="bake a grid of another name"):
        bpy.ops.ivg.bake(photons=1_000, resolution=(2, 2, 2))
    assert image[grid_image.KEY]["version"] == 3


def lose_file(volume: bpy.types.Volume) -> None:
    Path(bpy.path.abspath(volume.filepath)).unlink()


def move_file(volume: bpy.types.Volume) -> None:
    path = Path(bpy.path.abspath(volume.filepath))
    path.rename(path.with_name("moved.vdb"))


def other_content(volume: bpy.types.Volume) -> None:
    vdb_grid.save(random_grid(1), Path(bpy.path.abspath(volume.filepath)))


def no_volume(volume: bpy.types.Volume) -> None:
    bpy.data.volumes.remove(volume)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lose_file, "volume 'Room': its file"),
        (move_file, "is missing: press Restore"),
        (other_content, "holds something else than image 'Room'"),
        (no_volume, "the volume of image 'Room' was removed"),
    ],
)
def test_what_became_of_the_volume_is_said_and_restored(image: Image, change: Callable[[Any], None], says: str) -> None:
    change(bpy.data.volumes["Room"])
    assert says in storage.problem(image)
    assert_same(storage.load_grid(image), random_grid())
    assert bpy.ops.ivg.restore() == {"FINISHED"}
    assert storage.problem(image) == ""
    volume = bpy.data.volumes["Room"]
    assert_same(vdb_grid.load(Path(bpy.path.abspath(volume.filepath))), random_grid())


def test_a_linked_grid_is_restored_where_it_is(image: Image, file: Path) -> None:
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(str(file), link=True) as (_, here):
        here.images = ["Room"]
    bpy.context.scene.ivg.grid = here.images[0]
    with pytest.raises(RuntimeError, match=r"image 'Room' of .*room\.blend is linked: restore it in that file"):
        bpy.ops.ivg.restore()


# --- Export -----------------------------------------------------------------------------------------------------------


def test_export_writes_the_scenes_grid_or_a_named_one(extension: str, image: Image, file: Path) -> None:
    store(extension, "Hall", random_grid(1), file.parent)
    assert bpy.ops.ivg.export_vdb(filepath="//a") == {"FINISHED"}
    assert bpy.ops.ivg.export_vdb(filepath=str(file.with_name("b.vdb")), grid="Room") == {"FINISHED"}
    assert_same(vdb_grid.load(file.with_name("a.vdb")), random_grid(1))
    assert_same(vdb_grid.load(file.with_name("b.vdb")), random_grid(0))
    with pytest.raises(RuntimeError, match="there is no grid 'Attic' in this file"):
        bpy.ops.ivg.export_vdb(filepath="//c.vdb", grid="Attic")
    with pytest.raises(RuntimeError, match="cannot write"):
        bpy.ops.ivg.export_vdb(filepath="//nowhere/c.vdb")


def test_a_new_grid_never_takes_the_name_of_a_picture(extension: str, file: Path) -> None:
    picture = bpy.data.images.new("Room", 4, 4)
    stored = store(extension, "Room", random_grid(), file.parent)
    assert stored != picture
    assert tuple(picture.size) == (4, 4)
    assert module(extension, "storage").find(stored.name) == stored
