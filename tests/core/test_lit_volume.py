# SPDX-License-Identifier: GPL-3.0-or-later
"""The lit share of dual cells, against exact volumes of rooms that are not aligned with the grid."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from ivg_addon.core import lit_volume
from ivg_addon.core.bake import LEAST_LIT_SHARE, bake
from ivg_addon.core.cell_points import spread_points
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.lit_volume import (
    DIM,
    LEAK_RATIO,
    LIT,
    MANY_PHOTONS,
    PERHAPS_LIT,
    SEVERAL_PHOTONS,
    UNKNOWN,
    UNLIT,
    LightKnowledge,
    lit_part_steps,
    mark_cut_cells,
    side_verdict,
)
from ivg_addon.core.progress import finish
from ivg_addon.core.settings import BakeSettings

from .convex import clipped_volume
from .rooms import Part, box, lamp, quad, rotation, scene, sky
from .turned_rooms import LATTICE, ROOM, SEEN, TURN, UNDIVIDED, halfspaces, knowledge
from .z_tests import FALSE_ALARM

Float64 = NDArray[np.float64]
Float32 = NDArray[np.float32]

POINTS = 1024


def lit(of: LightKnowledge, points: object) -> NDArray[np.bool_]:
    places = np.array(points, dtype=np.float32)
    return of.lit(places, np.arange(len(places)), seed=1)


def shares(of: LightKnowledge, points: int = POINTS, seed: int = 0, threads: int = 2) -> Float32:
    return finish(lit_part_steps(of, LATTICE, UNDIVIDED, SEEN, points, seed, threads)).share


# --- Volumes ----------------------------------------------------------------------------------------------------------


def exact_shares(turn: Float64) -> Float64:
    """Return each dual cell's share inside a turned cube about the origin."""
    h, centres = LATTICE.voxel_size, LATTICE.vertex_positions()
    low = np.maximum(centres - h / 2, LATTICE.bounds_min)
    high = np.minimum(centres + h / 2, LATTICE.bounds_max)
    inside = [
        clipped_volume(a, b, *halfspaces(turn)) for a, b in zip(low.reshape(-1, 3), high.reshape(-1, 3), strict=True)
    ]
    return np.reshape(inside, LATTICE.shape) / LATTICE.cell_volumes()


def test_the_exact_volume_is_one() -> None:
    """A turned cube in a large box; a corner cut off a cube; a half."""
    turn = np.concatenate([TURN.T, -TURN.T])
    assert clipped_volume((-4, -4, -4), (4, 4, 4), turn, np.ones(6)) == pytest.approx(8)
    assert clipped_volume((0, 0, 0), (1, 1, 1), [(1, 1, 1)], [0.5]) == pytest.approx(0.5**3 / 6)
    assert clipped_volume((0, 0, 0), (1, 2, 3), [(1, 1, 1)], [3]) == pytest.approx(3)
    assert clipped_volume((0, 0, 0), (1, 1, 1), [(1, 0, 0)], [-1]) == 0


@pytest.mark.parametrize("turn", [np.eye(3), TURN, rotation((1, -1, 0.2), 1.1)], ids=["aligned", "turned", "other"])
def test_lit_shares_of_a_turned_room_are_its_exact_volumes(turn: Float64) -> None:
    """Points as even as these scatter less than random ones, whose binomial standard error is therefore safe."""
    room = scene([box((-1, -1, -1), (1, 1, 1), inward=True, turn=turn)])
    share, exact = shares(knowledge(room, [1000], [0])), exact_shares(turn)
    variance = exact * (1 - exact) / POINTS
    cut = (exact > 0) & (exact < 1)
    assert cut.sum() > 50
    np.testing.assert_array_equal(share[exact == 0], 0)
    np.testing.assert_array_equal(share[exact == 1], 1)
    # A binomial is normal where it has a dozen points; elsewhere what is left is a point or two.
    usual = cut & (exact * POINTS > 12) & ((1 - exact) * POINTS > 12)
    z = np.abs(share - exact)[usual] / np.sqrt(variance[usual])
    assert usual.sum() * math.erfc(z.max() / math.sqrt(2)) >= FALSE_ALARM
    assert np.abs(share - exact)[cut & ~usual].max(initial=0) < 48 / POINTS
    volumes = LATTICE.cell_volumes()
    total_z = abs(((share - exact) * volumes).sum()) / math.sqrt((variance * volumes**2).sum())
    assert math.erfc(total_z / math.sqrt(2)) >= FALSE_ALARM


