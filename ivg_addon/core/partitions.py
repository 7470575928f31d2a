# SPDX-License-Identifier: GPL-3.0-or-later
"""Which side of a thin wall a vertex speaks for.

A sheet with light on both sides (a partition wall, a table top, ground without thickness under a sky) may pass
through a dual cell, or between a vertex and a point that is looked up. What one side sees is nothing to the other. So
a vertex near a sheet speaks for one side of it: it has one to three planes, its cell's sums count what flies on their
positive sides, and look-ups elsewhere leave the vertex out. Where nothing divides a vertex's surroundings it has none.
`partitioning.py` finds them.

Planes are in voxels from the grid's lower corner: normal N of length one, offset D, and the slack s by which the sheet
strays from its plane. A point x of a surface with the normal n (0 for a point of no surface) lies on the positive side
if N·x − D + s N·n ≥ 0: what lies in the sheet itself belongs to the side that its normal points to.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MOST_PLANES = 3
"""Of a vertex: in the corner of a room three walls meet."""


@dataclass(frozen=True)
class Partitions:
    """Planes of the vertices, those of vertex v from `start[v]` up to `start[v + 1]`.

    Parameters
    ----------
    start : (vertices + 1,) int32
        Vertices in the order of the grid's arrays.
    planes : (P, 5) float32
        Nx, Ny, Nz, D, s in voxels from the grid's lower corner.
    """

    start: NDArray[np.int32]
    planes: NDArray[np.float32]

    @classmethod
    def none(cls, vertex_count: int) -> Partitions:
        """Return that of a grid that nothing divides."""
        return cls(np.zeros(vertex_count + 1, dtype=np.int32), np.empty((0, 5), dtype=np.float32))

    def problem(self, vertex_count: int) -> str | None:
        """Return what is wrong with the arrays of a grid of so many vertices, if anything."""
        if self.start.shape != (vertex_count + 1,) or self.start.dtype != np.int32:
            return f"plane_start: {self.start.dtype} {self.start.shape} instead of int32 {(vertex_count + 1,)}"
        per_vertex = np.diff(self.start.astype(np.int64))
        if self.start[0] != 0 or per_vertex.min() < 0 or per_vertex.max() > MOST_PLANES:
            return f"plane_start does not give each vertex 0 to {MOST_PLANES} planes"
        if self.planes.shape != (self.start[-1], 5) or self.planes.dtype != np.float32:
            return f"planes: {self.planes.dtype} {self.planes.shape} instead of float32 {(int(self.start[-1]), 5)}"
        return None

    @property
    def divided(self) -> NDArray[np.bool_]:
        """Which vertices have planes, (vertices,)."""
        return np.diff(self.start) > 0
