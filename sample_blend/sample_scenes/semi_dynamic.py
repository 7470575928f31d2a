# SPDX-License-Identifier: GPL-3.0-or-later
"""A room through which a rough stone flies: past a red wall, around a screen, into its shadow."""

from __future__ import annotations

import bpy
from mathutils import Vector

from ivg_addon.blender.properties import ensure_registered

from .assets import add, aim, area_light, collection, diffuse, mesh, point_light, spot_light
from .rooms import SUNK, Shell, ShellMaterials, add_shell
from .sculptures import Relief, carve
from .shapes import ball, box
from .stage import WIDE, camera, start

SHELL = Shell(width=7.0, length=5.0, height=3.2, thickness=0.25)
SCREEN = ((0.55, 0.1, -SUNK), (0.7, 2.5 + SUNK, 2.3))

FRAMES = 80
FLIGHT = (
    (1, (-2.6, 0.9, 0.9), (0.0, 0.0, 0.0)),
    (21, (-2.3, 0.5, 1.6), (0.6, 0.3, 1.6)),
    (41, (-0.8, 0.3, 1.3), (0.2, 0.9, 3.0)),
    (56, (0.6, -0.4, 1.3), (-0.3, 0.5, 4.2)),
    (68, (1.5, 0.2, 1.2), (0.4, 0.0, 5.1)),
    (80, (1.6, 1.2, 1.0), (0.0, 0.4, 6.0)),
)
"""Frame, place in metres, turns in radians."""


def build_semi_dynamic() -> None:
    """Build the room along x: lit at -x, where the wall is red, and dim behind the screen, where it is blue."""
    scene = start("Semi-Dynamic", WIDE)
    scene.frame_start, scene.frame_end = 1, FRAMES
    plaster = diffuse("Plaster", (0.76, 0.74, 0.70))
    red, blue = diffuse("Red", (0.66, 0.08, 0.05)), diffuse("Blue", (0.12, 0.22, 0.62))
    boards = diffuse("Boards", (0.46, 0.34, 0.22))
    architecture = collection("Architecture")
    sides = ShellMaterials(floor=boards, ceiling=plaster, west=red, east=blue, south=plaster, north=plaster)
    add_shell(architecture, SHELL, sides)
    add(architecture, "Screen", mesh("Screen", box(*SCREEN), plaster))
    _add_lights(collection("Lights"))
    _add_stone(collection("Moving"))
    camera((0.1, -2.4, 1.75), (0.0, 1.0, 1.35), lens=19.0)


def _add_lights(group: bpy.types.Collection) -> None:
    """Add the lamp over the lit side, a spot on the red wall, and a night light behind the screen."""
    warm, cool = (1.0, 0.93, 0.82), (0.80, 0.90, 1.0)
    lamp = area_light(group, "Lamp", (-1.4, 1.5, 3.1), size=(1.2, 0.8), watts=70.0, colour=warm)
    aim(lamp, (-1.6, 1.2, 0.0))
    spot_light(group, "Spot", (-1.2, -1.6, 2.9), (-3.5, 0.8, 1.2), degrees=50.0, blend=0.4, watts=90.0)
    point_light(group, "Night Light", (3.0, 2.0, 0.5), radius=0.1, watts=4.0, colour=cool)


def _add_stone(group: bpy.types.Collection) -> None:
    """Add the stone and its flight; a bake leaves it out."""
    stone = add(group, "Stone", mesh("Stone", ball(8, 0.3), diffuse("Sandstone", (0.46, 0.41, 0.34)), smooth=True))
    carve(stone, 3, (Relief("VORONOI", 0.16, 0.09), Relief("CLOUDS", 0.04, 0.015)))
    for frame, place, turns in FLIGHT:
        stone.location, stone.rotation_euler = Vector(place), turns
        stone.keyframe_insert("location", frame=frame)
        stone.keyframe_insert("rotation_euler", frame=frame)
    ensure_registered()
    stone.ivg.leave_out = True
    bpy.context.scene.frame_set(1)
