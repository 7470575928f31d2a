# SPDX-License-Identifier: GPL-3.0-or-later
"""Rough mirrors and rough glass: GGX facets, in the notation of Walter et al.

A facet of normal h mirrors or refracts. Facets are distributed by D (GGX of width α) and hide each other by Smith's
height-correlated G₂ (Heitz 2014). Of the facets that a direction i sees one is drawn with density
D_i(h) = G₁(i) ⟨i·h⟩ D(h) / cos θ_i (Dupuy & Benyoub 2023); light that arrives along i is then sent along its image o
at that facet. What is left to weigh it with is

    F G₂(i, o) / G₁(i)        G₁(i) = 1/(1 + Λ(i)),  G₂(i, o) = 1/(1 + Λ(i) + Λ(o)),

F what the facet reflects or lets through. What lies below the horizon after that is lost in this model: the share
1 − E(μ_i), more than half at α = 1. Cycles' "Multiscatter GGX" gives it back by a factor of the direction o in which
the surface is seen, with Fss the lobe's mean colour and Ē = ∫ E 2μ dμ (Kulla & Conty 2017):

    1 + Fms (1 − E(μ_o))/E(μ_o)        Fms = Fss Ē / (1 − Fss (1 − Ē)),

1/E(μ_o) for white. `fill_energy` tabulates E by quadrature, for mirrors and for glass of any index of refraction.

Walter, Marschner, Li & Torrance, "Microfacet Models for Refraction through Rough Surfaces", EGSR 2007.
Heitz, "Understanding the Masking-Shadowing Function in Microfacet-Based BRDFs", JCGT 3(2), 2014.
Dupuy & Benyoub, "Sampling Visible GGX Normals with Spherical Caps", HPG 2023.
Kutz, Hašan & Edmondson, "Novel Aspects of the Adobe Standard Material", Adobe, 2021.
Kulla & Conty, "Revisiting Physically Based Shading at Imageworks", SIGGRAPH courses, 2017.
"""

from __future__ import annotations

import math

import numpy as np

from .compiled import inlined, kernel, merged
from .scene import DIELECTRIC, SCHLICK
from .vectors import sine_and_cosine

MIRROR_ALPHA = math.sqrt(2e-10)
"""Up to this α a surface is a perfect mirror, in Cycles as here."""
CLEAR = 1e-4
"""An index of refraction as near to 1 bends nothing: facets then hide nothing either, as in Cycles."""
ENERGY_STEPS_ROUGHNESS = ENERGY_STEPS_COSINE = 32
"""Entries of an energy table, the first at 0 and the last at 1."""

_AROUND, _UP = 32, 128
"""Facets of the quadrature: few lie so steep that they send light below the horizon, many must be asked."""
_GRAZING = 1e-4


@inlined
def smith_lambda(cosine, alpha):
    """Return Smith's Λ of GGX for a direction at this cosine to the normal, of either sign."""
    squared = cosine * cosine
    return 0.5 * (math.sqrt(1.0 + alpha * alpha * max(0.0, 1.0 - squared) / squared) - 1.0)


@inlined
def shadowing(cosine_in, cosine_out, alpha):
    """Return G₂(i, o) / G₁(i)."""
    lit = 1.0 + smith_lambda(cosine_in, alpha)
    return lit / (lit + smith_lambda(cosine_out, alpha))


@inlined
def visible_normal(x, y, z, alpha, u, v):
    """Return a facet's unit normal, drawn from those that direction (x, y, z), z > 0, sees; u, v in (0, 1).

    In the frame whose third axis is the surface's normal.
    """
    sx, sy, sz = alpha * x, alpha * y, z
    length = math.sqrt(sx * sx + sy * sy + sz * sz)
    sx, sy, sz = sx / length, sy / length, sz / length
    height = (1.0 - v) * (1.0 + sz) - sz
    radius = math.sqrt(max(0.0, 1.0 - height * height))
    sine, cosine = sine_and_cosine(u)
    hx = alpha * (radius * cosine + sx)
    hy = alpha * (radius * sine + sy)
    hz = height + sz
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    return hx / length, hy / length, hz / length


@inlined
def dielectric_reflectance(cosine, eta):
    """Return what a smooth dielectric, η behind over before, reflects of unpolarised light at this cosine."""
    squared = eta * eta - 1.0 + cosine * cosine
    if squared <= 0.0:
        return 1.0
    g = math.sqrt(squared)
    a = (g - cosine) / (g + cosine)
    b = (cosine * (g + cosine) - 1.0) / (cosine * (g - cosine) + 1.0)
    return 0.5 * a * a * (1.0 + b * b)


@inlined
def refracted_cosine(cosine, eta):
    """Return the cosine on the other side by Snell's law, 0 where all is reflected."""
    return math.sqrt(max(0.0, 1.0 - (1.0 - cosine * cosine) / (eta * eta)))


@inlined
def fresnel_factor(fresnel, cosine, ior):
    """Return f of a glossy lobe, 0 at normal and 1 at grazing incidence; see `scene.Lobes`."""
    if fresnel == SCHLICK:
        m = 1.0 - cosine
        return m * m * m * m * m
    if fresnel == DIELECTRIC:
        normal = ((ior - 1.0) / (ior + 1.0)) ** 2
        if normal >= 1.0:
            return 0.0
        return min(max((dielectric_reflectance(cosine, ior) - normal) / (1.0 - normal), 0.0), 1.0)
    return 0.0


