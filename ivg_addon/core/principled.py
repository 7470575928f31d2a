# SPDX-License-Identifier: GPL-3.0-or-later
"""How much light the diffuse lobe of a Principled BSDF reflects under its specular layers.

Cycles builds the surface from layers, each of which takes its share of what comes from below it:
seen from a direction v with μ = cos θ_v, the diffuse lobe is

    f_d(μ) = (ρ/π) (1 − metallic)(1 − transmission) (1 − R(μ)) C(μ),

R the reflectance of the specular layer and C what coat and sheen let through: what photons send on has
these factors of the direction that they leave in. f_d does not depend on where light comes from,
so of any light the diffuse lobe reflects the share

    ∫_hemisphere f_d cos θ_v dv = ρ (1 − metallic)(1 − transmission) ∫₀¹ (1 − R(μ)) C(μ) 2μ dμ.

R is the albedo of a GGX layer with Smith's
height-correlated shadowing, compensated for bounces between its facets [K]:

    R(μ) = F(μ) (E(μ) + F_ms (1 − E(μ)))      F(μ) = f₀ + (1 − f₀) s(μ)
    E(μ) = ⟨G₂/G₁⟩       s(μ) = ⟨(F_η(v·h) − F_η(1)) / (1 − F_η(1))⟩
    F_ms = F_ss Ē / (1 − F_ss (1 − Ē))      Ē = ∫ E 2μ dμ

with averages ⟨ ⟩ over visible facet normals h [H], none counted that reflects below the horizon,
F_η the dielectric Fresnel reflectance and F_ss its cosine-weighted mean. Here they are computed by
quadrature; Cycles reads tables of 16³ entries, which is all that the two differ by: over
roughness 0–1 and IOR 1–3 the share agreed within 0.0015, at Principled's defaults (IOR 1.5,
level 0.5, roughness 0.5) within 0.0001: 0.9388, measured with Blender 5.0.1 and 5.2.3.

[H] Heitz, "Sampling the GGX Distribution of Visible Normals", JCGT 7(4), 2018.
[K] Kulla & Conty, "Revisiting Physically Based Shading at Imageworks", SIGGRAPH courses, 2017.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .sheen import sheen_reflectance

Float64 = NDArray[np.float64]
Colour = tuple[float, float, float]

_DIRECTIONS = 32
_FACETS = 48
_SMOOTHEST = 1e-4
"""Least GGX α: below, facets are as good as a mirror and their distribution overflows."""

_nodes, _weights = np.polynomial.legendre.leggauss(_DIRECTIONS)
COSINES: Float64 = 0.5 * (_nodes + 1.0)
"""Gauss–Legendre nodes μ in (0, 1), at which layers are evaluated."""
COSINE_WEIGHTS: Float64 = _weights * COSINES
"""Their weights for ∫₀¹ … 2μ dμ; the sum is 1."""


@dataclass(frozen=True)
class Layers:
    """What lies over the diffuse lobe of a Principled BSDF, as its sockets are named.

    Parameters
    ----------
    sheen
        The socket's weight times the largest channel of its tint.
    multiscatter
        The distribution is "Multiscatter GGX", not "GGX".
    specular
        False where Cycles leaves the specular layers out: "Reflective Caustics" is off, and then
        rays that were diffusely reflected do not see them.
    """

    metallic: float = 0.0
    transmission: float = 0.0
    ior: float = 1.5
    specular_ior_level: float = 0.5
    specular_tint: Colour = (1.0, 1.0, 1.0)
    roughness: float = 0.5
    coat: float = 0.0
    coat_roughness: float = 0.03
    coat_ior: float = 1.5
    coat_tint: Colour = (1.0, 1.0, 1.0)
    sheen: float = 0.0
    sheen_roughness: float = 0.5
    multiscatter: bool = True
    specular: bool = True


def coat_share(layers: Layers) -> Float64:
    """Return the share (3,) of the light from below that leaves through coat and sheen."""
    return COSINE_WEIGHTS @ through_coat(layers)


def diffuse_share(layers: Layers) -> Float64:
    """Return the share (3,) of its colour that the diffuse lobe reflects: the equation above."""
    return COSINE_WEIGHTS @ through_layers(layers)


def through_layers(layers: Layers) -> Float64:
    """Return what leaves the diffuse lobe through the layers, by the direction of view: (directions, 3)."""
    below = (1.0 - layers.metallic) * (1.0 - layers.transmission)
    through = through_coat(layers)
    if layers.specular:
        f0, eta = normal_reflectance(layers.ior, layers.specular_ior_level)
        # Cycles takes one share from all channels: that of the most reflective one.
        tinted = min(float(f0) * max(layers.specular_tint), 1.0)
        reflected = layer_reflectance(tinted, float(eta), layers.roughness, layers.multiscatter)
        through = through * np.clip(1.0 - reflected, 0.0, 1.0)[:, None]
    return below * through


def oren_nayar_share(colour: Float64, roughness: float | Float64) -> Float64:
    """Return the share of its colour that a rough diffuse lobe reflects in all, any shape.

    Of the model of `matte`, with Ē as there:

        Ē + ρ² Ē (1 − Ē) / (1 − ρ (1 − Ē))
    """
    a = 1.0 / (np.pi + roughness * (np.pi / 2 - 2 / 3))
    single = a * np.pi + (2 * np.pi - 5.6) / 3 * roughness * a
    rho = np.clip(colour, 0.0, 1.0)
    return np.asarray(single + rho**2 * single * (1.0 - single) / (1.0 - rho * (1.0 - single)))


def layer_reflectance(f0: float, eta: float, roughness: float, multiscatter: bool) -> Float64:
    """Return R at `COSINES`.

    Parameters
    ----------
    f0
        Reflectance at normal incidence, tint included.
    eta
        Relative index of refraction, which gives Fresnel's curve its shape.
    roughness
        Principled's roughness; GGX α is its square.
    """
    if eta == 1.0:
        return np.zeros_like(COSINES)
    shape, single = _facet_averages(max(eta, 1.0 / eta), roughness)
    fresnel = f0 + (1.0 - f0) * shape
    if not multiscatter:
        return fresnel
    true_f0 = ((eta - 1.0) / (eta + 1.0)) ** 2
    mean_shape = np.clip((_mean_fresnel(eta) - true_f0) / (1.0 - true_f0), 0.0, 1.0)
    overall = f0 + (1.0 - f0) * mean_shape
    mean_single = float(COSINE_WEIGHTS @ single)
    multiple = overall * mean_single / (1.0 - overall * (1.0 - mean_single))
    return np.asarray(fresnel * (single + multiple * (1.0 - single)))


def reflectance_of_ior(ior: ArrayLike) -> Float64:
    """Return a dielectric's reflectance at normal incidence."""
    relative = np.asarray(ior, dtype=np.float64)
    return np.asarray(((relative - 1.0) / (relative + 1.0)) ** 2)


