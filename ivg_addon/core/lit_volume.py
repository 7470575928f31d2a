# SPDX-License-Identifier: GPL-3.0-or-later
"""Which part of each dual cell light can reach.

A cell that a wall or a solid cuts averages where no light is. Its tally is therefore divided by
its lit volume, found with points spread through the cell. (The same points tell of what the vertex
stores a mean: `prefilter.py` takes it back.) Random rays from a point vote, by the
first surface that they meet and by what the photon walk found out about it:

* a side that received many photons: the point is lit;
* a side that received none while its other side received several: the point is behind or inside
  something;
* a side that received a few: perhaps a dim room, perhaps a leak (at an edge, rounding lets one
  photon in ten million through); half a vote for lit;
* neither side received several: this tells nothing (a leaf too small to be hit, the gap under a box);
* nothing: lit where a world shines, else this tells nothing.

Two votes ahead decide. One would not do: photons are counted in patches, and a patch of a floor may
lie on both sides of a wall that stands on it.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .cell_points import keep_own_side, mean_weights, spread_points
from .compiled import inlined, kernel
from .dual_cells import Lattice
from .embree import MISS, Tracer
from .partitions import Partitions
from .progress import Progress
from .random import STREAM_LIT_VOLUME, random4
from .scene import Float32, Geometry, Int32
from .side_by_side import side_by_side_steps
from .surface_bins import BACK, FRONT, SurfaceBins, patch_of
from .vectors import sphere_direction

_MOST_RAYS = 16
_PROBES = 8
"""Points in a cell that no geometry cuts: it is lit as a whole or not at all."""
_BATCH = 1 << 17

MANY_PHOTONS = 16
"""So many on a patch of surface are no leak."""
SEVERAL_PHOTONS = 8
"""A side as bright would have received none of so many by a chance of 3 in 10,000."""
LEAK_RATIO = 1e-4
"""A side that received less than this share of what its other side received did so by a leak."""
DIM = 0.05
"""A side that received no more than this share of what its other side received is dim: see `outshone.py`."""

UNLIT, UNKNOWN, PERHAPS_LIT, LIT = -2, 0, 1, 2
"""What a ray says of the point it starts from, in half votes."""
_MAJORITY = 4


@kernel
def mark_cut_cells(vertices, triangles, low, voxel, counts, half, cut):
    """Set cut (Ni+1, Nj+1, Nk+1) bool for each vertex whose box a triangle's plane and box meet.

    `half` is half of the vertices' boxes' edge, in voxels: ½ for their dual cells.

    Conservative: a cell near a triangle's edge may be marked without being cut, which costs time
    and nothing else.
    """
    for triangle in range(len(triangles)):
        p = np.empty((3, 3))
        for c in range(3):
            for axis in range(3):
                # In voxels, so that the box of vertex i spans [i − half, i + half].
                p[c, axis] = (vertices[triangles[triangle, c], axis] - low[axis]) / voxel[axis]
        first = np.empty(3, dtype=np.int64)
        last = np.empty(3, dtype=np.int64)
        for axis in range(3):
            lowest = min(p[0, axis], min(p[1, axis], p[2, axis]))
            highest = max(p[0, axis], max(p[1, axis], p[2, axis]))
            # Clamped as floats: a far triangle's index may not fit an integer.
            first[axis] = int(np.ceil(min(max(lowest - half, -1.0), counts[axis] + 0.0)))
            last[axis] = int(np.floor(max(min(highest + half, counts[axis] + 0.0), -1.0)))
            first[axis] = max(first[axis], 0)
            last[axis] = min(last[axis], counts[axis] - 1)
        nx, ny, nz = _cross(p)
        reach = half * (abs(nx) + abs(ny) + abs(nz)) * (1.0 + 1e-6)
        plane = nx * p[0, 0] + ny * p[0, 1] + nz * p[0, 2]
        for i in range(first[0], last[0] + 1):
            for j in range(first[1], last[1] + 1):
                for k in range(first[2], last[2] + 1):
                    if abs(nx * i + ny * j + nz * k - plane) <= reach:
                        cut[i, j, k] = True


@inlined
def _cross(p):
    """Return the (unnormalised) normal of a triangle p (3 corners, 3)."""
    ax, ay, az = p[1, 0] - p[0, 0], p[1, 1] - p[0, 1], p[1, 2] - p[0, 2]
    bx, by, bz = p[2, 0] - p[0, 0], p[2, 1] - p[0, 1], p[2, 2] - p[0, 2]
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@kernel
def spread_directions(identifiers, attempt, seed, directions):
    """Fill directions (n, 3) float32 with uniform directions addressed by (identifier, attempt)."""
    for row in range(len(identifiers)):
        u, v, _, _ = random4(seed, identifiers[row], STREAM_LIT_VOLUME + 1 + attempt)
        x, y, z = sphere_direction(u, v)
        directions[row, 0] = np.float32(x)
        directions[row, 1] = np.float32(y)
        directions[row, 2] = np.float32(z)


@inlined
def _normal_dot(vertices, triangles, triangle, dx, dy, dz):
    """Return the sign-carrying product of a direction with a triangle's normal."""
    p = np.empty((3, 3))
    for c in range(3):
        for axis in range(3):
            p[c, axis] = vertices[triangles[triangle, c], axis]
    nx, ny, nz = _cross(p)
    return dx * nx + dy * ny + dz * nz


