# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights and shining meshes."""

from __future__ import annotations

import math
from collections.abc import Callable

import bpy
import numpy as np

from .nodes import Maker, add, diffuse, emission, material, mix, node, ramp, set_light_nodes
from .stage import (
    ABOVE,
    GREEN,
    TESTED,
    Case,
    add_object,
    ball_mesh,
    card,
    card_mesh,
    floor,
    image,
    lamp,
    mesh,
    plain,
    room,
    walls,
)

_IES = """IESNA:LM-63-1995
TILT=NONE
1 1000 1 7 1 1 2 0 0 0
1 1 1
0 15 30 45 60 75 90
0
1000 900 650 850 300 50 0
"""
"""Candela by the angle from straight down: bright, with a ring at 45°."""
_PANEL = ((0.2, -0.2, 2.3), (0.2, -0.15, 0.3))
"""Where shining cards hang, and how they are turned: their fronts up, as a mesh's are."""


def _under(make: Callable[[], object]) -> Callable[[], None]:
    """Return what sets up floor and walls, and a light."""

    def build() -> None:
        floor(plain("Floor"))
        walls()
        make()

    return build


def _lamp(kind: str, **settings: object) -> Callable[[], None]:
    return _under(lambda: lamp(kind, TESTED, **settings))


def _lamp_nodes(kind: str, surface: Callable[[], Maker], **settings: object) -> Callable[[], None]:
    return _under(lambda: set_light_nodes(lamp(kind, TESTED, **settings).data, surface()))


def _panel(surface: Callable[[], Maker]) -> Callable[[], None]:
    return _under(lambda: card(material(TESTED, surface()), 0.5, *_PANEL))


def _ies() -> Maker:
    text = bpy.data.texts.new("Profile")
    text.write(_IES)
    return emission((1.0, 0.9, 0.7), node("TexIES", settings={"mode": "INTERNAL", "ies": text}, Strength=0.002))


def _one_sided() -> Maker:
    return mix(node("NewGeometry", "Backfacing"), node("BsdfDiffuse"), emission((4.0, 3.0, 2.0)))


def _image_emission() -> Maker:
    return emission(node("TexImage", settings={"image": image(TESTED)}), 6.0)


def _strengths() -> None:
    """Set up seven cards whose radiance spans six orders of magnitude, the dimmest the largest."""
    for index in range(7):
        angle = 2 * math.pi * index / 7
        half = 0.3 * 10 ** (-index / 4)
        place = (0.9 * math.cos(angle), 0.9 * math.sin(angle), 2.2)
        tint = tuple(0.3 + 0.7 * np.roll([1.0, 0.6, 0.2], index))
        card(material(f"{TESTED} {index}", emission(tint, 0.1 * 10.0**index * 0.02)), half, place, (0.3, 0.0, angle))


def _thousands() -> None:
    """Hang a bumpy sheet of 8,192 triangles that shine."""
    data = card_mesh(0.6, material(TESTED, emission((3.0, 2.0, 1.0))), cuts=64)
    rng = np.random.default_rng(3)
    for vertex in data.vertices:
        vertex.co.z = rng.uniform(-0.03, 0.03)
    add_object(TESTED, data, location=_PANEL[0])


def _half_lit_by_receivers() -> None:
    """Let a strong lamp light the back wall alone."""
    room()
    spot = lamp("POINT", TESTED, (0.0, 0.6, 2.6), energy=80.0)
    chosen = bpy.data.collections.new("Chosen")
    chosen.objects.link(bpy.data.objects["Floor"])
    chosen.collection_objects[0].light_linking.link_state = "EXCLUDE"
    spot.light_linking.receiver_collection = chosen


def _shaded_by_blockers() -> None:
    """Let a card stand in a lamp's light without a shadow."""
    floor(plain("Floor"))
    walls()
    card(plain("Card", GREEN))
    blockers = bpy.data.collections.new("Blockers")
    blockers.objects.link(bpy.data.objects["Floor"])
    lamp("AREA", TESTED).light_linking.blocker_collection = blockers


def _unseen_by_diffuse() -> None:
    room()
    lamp("POINT", TESTED, (-0.6, 0.4, 2.6), energy=100.0).visible_diffuse = False


def _shadowless() -> None:
    room()
    card(plain("Card", GREEN))
    lamp("POINT", TESTED, (-0.5, 0.3, 2.7), energy=40.0, use_shadow=False)


def _linear() -> Maker:
    return emission((1.0, 0.8, 0.6), node("LightFalloff", "Linear", Smooth=0.5))


def _linear_behind_panes() -> None:
    """Let an area lamp that falls off linearly shine through panes of which some light is left."""
    floor(plain("Floor"))
    walls()
    pane = material("Pane", node("BsdfTransparent", Color=(0.9, 0.9, 0.6)))
    for height in (1.9, 2.2):
        add_object(f"Pane {height}", card_mesh(1.0, pane), location=(0.0, 0.0, height))
    set_light_nodes(lamp("AREA", TESTED, energy=30.0).data, _linear())


def _darkening() -> None:
    """Hang a lamp that takes light away beside one that gives more, over a mirror."""
    shiny = node("BsdfGlossy", Color=(0.8, 0.8, 0.8), Roughness=0.4)
    room(material("Floor", mix(0.3, diffuse((0.6, 0.5, 0.4)), shiny)))
    lamp("POINT", TESTED, (-0.8, 0.6, 2.4), energy=-15.0, color=(1.0, 0.6, 0.2))


