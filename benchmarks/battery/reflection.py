# SPDX-License-Identifier: GPL-3.0-or-later
"""One kind of reflection or transmission each: the floor and a card, or a ball, of it."""

from __future__ import annotations

import bpy

from .nodes import Colour, Maker, Tree, Value, add, diffuse, emission, material, mix, node
from .stage import (
    ABOVE,
    TESTED,
    TILT,
    Case,
    add_object,
    card_mesh,
    image,
    plain,
    room,
    with_ball,
    with_card,
    with_floor,
    with_floor_and_card,
    with_turned_floor,
)

_CLOTH = (0.7, 0.4, 0.2)
_DEPTH = node("LightPath", "Ray Depth")
_SPECULAR = 6
_GLASS = (0.9, 0.95, 1.0)


def _principled(**inputs: Value) -> Maker:
    return node("BsdfPrincipled", **{"Base_Color": _CLOTH, **inputs})


def _glossy(roughness: float) -> Maker:
    return node("BsdfAnisotropic", Color=(0.9, 0.8, 0.6), Roughness=roughness, settings={"distribution": "GGX"})


def _conductor(roughness: float) -> Maker:
    """Return a metal of a dark red, its reflectance far from Schlick's in green."""
    index = {"IOR": (2.9, 1.2, 0.3), "Extinction": (3.1, 0.9, 2.4)}
    return node("BsdfMetallic", settings={"fresnel_type": "PHYSICAL_CONDUCTOR"}, Roughness=roughness, **index)


def _ggx() -> Maker:
    return node("BsdfPrincipled", settings={"distribution": "GGX"}, Base_Color=_CLOTH, Metallic=0.6, Roughness=0.7)


def _coated_screen() -> Maker:
    return _principled(
        Coat_Weight=1.0, Coat_Tint=(0.9, 0.4, 0.3), Emission_Color=(1.0, 0.8, 0.6), Emission_Strength=30.0
    )


def _grouped(surface: Maker) -> Maker:
    """Return a surface inside a node group."""

    def make(tree: Tree) -> bpy.types.NodeSocket:
        group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
        group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
        group.links.new(surface(group), group.nodes.new("NodeGroupOutput").inputs[0])
        holder = tree.nodes.new("ShaderNodeGroup")
        holder.node_tree = group
        return holder.outputs[0]

    return make


def _muted(surface: Maker) -> Maker:
    """Return a Mix Shader that is switched off, so that its first surface counts."""

    def make(tree: Tree) -> bpy.types.NodeSocket:
        socket = mix(0.5, surface, emission((9.0, 9.0, 9.0)))(tree)
        socket.node.mute = True
        return socket

    return make


def _texture(output: str, alpha: bool = False) -> Maker:
    """Return a socket of an image texture that is made with the tree."""
    return lambda tree: node("TexImage", output, {"image": image(TESTED, alpha=alpha), "interpolation": "Closest"})(
        tree
    )


def _number() -> Maker:
    """Return 0 or 1 by a texture."""
    return _texture("Alpha", alpha=True)


def _fresnel() -> Maker:
    return node("Fresnel", IOR=1.6)


def _facing(output: str) -> Maker:
    return node("LayerWeight", output, Blend=0.4)


def _rough(kind: str, roughness: float, colour: Colour = _GLASS) -> Maker:
    return node(kind, Color=colour, Roughness=roughness, IOR=1.45)


def _half_shadowless() -> None:
    """Hang a card of four faces, two of which cast no shadow."""
    room()
    made = card_mesh(0.6, plain(TESTED, _CLOTH), cuts=2, name=TESTED)
    clear = node("BsdfTransparent")
    made.materials.append(material(TESTED, mix(node("LightPath", "Is Shadow Ray"), diffuse(_CLOTH), clear)))
    made.polygons.foreach_set("material_index", [0, 1, 1, 0])
    add_object(TESTED, made, location=ABOVE, rotation_euler=TILT)


