# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that add a grid's light to what a BSDF reflects: L = ρ/π E beside it, as emission.

ρ is what of even light the BSDF's diffuse lobes send towards the viewer. Of a Principled BSDF, seen at a cosine μ to
its normal, that is

    ρ(μ) = alpha ((1 − metallic)(1 − transmission) base (1 − R(μ)) C(μ) + sheen R_s(μ))

with the layers of `core/principled.py`. Their tables R are replaced by

    R = f₀ (1 + a₁ r + (a₂ r + a₃ r²) μ) + (1 − f₀) B          r: the roughness, η: the index of refraction
    B = (1 − μ)^(c₀ + c₁ r + c₂ r² + c₃ η) (b₀ + b₁ r + b₂ r²) / (1 + (d₁ r + d₂ r²) μ)

fitted to them for η from 1.25 to 2, weighted mostly by cosine. The share that the layers leave, all directions
together, comes out within 0.009 (0.006 for roughnesses from 0.2 on); that of single directions, weighted by cosine,
within 0.014 (root mean square).

The light is seen by camera rays, and by rays that have met nothing but mirrors and glass since. To rays that were
diffusely reflected, and to those that ask an emitting surface for its light, it is not there: E holds what those find.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import bpy

from .irradiance_formula import BESIDE, OPEN, WALLS
from .node_formulas import Number, Socket
from .shader_maths import ShaderMaths

KEY = "ivg_light_group"
VERSION = 3
"""Of the nodes; those of another version stay with the materials that have them, until light is added again."""
_LOOK_UP = {OPEN: "Color", BESIDE: "Color", WALLS: "Float"}
"""What groups are told of irradiance: outputs of the look-up (irradiance_formula.py)."""

_MIRROR = {"a": (-0.1061, 0.5244, -1.1527), "b": (0.9750, -2.1528, 1.2629), "c": (6.2497, -9.1755, 6.3078, -0.8075)}
_SPREAD = (-0.3151, 6.8161)
"""a₁ …, b₀ …, c₀ …; and d₁, d₂."""
_SEEN_BY = ("Is Camera Ray", "Is Glossy Ray", "Is Transmission Ray", "Is Volume Scatter Ray")
_FLOATS = (
    *("Metallic", "Roughness", "IOR", "Alpha", "Diffuse Roughness", "Specular IOR Level", "Transmission Weight"),
    *("Coat Weight", "Coat Roughness", "Coat IOR", "Sheen Weight", "Sheen Roughness"),
)
_COLOURS = ("Base Color", "Specular Tint", "Coat Tint", "Sheen Tint")


def light_group(kind: str) -> bpy.types.ShaderNodeTree:
    """Return the group for a kind of BSDF, a key of `INPUTS`: the one that the file has, or a new one."""
    about = {"kind": kind, "version": VERSION}
    groups = (group for group in bpy.data.node_groups if not group.library and KEY in group)
    found = next((group for group in groups if group[KEY].to_dict() == about), None)
    if found is None:
        found = bpy.data.node_groups.new(f"IVG {kind.title()} Light", "ShaderNodeTree")
        _FILLERS[kind](ShaderMaths(found))
        found[KEY] = about
    return found


def is_light_group(group: bpy.types.NodeTree) -> bool:
    """Tell whether a node group is one of these."""
    return KEY in group


INPUTS: dict[str, tuple[str, ...]] = {
    "DIFFUSE": ("Color", "Roughness"),
    "SHEEN": ("Color", "Roughness", "Normal"),
    "PRINCIPLED": (*_FLOATS, *_COLOURS, "Normal"),
}
"""By kind, what a group is to be told of the BSDF: the names of the inputs of both."""


def _fill_diffuse(maths: ShaderMaths) -> None:
    into = maths.inputs({"BSDF": "Shader"} | _LOOK_UP | {"Color": "Color", "Roughness": "Float"})
    _shine(maths, into, _rough(maths, into["Color"], into["Roughness"]))


def _fill_sheen(maths: ShaderMaths) -> None:
    into = maths.inputs({"BSDF": "Shader"} | _LOOK_UP | {"Color": "Color", "Roughness": "Float", "Normal": "Vector"})
    reflected = _sheen(maths, _cosine(maths, into["Normal"]), into["Roughness"])
    _shine(maths, into, maths.scaled(into["Color"], reflected))


