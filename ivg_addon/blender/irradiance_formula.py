# SPDX-License-Identifier: GPL-3.0-or-later
"""The look-up of a stored grid, as the nodes of a group: the formulas of `core/look_up.py`, vertex by vertex.

Image Texture nodes read single texels (*Closest*). *Linear* ones could read two neighbours at once, with any weights
W₀ and W₁, at the share W₁ / (W₀ + W₁) of the way between them; but EEVEE then reads smaller versions of the image
wherever texture coordinates jump between pixels, as they do from voxel to voxel.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import bpy

from ..core.dual_cells import Lattice
from ..core.grid import BEHIND, DEFAULT_NORMAL_BIAS
from ..core.grid_atlas import BORDER, LIT, PLANES, AtlasLayout
from ..core.moments import NAMES
from .node_maths import BLACK, Colour, NodeMaths, Number, Socket
from .reconstruction_nodes import coefficients

Corner = tuple[int, int, int]
"""Of a voxel: 0 or 1 along each axis."""


@dataclass(frozen=True)
class Reading:
    """Where the nodes find a grid's texels.

    Parameters
    ----------
    image
        The grid's.
    lattice
        Where its vertices are.
    across
        Slices side by side in the image.
    """

    image: bpy.types.Image
    lattice: Lattice
    across: int

    @property
    def texel(self) -> tuple[float, float]:
        """Return the size of a texel in texture coordinates."""
        width, height = AtlasLayout(self.lattice.resolution, self.across).size
        return 1.0 / width, 1.0 / height

    @property
    def tile(self) -> tuple[float, float]:
        """Return the size of a plane in texture coordinates."""
        width, height = AtlasLayout(self.lattice.resolution, self.across).tile
        return width * self.texel[0], height * self.texel[1]

    def plane(self, place: Socket, plane: int, maths: NodeMaths) -> Socket:
        """Add a look-up in a plane, `place` being the texture coordinates in the first; return the colour."""
        at = maths.vector("ADD", place, (plane * self.tile[0], 0.0, 0.0)) if plane else place
        settings = {"image": self.image, "interpolation": "Closest", "extension": "EXTEND"}
        return maths.node("ShaderNodeTexImage", {"Vector": at}, **settings).outputs["Color"]


@dataclass(frozen=True)
class Stencil:
    """The eight vertices around a place.

    Parameters
    ----------
    base
        Vector: the lower vertex, counted along the axes.
    fraction
        Vector: how far the place is above it, voxels.
    slices
        Of the lower and the upper slice, vectors: the texture coordinates of the lower vertex in the first plane.
    """

    base: Socket
    fraction: Socket
    slices: tuple[Socket, Socket]

    def texel(self, maths: NodeMaths, reading: Reading, corner: Corner) -> Socket:
        """Return the texture coordinates in the first plane of one of the eight."""
        width, height = reading.texel
        i, j, k = corner
        return maths.vector("ADD", self.slices[k], (i * width, j * height, 0.0)) if i or j else self.slices[k]


def fill_vertex(group: bpy.types.ShaderNodeTree, reading: Reading) -> None:
    """Make a group the reading of one vertex: it adds its weighted light, and its weight if it takes part.

    Its inputs are the sums so far, `Light` and `Lit`, the texture coordinates `Place` in the first plane, how many
    voxels `Ahead` of the surface the vertex lies, the interpolation's `Weight`, the exponent `Proximity`, and the
    coefficients.
    """
    maths = NodeMaths(group)
    numbers = dict.fromkeys(("Lit", "Ahead", "Proximity", "Weight", *NAMES), "Float")
    into = maths.inputs({"Light": "Color", "Place": "Vector"} | numbers)
    ahead = maths.node("ShaderNodeMath", {0: into["Ahead"], 1: 0.5, 2: 0.5}, operation="MULTIPLY_ADD", use_clamp=True)
    lean = maths.math("POWER", maths.math("ADD", ahead.outputs[0], BEHIND), into["Proximity"])
    weight = maths.math("MULTIPLY", lean, into["Weight"])
    # Always 1. Without it Cycles 5.0 would read the texels of all vertices first, and run out of places for them.
    turn = maths.math("GREATER_THAN", into["Lit"], -1.0)
    place = maths.scaled(into["Place"], turn)
    lit = maths.channel(reading.plane(place, LIT, maths), 1)
    light: Colour = BLACK
    for plane, name in enumerate(NAMES):
        light = maths.added(light, into[name], reading.plane(place, plane, maths))
    maths.outputs(
        {
            "Light": ("Color", maths.added(into["Light"], weight, light)),
            "Lit": ("Float", maths.math("MULTIPLY_ADD", lit, weight, into["Lit"])),
        }
    )


def fill(group: bpy.types.ShaderNodeTree, vertex: bpy.types.ShaderNodeTree, reading: Reading) -> None:
    """Make a group the look-up; `vertex` is that of `fill_vertex`."""
    maths = NodeMaths(group)
    given = maths.inputs({"Normal": "Vector"})["Normal"]
    geometry = maths.node("ShaderNodeNewGeometry", {})
    surface = geometry.outputs["Normal"]
    absent = maths.math("LESS_THAN", maths.length(given), 1e-6)
    normal = maths.vector("NORMALIZE", maths.vector("ADD", given, maths.scaled(surface, absent)))
    c: dict[int | str, Number] = dict(zip(NAMES, coefficients(maths, normal), strict=True))

    place = _place(maths, reading, geometry.outputs["Position"])
    unlit = _unlit(maths, reading, _stencil(maths, reading, place))
    off = maths.scaled(surface, maths.math("MULTIPLY", unlit, DEFAULT_NORMAL_BIAS))
    around = _stencil(maths, reading, _within(maths, reading, maths.vector("ADD", place, off)))
    proximity = maths.math("MINIMUM", maths.math("MULTIPLY", unlit, 2.0), 1.0)
    lowest = maths.math("MULTIPLY", maths.dot(around.fraction, surface), -1.0)
    step = maths.separated(surface)
    light: Colour = BLACK
    lit: Number = 0.0
    for corner, weight in _weights(maths, around.fraction):
        ahead = lowest
        for axis in range(3):
            ahead = maths.math("ADD", ahead, step[axis]) if corner[axis] else ahead
        found = maths.node(
            "ShaderNodeGroup",
            {
                "Light": light,
                "Lit": lit,
                "Place": around.texel(maths, reading, corner),
                "Ahead": ahead,
                "Proximity": proximity,
                "Weight": weight,
                **c,
            },
            node_tree=vertex,
        )
        light, lit = found.outputs["Light"], found.outputs["Lit"]
    mean = maths.scaled(light, maths.math("DIVIDE", 1.0, lit))
    # A reconstruction can undershoot; light cannot.
    maths.outputs({"Irradiance": ("Color", maths.vector("MAXIMUM", mean, (0.0, 0.0, 0.0)))})


def _place(maths: NodeMaths, reading: Reading, position: Socket) -> Socket:
    """Return where a position is in voxels from the lower corner; outside the box the nearest place in it."""
    above = maths.vector("SUBTRACT", position, reading.lattice.bounds_min)
    voxels = maths.vector("DIVIDE", above, tuple(float(h) for h in reading.lattice.voxel_size))
    return _within(maths, reading, voxels)


def _within(maths: NodeMaths, reading: Reading, place: Socket) -> Socket:
    """Return the place in the box that is nearest to a place, both in voxels."""
    last = tuple(float(n) for n in reading.lattice.resolution)
    return maths.vector("MINIMUM", maths.vector("MAXIMUM", place, (0.0, 0.0, 0.0)), last)


def _stencil(maths: NodeMaths, reading: Reading, place: Socket) -> Stencil:
    """Return the vertices around a place in voxels."""
    last = tuple(float(n - 1) for n in reading.lattice.resolution)
    base = maths.vector("MINIMUM", maths.vector("FLOOR", place), last)
    width, height = reading.texel
    middle = BORDER + 0.5
    corner = maths.vector("MULTIPLY_ADD", base, (width, height, 0.0), (middle * width, middle * height, 0.0))
    k = maths.separated(base)[2]
    slices = (k, maths.math("ADD", k, 1.0))
    low, high = (maths.vector("ADD", corner, _slice(maths, reading, one)) for one in slices)
    return Stencil(base, maths.vector("SUBTRACT", place, base), (low, high))


def _slice(maths: NodeMaths, reading: Reading, k: Socket) -> Socket:
    """Return how far a slice's first plane is from that of slice 0, in texture coordinates."""
    across = float(reading.across)
    row = maths.math("FLOOR", maths.math("MULTIPLY_ADD", k, 1.0 / across, 0.5 / across))
    column = maths.math("MULTIPLY_ADD", row, -across, k)
    width, height = reading.tile
    return maths.vector("MULTIPLY", maths.combined(column, row, 0.0), (len(PLANES) * width, height, 0.0))


def _weights(maths: NodeMaths, fraction: Socket) -> list[tuple[Corner, Socket]]:
    """Return the corners of the voxel with their trilinear weights."""
    lower = maths.separated(maths.vector("SUBTRACT", (1.0,) * 3, fraction))
    upper = maths.separated(fraction)
    along = list(zip(lower, upper, strict=True))
    row = {(j, k): maths.math("MULTIPLY", along[1][j], along[2][k]) for j, k in product(range(2), repeat=2)}
    return [((i, j, k), maths.math("MULTIPLY", along[0][i], row[j, k])) for i, j, k in product(range(2), repeat=3)]


def _unlit(maths: NodeMaths, reading: Reading, around: Stencil) -> Socket:
    """Return the unlit share of the cells around a place."""
    lit: Colour = BLACK
    for corner, weight in _weights(maths, around.fraction):
        texel = reading.plane(around.texel(maths, reading, corner), LIT, maths)
        lit = maths.added(lit, weight, texel)
    return maths.math("MAXIMUM", maths.math("SUBTRACT", 1.0, maths.channel(lit, 0)), 0.0)
