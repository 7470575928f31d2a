# SPDX-License-Identifier: GPL-3.0-or-later
"""Readings are look-ups, written as the linear maps that they are."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.moments import moments, vectors
from ivg_addon.core.partitions import Partitions
from ivg_addon.core.readings import MOMENTS, Readings, moment_coefficients
from ivg_addon.core.reconstruction import coefficients
from ivg_addon.core.settings import Directional, Spatial

from .grids import LATTICE, UNIFORM, grid
from .rooms import rotation

Float64 = NDArray[np.float64]


def directions(rng: np.random.Generator, count: int) -> Float64:
    normals = rng.normal(size=(count, 3))
    return np.asarray(normals / np.linalg.norm(normals, axis=1, keepdims=True))


def test_coefficients_are_those_of_the_reconstruction() -> None:
    rng = np.random.default_rng(1)
    normals, values = directions(rng, 50), rng.normal(size=(MOMENTS, 3))
    expected = [np.einsum("dj,dcj->c", coefficients(n, Directional.LEAST_SQUARES), vectors(values)) for n in normals]
    np.testing.assert_allclose(moment_coefficients(normals) @ values, expected, atol=1e-12)


def bright_grid(divided: bool) -> IrradianceVectorGrid:
    """Return a grid of light that no look-up finds below zero, some vertices unlit, others with planes."""
    rng = np.random.default_rng(2)
    values = UNIFORM * (1.0 + 0.1 * rng.random((*LATTICE.shape, 1, 1, 1)))
    validity = rng.choice([0.0, 0.03, 0.5, 1.0], LATTICE.shape)
    start = np.zeros(LATTICE.vertex_count + 1, dtype=np.int32)
    plane = np.zeros((0, 5), dtype=np.float32)
    if divided:
        owners = rng.random(LATTICE.vertex_count) < 0.3
        start[1:] = np.cumsum(owners)
        tilt = rotation((1, 2, 3), 0.4)[0]
        middle = tilt @ (np.array(LATTICE.resolution) / 2)
        plane = np.tile(np.array([*tilt, middle, 0.1], dtype=np.float32), (int(owners.sum()), 1))
    return grid(values, validity, partitions=Partitions(start, plane))


@pytest.mark.parametrize("divided", [False, True])
def test_readings_are_look_ups(divided: bool) -> None:
    """To single precision; where rounding takes a place to another voxel, or another side, is too rare to be met."""
    rng = np.random.default_rng(3)
    made = bright_grid(divided)
    points = rng.uniform(made.bounds_min - 0.1, made.bounds_max + 0.1, (3000, 3))
    normals = directions(rng, len(points))
    readings = Readings.of(made, points, normals, np.eye(MOMENTS))
    values = moments(made.interpolated(Spatial.TRILINEAR)).reshape(-1, MOMENTS, 3)
    np.testing.assert_allclose(readings.irradiance(values), made.irradiance(points, normals), rtol=2e-5, atol=2e-5)


def test_the_transposed_map() -> None:
    """⟨e, C x⟩ = ⟨Cᵀ e, x⟩, whatever the coordinates."""
    rng = np.random.default_rng(4)
    made = bright_grid(False)
    points = rng.uniform(made.bounds_min, made.bounds_max, (500, 3))
    readings = Readings.of(made, points, directions(rng, 500), rng.normal(size=(MOMENTS, 5)))
    x, e = rng.normal(size=(LATTICE.vertex_count, 5, 3)), rng.normal(size=(500, 3))
    there, back = readings.irradiance(x), readings.transposed(e)
    np.testing.assert_allclose((e * there).sum(axis=0), (back * x).sum(axis=(0, 1)), rtol=1e-9)
