# SPDX-License-Identifier: GPL-3.0-or-later
"""The lights that are proved one by one: every type and option that Cycles and the bake share.

Each case fills an empty Blender scene with one light above the cells (`proof.CELLS`), and where it says so with a black
plate that casts a shadow into them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import bpy

from .battery.nodes import Colour, Maker, emission, material, node, set_light_nodes, set_world
from .battery.stage import Vec3, add_object, card_mesh

COLOR = (0.9, 0.5, 0.2)
LOCATION = (0.35, -0.25, 2.3)
ROTATION = (0.35, 0.25, 0.6)
SHADING = (0.2, -0.1, 1.85)
TILT = (-0.45, 0.5, 0.42)
ASIDE = (1.4, 1.3, -0.4)
"""Where the plate lies, tiny, when it is to shade nothing but the world; the bake needs some geometry."""
BLACK = (0.0, 0.0, 0.0)
EMISSIVE = (4.0, 1.5, 0.5)


@dataclass(frozen=True)
class LightCase:
    """One light: its name, and what makes its scene."""

    name: str
    build: Callable[[], None]


def light(
    kind: str,
    *,
    plate: bool = False,
    scale: Vec3 = (1.0, 1.0, 1.0),
    nodes: Callable[[], Maker] | None = None,
    **settings: object,
) -> Callable[[], None]:
    """Return what makes a light datablock with some settings, and nodes if they are given."""

    def build() -> None:
        data = bpy.data.lights.new("Light", kind)
        data.color = COLOR
        data.energy = 3.0 if kind == "SUN" else 100.0
        for name, value in settings.items():
            setattr(data, name, value)
        if nodes is not None:
            set_light_nodes(data, nodes())
        add_object("Light", data, location=LOCATION, rotation_euler=ROTATION, scale=scale)
        plate_at(*((0.35, SHADING) if plate else (0.02, ASIDE)))

    return build


def world(*, plate: bool = False) -> Callable[[], None]:
    """Return what makes a world of one colour."""

    def build() -> None:
        set_world("World", node("Background", Color=COLOR, Strength=0.7))
        plate_at(*((0.4, SHADING) if plate else (0.02, ASIDE)))

    return build


def emissive_mesh() -> None:
    """Make a tilted square that shines from both sides."""
    plate_at(0.4, LOCATION, EMISSIVE)


def plate_at(half: float, location: Vec3, radiance: Colour = BLACK) -> None:
    """Make a tilted square of black, or shining, material."""
    add_object("Plate", card_mesh(half, material("Plate", emission(radiance))), location=location, rotation_euler=TILT)


def _places() -> Maker:
    """Shine in other colours from each place of an area light or sphere, into each direction of a point or spot."""
    return emission(node("NewGeometry", "Parametric"), 2.0)


def _blackbody() -> Maker:
    return emission(node("Blackbody", Temperature=3500.0), 1.5)


def _node_cases() -> list[LightCase]:
    sphere = {"shadow_soft_size": 0.25, "use_soft_falloff": False}
    soft = {"shadow_soft_size": 0.25, "use_soft_falloff": True}
    spot = {"spot_size": 1.0, "spot_blend": 0.3}
    oval = {"shape": "ELLIPSE", "size": 0.5, "size_y": 0.9}
    return [
        LightCase("nodes, exact point", light("POINT", nodes=_places, shadow_soft_size=0.0)),
        LightCase("nodes, soft falloff", light("POINT", nodes=_places, **soft)),
        LightCase("nodes, sphere", light("POINT", nodes=_places, **sphere)),
        LightCase("nodes, spot", light("SPOT", nodes=_places, shadow_soft_size=0.0, **spot)),
        LightCase("nodes, spot, soft falloff", light("SPOT", nodes=_places, **soft, **spot)),
        LightCase("nodes, spot, sphere", light("SPOT", nodes=_places, **sphere, **spot)),
        LightCase("nodes, spot, scaled", light("SPOT", nodes=_places, scale=(1.0, 2.0, 1.5), **soft, **spot)),
        LightCase("nodes, area, spread 60°", light("AREA", nodes=_places, spread=math.radians(60.0), **oval)),
        LightCase("nodes, area, scaled", light("AREA", nodes=_places, scale=(2.0, 0.5, 1.0), size=0.4)),
        LightCase("nodes, blackbody spot", light("SPOT", nodes=_blackbody, **soft, **spot)),
        LightCase("nodes, blackbody sun", light("SUN", nodes=_blackbody, angle=math.radians(5.0))),
    ]


def _area_cases() -> list[LightCase]:
    sizes = {
        "RECTANGLE": {"size": 0.5, "size_y": 0.9},
        "SQUARE": {"size": 0.6},
        "DISK": {"size": 0.6},
        "ELLIPSE": {"size": 0.5, "size_y": 0.9},
    }
    return [
        LightCase(
            f"area {shape.lower()}, spread {spread}°",
            light("AREA", shape=shape, spread=math.radians(spread), **size),
        )
        for shape, size in sizes.items()
        for spread in (180, 90, 20)
    ]


def _point_cases() -> list[LightCase]:
    shapes = {
        "exact point": {"shadow_soft_size": 0.0},
        "sphere": {"shadow_soft_size": 0.25, "use_soft_falloff": False},
        "soft falloff": {"shadow_soft_size": 0.25, "use_soft_falloff": True},
    }
    cases = [LightCase(f"point, {name}", light("POINT", **shape)) for name, shape in shapes.items()]
    for name, shape in shapes.items():
        for blend in (0.0, 0.15, 1.0):
            spot = {"spot_size": math.radians(65.0), "spot_blend": blend, **shape}
            cases.append(LightCase(f"spot, {name}, blend {blend:g}", light("SPOT", **spot)))
    return cases


CASES = (
    *_area_cases(),
    *_point_cases(),
    *(LightCase(f"sun, {angle}°", light("SUN", angle=math.radians(angle))) for angle in (0, 5, 60)),
    LightCase("mesh, both sides", emissive_mesh),
    LightCase("world, one colour", world()),
    LightCase(
        "area rectangle, scaled (0.5, 2, 1)",
        light("AREA", shape="RECTANGLE", size=0.5, size_y=0.4, scale=(0.5, 2.0, 1.0)),
    ),
    LightCase("area disk, spread 4°", light("AREA", shape="DISK", size=0.9, spread=math.radians(4.0))),
    LightCase("area disk, parallel", light("AREA", shape="DISK", size=0.9, spread=0.0)),
    LightCase("area square, not normalised", light("AREA", shape="SQUARE", size=0.6, normalize=False, energy=40.0)),
    LightCase(
        "spot, scaled (1, 2, 1.5)",
        light("SPOT", spot_size=1.0, spot_blend=0.4, shadow_soft_size=0.1, scale=(1.0, 2.0, 1.5)),
    ),
    LightCase("point, not normalised", light("POINT", shadow_soft_size=0.25, normalize=False, energy=60.0)),
    LightCase(
        "point, temperature and exposure",
        light("POINT", shadow_soft_size=0.0, use_temperature=True, temperature=3000.0, exposure=-1.5),
    ),
    LightCase("sun, 20°, not normalised", light("SUN", angle=math.radians(20.0), normalize=False)),
    LightCase("area disk, shadow", light("AREA", shape="DISK", size=0.6, plate=True)),
    LightCase("point, exact point, shadow", light("POINT", shadow_soft_size=0.0, plate=True)),
    LightCase("point, soft falloff, shadow", light("POINT", shadow_soft_size=0.25, plate=True)),
    LightCase("point, sphere, shadow", light("POINT", shadow_soft_size=0.25, use_soft_falloff=False, plate=True)),
    LightCase("sun, 5°, shadow", light("SUN", angle=math.radians(5.0), plate=True)),
    LightCase("world, shadow", world(plate=True)),
    LightCase("point, exact point, no shadow", light("POINT", shadow_soft_size=0.0, use_shadow=False, plate=True)),
    *_node_cases(),
)
