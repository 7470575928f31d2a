# SPDX-License-Identifier: GPL-3.0-or-later
"""Seeing a grid: spheres and arrows at its vertices, as geometry with light on it.

A sphere is coloured by the irradiance of every direction of its surface [IV figs. 6 to 8, 12]; an arrow is one of the
vectors. What they show is what look-ups interpolate (prefilter.py), trilinear, so that at a vertex in the open a
sphere's colours are those that a look-up finds there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from .false_color import luminance
from .grid import IrradianceVectorGrid
from .moments import moments
from .reconstruction import coefficients
from .settings import Directional, Spatial
from .spheres import icosphere

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]
Int32 = NDArray[np.int32]

MIDDLE = 0.25
"""Brightness at which a grid's mean irradiance is shown, of the display's white."""

_LONG = 95.0
"""Percentile of the vectors' lengths whose arrows are as long as vertices are apart."""
_SIDES = 8
_SHAFT_RADIUS, _HEAD_RADIUS, _HEAD_START = 0.045, 0.13, 0.65
"""Of an arrow of length 1."""
_FEW_SPHERES = 300
"""Up to so many, spheres are made of four times as many triangles."""


class Vectors(StrEnum):
    """Which vectors arrows show: I_δ of one direction δ, or F = I_{+k} + I_{−k}."""

    FLUX = "FLUX"
    PX = "PX"
    NX = "NX"
    PY = "PY"
    NY = "NY"
    PZ = "PZ"
    NZ = "NZ"


DIRECTIONS = tuple(str(one) for one in Vectors if one is not Vectors.FLUX)
"""In the order of `IrradianceVectorGrid.vectors`."""


@dataclass(frozen=True)
class Vertices:
    """The vertices of a grid that are shown.

    Parameters
    ----------
    index : (n,) int64
        In the order of the grid's arrays.
    positions : (n, 3) float32
    validity : (n,) float32
        Lit shares of their cells; 0 where look-ups leave the vertex out.
    spacing
        Least distance between neighbours, metres.
    stride
        Every so-manieth along each axis is shown.
    """

    index: NDArray[np.int64]
    positions: Float32
    validity: Float32
    spacing: float
    stride: int

    @property
    def lit(self) -> Vertices:
        """Return those that take part in look-ups."""
        kept = self.validity > 0.0
        return Vertices(self.index[kept], self.positions[kept], self.validity[kept], self.spacing, self.stride)


@dataclass(frozen=True)
class Surface:
    """A mesh with light on it.

    Parameters
    ----------
    positions : (n, 3) float32
        Metres, world space.
    faces : (f, 3) or (f, 4) int32
        Vertices, counter-clockwise from outside.
    values : (n, 3) float32
        Linear RGB in W/m², unless told otherwise.
    """

    positions: Float32
    faces: Int32
    values: Float32


