# SPDX-License-Identifier: GPL-3.0-or-later
"""The Cornell box, upright and tilted.

The coordinates are those that the Program of Computer Graphics at Cornell University measured and
published ("Cornell Box Data"), in millimetres of a box 55 cm wide. They are taken tenfold, so that a
published unit is a centimetre and the box a room 5.5 m wide, and with the walls at right angles: the
measured ones are off by up to 6 mm.
"""

from __future__ import annotations

import math

import bpy
from mathutils import Euler, Matrix, Vector

from .assets import add, area_light, collection, diffuse, mesh
from .shapes import Point, prism, quad
from .stage import SQUARE, camera, start

METRES = 0.01
WIDTH, HEIGHT, DEPTH = 552.8, 548.8, 559.2

# (x, z) corners and the height of each block, x to the left and z into the box.
SHORT_BLOCK = (((130.0, 65.0), (82.0, 225.0), (240.0, 272.0), (290.0, 114.0)), 165.0)
TALL_BLOCK = (((423.0, 247.0), (265.0, 296.0), (314.0, 456.0), (472.0, 406.0)), 330.0)
LAMP_X, LAMP_Z = (213.0, 343.0), (227.0, 332.0)
EYE = (278.0, 273.0, -800.0)
LENS, SENSOR = 35.0, 25.0

# The RGB reflectances that most renderers use in place of the measured spectra.
WHITE = (0.725, 0.71, 0.68)
RED = (0.63, 0.065, 0.05)
GREEN = (0.14, 0.45, 0.091)

LAMP_WATTS = 120.0
LAMP_DROP = 0.005

TILT_X, TILT_Z = 30.0, 25.0


def build_cornell() -> None:
    """Build the box along the axes: x right, y into the box, z up, one corner at the origin."""
    _build("Cornell Box", Matrix.Identity(4))


def build_cornell_tilted() -> None:
    """Build the same box turned around its centre, about x and then z: no wall faces along an axis."""
    centre = Matrix.Translation(_room(WIDTH / 2.0, HEIGHT / 2.0, DEPTH / 2.0))
    turn = Euler((math.radians(TILT_X), 0.0, math.radians(TILT_Z)), "XYZ").to_matrix().to_4x4()
    _build("Cornell Box Tilted", centre @ turn @ centre.inverted())


def _build(name: str, placement: Matrix) -> None:
    scene = start(name, SQUARE)
    white, red, green = diffuse("White", WHITE), diffuse("Red", RED), diffuse("Green", GREEN)
    _add_walls(collection("Walls"), white, red, green)
    _add_blocks(collection("Blocks"), white)
    _add_lamp(collection("Lights"))
    camera(tuple(_room(*EYE)), tuple(_room(EYE[0], EYE[1], DEPTH)), lens=LENS, sensor=SENSOR)
    bpy.context.view_layer.update()
    for thing in scene.objects:
        thing.matrix_world = placement @ thing.matrix_world


def _room(x: float, y: float, z: float) -> Vector:
    """Return the point in the room of one in the published axes: x left, y up, z into the box."""
    return Vector((WIDTH - x, z, y)) * METRES


def _add_walls(
    group: bpy.types.Collection,
    white: bpy.types.Material,
    red: bpy.types.Material,
    green: bpy.types.Material,
) -> None:
    """Add the five walls, one face each, fronts inward; the box stays open towards the camera."""
    x, y, z = _room(0.0, HEIGHT, DEPTH)
    walls: dict[str, tuple[bpy.types.Material, tuple[Point, ...]]] = {
        "Floor": (white, ((0, 0, 0), (x, 0, 0), (x, y, 0), (0, y, 0))),
        "Ceiling": (white, ((0, 0, z), (0, y, z), (x, y, z), (x, 0, z))),
        "Back Wall": (white, ((0, y, 0), (x, y, 0), (x, y, z), (0, y, z))),
        "Left Wall": (red, ((0, 0, 0), (0, y, 0), (0, y, z), (0, 0, z))),
        "Right Wall": (green, ((x, y, 0), (x, 0, 0), (x, 0, z), (x, y, z))),
    }
    for name, (material, corners) in walls.items():
        add(group, name, mesh(name, quad(corners), material))


def _add_blocks(group: bpy.types.Collection, white: bpy.types.Material) -> None:
    """Add the two blocks, closed, standing on the floor."""
    for name, (corners, height) in (("Short Block", SHORT_BLOCK), ("Tall Block", TALL_BLOCK)):
        outline = [tuple(_room(x, 0.0, z).xy) for x, z in corners]
        add(group, name, mesh(name, prism(outline, 0.0, height * METRES), white))


def _add_lamp(group: bpy.types.Collection) -> None:
    """Add the ceiling lamp, a few millimetres below the ceiling."""
    centre = _room(sum(LAMP_X) / 2.0, HEIGHT, sum(LAMP_Z) / 2.0)
    size = ((LAMP_X[1] - LAMP_X[0]) * METRES, (LAMP_Z[1] - LAMP_Z[0]) * METRES)
    area_light(group, "Lamp", (centre.x, centre.y, centre.z - LAMP_DROP), size=size, watts=LAMP_WATTS)
