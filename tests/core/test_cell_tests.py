# SPDX-License-Identifier: GPL-3.0-or-later
"""The comparison of a bake with Cycles finds what differs, and only that."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.cell_tests import AXES, BLOCKS, Cells, compare_cells

CELLS = Cells((-1.0, -1.0, 0.0), (1.0, 1.0, 1.5), (8, 8, 6))
BAKES, POINTS = 16, 16
MEAN = 400.0
SIGNIFICANT = 1e-7
"""Probability below which two estimates differ."""


def estimates(seed: int, mean: float | np.ndarray = MEAN) -> tuple[np.ndarray, np.ndarray]:
    """Return a bake by counted photons, and points that are means of eight exponential numbers, of the same mean."""
    rng = np.random.default_rng(seed)
    expected = np.broadcast_to(mean, (CELLS.count, AXES, 3))
    baked = rng.poisson(expected, (BAKES, *expected.shape)).astype(np.float64)
    return baked, expected * rng.gamma(8.0, 1 / 8, (POINTS, *expected.shape))


def test_equal_light_passes_as_often_as_it_should() -> None:
    """Bonferroni's bound: of 60 comparisons, p < 0.1 in 6 or fewer on average; 17 or more with less than 1e-4."""
    found = [compare_cells(CELLS, *estimates(seed)) for seed in range(60)]
    assert sum(verdict.p < 0.1 for verdict in found) < 17
    assert min(verdict.p for verdict in found) > SIGNIFICANT
    # Chi-square of 60 squared deviations of the totals: within 24 and 115 but for 1e-5.
    total = sum(((verdict.ratio - 1.0) / verdict.ratio_error) ** 2 for verdict in found)
    assert 24.0 < total < 115.0


@pytest.mark.parametrize("factor", [0.97, 1.03])
def test_three_per_cent_are_found(factor: float) -> None:
    baked, points = estimates(1)
    assert compare_cells(CELLS, factor * baked, points).p < SIGNIFICANT


def test_light_in_the_wrong_block_is_found() -> None:
    """The total is right."""
    blocks = CELLS.blocks(BLOCKS)
    moved = MEAN * (1.0 + 0.2 * blocks[0] - 0.2 * blocks[26] * blocks[0].sum() / blocks[26].sum())
    baked, _ = estimates(2, moved[:, None, None])
    _, points = estimates(3)
    verdict = compare_cells(CELLS, baked, points)
    assert abs(verdict.ratio - 1.0) < 0.01
    assert verdict.p < SIGNIFICANT


def test_light_towards_the_wrong_axis_is_found() -> None:
    rising = MEAN * np.linspace(0.8, 1.2, AXES)[None, :, None]
    baked, _ = estimates(4, rising)
    assert compare_cells(CELLS, baked[:, :, ::-1], estimates(5, rising)[1]).p < SIGNIFICANT


def test_a_bake_without_light_is_found() -> None:
    baked, points = estimates(6)
    verdict = compare_cells(CELLS, np.zeros_like(baked), points)
    assert verdict.p < SIGNIFICANT
    assert verdict.ratio == 0.0
    assert verdict.largest_z < 0.0


def test_a_bake_without_light_towards_one_axis_is_found() -> None:
    baked, points = estimates(7)
    baked[:, :, 3] = 0.0
    assert compare_cells(CELLS, baked, points).p < SIGNIFICANT


def test_light_where_cycles_has_none_is_found() -> None:
    baked, points = estimates(8)
    assert compare_cells(CELLS, baked, np.zeros_like(points)).p < SIGNIFICANT


def test_two_dark_estimates_agree() -> None:
    baked, points = estimates(9)
    verdict = compare_cells(CELLS, np.zeros_like(baked), np.zeros_like(points))
    assert (verdict.tests, verdict.p) == (0, 1.0)


def test_rare_hits_are_no_alarm() -> None:
    """One path in thirty finds a lamp in a mirror: of the points of most cells, none to five do.

    Bonferroni's bound: p below 1e-3 in six of 200 or more with a chance of less than 1e-4. With errors from what the
    points happened to see it was so in 29.
    """
    rng = np.random.default_rng(12)
    light = 1.0 + 400.0 * rng.random((CELLS.count, 1, 1)) ** 4
    found = []
    for _ in range(200):
        baked = rng.poisson(100.0 * light, (BAKES, CELLS.count, AXES, 3)) / 100.0
        hits = rng.poisson(light / 100.0, (POINTS, CELLS.count, AXES, 1))
        points = 1.0 * light + 100.0 * hits * rng.gamma(4.0, 1 / 4, (POINTS, CELLS.count, AXES, 3))
        found.append(compare_cells(CELLS, baked + 1.0 * light, points).p < 1e-3)
    assert sum(found) < 6


def test_few_photons_are_no_proof() -> None:
    """Where a photon a bake comes, none at all may come."""
    light = np.full((CELLS.count, 1, 1), 0.05)
    light[0] = MEAN
    baked, points = estimates(10, light)
    assert compare_cells(CELLS, baked, points).p > SIGNIFICANT


def test_points_lie_in_their_cells() -> None:
    points, normals = CELLS.random_points(5, seed=1)
    low, high = CELLS.box()
    assert (points >= low).all() and (points <= high).all()
    voxel = (np.array(CELLS.bounds_max) - CELLS.bounds_min) / CELLS.resolution
    vertices = CELLS.bounds_min + voxel * CELLS.vertices()
    assert (np.abs(points - vertices[None, :, None]) <= 0.5 * voxel + 1e-12).all()
    np.testing.assert_array_equal(normals[0, 0], [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)])


def test_vectors_towards_axes() -> None:
    vectors = np.zeros((9, 9, 7, 6, 3, 3), dtype=np.float32)
    vectors[..., 3, 1, :] = (5.0, -2.0, 7.0)
    towards = CELLS.towards_axes(vectors)
    assert towards.shape == (245, 6, 3)
    assert (towards[:, 3, 1] == 2.0).all()
    assert np.count_nonzero(towards) == 245


def test_edges_are_where_lit_and_dark_points_meet() -> None:
    points = np.ones((4, *CELLS.shape, AXES, 3))
    points[:, 3:] = 0.0
    edge = CELLS.at_edge(points.reshape(4, -1, AXES, 3)).reshape(*CELLS.shape, AXES)
    np.testing.assert_array_equal(edge[:, 0, 0, 0], [False, False, True, True, False, False, False])
