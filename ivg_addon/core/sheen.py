# SPDX-License-Identifier: GPL-3.0-or-later
"""Sheen: the shine of fuzz and fibres at grazing angles, as Cycles has it.

Seen from o at a cosine μ to the shading normal, a surface of roughness r reflects the share R(μ, r) of even light, and
of light from i = (x, y, z), z along the normal and x on o's side of it,

    f(o, i) z = R(μ, r) (z / π) (A / l²)²        l² = (A x + B z)² + (A y)² + z²,

a cosine under a linear transformation, which A(μ, r) and B(μ, r) define [Z]. Cycles reads R, A and B from tables of 32²
entries; here they are the functions that the MaterialX library fits to the same data [M]. Of light from all sides the
two reflect the same within 1.5 % from a roughness of 0.35 on. Below 0.3 it differs by more, but is a fortieth of all
light at most.

[Z] Zeltner, Burley & Chiang, "Practical Multiple-Scattering Sheen Using Linearly Transformed Cosines", SIGGRAPH 2022.
[M] Academy Software Foundation, MaterialX, `mx_microfacet_sheen`, Apache License 2.0.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .compiled import inlined

Float64 = NDArray[np.float64]

_SMOOTHEST = 1e-3
"""Least roughness, in Cycles as here."""


def sheen_reflectance(cosine: Float64, roughness: float) -> Float64:
    """Return R at cosines."""
    r = max(roughness, _SMOOTHEST)
    width = r * (0.0206607 + 1.58491 * r) / (0.0379424 + r * (1.32227 + r))
    middle = r * (-0.193854 + r * (-1.14885 + r * (1.7932 - 0.95943 * r * r))) / (0.046391 + r)
    floor = r * (0.000654023 + (-0.0207818 + 0.119681 * r) * r) / (1.26264 + r * (-1.92021 + r))
    bell = np.exp(-0.5 * ((cosine - middle) / width) ** 2) / (width * math.sqrt(2.0 * math.pi))
    return np.clip(bell + floor, 0.0, 1.0)


@inlined
def sheen_transform(cosine, roughness):
    """Return A and B for a direction of view."""
    c, r = min(max(cosine, 0.0), 1.0), max(roughness, _SMOOTHEST)
    a = (2.58126 * c + 0.813703 * r) * r / (1.0 + 0.310327 * c * c + 2.60994 * c * r)
    b = math.sqrt(1.0 - c) * (r - 1.0) * r * r * r / (0.0000254053 + 1.71228 * c - 1.71506 * c * r + 1.34174 * r * r)
    return a, b


@inlined
def sheen_shape(cos_in, cos_out, cos_between, roughness):
    """Return (A / l²)²: π f(o, i) / R.

    Parameters
    ----------
    cos_in, cos_out
        Those of where light comes from and goes to, to the shading normal; the latter counts as 0 below.
    cos_between
        That of the angle between the two.
    """
    cos_out = min(max(cos_out, 0.0), 1.0)
    a, b = sheen_transform(cos_out, roughness)
    sine = math.sqrt(1.0 - cos_out * cos_out)
    x = (cos_between - cos_in * cos_out) / sine if sine > 1e-6 else 0.0
    length2 = a * a * (1.0 - cos_in * cos_in) + 2.0 * a * b * x * cos_in + (b * b + 1.0) * cos_in * cos_in
    return (a / length2) ** 2
