# SPDX-License-Identifier: GPL-3.0-or-later
"""Seeing a grid: a slice through it, as look-ups find it."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from .dual_cells import Lattice
from .grid import IrradianceVectorGrid
from .inspection import DIRECTIONS, Surface
from .settings import Spatial

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]

_PER_VOXEL = 4
_SAMPLES = 128
"""Along an edge of a slice, about; in a large grid one a voxel."""


class Quantity(StrEnum):
    """What a slice shows: irradiance towards a direction, its mean over all directions, or the lit share of cells."""

    MEAN = "MEAN"
    PX = "PX"
    NX = "NX"
    PY = "PY"
    NY = "NY"
    PZ = "PZ"
    NZ = "NZ"
    LIT = "LIT"


@dataclass(frozen=True)
class Slice:
    """A slice perpendicular to an axis, sampled in rows.

    Parameters
    ----------
    points : (a, b, 3) float64
        Metres; a along the first of the two other axes, b along the second.
    values : (a, b, 3) float32
        Irradiance of linear RGB in W/m²; of `Quantity.LIT` three times the share.
    known : (a, b) bool
        Where a vertex around takes part in look-ups.
    """

    points: Float64
    values: Float32
    known: NDArray[np.bool_]


def slice_points(lattice: Lattice, axis: int, position: float) -> Float64:
    """Return points (a, b, 3) on a plane: at the vertices' lines, and one to four a voxel.

    Parameters
    ----------
    axis
        That the plane is perpendicular to: 0, 1 or 2.
    position
        From 0, the grid's lower side, to 1, its upper one.
    """
    low, high = np.asarray(lattice.bounds_min), np.asarray(lattice.bounds_max)
    others = [other for other in range(3) if other != axis]
    counts = [min(_PER_VOXEL, max(1, _SAMPLES // n)) * n + 1 for n in lattice.resolution]
    lines = [np.linspace(low[other], high[other], counts[other]) for other in others]
    points = np.empty((len(lines[0]), len(lines[1]), 3))
    points[..., axis] = low[axis] + position * (high[axis] - low[axis])
    points[..., others[0]], points[..., others[1]] = np.meshgrid(*lines, indexing="ij")
    return points


def sample_slice(grid: IrradianceVectorGrid, axis: int, position: float, quantity: Quantity, spatial: Spatial) -> Slice:
    """Return what look-ups find on a plane; see `slice_points`. No normal bias: there is no surface."""
    points = slice_points(grid.lattice, axis, position)
    rows = points.reshape(-1, 3)
    share = _trilinear(grid.validity, grid.lattice, rows)
    known = _trilinear((grid.validity > 0.0).astype(np.float32), grid.lattice, rows) > 0.0
    if quantity == Quantity.LIT:
        values = np.repeat(share[:, None], 3, axis=1).astype(np.float32)
    else:
        wanted = DIRECTIONS if quantity == Quantity.MEAN else (str(quantity),)
        found = [_towards(grid, rows, DIRECTIONS.index(name), spatial) for name in wanted]
        values = np.mean(found, axis=0, dtype=np.float32)
    return Slice(points, values.reshape(points.shape), known.reshape(points.shape[:2]))


def slice_surface(sampled: Slice) -> Surface:
    """Return a slice as a mesh, of the faces at all of whose corners something is known."""
    a, b = sampled.known.shape
    corner = np.arange(a * b).reshape(a, b)
    faces = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], axis=-1).reshape(-1, 4)
    faces = faces[sampled.known.reshape(-1)[faces].all(axis=1)]
    used, places = np.unique(faces, return_inverse=True)
    return Surface(
        positions=sampled.points.reshape(-1, 3)[used].astype(np.float32),
        faces=places.reshape(faces.shape).astype(np.int32),
        values=sampled.values.reshape(-1, 3)[used],
    )


def _towards(grid: IrradianceVectorGrid, points: Float64, direction: int, spatial: Spatial) -> Float32:
    """Return the irradiance (n, 3) of surfaces that face along one of the six directions."""
    normal = np.zeros(3)
    normal[direction // 2] = -1.0 if direction % 2 else 1.0
    return grid.irradiance(points, np.broadcast_to(normal, points.shape), spatial, normal_bias=0.0)


def _trilinear(field: Float32, lattice: Lattice, points: Float64) -> Float64:
    """Return a field of the vertices interpolated at points (n, 3) inside the grid."""
    most = np.asarray(lattice.resolution)
    place = np.clip((points - np.asarray(lattice.bounds_min)) / lattice.voxel_size, 0.0, most)
    cell = np.minimum(place.astype(np.int64), most - 1)
    part = place - cell
    total = np.zeros(len(points))
    for corner in np.ndindex(2, 2, 2):
        weight = np.where(corner, part, 1.0 - part).prod(axis=1)
        total += weight * field[tuple((cell + corner).T)]
    return total
