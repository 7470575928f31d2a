# SPDX-License-Identifier: GPL-3.0-or-later
"""Random places lie where light is, evenly, and keep away from surfaces."""

from __future__ import annotations

import numpy as np
import pytest

from ivg_addon.core.errors import SceneError
from ivg_addon.core.lights import Lights
from ivg_addon.core.sample_points import (
    CLEARANCE,
    LIFT,
    LitBox,
    Places,
    find_clear,
    find_light_steps,
    free_space_points,
    surface_points,
)
from ivg_addon.core.scene import Scene

from . import rooms
from .steps import drain
from .z_tests import assert_counts

TURN = rooms.rotation((1.0, 2.0, 0.5), 0.6)
ROOM = np.array([4.0, 5.0, 3.0])
BLOCK_LOW, BLOCK_HIGH = np.array([1.0, 1.0, 0.0]), np.array([2.0, 3.0, 1.5])
COUNT = 4000


def room() -> Scene:
    """Return a tilted room whose ceiling shines, with a closed block that stands on its floor."""
    lamp = rooms.quad((1.0, 1.5, 2.99), (0.0, 2.0, 0.0), (2.0, 0.0, 0.0), material=1)
    lamp = rooms.Part(lamp.vertices @ TURN.T, lamp.triangles, 1)
    parts = [rooms.box((0, 0, 0), ROOM, inward=True, turn=TURN), rooms.box(BLOCK_LOW, BLOCK_HIGH, turn=TURN), lamp]
    return rooms.scene(parts, albedo=[(0.7,) * 3, (0.0,) * 3], emission=[(0.0,) * 3, (5.0,) * 3])


@pytest.fixture(scope="module")
def lit_box() -> LitBox:
    return lit_box_of(room())


def lit_box_of(scene: Scene, margin: float = 0.0) -> LitBox:
    low, high = (corner.astype(float) for corner in scene.geometry.bounds())
    return drain(find_light_steps(scene, tuple(low - margin), tuple(high + margin)))


def distances(points: np.ndarray) -> np.ndarray:
    """Return how far points in the untilted room are from its walls and its block, (n,)."""
    walls = np.minimum(points, ROOM - points).min(axis=1)
    outside = np.maximum(BLOCK_LOW - points, points - BLOCK_HIGH)
    return np.minimum(walls, np.linalg.norm(np.maximum(outside, 0.0), axis=1))


def test_free_space_points_lie_in_the_room_and_nowhere_else(lit_box: LitBox) -> None:
    """The grid's box is wider than the room, and the block is closed."""
    places = free_space_points(lit_box, COUNT)
    assert places.points.shape == places.normals.shape == (COUNT, 3)
    assert distances(places.points @ TURN).min() >= 0.999 * CLEARANCE * lit_box.diagonal
    np.testing.assert_allclose(np.linalg.norm(places.normals, axis=1), 1.0)


def test_free_space_points_are_even(lit_box: LitBox) -> None:
    """Over the upper half of the room, which is empty, and over the sphere."""
    places = free_space_points(lit_box, COUNT)
    points = places.points @ TURN
    upper = points[(points[:, 2] > 1.5) & (points[:, 2] < 2.9)]
    cell = (upper * [4, 5, 1] / ROOM).astype(int)
    assert_counts(np.bincount(5 * cell[:, 0] + cell[:, 1], minlength=20), np.full(20, 1 / 20))
    octant = (places.normals > 0) @ [1, 2, 4]
    assert_counts(np.bincount(octant, minlength=8), np.full(8, 1 / 8))


def test_surface_points_lie_on_lit_sides_only(lit_box: LitBox) -> None:
    places = surface_points(lit_box, COUNT)
    points, normals = places.points @ TURN, places.normals @ TURN
    lift = LIFT * lit_box.diagonal
    lamp = np.abs(points[:, 2] - 2.99) < 2 * lift
    np.testing.assert_allclose(distances(points)[~lamp], lift, atol=1e-5)
    # A step along the normal leads away from the surface, into the room.
    assert distances(points + 0.01 * normals)[~lamp].min() > 0.009


def test_surface_points_are_spread_by_area(lit_box: LitBox) -> None:
    """Counted on the four walls, away from the floor; strips as wide as the clearance are left out at the edges."""
    places = surface_points(lit_box, COUNT)
    points, normals = places.points @ TURN, places.normals @ TURN
    upper = (points[:, 2] > 1.6) & (points[:, 2] < 2.9)
    walls = [upper & (normals[:, axis] * sign > 0.99) for axis in (0, 1) for sign in (1, -1)]
    clearance = 0.9 * CLEARANCE * lit_box.diagonal
    lengths = np.array([5.0, 5.0, 4.0, 4.0]) - 2 * clearance
    assert_counts([wall.sum() for wall in walls], lengths / lengths.sum())


def test_places_follow_from_the_seed(lit_box: LitBox) -> None:
    def same(a: Places, b: Places) -> bool:
        return bool(np.array_equal(a.points, b.points) and np.array_equal(a.normals, b.normals))

    for choose in (free_space_points, surface_points):
        assert same(choose(lit_box, 50, seed=3), choose(lit_box, 50, seed=3))
        assert not same(choose(lit_box, 50, seed=3), choose(lit_box, 50, seed=4))


def test_in_the_open_all_around_a_block_is_lit() -> None:
    """By a world: inside of the block it is dark, outside nothing bounds the light."""
    world = Lights(world=np.ones(3, dtype=np.float32))
    scene = rooms.scene([rooms.box(BLOCK_LOW, BLOCK_HIGH, turn=TURN)], lights=world)
    points = free_space_points(lit_box_of(scene, margin=1.0), COUNT).points @ TURN
    assert not ((points > BLOCK_LOW) & (points < BLOCK_HIGH)).all(axis=1).any()


def test_a_box_within_a_solid_has_no_places() -> None:
    inside = drain(find_light_steps(room(), *boxed(TURN @ (1.5, 2.0, 0.75), 0.1)))
    for choose in (free_space_points, surface_points):
        with pytest.raises(SceneError, match="move its bounds"):
            choose(inside, 10)


def boxed(centre: np.ndarray, half: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    return tuple(map(float, centre - half)), tuple(map(float, centre + half))


def test_distance_from_triangles() -> None:
    """Against the nearest of many points on the triangle."""
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(3, 3)).astype(np.float32)
    mix = rng.dirichlet((0.5, 0.5, 0.5), size=20_000)
    for centre in rng.normal(scale=1.5, size=(100, 3)):
        distance = np.linalg.norm(mix @ corners - centre, axis=1).min()
        for radius, expected in ((0.98 * distance - 0.02, True), (distance + 0.001, False)):
            clear = np.ones(1, dtype=np.bool_)
            find_clear(corners, np.array([[0, 1, 2]], dtype=np.int32), centre[None], max(radius, 0.0), clear)
            assert clear[0] == expected
