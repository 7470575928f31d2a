# SPDX-License-Identifier: GPL-3.0-or-later
"""A long exhibition hall under eleven lights, after figure 4 of RR-6983: most of its light is direct."""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy

from . import paintings
from .assets import add, area_light, collection, diffuse, mesh, point_light, principled, spot_light
from .rooms import Shell, ShellMaterials, add_shell, bench, pedestal
from .sculptures import Relief, carve
from .shapes import Shape, ball, box, quad, revolve, torus_knot, twisted_star
from .stage import WIDE, camera, start

SHELL = Shell(width=8.0, length=24.0, height=4.5, thickness=0.25)
BEAMS_Y = (-9.0, -6.0, -3.0, 0.0, 3.0, 6.0, 9.0)

GLOBES = ((-0.3, -4.5, 3.1), (-0.3, 1.5, 3.1))
GLOBE_RADIUS = 0.14

WARM = (1.0, 0.90, 0.76)
COOL = (0.90, 0.95, 1.0)


@dataclass(frozen=True)
class Hanging:
    """A picture on a wall: its painter, its middle and its height in metres, its quarter turns about z."""

    name: str
    painter: paintings.Painter
    place: tuple[float, float, float]
    quarter_turns: int
    height: float = 1.35


# A picture faces -y before it is turned: one quarter makes it face +x, off the west wall, three -x.
HANGINGS = (
    Hanging("Discs", paintings.discs, (-4.0, -6.0, 1.75), 1),
    Hanging("Mountains", paintings.mountains, (-4.0, -0.5, 1.75), 1),
    Hanging("Mosaic", paintings.mosaic, (-4.0, 5.0, 1.75), 1),
    Hanging("Evening", paintings.evening, (4.0, -6.0, 1.75), 3),
    Hanging("Ripples", paintings.ripples, (4.0, -0.5, 1.75), 3),
    Hanging("Grid", paintings.grid, (4.0, 5.0, 1.75), 3),
    Hanging("Ribbons", paintings.ribbons, (0.0, 12.0, 2.1), 0, 2.4),
)


def build_gallery() -> None:
    """Build the hall along y, the camera at its -y end."""
    start("Gallery", WIDE)
    wall = diffuse("Wall Paint", (0.78, 0.76, 0.72))
    plank_image = paintings.paint("Planks", paintings.planks, (96, 96))
    floor = principled("Floor Boards", image=plank_image, roughness=0.7, specular=0.2)
    architecture = collection("Architecture")
    add_shell(
        architecture,
        SHELL,
        ShellMaterials(
            floor=floor,
            ceiling=diffuse("Ceiling Paint", (0.80, 0.80, 0.79)),
            west=wall,
            east=wall,
            south=wall,
            north=diffuse("Night Blue", (0.05, 0.09, 0.16)),
        ),
    )
    _add_beams(architecture, diffuse("Beam Oak", (0.34, 0.21, 0.11)))
    _add_cords(architecture, diffuse("Cord Black", (0.03, 0.03, 0.03)))
    _add_pictures(collection("Pictures"))
    _add_exhibits(collection("Exhibits"))
    _add_lights(collection("Lights"))
    camera((1.3, -11.6, 1.65), (-0.15, 0.0, 1.75), lens=22.0)


def _add_beams(group: bpy.types.Collection, material: bpy.types.Material) -> None:
    """Add the beams under the ceiling: objects of one mesh, their ends inside the walls."""
    reach = SHELL.width / 2.0 + 0.1
    shape = box((-reach, -0.12, SHELL.height - 0.28), (reach, 0.12, SHELL.height + 0.05))
    shared = mesh("Beam", shape, material)
    for number, y in enumerate(BEAMS_Y, start=1):
        add(group, f"Beam {number}", shared, (0.0, y, 0.0))


def _add_cords(group: bpy.types.Collection, material: bpy.types.Material) -> None:
    """Add the cords that the globes hang from, ending just above them."""
    for number, (x, y, z) in enumerate(GLOBES, start=1):
        length = SHELL.height - z
        shape = revolve(((0.012, GLOBE_RADIUS + 0.01), (0.012, length + 0.05)), 12)
        data = mesh(f"Cord {number}", shape, material, smooth=True)
        add(group, f"Cord {number}", data, (x, y, z))


def _add_pictures(group: bpy.types.Collection) -> None:
    """Add each picture: a canvas, whose UVs show its image, in front of a frame that runs into the wall."""
    frame_material = principled("Frame Wood", (0.09, 0.06, 0.04), roughness=0.4)
    for hanging in HANGINGS:
        image = paintings.paint(hanging.name, hanging.painter, (144, 108))
        canvas_material = principled(f"{hanging.name} Canvas", image=image, roughness=0.9, specular=0.0)
        canvas, frame = _picture_shapes(hanging.height)
        turn = (0.0, 0.0, math.radians(90.0 * hanging.quarter_turns))
        for name, shape, material in (
            (f"{hanging.name} Canvas", canvas, canvas_material),
            (f"{hanging.name} Frame", frame, frame_material),
        ):
            add(group, name, mesh(name, shape, material), hanging.place).rotation_euler = turn


