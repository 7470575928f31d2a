# SPDX-License-Identifier: GPL-3.0-or-later
"""The node group finds what the Python look-up finds, in Cycles and in EEVEE, and keeps up with its grid."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest

from benchmarks import node_stage
from ivg_addon.blender import grid_image
from ivg_addon.blender.irradiance_nodes import NAME, VERSION, find, follow, grid_of, irradiance_group
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.errors import GridFileError
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.partitions import Partitions
from ivg_addon.core.settings import Spatial
from tests.core.grids import AXES, LATTICE, grid

OTHER = Lattice((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (3, 2, 4))


@pytest.fixture(autouse=True)
def empty() -> Iterator[None]:
    bpy.ops.wm.read_homefile(use_empty=True)
    yield
    bpy.ops.wm.read_homefile(use_empty=True)


def walls(lattice: Lattice, rng: np.random.Generator) -> Partitions:
    """Return random planes close to vertices: none of most of them, one to three of the others."""
    count = np.where(rng.random(lattice.vertex_count) < 0.2, rng.integers(1, 4, lattice.vertex_count), 0)
    start = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
    vertex = np.stack(np.unravel_index(np.arange(lattice.vertex_count).repeat(count), lattice.shape), axis=-1)
    normal = unit(rng.normal(size=(len(vertex), 3)))
    offset = (normal * vertex).sum(axis=1) + rng.uniform(-0.7, 0.3, len(vertex))
    slack = rng.uniform(0.0, 0.2, len(vertex))
    return Partitions(start, np.column_stack([normal, offset, slack]).astype(np.float32))


def lit_grid(seed: int = 0, lattice: Lattice = LATTICE, divided: bool = False) -> IrradianceVectorGrid:
    """Return a grid of random light from all around; every fifth vertex is unlit, others are partly."""
    rng = np.random.default_rng(seed)
    validity = np.clip(rng.uniform(-0.3, 1.2, lattice.shape), 0.0, 1.0)
    size = (*lattice.shape, 6, 3, 3)
    vectors = rng.uniform(0.5, 1.5, size) * AXES[:, None, :] + 0.1 * rng.normal(size=size)
    sides = walls(lattice, rng) if divided else None
    return grid(vectors * (validity > 0.0)[..., None, None, None], validity, lattice, partitions=sides)


def stored(baked: IrradianceVectorGrid, name: str = "Room", spatial: Spatial = Spatial.TRILINEAR) -> bpy.types.Image:
    """Store a grid's image, in place of the one that has the name."""
    return grid_image.put(grid_image.prepare(baked, spatial), name, bpy.data.images.get(name))


def unit(vectors: node_stage.Float64) -> node_stage.Float64:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def stage(spatial: Spatial, divided: bool, bumps: bool, view: int) -> tuple[node_stage.Squares, node_stage.Wanted]:
    """Fill the scene with squares inside and around the grid; return them, and what Python finds there."""
    baked = lit_grid(divided=divided)
    rng = np.random.default_rng(1)
    low, high = np.asarray(LATTICE.bounds_min), np.asarray(LATTICE.bounds_max)
    points = rng.uniform(low - 0.2, high + 0.2, (20_000, 3))
    facing = unit(rng.normal(size=points.shape))
    normals = unit(facing + 0.5 * rng.normal(size=points.shape)) if bumps else facing
    what = node_stage.squares(node_stage.VIEWS[view], points, facing, normals)
    expected = node_stage.wanted(baked, spatial, what)
    node_stage.build(stored(baked, spatial=spatial), what, expected, bumps)
    return what, expected


