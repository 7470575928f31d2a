# SPDX-License-Identifier: GPL-3.0-or-later
"""Closures made into lobes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from .closures import Caustics, Closure, Float64, Values, usable_index
from .metals import conductor_edge, conductor_reflectance, tinted_edge
from .principled import COSINE_WEIGHTS, COSINES
from .principled_lobes import shade_principled
from .scene import DIELECTRIC, GLASS, GLOSSY, MATTE, NONE, REFRACTION, SCHLICK, TRANSLUCENT, TRANSPARENT
from .shading import Lobe, Shading, merged, sheen_lobe

_COLOURED = {
    **dict.fromkeys(("DIFFUSE", "GLOSSY", "GLASS", "REFRACTION", "SHEEN", "TRANSLUCENT", "TRANSPARENT"), ("Color",)),
    "EMISSION": ("Color", "Strength"),
}
"""By closures, the inputs that they are as bright as, in whatever direction they are seen."""
_EVEN = 1e-6


def shade(closures: Iterable[Closure], leaves: Sequence[Float64], caustics: Caustics) -> Shading:
    """Return what closures amount to.

    Parameters
    ----------
    leaves
        Values of the leaves, (k, 3) colours and (k, 1) numbers.
    """
    values = Values(leaves)
    emission, shining = np.zeros((1, 3)), np.zeros((len(COSINES), 3))
    found: list[Lobe] = []
    for closure in closures:
        part = _shade(closure, values, caustics)
        curve = values.curve(closure.weight)
        for name in _COLOURED.get(closure.kind, ()):
            curve = curve * values.looks(closure.inputs[name])
        seen = curve if part.emission_view is None else curve * part.emission_view
        emission = emission + part.emission * (COSINE_WEIGHTS @ seen)
        shining += np.nan_to_num(part.emission).mean(axis=0) * seen
        # Those of a Principled BSDF have more than one normal, and know theirs.
        own = None if closure.kind == "PRINCIPLED" else values.normal(closure.normal)
        found += (lobe.turned(own).mixed(curve) for lobe in part.lobes)
    lobes = tuple(merged(found))
    matte = [lobe for lobe in lobes if lobe.kind == MATTE]
    albedo = np.asarray(sum((lobe.albedo() for lobe in matte), np.zeros((1, 3))))
    if all(lobe.is_cosine() for lobe in matte):
        lobes = tuple(lobe for lobe in lobes if lobe.kind != MATTE)
    return Shading(albedo, emission, lobes, _relative(shining))


def _relative(shining: Float64) -> Float64 | None:
    """Return light towards directions of view (directions, 3) over its mean; None where all get the same."""
    if (np.abs(shining - shining[0]) <= _EVEN * np.abs(shining[0])).all():
        return None
    mean = COSINE_WEIGHTS @ shining
    return np.divide(shining, mean, out=np.ones_like(shining), where=mean > 0.0)


def _shade(closure: Closure, values: Values, caustics: Caustics) -> Shading:
    """Return what one closure amounts to, but for what its weight has to do with the direction of view."""
    none = np.zeros((1, 3))

    def colour(name: str = "Color") -> Float64:
        return values(closure.inputs[name])

    def lobe(kind: int, color: Float64, second: Float64, fresnel: int = NONE, ior: float = 1.5) -> Shading:
        roughness = values.share(closure.inputs.get("Roughness", (0.0,)))
        return Shading(none, none, (Lobe(kind, color, second, roughness, ior, fresnel, closure.multiscatter, weight),))

    weight = values.weight(closure.weight)
    match closure.kind:
        case "DIFFUSE":
            return lobe(MATTE, weight * colour(), colour())
        case "EMISSION":
            return Shading(none, weight * colour() * values(closure.inputs["Strength"]))
        case "GLOSSY" if caustics.reflective:
            return lobe(GLOSSY, weight * colour(), weight * colour())
        case "METALLIC" if caustics.reflective:
            normal, edge = _metal(closure, values)
            rough, ones = values.share(closure.inputs["Roughness"]), weight * np.ones((1, 3))
            metal = Lobe(GLOSSY, weight * normal, ones, rough, 1.5, SCHLICK, closure.multiscatter, weight, edge=edge)
            return Shading(none, none, (metal,))
        case "GLASS":
            tint = weight * colour()
            ior = usable_index(values.mean(closure.inputs["IOR"]))
            return lobe(GLASS, tint * caustics.reflective, tint * caustics.refractive, DIELECTRIC, ior)
        case "REFRACTION" if caustics.refractive:
            ior = usable_index(values.mean(closure.inputs["IOR"]))
            return lobe(REFRACTION, weight * colour(), weight * colour(), NONE, ior)
        case "SHEEN":
            return Shading(none, none, (sheen_lobe(weight * colour(), values.share(closure.inputs["Roughness"])),))
        case "TRANSLUCENT":
            return lobe(TRANSLUCENT, weight * colour(), weight * colour())
        case "TRANSPARENT":
            return lobe(TRANSPARENT, weight * colour(), weight * colour())
        case "PRINCIPLED":
            return shade_principled(closure, values, weight, caustics)
    return Shading(none, none)


def _metal(closure: Closure, values: Values) -> tuple[Float64, Float64]:
    """Return a metal's reflectance at normal incidence, (k, 3), and how its curve differs from Schlick's, (3,)."""
    if "Color" in closure.inputs:
        normal = np.clip(values(closure.inputs["Color"]), 0.0, 1.0)
        return normal, tinted_edge(normal, values(closure.inputs["Edge Tint"]))
    n, k = (np.maximum(values(closure.inputs[name]), 0.0) for name in ("IOR", "Extinction"))
    normal = conductor_reflectance(np.ones(1), n, k)[0]
    return normal, conductor_edge(n, k)
