# SPDX-License-Identifier: GPL-3.0-or-later
"""The look-up of a stored grid, as the nodes of a group: the formulas of `core/look_up.py`.

There are two ways. In the open textures' filters interpolate (open_look_up.py); beside walls, and for EEVEE wherever
interpolation is trilinear, vertices are read one by one (vertex_look_up.py). Which of them counts is a number, so that
shaders can be mixed by it: then Cycles computes only the one.
"""

from __future__ import annotations

import bpy

from ..core.look_up_rules import LEAST_DIVIDED
from ..core.moments import NAMES
from ..core.settings import Spatial
from .grid_reading import Reading, bias
from .node_formulas import Number, Socket
from .open_look_up import fill_slice, irradiance_in_the_open, lit_around
from .reconstruction_nodes import coefficients
from .shader_maths import BLACK, Colour, Inputs, ShaderMaths
from .vertex_look_up import Part, irradiance_by_vertices

IRRADIANCE, OPEN, BESIDE, WALLS = "Irradiance", "In the Open", "Beside Walls", "Walls"
"""Outputs of the group: E; that of either way, for those who mix shaders; and which of them counts, 0 or 1."""


def fill(group: bpy.types.ShaderNodeTree, reading: Reading, spatial: Spatial, part: Part) -> None:
    """Make a group the look-up.

    Parameters
    ----------
    spatial
        The interpolation that the image is for.
    part
        Returns a group to be used in it, by a name.
    """
    maths = ShaderMaths(group)
    given = maths.inputs({"Normal": "Vector"})["Normal"]
    geometry = maths.node("ShaderNodeNewGeometry", {})
    surface = geometry.outputs["Normal"]
    absent = maths.math("LESS_THAN", maths.length(given), 1e-6)
    normal = maths.vector("NORMALIZE", maths.vector("ADD", given, maths.scaled(surface, absent)))
    rows: Inputs = {name: row for name, row in zip(NAMES, coefficients(maths, normal), strict=True)}
    place = reading.place(maths, geometry.outputs["Position"])
    around = lit_around(maths, reading, spatial, place)
    moved = reading.within(maths, maths.vector("ADD", place, bias(maths, around, surface)))
    fill_slice(part("slice"), reading, spatial)
    found = irradiance_in_the_open(maths, reading, spatial, part("slice"), moved, rows)

    walls = reading.layout.walls > 0
    beside: Colour = BLACK
    counts: Number = 0.0
    if walls:
        counts = maths.math("GREATER_THAN", maths.channel(around, 2), LEAST_DIVIDED)
    if spatial is Spatial.TRILINEAR:
        counts = maths.math("MAXIMUM", _is_eevee(maths), counts) if walls else _is_eevee(maths)
    if isinstance(counts, Socket):
        beside = irradiance_by_vertices(maths, reading, part, place, surface, rows, spatial is not Spatial.TRILINEAR)
        found_here = maths.chosen(counts, beside, found)
    else:
        found_here = found
    maths.outputs(
        {
            IRRADIANCE: ("Color", found_here),
            OPEN: ("Color", found),
            BESIDE: ("Color", beside),
            WALLS: ("Float", counts),
        }
    )


def _is_eevee(maths: ShaderMaths) -> Socket:
    """Return 1 in EEVEE and 0 in Cycles, for which an IES Texture without a profile is 100; EEVEE has none."""
    profile = maths.value("ShaderNodeTexIES")
    return maths.math("SUBTRACT", 1.0, maths.math("COMPARE", profile, 100.0, 1.0))
