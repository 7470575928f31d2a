# SPDX-License-Identifier: GPL-3.0-or-later
"""Closures made into lobes.

Weights that depend on the direction (Fresnel) are replaced by what they amount to for light from all sides,
∫₀¹ F(μ) 2μ dμ, wherever a lobe does not have that very Fresnel factor itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from .closures import Caustics, Closure, Float64, Values, usable_index
from .principled import reflectance_of_ior
from .principled_lobes import rough_reflectance, shade_principled
from .scene import DIELECTRIC, GLASS, GLOSSY, NONE, REFRACTION, SCHLICK, TRANSLUCENT, TRANSPARENT
from .shading import Lobe, Shading, merged


def shade(closures: Iterable[Closure], leaves: Sequence[Float64], caustics: Caustics) -> Shading:
    """Return what closures amount to.

    Parameters
    ----------
    leaves
        Values of the leaves, (k, 3) colours and (k, 1) numbers.
    """
    values = Values(leaves)
    albedo, emission = np.zeros((1, 3)), np.zeros((1, 3))
    lobes: list[Lobe] = []
    for closure in closures:
        part = _shade(closure, values, caustics)
        albedo = albedo + part.albedo
        emission = emission + part.emission
        lobes += part.lobes
    return Shading(albedo, emission, tuple(merged(lobes)))


def _shade(closure: Closure, values: Values, caustics: Caustics) -> Shading:
    """Return what one closure amounts to."""
    none = np.zeros((1, 3))

    def colour(name: str = "Color") -> Float64:
        return values(closure.inputs[name])

    def lobe(kind: int, color: Float64, second: Float64, fresnel: int = NONE, ior: float = 1.5) -> Shading:
        roughness = values.share(closure.inputs.get("Roughness", (0.0,)))
        own = weight if layered is None else layered[0]
        return Shading(none, none, (Lobe(kind, color, second, roughness, ior, fresnel, closure.multiscatter, own),))

    layered = _under_fresnel(closure, values)
    weight = values.weight(closure.weight)
    match closure.kind:
        case "DIFFUSE":
            return Shading(weight * rough_reflectance(colour(), values.share(closure.inputs["Roughness"])), none)
        case "EMISSION":
            return Shading(none, weight * colour() * values(closure.inputs["Strength"]))
        case "GLOSSY" if caustics.reflective:
            if layered is not None:
                rest, ior = layered
                tint = rest * colour()
                if ior < 1.0:  # seen from inside: with total reflection, as glass has it
                    return lobe(GLASS, tint, 0.0 * tint, DIELECTRIC, 1.0 / ior)
                return lobe(GLOSSY, reflectance_of_ior(ior) * tint, tint, DIELECTRIC, ior)
            return lobe(GLOSSY, weight * colour(), weight * colour())
        case "METALLIC" if caustics.reflective:
            normal = np.clip(_metal(closure, values), 0.0, 1.0)
            return lobe(GLOSSY, weight * normal, weight * np.ones((1, 3)), SCHLICK)
        case "GLASS":
            tint = weight * colour()
            ior = usable_index(values.mean(closure.inputs["IOR"]))
            return lobe(GLASS, tint * caustics.reflective, tint * caustics.refractive, DIELECTRIC, ior)
        case "REFRACTION" if caustics.refractive:
            ior = usable_index(values.mean(closure.inputs["IOR"]))
            if layered is not None:
                tint = layered[0] * colour()
                return lobe(GLASS, 0.0 * tint, tint, DIELECTRIC, ior)
            return lobe(REFRACTION, weight * colour(), weight * colour(), NONE, ior)
        case "TRANSLUCENT":
            return lobe(TRANSLUCENT, weight * colour(), weight * colour())
        case "TRANSPARENT":
            return lobe(TRANSPARENT, weight * colour(), weight * colour())
        case "PRINCIPLED":
            return shade_principled(closure, values, weight, caustics)
    return Shading(none, none)


def _under_fresnel(closure: Closure, values: Values) -> tuple[Float64, float] | None:
    """Return the weight without its Fresnel factor, and the index of refraction of it, where a lobe can have that one.

    A glossy lobe can be weighted by F, refraction by 1 − F: each by one such factor.
    """
    fresnel = [factor for factor in closure.weight if factor.fresnel]
    if len(fresnel) != 1 or fresnel[0].complement != (closure.kind == "REFRACTION"):
        return None
    ior = values.mean(fresnel[0].value)
    if ior <= 0.0 or ior == 1.0:
        return None
    return values.weight(factor for factor in closure.weight if not factor.fresnel), ior


def _metal(closure: Closure, values: Values) -> Float64:
    """Return a metal's reflectance at normal incidence: a colour, or from its complex index of refraction n + ik."""
    if "Color" in closure.inputs:
        return values(closure.inputs["Color"])
    n, k = (np.maximum(values(closure.inputs[name]), 0.0) for name in ("IOR", "Extinction"))
    return np.asarray(((n - 1.0) ** 2 + k**2) / ((n + 1.0) ** 2 + k**2))
