# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles in world space: which of them can be lit, and their shading normals."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .compiled import kernel, merged

SMALLEST_AREA = 1e-18
"""Square metres, a square nanometre: below it, products of edges vanish in float32."""


def sound_triangles(areas: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Tell which triangles to keep, (n,) bool, given their areas from `measure_areas`: finite, and with an area."""
    return np.isfinite(areas) & (areas >= SMALLEST_AREA)


@kernel
def measure_areas(vertices, triangles, areas):
    """Fill areas (n,) float64 of triangles (n, 3); not finite where a vertex is not.

    Parameters
    ----------
    vertices : (nv, 3) float32
    triangles : (n, 3) int32
    areas : (n,) float64
        Changed in place, square metres.
    """
    for triangle in range(len(triangles)):
        x, y, z = _doubled_area_vector(vertices, triangles, triangle)
        areas[triangle] = 0.5 * math.sqrt(x * x + y * y + z * z)


@kernel
def place_normals(vertices, triangles, corners, source, corner_normals, transforms, per_transform, normals):
    """Fill the unit shading normals of triangles in world space.

    Where a mesh's own normal vanishes or is not finite under its transform, the triangle's geometric normal takes its
    place; so it does in a mesh without normals.

    Parameters
    ----------
    vertices : (nv, 3) float32
        In world space.
    triangles : (n, 3) int32
        Vertex indices.
    corners : (m, 3) int32
        Face corners of the triangles as the mesh has them, for each transform in a row.
    source : (n,) int64
        Which of `corners` a triangle is.
    corner_normals : (nc, 3) float32
        The mesh's own; none where it is shaded flat.
    transforms : (k, 3, 3) float64
        Transforms of normals.
    per_transform
        So many of `corners` belong to each.
    normals : (n, 3, 3) float32
        Changed in place.
    """
    smooth = len(corner_normals) > 0
    for triangle in range(len(triangles)):
        gx, gy, gz = _doubled_area_vector(vertices, triangles, triangle)
        length = math.sqrt(gx * gx + gy * gy + gz * gz)
        gx, gy, gz = gx / length, gy / length, gz / length
        row = source[triangle]
        which = row // per_transform
        for c in range(3):
            x, y, z = gx, gy, gz
            if smooth:
                corner = corners[row, c]
                nx, ny, nz = (
                    np.float64(corner_normals[corner, 0]),
                    np.float64(corner_normals[corner, 1]),
                    np.float64(corner_normals[corner, 2]),
                )
                x = transforms[which, 0, 0] * nx + transforms[which, 0, 1] * ny + transforms[which, 0, 2] * nz
                y = transforms[which, 1, 0] * nx + transforms[which, 1, 1] * ny + transforms[which, 1, 2] * nz
                z = transforms[which, 2, 0] * nx + transforms[which, 2, 1] * ny + transforms[which, 2, 2] * nz
                length = math.sqrt(x * x + y * y + z * z)
                if length > 0.0 and length < np.inf:
                    x, y, z = x / length, y / length, z / length
                else:
                    x, y, z = gx, gy, gz
            normals[triangle, c, 0] = np.float32(x)
            normals[triangle, c, 1] = np.float32(y)
            normals[triangle, c, 2] = np.float32(z)


@merged
def _doubled_area_vector(vertices, triangles, triangle):
    """Return the normal of a triangle, as long as twice its area."""
    p, q, r = triangles[triangle, 0], triangles[triangle, 1], triangles[triangle, 2]
    px, py, pz = np.float64(vertices[p, 0]), np.float64(vertices[p, 1]), np.float64(vertices[p, 2])
    ax, ay, az = np.float64(vertices[q, 0]) - px, np.float64(vertices[q, 1]) - py, np.float64(vertices[q, 2]) - pz
    bx, by, bz = np.float64(vertices[r, 0]) - px, np.float64(vertices[r, 1]) - py, np.float64(vertices[r, 2]) - pz
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
