# SPDX-License-Identifier: GPL-3.0-or-later
"""Panes of glass that are single faces: "Thin Wall" of the Principled BSDF, from Blender 5.2 on.

Light goes to and fro between the two sides of the pane. With F the Fresnel reflectance of one side for the direction of
view, ρ = F times the specular tint and c = colour^(1/cos θ_t) what one passage leaves,

    T = c (1 − F)² / (1 − ρ² c²)        R = ρ + ρ c T

are let through and reflected. The reflection is that of GGX facets; so is what is let through, mirrored to the other
side, with facets of α √(3.4 (η − 1)(η − ½)² / η³): two refractions in one (Kulla & Conty, "Revisiting Physically Based
Shading at Imageworks", SIGGRAPH courses, 2017).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .closures import Caustics
from .principled import COSINE_WEIGHTS, COSINES, dielectric_curve
from .scene import GLOSSY, NONE, PANE, TRANSPARENT
from .shading import Lobe

Float64 = NDArray[np.float64]

_STEPS = np.linspace(0.0, 1.0, 65)
"""Between these colours, what panes reflect and let through of even light is interpolated."""
_CLEAR = 1e-4
"""Below this α light goes straight on."""


def thin_wall(
    weight: Float64, tint: Float64, colour: Float64, roughness: Float64, ior: float, caustics: Caustics
) -> tuple[Lobe, ...]:
    """Return a pane's lobes.

    Parameters
    ----------
    weight, tint, colour : (k, 3)
        The pane's share of the material, its specular tint, and its colour in [0, 1]; of the tint the mean is taken,
        and of the colour for how the lobes depend on the direction of view.
    roughness : (k, 1)
    """
    mean_tint = tint.mean(axis=0) * caustics.reflective
    reflected, passed = zip(*(_curves(np.full(3, step), mean_tint, ior, caustics) for step in _STEPS), strict=True)
    over, through = _curves(colour.mean(axis=0), mean_tint, ior, caustics)
    color = weight * _interpolated(colour, reflected)
    own = np.divide(color, mean_tint, out=np.ones_like(color), where=mean_tint > 0.0)
    mirror = Lobe(GLOSSY, color, color, roughness, 1.5, NONE, True, own)
    lobes = [_shaped(mirror, over)]
    blur = math.sqrt(max(3.4 * (ior - 1.0) * (ior - 0.5) ** 2 / ior**3, 0.0))
    alpha = np.clip(roughness**2 * blur, 0.0, 1.0)
    color = weight * _interpolated(colour, passed)
    if alpha.max() < _CLEAR:
        lobes.append(_shaped(Lobe(TRANSPARENT, color, color, np.zeros((1, 1))), through))
    else:
        lobes.append(_shaped(Lobe(PANE, color, color, np.sqrt(alpha), 1.5, NONE, True, color), through))
    return tuple(lobes)


def _curves(colour: Float64, tint: Float64, ior: float, caustics: Caustics) -> tuple[Float64, Float64]:
    """Return R and T at `COSINES`, (directions, 3), for a colour and a tint (3,)."""
    fresnel = dielectric_curve(ior)[:, None]
    inside = np.sqrt(np.maximum(1.0 - (1.0 - COSINES**2) / ior**2, 0.0))[:, None]
    left = np.where(inside > 0.0, np.power(colour, 1.0 / np.maximum(inside, 1e-6)), 0.0)
    side, enters = fresnel * tint, (1.0 - fresnel) * caustics.refractive
    through = np.divide(left * enters**2, 1.0 - (side * left) ** 2, out=np.zeros((len(COSINES), 3)), where=enters > 0.0)
    return side + through * side * left, through


def _interpolated(colour: Float64, curves: tuple[Float64, ...]) -> Float64:
    """Return the means over directions for colours (k, 3) of curves that belong to `_STEPS`."""
    means = np.stack([COSINE_WEIGHTS @ curve for curve in curves])
    return np.stack([np.interp(colour[:, c], _STEPS, means[:, c]) for c in range(3)], axis=1)


def _shaped(lobe: Lobe, curve: Float64) -> Lobe:
    """Return a lobe, whose amount is known, with the shape of a function of the direction of view."""
    mean = COSINE_WEIGHTS @ curve
    return lobe.seen_by(np.divide(curve, mean, out=np.ones_like(curve), where=mean > 0.0))
