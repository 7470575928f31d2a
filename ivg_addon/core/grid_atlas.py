# SPDX-License-Identifier: GPL-3.0-or-later
"""A grid as a float image, laid out so that shader nodes can look it up (docs/file-format.md).

Irradiance by least squares is E(n) = ½ (F·n + Σ_kj W_kj(n) D_kj) of twelve numbers per channel (moments.py), where the
six vectors are eighteen. So a vertex has twelve RGB texels, and a thirteenth that tells how much of its cell is lit. A
*plane* holds one of these for all vertices of a slice k of the grid, one texel per vertex, i to the right and j
upwards, with a border of one texel all around that repeats the edge: what a filter reads beyond it is what clamping
would give, and no other plane. The planes of a slice stand side by side; slices follow each other to the right,
`across` of them, then upwards:

    column(i, k, plane) = (P (k mod across) + plane) (Ni + 3) + 1 + i
    row(j, k)           = ⌊k / across⌋ (Nj + 3) + 1 + j           (Ni + 1 vertices and two border texels along x)

P is 13, and more where thin walls divide vertices (partitions.py): a plane for each of the walls that one vertex may
have, with (1 + s) N, and one with their (1 + s) D, so that four numbers hold N, D and s. The last wall of a vertex
repeats where it has fewer than others; one that has none has N = 0 and D = −1, and speaks for all.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .errors import SettingsError
from .grid import IrradianceVectorGrid
from .look_up_rules import FULLY_COUNTED
from .moments import NAMES, moments
from .partitions import Partitions
from .settings import Spatial

Float32 = NDArray[np.float32]

PLANES = (*NAMES, "lit")
"""In the order of the image; red, green and blue of the first twelve are the three channels.

Of ``lit``, red is the validity, green how much a vertex counts in look-ups, from 0 to 1, by which its other planes are
multiplied, blue the same where walls divide it, and 0 where not.
"""
LIT = PLANES.index("lit")
BORDER = 1
LARGEST_SIDE = 16_384
"""Texels: what graphics cards take. Blender scales larger images down, and with them the numbers."""


@dataclass(frozen=True)
class AtlasLayout:
    """Where a grid's texels are.

    Parameters
    ----------
    resolution
        Voxels (Ni, Nj, Nk) of the grid.
    across
        Slices side by side.
    walls
        Most walls that divide one vertex.
    """

    resolution: tuple[int, int, int]
    across: int
    walls: int = 0

    @property
    def planes(self) -> int:
        """Return how many texels a vertex has."""
        return len(PLANES) + (self.walls + 1 if self.walls else 0)

    @property
    def tile(self) -> tuple[int, int]:
        """Return the width and height of a plane with its border, texels."""
        return self.resolution[0] + 1 + 2 * BORDER, self.resolution[1] + 1 + 2 * BORDER

    @property
    def size(self) -> tuple[int, int]:
        """Return the image's width and height, texels."""
        width, height = self.tile
        return width * self.planes * self.across, height * -(-(self.resolution[2] + 1) // self.across)

    def texel(
        self, i: NDArray[np.integer], j: NDArray[np.integer], k: NDArray[np.integer], plane: int
    ) -> tuple[NDArray[np.integer], NDArray[np.integer]]:
        """Return the column and row, from the left and from below, of vertices' texels in a plane."""
        width, height = self.tile
        column = (self.planes * (k % self.across) + plane) * width + BORDER + i
        return column, k // self.across * height + BORDER + j


def most_walls(grid: IrradianceVectorGrid) -> int:
    """Return the most walls that divide one vertex of a grid."""
    return int(np.diff(grid.partitions.start).max())


def layout(resolution: tuple[int, int, int], walls: int = 0) -> AtlasLayout:
    """Return the layout of the image that is nearest to a square.

    Parameters
    ----------
    walls
        Most walls that divide one vertex.

    Raises
    ------
    SettingsError
        There is none that graphics cards take.
    """
    slices = resolution[2] + 1
    ways = (AtlasLayout(resolution, across, walls) for across in range(1, slices + 1))
    best = min(ways, key=lambda way: (max(way.size), math.prod(way.size)))
    if max(best.size) > LARGEST_SIDE:
        raise SettingsError(
            f"a grid of {' × '.join(str(n) for n in resolution)} voxels does not fit into an image of "
            f"{LARGEST_SIDE:,} × {LARGEST_SIDE:,} pixels: bake fewer voxels"
        )
    return best


def image_bytes(resolution: tuple[int, int, int]) -> int:
    """Return what the image takes in memory, as Blender and graphics cards hold it; raises `SettingsError`.

    Walls are known only after the bake, and not counted.
    """
    return math.prod(layout(resolution).size) * 16


def atlas(grid: IrradianceVectorGrid, spatial: Spatial = Spatial.TRILINEAR) -> Float32:
    """Return the image (height, width, 3) of what look-ups interpolate, first row at the bottom.

    Parameters
    ----------
    spatial
        How they do.

    Raises
    ------
    SettingsError
        The grid is too large for an image.
    """
    where = layout(grid.resolution, most_walls(grid))
    planes = _planes(grid.interpolated(spatial), grid, where)
    width, height = where.size
    pixels = np.zeros((height, width, 3), dtype=np.float32)
    across, up = where.tile
    for k in range(planes.shape[0]):
        bordered = np.pad(planes[k], ((0, 0), (BORDER, BORDER), (BORDER, BORDER), (0, 0)), mode="edge")
        row = k // where.across * up
        column = k % where.across * where.planes * across
        block = pixels[row : row + up, column : column + where.planes * across]
        block[:] = bordered.transpose(1, 0, 2, 3).reshape(block.shape)
    return pixels


def _planes(values: Float32, grid: IrradianceVectorGrid, where: AtlasLayout) -> Float32:
    """Return the texels (Nk+1, planes, Nj+1, Ni+1, 3) of a grid.

    Parameters
    ----------
    values : (Ni+1, Nj+1, Nk+1, 6, 3 channel, 3 xyz)
        What is interpolated.
    """
    validity = grid.validity
    slices = validity.shape[2]
    texels = np.empty((slices, where.planes, validity.shape[1], validity.shape[0], 3), dtype=np.float32)
    divided = grid.partitions.divided.reshape(validity.shape)
    for k in range(slices):
        counts = np.minimum(validity[:, :, k] / FULLY_COUNTED, 1.0)
        texels[k, :LIT] = (moments(values[:, :, k]) * counts[..., None, None]).transpose(2, 1, 0, 3)
        texels[k, LIT, ..., 0] = validity[:, :, k].T
        texels[k, LIT, ..., 1] = counts.T
        texels[k, LIT, ..., 2] = (divided[:, :, k] * counts).T
    if where.walls:
        walls = _walls(grid.partitions, where.walls).reshape(*validity.shape, where.walls + 1, 3)
        texels[:, len(PLANES) :] = walls.transpose(2, 3, 1, 0, 4)
    return texels


def _walls(partitions: Partitions, most: int) -> Float32:
    """Return the texels (vertices, most + 1, 3) of the walls of all vertices."""
    start, count = partitions.start[:-1], np.diff(partitions.start)
    texels = np.zeros((len(start), most + 1, 3), dtype=np.float32)
    texels[:, most] = -1.0
    some = np.flatnonzero(count)
    for wall in range(most):
        plane = partitions.planes[start[some] + np.minimum(wall, count[some] - 1)]
        size = 1.0 + plane[:, 4:]
        texels[some, wall] = size * plane[:, :3]
        texels[some, most, wall] = size[:, 0] * plane[:, 3]
    return texels
