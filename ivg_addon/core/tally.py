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
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .compiled import inlined, kernel, merged
from .dual_cells import Lattice
from .settings import Estimator

Int64 = NDArray[np.int64]

GRAZING_COSINE = 0.01
"""`CROSSING` divides by max(|ω·δ|, this). The crossing rate of an isotropic field has density
2cos θ, so the part of the tangential sums (∝ tan θ) that the cap costs is below 0.6 %; without it
their variance diverges logarithmically."""

WEIGHT_LIMIT = 16.0
"""No photon weight exceeds this (see scattering.py); fixed-point scales are chosen for it."""

_SQRT3 = math.sqrt(3.0)


@merged
def clip_to_box(o, inverse, length, low, high):
    """Return the interval (t₀, t₁) of the segment o + t·d, 0 ≤ t ≤ length, inside the box.

    Empty when t₀ ≥ t₁. `o` and `inverse` = 1/d are tuples, `low` and `high` the box's corners. The
    slab method, with zero components of d handled apart, so that no 0·∞ arises.
    """
    t0 = 0.0
    t1 = length
    for axis in range(3):
        if math.isinf(inverse[axis]):
            if o[axis] < low[axis] or o[axis] > high[axis]:
                t1 = -1.0
        else:
            near = (low[axis] - o[axis]) * inverse[axis]
            far = (high[axis] - o[axis]) * inverse[axis]
            t0 = max(t0, min(near, far))
            t1 = min(t1, max(near, far))
    return t0, t1


@inlined
def first_cell(position, count):
    """Return the index of the dual cell at a position counted in voxels from −½, clamped."""
    return min(max(math.floor(position), 0), count - 1)


@kernel
def deposit_track_length(origins, directions, weights, lengths, low, high, voxel, counts, scale, sums):
    """Add φ ω ℓ to every dual cell that the n segments traverse.

    Parameters
    ----------
    origins, directions, weights : (n, 3) float32
    lengths : (n,) float32
        Metres to the hit; 1e37 without one.
    low, high, voxel : (3,) float64
        Bounds and voxel size.
    counts : (3,) int64
        Vertices along each axis.
    scale
        Fixed-point steps for a weight of one over one h̄, divided by h̄.
    sums : (vertices · 8 · 9,) int64
        Changed in place.
    """
    stride_y = counts[2] * 72
    stride_x = counts[1] * stride_y
    for ray in range(len(lengths)):
        o = (float(origins[ray, 0]), float(origins[ray, 1]), float(origins[ray, 2]))
        d = (float(directions[ray, 0]), float(directions[ray, 1]), float(directions[ray, 2]))
        inverse = (1.0 / d[0], 1.0 / d[1], 1.0 / d[2])
        t, t_end = clip_to_box(o, inverse, float(lengths[ray]), low, high)
        if not t < t_end:
            continue
        # ω = −d; the nine products are constant along the flight.
        red, green, blue = -weights[ray, 0] * scale, -weights[ray, 1] * scale, -weights[ray, 2] * scale
        p0, p1, p2 = red * d[0], red * d[1], red * d[2]
        p3, p4, p5 = green * d[0], green * d[1], green * d[2]
        p6, p7, p8 = blue * d[0], blue * d[1], blue * d[2]
        octant = (1 if d[0] < 0 else 0) + (2 if d[1] < 0 else 0) + (4 if d[2] < 0 else 0)

        # Amanatides & Woo's walk, over dual cells: boundaries lie at half voxels.
        i, step_x, next_x, delta_x = _axis_walk(t, o[0], d[0], inverse[0], low[0], voxel[0], counts[0])
        j, step_y, next_y, delta_y = _axis_walk(t, o[1], d[1], inverse[1], low[1], voxel[1], counts[1])
        k, step_z, next_z, delta_z = _axis_walk(t, o[2], d[2], inverse[2], low[2], voxel[2], counts[2])
        slot = i * stride_x + j * stride_y + k * 72 + octant * 9
        step_x *= stride_x
        step_y *= stride_y
        step_z *= 72
        while True:
            t_next = min(next_x, min(next_y, next_z))
            leg = min(t_next, t_end) - t
            if leg > 0.0:
                sums[slot] += np.int64(p0 * leg)
                sums[slot + 1] += np.int64(p1 * leg)
                sums[slot + 2] += np.int64(p2 * leg)
                sums[slot + 3] += np.int64(p3 * leg)
                sums[slot + 4] += np.int64(p4 * leg)
                sums[slot + 5] += np.int64(p5 * leg)
                sums[slot + 6] += np.int64(p6 * leg)
                sums[slot + 7] += np.int64(p7 * leg)
                sums[slot + 8] += np.int64(p8 * leg)
            if t_next >= t_end:
                break
            t = t_next
            # Without branches, which would be mispredicted every other cell.
            at_x, at_y, at_z = next_x <= t_next, next_y <= t_next, next_z <= t_next
            slot += (step_x if at_x else 0) + (step_y if at_y else 0) + (step_z if at_z else 0)
            next_x += delta_x if at_x else 0.0
            next_y += delta_y if at_y else 0.0
            next_z += delta_z if at_z else 0.0