@kernel
def judge(
    directions,
    hit_triangle,
    hit_u,
    hit_v,
    vertices,
    triangles,
    divisions,
    offset,
    bin_counts,
    world_shines,
    least_share,
    verdict,
):
    """Fill verdict (n,) int8 with `LIT`, `UNLIT`, `PERHAPS_LIT` or `UNKNOWN` for each ray."""
    for ray in range(len(hit_triangle)):
        triangle = hit_triangle[ray]
        if triangle == MISS:
            verdict[ray] = LIT if world_shines else UNKNOWN
            continue
        along = _normal_dot(
            vertices,
            triangles,
            triangle,
            directions[ray, 0],
            directions[ray, 1],
            directions[ray, 2],
        )
        side = FRONT if along < 0.0 else BACK
        patch = patch_of(triangle, hit_u[ray], hit_v[ray], divisions, offset)
        verdict[ray] = side_verdict(bin_counts[patch, side], bin_counts[patch, 1 - side], least_share)


@inlined
def side_verdict(here, beyond, least_share):
    """Judge a ray that met a side which received `here` photons, its other side `beyond`."""
    if here > least_share * beyond:
        return LIT if here >= MANY_PHOTONS else PERHAPS_LIT
    return UNLIT if beyond >= SEVERAL_PHOTONS else UNKNOWN


@dataclass(frozen=True)
class LightKnowledge:
    """What the photon walk found out about a scene's surfaces.

    Parameters
    ----------
    geometry, tracer
        The surfaces that diffuse rays see.
    bins, bin_counts
        Patches of the surfaces and the photons received by each of their sides.
    world_shines
        True when rays that meet nothing find light.
    least_share
        A side that received less than this share of what its other side received counts as unlit.
    """

    geometry: Geometry
    tracer: Tracer
    bins: SurfaceBins
    bin_counts: Int32
    world_shines: bool
    least_share: float = LEAK_RATIO

    def of_bright_places(self) -> LightKnowledge:
        """Return the knowledge by which dim places are not lit."""
        return replace(self, least_share=DIM)

    def verdicts(self, origins: Float32, directions: Float32) -> NDArray[np.int8]:
        """Return what n rays, (n, 3) each, say of the points that they start from."""
        hits = self.tracer.intersect(origins, directions)
        verdict = np.empty(len(origins), dtype=np.int8)
        judge(
            directions,
            hits.triangle,
            hits.u,
            hits.v,
            self.geometry.vertices,
            self.geometry.triangles,
            self.bins.divisions,
            self.bins.offset,
            self.bin_counts,
            self.world_shines,
            self.least_share,
            verdict,
        )
        return verdict

    def lit(self, points: Float32, identifiers: NDArray[np.int64], seed: int) -> NDArray[np.bool_]:
        """Tell for n points (n, 3) whether light can reach them.

        `identifiers` (n,) int64 address the random rays, so that the answer does not depend on
        how points are batched.
        """
        votes = np.zeros(len(points), dtype=np.int8)
        undecided = np.arange(len(points))
        for attempt in range(_MOST_RAYS):
            origins = np.ascontiguousarray(points[undecided])
            directions = np.empty_like(origins)
            spread_directions(identifiers[undecided], attempt, seed, directions)
            votes[undecided] += self.verdicts(origins, directions)
            undecided = undecided[np.abs(votes[undecided]) < _MAJORITY]
            if len(undecided) == 0:
                break
        return votes > 0


