# SPDX-License-Identifier: GPL-3.0-or-later
"""What lies around vertices near geometry: points, which of them are lit, and straight ways between these.

A vertex has a say in the eight voxels around it. Points are spread through these, and the ways between the lit ones
tell what sees what.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .cell_points import sequence_point, vertex_indices
from .compiled import kernel
from .dual_cells import Lattice
from .embree import Tracer
from .lit_volume import LightKnowledge, mark_cut_cells
from .progress import Progress
from .random import STREAM_PARTITION, random4
from .scene import Float32, Int32
from .side_by_side import Found, side_by_side_steps

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

POINTS = 16
"""In each voxel near geometry."""
AROUND = 8 * POINTS
"""Points around a vertex."""
_FAR_AWAY = 1e6
"""Voxels."""
_BATCH = 512
"""Vertices at a time."""
_LIT_BATCH = 1 << 13
"""Voxels at a time."""


@dataclass(frozen=True)
class Surroundings:
    """The points around some vertices, and what is known of them.

    Parameters
    ----------
    walls
        What ways are blocked by.
    seed
        Of the points.
    vertices : (n,) int64
        Whose surroundings these are.
    voxels : (m,) int64
        Around them.
    place : (vertices of the grid,) int32
        Row of each voxel in `lit`, −1 for those that are not needed.
    lit : (m, POINTS) bool
        Filled by `light_steps`.
    """

    knowledge: LightKnowledge
    walls: Tracer
    lattice: Lattice
    seed: int
    vertices: Int64
    voxels: Int64
    place: NDArray[np.int32]
    lit: NDArray[np.bool_]

    @classmethod
    def of(
        cls, knowledge: LightKnowledge, walls: Tracer, lattice: Lattice, seed: int, triangles: Int32
    ) -> Surroundings:
        """Return those of the vertices within a voxel of triangles (n, 3)."""
        near = np.zeros(lattice.shape, dtype=np.bool_)
        low, counts = np.asarray(lattice.bounds_min, dtype=np.float64), np.asarray(lattice.shape, dtype=np.int64)
        mark_cut_cells(knowledge.geometry.vertices, triangles, low, lattice.voxel_size, counts, 1.0, near)
        voxels = np.flatnonzero(_voxels_around(near))
        place = np.full(lattice.vertex_count, -1, dtype=np.int32)
        place[voxels] = np.arange(len(voxels), dtype=np.int32)
        lit = np.zeros((len(voxels), POINTS), dtype=np.bool_)
        return cls(knowledge, walls, lattice, seed, np.flatnonzero(near), voxels, place, lit)

    def light_steps(self, task: str, threads: int) -> Generator[Progress, None, None]:
        """Find out which points are lit; `threads` is 0 for one per processor."""
        batches = [self.voxels[at : at + _LIT_BATCH] for at in range(0, len(self.voxels), _LIT_BATCH)]
        yield from side_by_side_steps(self._light, batches, task, threads)

    def visit_steps(
        self, task: str, visit: Callable[[Int64], Found], threads: int
    ) -> Generator[Progress, None, list[Found]]:
        """Return what `visit` finds out about batches of vertices, in their order."""
        batches = [self.vertices[at : at + _BATCH] for at in range(0, len(self.vertices), _BATCH)]
        return (yield from side_by_side_steps(visit, batches, task, threads))

    def gather(self, vertices: Int64) -> tuple[Float64, NDArray[np.bool_]]:
        """Return the points around n vertices, (n, AROUND, 3) in voxels, and which are lit, (n, AROUND)."""
        points = np.empty((len(vertices), AROUND, 3))
        lit = np.empty((len(vertices), AROUND), dtype=np.bool_)
        gather(vertices, self._counts, self.seed, self.place, self.lit, points, lit)
        return points, lit

    def look(self, points: Float64, lit: NDArray[np.bool_], stride: int) -> Ways:
        """Look from each lit point to the one of the same vertex that is so many further on in their list."""
        ends = np.empty((lit.size, 2), dtype=np.int64)
        ends = ends[: pair_up(lit, stride, ends)]
        world = self._world(points)
        origins = world[ends[:, 0]]
        hits = self.walls.intersect(origins, world[ends[:, 1]] - origins)
        return Ways(ends, hits.triangle, hits.distance)

    def _light(self, voxels: Int64) -> None:
        points = np.empty((len(voxels), POINTS, 3))
        spread_in_voxels(voxels, self._counts, self.seed, points)
        identifiers = (voxels[:, None] * POINTS + np.arange(POINTS)).reshape(-1)
        lit = self.knowledge.lit(self._world(points), identifiers, self.seed)
        self.lit[self.place[voxels]] = lit.reshape(-1, POINTS)

    @property
    def _counts(self) -> Int64:
        return np.asarray(self.lattice.shape, dtype=np.int64)

    def _world(self, points: Float64) -> Float32:
        """Return positions in metres, (n, 3), of those in voxels."""
        lattice = self.lattice
        return (lattice.bounds_min + points.reshape(-1, 3) * lattice.voxel_size).astype(np.float32)


@dataclass(frozen=True)
class Ways:
    """Straight ways between points around the same vertex.

    Parameters
    ----------
    ends : (n, 2) int64
        Indices of points, vertex after vertex.
    triangle : (n,) int32
        What is met first, there or beyond.
    distance : (n,) float32
        Of it, as a share of the way.
    """

    ends: Int64
    triangle: NDArray[np.int32]
    distance: Float32

    @property
    def owner(self) -> Int64:
        """Row of the vertex that each way belongs to."""
        return self.ends[:, 0] // AROUND

    @property
    def blocked(self) -> NDArray[np.bool_]:
        """Whether something stands in each way."""
        return self.distance < 1.0

    @classmethod
    def joined(cls, parts: list[Ways]) -> Ways:
        """Return all ways, sorted by their vertices."""
        ends = np.concatenate([part.ends for part in parts])
        order = np.argsort(ends[:, 0] // AROUND, kind="stable")
        return cls(
            ends[order],
            np.concatenate([part.triangle for part in parts])[order],
            np.concatenate([part.distance for part in parts])[order],
        )


def _voxels_around(near: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which voxels touch a marked vertex; a voxel has the index of its lower corner, in the grid's shape."""
    voxels = near.copy()
    for axis in range(3):
        further = np.roll(voxels, -1, axis=axis)
        voxels |= further
        last = [slice(None)] * 3
        last[axis] = slice(-1, None)
        voxels[tuple(last)] = False
    return voxels


