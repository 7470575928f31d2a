# SPDX-License-Identifier: GPL-3.0-or-later
"""How metals reflect, by the cosine μ of incidence.

    F(μ) = F₀ + (1 − F₀) (1 − μ)⁵ − b μ (1 − μ)⁶

Schlick's curve, and a dip before grazing incidence that the edge's tint sets: the factor of Schlick's curve at μ = 1/7
(Kutz, Hašan & Edmondson, "Novel Aspects of the Adobe Standard Material", 2021). For metals that are given by their
complex index of refraction n + ik, b is such that they reflect of light from all sides what Fresnel's equations say.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .microfacets import MEAN_EDGE
from .principled import COSINE_WEIGHTS, COSINES

Float64 = NDArray[np.float64]

_RIM = 1.0 / 7.0
"""μ at which μ (1 − μ)⁶ is largest."""
_MEAN_SCHLICK = 1.0 / 21.0


def tinted_edge(normal: Float64, tint: Float64) -> Float64:
    """Return b, (3,), for a reflectance at normal incidence and a tint, (k, 3) each: that of their means."""
    base, factor = (np.clip(np.nan_to_num(each), 0.0, 1.0).mean(axis=0) for each in (normal, tint))
    schlick = base + (1.0 - base) * (1.0 - _RIM) ** 5
    return np.asarray(schlick * (1.0 - factor) / (_RIM * (1.0 - _RIM) ** 6) * np.ones(3))


def conductor_edge(n: Float64, k: Float64) -> Float64:
    """Return b, (3,), of the means of complex indices of refraction (points, 3)."""
    curve = conductor_reflectance(COSINES, *(np.nan_to_num(each).mean(axis=0, keepdims=True) for each in (n, k)))[:, 0]
    normal = conductor_reflectance(np.ones(1), *(np.nan_to_num(each).mean(axis=0, keepdims=True) for each in (n, k)))[
        0, 0
    ]
    return np.asarray((normal + (1.0 - normal) * _MEAN_SCHLICK - COSINE_WEIGHTS @ curve) / MEAN_EDGE * np.ones(3))


def conductor_reflectance(cosines: Float64, n: Float64, k: Float64) -> Float64:
    """Return what a conductor reflects of unpolarised light, (cosines, points, 3), by Fresnel's equations.

    With the complex refracted cosine √((n + ik)² − sin²θ) = p: rₛ = (μ − p)/(μ + p), and rₚ that of (n + ik)² μ and p.
    """
    mu, index = cosines[:, None, None], (n + 1j * k)[None]
    refracted = np.sqrt(index**2 - (1.0 - mu**2))
    across = np.abs((mu - refracted) / (mu + refracted)) ** 2
    along = np.abs((index**2 * mu - refracted) / (index**2 * mu + refracted)) ** 2
    return np.asarray(0.5 * (across + along))