def stride(shape: tuple[int, int, int], every: int, most: int) -> int:
    """Return the least stride from `every` on that leaves at most `most` vertices of a grid of this shape."""
    step = max(1, every)
    while math.prod(-(-count // step) for count in shape) > most:
        step += 1
    return step


def choose_vertices(grid: IrradianceVectorGrid, every: int, most: int) -> Vertices:
    """Return every so-manieth vertex of a grid along each axis, or fewer where that were more than `most`.

    What is left over at the end of an axis is shared by both sides.
    """
    lattice = grid.lattice
    step = stride(lattice.shape, every, most)
    axes = [np.arange((count - 1) % step // 2, count, step) for count in lattice.shape]
    index = np.ravel_multi_index(np.ix_(*axes), lattice.shape).reshape(-1)
    places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    positions = np.asarray(lattice.bounds_min) + places * lattice.voxel_size
    return Vertices(
        index=index,
        positions=positions.astype(np.float32),
        validity=grid.validity.reshape(-1)[index],
        spacing=step * float(lattice.voxel_size.min()),
        stride=step,
    )


def mean_irradiance(grid: IrradianceVectorGrid) -> float:
    """Return the mean luminance of irradiance, over the six axis directions and all lit vertices, W/m²; 0 if none."""
    lit = grid.validity > 0.0
    if not lit.any():
        return 0.0
    own = [grid.vectors[..., 2 * axis, :, axis] - grid.vectors[..., 2 * axis + 1, :, axis] for axis in range(3)]
    return float(np.mean([luminance(part[lit].mean(axis=0, dtype=np.float64)) for part in own]) / 2.0)


def gain(mean: float, exposure: float) -> float:
    """Return the brightness of 1 W/m²: the mean irradiance comes to `MIDDLE`, times two for each stop of exposure."""
    return math.exp2(exposure) * (MIDDLE / mean if mean > 0.0 else 1.0)


def shown_vectors(grid: IrradianceVectorGrid, vertices: Vertices) -> Float32:
    """Return the six vectors of each channel that look-ups interpolate, (n, 6, 3 channel, 3 xyz)."""
    return grid.interpolated(Spatial.TRILINEAR).reshape(-1, 6, 3, 3)[vertices.index]


def sphere_irradiance(vectors: Float32, normals: Float64) -> Float32:
    """Return E(n) of vertices' own vectors by least squares, for all of some normals.

    Parameters
    ----------
    vectors : (n, 6, 3 channel, 3 xyz)
    normals : (m, 3)
        Of length one.

    Returns
    -------
    (n, m, 3) float32
        W/m², not negative.
    """
    weights = np.stack([coefficients(normal, Directional.LEAST_SQUARES).reshape(18) for normal in normals])
    rows = vectors.transpose(0, 2, 1, 3).reshape(-1, 18)
    found = (rows @ weights.T.astype(np.float32)).reshape(-1, 3, len(normals))
    return np.ascontiguousarray(np.maximum(found, 0.0).transpose(0, 2, 1), dtype=np.float32)


def spheres(grid: IrradianceVectorGrid, vertices: Vertices, size: float) -> Surface:
    """Return spheres of irradiance.

    Parameters
    ----------
    size
        Their diameter in distances between shown vertices.
    """
    directions, triangles = icosphere(3 if len(vertices.index) <= _FEW_SPHERES else 2)
    radius = 0.5 * size * vertices.spacing
    positions = vertices.positions[:, None] + (radius * directions).astype(np.float32)
    return _copies(triangles, positions, sphere_irradiance(shown_vectors(grid, vertices), directions))


def arrow_vectors(grid: IrradianceVectorGrid, vertices: Vertices, which: Vectors) -> tuple[Float32, Float32]:
    """Return what arrows show, and its colour.

    Returns
    -------
    (n, 3) float32
        The channels' vectors weighted as in luminance, W/m². It points to where the light comes from.
    (n, 3) float32
        The lengths of red's, green's and blue's vector, W/m².
    """
    six = shown_vectors(grid, vertices)
    of_channels = moments(six)[:, :3].swapaxes(1, 2) if which == Vectors.FLUX else six[:, DIRECTIONS.index(which)]
    pointing = luminance(of_channels.swapaxes(1, 2)).astype(np.float32)
    return pointing, np.linalg.norm(of_channels, axis=2).astype(np.float32)


def arrow_scale(pointing: Float32) -> float:
    """Return the length of an arrow of 1 W/m² in distances between shown vertices; 0 where nothing is to be shown."""
    lengths = np.linalg.norm(pointing, axis=1)
    lengths = lengths[lengths > 0.0]
    return 1.0 / float(np.percentile(lengths, _LONG)) if len(lengths) else 0.0


def arrows(grid: IrradianceVectorGrid, vertices: Vertices, which: Vectors, size: float) -> Surface:
    """Return arrows that start at the vertices, as long as their vectors are.

    Parameters
    ----------
    size
        Length of a long one (only one in twenty is longer) in distances between shown vertices.
    """
    pointing, colors = arrow_vectors(grid, vertices, which)
    some = pointing.any(axis=1)
    pointing, colors, tails = pointing[some], colors[some], vertices.positions[some]
    shape, triangles = unit_arrow()
    frames = _frames(pointing.astype(np.float64)) * (size * vertices.spacing * arrow_scale(pointing))
    positions = tails[:, None] + np.einsum("vk,nkx->nvx", shape, frames).astype(np.float32)
    return _copies(triangles, positions, np.broadcast_to(colors[:, None], positions.shape))


def unit_arrow() -> tuple[Float64, Int32]:
    """Return the vertices (v, 3) and triangles of an arrow from the origin to (0, 0, 1)."""
    turn = 2.0 * math.pi * np.arange(_SIDES) / _SIDES
    circle = np.stack([np.cos(turn), np.sin(turn), np.zeros(_SIDES)], axis=-1)
    up = np.array([0.0, 0.0, 1.0])
    rings = [
        _SHAFT_RADIUS * circle,
        _SHAFT_RADIUS * circle + _HEAD_START * up,
        _HEAD_RADIUS * circle + _HEAD_START * up,
    ]
    tip, end = len(rings) * _SIDES, len(rings) * _SIDES + 1
    here = np.arange(_SIDES)
    after = (here + 1) % _SIDES
    triangles = [np.stack([after, here, np.full(_SIDES, end)], axis=-1)]
    for low in range(len(rings) - 1):
        a, b = low * _SIDES + here, low * _SIDES + after
        triangles += [np.stack([a, b, b + _SIDES], axis=-1), np.stack([a, b + _SIDES, a + _SIDES], axis=-1)]
    last = tip - _SIDES
    triangles.append(np.stack([last + here, last + after, np.full(_SIDES, tip)], axis=-1))
    return np.concatenate([*rings, up[None], np.zeros((1, 3))]), np.concatenate(triangles).astype(np.int32)


def _frames(vectors: Float64) -> Float64:
    """Return for each vector (n, 3) two perpendicular ones of its length, and itself, (n, 3, 3)."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    # The axis that a vector is farthest from gives perpendiculars that never vanish.
    aside = np.cross(np.eye(3)[np.abs(vectors).argmin(axis=1)], vectors)
    aside *= length / np.linalg.norm(aside, axis=1, keepdims=True)
    return np.stack([aside, np.cross(vectors, aside) / length, vectors], axis=1)


def _copies(triangles: NDArray[np.integer], positions: Float32, values: Float32) -> Surface:
    """Return n copies of a mesh of v vertices as one: triangles (t, 3) of each; positions and values (n, v, 3)."""
    copies, size, _ = positions.shape
    return Surface(
        positions=positions.reshape(-1, 3),
        faces=(size * np.arange(copies)[:, None, None] + triangles).reshape(-1, 3).astype(np.int32),
        values=np.ascontiguousarray(values, dtype=np.float32).reshape(-1, 3),
    )