def normal_reflectance(ior: ArrayLike, level: ArrayLike) -> tuple[Float64, Float64]:
    """Return f₀ of the specular layer before its tint, and the index of refraction to go with it.

    Parameters
    ----------
    ior, level
        The sockets IOR and Specular IOR Level; arrays of one shape.
    """
    plain = np.maximum(np.asarray(ior, dtype=np.float64), 1e-5)
    strength = np.asarray(level, dtype=np.float64)
    f0 = reflectance_of_ior(plain)
    adjusted = f0 * 2.0 * np.maximum(strength, 0.0)
    root = np.sqrt(np.minimum(adjusted, 0.99))
    eta = (1.0 + root) / (1.0 - root)
    eta = np.where(plain < 1.0, 1.0 / eta, eta)
    untouched = strength == 0.5
    return np.where(untouched, f0, adjusted), np.where(untouched, plain, eta)


def through_coat(layers: Layers) -> Float64:
    """Return what coat and sheen let through, (directions, 3): the coat's reflection, then its tint's absorption."""
    through = np.tile(through_sheen(layers), 3)
    if layers.coat <= 0.0:
        return through
    ior = max(layers.coat_ior, 1.0)
    f0 = ((ior - 1.0) / (ior + 1.0)) ** 2
    if layers.specular:
        reflected = layer_reflectance(f0, ior, layers.coat_roughness, True)
        through *= np.clip(1.0 - layers.coat * reflected, 0.0, 1.0)[:, None]
    inside = np.sqrt(1.0 - (1.0 - COSINES**2) / ior**2)
    tint = np.maximum(layers.coat_tint, 0.0)[None, :] ** (1.0 / inside)[:, None]
    return through * (1.0 + layers.coat * (tint - 1.0))


def through_sheen(layers: Layers) -> Float64:
    """Return what the sheen lets through, (directions, 1)."""
    if layers.sheen <= 0.0:
        return np.ones((_DIRECTIONS, 1))
    reflected = layers.sheen * sheen_reflectance(COSINES, layers.sheen_roughness)
    return np.clip(1.0 - reflected, 0.0, 1.0)[:, None]