@dataclass(frozen=True)
class LitParts:
    """The part of each dual cell that light can reach, on its vertex's side of thin walls.

    Parameters
    ----------
    share : (Ni+1, Nj+1, Nk+1) float32
        Of the cell's volume.
    weights : (Ni+1, Nj+1, Nk+1, 3, 3, 3) float16
        Means over it of the trilinear weights, as `Lattice.whole_cell_weights` has them; those themselves where the
        part is the whole or nothing.
    """

    share: Float32
    weights: NDArray[np.float16]

    @classmethod
    def whole(cls, lattice: Lattice) -> LitParts:
        """Return those of cells that light reaches everywhere."""
        return cls(np.ones(lattice.shape, dtype=np.float32), lattice.whole_cell_weights())


def lit_part_steps(
    knowledge: LightKnowledge,
    lattice: Lattice,
    partitions: Partitions,
    outshone: NDArray[np.bool_],
    points: int,
    seed: int,
    threads: int,
) -> Generator[Progress, None, LitParts]:
    """Return the lit part of every dual cell; yields as it goes.

    Cells that geometry cuts, and those beside vertices with planes, get `points` points, the others a few: they are
    wholly lit or not. For the vertices `outshone`, (vertices,), dim places are not lit.
    """
    low = np.asarray(lattice.bounds_min, dtype=np.float64)
    counts = np.asarray(lattice.shape, dtype=np.int64)
    bright = knowledge.of_bright_places()
    marked = np.zeros(lattice.shape, dtype=bool)
    geometry = knowledge.geometry
    mark_cut_cells(geometry.vertices, geometry.triangles, low, lattice.voxel_size, counts, 0.5, marked)
    divided = partitions.divided.reshape(lattice.shape)
    beside = _with_neighbours(divided).reshape(-1)

    cut = marked.reshape(-1) | beside
    sides = (partitions.start, partitions.planes)
    share = np.zeros(lattice.vertex_count, dtype=np.float32)
    weights = lattice.whole_cell_weights().reshape(-1, 3, 3, 3)

    def measure(cells: NDArray[np.int64], per_cell: int) -> None:
        origins = np.empty((len(cells) * per_cell, 3), dtype=np.float32)
        spread_points(cells, 0, per_cell, seed, low, lattice.voxel_size, counts, origins)
        identifiers = (cells[:, None] * per_cell + np.arange(per_cell)).reshape(-1)
        lit = knowledge.lit(origins, identifiers, seed)
        dimmed = np.flatnonzero(np.repeat(outshone[cells], per_cell) & lit)
        lit[dimmed] = bright.lit(origins[dimmed], identifiers[dimmed], seed)
        lit = lit.reshape(len(cells), per_cell)
        keep_own_side(cells, seed, counts, *sides, lit)
        share[cells] = lit.mean(axis=1, dtype=np.float32)
        partly = cut[cells] & lit.any(axis=1) & (beside[cells] | ~lit.all(axis=1))
        means = np.empty((np.count_nonzero(partly), 3, 3, 3))
        mean_weights(cells[partly], lit[partly], seed, counts, *sides, beside[cells[partly]], means)
        weights[cells[partly]] = means

    jobs = [
        *_jobs(np.flatnonzero(~cut), _PROBES),
        *_jobs(np.flatnonzero(cut), points),
    ]
    yield from side_by_side_steps(lambda job: measure(*job), jobs, "Measuring lit volumes", threads)
    whole = ~(marked | divided).reshape(-1)
    share[whole] = share[whole] >= 0.5
    return LitParts(share.reshape(lattice.shape), weights.reshape(*lattice.shape, 3, 3, 3))


def _with_neighbours(marked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Mark the 26 neighbours of marked vertices, too."""
    for axis in range(3):
        wider = marked.copy()
        before, after = [slice(None)] * 3, [slice(None)] * 3
        before[axis], after[axis] = slice(None, -1), slice(1, None)
        wider[tuple(before)] |= marked[tuple(after)]
        wider[tuple(after)] |= marked[tuple(before)]
        marked = wider
    return marked


def _jobs(cells: NDArray[np.int64], per_cell: int) -> list[tuple[NDArray[np.int64], int]]:
    """Divide cells into batches of about `_BATCH` points."""
    size = max(1, _BATCH // per_cell)
    return [(cells[start : start + size], per_cell) for start in range(0, len(cells), size)]
