# SPDX-License-Identifier: GPL-3.0-or-later
"""Light that mirrors and glass throw: Cycles finds it where its paths meet the lamp, so lamps are large."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from .nodes import Maker, material, node
from .stage import TESTED, Case, add_object, ball, box_mesh, card, floor, lamp, plain, walls

_PATHS = 8
_MIRROR = node("BsdfAnisotropic", Color=(0.95, 0.9, 0.85), Roughness=0.0)
_GLASS = node("BsdfGlass", Color=(1.0, 1.0, 1.0), Roughness=0.0, IOR=1.5)


def _scene(hang: Callable[[bpy.types.Material], object], surface: Maker, **switches: bool) -> Callable[[], None]:
    """Return what lights a thing from the side, so that its light falls where no other does."""

    def build() -> None:
        floor(plain("Floor"))
        walls()
        lamp("AREA", location=(1.0, -1.6, 2.4), aim=(0.0, 0.0, 2.0), size=0.9)
        hang(material(TESTED, surface))
        for name, value in switches.items():
            setattr(bpy.context.scene.cycles, name, value)

    return build


def _slab(made: bpy.types.Material) -> None:
    add_object(TESTED, box_mesh((0.9, 0.9, 0.2), made), location=(0.0, -0.3, 1.9), rotation_euler=(0.6, 0.3, 0.0))


def _mirror(made: bpy.types.Material) -> None:
    card(made, 0.5, (-0.3, 0.4, 1.95), (0.4, 0.2, 0.0))


def _ball(made: bpy.types.Material) -> None:
    ball(made, 0.4, (0.0, -0.2, 1.95))


def _absorbing() -> Maker:
    return node("BsdfGlass", Color=(0.9, 0.4, 0.2), Roughness=0.05, IOR=1.5)


CASES = (
    Case("caustic: mirror", _scene(_mirror, _MIRROR), _PATHS),
    Case("caustic: glass ball", _scene(_ball, _GLASS), _PATHS),
    Case("caustic: glass slab", _scene(_slab, _GLASS), _PATHS),
    Case("caustic: coloured rough glass", _scene(_ball, _absorbing()), _PATHS),
    Case("caustic: reflective ones off, mirror", _scene(_mirror, _MIRROR, caustics_reflective=False)),
    Case("caustic: refractive ones off, glass", _scene(_ball, _GLASS, caustics_refractive=False)),
    Case(
        "caustic: all off, Principled",
        _scene(_mirror, node("BsdfPrincipled", Roughness=0.2), caustics_reflective=False, caustics_refractive=False),
    ),
)