def _picture_shapes(height: float) -> tuple[Shape, Shape]:
    """Return a canvas and its frame, four by three, facing -y, the wall at y = 0."""
    z = height / 2.0
    x = z * 4.0 / 3.0
    rim = 0.07
    front = -0.06
    canvas = quad(((-x, front, -z), (x, front, -z), (x, front, z), (-x, front, z)))
    return canvas, box((-x - rim, front + 0.01, -z - rim), (x + rim, 0.03, z + rim))


def _add_exhibits(group: bpy.types.Collection) -> None:
    """Add three sculptures on pedestals and a bench."""
    white = diffuse("Pedestal White", (0.74, 0.74, 0.73))
    for name, x, y, height in (
        ("Meteorite", -1.5, -7.2, 0.95),
        ("Flame", 1.95, -3.0, 0.7),
        ("Coral Knot", -1.3, 1.6, 0.85),
    ):
        data = mesh(f"{name} Pedestal", pedestal(0.75, height), white)
        add(group, f"{name} Pedestal", data, (x, y, 0.0))
    _add_meteorite(group, (-1.5, -7.2, 0.95 + 0.5))
    _add_flame(group, (1.95, -3.0, 0.7 - 0.03))
    _add_coral_knot(group, (-1.3, 1.6, 0.85 + 0.62))
    oak = principled("Bench Oak", (0.42, 0.25, 0.12), roughness=0.5)
    add(group, "Bench", mesh("Bench", bench(1.9, 0.5, 0.45), oak), (2.35, -6.4, 0.0))


def _add_meteorite(group: bpy.types.Collection, place: tuple[float, float, float]) -> None:
    iron = principled("Meteorite Iron", (0.33, 0.27, 0.23), roughness=0.55)
    meteorite = add(group, "Meteorite", mesh("Meteorite", ball(12, 0.46), iron), place)
    meteorite.rotation_euler = (0.3, 0.2, 0.9)
    craters = Relief("VORONOI", 0.26, 0.22)
    carve(meteorite, 2, (Relief("CLOUDS", 0.5, 0.28), craters, Relief("CLOUDS", 0.05, 0.025)))


def _add_flame(group: bpy.types.Collection, place: tuple[float, float, float]) -> None:
    clay = diffuse("Terracotta", (0.62, 0.24, 0.13))
    shape = twisted_star(5, radius=0.36, depth=0.3, height=1.5, turn=2.6, rings=28)
    flame = add(group, "Flame", mesh("Flame", shape, clay), place)
    carve(flame, 2, (Relief("CLOUDS", 0.22, 0.10), Relief("CLOUDS", 0.03, 0.012)))


def _add_coral_knot(group: bpy.types.Collection, place: tuple[float, float, float]) -> None:
    jade = diffuse("Jade", (0.22, 0.48, 0.36))
    shape = torus_knot(3, 4, radius=0.4, swing=0.16, tube=0.085, steps=160, sides=8)
    knot = add(group, "Coral Knot", mesh("Coral Knot", shape, jade), place)
    knot.rotation_euler = (0.0, 0.0, math.radians(-15.0))
    carve(knot, 2, (Relief("VORONOI", 0.06, 0.05),))


def _add_lights(group: bpy.types.Collection) -> None:
    """Add seven spots on the pictures, two panels in the ceiling and two globes over the sculptures."""
    for hanging in HANGINGS:
        x, y, z = hanging.place
        from_wall = 2.2
        away = {0: (0.0, -from_wall), 1: (from_wall, 0.0), 3: (-from_wall, 0.0)}[hanging.quarter_turns]
        spot_light(
            group,
            f"{hanging.name} Spot",
            (x + away[0], y + away[1], SHELL.height - 0.35),
            (x, y, z),
            degrees=54.0 if hanging.height < 2.0 else 72.0,
            blend=0.5,
            watts=190.0 if hanging.height < 2.0 else 380.0,
            colour=WARM,
        )
    for number, y in enumerate((-7.5, 7.5), start=1):
        place = (0.0, y, SHELL.height - 0.05)
        area_light(group, f"Panel {number}", place, size=(2.4, 0.9), watts=160.0, colour=COOL)
    for number, place in enumerate(GLOBES, start=1):
        point_light(group, f"Globe {number}", place, radius=GLOBE_RADIUS, watts=80.0, colour=WARM)
