# SPDX-License-Identifier: GPL-3.0-or-later
"""Where photons landed: counts per side of small patches of the surfaces.

The lit-volume estimate asks whether a side of a surface received light. A triangle may be much
larger than a voxel (a floor that reaches under a wall and out of the house), so it is divided into
patches, in barycentric coordinates. A patch on both sides of a wall makes the dark side look lit: patches
are much smaller than a voxel, and no smaller than the photons can fill.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .compiled import kernel, merged
from .scene import Geometry, Int32

FRONT = 0
BACK = 1

PATCHES_PER_VOXEL = 8
"""Along an edge."""
PHOTONS_PER_PATCH = 8

_MOST_OF_ONE = 1 << 18
"""Patches of a triangle."""
_MOST_PATCHES = 1 << 20


@dataclass(frozen=True)
class SurfaceBins:
    """How each triangle is divided into patches.

    Parameters
    ----------
    divisions : (nt, 3) int32
        c, m, n: the corner where the triangle's two shorter edges meet; into how many parts the one to the next corner
        is cut, and the one from the corner before. Of the m n patches, those that lie beyond the third edge are empty.
    offset : (nt,) int64
        Index of the triangle's first patch.
    count
        Patches in all.
    """

    divisions: Int32
    offset: NDArray[np.int64]
    count: int

    @classmethod
    def of(cls, geometry: Geometry, patch_size: float, most: int = _MOST_PATCHES) -> SurfaceBins:
        """Divide every triangle into patches whose edges are `patch_size` metres or less.

        Larger ones are made where triangles are huge, and everywhere if there would be more than `most` patches beyond
        one for each triangle.
        """
        edges = np.empty((geometry.triangle_count, 3))
        measure_edges(geometry.vertices, geometry.triangles, edges)
        corner = (np.argmax(edges, axis=1) + 2) % 3
        shorter = np.stack(
            [np.take_along_axis(edges, (corner + turn)[:, None] % 3, 1)[:, 0] for turn in (0, 2)], axis=1
        )
        while True:
            parts = np.clip(shorter / patch_size, 1.0, _MOST_OF_ONE)
            parts /= np.sqrt(np.maximum(1.0, parts.prod(axis=1, keepdims=True) / _MOST_OF_ONE))
            parts = np.maximum(1, np.ceil(parts)).astype(np.int32)
            patches = parts.prod(axis=1, dtype=np.int64)
            if patches.sum() - geometry.triangle_count <= min(most, _MOST_PATCHES):
                break
            patch_size *= 2.0
        return cls(
            divisions=np.concatenate([corner[:, None].astype(np.int32), parts], axis=1),
            offset=np.cumsum(patches) - patches,
            count=int(patches.sum()),
        )

    def empty_counts(self) -> Int32:
        """Return (patches, 2) zeros: photons received on the front and on the back."""
        return np.zeros((self.count, 2), dtype=np.int32)


@kernel
def measure_edges(vertices, triangles, edges):
    """Fill edges (nt, 3) float64 with the lengths of those from each corner to the next."""
    for triangle in range(len(triangles)):
        for c in range(3):
            p, q = triangles[triangle, c], triangles[triangle, (c + 1) % 3]
            x = np.float64(vertices[q, 0]) - np.float64(vertices[p, 0])
            y = np.float64(vertices[q, 1]) - np.float64(vertices[p, 1])
            z = np.float64(vertices[q, 2]) - np.float64(vertices[p, 2])
            edges[triangle, c] = np.sqrt(x * x + y * y + z * z)


@merged
def patch_of(triangle, u, v, divisions, offset):
    """Return the index of the patch at barycentric coordinates u, v of a triangle."""
    c, m, n = divisions[triangle, 0], divisions[triangle, 1], divisions[triangle, 2]
    s, t = u, v
    if c == 1:
        s, t = v, 1.0 - u - v
    elif c == 2:
        s, t = 1.0 - u - v, u
    a = min(max(int(s * m), 0), m - 1)
    b = min(max(int(t * n), 0), n - 1)
    return offset[triangle] + a * n + b
