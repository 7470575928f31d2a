# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding out which vertices stand beside a thin wall, and on which side of it they are.

A vertex has a say in the eight voxels around it. Points are spread through these, and straight ways between the lit
ones tell what sees what. A plane parts a vertex's surroundings well if most ways through it are blocked: that of a wall
that ends far from the vertex, of a table top near its border, of a block's top beside its edge; not that of a pole,
which light flows around. Of the planes of what stood in the ways, and their mean, the best one divides the vertex, if
any is good. The vertex speaks for the side that it lies on, unless that is next to dark, and further planes are sought
there.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Generator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .cell_points import sequence_point, vertex_indices
from .compiled import kernel
from .dividing_planes import find_planes
from .dual_cells import Lattice
from .embree import Tracer
from .lit_volume import LightKnowledge, mark_cut_cells
from .partitions import MOST_PLANES, Partitions
from .progress import Progress
from .random import STREAM_PARTITION, random4
from .scene import GLASS, PANE, REFRACTION, TRANSPARENT, Float32, Scene

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

POINTS = 16
"""In each voxel near geometry."""
_AROUND = 8 * POINTS
"""Points around a vertex."""
_FIRST_STRIDE, _STRIDES = 55, (1, 3, 8, 21, 34)
"""A way leads from each lit point to the one so many further on in their list. Where none of the first kind is blocked
nothing divides the vertex."""
_FAR_AWAY = 1e6
"""Voxels."""
_BATCH = 512
"""Vertices at a time."""
_LIT_BATCH = 1 << 13
"""Voxels at a time."""
_CLEAR = 0.5
"""From this transmittance on a surface parts nothing: who looks through glass sees much the same from both sides."""


def parting(scene: Scene) -> NDArray[np.bool_]:
    """Tell which triangles, (nt,), may part places: those that light does not go on through."""
    lobes = scene.materials.lobes
    clear = np.isin(lobes.kind, (GLASS, REFRACTION, TRANSPARENT, PANE))
    through = np.where(lobes.kind == GLASS, lobes.second.max(axis=1), lobes.color.max(axis=1))
    transmittance = np.zeros(len(scene.materials.names))
    np.add.at(transmittance, lobes.material[clear], through[clear])
    return np.asarray(transmittance[scene.geometry.material] < _CLEAR)


def partition_steps(
    knowledge: LightKnowledge, walls: Tracer, lattice: Lattice, seed: int, threads: int
) -> Generator[Progress, None, Partitions]:
    """Return the planes of all vertices; yields as it goes.

    Parameters
    ----------
    knowledge
        Where light is; a part of the photons tells it well enough.
    walls
        What is `parting`.
    seed
        Of the points.
    threads
        0 for one per processor.
    """
    low = np.asarray(lattice.bounds_min, dtype=np.float64)
    counts = np.asarray(lattice.shape, dtype=np.int64)
    near = np.zeros(lattice.shape, dtype=np.bool_)
    geometry = knowledge.geometry
    mark_cut_cells(geometry.vertices, geometry.triangles, low, lattice.voxel_size, counts, 1.0, near)
    vertices = np.flatnonzero(near)
    voxels = np.flatnonzero(_voxels_around(near))
    place = np.full(lattice.vertex_count, -1, dtype=np.int32)
    place[voxels] = np.arange(len(voxels), dtype=np.int32)
    lit = np.zeros((len(voxels), POINTS), dtype=np.bool_)
    around = _Around(knowledge, walls, lattice, seed, place, lit)
    found: list[tuple[Int64, Float32]] = [(np.zeros(0, dtype=np.int64), np.empty((0, 5), dtype=np.float32))]

    with ThreadPoolExecutor(threads or os.cpu_count(), thread_name_prefix="ivg-sides") as pool:
        first = [voxels[at : at + _LIT_BATCH] for at in range(0, len(voxels), _LIT_BATCH)]
        then = [vertices[at : at + _BATCH] for at in range(0, len(vertices), _BATCH)]
        done = itertools.count(1)
        for work, batches in ((around.light, first), (around.divide, then)):
            futures = [pool.submit(work, batch) for batch in batches]
            try:
                for future in futures:
                    result = future.result()
                    if result is not None:
                        found.append(result)
                    yield Progress("Looking for thin walls", next(done) / (len(first) + len(then)))
            finally:
                for future in futures:
                    future.cancel()

    owners = np.concatenate([owner for owner, _ in found])
    start = np.zeros(lattice.vertex_count + 1, dtype=np.int32)
    np.cumsum(np.bincount(owners, minlength=lattice.vertex_count), out=start[1:])
    return Partitions(start, np.concatenate([planes for _, planes in found]))


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


