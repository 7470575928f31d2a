# SPDX-License-Identifier: GPL-3.0-or-later
"""Deconvolution: uniform fields stay, smoothing is taken back by the share that its transfer function has."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.prefilter import LEAST_VALIDITY, STEPS, deconvolved
from ivg_addon.core.settings import Spatial

from .grids import grid, matrix, spread

Float64 = NDArray[np.float64]

LATTICE = Lattice((-1.0, 2.0, 0.5), (1.5, 3.0, 4.0), (7, 6, 8))
SMALL = Lattice((0, 0, 0), (1, 1, 1), (3, 1, 2))
ROUNDING = 2.0**-23

spatials = st.sampled_from(list(Spatial))
SPLIT = np.array([-1, 1]) / np.sqrt(3)
"""Gauss's two nodes on [−1, 1]: exact for cubic polynomials."""


def lit(lattice: Lattice = LATTICE) -> tuple[NDArray[np.float32], NDArray[np.float16]]:
    """Return validity and lit weights of a lattice that is lit all over."""
    return np.ones(lattice.shape, dtype=np.float32), lattice.whole_cell_weights()


def cut_at_random(lattice: Lattice, seed: int) -> tuple[NDArray[np.float32], NDArray[np.float16]]:
    """Return any validity, with vertices without light, and any weights, those of vertices beyond the bounds too."""
    rng = np.random.default_rng(seed)
    validity = rng.random(lattice.shape) * (rng.random(lattice.shape) < 0.7)
    return validity.astype(np.float32), rng.random((*lattice.shape, 3, 3, 3)).astype(np.float16)


# --- The system -------------------------------------------------------------------------------------------------------


@given(seed=st.integers(0, 1000))
def test_it_is_two_steps_of_the_iteration(seed: int) -> None:
    validity, weights = cut_at_random(SMALL, seed)
    means = np.random.default_rng(seed).normal(size=(*SMALL.shape, 6, 3, 3)).astype(np.float32)
    a, m = matrix(validity, weights), means.reshape(-1, 54).astype(np.float64)
    v = m
    for _ in range(2):
        v = v + (m - a @ v)
    found = deconvolved(means, validity, weights, Spatial.TRILINEAR)
    # Rows of I − A sum up to at most 2 in magnitude, twice; products of 27 terms lose a few bits.
    np.testing.assert_allclose(found.reshape(-1, 54), v, atol=27 * 4 * ROUNDING * np.abs(m).max())


@given(seed=st.integers(0, 1000), value=st.floats(-1e6, 1e6, width=32), spatial=spatials)
def test_uniform_fields_stay_to_the_bit(seed: int, value: float, spatial: Spatial) -> None:
    """Whatever stands at vertices without light."""
    validity, weights = cut_at_random(LATTICE, seed)
    means = spread(np.where(validity > 0, value, 1e30))
    np.testing.assert_array_equal(deconvolved(means, validity, weights, spatial), means)


@given(seed=st.integers(0, 1000), spatial=spatials)
def test_vertices_without_light_take_no_part(seed: int, spatial: Spatial) -> None:
    validity, weights = cut_at_random(LATTICE, seed)
    rng = np.random.default_rng(seed)
    means = rng.normal(size=(*LATTICE.shape, 6, 3, 3)).astype(np.float32)
    others = np.where((validity > 0)[..., None, None, None], means, np.float32(1e10))
    first, second = (deconvolved(x, validity, weights, spatial) for x in (means, others))
    np.testing.assert_array_equal(first[validity > 0], second[validity > 0])
    np.testing.assert_array_equal(second[validity == 0], np.float32(1e10))


def test_cells_that_say_nothing_keep_their_means() -> None:
    """No weight for any lit vertex: a damaged file at worst, but no number that is none."""
    means = spread(np.random.default_rng(0).normal(size=LATTICE.shape))
    validity, weights = lit()
    np.testing.assert_array_equal(deconvolved(means, validity, 0 * weights, Spatial.TRILINEAR), means)


