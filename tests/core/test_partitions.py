# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertices that speak for one side of a thin wall: what they count, who listens to them, and how they are found."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from ivg_addon.core.bake import bake
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.partitioning import parting, partition_steps
from ivg_addon.core.partitions import Partitions
from ivg_addon.core.progress import finish
from ivg_addon.core.scene import GLASS, TRANSLUCENT, TRANSPARENT, Scene
from ivg_addon.core.settings import BakeSettings, Estimator, Spatial
from ivg_addon.core.tally import Tally

from .grids import grid, own_weights, spread
from .lobe_scenes import lobe, with_lobes
from .rooms import box, quad, rotation, scene
from .turned_rooms import knowledge
from .z_tests import assert_means

Float64 = NDArray[np.float64]

CUBE = Lattice((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), (4, 4, 4))
TURN = rotation((1, 2, 3), 0.5)


def one_plane_each(lattice: Lattice, planes: Float64) -> Partitions:
    """Return partitions of one plane (5,) per vertex, or the same for all."""
    count = lattice.vertex_count
    return Partitions(
        np.arange(count + 1, dtype=np.int32), np.broadcast_to(planes, (count, 5)).astype(np.float32, order="C")
    )


# --- What vertices count ----------------------------------------------------------------------------------------------


def sampled_mean(origin: Float64, direction: Float64, length: float, plane: Float64) -> Float64:
    """Return what a flight adds to Σ ℓ of each dual cell on the plane's positive side, by a million points along it."""
    t = (np.arange(1_000_000) + 0.5) / 1_000_000 * length
    g = (origin + t[:, None] * direction - CUBE.bounds_min) / CUBE.voxel_size
    g = g[(g >= 0).all(axis=1) & (g <= 4).all(axis=1) & (g @ plane[:3] >= plane[3])]
    cells = np.ravel_multi_index(tuple(np.floor(g + 0.5).astype(int).T), CUBE.shape)
    return np.bincount(cells, minlength=CUBE.vertex_count).reshape(CUBE.shape) * length / 1_000_000


@pytest.mark.parametrize("seed", range(6))
def test_flights_count_on_the_positive_side_alone(seed: int) -> None:
    """Against points along the flight; each cell's share is right to two of them."""
    rng = np.random.default_rng(seed)
    normal, origin, target = rng.normal(size=3), rng.uniform(-0.9, 0.9, 3), rng.uniform(-0.9, 0.9, 3)
    normal /= np.linalg.norm(normal)
    through = (origin + rng.uniform(0.2, 0.8) * (target - origin) - CUBE.bounds_min) / CUBE.voxel_size
    plane = np.array([*normal, normal @ through, 0.1], dtype=np.float32).astype(np.float64)
    flight = (target - origin).astype(np.float32)
    length = float(np.linalg.norm(flight))
    direction = (flight / np.float32(length)).astype(np.float32)
    tally = Tally.empty(CUBE, Estimator.TRACK_LENGTH, photons=1, bounces=0).divide(one_plane_each(CUBE, plane))
    arrays = (origin[None], direction[None], np.ones((1, 3)), np.array([length]))
    tally.deposit(*(np.ascontiguousarray(a, dtype=np.float32) for a in arrays))
    heard = np.linalg.norm(tally.vectors(1.0)[..., 0:2, 0, :].sum(axis=-2), axis=-1) * CUBE.cell_volumes()
    expected = sampled_mean(origin.astype(np.float32).astype(float), direction.astype(float), length, plane)
    assert expected.any()
    np.testing.assert_allclose(heard, expected, atol=2 * length / 1_000_000 + 1e-6)


@pytest.mark.parametrize("estimator", [Estimator.TRACK_LENGTH, Estimator.CROSSING])
def test_two_halves_are_the_whole(estimator: Estimator) -> None:
    """What vertices count on either side of a plane adds up to what they count without it."""
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    arrays = (rng.uniform(-1, 1, (2000, 3)), directions, np.ones((2000, 3)), rng.exponential(1.0, 2000))
    flights = [np.ascontiguousarray(a, dtype=np.float32) for a in arrays]
    plane = np.array([0.6, 0.0, 0.8, 2.9, 0.0])
    vectors = []
    for sides in (Partitions.none(CUBE.vertex_count), *(one_plane_each(CUBE, s * plane) for s in (1, -1))):
        tally = Tally.empty(CUBE, estimator, photons=2000, bounces=0).divide(sides)
        tally.deposit(*flights)
        vectors.append(tally.vectors(1.0))
    assert (vectors[1] != 0).any() and (vectors[2] != 0).any()
    np.testing.assert_allclose(vectors[1] + vectors[2], vectors[0], atol=1e-6 * np.abs(vectors[0]).max())


