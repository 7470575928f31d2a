# SPDX-License-Identifier: GPL-3.0-or-later
"""The look-up of a stored grid, as the nodes of a group.

Weights differ from vertex to vertex near surfaces (`core/look_up.py`, `lean`), so single vertices would have to be
read, were it not that two neighbours along x can be read at once: linear filtering at t = W₁ / (W₀ + W₁) of the way
from the one to the other gives (W₀ T₀ + W₁ T₁) / (W₀ + W₁), whatever the two weights. Vertices that take no part are
black, so that they add nothing to the light; how much of the weight the others have is read in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import bpy

from ..core.dual_cells import Lattice
from ..core.grid import DEFAULT_NORMAL_BIAS
from ..core.grid_atlas import BORDER, LIT, PLANES, AtlasLayout
from ..core.look_up import BEHIND
from ..core.moments import NAMES
from .node_maths import NodeMaths, Number, Socket
from .reconstruction_nodes import coefficients


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
        settings = {"image": self.image, "interpolation": "Linear", "extension": "EXTEND"}
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


def fill_pair(group: bpy.types.ShaderNodeTree, reading: Reading) -> None:
    """Make a group the look-up of two vertices that are neighbours along x.

    The components of its vectors `Ahead` and `Weights` are the second vertex's, the first one's and 0. It returns the
    sum of the two vertices' weights, of their weighted light, and of the weights of those that take part.
    """
    maths = NodeMaths(group)
    into = maths.inputs(dict.fromkeys(("Place", "Ahead", "Proximity", "Weights", *NAMES), "Vector"))
    lean = maths.node(
        "ShaderNodeMapRange",
        {6: into["Ahead"], 7: (-1.0,) * 3, 8: (1.0,) * 3, 9: (BEHIND,) * 3, 10: (1.0 + BEHIND,) * 3},
        data_type="FLOAT_VECTOR",
        clamp=True,
    ).outputs["Vector"]
    weights = maths.vector("MULTIPLY", maths.vector("POWER", lean, into["Proximity"]), into["Weights"])
    total = maths.dot(weights, (1.0, 1.0, 0.0))
    texels_per_weight = maths.combined(maths.math("DIVIDE", reading.texel[0], total), 0.0, 0.0)
    place = maths.vector("MULTIPLY_ADD", weights, texels_per_weight, into["Place"])
    light: Socket | tuple[float, ...] = (0.0, 0.0, 0.0)
    for plane, name in enumerate(NAMES):
        light = maths.vector("MULTIPLY_ADD", reading.plane(place, plane, maths), into[name], light)
    lit = maths.dot(reading.plane(place, LIT, maths), (0.0, 1.0, 0.0))
    maths.outputs(
        {"Light": ("Vector", maths.scaled(light, total)), "Lit": ("Float", maths.math("MULTIPLY", lit, total))}
    )


def fill(group: bpy.types.ShaderNodeTree, pair: bpy.types.ShaderNodeTree, reading: Reading) -> None:
    """Make a group the look-up; `pair` is that of `fill_pair`."""
    maths = NodeMaths(group)
    given = maths.inputs({"Normal": "Vector"})["Normal"]
    geometry = maths.node("ShaderNodeNewGeometry", {})
    surface = geometry.outputs["Normal"]
    absent = maths.math("LESS_THAN", maths.length(given), 1e-6)
    normal = maths.vector("NORMALIZE", maths.vector("ADD", given, maths.scaled(surface, absent)))
    c = dict(zip(NAMES, coefficients(maths, normal), strict=True))

    place = _place(maths, reading, geometry.outputs["Position"])
    unlit = _unlit(maths, reading, _stencil(maths, reading, place))
    moved = maths.vector("ADD", place, maths.scaled(surface, maths.math("MULTIPLY", unlit, DEFAULT_NORMAL_BIAS)))
    moved = _within(maths, reading, moved)
    around = _stencil(maths, reading, moved)
    proximity = maths.math("MINIMUM", maths.math("MULTIPLY", unlit, 2.0), 1.0)
    powers = maths.combined(proximity, proximity, proximity)
    behind = maths.math("MULTIPLY", maths.dot(around.fraction, surface), -1.0)
    step = maths.separated(surface)
    first = maths.combined(maths.math("ADD", behind, step[0]), behind, 0.0)
    weights = _linear(maths, around.fraction)
    along = maths.combined(weights[0][1], weights[0][0], 0.0)
    light: Socket | tuple[float, ...] = (0.0, 0.0, 0.0)
    lit: Number = 0.0
    for b, s in product(range(2), repeat=2):
        ahead = first
        for far, axis in ((b, 1), (s, 2)):
            if far:
                ahead = maths.vector("ADD", ahead, maths.combined(step[axis], step[axis], 0.0))
        found = maths.node(
            "ShaderNodeGroup",
            {
                "Place": maths.vector("ADD", around.slices[s], (0.0, b * reading.texel[1], 0.0)),
                "Ahead": ahead,
                "Proximity": powers,
                "Weights": maths.scaled(along, maths.math("MULTIPLY", weights[1][b], weights[2][s])),
                **c,
            },
            node_tree=pair,
        )
        light = maths.vector("ADD", light, found.outputs["Light"])
        lit = maths.math("ADD", lit, found.outputs["Lit"])
    mean = maths.vector("DIVIDE", light, maths.combined(lit, lit, lit))
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


def _linear(maths: NodeMaths, fraction: Socket) -> list[tuple[Socket, Socket]]:
    """Return the weights of the lower and the upper vertices along each axis."""
    lower = maths.vector("SUBTRACT", (1.0,) * 3, fraction)
    return list(zip(maths.separated(lower), maths.separated(fraction), strict=True))


def _unlit(maths: NodeMaths, reading: Reading, around: Stencil) -> Socket:
    """Return the unlit share of the cells around a place."""
    width, height = reading.texel
    inside = maths.vector("MULTIPLY", around.fraction, (width, height, 0.0))
    low, high = (reading.plane(maths.vector("ADD", one, inside), LIT, maths) for one in around.slices)
    rise = maths.scaled(maths.vector("SUBTRACT", high, low), maths.separated(around.fraction)[2])
    lit = maths.dot(maths.vector("ADD", low, rise), (1.0, 0.0, 0.0))
    return maths.math("MAXIMUM", maths.math("SUBTRACT", 1.0, lit), 0.0)
