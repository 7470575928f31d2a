# SPDX-License-Identifier: GPL-3.0-or-later
"""From means over dual cells to the numbers that are interpolated.

A vertex c stores m_c, the mean of the light over the lit part of its dual cell. Look-ups interpolate, and the
interpolant of the means has other means than these: it is smoother, and where walls cut cells it is off, since a mean
over part of a cell belongs to that part and not to the vertex. So what is interpolated are values v whose trilinear
interpolant has the means that were measured:

    A v = m        A_cj = the mean over the lit part of cell c of the trilinear weight of vertex j

The rows of A sum to 1. The system is badly conditioned (a sliver's mean says next to nothing about its vertex, and
waves of two voxels are nearly lost), and m is noisy. Van Cittert's iteration v ← v + (m − A v) = m + (I − A) v,
stopped early, solves for what A keeps and leaves alone what it loses: after n steps from v = m, what A shrinks to a
share a has come back to 1 − (1 − a)ⁿ⁺¹. (van Cittert, "Zum Einfluß der Spaltbreite auf die Intensitätsverteilung in
Spektrallinien II", Zeitschrift für Physik 69, 1931.)
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from .compiled import kernel
from .moments import vectors
from .settings import Spatial

STEPS = 2
"""Of the iteration. In uncut cells one step takes back the smoothing to second order."""

CUBIC_SHARE = 1.0 / 12.0
"""Of second differences that the cubic B-spline needs taken off beyond what linear interpolation does.

For a field f with voxel size h, linear interpolation adds h²/12 f″ on average, the B-spline h²/6 f″, along each axis.
A has the former; the second difference of neighbouring vertices is h² f″.
"""

LEAST_VALIDITY = 0.5
"""Values of cells that are lit by less follow their lit parts: no second difference is taken there."""

Float32 = NDArray[np.float32]


@kernel
def step(weights, validity, means, values, i, counts, result):
    """Fill the plane i of result with m + (I − A) v, where validity is not 0.

    Rows of A are shared out among the valid vertices. Written as Σ_j A_cj (v_c − v_j), a uniform field stays to the
    bit.

    Parameters
    ----------
    weights : (Nj+1, Nk+1, 3, 3, 3) float32
        The plane's.
    validity : (Ni+1, Nj+1, Nk+1) float32
    means, values, result : (Ni+1, Nj+1, Nk+1, 54) float32
    """
    lost = np.empty(54, dtype=np.float32)
    for j in range(counts[1]):
        for k in range(counts[2]):
            if validity[i, j, k] == 0.0:
                continue
            total = np.float32(0.0)
            lost[:] = 0.0
            for a in range(max(i - 1, 0), min(i + 2, counts[0])):
                for b in range(max(j - 1, 0), min(j + 2, counts[1])):
                    for c in range(max(k - 1, 0), min(k + 2, counts[2])):
                        weight = weights[j, k, a - i + 1, b - j + 1, c - k + 1]
                        if weight > 0.0 and validity[a, b, c] > 0.0:
                            total += weight
                            for m in range(54):
                                lost[m] += weight * (values[i, j, k, m] - values[a, b, c, m])
            if total > 0.0:
                for m in range(54):
                    result[i, j, k, m] = means[i, j, k, m] + lost[m] / total


def deconvolved(
    means: Float32,
    validity: Float32,
    lit_weights: NDArray[np.float16],
    spatial: Spatial,
    divided: NDArray[np.bool_] | None = None,
    corrections: tuple[NDArray[np.int32], Float32] | None = None,
) -> Float32:
    """Return values whose interpolant has, nearly, the given means over the lit parts of the dual cells.

    Parameters
    ----------
    means : (Ni+1, Nj+1, Nk+1, 6, 3, 3) float32
    validity : (Ni+1, Nj+1, Nk+1) float32
        Lit shares; vertices with 0 stay as they are and take no part.
    lit_weights : (Ni+1, Nj+1, Nk+1, 3, 3, 3) float16
        A; entry (a, b, c) is that of the vertex (i + a − 1, j + b − 1, k + c − 1).
    spatial
        The interpolation that follows.
    divided : (Ni+1, Nj+1, Nk+1) bool, optional
        Vertices that speak for one side of a thin wall: beside them the interpolation is trilinear in any case.
    corrections : (k,) int32, (k, 12, 3) float32, optional
        What is added to the values that trilinear look-ups interpolate, in moments, at k vertices (surface_fit.py).
    """
    counts = np.array(validity.shape)
    m = means.reshape(*validity.shape, 54)
    values = m
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        for _ in range(STEPS):
            result = m.copy()

            def plane(i: int, values: Float32 = values, result: Float32 = result) -> None:
                step(lit_weights[i].astype(np.float32), validity, m, values, i, counts, result)

            list(pool.map(plane, range(counts[0])))
            values = result
    if corrections is not None and len(corrections[0]):
        added = vectors(corrections[1]).reshape(-1, 54).astype(np.float32)
        values = values.copy()
        values.reshape(-1, 54)[corrections[0]] += added
    if spatial is Spatial.TRICUBIC:
        values = _without_second_differences(values, validity, divided)
    return values.reshape(means.shape)


def _without_second_differences(values: Float32, validity: Float32, divided: NDArray[np.bool_] | None) -> Float32:
    """Return values minus `CUBIC_SHARE` of their second differences along each axis, among mostly lit vertices."""
    result = values.copy()
    known = validity >= LEAST_VALIDITY
    if divided is not None:
        known &= ~divided
    for axis in range(3):
        middle = _shifted(axis, 1, -1)
        before, after = _shifted(axis, 0, -2), _shifted(axis, 2, None)
        usable = known[middle] & known[before] & known[after]
        second = values[before] + values[after] - 2.0 * values[middle]
        second *= usable[..., None]
        result[middle] -= np.float32(CUBIC_SHARE) * second
    return result


def _shifted(axis: int, start: int, stop: int | None) -> tuple[slice, ...]:
    """Return an index that takes start:stop along one of the three grid axes."""
    return tuple(slice(start, stop) if k == axis else slice(None) for k in range(3))
