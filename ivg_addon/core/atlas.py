# SPDX-License-Identifier: GPL-3.0-or-later
"""An atlas in which every triangle has texels of its own.

Each triangle has a block of b × b texels; its corners are the block's lower left, lower right and upper left corners.
So it covers the centres of the texels (i, j) with i + j < b: b (b + 1)/2 of them. Blocks of one size stand in rows of
their own. Looked up at the nearest texel, no neighbour's colour ever shows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .scene import Float32, Int32

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

WIDTH = 4096
"""Most texels of a row."""
LARGEST_BLOCK = 512
_INSET = 1e-3
"""Texels by which a triangle that is looked up stays within its block, whatever is rounded."""
_OVER_CENTRES = 0.01
"""Texels by which a triangle that is drawn reaches beyond the centres on its long side."""
_MIDDLE = 0.5
"""The same for a block of one texel: then the texel's centre is the triangle's."""


@dataclass(frozen=True)
class Atlas:
    """Blocks of n triangles.

    Parameters
    ----------
    width, height
        Texels.
    size : (n,) int32
        Edge b of each triangle's block.
    column, row : (n,) int32
        Its lower left texel.
    """

    width: int
    height: int
    size: Int32
    column: Int32
    row: Int32

    def looked_up(self) -> Float32:
        """Return the texture coordinates (n, 3, 2) of the corners, as photons look them up."""
        return self._corners(_INSET, self.size - 2.0 * _INSET)

    def drawn(self) -> Float32:
        """Return the texture coordinates (n, 3, 2) of the corners with which all their texels are covered."""
        beyond = np.where(self.size == 1, _MIDDLE, _OVER_CENTRES).astype(np.float64)
        return self._corners(0.0, self.size + beyond)

    def _corners(self, inset: float, leg: NDArray[Any]) -> Float32:
        corners = np.empty((len(self.size), 3, 2))
        corners[:, :, 0] = (self.column + inset)[:, None]
        corners[:, :, 1] = (self.row + inset)[:, None]
        corners[:, 1, 0] += leg
        corners[:, 2, 1] += leg
        return (corners / (self.width, self.height)).astype(np.float32)

    def texels(self) -> tuple[Int64, Int64]:
        """Return the covered texels' indices in rows from below, and of which triangle each is: (k,), (k,)."""
        texels, owners = [], []
        for b in np.unique(self.size):
            members = np.flatnonzero(self.size == b)
            j, i = np.divmod(np.arange(b * b, dtype=np.int64), b)
            i, j = i[i + j < b], j[i + j < b]
            first = self.row[members].astype(np.int64) * self.width + self.column[members]
            texels.append((first[:, None] + j * self.width + i).reshape(-1))
            owners.append(np.repeat(members, len(i)))
        return np.concatenate(texels), np.concatenate(owners)

    def image(self, texels: Int64, values: Float64) -> Float32:
        """Return an image (height, width, 3) that has values (k, 3) at texels (k,).

        A look-up on a triangle's long side may, by rounding, meet the texel beyond it: that one is given the value of
        the texel across.
        """
        pixels = np.zeros((self.height * self.width, 3), dtype=np.float32)
        pixels[texels] = values
        for b in np.unique(self.size[self.size > 1]):
            members = np.flatnonzero(self.size == b)
            first = self.row[members].astype(np.int64) * self.width + self.column[members]
            i = np.arange(1, b, dtype=np.int64)
            j = b - i
            beyond, across = j * self.width + i, (j - 1) * self.width + i
            pixels[(first[:, None] + beyond).reshape(-1)] = pixels[(first[:, None] + across).reshape(-1)]
        return pixels.reshape(self.height, self.width, 3)


def lay_out(sizes: NDArray[np.integer]) -> Atlas:
    """Place blocks of the given sizes (n,), at least 1."""
    size: Int32 = np.minimum(sizes, LARGEST_BLOCK).astype(np.int32)
    area = int((size.astype(np.int64) ** 2).sum())
    largest = int(size.max())
    width = int(min(WIDTH, max(largest, np.ceil(np.sqrt(area)))))
    column, row = np.empty_like(size), np.empty_like(size)
    height = 0
    for b in np.unique(size):
        members = np.flatnonzero(size == b)
        across = width // int(b)
        place = np.arange(len(members))
        column[members] = (place % across) * b
        row[members] = height + (place // across) * b
        height += -(-len(members) // across) * int(b)
    return Atlas(width, height, size, column, row)