def test_dividing_forgets_what_divided_vertices_have_counted() -> None:
    tally = Tally.empty(CUBE, Estimator.TRACK_LENGTH, photons=10, bounces=0)
    tally.sums[:] = 1
    start = np.zeros(CUBE.vertex_count + 1, dtype=np.int32)
    start[8:] = 1
    tally = tally.divide(Partitions(start, np.array([[1, 0, 0, 0, 0]], dtype=np.float32)))
    sums = tally.sums.reshape(CUBE.vertex_count, -1)
    assert (sums[7] == 0).all() and (np.delete(sums, 7, axis=0) == 1).all()


# --- Who listens to them ----------------------------------------------------------------------------------------------


def step_grid(height: float, below: float, above: float) -> IrradianceVectorGrid:
    """Return a grid of two values, parted by the plane g_z = height, in voxels; vertices on it speak for above."""
    z = np.arange(CUBE.shape[2])
    values = np.broadcast_to(np.where(z >= height, above, below), CUBE.shape)
    planes = np.zeros((*CUBE.shape, 5))
    planes[..., 2], planes[..., 3], planes[..., 4] = 1.0, height, 1e-3
    planes[:, :, z < height, 2:4] *= -1.0
    validity = np.clip(np.abs(z - height) + 0.5, 0.0, 1.0)
    sides = one_plane_each(CUBE, planes.reshape(-1, 5))
    return grid(spread(values), validity, CUBE, own_weights(CUBE), sides)


positions = st.tuples(*[st.floats(-1, 1)] * 3)


@given(
    point=positions,
    height=st.floats(0.6, 3.4),
    normal=positions.filter(lambda n: max(map(abs, n)) > 0.1),
    spatial=st.sampled_from(list(Spatial)),
    bias=st.floats(0, 2),
)
def test_each_side_of_a_wall_has_its_own_light(
    point: tuple[float, ...], height: float, normal: tuple[float, ...], spatial: Spatial, bias: float
) -> None:
    """However near the wall: points of the air, beyond the plane's slack. All 54 numbers alike: E is the number."""
    g = (point[2] + 1.0) * 2.0
    if abs(g - height) < 2e-3:
        return
    e = step_grid(height, 1.0, 100.0).irradiance([point], [(1.0, 0.0, 0.0)], spatial, normal_bias=bias)
    np.testing.assert_allclose(e, 100.0 if g > height else 1.0, rtol=1e-5)


@given(height=st.floats(0.6, 3.4), x=st.floats(-1, 1), y=st.floats(-1, 1))
def test_a_wall_belongs_to_the_side_that_its_normal_points_to(height: float, x: float, y: float) -> None:
    made = step_grid(height, 1.0, 100.0)
    for up in (1.0, -1.0):
        # Of numbers all alike E depends on the normal, so it is compared with E in the open.
        open_air, at_wall = made.irradiance([(x, y, 0.99 * up), (x, y, height / 2 - 1)], [(0, 0, up)] * 2)
        np.testing.assert_allclose(at_wall, open_air, rtol=1e-5)


def test_a_wall_on_a_floor_does_not_send_the_look_up_through_the_floor() -> None:
    """A point of the floor a hair below its plane, where all vertices above speak for what is beyond a wall."""
    floor = step_grid(2.0, 1.0, 100.0)
    planes = floor.partitions.planes.reshape(*CUBE.shape, 5)
    number = np.ones(CUBE.shape, dtype=np.int64)
    number[2:, :, 2:] = 2
    rows = [
        [plane, [1.0, 0.0, 0.0, 2.5, 1e-3]][:n] for plane, n in zip(planes.reshape(-1, 5), number.flat, strict=True)
    ]
    start = np.concatenate([[0], np.cumsum(number)]).astype(np.int32)
    both = Partitions(start, np.array([plane for row in rows for plane in row], dtype=np.float32))
    values = np.where(np.arange(CUBE.shape[2]) >= 2, 100.0, 1.0)
    made = grid(spread(np.broadcast_to(values, CUBE.shape)), floor.validity, CUBE, own_weights(CUBE), both)
    on_floor, in_the_open = made.irradiance([(0.15, 0.1, -5e-5), (-0.9, 0.1, 0.9)], [(0, 0, 1)] * 2)
    np.testing.assert_allclose(on_floor, in_the_open, rtol=1e-5)