CASES = (
    Case("surface: Diffuse", with_floor_and_card(diffuse(_CLOTH))),
    Case("surface: Diffuse, roughness 1", with_floor_and_card(diffuse(_CLOTH, 1.0))),
    Case("surface: Principled as added", with_floor_and_card(node("BsdfPrincipled"))),
    Case("surface: Principled, no specular", with_floor_and_card(_principled(Specular_IOR_Level=0.0))),
    Case("surface: Principled, specular 1", with_floor_and_card(_principled(Specular_IOR_Level=1.0, Roughness=0.3))),
    Case("surface: Principled, metallic 1, rough 0.3", with_floor_and_card(_principled(Metallic=1.0, Roughness=0.3))),
    Case("surface: Principled, metallic by image", with_floor_and_card(_principled(Metallic=_number(), Roughness=0.4))),
    Case("surface: Principled, roughness by image", with_floor(_principled(Metallic=0.5, Roughness=_texture("Color")))),
    Case("surface: Principled, coat", with_floor_and_card(_principled(Coat_Weight=1.0, Coat_Tint=(0.9, 0.6, 0.5)))),
    Case("surface: Principled, sheen", with_floor_and_card(_principled(Sheen_Weight=1.0, Sheen_Roughness=0.4))),
    Case("surface: Principled, diffuse roughness 1", with_floor_and_card(_principled(Diffuse_Roughness=1.0))),
    Case(
        "surface: Principled, transmission rough 0",
        with_ball(_principled(Transmission_Weight=1.0, Roughness=0.0)),
        paths=_SPECULAR,
    ),
    Case(
        "surface: Principled, transmission rough 0.5",
        with_ball(_principled(Transmission_Weight=1.0, Roughness=0.5)),
        paths=_SPECULAR,
    ),
    Case(
        "surface: Principled, half transmission",
        with_ball(_principled(Transmission_Weight=0.5, Roughness=0.2)),
        paths=_SPECULAR,
    ),
    Case(
        "surface: Principled, subsurface",
        with_ball(_principled(Subsurface_Weight=1.0, Subsurface_Scale=0.05, Subsurface_Radius=(1.0, 0.4, 0.2))),
    ),
    Case(
        "surface: Principled, thin wall",
        with_card(_principled(Transmission_Weight=0.8, Thin_Wall=True)),
        paths=_SPECULAR,
    ),
    Case(
        "surface: Principled, thin wall, clear",
        with_card(_principled(Transmission_Weight=1.0, Thin_Wall=True, Roughness=0.0)),
        paths=_SPECULAR,
    ),
    Case("surface: Principled, GGX", with_floor_and_card(_ggx())),
    Case(
        "surface: Principled, specular tint", with_floor_and_card(_principled(Specular_Tint=(1.0, 0.3, 0.1), IOR=2.0))
    ),
    Case("surface: Principled, coat over emission", with_card(_coated_screen())),
    Case(
        "surface: Principled, emission", with_card(_principled(Emission_Color=(1.0, 0.6, 0.3), Emission_Strength=30.0))
    ),
    Case("surface: Principled, anisotropic", with_floor(_principled(Metallic=1.0, Anisotropic=0.8, Roughness=0.4))),
    Case("surface: Principled, thin film", with_floor(_principled(Thin_Film_Thickness=500.0, Roughness=0.2))),
    Case("surface: Principled, alpha 0.5", with_card(_principled(Alpha=0.5))),
    Case("surface: Principled, alpha by image", with_card(_principled(Alpha=_number()))),
    Case("surface: Glossy, rough 0", with_floor_and_card(_glossy(0.0)), paths=_SPECULAR),
    Case("surface: Glossy, rough 0.2", with_floor_and_card(_glossy(0.2))),
    Case("surface: Glossy, rough 0.8", with_floor_and_card(_glossy(0.8))),
    Case("surface: Metallic BSDF", with_floor_and_card(node("BsdfMetallic", Roughness=0.3))),
    Case(
        "surface: Metallic BSDF, tinted edge",
        with_floor_and_card(node("BsdfMetallic", Roughness=0.8, Base_Color=(0.8, 0.7, 0.5), Edge_Tint=(0.0, 0.2, 0.9))),
    ),
    Case("surface: Metallic BSDF, by its index", with_floor_and_card(_conductor(0.8))),
    Case(
        "surface: Principled, metal of tinted edge",
        with_floor_and_card(_principled(Metallic=1.0, Roughness=0.7, Specular_Tint=(0.0, 0.3, 1.0))),
    ),
    Case("surface: Sheen BSDF", with_floor_and_card(node("BsdfSheen", Color=_CLOTH, Roughness=0.5))),
    Case("surface: Toon", with_floor(node("BsdfToon", Color=_CLOTH, Size=0.5, Smooth=0.2))),
    Case("surface: Subsurface Scattering", with_ball(node("SubsurfaceScattering", Color=_CLOTH, Scale=0.05))),
    Case("surface: Glass, ball", with_ball(_rough("BsdfGlass", 0.0)), paths=_SPECULAR),
    Case("surface: Glass, rough 0.4", with_ball(_rough("BsdfGlass", 0.4)), paths=_SPECULAR),
    Case("surface: Glass, card", with_card(_rough("BsdfGlass", 0.0)), paths=_SPECULAR),
    Case("surface: Refraction, rough 0.1", with_ball(_rough("BsdfRefraction", 0.1)), paths=_SPECULAR),
    Case("surface: Translucent", with_floor_and_card(node("BsdfTranslucent", Color=_CLOTH))),
    Case("surface: Transparent, coloured", with_card(node("BsdfTransparent", Color=(0.8, 0.3, 0.1)))),
    Case("mix: diffuse and glossy, 0.4", with_floor_and_card(mix(0.4, diffuse(_CLOTH), _glossy(0.2)))),
    Case("mix: diffuse and glossy, Fresnel", with_floor_and_card(mix(_fresnel(), diffuse(_CLOTH), _glossy(0.1)))),
    Case("mix: diffuse and glossy, Facing", with_floor_and_card(mix(_facing("Facing"), diffuse(_CLOTH), _glossy(0.1)))),
    Case(
        "mix: diffuse and glossy, Layer Weight Fresnel",
        with_floor(mix(_facing("Fresnel"), diffuse(_CLOTH), _glossy(0.1))),
    ),
    Case(
        "mix: by Fresnel times an image",
        with_floor(
            mix(
                node("Math", settings={"operation": "MULTIPLY"}, Value=node("Fresnel", IOR=2.0), Value_001=_number()),
                diffuse(_CLOTH),
                _glossy(0.3),
            )
        ),
    ),
    Case("mix: two colours by image", with_floor_and_card(mix(_number(), diffuse(_CLOTH), diffuse((0.1, 0.3, 0.8))))),
    Case("mix: diffuse and transparent by image", with_card(mix(_number(), node("BsdfTransparent"), diffuse(_CLOTH)))),
    Case("mix: diffuse and transparent, 0.5", with_card(mix(0.5, node("BsdfTransparent"), diffuse(_CLOTH)))),
    Case("mix: diffuse and translucent, 0.5", with_card(mix(0.5, node("BsdfTranslucent"), diffuse(_CLOTH)))),
    Case(
        "mix: colours by Backfacing",
        with_turned_floor(mix(node("NewGeometry", "Backfacing"), diffuse(_CLOTH), diffuse((0.1, 0.3, 0.8)))),
    ),
    Case(
        "mix: shadowless by Light Path",
        with_card(mix(node("LightPath", "Is Shadow Ray"), diffuse(_CLOTH), node("BsdfTransparent"))),
    ),
    Case(
        "mix: glass without shadow",
        with_ball(mix(node("LightPath", "Is Shadow Ray"), node("BsdfGlass", IOR=1.4), node("BsdfTransparent"))),
        paths=_SPECULAR,
    ),
    Case("mix: half of a mesh without shadow", _half_shadowless),
    Case(
        "mix: by Light Path, ray depth",
        with_floor(diffuse(node("Math", settings={"operation": "MULTIPLY"}, Value=0.4, Value_001=_DEPTH))),
    ),
    Case("mix: factor above 1", with_card(mix(1.7, diffuse(_CLOTH), diffuse((0.1, 0.3, 0.8))))),
    Case("mix: in a node group", with_floor(_grouped(mix(0.3, diffuse(_CLOTH), diffuse((0.1, 0.3, 0.8)))))),
    Case("mix: muted", with_floor(_muted(diffuse(_CLOTH)))),
    Case("mix: diffuse added to diffuse, above 1", with_card(add(diffuse((0.8, 0.8, 0.8)), diffuse((0.7, 0.1, 0.1))))),
    Case("mix: nothing in the second place", with_floor(node("MixShader", Fac=0.4, Shader=diffuse(_CLOTH)))),
    Case("mix: black, negative light", with_card(emission((2.0, 1.0, 1.0), -1.0))),
    Case("mix: diffuse added to glossy", with_floor(add(diffuse((0.3, 0.2, 0.1)), _glossy(0.3)))),
    Case(
        "mix: emission and diffuse by Fresnel",
        with_card(mix(_fresnel(), diffuse(_CLOTH), emission((40.0, 30.0, 20.0)))),
    ),
    Case(
        "surface: Emission by facing",
        with_card(emission(node("LayerWeight", "Facing", Blend=0.5), 30.0)),
    ),
    Case(
        "mix: emission and diffuse by image", with_card(mix(_number(), diffuse(_CLOTH), emission((40.0, 30.0, 20.0))))
    ),
)