MEAN_EDGE = 1.0 / 126.0
"""∫₀¹ μ (1 − μ)⁶ 2μ dμ."""


@inlined
def edge_factor(cosine):
    """Return μ (1 − μ)⁶, by which metals differ from Schlick's curve (Kutz, Hašan & Edmondson 2021)."""
    m = max(1.0 - cosine, 0.0)
    return cosine * m * m * m * m * m * m


@inlined
def mean_fresnel_factor(fresnel, ior):
    """Return ∫ f 2μ dμ, for a dielectric by the fit of Kulla & Conty that Cycles uses."""
    if fresnel == SCHLICK:
        return 1.0 / 21.0
    if fresnel == DIELECTRIC:
        if ior < 1.0:
            mean = 0.997118 + ior * (0.1014 - ior * (0.965241 + ior * 0.130607))
        else:
            mean = (ior - 1.0) / (4.08567 + 1.00071 * ior)
        normal = ((ior - 1.0) / (ior + 1.0)) ** 2
        return min(max((mean - normal) / (1.0 - normal), 0.0), 1.0)
    return 0.0


@inlined
def single_albedo(cosine, alpha, eta):
    """Return E: what of light at this cosine one bounce at white facets sends on, by the midpoint rule.

    `eta` is that of glass; 0 for facets that reflect all.
    """
    total = 0.0
    x = math.sqrt(1.0 - cosine * cosine)
    for i in range(_AROUND):
        for j in range(_UP):
            # Half of the facets: the others are their mirror images.
            hx, _, hz = visible_normal(x, 0.0, cosine, alpha, 0.5 * (i + 0.5) / _AROUND, (j + 0.5) / _UP)
            facing = x * hx + cosine * hz
            reflectance = 1.0 if eta == 0.0 else dielectric_reflectance(facing, eta)
            above = 2.0 * facing * hz - cosine
            if above > 0.0:
                total += reflectance * shadowing(cosine, above, alpha)
            if reflectance < 1.0:
                below = (facing / eta - refracted_cosine(facing, eta)) * hz - cosine / eta
                if below < 0.0:
                    seen = 1.0 if abs(eta - 1.0) < CLEAR else shadowing(cosine, below, alpha)
                    total += (1.0 - reflectance) * seen
    return total / (_AROUND * _UP)


@kernel
def fill_energy(etas, energy, mean):
    """Tabulate E over roughness (√α) and μ, and Ē over roughness.

    Parameters
    ----------
    etas : (t,) float64
        Index of refraction beyond over before the surface as it is seen; 0 for mirrors.
    energy : (t, ENERGY_STEPS_ROUGHNESS, ENERGY_STEPS_COSINE) float32
        Changed in place.
    mean : (t, ENERGY_STEPS_ROUGHNESS) float32
        Changed in place.
    """
    for table in range(len(etas)):
        for row in range(ENERGY_STEPS_ROUGHNESS):
            roughness = row / (ENERGY_STEPS_ROUGHNESS - 1)
            alpha = max(roughness * roughness, MIRROR_ALPHA)
            sum_of_shares = 0.0
            sum_of_weights = 0.0
            for column in range(ENERGY_STEPS_COSINE):
                cosine = max(column / (ENERGY_STEPS_COSINE - 1), _GRAZING)
                value = single_albedo(cosine, alpha, etas[table])
                energy[table, row, column] = np.float32(value)
                # The trapezoidal rule for ∫ E 2μ dμ; both ends' weights are what they should be but for ½ at μ = 1.
                weight = cosine if column < ENERGY_STEPS_COSINE - 1 else 0.5
                sum_of_shares += weight * value
                sum_of_weights += weight
            mean[table, row] = np.float32(sum_of_shares / sum_of_weights)


@merged
def energy_factor(energy, mean, table, roughness, cosine, mean_color):
    """Return what Cycles' "Multiscatter GGX" multiplies light of one channel with; see the module's equation.

    `cosine` is that of the direction in which the surface is seen, `mean_color` is Fss.
    """
    y = min(max(roughness, 0.0), 1.0) * (ENERGY_STEPS_ROUGHNESS - 1)
    x = min(abs(cosine), 1.0) * (ENERGY_STEPS_COSINE - 1)
    i, j = min(int(y), ENERGY_STEPS_ROUGHNESS - 2), min(int(x), ENERGY_STEPS_COSINE - 2)
    s, t = y - i, x - j
    low = (1.0 - t) * energy[table, i, j] + t * energy[table, i, j + 1]
    high = (1.0 - t) * energy[table, i + 1, j] + t * energy[table, i + 1, j + 1]
    share = (1.0 - s) * low + s * high
    mean_share = (1.0 - s) * mean[table, i] + s * mean[table, i + 1]
    multiple = mean_color * mean_share / (1.0 - mean_color * (1.0 - mean_share))
    return 1.0 + multiple * (1.0 - share) / share