def _linear_linked() -> None:
    """Let a lamp that falls off linearly shine through a card that casts no shadow in its light."""
    _shaded_by_blockers()
    set_light_nodes(bpy.data.objects[TESTED].data, _linear())


def _instanced_lamps() -> None:
    floor(plain("Floor"))
    walls()
    collection = bpy.data.collections.new("Lamps")
    made = lamp("AREA", TESTED, (0.0, 0.0, 2.5), size=0.4, energy=30.0)
    bpy.context.scene.collection.objects.unlink(made)
    collection.objects.link(made)
    for x in (-0.6, 0.6):
        holder = add_object("Holder", None, location=(x, 0.2, 0.1), rotation_euler=(0.0, 0.3 * x, 0.0))
        holder.instance_type, holder.instance_collection = "COLLECTION", collection


def _ball_light() -> None:
    add_object(TESTED, ball_mesh(0.2, material(TESTED, emission((8.0, 6.0, 5.0)))), location=ABOVE)


def _triangle_light() -> None:
    """Hang two stacked shining triangles, one of them turned over."""
    made = material(TESTED, _one_sided())
    corners = [(-0.5, -0.4, 0.0), (0.5, -0.4, 0.0), (0.0, 0.6, 0.0)]
    add_object(TESTED, mesh("Down", corners, [(0, 2, 1)], made), location=(0.3, 0.2, 2.2))
    add_object(TESTED, mesh("Up", corners, [(0, 1, 2)], made), location=(0.3, 0.2, 2.6))


CASES = (
    Case("light: area disk", _lamp("AREA")),
    Case("light: area with spread 60°", _lamp("AREA", spread=math.radians(60.0), shape="RECTANGLE", size_y=0.4)),
    Case("light: point with radius", _lamp("POINT")),
    Case("light: point, soft falloff off", _lamp("POINT", use_soft_falloff=False)),
    Case("light: spot with blend", _lamp("SPOT", spot_size=1.1, spot_blend=0.5)),
    Case("light: sun of 5°", _lamp("SUN", angle=math.radians(5.0), location=(0.8, -1.0, 2.7))),
    Case("light: exposure, temperature", _lamp("AREA", exposure=0.7, use_temperature=True, temperature=3500.0)),
    Case("light: not normalised", _lamp("AREA", normalize=False, energy=40.0)),
    Case("light: IES profile", _lamp_nodes("POINT", _ies, energy=300.0)),
    Case(
        "light: falloff node, linear", _lamp_nodes("POINT", lambda: emission((1, 1, 1), node("LightFalloff", "Linear")))
    ),
    Case(
        "light: falloff node, constant, smooth",
        _lamp_nodes("POINT", lambda: emission((1, 1, 1), node("LightFalloff", "Constant", Strength=0.5, Smooth=1.0))),
    ),
    Case("light: falloff node, linear, area behind panes", _linear_behind_panes),
    Case("light: falloff node, linked", _linear_linked),
    Case("light: negative", _darkening),
    Case("light: ray length", _lamp_nodes("POINT", lambda: emission((1, 1, 1), node("LightPath", "Ray Length")))),
    Case("light: constant nodes", _lamp_nodes("AREA", lambda: emission((1.0, 0.6, 0.3), 2.0), energy=30.0)),
    Case(
        "light: nodes over the area (UV)",
        _lamp_nodes("AREA", lambda: emission(node("NewGeometry", "Parametric"), 2.0), shape="SQUARE"),
    ),
    Case("light: hidden from diffuse rays", _unseen_by_diffuse),
    Case("light: without shadows", _shadowless),
    Case("light: linked to receivers", _half_lit_by_receivers),
    Case("light: linked to blockers", _shaded_by_blockers),
    Case("light: instances of a lamp", _instanced_lamps),
    Case(
        "light: black by its nodes",
        _under(lambda: (lamp(), set_light_nodes(lamp("POINT", TESTED).data, emission((0, 0, 0))))),
    ),
    Case("mesh light: constant", _panel(lambda: emission((4.0, 3.0, 2.0)))),
    Case("mesh light: ball", _under(_ball_light)),
    Case("mesh light: image", _panel(_image_emission)),
    Case("mesh light: noise", _panel(lambda: emission(node("TexNoise", "Color", Scale=3.0), 6.0))),
    Case(
        "mesh light: gradient",
        _panel(lambda: emission(ramp(node("TexGradient", "Fac"), (0.3, (0.0, 0.0, 0.0)), (0.9, (8.0, 5.0, 2.0))))),
    ),
    Case("mesh light: one-sided by Backfacing", _panel(_one_sided)),
    Case("mesh light: one-sided triangles", _under(_triangle_light)),
    Case("mesh light: strengths over 10⁶", _under(_strengths)),
    Case("mesh light: 8,192 triangles", _under(_thousands)),
    Case("mesh light: mixed with diffuse", _panel(lambda: mix(0.4, emission((6.0, 4.0, 3.0)), node("BsdfDiffuse")))),
    Case("mesh light: added to diffuse", _panel(lambda: add(emission((3.0, 2.0, 1.0)), node("BsdfDiffuse")))),
    Case(
        "mesh light: Light Path camera mix",
        _panel(lambda: mix(node("LightPath", "Is Camera Ray"), emission((4.0, 3.0, 2.0)), emission((0.1, 9.0, 0.1)))),
    ),
    Case("mesh light: blackbody", _panel(lambda: emission(node("Blackbody", Temperature=3000.0), 3.0))),
)