@pytest.mark.parametrize(
    ("engine", "spatial", "divided", "bumps", "view"),
    [
        ("CYCLES", Spatial.TRILINEAR, False, False, 0),
        ("CYCLES", Spatial.TRILINEAR, True, True, 1),
        ("CYCLES", Spatial.TRICUBIC, True, False, 1),
        ("BLENDER_EEVEE", Spatial.TRILINEAR, False, True, 0),
        ("BLENDER_EEVEE", Spatial.TRICUBIC, False, False, 1),
    ],
    ids=["Cycles", "Cycles, walls and bumps", "Cycles, tricubic, walls", "EEVEE, bumps", "EEVEE, tricubic"],
)
def test_a_file_opened_again_shows_what_python_finds(
    tmp_path: Path, engine: str, spatial: Spatial, divided: bool, bumps: bool, view: int
) -> None:
    """To a thousandth, without the add-on.

    Beside walls a look-up may rest on vertices of weight 10⁻⁶, of which single precision keeps two digits.
    """
    what, expected = stage(spatial, divided, bumps, view)
    picture = node_stage.render(engine, tmp_path)
    if picture is None:
        pytest.skip("no OpenGL here: install libegl1 and libgl1-mesa-dri")
    straight = expected.bent() < 2e-4
    assert straight.mean() > 0.5
    off = node_stage.differences(what, picture)[straight].max(axis=1)
    assert off.max() < 1e-2
    assert (off > 1e-3).mean() < (2e-3 if divided else 1e-9)


def images_of(group: bpy.types.ShaderNodeTree) -> set[str]:
    """Return the names of all images that a group reads, with the groups in it."""
    trees = {group} | {node.node_tree for node in group.nodes if node.type == "GROUP"}
    return {node.image.name for tree in trees for node in tree.nodes if node.type == "TEX_IMAGE"}


def test_each_grid_has_one_group_of_its_own() -> None:
    room, hall = stored(lit_grid(), "Room"), stored(lit_grid(3, OTHER), "Hall")
    first, second = irradiance_group(room), irradiance_group(hall)
    assert (first.name, second.name) == (NAME, f"{NAME} (Hall)")
    assert irradiance_group(room) == first
    assert (images_of(first), images_of(second)) == ({"Room"}, {"Hall"})
    assert (grid_of(first), find(hall)) == (room, second)


def test_a_group_follows_its_grid_and_keeps_its_links() -> None:
    """A bake of another resolution: the same group with the same sockets, and as many datablocks as before."""
    image = stored(lit_grid())
    group = irradiance_group(image)
    sockets = [socket.identifier for socket in group.interface.items_tree]
    before = [node.inputs[1].default_value[:] for node in group.nodes if node.type == "VECT_MATH"]
    stored(lit_grid(3, OTHER))
    follow(image)
    assert find(image) == group
    assert [socket.identifier for socket in group.interface.items_tree] == sockets
    assert [node.inputs[1].default_value[:] for node in group.nodes if node.type == "VECT_MATH"] != before
    assert len(bpy.data.node_groups) == 3


def test_groups_of_older_versions_are_made_anew_and_newer_ones_refused() -> None:
    image = stored(lit_grid())
    group = irradiance_group(image)
    group["ivg"]["version"] = VERSION - 1
    group.nodes.clear()
    assert irradiance_group(image) == group
    assert group.nodes
    group["ivg"]["version"] = VERSION + 1
    with pytest.raises(GridFileError, match=f"'{NAME}' was made by a newer .* update the extension"):
        irradiance_group(image)


def test_what_is_no_grid_for_nodes_is_refused() -> None:
    with pytest.raises(GridFileError, match="'Photo' holds no irradiance vector grid"):
        irradiance_group(bpy.data.images.new("Photo", 4, 4))


def test_a_linked_group_serves_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "room.blend"
    irradiance_group(stored(lit_grid())).use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(str(path), link=True) as (_, into):
        into.node_groups = [NAME]
    (group,) = into.node_groups
    image = grid_of(group)
    assert irradiance_group(image) == group
    group["ivg"]["version"] = VERSION - 1
    with pytest.raises(GridFileError, match=r"room\.blend"):
        irradiance_group(image)
