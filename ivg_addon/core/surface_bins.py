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

_MOST_DIVISIONS = 512
_MOST_PATCHES = 1 << 20
"""Every thread counts for itself, 8 bytes a patch."""


@dataclass(frozen=True)
class SurfaceBins:
    """How each triangle is divided into patches.

    Parameters
    ----------
    divisions : (nt,) int32
        d: the triangle has d² patches, d along each barycentric axis.
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
        """Divide every triangle into patches whose edges are about `patch_size` metres or less.

        Larger ones are made where triangles are huge, and everywhere if there would be more than `most` patches beyond
        one for each triangle.
        """
        longest = np.empty(geometry.triangle_count)
        measure_edges(geometry.vertices, geometry.triangles, longest)
        while True:
            divisions = np.clip(np.ceil(longest / patch_size), 1, _MOST_DIVISIONS).astype(np.int32)
            patches = divisions.astype(np.int64) ** 2
            if patches.sum() - geometry.triangle_count <= min(most, _MOST_PATCHES):
                break
            patch_size *= 2.0
        return cls(
            divisions=divisions,
            offset=np.cumsum(patches) - patches,
            count=int(patches.sum()),
        )

    def empty_counts(self) -> Int32:
        """Return (patches, 2) zeros: photons received on the front and on the back."""
        return np.zeros((self.count, 2), dtype=np.int32)


@kernel
def measure_edges(vertices, triangles, longest):
    """Fill longest (nt,) float64 with the longer of the two edges at each triangle's first corner."""
    for triangle in range(len(triangles)):
        p = triangles[triangle, 0]
        squared = 0.0
        for c in range(1, 3):
            q = triangles[triangle, c]
            x = np.float64(vertices[q, 0]) - np.float64(vertices[p, 0])
            y = np.float64(vertices[q, 1]) - np.float64(vertices[p, 1])
            z = np.float64(vertices[q, 2]) - np.float64(vertices[p, 2])
            squared = max(squared, x * x + y * y + z * z)
        longest[triangle] = np.sqrt(squared)


@merged
def patch_of(triangle, u, v, divisions, offset):
    """Return the index of the patch at barycentric coordinates u, v of a triangle."""
    d = divisions[triangle]
    a = min(int(u * d), d - 1)
    b = min(int(v * d), d - 1)
    return offset[triangle] + a * d + b