@inlined
def _axis_walk(t, o, d, inverse, low, voxel, count):
    """Return (cell at t, step, t of the next dual-cell boundary, t between boundaries) of an axis."""
    cell = first_cell((o + t * d - low) / voxel + 0.5, count)
    if d > 0.0:
        return cell, 1, (low + (cell + 0.5) * voxel - o) * inverse, voxel * inverse
    if d < 0.0:
        return cell, -1, (low + (cell - 0.5) * voxel - o) * inverse, -voxel * inverse
    return cell, 0, math.inf, math.inf


@kernel
def deposit_crossings(origins, directions, weights, lengths, low, high, voxel, counts, scale, min_cosine, sums):
    """Add φ ω / max(|ω_k|, min_cosine) at every voxel face, to the nearest vertex in its plane.

    With `min_cosine` 1 this is the report's formula as printed (`REPORT`), with
    `GRAZING_COSINE` the unbiased one (`CROSSING`). Parameters as of `deposit_track_length`, but
    `scale` holds the fixed-point steps for a weight of one, and `sums` is
    (vertices · 6 · 9,) int64.
    """
    for ray in range(len(lengths)):
        o = (float(origins[ray, 0]), float(origins[ray, 1]), float(origins[ray, 2]))
        d = (float(directions[ray, 0]), float(directions[ray, 1]), float(directions[ray, 2]))
        inverse = (1.0 / d[0], 1.0 / d[1], 1.0 / d[2])
        t0, t1 = clip_to_box(o, inverse, float(lengths[ray]), low, high)
        if not t0 < t1:
            continue
        for axis in range(3):
            if d[axis] == 0.0:
                continue
            factor = scale / max(abs(d[axis]), min_cosine)
            # ω = −d lies on the side +axis when d points towards −axis.
            hemisphere = 2 * axis + (1 if d[axis] > 0.0 else 0)
            start = (o[axis] + t0 * d[axis] - low[axis]) / voxel[axis]
            end = (o[axis] + t1 * d[axis] - low[axis]) / voxel[axis]
            first = max(math.ceil(min(start, end)), 0)
            last = min(math.floor(max(start, end)), counts[axis] - 1)
            for plane in range(first, last + 1):
                t = (low[axis] + plane * voxel[axis] - o[axis]) / d[axis]
                slot = 0
                for other in range(3):
                    index = plane
                    if other != axis:
                        index = first_cell(
                            (o[other] + t * d[other] - low[other]) / voxel[other] + 0.5,
                            counts[other],
                        )
                    slot = slot * counts[other] + index
                slot = (slot * 6 + hemisphere) * 9
                for channel in range(3):
                    flux = factor * weights[ray, channel]
                    for component in range(3):
                        sums[slot + 3 * channel + component] -= np.int64(flux * d[component])


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
    """

    lattice: Lattice
    estimator: Estimator
    steps: float
    sums: Int64

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
        )

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
            np.asarray(lattice.bounds_max, dtype=np.float64),
            lattice.voxel_size,
            np.asarray(lattice.shape, dtype=np.int64),
        )
        flights = (origins, directions, weights, lengths)
        if self.estimator is Estimator.TRACK_LENGTH:
            mean_edge = np.cbrt(lattice.voxel_size.prod())
            deposit_track_length(*flights, *box, self.steps / mean_edge, self.sums)
        else:
            cosine = 1.0 if self.estimator is Estimator.REPORT else GRAZING_COSINE
            deposit_crossings(*flights, *box, self.steps, cosine, self.sums)

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
