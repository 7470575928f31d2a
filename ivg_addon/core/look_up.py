"""Looking the grid up: spatial interpolation of the vectors, then the directional reconstruction.

Both are linear, so the vectors around a point are blended first (54 numbers, one after the other
in memory) and contracted with the 18 coefficients of the normal once.
"""

from __future__ import annotations

import math
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from .compiled import inlined, kernel
from .dual_cells import Lattice
from .reconstruction import DIRECTIONAL_CODES, directional_coefficients
from .settings import Directional, Spatial

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

_CHUNK = 32_768

_BEHIND = 0.02
"""What remains of the weight of a vertex right behind a surface, so that weights never vanish."""


@inlined
def linear_weights(f, w):
    """Fill w[0:2] with the linear interpolation weights at fraction f in [0, 1]."""
    w[0] = 1.0 - f
    w[1] = f


@inlined
def cubic_weights(f, w):
    """Fill w[0:4] with the cubic B-spline's weights at fraction f in [0, 1].

    Sigg & Hadwiger, "Fast Third-Order Texture Filtering", GPU Gems 2, ch. 20.
    """
    g = 1.0 - f
    w[0] = g * g * g / 6.0
    w[1] = (4.0 - 3.0 * f * f * (2.0 - f)) / 6.0
    w[2] = (4.0 - 3.0 * g * g * (2.0 - g)) / 6.0
    w[3] = f * f * f / 6.0


@inlined
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


@inlined
def vertex_index(base, a, b, c, counts):
    """Return the flat index of a stencil's vertex; beyond the grid the edge repeats."""
    i = min(max(base[0] + a, 0), counts[0] - 1)
    j = min(max(base[1] + b, 0), counts[1] - 1)
    k = min(max(base[2] + c, 0), counts[2] - 1)
    return (i * counts[1] + j) * counts[2] + k


@inlined
def unlit_share(validity, base, w, support, counts):
    """Return how much geometry cuts the cells around a point: 0 in the open, ½ at a plane."""
    unlit = 0.0
    for a in range(support):
        for b in range(support):
            wab = w[0, a] * w[1, b]
            for c in range(support):
                vertex = vertex_index(base, a, b, c, counts)
                unlit += wab * w[2, c] * (1.0 - validity[vertex])
    return unlit


@inlined
def facing(g, n, base, a, b, c, proximity):
    """Return the weight factor of a vertex for a surface at g with normal n.

    ((1 + cos)/2 + ε)^proximity, cos between n and the direction to the vertex: what lies behind
    the surface is rarely seen from it (Majercik et al., "Dynamic Diffuse Global Illumination with
    Ray-Traced Irradiance Fields", JCGT 2019, weigh probes by this cosine). One in the open.
    """
    x, y, z = base[0] + a - g[0], base[1] + b - g[1], base[2] + c - g[2]
    length = math.sqrt(x * x + y * y + z * z)
    cosine = (x * n[0] + y * n[1] + z * n[2]) / length if length > 0.0 else 1.0
    return ((1.0 + cosine) / 2.0 + _BEHIND) ** proximity


@inlined
def blend(vectors, validity, counts, support, base, w, g, n, proximity, blended):
    """Fill blended (54,) with the weighted vectors of a stencil; return the sum of its weights.

    Vertices without lit volume get no weight.
    """
    for m in range(54):
        blended[m] = 0.0
    total = 0.0
    for a in range(support):
        for b in range(support):
            wab = w[0, a] * w[1, b]
            for c in range(support):
                vertex = vertex_index(base, a, b, c, counts)
                weight = wab * w[2, c]
                if validity[vertex] > 0.0 and weight > 0.0:
                    if proximity > 0.0:
                        weight *= facing(g, n, base, a, b, c, proximity)
                    total += weight
                    share = np.float32(weight)
                    for m in range(54):
                        blended[m] += share * vectors[vertex, m]
    return total


@kernel
def look_up(points, normals, vectors, validity, low, voxel, counts, support, directional, bias, out):
    """Fill out (n, 3) with E(p, n) of n points and normals, both (n, 3) float64.

    vectors : (vertices, 54) float32, validity : (vertices,) float32
    low, voxel : (3,) float64; counts : (3,) int64
    """
    w = np.empty((3, 4))
    base = np.empty(3, dtype=np.int64)
    g = np.empty(3)
    c = np.empty((6, 3))
    blended = np.empty(54, dtype=np.float32)
    for q in range(len(points)):
        length = math.sqrt(normals[q, 0] ** 2 + normals[q, 1] ** 2 + normals[q, 2] ** 2)
        n = (normals[q, 0] / length, normals[q, 1] / length, normals[q, 2] / length)
        for axis in range(3):
            position = (points[q, axis] - low[axis]) / voxel[axis]
            g[axis] = min(max(position, 0.0), counts[axis] - 1.0)
        stencil(g, counts, support, base, w)
        unlit = unlit_share(validity, base, w, support, counts)
        # A plane that halves every cell around the point is as near as a surface comes.
        proximity = min(1.0, 2.0 * unlit)
        if unlit > 0.0 and bias != 0.0:
            for axis in range(3):
                position = g[axis] + bias * unlit * n[axis]
                g[axis] = min(max(position, 0.0), counts[axis] - 1.0)
            stencil(g, counts, support, base, w)
        total = blend(vectors, validity, counts, support, base, w, g, n, proximity, blended)
        directional_coefficients(directional, n, c)
        for channel in range(3):
            e = 0.0
            for hemisphere in range(6):
                m = 9 * hemisphere + 3 * channel
                for component in range(3):
                    e += c[hemisphere, component] * blended[m + component]
            # A reconstruction can undershoot; light cannot.
            out[q, channel] = max(0.0, e / total) if total > 0.0 else 0.0


def irradiance(
    vectors: Float32,
    validity: Float32,
    lattice: Lattice,
    points: Float64,
    normals: Float64,
    spatial: Spatial,
    directional: Directional,
    normal_bias: float,
) -> Float32:
    """Return E (n, 3) float32 W/m² at points with unit normals, (n, 3) float64; several threads."""
    out = np.empty((len(points), 3), dtype=np.float32)
    grid = (
        vectors.reshape(-1, 54),
        validity.reshape(-1),
        np.asarray(lattice.bounds_min, dtype=np.float64),
        lattice.voxel_size,
        np.asarray(lattice.shape, dtype=np.int64),
        2 if spatial is Spatial.TRILINEAR else 4,
        DIRECTIONAL_CODES[directional],
        float(normal_bias),
    )

    def chunk(start: int) -> None:
        part = slice(start, start + _CHUNK)
        look_up(points[part], normals[part], *grid, out[part])

    starts = range(0, len(points), _CHUNK)
    if len(starts) < 2:
        for start in starts:
            chunk(start)
    else:
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(chunk, starts))
    return out
