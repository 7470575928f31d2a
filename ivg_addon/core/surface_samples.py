# SPDX-License-Identifier: GPL-3.0-or-later
"""The irradiance of surfaces, as the photons that landed there tell it.

Flux over area is irradiance, without any grid. Patches that lie together and face alike make one sample. Left out is
what would tell a wrong irradiance, or one that no look-up can tell apart:

* patches that other geometry reaches into: the light falls on a part of them only, who knows how much;
* patches that got none although chance would have brought some: something lies on them;
* samples that face another surface within a quarter of a voxel: gaps, the backs of what hangs on a wall;
* sides of surfaces that reflect nothing diffusely, or that diffuse rays do not see: nobody asks for their irradiance.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from .dual_cells import Lattice
from .embree import MISS
from .lit_volume import SEVERAL_PHOTONS, LightKnowledge
from .lobes import KIND
from .progress import Progress, part
from .scene import MATTE, NO_TEXTURE, SHEEN, TRANSLUCENT, Float32, Int32
from .side_by_side import side_by_side_steps
from .surface_bins import FRONT
from .surface_patches import Patches, spokes
from .surfaces import Surfaces

Float64 = NDArray[np.float64]
Mask = NDArray[np.bool_]

SPAN = 0.125
"""Voxels along each axis within which patches make one sample."""
REACH = 0.25
"""Voxels that must be free before a sample."""
_NORMAL_STEPS = 8.0
"""Samples are made of what faces alike within a sixteenth of the unit sphere's radius, along each axis."""
_LIFT = 1e-4
"""Voxels above the surface where rays start."""
_SMALL = 1.0 / 16.0
"""Voxels: what reaches into patches below this size takes too little of their area to be looked for."""
_BY_CHANCE = 3.0
"""Photons: where fewer are expected, none may be chance (with a probability of 5 % or more)."""
_BATCH = 1 << 14
TASK = "Fitting to the surfaces"


@dataclass(frozen=True)
class SurfaceSamples:
    """Irradiance at n places on surfaces.

    Parameters
    ----------
    points, normals : (n, 3) float64
        Metres; unit, on the side that the light arrives at.
    area : (n,) float64
        m².
    irradiance : (n, 3) float64
        W/m².
    """

    points: Float64
    normals: Float64
    area: Float64
    irradiance: Float64


@dataclass(frozen=True)
class _Sides:
    """Sides of n patches: the patch, its centre, the side's normal, its area, what flux and photons it received."""

    patch: NDArray[np.int64]
    centre: Float32
    normal: Float32
    area: Float32
    flux: Float32
    photons: Int32

    def only(self, keep: Mask) -> _Sides:
        """Return some of them."""
        return _Sides(*(getattr(self, item.name)[keep] for item in fields(self)))


def surface_sample_steps(
    knowledge: LightKnowledge,
    surfaces: Surfaces,
    received: Float32,
    flux_scale: float,
    lattice: Lattice,
    expected: Callable[[Float64, Float64], NDArray[np.floating]],
    threads: int,
) -> Generator[Progress, None, SurfaceSamples]:
    """Gather the samples within a grid's box; yields as it goes.

    Parameters
    ----------
    received : (patches, 2, 3) float32
        The grid's light that arrived at each side of each patch, in units of `flux_scale` watts.
    expected
        Irradiance (n, 3) that one would expect at points with normals, roughly.
    threads
        0 for one per processor.
    """
    patches = Patches.of(knowledge.geometry, knowledge.bins)
    sides = _asked(knowledge, surfaces, received, patches, lattice)
    yield Progress(TASK, 0.2)
    sides = sides.only((yield from part(_unobstructed_steps(knowledge, lattice, patches, sides, threads), 0.2, 0.9)))
    group = _together(sides, lattice)
    density = np.bincount(group, sides.photons) / np.bincount(group, sides.area)
    # None where others of the sample got many: something lies there.
    uncovered = (sides.photons > 0) | (density[group] * sides.area < _BY_CHANCE)
    group = np.unique(group[uncovered], return_inverse=True)[1]
    samples, photons = _merged(sides.only(uncovered), group, flux_scale)
    good = _free_before(knowledge, lattice, samples)
    # Nor was a whole sample left dark by chance where the light around would have brought many, or where no light is.
    dark = np.flatnonzero(good & (photons == 0))
    points, normals = samples.points[dark], samples.normals[dark]
    watts = flux_scale * float(received.sum(dtype=np.float64)) / 3.0 / max(1, int(knowledge.bin_counts.sum()))
    few = expected(points, normals).mean(axis=1) * samples.area[dark] < _BY_CHANCE * watts
    good[dark] = few & knowledge.lit(_lifted(points, normals, lattice), dark.astype(np.int64), 0)
    yield Progress(TASK, 1.0)
    return SurfaceSamples(*(getattr(samples, item.name)[good] for item in fields(samples)))


