# SPDX-License-Identifier: GPL-3.0-or-later
"""Which vertices speak for a place beside thin walls (core/partitions.py), as nodes.

A vertex has texels V_w = (1 + s) N for each of its walls, and one with (1 + s) D (core/grid_atlas.py). It speaks for a
place x of a surface with normal n if V_w·x − (1 + s) D + s V_w·n ≥ 0 for all w, s = ‖V_w‖ − 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from ..core.grid_atlas import LIT, PLANES
from ..core.look_up_rules import LEAST_DIVIDED, LEAST_SPOKEN
from .grid_reading import CORNERS, Reading, weights
from .node_formulas import Socket
from .shader_maths import Inputs, ShaderMaths


def fill_sides(group: bpy.types.ShaderNodeTree, reading: Reading) -> None:
    """Make a group the question whether a vertex speaks for a place.

    Its inputs are the texture coordinates `Place` in the first plane, the place `At`, voxels, and the surface's
    `Normal` there. It returns whether the vertex `Speaks`, 1 or 0, and the `Wall` V that the place is behind, else the
    last one.
    """
    maths = ShaderMaths(group)
    into = maths.inputs(dict.fromkeys(("Place", "At", "Normal"), "Vector"))
    first, count = len(PLANES), reading.layout.walls
    offsets = reading.plane(maths, into["Place"], first + count)
    silent: Socket | None = None
    wall: Socket | None = None
    for number in reversed(range(count)):
        v = reading.plane(maths, into["Place"], first + number)
        distance = maths.math("SUBTRACT", maths.dot(v, into["At"]), maths.channel(offsets, number))
        slack = maths.math("SUBTRACT", maths.length(v), 1.0)
        side = maths.math("MULTIPLY_ADD", slack, maths.dot(v, into["Normal"]), distance)
        beyond = maths.math("LESS_THAN", side, 0.0)
        silent = beyond if silent is None else maths.math("MAXIMUM", silent, beyond)
        wall = v if wall is None else maths.chosen(beyond, v, wall)
    assert silent is not None and wall is not None
    maths.outputs({"Speaks": ("Float", maths.math("SUBTRACT", 1.0, silent)), "Wall": ("Vector", wall)})


def fill_asked(group: bpy.types.ShaderNodeTree, sides: bpy.types.ShaderNodeTree, reading: Reading) -> None:
    """Make a group the asking of one vertex after the other whether it speaks for a place.

    To the sums so far it adds the weight of a vertex that takes part to `Total`, and to `Spoken` if it speaks for the
    place; to `Divided` if walls divide it; and keeps the `Most` weight of one that is silent, with its `Wall`.
    """
    maths = ShaderMaths(group)
    numbers = dict.fromkeys(("Total", "Spoken", "Most", "Divided", "Weight"), "Float")
    into = maths.inputs(numbers | dict.fromkeys(("Wall", "Place", "At", "Normal"), "Vector"))
    place = in_turn(maths, into["Place"], into["Total"])
    lit = reading.plane(maths, place, LIT)
    asked = maths.node(
        "ShaderNodeGroup", {"Place": place, "At": into["At"], "Normal": into["Normal"]}, node_tree=sides
    ).outputs
    weight = maths.math("MULTIPLY", into["Weight"], maths.channel(lit, 1))
    silent = maths.math("MULTIPLY", weight, maths.math("SUBTRACT", 1.0, asked["Speaks"]))
    more = maths.math("GREATER_THAN", silent, into["Most"])
    maths.outputs(
        {
            "Total": ("Float", maths.math("ADD", into["Total"], weight)),
            "Spoken": ("Float", maths.math("MULTIPLY_ADD", weight, asked["Speaks"], into["Spoken"])),
            "Most": ("Float", maths.math("MAXIMUM", into["Most"], silent)),
            "Divided": ("Float", maths.math("MULTIPLY_ADD", into["Weight"], maths.channel(lit, 2), into["Divided"])),
            "Wall": ("Vector", maths.chosen(more, asked["Wall"], into["Wall"])),
        }
    )


def in_turn(maths: ShaderMaths, place: Socket, after: Socket) -> Socket:
    """Return `place`, but not before `after`, a number that is not negative, is known.

    Without it Cycles 5.0 reads the texels of all vertices first, and runs out of places to keep them.
    """
    return maths.scaled(place, maths.math("GREATER_THAN", after, -1.0))


@dataclass(frozen=True)
class Beside:
    """A place, perhaps beside thin walls.

    Parameters
    ----------
    place, voxel
        Where it is, voxels, and the lower vertex of the voxel there.
    divided
        1 if walls divide vertices around the place that was asked for, else 0; None if the grid has no walls.
    """

    place: Socket
    voxel: Socket
    divided: Socket | None


def step_back(
    maths: ShaderMaths,
    reading: Reading,
    asked: bpy.types.ShaderNodeTree,
    place: Socket,
    normal: Socket,
    divided: bool,
) -> Beside:
    """Return a place, or one half a voxel away from a wall where hardly a vertex speaks for it (`core/look_up.py`).

    Parameters
    ----------
    divided
        Vertices around are divided anyway; else it is found out.
    """
    voxel = reading.voxel(maths, place)
    texels = reading.corners(maths, voxel)
    weight = weights(maths, maths.vector("SUBTRACT", place, voxel))
    sums: Inputs = dict.fromkeys(("Total", "Spoken", "Most", "Divided"), 0.0)
    sums["Wall"] = (0.0, 0.0, 0.0)
    for corner in CORNERS:
        inputs = sums | {"Weight": weight[corner], "Place": texels[corner], "At": place, "Normal": normal}
        found = maths.node("ShaderNodeGroup", inputs, node_tree=asked).outputs
        sums = {name: found[name] for name in sums}
    enough = maths.math("MULTIPLY", sums["Total"], LEAST_SPOKEN)
    moves = maths.math(
        "MULTIPLY",
        maths.math("LESS_THAN", sums["Spoken"], enough),
        maths.math("GREATER_THAN", sums["Most"], 0.0),
    )
    away = maths.scaled(maths.vector("NORMALIZE", sums["Wall"]), maths.math("MULTIPLY", moves, -0.5))
    here = reading.within(maths, maths.vector("ADD", place, away))
    share = 1.0 if divided else sums["Divided"]
    return Beside(here, reading.voxel(maths, here), maths.math("GREATER_THAN", share, LEAST_DIVIDED))
