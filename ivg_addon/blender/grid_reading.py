# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a grid's texels are in its image (core/grid_atlas.py), as nodes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import bpy

from ..core.dual_cells import Lattice
from ..core.grid import DEFAULT_NORMAL_BIAS
from ..core.grid_atlas import BORDER, LIT, AtlasLayout
from .node_formulas import Socket
from .shader_maths import BLACK, Colour, ShaderMaths

Corner = tuple[int, int, int]
"""Of a voxel: 0 or 1 along each axis."""
CORNERS: tuple[Corner, ...] = tuple((i, j, k) for i, j, k in product(range(2), repeat=3))


@dataclass(frozen=True)
class Reading:
    """How nodes find a grid's texels.

    Parameters
    ----------
    image
        The grid's.
    lattice
        Where its vertices are.
    layout
        Where their texels are.
    """

    image: bpy.types.Image
    lattice: Lattice
    layout: AtlasLayout

    @property
    def texel(self) -> tuple[float, float]:
        """Return the size of a texel in texture coordinates."""
        width, height = self.layout.size
        return 1.0 / width, 1.0 / height

    @property
    def tile(self) -> tuple[float, float]:
        """Return the size of a plane in texture coordinates."""
        width, height = self.layout.tile
        return width * self.texel[0], height * self.texel[1]

    def plane(self, maths: ShaderMaths, place: Socket, plane: int, interpolation: str = "Closest") -> Socket:
        """Read a plane where `place` are the texture coordinates in the first; return the colour."""
        at = maths.vector("ADD", place, (plane * self.tile[0], 0.0, 0.0)) if plane else place
        settings = {"image": self.image, "interpolation": interpolation, "extension": "EXTEND"}
        return maths.node("ShaderNodeTexImage", {"Vector": at}, **settings).outputs["Color"]

    def place(self, maths: ShaderMaths, position: Socket) -> Socket:
        """Return where a position is in voxels from the lower corner; outside the box the nearest place in it."""
        above = maths.vector("SUBTRACT", position, self.lattice.bounds_min)
        return self.within(maths, maths.vector("DIVIDE", above, tuple(float(h) for h in self.lattice.voxel_size)))

    def within(self, maths: ShaderMaths, place: Socket) -> Socket:
        """Return the place in the box that is nearest to a place, both in voxels."""
        last = tuple(float(n) for n in self.lattice.resolution)
        return maths.vector("MINIMUM", maths.vector("MAXIMUM", place, (0.0,) * 3), last)

    def voxel(self, maths: ShaderMaths, place: Socket) -> Socket:
        """Return the lower vertex of the voxel that a place is in, counted along the axes."""
        last = tuple(float(n - 1) for n in self.lattice.resolution)
        return maths.vector("MINIMUM", maths.vector("FLOOR", place), last)

    def corners(self, maths: ShaderMaths, voxel: Socket) -> dict[Corner, Socket]:
        """Return the texture coordinates of a voxel's vertices in the first plane."""
        width, height = self.texel
        lowest, k = self.in_plane(maths, voxel), maths.separated(voxel)[2]
        slices = [self.in_slice(maths, lowest, one) for one in (k, maths.math("ADD", k, 1.0))]
        return {
            (i, j, k): maths.vector("ADD", slices[k], (i * width, j * height, 0.0)) if i or j else slices[k]
            for i, j, k in CORNERS
        }

    def in_plane(self, maths: ShaderMaths, place: Socket) -> Socket:
        """Return the texture coordinates of a place, whatever its height, in the first plane of slice 0."""
        width, height = self.texel
        middle = BORDER + 0.5
        return maths.vector("MULTIPLY_ADD", place, (width, height, 0.0), (middle * width, middle * height, 0.0))

    def in_slice(self, maths: ShaderMaths, at: Socket, k: Socket) -> Socket:
        """Return the texture coordinates in slice k of what is `at` some in slice 0."""
        return maths.vector("ADD", at, self._slice(maths, k))

    def _slice(self, maths: ShaderMaths, k: Socket) -> Socket:
        """Return how far a slice's first plane is from that of slice 0, in texture coordinates."""
        across = float(self.layout.across)
        row = maths.math("FLOOR", maths.math("MULTIPLY_ADD", k, 1.0 / across, 0.5 / across))
        column = maths.math("MULTIPLY_ADD", row, -across, k)
        width, height = self.tile
        return maths.vector("MULTIPLY", maths.combined(column, row, 0.0), (self.layout.planes * width, height, 0.0))


def weights(maths: ShaderMaths, fraction: Socket) -> dict[Corner, Socket]:
    """Return the trilinear weights of a voxel's corners for a place that is `fraction` above the lowest."""
    lower = maths.separated(maths.vector("SUBTRACT", (1.0,) * 3, fraction))
    along = list(zip(lower, maths.separated(fraction), strict=True))
    rows = {(j, k): maths.math("MULTIPLY", along[1][j], along[2][k]) for j, k in product(range(2), repeat=2)}
    return {(i, j, k): maths.math("MULTIPLY", along[0][i], rows[j, k]) for i, j, k in CORNERS}


def lit_by_vertices(maths: ShaderMaths, reading: Reading, place: Socket, voxel: Socket) -> Socket:
    """Return the interpolated texel of what is lit around a place in a voxel, as a colour."""
    texels = reading.corners(maths, voxel)
    lit: Colour = BLACK
    for corner, weight in weights(maths, maths.vector("SUBTRACT", place, voxel)).items():
        lit = maths.added(lit, weight, reading.plane(maths, texels[corner], LIT))
    assert isinstance(lit, Socket)
    return lit


def bias(maths: ShaderMaths, lit: Socket, surface: Socket) -> Socket:
    """Return how far the normal bias moves a look-up, by what is lit around and by the surface's own normal."""
    unlit = maths.math("MAXIMUM", maths.math("SUBTRACT", 1.0, maths.channel(lit, 0)), 0.0)
    return maths.scaled(surface, maths.math("MULTIPLY", unlit, DEFAULT_NORMAL_BIAS))
