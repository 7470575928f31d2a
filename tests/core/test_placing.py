# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ivg_addon.core.placing import SMALLEST_AREA, measure_areas, place_normals, sound_triangles

TRIANGLE = np.array([[0, 1, 2]], dtype=np.int32)
lengths = st.floats(np.float32(1e-3), np.float32(1e3), width=32)
coordinates = st.floats(-100, 100, width=32)


def normals_and_areas(corners: object) -> tuple[np.ndarray, np.ndarray]:
    """Return the normal and the area of one triangle that is shaded flat, (1, 3) and (1,)."""
    vertices, areas = np.array(corners, dtype=np.float32), np.empty(1)
    measure_areas(vertices, TRIANGLE, areas)
    normals = np.empty((1, 3, 3), dtype=np.float32)
    none, first = np.zeros((0, 3), dtype=np.float32), np.zeros(1, dtype=np.int64)
    place_normals(vertices, TRIANGLE, TRIANGLE, first, none, np.eye(3)[None], 1, normals)
    np.testing.assert_array_equal(normals, np.repeat(normals[:, :1], 3, axis=1))
    return normals[:, 0], areas


@given(lengths, lengths)
def test_right_triangle(width: float, height: float) -> None:
    normals, areas = normals_and_areas([(0, 0, 0), (width, 0, 0), (0, height, 0)])
    np.testing.assert_array_equal(normals, [[0, 0, 1]])
    assert areas[0] == pytest.approx(width * height / 2, rel=1e-12)
    assert sound_triangles(areas).all()


@given(st.tuples(*[coordinates] * 9), st.permutations(range(3)))
def test_normal_turns_with_the_winding_and_area_stays(values: tuple[float, ...], order: list[int]) -> None:
    corners = np.array(values, dtype=np.float32).reshape(3, 3)
    normals, areas = normals_and_areas(corners)
    turned, same = normals_and_areas(corners[order])
    odd = order in ([0, 2, 1], [1, 0, 2], [2, 1, 0])
    assert same[0] == pytest.approx(areas[0], rel=1e-6, abs=1e-9)
    if areas[0] > 1e-3:
        np.testing.assert_allclose(turned, -normals if odd else normals, atol=1e-6)
        np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-6)


@pytest.mark.parametrize(
    "corners",
    [
        [(0, 0, 0), (0, 0, 0), (1, 0, 0)],
        [(0, 0, 0), (1, 1, 1), (2, 2, 2)],
        [(5, 5, 5)] * 3,
        [(0, 0, 0), (1, 0, 0), (0, np.nan, 0)],
        [(0, 0, 0), (np.inf, 0, 0), (0, 1, 0)],
        [(0, 0, 0), (np.inf, 0, 0), (-np.inf, 1, 0)],
        [(0, 0, 0), (np.inf, 1, 1), (1, 2, 3)],
        [(0, 0, 0), (1e-10, 0, 0), (0, 1e-10, 0)],
    ],
)
def test_triangles_that_cannot_be_lit(corners: list[tuple[float, ...]]) -> None:
    assert not sound_triangles(normals_and_areas(corners)[1]).any()


def test_smallest_triangle_that_counts() -> None:
    side = np.sqrt(2 * SMALLEST_AREA) * np.array([0.9, 1.1])
    areas = np.array([normals_and_areas([(0, 0, 0), (s, 0, 0), (0, s, 0)])[1][0] for s in side])
    np.testing.assert_array_equal(sound_triangles(areas), [False, True])


def test_large_finite_coordinates_are_kept() -> None:
    assert sound_triangles(normals_and_areas([(1e30, 0, 0), (-1e30, 0, 0), (0, 1e30, 0)])[1]).all()
