# SPDX-License-Identifier: GPL-3.0-or-later
"""Diffuse reflection that is no cosine: rough, or seen through layers.

Cycles' rough diffuse lobe is Fujii's improved Oren–Nayar model with the multiple scattering of the OpenPBR
specification. Light from i is seen from o as the radiance f(o, i) |i·s| times its own, with

    π f(o, i) = A + B t + ρ² Ē / (1 − Ē) (1 − E(o)) (1 − E(i)) / (1 − ρ (1 − Ē)),
    A = π / (π + σ (π/2 − 2/3)),  B = σ A,  E(ω) = A + B G(c) / π,  Ē = A + B (2 − 5.6/π) / 3

times the surface's colour. Here σ is the roughness, ρ the colour within [0, 1], c the cosines to the shading normal s,
and t = i·o − c_i c_o, divided by max(c_i, c_o) where it is positive.

Fujii, "Improvement of Oren-Nayar Model", https://mimosa-pudica.net/improved-oren-nayar.html.
Andersson et al., "OpenPBR Surface Specification", Academy Software Foundation, 2024.
"""

from __future__ import annotations

import math

from .compiled import inlined, merged
from .scene import VIEW_STEPS

SMOOTH = 1e-5
"""Below this roughness Cycles takes a cosine."""


@inlined
def _mean_tilt(cosine):
    """Return Fujii's G."""
    if cosine < 1e-6:
        return 0.5 * math.pi - 2.0 / 3.0 - cosine
    sine = math.sqrt(max(0.0, 1.0 - cosine * cosine))
    angle = math.acos(min(cosine, 1.0))
    return sine * (angle - 2.0 / 3.0 - sine * cosine) + 2.0 / 3.0 * (sine / cosine) * (1.0 - sine * sine * sine)


@inlined
def _terms(roughness):
    """Return A, B and Ē of the module's equation."""
    a = math.pi / (math.pi + roughness * (0.5 * math.pi - 2.0 / 3.0))
    b = roughness * a
    return a, b, a + b * (2.0 - 5.6 / math.pi) / 3.0


@inlined
def rough_diffuse(cos_in, cos_out, cos_between, roughness, colour):
    """Return π f(o, i) for one channel, without the colour itself; see the module's equation.

    Parameters
    ----------
    cos_in, cos_out
        Those of where light comes from and goes to, to the shading normal; the latter counts as 0 below.
    cos_between
        That of the angle between the two.
    """
    cos_out = max(cos_out, 0.0)
    a, b, mean = _terms(roughness)
    t = cos_between - cos_in * cos_out
    if t > 0.0:
        t /= max(cos_in, cos_out)
    rho = min(max(colour, 0.0), 1.0)
    seen = a + b * _mean_tilt(cos_out) / math.pi
    lit = a + b * _mean_tilt(cos_in) / math.pi
    multiple = rho * rho * mean / (1.0 - mean) * (1.0 - seen) * (1.0 - lit) / (1.0 - rho * (1.0 - mean))
    return a + b * t + multiple


@merged
def view_factor(views, view, cosine):
    """Return the factor of each channel of a lobe that is seen at this cosine; see `scene.Lobes`."""
    x = min(max(cosine, 0.0), 1.0) * (VIEW_STEPS - 1)
    i = min(int(x), VIEW_STEPS - 2)
    t = x - i
    return (
        (1.0 - t) * views[view, i, 0] + t * views[view, i + 1, 0],
        (1.0 - t) * views[view, i, 1] + t * views[view, i + 1, 1],
        (1.0 - t) * views[view, i, 2] + t * views[view, i + 1, 2],
    )


@inlined
def rough_albedo(cos_out, roughness, colour):
    """Return ∫ f(o, i) cos_i di for one channel, without the colour itself: what of even light is seen from o.

    With ∫ (1 − E(i)) cos_i di / π = 1 − Ē this is E(o) + ρ² Ē (1 − E(o)) / (1 − ρ (1 − Ē)).
    """
    a, b, mean = _terms(roughness)
    rho = min(max(colour, 0.0), 1.0)
    seen = a + b * _mean_tilt(max(cos_out, 0.0)) / math.pi
    return seen + rho * rho * mean * (1.0 - seen) / (1.0 - rho * (1.0 - mean))
