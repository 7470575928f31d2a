# SPDX-License-Identifier: GPL-3.0-or-later
"""Two rooms joined by a doorway, after figure 5 of RR-6983: one lamp, in the farther room."""

from __future__ import annotations

import math

import bpy

from .assets import add, aim, area_light, collection, diffuse, mesh
from .rooms import Shell, ShellMaterials, add_shell, column, pedestal
from .sculptures import Relief, carve
from .shapes import torus_knot, wall_with_doorway
from .stage import WIDE, camera, start

# With its walls 7.5 x 23 x 5 m: 30 x 92 x 20 voxels of a quarter metre, the walls' thickness.
SHELL = Shell(width=7.0, length=22.5, height=4.5, thickness=0.25)
DOORWAY = (-0.3, 2.1, 3.2)

COLUMN_X = -2.1
COLUMN_Y = (-9.2, -6.9, -4.6, -2.3)
KNOT_XY = (-0.1, -6.6)

LAMP_WATTS = 1100.0


def build_two_rooms() -> None:
    """Build the rooms along y: the dark one, with the camera, at -y, the lit one at +y.

    The lamp shines through the doorway onto the dark room's east wall and floor, from where light
    reaches the columns and the sculpture.
    """
    start("Two Rooms", WIDE)
    plaster = diffuse("Plaster", (0.76, 0.74, 0.70))
    ochre = diffuse("Ochre", (0.72, 0.36, 0.10))
    blue = diffuse("Blue", (0.18, 0.36, 0.55))
    stone = diffuse("Stone", (0.60, 0.55, 0.48))
    architecture = collection("Architecture")
    add_shell(
        architecture,
        SHELL,
        ShellMaterials(floor=stone, ceiling=plaster, west=blue, east=plaster, south=plaster, north=ochre),
    )
    _add_partition(architecture, plaster)
    marble = diffuse("Marble", (0.80, 0.78, 0.74))
    _add_columns(architecture, marble)
    _add_knot(collection("Exhibit"), marble)
    lamp = area_light(
        collection("Lights"),
        "Lamp",
        (-1.7, 3.4, 3.0),
        size=(0.7, 0.7),
        watts=LAMP_WATTS,
        colour=(1.0, 0.93, 0.82),
    )
    aim(lamp, (0.9, 0.0, 1.2))
    camera((2.2, -10.6, 1.75), (0.3, -4.0, 1.6), lens=22.0)


def _add_partition(group: bpy.types.Collection, material: bpy.types.Material) -> None:
    """Add the wall between the rooms, its ends inside the walls, the floor and the ceiling."""
    sunk = 0.5 * SHELL.thickness
    shape = wall_with_doorway(SHELL.width + 2.0 * sunk, -sunk, SHELL.height + sunk, SHELL.thickness, DOORWAY)
    add(group, "Partition Wall", mesh("Partition Wall", shape, material))


def _add_columns(group: bpy.types.Collection, material: bpy.types.Material) -> None:
    """Add the row of columns in the dark room: objects of one mesh."""
    shared = mesh("Column", column(SHELL.height, 0.26), material, smooth=True)
    for number, y in enumerate(COLUMN_Y, start=1):
        add(group, f"Column {number}", shared, (COLUMN_X, y, 0.0))


def _add_knot(group: bpy.types.Collection, material: bpy.types.Material) -> None:
    """Add the sculpture of the dark room: a weathered torus knot on a pedestal."""
    x, y = KNOT_XY
    height = 0.8
    add(group, "Pedestal", mesh("Pedestal", pedestal(0.84, height), material), (x, y, 0.0))
    shape = torus_knot(2, 3, radius=0.54, swing=0.24, tube=0.15, steps=128, sides=12)
    data = mesh("Torus Knot", shape, diffuse("Terracotta", (0.74, 0.38, 0.24)))
    knot = add(group, "Torus Knot", data, (x, y, height + 0.88))
    knot.rotation_euler = (0.0, 0.0, math.radians(20.0))
    carve(
        knot,
        2,
        (
            Relief("VORONOI", 0.10, 0.065),
            Relief("CLOUDS", 0.03, 0.012),
        ),
    )