@pytest.mark.parametrize("spatial", Spatial)
def test_any_number_of_threads_gives_the_same_bits(spatial: Spatial, monkeypatch: pytest.MonkeyPatch) -> None:
    validity, weights = cut_at_random(LATTICE, 0)
    means = np.random.default_rng(1).normal(size=(*LATTICE.shape, 6, 3, 3)).astype(np.float32)
    results = []
    for threads in (1, 2, 7):
        monkeypatch.setattr(os, "cpu_count", lambda threads=threads: threads)
        results.append(deconvolved(means, validity, weights, spatial))
    for result in results[1:]:
        np.testing.assert_array_equal(result, results[0])


def test_the_means_are_not_touched() -> None:
    means = spread(np.random.default_rng(0).normal(size=LATTICE.shape))
    before = means.copy()
    for spatial in Spatial:
        deconvolved(means, *lit(), spatial)
    np.testing.assert_array_equal(means, before)


# --- What it takes back -----------------------------------------------------------------------------------------------

waves = st.tuples(*[st.floats(0, np.pi)] * 3)


@given(k=waves, phase=st.floats(0, 2 * np.pi))
def test_waves_come_back_by_the_transfer_function(k: tuple[float, ...], phase: float) -> None:
    """Of a wave that A shrinks to a share a, 1 − (1 − a)³ is there again; k in radians a voxel, far from the bounds."""
    i = np.indices(LATTICE.shape)
    field = np.prod([np.cos(k[axis] * i[axis] + phase) for axis in range(3)], axis=0)
    a = np.prod(3 / 4 + np.cos(k) / 4)
    inside = (slice(STEPS, -STEPS),) * 3
    found = deconvolved(spread(a * field), *lit(), Spatial.TRILINEAR)[..., 0, 0, 0]
    np.testing.assert_allclose(found[inside], ((1 - (1 - a) ** 3) * field)[inside], atol=64 * ROUNDING)


def linear_means(slope: Float64) -> tuple[Float64, Float64]:
    """Return a linear field at the vertices, and its means over the dual cells, half of one at the bounds."""
    positions = LATTICE.vertex_positions()
    centres = positions.copy()
    for axis, h in enumerate(LATTICE.voxel_size):
        along = np.moveaxis(centres[..., axis], axis, 0)
        along[0] += h / 4
        along[-1] -= h / 4
    return positions @ slope, centres @ slope


@pytest.mark.parametrize("spatial", Spatial)
@given(slope=st.tuples(*[st.floats(-10, 10)] * 3).map(np.array))
def test_linear_fields_stay_inside_and_come_back_at_the_bounds(spatial: Spatial, slope: Float64) -> None:
    """At the bounds the means err by e = h/4 times the slope; after two steps 3/32 e, −1/16 e and 1/64 e are left.

    With I − A = (1/4, −1/4; −1/8, 1/4, −1/8; 0, −1/8, 1/4 …) along the axis, these are (I − A)² (e, 0, 0 …).
    """
    field, means = linear_means(slope)
    expected = field.copy()
    for axis, h in enumerate(LATTICE.voxel_size):
        along = np.moveaxis(expected, axis, 0)
        for depth, share in enumerate((3 / 32, -1 / 16, 1 / 64)):
            along[depth] += share * slope[axis] * h / 4
            along[-1 - depth] -= share * slope[axis] * h / 4
    found = deconvolved(spread(means), *lit(), spatial)[..., 0, 0, 0]
    part = (slice(None),) * 3 if spatial is Spatial.TRILINEAR else (slice(4, -4), slice(3, -3), slice(4, -4))
    atol = 64 * ROUNDING * max(1.0, float(np.abs(means).max()))
    np.testing.assert_allclose(found[part], expected[part], atol=atol)


WIDE = Lattice((-1.0, 2.0, 0.5), (1.5, 3.0, 4.0), (13, 12, 14))


