# SPDX-License-Identifier: GPL-3.0-or-later
"""The lattice: dual cells fill the box, their faces fill its cross-sections."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ivg_addon.core.dual_cells import Lattice

resolutions = st.tuples(*[st.integers(1, 6)] * 3)
corners = st.tuples(*[st.floats(-1e3, 1e3)] * 3)
edges = st.tuples(*[st.floats(1e-2, 1e3)] * 3)


def lattice(low: tuple[float, ...], size: tuple[float, ...], resolution: tuple[int, ...]) -> Lattice:
    high = tuple(a + b for a, b in zip(low, size, strict=True))
    return Lattice(low, high, resolution)  # type: ignore[arg-type]


@given(corners, edges, resolutions)
def test_volumes_sum_up_to_the_box(
    low: tuple[float, ...], size: tuple[float, ...], resolution: tuple[int, ...]
) -> None:
    grid = lattice(low, size, resolution)
    volumes = grid.cell_volumes()
    extent = np.subtract(grid.bounds_max, grid.bounds_min)
    assert volumes.shape == grid.shape
    assert volumes.size == grid.vertex_count
    assert volumes.sum() == pytest.approx(extent.prod(), rel=1e-12)
    assert volumes[0, 0, 0] == pytest.approx(grid.voxel_size.prod() / 8, rel=1e-12)


@given(corners, edges, resolutions)
def test_faces_sum_up_to_each_cross_section(
    low: tuple[float, ...], size: tuple[float, ...], resolution: tuple[int, ...]
) -> None:
    grid = lattice(low, size, resolution)
    areas = grid.face_areas()
    extent = np.subtract(grid.bounds_max, grid.bounds_min)
    for axis in range(3):
        sections = np.moveaxis(areas[..., axis], axis, 0).reshape(grid.shape[axis], -1).sum(axis=1)
        np.testing.assert_allclose(sections, extent.prod() / extent[axis], rtol=1e-12)


@given(corners, edges, resolutions)
def test_vertices_are_evenly_spaced_from_corner_to_corner(
    low: tuple[float, ...], size: tuple[float, ...], resolution: tuple[int, ...]
) -> None:
    grid = lattice(low, size, resolution)
    positions = grid.vertex_positions()
    np.testing.assert_array_equal(positions[0, 0, 0], grid.bounds_min)
    np.testing.assert_array_equal(positions[-1, -1, -1], grid.bounds_max)
    scale = np.abs([grid.bounds_min, grid.bounds_max]).max()
    for axis in range(3):
        steps = np.diff(positions[..., axis], axis=axis)
        np.testing.assert_allclose(steps, grid.voxel_size[axis], rtol=1e-12, atol=1e-12 * scale)


def test_a_cell_that_the_bounds_cut_keeps_half_a_quarter_or_an_eighth() -> None:
    grid = Lattice((0, 0, 0), (2, 4, 6), (2, 2, 2))
    volumes = grid.cell_volumes() / grid.voxel_size.prod()
    assert [volumes[1, 1, 1], volumes[0, 1, 1], volumes[0, 2, 1], volumes[0, 2, 2]] == [1, 1 / 2, 1 / 4, 1 / 8]
    # Perpendicular to x: the cell at an edge of the grid along x keeps a quarter of its face.
    assert grid.face_areas()[1, 0, 2, 0] == grid.voxel_size[1] * grid.voxel_size[2] / 4


@given(resolutions)
def test_weights_of_whole_cells_are_means_of_trilinear_weights(resolution: tuple[int, ...]) -> None:
    """By the midpoints of each octant, which are exact for what is linear along each axis."""
    grid = lattice((0, 0, 0), (1, 1, 1), resolution)
    weights = grid.whole_cell_weights()
    assert weights.shape == (*grid.shape, 3, 3, 3)
    assert weights.dtype == np.float16
    expected = np.zeros(weights.shape)
    for vertex in np.ndindex(grid.shape):
        halves = [
            [side for side in (-1, 1) if 0 <= i + side < count] for i, count in zip(vertex, grid.shape, strict=True)
        ]
        for octant in itertools.product(*halves):
            for beyond in itertools.product((0, 1), repeat=3):
                entry = tuple(1 + s * o for s, o in zip(octant, beyond, strict=True))
                expected[vertex][entry] += np.prod([1 / 4 if o else 3 / 4 for o in beyond]) / np.prod(
                    [len(half) for half in halves]
                )
    np.testing.assert_array_equal(weights, expected)
    np.testing.assert_array_equal(weights.astype(np.float64).sum(axis=(-3, -2, -1)), 1)