def test_photons_find_the_same_room() -> None:
    """The same through the walk: which sides are lit is what photons say."""
    room = scene([box((-1, -1, -1), (1, 1, 1), inward=True, turn=TURN)], lights=lamp((0.2, 0.1, -0.3)))
    settings = BakeSettings(
        LATTICE.bounds_min, LATTICE.bounds_max, LATTICE.resolution, photons=200_000, lit_points=POINTS
    )
    known = shares(knowledge(room, [1000], [0]))
    validity = bake(room, settings).grid.validity
    np.testing.assert_array_equal(validity, np.where(known >= LEAST_LIT_SHARE, known, 0))


# --- What light knows -------------------------------------------------------------------------------------------------


def test_inside_solids_it_is_dark() -> None:
    solid = box((-0.4, -0.3, -0.2), (0.3, 0.4, 0.5))
    of = knowledge(scene([ROOM, solid]), [1000, 1000], [0, 0])
    assert not lit(of, np.random.default_rng(0).uniform((-0.39, -0.29, -0.19), (0.29, 0.39, 0.49), (500, 3))).any()
    assert lit(of, [(0.6, 0, 0), (0, -0.6, 0), (0, 0, 0.7)]).all()


def test_beyond_the_walls_it_is_dark() -> None:
    of = knowledge(scene([ROOM]), [1000], [0])
    assert not lit(of, [(3, 0, 0), (1.6, 1.6, 1.6), (0, -2, 0.1)]).any()


def test_a_floor_that_reaches_under_the_walls_and_out() -> None:
    """Beyond the walls neither of its sides received any: that tells nothing, and the walls tell that it is dark."""
    settings = BakeSettings((-2, -2, -0.5), (2, 2, 1.5), (8, 8, 4), photons=100_000, lit_points=256)
    walls = [
        quad((-1, -1, 0), (0, 2, 0), (0, 0, 1)),
        quad((1, -1, 0), (0, 0, 1), (0, 2, 0)),
        quad((-1, -1, 0), (0, 0, 1), (2, 0, 0)),
        quad((-1, 1, 0), (2, 0, 0), (0, 0, 1)),
        quad((-1, -1, 1), (0, 2, 0), (2, 0, 0)),
    ]
    floor = [quad((x, y, 0), (1, 0, 0), (0, 1, 0)) for x in range(-2, 2) for y in range(-2, 2)]
    validity = bake(scene([*walls, *floor], lights=lamp((0, 0, 0.5))), settings).grid.validity
    position = Lattice(settings.bounds_min, settings.bounds_max, settings.resolution).vertex_positions()
    x, y, z = np.moveaxis(position, -1, 0)
    aside = np.maximum(np.abs(x), np.abs(y))
    assert not validity[(aside > 1.3) | (z > 1.3) | (z < -0.3)].any()
    np.testing.assert_array_equal(validity[(aside < 0.7) & (z > 0.3) & (z < 0.7)], 1)
    # Cells that the floor halves, to the scatter of 256 points.
    halved = validity[(aside < 0.7) & (z == 0)]
    assert len(halved) == 9
    np.testing.assert_allclose(halved, 0.5, atol=5 * math.sqrt(0.25 / 256))


