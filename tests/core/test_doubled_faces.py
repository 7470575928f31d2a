# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces that lie exactly in others are found, whatever the order of their corners, and made black."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ivg_addon.core.doubled_faces import BLACK_NAME, MOST_IN_PLANE, blackened, doubled_triangles
from ivg_addon.core.scene import TRANSPARENT, Lobes, Scene

from .rooms import Part, quad, rotation, scene

WALL = quad((-1, -1, 0), (2, 0, 0), (0, 2, 0))


def doubles(of: Scene) -> tuple[list[int], list[int]]:
    across, others = doubled_triangles(of.geometry, of.materials, of.diffuse_visible)
    return sorted(across.tolist()), sorted(others.tolist())


def turned(part: Part) -> Part:
    return replace(part, vertices=part.vertices @ rotation((1, 2, 3), 0.7).T)


def reversed_copy(part: Part) -> Part:
    """Return it facing the other way, with other vertices."""
    return replace(part, triangles=part.triangles[:, [2, 1, 0]])


def test_a_wall_is_not_its_own_double() -> None:
    assert doubles(scene([WALL, quad((-1, -1, 1e-6), (2, 0, 0), (0, 2, 0))])) == ([], [])


def test_doubles_in_any_order_of_corners() -> None:
    above = quad((-1, -1, 0.5), (2, 0, 0), (0, 2, 0))
    assert doubles(scene([WALL, above, WALL])) == ([0, 1, 4, 5], [])
    assert doubles(scene([reversed_copy(WALL), above, WALL])) == ([0, 1, 4, 5], [])
    assert doubles(scene([turned(WALL), above, reversed_copy(turned(WALL))])) == ([], [0, 1, 4, 5])


def test_zero_has_no_sign() -> None:
    negative = replace(WALL, vertices=np.where(WALL.vertices == 0, -0.0, WALL.vertices))
    assert doubles(scene([WALL, negative])) == ([0, 1, 2, 3], [])


def test_what_shines_or_lets_light_through_is_left_alone() -> None:
    shining = scene([WALL, replace(WALL, material=1)], ((0.5,) * 3,) * 2, emission=((0,) * 3, (1,) * 3))
    assert doubles(shining) == ([], [])
    clear = Lobes(material=np.array([0], dtype=np.int32), kind=np.array([TRANSPARENT], dtype=np.int32))
    pane = scene([WALL, WALL])
    assert doubles(replace(pane, materials=replace(pane.materials, lobes=clear))) == ([], [])
    unseen = replace(pane, diffuse_visible=np.array([True, False]))
    assert doubles(unseen) == ([], [])


def test_they_become_black() -> None:
    room = scene([WALL, WALL, quad((0, 0, 1), (1, 0, 0), (0, 1, 0))])
    across, _ = doubled_triangles(room.geometry, room.materials, room.diffuse_visible)
    geometry, materials = blackened(room.geometry, room.materials, across)
    assert materials.names[-1] == BLACK_NAME
    np.testing.assert_array_equal(materials.albedo[geometry.material][:4], 0)
    np.testing.assert_array_equal(materials.albedo[geometry.material][4:], 0.5)
    assert len(materials.texture) == len(materials.emission) == len(materials.names)


def test_doubles_with_another_diagonal() -> None:
    other = replace(WALL, triangles=np.array([[0, 1, 3], [1, 2, 3]]))
    assert doubles(scene([WALL, other])) == ([0, 1, 2, 3], [])


def test_a_floor_that_something_stands_on_is_none() -> None:
    assert doubles(scene([WALL, quad((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0))])) == ([], [])


def test_neighbours_in_a_plane_are_none() -> None:
    tiles = [quad((x, y, 0.3), (0.1, 0, 0), (0, 0.1, 0)) for x in np.arange(10) / 10 for y in np.arange(10) / 10]
    assert doubles(scene(tiles)) == ([], [])


def test_large_planes_are_held_against_each_other_corner_by_corner() -> None:
    tiles = [quad((x, y, 0.3), (0.1, 0, 0), (0, 0.1, 0)) for x in np.arange(20) / 10 for y in np.arange(20) / 10]
    assert len(tiles) * 2 > MOST_IN_PLANE
    assert doubles(scene([*tiles, tiles[7]])) == ([14, 15, 800, 801], [])