@dataclass(frozen=True)
class _Around:
    """The points around vertices, and what is known of them.

    Parameters
    ----------
    place : (vertices,) int32
        Row of each voxel in `lit`, −1 for those that are not needed.
    lit : (voxels, POINTS) bool
        Filled by `light`.
    """

    knowledge: LightKnowledge
    walls: Tracer
    lattice: Lattice
    seed: int
    place: NDArray[np.int32]
    lit: NDArray[np.bool_]

    def light(self, voxels: Int64) -> None:
        """Find out which points of some voxels are lit."""
        points = np.empty((len(voxels), POINTS, 3))
        spread_in_voxels(voxels, self._counts, self.seed, points)
        identifiers = (voxels[:, None] * POINTS + np.arange(POINTS)).reshape(-1)
        lit = self.knowledge.lit(self._world(points), identifiers, self.seed)
        self.lit[self.place[voxels]] = lit.reshape(-1, POINTS)

    def divide(self, vertices: Int64) -> tuple[Int64, Float32]:
        """Return planes (P, 5) and the vertices (P,) that they belong to."""
        points = np.empty((len(vertices), _AROUND, 3))
        lit = np.empty((len(vertices), _AROUND), dtype=np.bool_)
        gather(vertices, self._counts, self.seed, self.place, self.lit, points, lit)
        ways = self._look(points, lit, _FIRST_STRIDE)
        seen = np.bincount(ways.owner[ways.blocked], minlength=len(vertices)) > 0
        vertices, points, lit = vertices[seen], points[seen], lit[seen]
        ways = _Ways.joined([self._look(points, lit, stride) for stride in (_FIRST_STRIDE, *_STRIDES)])
        planes = np.empty((len(vertices), MOST_PLANES, 5), dtype=np.float32)
        number = np.zeros(len(vertices), dtype=np.int64)
        starts = np.searchsorted(ways.owner, np.arange(len(vertices) + 1))
        find_planes(vertices, self._counts, points, lit, starts, *self._obstacles(ways, points), planes, number)
        return np.repeat(vertices, number), planes[np.arange(MOST_PLANES) < number[:, None]]

    def _look(self, points: Float64, lit: NDArray[np.bool_], stride: int) -> _Ways:
        """Look from each lit point to another of the same vertex."""
        ends = np.empty((lit.size, 2), dtype=np.int64)
        ends = ends[: pair_up(lit, stride, ends)]
        world = self._world(points)
        origins = world[ends[:, 0]]
        hits = self.walls.intersect(origins, world[ends[:, 1]] - origins)
        return _Ways(ends, hits.triangle, hits.distance)

    def _obstacles(self, ways: _Ways, points: Float64) -> tuple[Int64, NDArray[np.bool_], Float64, Float64]:
        """Return of each way its ends (n, 2), whether it is blocked, by what normal towards its start, and where."""
        geometry, lattice = self.knowledge.geometry, self.lattice
        triangles = geometry.triangles[np.where(ways.blocked, ways.triangle, 0)]
        p = (geometry.vertices[triangles] - np.array(lattice.bounds_min)) / lattice.voxel_size
        normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        start, end = points.reshape(-1, 3)[ways.ends[:, 0]], points.reshape(-1, 3)[ways.ends[:, 1]]
        normal *= np.where(np.einsum("ij,ij->i", normal, start - end) >= 0.0, 1.0, -1.0)[:, None]
        met = start + ways.distance[:, None] * (end - start)
        return ways.ends, ways.blocked, normal, met

    @property
    def _counts(self) -> Int64:
        return np.asarray(self.lattice.shape, dtype=np.int64)

    def _world(self, points: Float64) -> Float32:
        """Return positions in metres, (n, 3), of those in voxels."""
        lattice = self.lattice
        return (lattice.bounds_min + points.reshape(-1, 3) * lattice.voxel_size).astype(np.float32)


@dataclass(frozen=True)
class _Ways:
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
        return self.ends[:, 0] // _AROUND

    @property
    def blocked(self) -> NDArray[np.bool_]:
        """Whether something stands in each way."""
        return self.distance < 1.0

    @classmethod
    def joined(cls, parts: list[_Ways]) -> _Ways:
        """Return all ways, sorted by their vertices."""
        ends = np.concatenate([part.ends for part in parts])
        order = np.argsort(ends[:, 0] // _AROUND, kind="stable")
        return cls(
            ends[order],
            np.concatenate([part.triangle for part in parts])[order],
            np.concatenate([part.distance for part in parts])[order],
        )


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
    """Fill points (n, _AROUND, 3) voxels and lit (n, _AROUND) for the voxels around each vertex.

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