def _asked(
    knowledge: LightKnowledge, surfaces: Surfaces, received: Float32, patches: Patches, lattice: Lattice
) -> _Sides:
    """Return the sides in the box whose irradiance shades something, but those that are dark while the other is lit."""
    inside = ((patches.centre >= lattice.bounds_min) & (patches.centre <= lattice.bounds_max)).all(axis=1)
    # Triangles without area have no normal; what is larger than a voxel's face tells of no place.
    has_normal = (surfaces.planes[:, :3] ** 2).sum(axis=1) > 0.5
    largest = np.prod(lattice.voxel_size) ** (2.0 / 3.0)
    inside &= (patches.area > 0.0) & (patches.area <= largest) & has_normal[patches.triangle]
    found = []
    for side in range(2):
        shades = surfaces.reflects & _is_diffuse(surfaces, side)[surfaces.material]
        here, beyond = knowledge.bin_counts[:, side], knowledge.bin_counts[:, 1 - side]
        is_dark = (here <= knowledge.least_share * beyond) & (beyond >= SEVERAL_PHOTONS)
        patch = np.flatnonzero(inside & shades[patches.triangle] & ~is_dark)
        found.append(
            _Sides(
                patch,
                patches.centre[patch],
                surfaces.planes[patches.triangle[patch], :3] * np.float32(1 - 2 * side),
                patches.area[patch],
                received[patch, side],
                here[patch],
            )
        )
    return _Sides(*(np.concatenate([getattr(each, item.name) for each in found]) for item in fields(_Sides)))


def _is_diffuse(surfaces: Surfaces, side: int) -> Mask:
    """Tell which materials, (m,), reflect light diffusely that arrives at a side, or let it through so."""
    lobes = surfaces.lobes
    of_lobe = np.repeat(np.arange(len(surfaces.back)), np.diff(lobes.first))
    spreads = of_lobe[np.isin(lobes.codes[:, KIND], (MATTE, SHEEN, TRANSLUCENT))]
    own = (surfaces.albedo > 0.0).any(axis=1) | (surfaces.texture != NO_TEXTURE)
    own[spreads] = True
    return np.asarray(own if side == FRONT else own[surfaces.back])


def _unobstructed_steps(
    knowledge: LightKnowledge, lattice: Lattice, patches: Patches, sides: _Sides, threads: int
) -> Generator[Progress, None, Mask]:
    """Tell which patches nothing reaches into: what is seen from their centres along the surface, up to the corners."""
    geometry, bins = knowledge.geometry, knowledge.bins
    small = _SMALL * float(lattice.voxel_size.min())

    def look(piece: slice) -> Mask:
        patch, centre = sides.patch[piece], sides.centre[piece]
        triangle, origins = patches.triangle[patch], _lifted(centre, sides.normal[piece], lattice)
        clear = np.ones(len(patch), dtype=np.bool_)
        ends = np.empty((len(patch), 3), dtype=np.float32)
        for which in range(4):
            spokes(geometry.vertices, geometry.triangles, bins.divisions, bins.offset, patch, triangle, which, ends)
            along = ends - centre
            long = np.flatnonzero((along**2).sum(axis=1) > small * small)
            # A twentieth of the way is left to neighbours that rise at the edge.
            hits = knowledge.tracer.intersect(origins[long], 0.95 * along[long])
            clear[long[(hits.triangle != MISS) & (hits.distance <= 1.0)]] = False
        return clear

    pieces = [slice(at, at + _BATCH) for at in range(0, max(1, len(sides.patch)), _BATCH)]
    return np.concatenate((yield from side_by_side_steps(look, pieces, TASK, threads)))


def _together(sides: _Sides, lattice: Lattice) -> NDArray[np.int64]:
    """Return to which sample each side belongs: by its place and the way it faces."""
    place = np.floor((sides.centre - lattice.bounds_min) / (SPAN * lattice.voxel_size)).astype(np.int64)
    facing = np.rint((sides.normal + 1.0) * _NORMAL_STEPS).astype(np.int64)
    key = np.zeros(len(place), dtype=np.int64)
    for column in (*place.T, *facing.T):
        key = key * (column.max(initial=0) + 1) + column
    return np.unique(key, return_inverse=True)[1]


def _merged(sides: _Sides, group: NDArray[np.int64], flux_scale: float) -> tuple[SurfaceSamples, NDArray[np.int64]]:
    """Return the samples that sides belong to, and how many photons each got."""
    of_side: Float64 = sides.area.astype(np.float64)
    area: Float64 = np.bincount(group, of_side).astype(np.float64)

    def mean(values: NDArray[np.floating]) -> Float64:
        return np.stack([np.bincount(group, column) for column in values.T], axis=1) / area[:, None]

    facing = mean(of_side[:, None] * sides.normal)
    samples = SurfaceSamples(
        points=mean(of_side[:, None] * sides.centre),
        normals=facing / np.linalg.norm(facing, axis=1, keepdims=True),
        area=area,
        irradiance=flux_scale * mean(sides.flux),
    )
    return samples, np.bincount(group, sides.photons).astype(np.int64)


def _free_before(knowledge: LightKnowledge, lattice: Lattice, samples: SurfaceSamples) -> Mask:
    """Tell which samples face nothing within `REACH`."""
    origins = _lifted(samples.points, samples.normals, lattice)
    way = (REACH * lattice.voxel_size * samples.normals).astype(np.float32)
    hits = knowledge.tracer.intersect(origins, way)
    return np.asarray((hits.triangle == MISS) | (hits.distance > 1.0))


def _lifted(points: NDArray[np.floating], normals: NDArray[np.floating], lattice: Lattice) -> Float32:
    """Return points a hair above their surfaces, (n, 3)."""
    return (points + _LIFT * float(lattice.voxel_size.min()) * normals).astype(np.float32)
