# SPDX-License-Identifier: GPL-3.0-or-later
"""The grid's lattice: vertices, voxels, and the dual cells around the vertices.

A dual cell is the box of one voxel's size centred at a vertex, cut at the grid's bounds: half of
it remains at a face of the grid, a quarter at an edge, an eighth at a corner. [IVG §3.3]
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .settings import Vec3

Float64 = NDArray[np.float64]


@dataclass(frozen=True)
class Lattice:
    """Where a grid's vertices lie.

    Parameters
    ----------
    bounds_min, bounds_max
        Opposite corners of the box, metres.
    resolution
        Voxels (Ni, Nj, Nk) along x, y, z.
    """

    bounds_min: Vec3
    bounds_max: Vec3
    resolution: tuple[int, int, int]

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return the number of vertices along each axis."""
        ni, nj, nk = self.resolution
        return ni + 1, nj + 1, nk + 1

    @property
    def vertex_count(self) -> int:
        """Return the number of vertices."""
        ni, nj, nk = self.shape
        return ni * nj * nk

    @property
    def voxel_size(self) -> Float64:
        """Return the voxel's edges h, (3,) metres."""
        extent = np.subtract(self.bounds_max, self.bounds_min, dtype=np.float64)
        return np.asarray(extent / np.asarray(self.resolution, dtype=np.float64))

    def vertex_positions(self) -> Float64:
        """Return (Ni+1, Nj+1, Nk+1, 3) positions, metres."""
        axes = [
            np.linspace(low, high, count)
            for low, high, count in zip(self.bounds_min, self.bounds_max, self.shape, strict=True)
        ]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)

    def _edges(self) -> list[Float64]:
        """Return for each axis the dual cells' edge lengths: h inside, h/2 at the bounds."""
        edges = []
        for h, count in zip(self.voxel_size, self.shape, strict=True):
            edge = np.full(count, h)
            edge[0] *= 0.5
            edge[-1] *= 0.5
            edges.append(edge)
        return edges

    def cell_volumes(self) -> Float64:
        """Return V of each dual cell, (Ni+1, Nj+1, Nk+1) m³."""
        x, y, z = self._edges()
        return x[:, None, None] * y[None, :, None] * z[None, None, :]

    def whole_cell_weights(self) -> NDArray[np.float16]:
        """Return the mean of each trilinear weight over each whole dual cell, (Ni+1, Nj+1, Nk+1, 3, 3, 3).

        Entry (a, b, c) is that of the vertex (i + a − 1, j + b − 1, k + c − 1): along an axis 1/8, 3/4, 1/8, and
        3/4, 1/4 where the bounds halve the cell. All are multiples of 1/512, which float16 holds exactly.
        """
        axes = []
        for count in self.shape:
            weights = np.tile(np.array([1 / 8, 3 / 4, 1 / 8], dtype=np.float16), (count, 1))
            weights[0], weights[-1] = (0, 3 / 4, 1 / 4), (1 / 4, 3 / 4, 0)
            axes.append(weights)
        x, y, z = axes
        xy = x[:, None, :, None] * y[None, :, None, :]
        return np.asarray(xy[:, :, None, :, :, None] * z[None, None, :, None, None, :])

    def face_areas(self) -> Float64:
        """Return A of each dual cell's cross-section at its vertex, (Ni+1, Nj+1, Nk+1, 3) m².

        Entry k is the face perpendicular to axis k: the part of the voxel faces in that plane
        whose nearest vertex is this one.
        """
        x, y, z = self._edges()
        ones = np.ones(self.shape)
        return np.stack(
            [
                ones * y[None, :, None] * z[None, None, :],
                ones * x[:, None, None] * z[None, None, :],
                ones * x[:, None, None] * y[None, :, None],
            ],
            axis=-1,
        )
