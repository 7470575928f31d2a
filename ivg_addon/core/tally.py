# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons in flight become sums: the three estimators of docs/method.md.

Sums are fixed-point integers: integer addition is associative, so any number of threads and any
batch size give the same bits. A flight has one direction ω = −d and one weight w, so what it adds
to a vertex is a scalar times the nine products w_c ω_j; the kernels write those nine numbers into
one slot per vertex:

* `TRACK_LENGTH`: slot = octant of ω (8 slots), scalar = ℓ/h̄ in every dual cell it traverses
  (h̄ the geometric mean of the voxel's edges, so that the numbers are of order one);
* `REPORT`: slot = hemisphere ±k (6 slots), scalar = 1 at every crossing of a voxel face
  perpendicular to axis k;
* `CROSSING`: the same with scalar 1/|ω_k|.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .compiled import inlined, kernel, merged
from .dual_cells import Lattice
from .partitions import Partitions
from .settings import Estimator
from .sides import NO_NORMAL, side_distance, speaks_for

Int64 = NDArray[np.int64]

GRAZING_COSINE = 0.01
"""`CROSSING` divides by max(|ω·δ|, this). The crossing rate of an isotropic field has density
2cos θ, so the part of the tangential sums (∝ tan θ) that the cap costs is below 0.6 %; without it
their variance diverges logarithmically."""

WEIGHT_LIMIT = 16.0
"""No photon weight exceeds this (see scattering.py); fixed-point scales are chosen for it."""

_TICKS = 2.0**40
"""The walk counts lengths in integers, so many for the box's diagonal: they compare and add in a fraction of the time
that floats need, and the legs of a flight sum up to its length exactly."""
_NEVER = 2.0**50
"""Ticks that no flight inside the box has."""

AT_THE_END = 1e-3
"""Voxels by which a flight is taken to be longer at both ends when it is asked which faces it crosses. One that starts
or ends on a wall in the plane of a face starts just above it, or ends a rounding error away: it crosses."""


@merged
def clip_to_box(x, inverse, t0, t1, top, free):
    """Return the part (t₀, t₁) of a segment that lies inside the box; empty when t₀ ≥ t₁.

    Slab by slab, with zero components of the direction handled apart, so that no 0·∞ arises.

    Parameters
    ----------
    x, inverse
        Position at t = 0 in voxels from the box's lower corner, and metres per voxel along each axis.
    t0, t1
        The segment's ends, metres.
    top
        Voxels along each axis.
    free
        An axis that does not count, or −1.
    """
    for axis in range(3):
        if axis == free:
            continue
        if math.isinf(inverse[axis]):
            if x[axis] < 0.0 or x[axis] > top[axis]:
                t1 = t0 - 1.0
        else:
            near = -x[axis] * inverse[axis]
            far = (top[axis] - x[axis]) * inverse[axis]
            t0 = max(t0, min(near, far))
            t1 = min(t1, max(near, far))
    return t0, t1


@inlined
def nearest_vertex(x, top):
    """Return the index of the vertex nearest to a position in voxels, along one axis."""
    return math.floor(min(max(x, 0.0), top) + 0.5)


def _track_length_kernel(divided: bool) -> Callable[..., None]:
    """Return the kernel of the track-length estimator, for a grid with partitions or, faster, without."""

    @kernel
    def deposit(origins, directions, weights, lengths, low, voxel, counts, scale, start, planes, sums):
        """Add φ ω ℓ to every dual cell that the n segments traverse, ℓ the length on the positive sides of its planes.

        Parameters
        ----------
        origins, directions, weights : (n, 3) float32
        lengths : (n,) float32
            Metres to the hit; 1e37 without one.
        low, voxel : (3,) float64
            Lower corner of the bounds, and voxel size.
        counts : (3,) int64
            Vertices along each axis.
        scale
            Fixed-point steps for a weight of one over one metre.
        start, planes
            As of `Partitions`; unused by the kernel for none.
        sums : (vertices · 8, 9) int64
            Changed in place.
        """
        top = (counts[0] - 1.0, counts[1] - 1.0, counts[2] - 1.0)
        diagonal = math.sqrt((top[0] * voxel[0]) ** 2 + (top[1] * voxel[1]) ** 2 + (top[2] * voxel[2]) ** 2)
        ticks = _TICKS / diagonal
        row_y = counts[2] * 8
        row_x = counts[1] * row_y
        for ray in range(len(lengths)):
            d = (float(directions[ray, 0]), float(directions[ray, 1]), float(directions[ray, 2]))
            x, inverse = in_voxels(origins, ray, d, low, voxel)
            t0, t1 = clip_to_box(x, inverse, 0.0, float(lengths[ray]), top, -1)
            if not t0 < t1:
                continue
            # ω = −d
            products = products_of(weights, ray, -scale / ticks, d)
            octant = (1 if d[0] < 0 else 0) + (2 if d[1] < 0 else 0) + (4 if d[2] < 0 else 0)

            # Amanatides & Woo's walk, over dual cells: boundaries lie at half voxels.
            i, step_x, next_x, delta_x, wall_x = axis_walk(x[0], t0, d[0], inverse[0], top[0], ticks)
            j, step_y, next_y, delta_y, wall_y = axis_walk(x[1], t0, d[1], inverse[1], top[1], ticks)
            k, step_z, next_z, delta_z, wall_z = axis_walk(x[2], t0, d[2], inverse[2], top[2], ticks)
            end = min(np.int64(min((t1 - t0) * ticks, _NEVER)), min(wall_x, min(wall_y, wall_z)))
            if divided:
                rate = (1.0 / (inverse[0] * ticks), 1.0 / (inverse[1] * ticks), 1.0 / (inverse[2] * ticks))
                entry = (x[0] + t0 / inverse[0], x[1] + t0 / inverse[1], x[2] + t0 / inverse[2])
            cell = i * row_x + j * row_y + k * 8 + octant
            step_x *= row_x
            step_y *= row_y
            step_z *= 8
            t = 0
            while True:
                t_next = min(next_x, min(next_y, next_z))
                leg = float(min(t_next, end) - t)
                row = np.uint64(cell)
                if divided:
                    vertex = cell >> 3
                    if start[vertex] < start[vertex + 1]:
                        leg = length_on_side(start, planes, vertex, entry, rate, float(t), t + leg)
                add_leg(sums, row, products, leg)
                if t_next >= end:
                    break
                t = t_next
                if next_x == t_next:
                    cell += step_x
                    next_x += delta_x
                elif next_y == t_next:
                    cell += step_y
                    next_y += delta_y
                else:
                    cell += step_z
                    next_z += delta_z

    return deposit


deposit_track_length = _track_length_kernel(divided=False)
deposit_track_length_on_side = _track_length_kernel(divided=True)


@merged
def products_of(weights, ray, unit, d):
    """Return the nine products w_c d_j of a flight, in so many units; they are constant along it."""
    red, green, blue = weights[ray, 0] * unit, weights[ray, 1] * unit, weights[ray, 2] * unit
    of_red = red * d[0], red * d[1], red * d[2]
    of_green = green * d[0], green * d[1], green * d[2]
    of_blue = blue * d[0], blue * d[1], blue * d[2]
    return of_red + of_green + of_blue


@merged
def add_leg(sums, row, products, leg):
    """Add the nine products, times the length of a leg, to a row."""
    p0, p1, p2, p3, p4, p5, p6, p7, p8 = products
    sums[row, 0] += np.int64(p0 * leg)
    sums[row, 1] += np.int64(p1 * leg)
    sums[row, 2] += np.int64(p2 * leg)
    sums[row, 3] += np.int64(p3 * leg)
    sums[row, 4] += np.int64(p4 * leg)
    sums[row, 5] += np.int64(p5 * leg)
    sums[row, 6] += np.int64(p6 * leg)
    sums[row, 7] += np.int64(p7 * leg)
    sums[row, 8] += np.int64(p8 * leg)


@merged
def length_on_side(start, planes, vertex, x, rate, t0, t1):
    """Return how much of the leg from t₀ to t₁ of the path x + rate·t, in voxels, lies on a vertex's side."""
    for plane in range(start[vertex], start[vertex + 1]):
        ahead = side_distance(planes, plane, x[0], x[1], x[2])
        speed = planes[plane, 0] * rate[0] + planes[plane, 1] * rate[1] + planes[plane, 2] * rate[2]
        if speed > 0.0:
            t0 = max(t0, -ahead / speed)
        elif speed < 0.0:
            t1 = min(t1, -ahead / speed)
        elif ahead < 0.0:
            t1 = t0
    return max(0.0, t1 - t0)


@merged
def in_voxels(origins, ray, d, low, voxel):
    """Return a ray's origin in voxels from the box's lower corner, and its metres per voxel along each axis."""
    x = (
        (origins[ray, 0] - low[0]) / voxel[0],
        (origins[ray, 1] - low[1]) / voxel[1],
        (origins[ray, 2] - low[2]) / voxel[2],
    )
    return x, (voxel[0] / d[0], voxel[1] / d[1], voxel[2] / d[2])


@inlined
def axis_walk(x, t0, d, inverse, top, ticks):
    """Return what the walk along one axis needs, in ticks from where the flight enters the box.

    All begins at the position there, held inside the box: however far away the flight started, and whatever rounding
    made of that, the walk stays inside the lattice.

    Returns
    -------
    tuple
        First cell; step to the next; length to the first boundary between cells, between boundaries, and to the wall of
        the box.
    """
    never = np.int64(_NEVER)
    if d == 0.0:
        return nearest_vertex(x, top), 0, never, never, never
    x = min(max(x + t0 / inverse, 0.0), top)
    cell = nearest_vertex(x, top)
    step = 1 if d > 0.0 else -1
    boundary = abs((cell + 0.5 * step - x) * inverse)
    wall = abs(((top if d > 0.0 else 0.0) - x) * inverse)
    return (
        cell,
        step,
        np.int64(min(boundary * ticks, _NEVER)),
        np.int64(min(abs(inverse) * ticks, _NEVER)),
        np.int64(min(wall * ticks, _NEVER)),
    )


@kernel
def deposit_crossings(
    origins, directions, weights, lengths, low, voxel, counts, scale, min_cosine, start, planes, sums
):
    """Add φ ω / max(|ω_k|, min_cosine) at every voxel face, to the nearest vertex in its plane if it speaks for it.

    With `min_cosine` 1 this is the report's formula as printed (`REPORT`), with `GRAZING_COSINE` the unbiased one
    (`CROSSING`). Parameters as of `deposit_track_length`, but `scale` holds the fixed-point steps for a weight of one,
    and `sums` is (vertices · 6, 9) int64.
    """
    top = (counts[0] - 1.0, counts[1] - 1.0, counts[2] - 1.0)
    beyond = AT_THE_END * min(voxel[0], min(voxel[1], voxel[2]))
    for ray in range(len(lengths)):
        d = (float(directions[ray, 0]), float(directions[ray, 1]), float(directions[ray, 2]))
        x, inverse = in_voxels(origins, ray, d, low, voxel)
        for axis in range(3):
            if math.isinf(inverse[axis]):
                continue
            t0, t1 = clip_to_box(x, inverse, -beyond, lengths[ray] + beyond, top, axis)
            if not t0 < t1:
                continue
            factor = scale / max(abs(d[axis]), min_cosine)
            # ω = −d lies on the side +axis when d points towards −axis.
            hemisphere = 2 * axis + (1 if d[axis] > 0.0 else 0)
            near, far = x[axis] + t0 / inverse[axis], x[axis] + t1 / inverse[axis]
            first = np.int64(math.ceil(max(min(near, far), 0.0)))
            last = np.int64(math.floor(min(max(near, far), top[axis])))
            for plane in range(first, last + 1):
                t = (plane - x[axis]) * inverse[axis]
                vertex = 0
                for other in range(3):
                    index = plane if other == axis else nearest_vertex(x[other] + t / inverse[other], top[other])
                    vertex = vertex * counts[other] + index
                at = (x[0] + t / inverse[0], x[1] + t / inverse[1], x[2] + t / inverse[2])
                if not speaks_for(start, planes, vertex, at, NO_NORMAL):
                    continue
                for channel in range(3):
                    flux = factor * weights[ray, channel]
                    for component in range(3):
                        sums[vertex * 6 + hemisphere, 3 * channel + component] -= np.int64(flux * d[component])


@dataclass(frozen=True)
class Tally:
    """One thread's sums, and how to add to them.

    Parameters
    ----------
    lattice, estimator
        What is being estimated.
    steps
        Fixed-point steps per unit.
    sums : (vertices · slots · 9,) int64
    partitions
        Which flights vertices count.
    """

    lattice: Lattice
    estimator: Estimator
    steps: float
    sums: Int64
    partitions: Partitions

    @staticmethod
    def slots(estimator: Estimator) -> int:
        """Return how many slots a vertex has: octants or hemispheres."""
        return 8 if estimator is Estimator.TRACK_LENGTH else 6

    @classmethod
    def bytes(cls, lattice: Lattice, estimator: Estimator) -> int:
        """Return the memory of one tally."""
        return lattice.vertex_count * cls.slots(estimator) * 9 * 8

    @classmethod
    def empty(cls, lattice: Lattice, estimator: Estimator, photons: int, bounces: int) -> Tally:
        """Return a tally of zeros whose scale cannot overflow.

        A photon has at most `bounces` + 1 flights and each adds to a cell at most once (a
        diagonal, √3 h̄ for cubic voxels) or crosses three faces of a vertex.
        """
        largest = WEIGHT_LIMIT * photons * (bounces + 1)
        if estimator is Estimator.TRACK_LENGTH:
            voxel = lattice.voxel_size
            largest *= float(np.linalg.norm(voxel) / np.cbrt(voxel.prod()))
        elif estimator is Estimator.CROSSING:
            largest /= GRAZING_COSINE
        steps = 2.0 ** min(40, 62 - math.ceil(math.log2(largest)))
        return cls(
            lattice=lattice,
            estimator=estimator,
            steps=steps,
            sums=np.zeros(lattice.vertex_count * cls.slots(estimator) * 9, dtype=np.int64),
            partitions=Partitions.none(lattice.vertex_count),
        )

    def divide(self, partitions: Partitions) -> Tally:
        """Return a tally that goes on with these sums, with those of divided vertices begun anew."""
        self.sums.reshape(self.lattice.vertex_count, -1)[partitions.divided] = 0
        return replace(self, partitions=partitions)

    def deposit(
        self,
        origins: NDArray[np.float32],
        directions: NDArray[np.float32],
        weights: NDArray[np.float32],
        lengths: NDArray[np.float32],
    ) -> None:
        """Add n flights: origins, directions, weights (n, 3), lengths (n,) in metres."""
        lattice = self.lattice
        box = (
            np.asarray(lattice.bounds_min, dtype=np.float64),
            lattice.voxel_size,
            np.asarray(lattice.shape, dtype=np.int64),
        )
        flights = (origins, directions, weights, lengths)
        start, planes = self.partitions.start, self.partitions.planes
        rows = self.sums.reshape(-1, 9)
        if self.estimator is Estimator.TRACK_LENGTH:
            deposit = deposit_track_length_on_side if len(planes) else deposit_track_length
            mean_edge = np.cbrt(lattice.voxel_size.prod())
            deposit(*flights, *box, self.steps / mean_edge, start, planes, rows)
        else:
            cosine = 1.0 if self.estimator is Estimator.REPORT else GRAZING_COSINE
            deposit_crossings(*flights, *box, self.steps, cosine, start, planes, rows)

    def add(self, other: Tally) -> None:
        """Add another thread's sums to this one's."""
        np.add(self.sums, other.sums, out=self.sums)

    def vectors(self, flux_per_weight: float) -> NDArray[np.float64]:
        """Return the irradiance vectors, (Ni+1, Nj+1, Nk+1, 6, 3 channel, 3 xyz) W/m².

        Σ φ ω ℓ / V or Σ φ ω / A, over whole dual cells: the lit share is not known here.
        `flux_per_weight` is the flux in watts of a photon of weight one.
        """
        lattice = self.lattice
        slots = self.slots(self.estimator)
        sums = self.sums.reshape(*lattice.shape, slots, 3, 3)
        unit = flux_per_weight / self.steps
        vectors = np.empty((*lattice.shape, 6, 3, 3))
        if self.estimator is Estimator.TRACK_LENGTH:
            octant = np.arange(8)
            for axis in range(3):
                positive = (octant >> axis & 1).astype(bool)
                vectors[..., 2 * axis, :, :] = sums[..., positive, :, :].sum(axis=3)
                vectors[..., 2 * axis + 1, :, :] = sums[..., ~positive, :, :].sum(axis=3)
            unit *= float(np.cbrt(lattice.voxel_size.prod()))
            vectors *= unit / lattice.cell_volumes()[..., None, None, None]
        else:
            vectors[...] = sums
            areas = np.repeat(lattice.face_areas(), 2, axis=-1)
            vectors *= unit / areas[..., None, None]
        return vectors