@kernel
def spread_in_voxels(voxels, counts, seed, points):
    """Fill points (n, POINTS, 3), in voxels from the grid's lower corner, with a shifted sequence in each voxel."""
    for index in range(len(voxels)):
        ijk = vertex_indices(voxels[index], counts)
        shift = random4(seed, voxels[index], STREAM_PARTITION)
        for point in range(points.shape[1]):
            for axis in range(3):
                points[index, point, axis] = ijk[axis] + sequence_point(shift, point, axis)


@kernel
def gather(vertices, counts, seed, place, known, points, lit):
    """Fill points (n, AROUND, 3) voxels and lit (n, AROUND) for the voxels around each vertex.

    Outside of the grid nothing is lit, and there are no points.
    """
    for index in range(len(vertices)):
        ijk = vertex_indices(vertices[index], counts)
        for octant in range(8):
            i, j, k = ijk[0] - (octant & 1), ijk[1] - (octant >> 1 & 1), ijk[2] - (octant >> 2)
            inside = 0 <= i < counts[0] - 1 and 0 <= j < counts[1] - 1 and 0 <= k < counts[2] - 1
            voxel = (i * counts[1] + j) * counts[2] + k if inside else 0
            shift = random4(seed, voxel, STREAM_PARTITION)
            for point in range(POINTS):
                row = octant * POINTS + point
                lit[index, row] = inside and known[place[voxel], point]
                points[index, row, 0] = i + sequence_point(shift, point, 0) if inside else _FAR_AWAY
                points[index, row, 1] = j + sequence_point(shift, point, 1) if inside else _FAR_AWAY
                points[index, row, 2] = k + sequence_point(shift, point, 2) if inside else _FAR_AWAY


@kernel
def pair_up(lit, stride, ends):
    """Fill ends with pairs of lit points of the same row (n, m); return how many."""
    listed = np.empty(lit.shape[1], dtype=np.int64)
    n = 0
    for index in range(len(lit)):
        count = 0
        for point in range(lit.shape[1]):
            if lit[index, point]:
                listed[count] = index * lit.shape[1] + point
                count += 1
        for at in range(count):
            ends[n, 0] = listed[at]
            ends[n, 1] = listed[(at + stride) % count]
            n += 1
    return n