@pytest.mark.parametrize("cells", [8, 16])
def test_a_floor_in_one_piece_reads_like_one_cut_at_the_walls(cells: int) -> None:
    """Photons fly alike in both; only patches on both sides of a wall differ, an eighth of a voxel wide.

    Beyond the wall such a patch outweighs the wall only at points closer to it than to the wall: less than half of what
    lies above it, a sixteenth of a cell.
    """
    width = 1.05  # not on the patches' edges
    walls = [
        quad((-width, -width, 0), (0, 2 * width, 0), (0, 0, 1)),
        quad((width, -width, 0), (0, 0, 1), (0, 2 * width, 0)),
        quad((-width, -width, 0), (0, 0, 1), (2 * width, 0, 0)),
        quad((-width, width, 0), (2 * width, 0, 0), (0, 0, 1)),
        quad((-width, -width, 1), (0, 2 * width, 0), (2 * width, 0, 0)),
    ]
    whole = quad((-2, -2, 0), (4, 0, 0), (0, 4, 0))
    cut = quad((-width, -width, 0), (2 * width, 0, 0), (0, 2 * width, 0))
    bake_settings = BakeSettings(
        (-2, -2, -0.5), (2, 2, 1.5), (cells, cells, cells // 2), photons=1_000_000, lit_points=1024
    )
    grids = [bake(scene([*walls, floor], lights=lamp((0, 0, 0.5))), bake_settings).grid for floor in (whole, cut)]
    points = np.random.default_rng(0).uniform((-width, -width, 0), (width, width, 0), (4000, 3))
    on_whole, on_cut = (grid.irradiance(points, np.tile((0, 0, 1), (4000, 1)))[:, 0] for grid in grids)
    beside = np.abs(points[:, :2]).max(axis=1) > width - 4 / cells
    assert on_whole[beside].mean() / on_cut[beside].mean() == pytest.approx(1, abs=1 / 16)
    assert on_whole[~beside].mean() / on_cut[~beside].mean() == pytest.approx(1, abs=1 / 64)
    outside = np.abs(grids[0].lattice.vertex_positions()[..., :2]).max(axis=-1) > width + 4 / cells
    assert not grids[0].validity[outside].any()


def test_an_open_room_is_lit_as_far_as_light_leaves_it() -> None:
    """Without a front: inside all is lit, behind the walls nothing."""
    low, high = (-0.9, -0.9, -0.9), (0.9, 0.9, 0.9)
    closed = box(low, high, inward=True)
    front = np.all(np.isclose(closed.vertices[closed.triangles][:, :, 1], -0.9), axis=1)
    cornell = replace(closed, triangles=closed.triangles[~front])
    settings = BakeSettings((-1.3, -1.3, -1.3), (1.3, 1.3, 1.3), (6, 6, 6), photons=100_000, lit_points=256)
    validity = bake(scene([cornell], lights=lamp((0, 0, 0.6))), settings).grid.validity
    position = Lattice(settings.bounds_min, settings.bounds_max, settings.resolution).vertex_positions()
    inside = (np.abs(position) < 0.65).all(axis=-1)
    assert inside.sum() >= 27
    np.testing.assert_array_equal(validity[inside], 1)
    assert not validity[position[..., 1] > 1.2].any()


def test_a_world_that_shines_lights_what_sees_it() -> None:
    solid = scene([box((-0.8, -0.8, -0.8), (0.8, 0.8, 0.8), turn=TURN)])
    for world_shines in (True, False):
        of = knowledge(solid, [1000 if world_shines else 0], [0], world_shines)
        np.testing.assert_array_equal(
            lit(of, [(0, 0, 0), (1.9, 0, 0), (0, 0, -1.8)]), [False, world_shines, world_shines]
        )
    settings = BakeSettings((-2, -2, -2), (2, 2, 2), (4, 4, 4), photons=50_000, lit_points=64)
    validity = bake(replace(solid, lights=sky()), settings).grid.validity
    assert validity[2, 2, 2] == 0
    assert (validity[0] == 1).all()


def test_a_sealed_box_that_nothing_lights_is_dark() -> None:
    """Its walls are planes with light on their outer side."""
    sealed = box((-0.4, -0.4, -0.4), (0.4, 0.4, 0.4))
    of = knowledge(scene([ROOM, sealed]), [1000, 1000], [0, 0])
    assert not lit(of, np.random.default_rng(1).uniform(-0.39, 0.39, (300, 3))).any()


def test_a_dim_room_beside_a_bright_one() -> None:
    """A door's crack lets a few photons in: dim is not dark. A leak, a few among many, is."""
    wall = quad((0, -1, -1), (0, 2, 0), (0, 0, 2))  # front towards +x
    left = box((-1, -1, -1), (0, 1, 1), inward=True)
    right = box((0, -1, -1), (1, 1, 1), inward=True)
    keep = ~np.all(np.isclose(left.vertices[left.triangles][:, :, 0], 0), axis=1)
    bright = replace(left, triangles=left.triangles[keep])
    keep = ~np.all(np.isclose(right.vertices[right.triangles][:, :, 0], 0), axis=1)
    dim = replace(right, triangles=right.triangles[keep])
    points = np.random.default_rng(2).uniform((0.02, -0.98, -0.98), (0.98, 0.98, 0.98), (300, 3))
    rooms = scene([bright, dim, wall])
    dimly_lit = knowledge(rooms, [100_000, 100, 100], [0, 0, 100_000])
    assert lit(dimly_lit, points).all()
    assert lit(dimly_lit, -points).all()
    leaked = knowledge(rooms, [1_000_000, 0, 20], [0, 0, 1_000_000])
    assert not lit(leaked, points).any()
    assert lit(leaked, -points).all()


@pytest.mark.parametrize(
    ("here", "beyond", "verdict"),
    [
        (0, 0, UNKNOWN),
        (0, SEVERAL_PHOTONS - 1, UNKNOWN),
        (0, SEVERAL_PHOTONS, UNLIT),
        (1, 0, PERHAPS_LIT),
        (MANY_PHOTONS - 1, 0, PERHAPS_LIT),
        (MANY_PHOTONS, 0, LIT),
        (1, 9999, PERHAPS_LIT),
        (1, round(1 / LEAK_RATIO) + 1, UNLIT),
        (MANY_PHOTONS, 10 * MANY_PHOTONS, LIT),
        (100, 10**6 + 1, UNLIT),
        (10**6, 10**9, LIT),
    ],
)
def test_verdict_on_a_side(here: int, beyond: int, verdict: int) -> None:
    assert side_verdict(here, beyond, LEAK_RATIO) == verdict


def test_verdict_on_a_dim_side() -> None:
    assert side_verdict(100, 3000, LEAK_RATIO) == LIT
    assert side_verdict(100, 3000, DIM) == UNLIT
    assert side_verdict(200, 3000, DIM) == LIT


def test_rays_vote() -> None:
    """In the middle of a cube with one lit side a ray says lit with p = 1/6; two votes ahead p² / (p² + q²) do."""
    sides = [box((-1, -1, -1), (1, 1, 1), inward=True)]
    top = np.all(np.isclose(sides[0].vertices[sides[0].triangles][:, :, 2], 1), axis=1)
    cube = scene([replace(sides[0], triangles=sides[0].triangles[part]) for part in (top, ~top)])
    points = 40_000
    share = lit(knowledge(cube, [1000, 0], [0, 1000]), np.zeros((points, 3))).mean()
    p, q = 1 / 6, 5 / 6
    expected = p**2 / (p**2 + q**2)
    z = abs(share - expected) / math.sqrt(expected * (1 - expected) / points)
    # 16 rays leave one point in 10⁴ undecided; half of these are taken for one thing or the other.
    assert z < 5.5


def test_a_leaf_too_small_to_be_hit_tells_nothing() -> None:
    """Neither side received a photon: the next ray decides."""
    leaf = quad((-0.1, -0.1, 0), (0.2, 0, 0), (0, 0.2, 0))
    of = knowledge(scene([ROOM, leaf]), [1000, 0], [0, 0])
    assert lit(of, [(0, 0, 0.01), (0, 0, -0.01), (0.05, 0.05, 0.001)]).all()


# --- The points -------------------------------------------------------------------------------------------------------


def test_answers_do_not_depend_on_batches_and_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    of = knowledge(scene([ROOM]), [1000], [0])
    whole = shares(of, points=100, threads=1)
    for batch, threads in ((100, 3), (1000, 2), (1 << 20, 2)):
        monkeypatch.setattr(lit_volume, "_BATCH", batch)
        np.testing.assert_array_equal(shares(of, points=100, threads=threads), whole)
    assert (shares(of, points=100, seed=1) != whole).any()


@given(cells=st.lists(st.integers(0, LATTICE.vertex_count - 1), min_size=1, max_size=5), first=st.integers(0, 10**6))
def test_points_lie_in_their_cells_and_fill_them(cells: list[int], first: int) -> None:
    """Any half of a cell holds half of its points, to a few: they are more even than random ones."""
    count = 512
    vertices = np.array(cells, dtype=np.int64)
    out = np.empty((len(cells) * count, 3), dtype=np.float32)
    low, shape = np.array(LATTICE.bounds_min), np.array(LATTICE.shape, dtype=np.int64)
    spread_points(vertices, first, count, 7, low, LATTICE.voxel_size, shape, out)
    position = (out.reshape(len(cells), count, 3) - low) / LATTICE.voxel_size
    centre = np.stack(np.unravel_index(vertices, LATTICE.shape), axis=-1)[:, None]
    a, b = np.maximum(centre - 0.5, 0), np.minimum(centre + 0.5, shape - 1)
    assert (position >= a - 1e-5).all()
    assert (position <= b + 1e-5).all()
    below = (position < (a + b) / 2).sum(axis=1)
    assert np.abs(below - count / 2).max() < 3 * math.log2(count)


def test_a_grid_of_several_batches_tells_its_progress() -> None:
    steps = lit_part_steps(knowledge(scene([ROOM]), [1000], [0]), LATTICE, UNDIVIDED, SEEN, 4000, 0, 2)
    fractions = [progress.fraction for progress in steps]
    assert len(fractions) > 3
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0


coordinates = st.floats(-2, 2, width=32)


@given(st.tuples(*[coordinates] * 9), st.tuples(*[st.floats(0, 1)] * 2))
@settings(max_examples=300)
def test_every_cell_that_a_triangle_cuts_is_marked(corners: tuple[float, ...], place: tuple[float, float]) -> None:
    """The cell of any point of the triangle; and none farther away than a cell from it is."""
    vertices = np.array(corners, dtype=np.float32).reshape(3, 3)
    cut = np.zeros(LATTICE.shape, dtype=bool)
    low, shape = np.array(LATTICE.bounds_min), np.array(LATTICE.shape, dtype=np.int64)
    mark_cut_cells(vertices, np.array([[0, 1, 2]], dtype=np.int32), low, LATTICE.voxel_size, shape, 0.5, cut)
    u, v = place if sum(place) <= 1 else (1 - place[0], 1 - place[1])
    p, q, r = ((vertices.astype(np.float64) - low) / LATTICE.voxel_size).tolist()
    point = np.array(p) + u * np.subtract(q, p) + v * np.subtract(r, p)
    if (point > 0).all() and (point < shape - 1).all() and (np.abs(point % 1 - 0.5) > 1e-6).all():
        assert cut[tuple(np.floor(point + 0.5).astype(int))]
    marked = np.argwhere(cut)
    lowest, highest = np.min([p, q, r], axis=0), np.max([p, q, r], axis=0)
    assert ((marked >= lowest - 0.501) & (marked <= highest + 0.501)).all()


@pytest.mark.parametrize("size", [1e6, 1e20, 3e38])
def test_huge_triangles_are_marked_in_time(size: float) -> None:
    corners = np.array([(-size, -size, 0.1), (size, -size, 0.1), (0, size, 0.1)], dtype=np.float32)
    cut = np.zeros(LATTICE.shape, dtype=bool)
    low, shape = np.array(LATTICE.bounds_min), np.array(LATTICE.shape, dtype=np.int64)
    mark_cut_cells(corners, np.array([[0, 1, 2]], dtype=np.int32), low, LATTICE.voxel_size, shape, 0.5, cut)
    assert cut.any(axis=(0, 1)).sum() == 1
    assert cut.all(axis=2).sum() == 0
    assert cut.sum() == shape[0] * shape[1]


def test_nothing_is_cut_where_nothing_is() -> None:
    of = knowledge(scene([Part(np.zeros((3, 3)) + 50, np.array([[0, 1, 2]]))]), [1], [0], world_shines=True)
    np.testing.assert_array_equal(shares(of), 1)
