# SPDX-License-Identifier: GPL-3.0-or-later
"""Normals by bump and normal maps, and by displacement that only bends them."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from .nodes import Maker, add, diffuse, material, mix, node
from .stage import TESTED, Case, ball, card, room, with_floor

_SAND = (0.8, 0.7, 0.3)
_BLUE = (0.1, 0.2, 0.8)
_PATHS = 4


def _map(strength: float = 1.0, **settings: object) -> Maker:
    """Return a normal map of one colour: the same tilt of 38° everywhere at full strength."""
    return node("NormalMap", settings=settings, Color=(0.8, 0.4, 0.9), Strength=strength)


def _rough_map(strength: float = 0.35) -> Maker:
    """Return a normal map of noise."""
    return node("NormalMap", Color=node("TexNoise", "Color", Scale=6.0), Strength=strength)


def _bump(distance: float = 0.15, scale: float = 6.0, **inputs: Maker) -> Maker:
    """Return bumps of noise."""
    return node("Bump", Height=node("TexNoise", Scale=scale), Distance=distance, **inputs)


def _ramp(slope: float = 0.5) -> Maker:
    """Return bumps of one slope."""
    height = node("SeparateXYZ", "X", Vector=node("NewGeometry", "Position"))
    return node("Bump", Height=height, Distance=slope)


def _bsdf(kind: str, normal: Maker, **inputs: object) -> Maker:
    return node(f"Bsdf{kind}", Normal=normal, **inputs)


def _displaced(scale: float) -> Callable[[], object]:
    """Return what makes a floor bent by its material's displacement, on a mesh of another scale."""

    def build() -> None:
        made = material(TESTED, diffuse(_SAND))
        tree = made.node_tree
        bend = node("Displacement", Height=node("TexNoise", Scale=6.0, Vector=node("TexCoord", "Object")), Scale=0.15)
        tree.links.new(bend(tree), tree.get_output_node("CYCLES").inputs["Displacement"])
        room(made)
        shown = bpy.data.objects[TESTED]
        shown.data.transform(shown.matrix_world.to_3x3().to_4x4() * (1.0 / scale))
        shown.scale = (scale,) * 3

    return build


def _on_ball(surface: Maker) -> Callable[[], object]:
    def build() -> None:
        room()
        ball(material(TESTED, surface))

    return build


def _from_behind(surface: Maker) -> Callable[[], object]:
    """Return what makes a room with a card whose back is lit."""

    def build() -> None:
        room()
        card(material(TESTED, surface), rotation=(3.3, 0.4, 0.2))

    return build


CASES = (
    Case("bump: normal map, one tilt", with_floor(_bsdf("Diffuse", _map(), Color=_SAND))),
    Case("bump: normal map of noise", with_floor(_bsdf("Diffuse", _rough_map(), Color=_SAND))),
    Case("bump: one slope", with_floor(_bsdf("Diffuse", _ramp(), Color=_SAND))),
    Case("bump: noise", with_floor(_bsdf("Diffuse", _bump(), Color=_SAND))),
    Case("bump: noise, rough diffuse", with_floor(_bsdf("Diffuse", _bump(), Color=_SAND, Roughness=0.8))),
    Case("bump: on a normal map", with_floor(_bsdf("Diffuse", _bump(0.1, Normal=_map(0.4)), Color=_SAND))),
    Case("bump: displacement, bump only", _displaced(1.0)),
    Case("bump: displacement, bump only, scaled", _displaced(2.5)),
    Case(
        "bump: Principled, normal map", with_floor(_bsdf("Principled", _rough_map(), Base_Color=_SAND, Roughness=0.4))
    ),
    Case(
        "bump: Principled metal, bump",
        with_floor(_bsdf("Principled", _bump(0.08), Base_Color=_SAND, Metallic=1.0, Roughness=0.4)),
        paths=_PATHS,
    ),
    Case(
        "bump: Principled, coat over bumps",
        with_floor(_bsdf("Principled", _bump(0.1), Base_Color=_SAND, Roughness=0.5, Coat_Weight=1.0)),
        paths=_PATHS,
    ),
    Case(
        "bump: Principled, bumps of the coat",
        with_floor(
            node("BsdfPrincipled", Base_Color=_SAND, Coat_Weight=1.0, Coat_Roughness=0.4, Coat_Normal=_bump(0.08))
        ),
        paths=_PATHS,
    ),
    Case(
        "bump: glossy, rough, one tilt",
        with_floor(_bsdf("Glossy", _map(0.5), Color=_SAND, Roughness=0.6)),
        paths=_PATHS,
    ),
    Case(
        "bump: glossy, normal map", with_floor(_bsdf("Glossy", _rough_map(), Color=_SAND, Roughness=0.3)), paths=_PATHS
    ),
    Case("bump: mirror, bump", with_floor(_bsdf("Glossy", _bump(0.02), Color=_SAND, Roughness=0.05)), paths=_PATHS),
    Case(
        "bump: in a mix by Fresnel",
        with_floor(
            mix(
                node("LayerWeight", "Fresnel", Blend=0.6),
                _bsdf("Diffuse", _bump(), Color=_SAND),
                _bsdf("Glossy", _bump(), Color=(0.8, 0.8, 0.8), Roughness=0.5),
            )
        ),
        paths=_PATHS,
    ),
    Case(
        "bump: two normals in a mix",
        with_floor(mix(0.5, _bsdf("Diffuse", _map(), Color=_SAND), _bsdf("Diffuse", _bump(), Color=_BLUE))),
    ),
    Case(
        "bump: added to plain",
        with_floor(add(diffuse((0.2, 0.3, 0.2)), _bsdf("Glossy", _bump(0.08), Color=(0.5, 0.5, 0.5), Roughness=0.5))),
        paths=_PATHS,
    ),
    Case("bump: translucent card", _from_behind(_bsdf("Translucent", _map(0.5), Color=_SAND))),
    Case("bump: on a smooth ball", _on_ball(_bsdf("Diffuse", _bump(0.1, 10.0), Color=_SAND))),
    Case("bump: sheen", with_floor(_bsdf("Sheen", _bump(), Color=_SAND))),
    Case("bump: seen from behind, map", _from_behind(_bsdf("Diffuse", _map(0.5), Color=_SAND))),
    Case("bump: seen from behind, slope", _from_behind(_bsdf("Diffuse", _ramp(), Color=_SAND))),
    Case("bump: glass", _on_ball(_bsdf("Glass", _bump(0.05, 10.0), Roughness=0.2, IOR=1.4)), paths=16),
)
