# SPDX-License-Identifier: GPL-3.0-or-later
"""Looking a stored grid up vertex by vertex, as nodes: the trilinear look-up, beside thin walls too.

Image Texture nodes read single texels (*Closest*).
"""

from __future__ import annotations

from collections.abc import Callable

import bpy

from ..core.grid_atlas import LIT
from ..core.look_up_rules import WITHIN
from ..core.moments import NAMES
from .grid_reading import CORNERS, Reading, bias, lit_by_vertices, weights
from .node_formulas import Socket
from .shader_maths import BLACK, Colour, Inputs, ShaderMaths
from .wall_nodes import Beside, fill_asked, fill_sides, in_turn, step_back

Part = Callable[[str], bpy.types.ShaderNodeTree]

_SILENT = 1e-24
"""What remains of the weight of a vertex that does not speak for a place: it counts where no other does.

Those that speak have at least `WITHIN`³; single precision ends at 10⁻³⁸.
"""


def irradiance_by_vertices(
    maths: ShaderMaths,
    reading: Reading,
    part: Part,
    place: Socket,
    surface: Socket,
    coefficients: Inputs,
    divided: bool,
) -> Socket:
    """Return E at a place of a surface.

    Parameters
    ----------
    part
        Returns a group to be used, by a name.
    place
        In voxels.
    surface
        Its own normal.
    coefficients
        Of the normal that receives the light, by their names.
    divided
        The look-up is made beside walls only; else their vertices count where they are.
    """
    walls = reading.layout.walls > 0
    vertex = part("vertex")
    if walls:
        fill_sides(part("sides"), reading)
        fill_asked(part("asked"), part("sides"), reading)
        fill_vertex(vertex, reading, part("sides"))
        beside = step_back(maths, reading, part("asked"), place, surface, divided)
    else:
        fill_vertex(vertex, reading, None)
        beside = Beside(place, reading.voxel(maths, place), None)
    lit = lit_by_vertices(maths, reading, beside.place, beside.voxel)
    voxel, fraction = _moved(maths, reading, beside, bias(maths, lit, surface))

    common = coefficients
    if beside.divided is not None:
        # Of vertices that walls divide, others than those around the place asked for are not asked.
        common = common | {"At": beside.place, "Normal": surface, "Spoken": maths.math("SUBTRACT", 1.0, beside.divided)}
    weight = weights(maths, fraction)
    texels = reading.corners(maths, voxel)
    sums: Inputs = {"Light": BLACK, "Lit": 0.0}
    for corner in CORNERS:
        inputs = sums | common | {"Place": texels[corner], "Weight": weight[corner]}
        found = maths.node("ShaderNodeGroup", inputs, node_tree=vertex).outputs
        sums = {name: found[name] for name in sums}
    mean = maths.scaled(found["Light"], maths.math("DIVIDE", 1.0, found["Lit"]))
    # A reconstruction can undershoot; light cannot.
    return maths.vector("MAXIMUM", mean, (0.0,) * 3)


def fill_vertex(group: bpy.types.ShaderNodeTree, reading: Reading, sides: bpy.types.ShaderNodeTree | None) -> None:
    """Make a group the reading of one vertex: it adds its weighted light, and its weight if it takes part.

    Its inputs are the sums so far, `Light` and `Lit`, the texture coordinates `Place` in the first plane, the
    interpolation's `Weight`, and the coefficients; with `sides` (`fill_sides`) also what these ask for, and 1 as
    `Spoken` where they are not to be asked.
    """
    maths = ShaderMaths(group)
    kinds = {"Light": "Color", "Place": "Vector"} | dict.fromkeys(("Lit", "Weight", *NAMES), "Float")
    if sides is not None:
        kinds |= {"At": "Vector", "Normal": "Vector", "Spoken": "Float"}
    into = maths.inputs(kinds)
    place = in_turn(maths, into["Place"], into["Lit"])
    weight = into["Weight"]
    if sides is not None:
        asked = maths.node(
            "ShaderNodeGroup", {"Place": place, "At": into["At"], "Normal": into["Normal"]}, node_tree=sides
        )
        speaks = maths.math("MAXIMUM", maths.math("MAXIMUM", asked.outputs["Speaks"], into["Spoken"]), _SILENT)
        weight = maths.math("MULTIPLY", weight, speaks)
    lit = maths.channel(reading.plane(maths, place, LIT), 1)
    light: Colour = BLACK
    for plane, name in enumerate(NAMES):
        light = maths.added(light, into[name], reading.plane(maths, place, plane))
    maths.outputs(
        {
            "Light": ("Color", maths.added(into["Light"], weight, light)),
            "Lit": ("Float", maths.math("MULTIPLY_ADD", lit, weight, into["Lit"])),
        }
    )


def _moved(maths: ShaderMaths, reading: Reading, beside: Beside, off: Socket) -> tuple[Socket, Socket]:
    """Return the voxel to which the bias moves a place, and how far above its lower vertex: not out of one at walls."""
    moved = reading.within(maths, maths.vector("ADD", beside.place, off))
    voxel = reading.voxel(maths, moved)
    fraction = maths.vector("SUBTRACT", moved, voxel)
    if beside.divided is None:
        return voxel, fraction
    inside = maths.vector("MAXIMUM", maths.vector("SUBTRACT", moved, beside.voxel), (WITHIN,) * 3)
    inside = maths.vector("MINIMUM", inside, (1.0 - WITHIN,) * 3)
    return maths.chosen(beside.divided, beside.voxel, voxel), maths.chosen(beside.divided, inside, fraction)
