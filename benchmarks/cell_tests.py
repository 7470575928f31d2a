# SPDX-License-Identifier: GPL-3.0-or-later
"""Statistics of a comparison of two estimates of the irradiance in the dual cells of a grid.

A vertex's value towards an axis is the mean of the irradiance E(p, axis) over the points p of its dual cell. One side,
the bake, repeats itself with other seeds; the other, Cycles, is asked at random points of each cell, others for each
axis. Both are means of independent samples, so every sum of cells has an honest standard error on either side: how far
bakes, and points of one cell, scatter. What a single point's samples scatter by is part of the latter.

Tested are, per channel, the sum of everything, the sums over 1 and 27 blocks of cells per axis, and the single cells
per axis. Each test is a Welch t-test; the smallest p-value times the number of tests (Bonferroni, which holds for
correlated tests) is the p-value of the comparison.

What a few of Cycles' paths find, a lamp in a mirror or behind glass, has no honest standard error where few of them
found it: points that missed it neither see its light nor know how it scatters, and a t-test then finds Cycles too dark
(Cycles fails against its own mean of a thousand times as many paths). So the error is not taken from what the points of
a sum happened to see, but, if that is more, from what both sides should see if they are equal. Light that comes in
independent hits of weights w has, in a mean over n paths, the variance ω times its expectation, ω = E[w²]/(n E[w]): the
number of hits is a Poisson number. ω is known from all cells together, and the expectation from the bake. That is a
score test, where a test with the error that was seen is Wald's. Cells at the edge of light are left to the sums.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]

AXES = 6
"""+x, −x, +y, −y, +z, −z."""
BLOCKS = 3
"""Blocks of cells along an axis."""
_FEW_PHOTONS = 0.3
"""A sum is tested if the bakes scatter by less than this share of their mean: that is a dozen photons or more in each
bake, so that the mean over the bakes is normal."""
_MANY_PHOTONS = 12.0
"""Where no bake has any light, a sum is tested if so many photons a bake were due there."""


@dataclass(frozen=True)
class Cells:
    """The dual cells of a grid that its bounds do not cut.

    Parameters
    ----------
    bounds_min, bounds_max
        Of the grid, metres.
    resolution
        Voxels along each axis, 4 or more.
    """

    bounds_min: tuple[float, float, float]
    bounds_max: tuple[float, float, float]
    resolution: tuple[int, int, int]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return the number of cells along each axis."""
        i, j, k = self.resolution
        return i - 1, j - 1, k - 1

    @property
    def count(self) -> int:
        """Return the number of cells."""
        return math.prod(self.shape)

    def vertices(self) -> NDArray[np.int64]:
        """Return the indices of the cells' vertices in the grid, (cells, 3)."""
        axes = [np.arange(1, n) for n in self.resolution]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)

    def box(self) -> tuple[Float64, Float64]:
        """Return the corners of the box that the cells fill."""
        low, voxel = np.asarray(self.bounds_min, dtype=np.float64), self._voxel()
        return low + 0.5 * voxel, low + (np.asarray(self.resolution) - 0.5) * voxel

    def towards_axes(self, vectors: NDArray[np.float32]) -> Float64:
        """Return the irradiance of each cell towards the six axes, (cells, 6, 3 channels), of a grid's vectors."""
        picked = vectors[tuple(self.vertices().T)].astype(np.float64)
        axis = np.arange(AXES) // 2
        towards: Float64 = picked[:, np.arange(AXES), :, axis].transpose(1, 0, 2)
        return towards * np.array([1, -1] * 3)[None, :, None]

    def random_points(self, count: int, seed: int) -> tuple[Float64, Float64]:
        """Return so many random points in each cell for each axis, and the axes: (count, cells, 6, 3) twice."""
        shape = (count, self.count, AXES, 3)
        place = self.vertices()[None, :, None, :] + np.random.default_rng(seed).uniform(-0.5, 0.5, shape)
        normals = np.zeros((AXES, 3))
        normals[np.arange(AXES), np.arange(AXES) // 2] = [1, -1] * 3
        return np.asarray(self.bounds_min) + self._voxel() * place, np.broadcast_to(normals, shape)

    def blocks(self, divisions: int) -> Float64:
        """Return which cells belong to which of divisions³ blocks, (blocks, cells) of zeros and ones."""
        parts = [np.arange(n) * divisions // n for n in self.shape]
        i, j, k = np.meshgrid(*parts, indexing="ij")
        block = ((i * divisions + j) * divisions + k).reshape(-1)
        return (np.arange(divisions**3)[:, None] == block).astype(np.float64)

    def at_edge(self, points: Float64) -> NDArray[np.bool_]:
        """Tell per cell and axis, (cells, 6), whether it and its neighbours have both lit and dark points."""
        lit = points.max(axis=-1) > 0.0

        def nearby(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
            padded = np.pad(cells.reshape(*self.shape, AXES), ((1, 1), (1, 1), (1, 1), (0, 0)))
            windows = np.lib.stride_tricks.sliding_window_view(padded, (3, 3, 3), axis=(0, 1, 2))
            return windows.any(axis=(-1, -2, -3)).reshape(-1, AXES)

        return nearby(lit.any(axis=0)) & nearby(~lit.all(axis=0))

    def _voxel(self) -> Float64:
        return np.subtract(self.bounds_max, self.bounds_min) / self.resolution


@dataclass(frozen=True)
class Verdict:
    """How two estimates compare.

    Parameters
    ----------
    cells, tests
        Cells compared, and t-tests made.
    ratio, ratio_error
        Bake over Cycles, all light together, and its standard error. The ratio is not a number where neither side has
        light.
    largest_z
        The largest deviation, in standard errors of the normal distribution; positive where the bake has more light.
    p
        Upper bound of the probability of such a deviation where both sides have the same expectation.
    """

    cells: int
    tests: int
    ratio: float
    ratio_error: float
    largest_z: float
    p: float


def compare_cells(cells: Cells, baked: Float64, points: Float64) -> Verdict:
    """Test a bake against Cycles.

    Parameters
    ----------
    baked : (bakes, cells, 6, 3 channels)
        Means over cells, of independent bakes.
    points : (points, cells, 6, 3 channels)
        Irradiance at independent random points of each cell.
    """
    cycles = points.mean(axis=0)
    variance = points.var(axis=0, ddof=1) / len(points)
    edge = cells.at_edge(points)
    # The points of a cell at an edge may all have missed its lit part, or its dark one: what they did not see is of
    # the order of one point in their number.
    variance += edge[..., None] * (points.max(axis=(0, 1)) / len(points)) ** 2
    squares = variance**2 / (len(points) - 1)
    weight, freedom = _hit_weight(cycles, variance, squares)
    whole = (baked, cycles, variance, squares, weight * baked.mean(axis=0))
    deviations = [_deviations(*(values[..., ~edge, :] for values in whole), freedom)]
    for divisions in (1, BLOCKS):
        blocks = cells.blocks(divisions)
        deviations.append(_deviations(*(_sum(values, blocks) for values in whole), freedom))
    deviations.append(_deviations(*(values.sum(axis=(-3, -2)) for values in whole), freedom))
    z = np.concatenate(deviations)
    largest = float(z[np.abs(z).argmax()]) if len(z) else 0.0
    ratio, error = _ratio(baked.sum(axis=(1, 2, 3)), float(cycles.sum()), float(variance.sum()))
    return Verdict(
        cells=cells.count,
        tests=len(z),
        ratio=ratio,
        ratio_error=error,
        largest_z=largest,
        p=min(1.0, len(z) * math.erfc(abs(largest) / math.sqrt(2.0))) if len(z) else 1.0,
    )


def _hit_weight(cycles: Float64, variance: Float64, squares: Float64) -> tuple[Float64, float]:
    """Return ω of the module's text, (6, 3), of all cells, and its degrees of freedom, the least of all axes.

    Parameters
    ----------
    cycles, variance, squares : (cells, 6, 3)
        Means of Cycles, their squared standard errors v, and v² / ν.
    """
    light, total, spread = cycles.sum(axis=0), variance.sum(axis=0), squares.sum(axis=0)
    scatters = (light > 0.0) & (spread > 0.0)
    weight = np.divide(total, light, out=np.zeros_like(light), where=scatters)
    return weight, float(np.min(total[scatters] ** 2 / spread[scatters], initial=math.inf))


def _ratio(totals: Float64, cycles: float, variance: float) -> tuple[float, float]:
    """Return bake over Cycles and its standard error, of all bakes' totals (bakes,) and one of Cycles."""
    if cycles == 0.0:
        return (math.inf if totals.any() else math.nan), math.inf
    ratio = float(totals.mean()) / cycles
    error = math.hypot(float(totals.std(ddof=1)) / math.sqrt(len(totals)), ratio * math.sqrt(variance))
    return ratio, error / cycles


def _sum(values: Float64, blocks: Float64) -> Float64:
    """Return (…, blocks, 6, 3) sums of (…, cells, 6, 3)."""
    total: Float64 = np.einsum("bc,...cxy->...bxy", blocks, values)
    return total


def _deviations(
    baked: Float64, cycles: Float64, variance: Float64, squares: Float64, expected: Float64, freedom: float
) -> Float64:
    """Return Welch's t of each sum as the z of the normal distribution of the same p-value.

    Degrees of freedom are Welch's and Satterthwaite's, (Σ v)² / Σ (v² / ν) over all variances v that make up the
    difference, of ν degrees each. The transformation to z is Wallace's, "Bounds on Normal Approximations to Student's
    and the Chi-Square Distributions" (1959). A sum that no photon came to is tested if many should have come, by the
    weight that photons have in the brightest sum.

    Parameters
    ----------
    baked : (bakes, …)
    cycles, variance : (…)
        Sums of means of Cycles, and of their squared standard errors v.
    squares : (…)
        Sums of v² / ν.
    expected : (…)
        What v should be for the bake's light, known to so many degrees of `freedom`.
    """
    bakes = len(baked)
    mean, scatter2 = baked.mean(axis=0), baked.var(axis=0, ddof=1)
    squares = np.where(expected > variance, expected**2 / freedom, squares)
    error2 = scatter2 / bakes + np.maximum(expected, variance)
    few = np.where(mean > 0.0, scatter2 >= (_FEW_PHOTONS * mean) ** 2, ~_due(mean, scatter2, cycles))
    tested = (error2 > 0.0) & ~few
    both = error2[tested] ** 2 / ((scatter2[tested] / bakes) ** 2 / (bakes - 1) + squares[tested])
    t = (mean - cycles)[tested] / np.sqrt(error2[tested])
    z = np.sqrt(both * np.log1p(t * t / both)) * (8 * both + 1) / (8 * both + 3)
    return np.copysign(z, t)


def _due(mean: Float64, scatter2: Float64, cycles: Float64) -> NDArray[np.bool_]:
    """Tell where Cycles' light is that of many photons in each bake; everywhere if no bake has light anywhere."""
    if not mean.any():
        return np.ones(mean.shape, dtype=np.bool_)
    brightest = mean.argmax()
    weight = scatter2.flat[brightest] / mean.flat[brightest]
    return np.asarray(cycles >= _MANY_PHOTONS * weight)