def mean_reflectance(eta: float) -> float:
    """Return ∫₀¹ F_η 2μ dμ of a dielectric, by quadrature."""
    return float(COSINE_WEIGHTS @ dielectric_curve(eta))


def dielectric_curve(eta: float, cosines: Float64 = COSINES) -> Float64:
    """Return F_η of a smooth dielectric at cosines."""
    return _fresnel(cosines, eta)


def facing_curve(blend: float, cosines: Float64 = COSINES) -> Float64:
    """Return the output Facing of a Layer Weight node at cosines: 1 − μ^e."""
    blend = min(max(blend, 0.0), 1.0 - 1e-5)
    return np.asarray(1.0 - cosines ** (2.0 * blend if blend < 0.5 else 0.5 / (1.0 - blend)))


def _fresnel(cosine: Float64, eta: float) -> Float64:
    """Return the reflectance of a dielectric for unpolarised light; 1 where all of it is reflected."""
    g = np.sqrt(np.maximum(eta**2 - 1.0 + cosine**2, 0.0))
    a = (g - cosine) / (g + cosine)
    b = (cosine * (g + cosine) - 1.0) / (cosine * (g - cosine) + 1.0)
    return np.asarray(0.5 * a**2 * (1.0 + b**2))


def _mean_fresnel(eta: float) -> float:
    """Return ∫₀¹ F_η 2μ dμ of a dielectric by the numerical fit of [K], which is what Cycles uses."""
    if eta < 1.0:
        return 0.997118 + eta * (0.1014 - eta * (0.965241 + eta * 0.130607))
    return (eta - 1.0) / (4.08567 + 1.00071 * eta)


def facet_means(eta: float, roughness: float) -> tuple[float, float]:
    """Return s and E, averaged over all directions: ∫₀¹ … 2μ dμ; η ≥ 1."""
    if eta == 1.0:
        return 0.0, 1.0
    shape, single = _facet_averages(eta, roughness)
    return float(COSINE_WEIGHTS @ shape), float(COSINE_WEIGHTS @ single)


@lru_cache(maxsize=256)
def _facet_averages(eta: float, roughness: float) -> tuple[Float64, Float64]:
    """Return s and E at `COSINES`, averaged over a grid of visible facet normals, η ≥ 1."""
    alpha = max(roughness**2, _SMOOTHEST)
    grid = (np.arange(_FACETS) + 0.5) / _FACETS
    radius, angle = (axis.ravel() for axis in np.meshgrid(np.sqrt(grid), 2.0 * np.pi * grid))
    across, along = radius * np.cos(angle), radius * np.sin(angle)

    mu = COSINES[:, None]
    sine = np.sqrt(1.0 - mu**2)
    # The hemisphere configuration of [H]: v stretched by α, facets as points of a disk around it.
    stretched = np.hypot(alpha * sine, mu)
    vx, vz = alpha * sine / stretched, mu / stretched
    squeeze = 0.5 * (1.0 + vz)
    along = (1.0 - squeeze) * np.sqrt(1.0 - across**2) + squeeze * along
    out = np.sqrt(np.maximum(0.0, 1.0 - across**2 - along**2))
    hx = alpha * (vx * out - vz * along)
    hy = alpha * across
    hz = np.maximum(0.0, vx * along + vz * out)
    length = np.sqrt(hx**2 + hy**2 + hz**2)
    hx, hz = hx / length, hz / length

    facing = sine * hx + mu * hz
    reflected = 2.0 * facing * hz - mu
    above = reflected > 0.0
    to_viewer = _smith_lambda(mu, alpha)
    to_light = _smith_lambda(np.where(above, reflected, 1.0), alpha)
    single = np.where(above, (1.0 + to_viewer) / (1.0 + to_viewer + to_light), 0.0)
    f0 = ((eta - 1.0) / (eta + 1.0)) ** 2
    shape = np.where(above, (_fresnel(facing, eta) - f0) / (1.0 - f0), 0.0)
    return shape.mean(axis=1), single.mean(axis=1)


def _smith_lambda(cosine: Float64, alpha: float) -> Float64:
    """Return Smith's Λ of GGX."""
    tangent_squared = (1.0 - cosine**2) / cosine**2
    return np.asarray(0.5 * (np.sqrt(1.0 + alpha**2 * tangent_squared) - 1.0))
