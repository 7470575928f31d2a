# SPDX-License-Identifier: GPL-3.0-or-later
"""Points spread evenly through dual cells: where they lie, on whose side, and what interpolation weighs there."""

from __future__ import annotations

import numpy as np

from .compiled import inlined, kernel, merged
from .random import STREAM_LIT_VOLUME, random4
from .sides import NO_NORMAL, speaks_for

# The generalised golden ratio in three dimensions: 1/g, 1/g², 1/g³ with g⁴ = g + 1 make an additive
# sequence of low discrepancy (Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences").
_G = 1.2207440846057596
_R3 = (1.0 / _G, 1.0 / _G**2, 1.0 / _G**3)


@inlined
def sequence_point(shift, point, axis):
    """Return a coordinate in [0, 1) of a point of the sequence, shifted by as many random numbers as there are axes."""
    x = shift[axis] + (point + 1) * _R3[axis]
    return x - np.floor(x)


@inlined
def _coordinate(shift, point, axis, index, count):
    """Return where a dual cell's point lies along an axis, in voxels from the grid's lower bound."""
    a = max(index - 0.5, 0.0)
    b = min(index + 0.5, count - 1.0)
    return a + (b - a) * sequence_point(shift, point, axis)


@inlined
def vertex_indices(vertex, counts):
    """Return (i, j, k) of a flat vertex index."""
    return vertex // (counts[1] * counts[2]), vertex // counts[2] % counts[1], vertex % counts[2]


@kernel
def spread_points(cells, first_point, count, seed, low, voxel, counts, origins):
    """Fill origins with points first_point … + count − 1 of each cell, cell after cell.

    The points of a cell are a low-discrepancy sequence with a random shift of its own.

    Parameters
    ----------
    cells : (n,) int64
        Flat vertex indices.
    origins : (n · count, 3) float32
        Changed in place.
    """
    for index in range(len(cells)):
        ijk = vertex_indices(cells[index], counts)
        shift = random4(seed, cells[index], STREAM_LIT_VOLUME)
        for point in range(count):
            row = index * count + point
            for axis in range(3):
                x = _coordinate(shift, first_point + point, axis, ijk[axis], counts[axis])
                origins[row, axis] = np.float32(low[axis] + x * voxel[axis])


@kernel
def mean_weights(cells, lit, seed, counts, start, planes, beside, weights):
    """Fill weights with the means of the trilinear weights over the lit points of each cell.

    Vertices that do not speak for a point have no weight there, the others the more.

    Parameters
    ----------
    cells : (n,) int64
        Flat vertex indices.
    lit : (n, count) bool
        Which of the cell's first `count` points are lit; at least one.
    start, planes
        As of `Partitions`.
    beside : (n,) bool
        Whether a vertex of those around the cell has planes.
    weights : (n, 3, 3, 3) float64
        Changed in place; entry (a, b, c) is for the vertex a − 1, b − 1, c − 1 further on.
    """
    w = np.empty((3, 3))
    x = np.empty(3)
    at_point = np.empty(27)
    total = np.empty(27)
    for index in range(len(cells)):
        ijk = vertex_indices(cells[index], counts)
        shift = random4(seed, cells[index], STREAM_LIT_VOLUME)
        total[:] = 0.0
        lit_points = 0
        for point in range(lit.shape[1]):
            if not lit[index, point]:
                continue
            lit_points += 1
            for axis in range(3):
                x[axis] = _coordinate(shift, point, axis, ijk[axis], counts[axis])
                along = x[axis] - ijk[axis]
                w[axis, 0] = max(-along, 0.0)
                w[axis, 1] = 1.0 - abs(along)
                w[axis, 2] = max(along, 0.0)
            for a in range(3):
                for b in range(3):
                    wab = w[0, a] * w[1, b]
                    for c in range(3):
                        at_point[9 * a + 3 * b + c] = wab * w[2, c]
            if beside[index]:
                share_among_speakers(x, ijk, counts, start, planes, at_point)
            for entry in range(27):
                total[entry] += at_point[entry]
        for entry in range(27):
            weights[index, entry // 9, entry // 3 % 3, entry % 3] = total[entry] / lit_points


@merged
def share_among_speakers(x, ijk, counts, start, planes, weights):
    """Take the weights (27,) at x, voxels, from the vertices around ijk that do not speak for it.

    The others get them, if there are any.
    """
    total = 0.0
    for entry in range(27):
        if weights[entry] > 0.0:
            i, j, k = ijk[0] + entry // 9 - 1, ijk[1] + entry // 3 % 3 - 1, ijk[2] + entry % 3 - 1
            if speaks_for(start, planes, (i * counts[1] + j) * counts[2] + k, x, NO_NORMAL):
                total += weights[entry]
            else:
                weights[entry] = -weights[entry]
    for entry in range(27):
        if total > 0.0:
            weights[entry] = max(weights[entry], 0.0) / total
        else:
            weights[entry] = abs(weights[entry])


@kernel
def keep_own_side(cells, seed, counts, start, planes, lit):
    """Unset lit (n, count) bool for the points of cells (n,) that their vertices do not speak for."""
    x = np.empty(3)
    for index in range(len(cells)):
        if start[cells[index]] == start[cells[index] + 1]:
            continue
        ijk = vertex_indices(cells[index], counts)
        shift = random4(seed, cells[index], STREAM_LIT_VOLUME)
        for point in range(lit.shape[1]):
            for axis in range(3):
                x[axis] = _coordinate(shift, point, axis, ijk[axis], counts[axis])
            if not speaks_for(start, planes, cells[index], x, NO_NORMAL):
                lit[index, point] = False
