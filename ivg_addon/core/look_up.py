# SPDX-License-Identifier: GPL-3.0-or-later
"""Looking the grid up: spatial interpolation of the vectors, then the directional reconstruction.

Both are linear, so the vectors around a point are blended first (54 numbers, one after the other
in memory) and contracted with the 18 coefficients of the normal once.
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from .compiled import kernel, merged
from .dual_cells import Lattice
from .look_up_rules import FULLY_COUNTED, LEAST_DIVIDED, LEAST_SPOKEN, WITHIN
from .partitions import Partitions
from .reconstruction import DIRECTIONAL_CODES, directional_coefficients
from .settings import Directional, Spatial
from .sides import hears, speaks_for
from .vectors import unit

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

CHUNK = 32_768
"""Points that a thread looks up at a time."""


@merged
def linear_weights(f, w):
    """Fill w[0:2] with the linear interpolation weights at fraction f in [0, 1]."""
    w[0] = 1.0 - f
    w[1] = f


@merged
def cubic_weights(f, w):
    """Fill w[0:4] with the cubic B-spline's weights at fraction f in [0, 1].

    Sigg & Hadwiger, "Fast Third-Order Texture Filtering", GPU Gems 2, ch. 20.
    """
    g = 1.0 - f
    w[0] = g * g * g / 6.0
    w[1] = (4.0 - 3.0 * f * f * (2.0 - f)) / 6.0
    w[2] = (4.0 - 3.0 * g * g * (2.0 - g)) / 6.0
    w[3] = f * f * f / 6.0


@merged
def stencil(g, counts, support, base, w):
    """Fill base (3,) with the first vertex around grid position g and w (3, support) with weights.

    `support` is 2 (trilinear) or 4 (tricubic).
    """
    for axis in range(3):
        cell = min(int(g[axis]), counts[axis] - 2)
        if support == 2:
            linear_weights(g[axis] - cell, w[axis])
            base[axis] = cell
        else:
            cubic_weights(g[axis] - cell, w[axis])
            base[axis] = cell - 1


@merged
def weigh(validity, counts, support, base, w, vertices, weights):
    """Fill vertices and weights, (support³,) each, of a stencil; beyond the grid the edge repeats.

    Vertices without lit volume get no weight, those with little of it less.

    Returns
    -------
    float
        The unlit share of the cells around the point, how much geometry cuts them: 0 in the open, ½ at a plane.
    """
    unlit = 0.0
    entry = 0
    for a in range(support):
        i = min(max(base[0] + a, 0), counts[0] - 1)
        for b in range(support):
            j = min(max(base[1] + b, 0), counts[1] - 1)
            wab = w[0, a] * w[1, b]
            for c in range(support):
                k = min(max(base[2] + c, 0), counts[2] - 1)
                vertex = (i * counts[1] + j) * counts[2] + k
                weight = wab * w[2, c]
                unlit += weight * (1.0 - validity[vertex])
                vertices[entry] = vertex
                weights[entry] = weight * min(1.0, validity[vertex] / FULLY_COUNTED)
                entry += 1
    return unlit


@merged
def is_divided(start, vertices, weights, size):
    """Tell whether vertices with planes have a share in `size` vertices."""
    share = 0.0
    for entry in range(size):
        if start[vertices[entry] + 1] > start[vertices[entry]]:
            share += weights[entry]
    return share > LEAST_DIVIDED


@merged
def step_back(start, planes, g, n, counts, vertices, weights, size):
    """Move g half a voxel away from the wall beside it where hardly a vertex speaks for it; tell whether.

    In the corner of a voxel that a wall cuts off, the only vertex may speak for the wall's other side.
    """
    spoken, total = 0.0, 0.0
    most = 0.0
    wall = -1
    for entry in range(size):
        total += weights[entry]
        if speaks_for(start, planes, vertices[entry], g, n):
            spoken += weights[entry]
        elif weights[entry] > most:
            most = weights[entry]
            wall = start[vertices[entry]]
            while hears(planes, wall, g, n) and wall + 1 < start[vertices[entry] + 1]:
                wall += 1
    moves = wall >= 0 and spoken < LEAST_SPOKEN * total
    if moves:
        for axis in range(3):
            g[axis] = min(max(g[axis] - 0.5 * planes[wall, axis], 0.0), counts[axis] - 1.0)
    return moves


@merged
def leave_to_speakers(start, planes, g, n, vertices, weights, size):
    """Take the weight of vertices that do not speak for a surface at g with normal n, unless that leaves none."""
    spoken = 0.0
    for entry in range(size):
        if speaks_for(start, planes, vertices[entry], g, n):
            spoken += weights[entry]
        else:
            weights[entry] = -weights[entry]
    for entry in range(size):
        weights[entry] = max(weights[entry], 0.0) if spoken > 0.0 else abs(weights[entry])


@merged
def blend(vectors, vertices, weights, size, blended):
    """Fill blended (54,) with the weighted mean vectors of `size` vertices; return whether any has a weight."""
    total = 0.0
    for entry in range(size):
        total += weights[entry]
    for m in range(54):
        blended[m] = 0.0
    for entry in range(size):
        if weights[entry] > 0.0:
            share = np.float32(weights[entry] / total)
            vertex = np.uint64(vertices[entry])
            for m in range(54):
                blended[m] += share * vectors[vertex, m]
    return total > 0.0


@kernel
def look_up(
    points,
    normals,
    facing,
    bumps,
    vectors,
    validity,
    start,
    planes,
    low,
    voxel,
    counts,
    spatial_support,
    directional,
    bias,
    out,
):
    """Fill out (n, 3) with E(p, n) of n points and normals, both (n, 3) float64.

    Where the look-up is made, and which vertices see the point, is told by the surface's own normals `facing` (n, 3);
    without `bumps` they are the same.
    Beside vertices with planes the interpolation is trilinear: wider ones reach vertices behind the wall.

    vectors : (vertices, 54) float32, validity : (vertices,) float32
    start, planes : as of `Partitions`
    low, voxel : (3,) float64; counts : (3,) int64
    """
    w = np.empty((3, 4))
    base = np.empty(3, dtype=np.int64)
    g = np.empty(3)
    here = np.empty(3)
    c = np.empty((6, 3))
    vertices = np.empty(64, dtype=np.int64)
    weights = np.empty(64)
    blended = np.empty(54, dtype=np.float32)
    some_divided = len(planes) > 0
    for q in range(len(points)):
        n = unit(facing[q, 0], facing[q, 1], facing[q, 2])
        for axis in range(3):
            position = (points[q, axis] - low[axis]) / voxel[axis]
            g[axis] = min(max(position, 0.0), counts[axis] - 1.0)
            here[axis] = g[axis]
        support = spatial_support
        stencil(g, counts, support, base, w)
        unlit = weigh(validity, counts, support, base, w, vertices, weights)
        divided = some_divided and is_divided(start, vertices, weights, support * support * support)
        if divided and support > 2:
            support = 2
            stencil(g, counts, support, base, w)
            unlit = weigh(validity, counts, support, base, w, vertices, weights)
        if divided and step_back(start, planes, g, n, counts, vertices, weights, support * support * support):
            here[:] = g
            stencil(g, counts, support, base, w)
            unlit = weigh(validity, counts, support, base, w, vertices, weights)
        if unlit > 0.0 and bias != 0.0:
            for axis in range(3):
                position = here[axis] + bias * unlit * n[axis]
                # Beside a wall not into the next voxel: whose vertices know which side they are on is not known.
                low_end, high_end = 0.0, counts[axis] - 1.0
                if divided:
                    low_end, high_end = base[axis] + WITHIN, base[axis] + 1.0 - WITHIN
                g[axis] = min(max(position, low_end), high_end)
            stencil(g, counts, support, base, w)
            weigh(validity, counts, support, base, w, vertices, weights)
        if divided:
            leave_to_speakers(start, planes, here, n, vertices, weights, support * support * support)
        some = blend(vectors, vertices, weights, support * support * support, blended)
        if bumps:
            n = unit(normals[q, 0], normals[q, 1], normals[q, 2])
        directional_coefficients(directional, n, c)
        for channel in range(3):
            e = 0.0
            for hemisphere in range(6):
                m = 9 * hemisphere + 3 * channel
                for component in range(3):
                    e += c[hemisphere, component] * blended[m + component]
            # A reconstruction can undershoot; light cannot.
            out[q, channel] = max(0.0, e) if some else 0.0


def irradiance(
    vectors: Float32,
    validity: Float32,
    partitions: Partitions,
    lattice: Lattice,
    points: Float64,
    normals: Float64,
    spatial: Spatial,
    directional: Directional,
    normal_bias: float,
    facing: Float64 | None = None,
) -> Float32:
    """Return E (n, 3) float32 W/m² at points with normals, (n, 3) float64; several threads.

    Parameters
    ----------
    facing : (n, 3) float64, optional
        The surface's own normals where `normals` are those of bumps on it.
    """
    own = normals if facing is None else facing
    out = np.empty((len(points), 3), dtype=np.float32)
    grid = (
        vectors.reshape(-1, 54),
        validity.reshape(-1),
        partitions.start,
        partitions.planes,
        np.asarray(lattice.bounds_min, dtype=np.float64),
        lattice.voxel_size,
        np.asarray(lattice.shape, dtype=np.int64),
        2 if spatial is Spatial.TRILINEAR else 4,
        DIRECTIONAL_CODES[directional],
        float(normal_bias),
    )

    def chunk(start: int) -> None:
        part = slice(start, start + CHUNK)
        look_up(points[part], normals[part], own[part], facing is not None, *grid, out[part])

    starts = range(0, len(points), CHUNK)
    if len(starts) < 2:
        for start in starts:
            chunk(start)
    else:
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(chunk, starts))
    return out