@pytest.mark.parametrize("spatial", Spatial)
@pytest.mark.parametrize("curvature", [(1, 0, 0), (0, -2, 0), (0, 0, 0.5), (1, 2, -3)])
def test_quadratic_fields_lose_their_bias(spatial: Spatial, curvature: tuple[float, ...]) -> None:
    """Means over a voxel: of look-ups in the cells' means, as of the field itself.

    The B-spline is right pointwise; linear interpolation is right on average.
    """
    a = np.array(curvature, dtype=np.float64)
    offset = 100.0  # so that E stays positive
    # Means of Σ a_k x_k² over whole dual cells: x² + h²/12 for each axis.
    means = (a * (WIDE.vertex_positions() ** 2 + WIDE.voxel_size**2 / 12)).sum(axis=-1)
    made = grid(spread(offset + means), lattice=WIDE)
    nodes = np.stack(np.meshgrid(*[SPLIT] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    # What the bounds do reaches three vertices inwards, and a B-spline with its second differences two farther.
    for cell in [(6, 6, 6), (7, 5, 8), (5, 6, 7)]:
        points = WIDE.bounds_min + WIDE.voxel_size * (np.array(cell) + 0.5 + nodes / 2)
        e = made.irradiance(points, np.tile([1.0, 0.0, 0.0], (8, 1)), spatial, normal_bias=0.0)[:, 0]
        # All 54 numbers alike: E(x) = ½ F·x + ½ D_xx = the number, since D = 0 and F·x is twice it.
        errors = e - (offset + (a * points**2).sum(axis=-1))
        error = np.abs(errors).max() if spatial is Spatial.TRICUBIC else abs(errors.mean())
        assert error < 64 * ROUNDING * offset


@pytest.mark.parametrize("spatial", Spatial)
def test_the_bias_is_there_without(spatial: Spatial) -> None:
    """h² (1/24 + 1/12) f″ for linear interpolation, h² (1/24 + 1/6) f″ for the B-spline: what the test above finds."""
    means = spread(WIDE.vertex_positions()[..., 0] ** 2)
    taken = (means - deconvolved(means, *lit(WIDE), spatial))[4:-4, 4:-4, 4:-4]
    share = {Spatial.TRILINEAR: 1 / 8, Spatial.TRICUBIC: 5 / 24}[spatial]
    np.testing.assert_allclose(taken, 2 * share * WIDE.voxel_size[0] ** 2, rtol=1e-3)


def test_only_mostly_lit_cells_are_differenced_for_the_spline() -> None:
    """A mostly unlit vertex changes neither itself nor, along the line through it, its neighbours."""
    means = np.random.default_rng(0).normal(size=(*LATTICE.shape, 6, 3, 3)).astype(np.float32)
    whole, weights = lit()
    holed = whole.copy()
    holed[2, 2, 3] = np.nextafter(np.float32(LEAST_VALIDITY), np.float32(0))
    everywhere, here = (deconvolved(means, v, weights, Spatial.TRICUBIC) for v in (whole, holed))
    linear = deconvolved(means, holed, weights, Spatial.TRILINEAR)
    np.testing.assert_array_equal(here[2, 2, 3], linear[2, 2, 3])
    changed = (everywhere != here).any(axis=(-1, -2, -3))
    expected = np.zeros(LATTICE.shape, dtype=bool)
    expected[1:4, 2, 3] = expected[2, 1:4, 3] = expected[2, 2, 2:5] = True
    np.testing.assert_array_equal(changed, expected)
    # A neighbour keeps the second differences across.
    assert (here[1, 2, 3] != linear[1, 2, 3]).any()


def test_look_ups_of_the_report_take_the_means() -> None:
    means: Any = np.random.default_rng(0).random((*LATTICE.shape, 6, 3, 3))
    made = grid(means, lattice=LATTICE)
    vertices = LATTICE.vertex_positions().reshape(-1, 3)
    up = np.tile([0.0, 0.0, 1.0], (len(vertices), 1))
    for directional, same in (("REPORT", True), ("LEAST_SQUARES", False)):
        e = made.irradiance(vertices, up, directional=directional)
        assert np.allclose(e, means[..., 4, :, 2].reshape(-1, 3), rtol=1e-5) == same