def _fill_principled(maths: ShaderMaths) -> None:
    kinds = {"BSDF": "Shader"} | _LOOK_UP | {"Normal": "Vector"}
    into = maths.inputs(kinds | dict.fromkeys(_COLOURS, "Color") | dict.fromkeys(_FLOATS, "Float"))
    cosine = _cosine(maths, into["Normal"])
    normal_reflectance, index = _facets(maths, into["IOR"], into["Specular IOR Level"])
    tinted = _least(maths, maths.math("MULTIPLY", normal_reflectance, _largest(maths, into["Specular Tint"])), 1.0)
    specular = _layer(maths, cosine, tinted, index, into["Roughness"])
    below = maths.math(
        "MULTIPLY",
        maths.math("MULTIPLY", _rest(maths, into["Metallic"]), _rest(maths, into["Transmission Weight"])),
        _rest(maths, specular),
    )
    fuzz = _sheen(maths, cosine, into["Sheen Roughness"])
    sheen = maths.scaled(into["Sheen Tint"], maths.math("MULTIPLY", into["Sheen Weight"], fuzz))
    below = maths.math("MULTIPLY", below, _rest(maths, _largest(maths, sheen)))
    body = maths.scaled(_rough(maths, into["Base Color"], into["Diffuse Roughness"]), below)
    body = maths.vector("MULTIPLY", body, _coat(maths, into, cosine))
    _shine(maths, into, maths.scaled(maths.vector("ADD", body, sheen), into["Alpha"]))


_FILLERS: dict[str, Callable[[ShaderMaths], None]] = {
    "DIFFUSE": _fill_diffuse,
    "SHEEN": _fill_sheen,
    "PRINCIPLED": _fill_principled,
}


def _shine(maths: ShaderMaths, into: dict[str, Socket], reflectance: Socket) -> None:
    """Put out the BSDF and the light.

    Where it is not seen it is mixed with nothing; the two ways to look it up are mixed as shaders. Cycles computes no
    shader that is mixed in with a weight of 0.
    """
    path = maths.node("ShaderNodeLightPath", {})
    seen: Number = 0.0
    for name in _SEEN_BY:
        seen = maths.math("MAXIMUM", seen, path.outputs[name])
    seen = maths.math("MULTIPLY", seen, maths.math("LESS_THAN", path.outputs["Diffuse Depth"], 0.5))
    positive = maths.vector("MAXIMUM", reflectance, (0.0, 0.0, 0.0))

    def light(irradiance: Socket) -> Socket:
        colour = maths.vector("MULTIPLY", positive, irradiance)
        return maths.value("ShaderNodeEmission", colour, 1.0 / math.pi)

    lit = maths.value("ShaderNodeMixShader", into[WALLS], light(into[OPEN]), light(into[BESIDE]))
    shown = maths.node("ShaderNodeMixShader", {0: seen, 2: lit})
    both = maths.node("ShaderNodeAddShader", {0: into["BSDF"], 1: shown.outputs[0]})
    maths.outputs({"BSDF": ("Shader", both.outputs[0])})


def _cosine(maths: ShaderMaths, given: Socket) -> Socket:
    """Return μ, that of the angle between the direction of view and the normal: a given one, or the surface's own."""
    geometry = maths.node("ShaderNodeNewGeometry", {})
    absent = maths.math("LESS_THAN", maths.length(given), 1e-6)
    normal = maths.vector("NORMALIZE", maths.vector("ADD", given, maths.scaled(geometry.outputs["Normal"], absent)))
    return _least(maths, maths.math("ABSOLUTE", maths.dot(geometry.outputs["Incoming"], normal)), 1.0)


def _rough(maths: ShaderMaths, colour: Socket, roughness: Socket) -> Socket:
    """Return the albedo of a diffuse lobe of any roughness: `principled.oren_nayar_share` times the colour."""
    spread = maths.math("DIVIDE", 1.0, maths.math("MULTIPLY_ADD", roughness, math.pi / 2 - 2 / 3, math.pi))
    once = maths.math("MULTIPLY", spread, maths.math("MULTIPLY_ADD", roughness, (2 * math.pi - 5.6) / 3, math.pi))
    again = _rest(maths, once)
    within = maths.vector("MINIMUM", maths.vector("MAXIMUM", colour, (0.0,) * 3), (1.0,) * 3)
    left = maths.vector("SUBTRACT", (1.0,) * 3, maths.scaled(within, again))
    more = maths.vector("DIVIDE", maths.vector("MULTIPLY", within, within), left)
    share = maths.vector("ADD", maths.scaled(more, again), (1.0,) * 3)
    return maths.vector("MULTIPLY", colour, maths.scaled(share, once))


def _facets(maths: ShaderMaths, ior: Socket, level: Socket) -> tuple[Socket, Socket]:
    """Return f₀ before its tint and η ≥ 1: `principled.normal_reflectance`."""
    plain = maths.math("MAXIMUM", ior, 1e-5)
    root = maths.math("DIVIDE", maths.math("SUBTRACT", plain, 1.0), maths.math("ADD", plain, 1.0))
    twice = maths.math("MULTIPLY", maths.math("MAXIMUM", level, 0.0), 2.0)
    adjusted = maths.math("MULTIPLY", maths.math("MULTIPLY", root, root), twice)
    edge = maths.math("SQRT", _least(maths, adjusted, 0.99))
    return adjusted, maths.math("DIVIDE", maths.math("ADD", edge, 1.0), _rest(maths, edge))


