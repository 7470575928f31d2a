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

from collections.abc import Generator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from .dividing_planes import find_planes
from .dual_cells import Lattice
from .embree import Tracer
from .lit_volume import LightKnowledge
from .partitions import MOST_PLANES, Partitions
from .progress import Progress, part
from .scene import GLASS, PANE, REFRACTION, TRANSPARENT, Float32, Scene
from .surroundings import Float64, Int64, Surroundings, Ways

_TASK = "Looking for thin walls"
_FIRST_STRIDE, _STRIDES = 55, (1, 3, 8, 21, 34)
"""A way leads from each lit point to the one so many further on in their list. Where none of the first kind is blocked
nothing divides the vertex."""
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
    around = Surroundings.of(knowledge, walls, lattice, seed, knowledge.geometry.triangles)
    yield from part(around.light_steps(_TASK, threads), 0.0, 0.5)
    found = yield from part(around.visit_steps(_TASK, partial(_divide, around), threads), 0.5, 1.0)
    owners = np.concatenate([np.zeros(0, dtype=np.int64), *(owner for owner, _ in found)])
    start = np.zeros(lattice.vertex_count + 1, dtype=np.int32)
    np.cumsum(np.bincount(owners, minlength=lattice.vertex_count), out=start[1:])
    planes = np.concatenate([np.empty((0, 5), dtype=np.float32), *(planes for _, planes in found)])
    return Partitions(start, planes)


def _divide(around: Surroundings, vertices: Int64) -> tuple[Int64, Float32]:
    """Return planes (P, 5) and the vertices (P,) that they belong to."""
    points, lit = around.gather(vertices)
    ways = around.look(points, lit, _FIRST_STRIDE)
    seen = np.bincount(ways.owner[ways.blocked], minlength=len(vertices)) > 0
    vertices, points, lit = vertices[seen], points[seen], lit[seen]
    ways = Ways.joined([around.look(points, lit, stride) for stride in (_FIRST_STRIDE, *_STRIDES)])
    planes = np.empty((len(vertices), MOST_PLANES, 5), dtype=np.float32)
    number = np.zeros(len(vertices), dtype=np.int64)
    starts = np.searchsorted(ways.owner, np.arange(len(vertices) + 1))
    counts = np.asarray(around.lattice.shape, dtype=np.int64)
    find_planes(vertices, counts, points, lit, starts, *_obstacles(around, ways, points), planes, number)
    return np.repeat(vertices, number), planes[np.arange(MOST_PLANES) < number[:, None]]


def _obstacles(around: Surroundings, ways: Ways, points: Float64) -> tuple[Int64, NDArray[np.bool_], Float64, Float64]:
    """Return of each way its ends (n, 2), whether it is blocked, by what normal towards its start, and where."""
    geometry, lattice = around.knowledge.geometry, around.lattice
    triangles = geometry.triangles[np.where(ways.blocked, ways.triangle, 0)]
    p = (geometry.vertices[triangles] - np.array(lattice.bounds_min)) / lattice.voxel_size
    normal = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    start, end = points.reshape(-1, 3)[ways.ends[:, 0]], points.reshape(-1, 3)[ways.ends[:, 1]]
    normal *= np.where(np.einsum("ij,ij->i", normal, start - end) >= 0.0, 1.0, -1.0)[:, None]
    met = start + ways.distance[:, None] * (end - start)
    return ways.ends, ways.blocked, normal, met
