"""Sharpening: linear fields stay, the bias of quadratic ones goes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.prefilter import LEAST_VALIDITY, sharpened
from ivg_addon.core.settings import Spatial

from .grids import grid

Float64 = NDArray[np.float64]

LATTICE = Lattice((-1.0, 2.0, 0.5), (1.5, 3.0, 4.0), (7, 6, 8))

slopes = st.tuples(*[st.floats(-10, 10)] * 3)
SPLIT = np.array([-1, 1]) / np.sqrt(3)
"""Gauss's two nodes on [−1, 1]: exact for cubic polynomials."""


def spread(scalar: Float64) -> NDArray[np.float32]:
    """Return vectors all of whose 54 numbers are the vertices' scalar."""
    return np.broadcast_to(scalar[..., None, None, None], (*scalar.shape, 6, 3, 3)).astype(np.float32)


@pytest.mark.parametrize("spatial", Spatial)
@given(offset=st.floats(-10, 10), slope=slopes)
def test_linear_fields_stay(spatial: Spatial, offset: float, slope: tuple[float, ...]) -> None:
    vectors = spread(offset + LATTICE.vertex_positions() @ np.array(slope))
    result = sharpened(vectors, np.ones(LATTICE.shape, dtype=np.float32), spatial)
    np.testing.assert_allclose(result, vectors, atol=8 * 2.0**-23 * max(1.0, float(np.abs(vectors).max())))


def cell_means(curvature: Float64) -> Float64:
    """Return means of Σ a_k x_k² over whole dual cells: x² + h²/12 for each axis."""
    positions = LATTICE.vertex_positions()
    return np.asarray((curvature * (positions**2 + LATTICE.voxel_size**2 / 12)).sum(axis=-1))


@pytest.mark.parametrize("spatial", Spatial)
@pytest.mark.parametrize("curvature", [(1, 0, 0), (0, -2, 0), (0, 0, 0.5), (1, 2, -3)])
def test_quadratic_fields_lose_their_bias(spatial: Spatial, curvature: tuple[float, ...]) -> None:
    """Means over a voxel: of look-ups in the cells' means, as of the field itself.

    The B-spline is right pointwise; linear interpolation is right on average.
    """
    a = np.array(curvature, dtype=np.float64)
    offset = 100.0  # so that E stays positive
    made = grid(spread(offset + cell_means(a)), lattice=LATTICE)
    nodes = np.stack(np.meshgrid(*[SPLIT] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    # Look-ups here reach no vertex on the bounds, which has no second difference.
    for cell in [(2, 2, 2), (4, 3, 5), (3, 2, 4)]:
        points = LATTICE.bounds_min + LATTICE.voxel_size * (np.array(cell) + 0.5 + nodes / 2)
        e = made.irradiance(points, np.tile([1.0, 0.0, 0.0], (8, 1)), spatial, normal_bias=0.0)[:, 0]
        # All 54 numbers alike: E(x) = ½ F·x + ½ D_xx = the number, since D = 0 and F·x is twice it.
        errors = e - (offset + (a * points**2).sum(axis=-1))
        error = np.abs(errors).max() if spatial is Spatial.TRICUBIC else abs(errors.mean())
        assert error < 64 * 2.0**-23 * offset


@pytest.mark.parametrize("spatial", Spatial)
def test_without_sharpening_the_bias_is_there(spatial: Spatial) -> None:
    """h²/8 f″ for linear interpolation, h² (1/24 + 1/6) f″ for the B-spline: what the test above would find."""
    a = np.array([1.0, 0.0, 0.0])
    vectors = spread(cell_means(a))
    result = sharpened(vectors, np.ones(LATTICE.shape, dtype=np.float32), spatial)
    share = {Spatial.TRILINEAR: 1 / 8, Spatial.TRICUBIC: 5 / 24}[spatial]
    taken = (vectors - result)[1:-1, 1:-1, 1:-1]
    np.testing.assert_allclose(taken, 2 * share * LATTICE.voxel_size[0] ** 2, rtol=1e-3)


@pytest.mark.parametrize("spatial", Spatial)
def test_only_means_over_most_of_a_cell_are_differenced(spatial: Spatial) -> None:
    """A mostly unlit vertex changes neither itself nor, along the line through it, its neighbours."""
    rng = np.random.default_rng(0)
    vectors = rng.normal(size=(*LATTICE.shape, 6, 3, 3)).astype(np.float32)
    whole = np.ones(LATTICE.shape, dtype=np.float32)
    holed = whole.copy()
    holed[2, 2, 3] = np.nextafter(np.float32(LEAST_VALIDITY), np.float32(0))
    everywhere, here = sharpened(vectors, whole, spatial), sharpened(vectors, holed, spatial)
    np.testing.assert_array_equal(here[2, 2, 3], vectors[2, 2, 3])
    changed = (everywhere != here).any(axis=(-1, -2, -3))
    expected = np.zeros(LATTICE.shape, dtype=bool)
    expected[1:4, 2, 3] = expected[2, 1:4, 3] = expected[2, 2, 2:5] = True
    np.testing.assert_array_equal(changed, expected)
    # A neighbour keeps the second differences across.
    assert (here[1, 2, 3] != vectors[1, 2, 3]).any()