def _layer(maths: ShaderMaths, cosine: Socket, f0: Socket, eta: Socket, roughness: Socket) -> Socket:
    """Return R of the equation above; nothing where there is nothing to reflect."""
    (a1, a2, a3), b, c = _MIRROR["a"], _MIRROR["b"], _MIRROR["c"]
    d1, d2 = _SPREAD

    def polynomial(*coefficients: float) -> Socket:
        value: Number = coefficients[-1]
        for coefficient in reversed(coefficients[:-1]):
            value = maths.math("MULTIPLY_ADD", value, roughness, coefficient)
        assert not isinstance(value, float)
        return value

    head_on = maths.math("MULTIPLY_ADD", polynomial(0.0, a2, a3), cosine, polynomial(1.0, a1))
    exponent = maths.math("MULTIPLY_ADD", eta, c[3], polynomial(*c[:3]))
    narrow = maths.math("POWER", _rest(maths, cosine), exponent)
    spread = maths.math("MULTIPLY_ADD", polynomial(0.0, d1, d2), cosine, 1.0)
    grazing = maths.math("DIVIDE", maths.math("MULTIPLY", narrow, polynomial(*b)), spread)
    mixed = maths.math("MULTIPLY_ADD", f0, maths.math("SUBTRACT", head_on, grazing), grazing)
    there = maths.math("GREATER_THAN", eta, 1.0 + 1e-4)
    return maths.math("MULTIPLY", _least(maths, maths.math("MAXIMUM", mixed, 0.0), 1.0), there)


def _coat(maths: ShaderMaths, into: dict[str, Socket], cosine: Socket) -> Socket:
    """Return what the coat lets through, per channel: `principled.through_coat`, without the sheen."""
    ior = maths.math("MAXIMUM", into["Coat IOR"], 1.0)
    root = maths.math("DIVIDE", maths.math("SUBTRACT", ior, 1.0), maths.math("ADD", ior, 1.0))
    f0 = maths.math("MULTIPLY", root, root)
    reflected = _layer(maths, cosine, f0, ior, into["Coat Roughness"])
    left = _rest(maths, maths.math("MULTIPLY", into["Coat Weight"], reflected))
    bent = maths.math("DIVIDE", maths.math("MULTIPLY_ADD", cosine, cosine, -1.0), maths.math("MULTIPLY", ior, ior))
    longer = maths.math("INVERSE_SQRT", maths.math("MAXIMUM", maths.math("ADD", bent, 1.0), 1e-6))
    absorbed = maths.vector("POWER", into["Coat Tint"], maths.combined(longer, longer, longer))
    tinted = maths.scaled(maths.vector("SUBTRACT", absorbed, (1.0,) * 3), into["Coat Weight"])
    return maths.scaled(maths.vector("ADD", tinted, (1.0,) * 3), left)


def _sheen(maths: ShaderMaths, cosine: Socket, roughness: Socket) -> Socket:
    """Return R_s of `core/sheen.py`."""
    r = maths.math("MAXIMUM", roughness, 1e-3)

    def polynomial(*coefficients: float) -> Socket:
        value = maths.math("MULTIPLY_ADD", r, coefficients[-1], coefficients[-2])
        for coefficient in reversed(coefficients[:-2]):
            value = maths.math("MULTIPLY_ADD", value, r, coefficient)
        return value

    width = maths.math("DIVIDE", polynomial(0.0, 0.0206607, 1.58491), polynomial(0.0379424, 1.32227, 1.0))
    middle = polynomial(0.0, -0.193854, -1.14885, 1.7932, 0.0, -0.95943)
    middle = maths.math("DIVIDE", middle, maths.math("ADD", r, 0.046391))
    floor = maths.math("DIVIDE", polynomial(0.0, 0.000654023, -0.0207818, 0.119681), polynomial(1.26264, -1.92021, 1.0))
    off = maths.math("DIVIDE", maths.math("SUBTRACT", cosine, middle), width)
    bell = maths.math("EXPONENT", maths.math("MULTIPLY", maths.math("MULTIPLY", off, off), -0.5))
    bell = maths.math("DIVIDE", bell, maths.math("MULTIPLY", width, math.sqrt(2.0 * math.pi)))
    return _least(maths, maths.math("MAXIMUM", maths.math("ADD", bell, floor), 0.0), 1.0)


def _rest(maths: ShaderMaths, share: Socket) -> Socket:
    """Return 1 − share, at least 0."""
    return maths.math("MAXIMUM", maths.math("SUBTRACT", 1.0, share), 0.0)


def _least(maths: ShaderMaths, value: Socket, most: float) -> Socket:
    return maths.math("MINIMUM", value, most)


def _largest(maths: ShaderMaths, colour: Socket) -> Socket:
    """Return the largest channel of a colour, at least 0."""
    red, green, blue = maths.separated(colour)
    return maths.math("MAXIMUM", maths.math("MAXIMUM", red, green), maths.math("MAXIMUM", blue, 0.0))
