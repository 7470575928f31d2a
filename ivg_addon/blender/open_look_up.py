# SPDX-License-Identifier: GPL-3.0-or-later
"""Looking a stored grid up where no wall is near, as nodes: textures' own filters interpolate within a slice.

In the open a vertex counts by its weight alone, a product of one for each axis. Within a slice that is the filter of an
Image Texture node, bilinear (*Linear*) or of cubic B-splines (*Cubic*): the light of vertices that take no part is
black in the image, and the share of those that do is divided by. So a plane is read twice where its vertices are 8, and
four times where they are 64.

EEVEE reads smaller versions of an image by *Linear* where texture coordinates jump between pixels, as they do from
slice to slice; by *Cubic* it does not.
"""

from __future__ import annotations

import bpy

from ..core.grid_atlas import LIT
from ..core.moments import NAMES
from ..core.settings import Spatial
from .grid_reading import Reading
from .node_formulas import Socket
from .shader_maths import BLACK, Colour, Inputs, ShaderMaths
from .wall_nodes import in_turn

FILTERS = {Spatial.TRILINEAR: "Linear", Spatial.TRICUBIC: "Cubic"}


def fill_slice(group: bpy.types.ShaderNodeTree, reading: Reading, spatial: Spatial) -> None:
    """Make a group the reading of one slice.

    Its inputs are the texture coordinates `Place` in the slice's first plane, and the coefficients of a normal. It
    returns the interpolated `Light`, and of the share of vertices that take part the texel `Lit`.
    """
    maths = ShaderMaths(group)
    into = maths.inputs({"Place": "Vector"} | dict.fromkeys(NAMES, "Float"))
    light: Colour = BLACK
    for plane, name in enumerate(NAMES):
        light = maths.added(light, into[name], reading.plane(maths, into["Place"], plane, FILTERS[spatial]))
    lit = reading.plane(maths, into["Place"], LIT, FILTERS[spatial])
    assert isinstance(light, Socket)
    maths.outputs({"Light": ("Color", light), "Lit": ("Color", lit)})


def lit_around(maths: ShaderMaths, reading: Reading, spatial: Spatial, place: Socket) -> Socket:
    """Return the interpolated texel of what is lit around a place, in voxels, as a colour."""
    found: Colour = BLACK
    for at, weight in _slices(maths, reading, spatial, place):
        found = maths.added(found, weight, reading.plane(maths, at, LIT, FILTERS[spatial]))
    assert isinstance(found, Socket)
    return found


def irradiance_in_the_open(
    maths: ShaderMaths,
    reading: Reading,
    spatial: Spatial,
    one_slice: bpy.types.ShaderNodeTree,
    place: Socket,
    coefficients: Inputs,
) -> Socket:
    """Return E at a place, in voxels; `one_slice` is the group of `fill_slice`."""
    light: Colour = BLACK
    lit: Colour = BLACK
    for at, weight in _slices(maths, reading, spatial, place):
        here = in_turn(maths, at, maths.channel(lit, 1)) if isinstance(lit, Socket) else at
        found = maths.node("ShaderNodeGroup", coefficients | {"Place": here}, node_tree=one_slice).outputs
        light = maths.added(light, weight, found["Light"])
        lit = maths.added(lit, weight, found["Lit"])
    assert isinstance(light, Socket) and isinstance(lit, Socket)
    mean = maths.scaled(light, maths.math("DIVIDE", 1.0, maths.channel(lit, 1)))
    # A reconstruction can undershoot; light cannot.
    return maths.vector("MAXIMUM", mean, (0.0,) * 3)


def _slices(maths: ShaderMaths, reading: Reading, spatial: Spatial, place: Socket) -> list[tuple[Socket, Socket]]:
    """Return the texture coordinates of a place in the first planes of the slices around it, with their weights."""
    last = float(reading.lattice.resolution[2])
    z = maths.separated(place)[2]
    k = maths.math("MINIMUM", maths.math("FLOOR", z), last - 1.0)
    above = maths.math("SUBTRACT", z, k)
    upper = maths.math("ADD", k, 1.0)
    if spatial is Spatial.TRILINEAR:
        found = [(k, maths.math("SUBTRACT", 1.0, above)), (upper, above)]
    else:
        lowest = maths.math("MAXIMUM", maths.math("SUBTRACT", k, 1.0), 0.0)
        highest = maths.math("MINIMUM", maths.math("ADD", k, 2.0), last)
        found = list(zip((lowest, k, upper, highest), _cubic(maths, above), strict=True))
    at = reading.in_plane(maths, place)
    return [(reading.in_slice(maths, at, number), weight) for number, weight in found]


def _cubic(maths: ShaderMaths, f: Socket) -> tuple[Socket, Socket, Socket, Socket]:
    """Return `look_up.cubic_weights`."""
    g = maths.math("SUBTRACT", 1.0, f)

    def outer(t: Socket) -> Socket:
        return maths.math("MULTIPLY", maths.math("MULTIPLY", t, t), maths.math("MULTIPLY", t, 1.0 / 6.0))

    def inner(t: Socket) -> Socket:
        bent = maths.math("MULTIPLY", maths.math("MULTIPLY", t, t), maths.math("MULTIPLY_ADD", t, 0.5, -1.0))
        return maths.math("ADD", bent, 2.0 / 3.0)

    return outer(g), inner(f), inner(g), outer(f)