def test_where_nobody_speaks_everybody_is_heard() -> None:
    """Better the light of the next room than none."""
    nowhere = one_plane_each(CUBE, np.array([1.0, 0.0, 0.0, 1e6, 0.0]))
    made = grid(spread(np.full(CUBE.shape, 3.0)), lattice=CUBE, partitions=nowhere)
    np.testing.assert_allclose(made.irradiance([(0.1, 0.2, 0.3)], [(1, 0, 0)]), 3.0, rtol=1e-6)


# --- How they are found -----------------------------------------------------------------------------------------------


def found(of: Scene, photons: int = 1000, lattice: Lattice = CUBE, threads: int = 2, seed: int = 0) -> Partitions:
    """Return the partitions of a scene all of whose surfaces received photons on both sides."""
    objects = len(of.objects)
    known = knowledge(of, [photons] * objects, [photons] * objects)
    return finish(partition_steps(known, known.tracer, lattice, seed, threads))


def sheet(half: float, height: float) -> Scene:
    return scene([quad((-half, -half, height), (2 * half, 0, 0), (0, 2 * half, 0))])


@pytest.mark.parametrize("height", [-0.13, 0.0, 0.1, 0.24])
def test_a_sheet_divides_all_vertices_that_reach_through_it(height: float) -> None:
    made = found(sheet(3.0, height))
    divided = made.divided.reshape(CUBE.shape)
    g = (height + 1.0) * 2.0
    reach = np.abs(np.arange(5) - g)
    assert divided[:, :, reach < 0.9].all()
    assert not divided[:, :, reach >= 1.0].any()
    # The plane is the sheet's, to single precision, and the vertex lies on its positive side unless it is very near.
    np.testing.assert_allclose(made.planes[:, 3] * np.sign(made.planes[:, 2]), g, atol=1e-5)
    owner = np.repeat(np.arange(CUBE.vertex_count), np.diff(made.start)) % 5
    far = np.abs(owner - g) > 0.25
    assert (np.sign(owner - g) == np.sign(made.planes[:, 2]))[far].all()


def test_vertices_in_the_plane_of_a_sheet_all_speak_for_the_same_side() -> None:
    made = found(sheet(3.0, 0.0), seed=3)
    owner = np.repeat(np.arange(CUBE.vertex_count), np.diff(made.start)) % 5
    assert (made.planes[owner == 2, 2] > 0).all()


def test_a_sheet_divides_up_to_near_its_border() -> None:
    """One of 2 × 2 voxels divides the vertices at its border; 0.7 voxels beyond that of another, few are divided."""
    wide = Lattice((-1.5, -1.5, -1.5), (1.5, 1.5, 1.5), (6, 6, 6))
    inner, outer = (found(sheet(half, 0.1), lattice=wide).divided.reshape(wide.shape) for half in (0.5, 0.65))
    assert inner[3, 2:5, 3:5].all() and inner[2:5, 3, 3:5].all()
    ring = np.concatenate([outer[[1, 5], 1:6, 3:5].ravel(), outer[2:5, [1, 5], 3:5].ravel()])
    assert ring.mean() < 0.25


def test_rooms_poles_and_dust_divide_nothing() -> None:
    room = knowledge(scene([box((-0.9,) * 3, (0.9,) * 3, inward=True, turn=TURN)]), [1000], [0])
    assert not finish(partition_steps(room, room.tracer, CUBE, 0, 2)).divided.any()
    assert not found(scene([box((-0.03, -0.02, -2), (0.02, 0.03, 2))])).divided.any()
    rng = np.random.default_rng(0)
    specks = [quad(p, 0.02 * u, 0.02 * v) for p, u, v in rng.uniform(-1, 1, (60, 3, 3))]
    assert not found(scene(specks)).divided.any()


def test_what_is_dark_behind_needs_no_division() -> None:
    """A floor over solid ground: photons meet one side of it."""
    dark = knowledge(sheet(3.0, 0.1), [1000], [0])
    assert not finish(partition_steps(dark, dark.tracer, CUBE, 0, 2)).divided.any()


@pytest.mark.parametrize(
    ("kind", "colour", "parts"),
    [(TRANSPARENT, 0.6, False), (TRANSPARENT, 0.4, True), (GLASS, 1.0, False), (TRANSLUCENT, 1.0, True)],
)
def test_what_light_goes_on_through_parts_nothing(kind: int, colour: float, parts: bool) -> None:
    of = scene([quad((-3, -3, 0.1), (6, 0, 0), (0, 6, 0), material=1)], ((0.5,) * 3, (0.0,) * 3))
    of = with_lobes(of, lobe(kind, (colour,) * 3, material=1))
    np.testing.assert_array_equal(parting(of), parts)


def test_any_number_of_threads_finds_the_same_planes() -> None:
    of = scene([quad((-3, -3, 0.1), (6, 0, 0), (0, 6, 0)), quad((0.2, -3, -3), (0, 6, 0), (0, 0, 6))])
    one, two = (found(of, threads=threads) for threads in (1, 2))
    assert one.divided.any()
    assert one.start.tobytes() == two.start.tobytes() and one.planes.tobytes() == two.planes.tobytes()
    # In the four rooms around the edge vertices have both planes.
    assert np.diff(one.start).max() == 2


def test_bent_sheets_have_slack() -> None:
    """A tent of 0.1 voxel: no plane fits it better than half of that; surfaces on both slopes belong to either side."""
    tent = scene([quad((-3, -3, 0.02), (3, 0, 0.05), (0, 6, 0)), quad((0, -3, 0.07), (3, 0, -0.05), (0, 6, 0))])
    made = found(tent)
    owner = np.repeat(np.arange(CUBE.vertex_count), np.diff(made.start))
    middle = np.unravel_index(owner, CUBE.shape)[0] == 2
    assert middle.any()
    assert (made.planes[middle, 4] > 0.01).all() and (made.planes[middle, 4] <= 0.25).all()


# --- The whole: two furnaces wall to wall -----------------------------------------------------------------------------


def furnaces(turn: Float64, wall: float, seed: int = 0, gap: float = 1e-3) -> IrradianceVectorGrid:
    """Bake two closed rooms with a gap between them, one ten times as bright.

    In a closed room of albedo ½ that emits the radiance e, E of the reflected light is π e for every point and normal.
    """
    rooms = [
        box((-1, -1, -1), (wall - gap / 2, 1, 1), 0, inward=True, turn=turn),
        box((wall + gap / 2, -1, -1), (1, 1, 1), 1, inward=True, turn=turn),
    ]
    of = scene(rooms, albedo=((0.5,) * 3,) * 2, emission=((1.0,) * 3, (0.1,) * 3))
    low, high = of.geometry.bounds()
    settings = BakeSettings(
        tuple(map(float, low)), tuple(map(float, high)), (6, 6, 6), photons=200_000, bounces=30, seed=seed
    )
    return bake(of, settings).grid


def places(wall: float, count: int) -> tuple[Float64, Float64, NDArray[np.bool_]]:
    """Return points of both rooms a hundredth off the wall, normals, and which are in the brighter room."""
    rng = np.random.default_rng(7)
    points = rng.uniform(-0.99, 0.99, (count, 3))
    points = points[np.abs(points[:, 0] - wall) > 0.01]
    normals = rng.normal(size=points.shape)
    return points, normals / np.linalg.norm(normals, axis=1)[:, None], points[:, 0] < wall


@pytest.mark.parametrize("wall", [0.0, 0.1, -0.27])
def test_no_light_leaks_between_rooms_in_line_with_the_grid(wall: float) -> None:
    """Means over each room, over independent bakes, against the closed form."""
    points, normals, bright = places(wall, 4000)
    means = []
    for seed in range(8):
        e = furnaces(np.eye(3), wall, seed=seed).irradiance(points, normals)[:, 0]
        means.append((e[bright].mean() / np.pi, e[~bright].mean() / (0.1 * np.pi)))
    assert_means(means, 1.0)


def test_hardly_any_light_leaks_between_turned_rooms() -> None:
    """In corners, where three walls meet, a plane may be missed; else light of the bright room is nowhere in the dark.

    Whole cells would be a mean of both rooms up to half a voxel off the wall, a sixth of the dark room.
    """
    points, normals, bright = places(0.1, 4000)
    e = furnaces(TURN, 0.1).irradiance(points @ TURN.T, normals @ TURN.T)[:, 0] / np.pi
    assert np.mean(e[~bright] > 0.3) < 0.01
    assert np.mean(e[bright] < 0.5) < 0.01


def test_nobody_speaks_for_the_inside_of_a_wall() -> None:
    """A wall as thick as a voxel, with a layer of vertices inside: they speak for a room, or not at all."""
    made = furnaces(np.eye(3), 0.0, gap=0.33)
    inside = made.vectors[3]
    assert (made.validity[3] > 0).any()
    assert inside[made.validity[3] > 0].any(axis=(-1, -2, -3)).all()
    points, normals, bright = places(0.0, 4000)
    clear = np.abs(points[:, 0]) > 0.17
    e = made.irradiance(points[clear], normals[clear])[:, 0] / np.pi / np.where(bright[clear], 1.0, 0.1)
    assert np.mean(np.abs(e - 1.0) > 0.5) < 0.01
