# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons from area lights: rectangles and ellipses, with Cycles' spread.

The radiance at an angle θ to the light's normal is that of a soft box whose grid of slats hides
the rest, with half spread a:

    L(θ) = L₀ κ (tan a − tan θ)  for θ < a,        κ = 1 / (tan a − a)

so that the flux per area, ∫ L cos θ dω = π L₀, is the same for every spread. Seen along θ the
slats cover a share tan θ / tan a of the light: behind a slat that cuts the view off at an angle φ,
light has Lambert's distribution up to φ, sin²θ = ξ sin²φ, and integrating over the slats gives

    tan φ − φ = ξ' (tan a − a)

for the angle that a photon's slat has. Two uniform numbers thus sample L cos θ exactly.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import inlined, merged
from ..lights import AreaLights
from ..vectors import offset_distance, orthonormal_basis, sine_and_cosine

Float64 = NDArray[np.float64]

_CYCLES_SERIES_LIMIT = 0.05
"""Below this half spread Cycles takes 3/a³ for κ, and emits that much more."""
_LAMBERT = 0.5 * math.pi - 1e-6
"""A half spread from here on is Lambert's cosine law."""


class AreaEmitters(NamedTuple):
    """Area lights as the kernel sees them, float64; fields as in `lights.AreaLights`.

    slat_range : (n,) float64
        tan a − a of the half spread a; infinite at full spread.
    """

    center: Float64
    edge_u: Float64
    edge_v: Float64
    direction: Float64
    elliptic: NDArray[np.bool_]
    slat_range: Float64

    @classmethod
    def of(cls, lights: AreaLights) -> AreaEmitters:
        """Gather the arrays that the kernel needs."""
        half_spread = np.clip(lights.half_spread.astype(np.float64), 0.0, None)
        narrow = np.minimum(half_spread, _LAMBERT)
        return cls(
            center=lights.center.astype(np.float64),
            edge_u=lights.edge_u.astype(np.float64),
            edge_v=lights.edge_v.astype(np.float64),
            direction=lights.direction.astype(np.float64),
            elliptic=lights.elliptic,
            slat_range=np.where(half_spread < _LAMBERT, _tan_minus_angle(narrow), np.inf),
        )


def area_powers(lights: AreaLights) -> Float64:
    """Return each light's power, (n, 3) W: π L₀ times the area.

    The area is the product of the sides' lengths, as Cycles has it, also where a sheared
    transform leaves them at an angle other than a right one.
    """
    side_u = np.linalg.norm(lights.edge_u.astype(np.float64), axis=1)
    side_v = np.linalg.norm(lights.edge_v.astype(np.float64), axis=1)
    area = side_u * side_v * np.where(lights.elliptic, math.pi / 4, 1.0)
    a = np.clip(lights.half_spread.astype(np.float64), 0.0, _LAMBERT)
    series = (a > 0.0) & (a <= _CYCLES_SERIES_LIMIT)
    gathered = np.where(series, 3.0 * _tan_minus_angle(a) / np.where(series, a, 1.0) ** 3, 1.0)
    power: Float64 = math.pi * lights.radiance.astype(np.float64) * (area * gathered)[:, None]
    return power


def _tan_minus_angle(a: Float64) -> Float64:
    """Return tan a − a without cancellation for small a."""
    return np.where(a < 0.01, a**3 / 3.0 + a**5 * (2.0 / 15.0), np.tan(a) - a)


@inlined
def _tan_of_slat(y):
    """Return tan φ where tan φ − φ = y, by Newton's method in w = tan φ.

    w − arctan w is convex and increasing; from (3y)^⅓ or y, both below the root, the first step
    leads above it and the others fall towards it.
    """
    w = max((3.0 * y) ** (1.0 / 3.0), y)
    if w < 1e-4:
        return w
    for _ in range(8):
        step = (w - math.atan(w) - y) * (1.0 + w * w) / (w * w)
        w -= step
        if abs(step) < 1e-9 * w:
            break
    return w


@merged
def on_area(elliptic, xi_0, xi_1):
    """Return a place on a light, uniform over it: −½ to ½ along its edges."""
    if elliptic:
        radius = 0.5 * math.sqrt(xi_0)
        sine, cosine = sine_and_cosine(xi_1)
        return radius * cosine, radius * sine
    return xi_0 - 0.5, xi_1 - 0.5


@merged
def emit_area(center, edge_u, edge_v, direction, slat_range, light, u, v, xi_2, xi_3, xi_4):
    """Return a photon's origin and direction, six floats.

    Parameters
    ----------
    center … slat_range
        The fields of `AreaEmitters`, one by one: taken out of their tuple for every photon, Numba would count
        references to each of them.
    light
        Index of the light.
    u, v
        Where on it the photon starts, −½ to ½.
    xi_2 … xi_4
        Uniform in (0, 1): one picks the photon's slat, two its direction.
    """
    px = center[light, 0] + u * edge_u[light, 0] + v * edge_v[light, 0]
    py = center[light, 1] + u * edge_u[light, 1] + v * edge_v[light, 1]
    pz = center[light, 2] + u * edge_u[light, 2] + v * edge_v[light, 2]

    slats = slat_range[light]
    sin2_slat = 1.0
    if slats < math.inf:
        tan_slat = _tan_of_slat(xi_2 * slats)
        sin2_slat = tan_slat * tan_slat / (1.0 + tan_slat * tan_slat)
    sin2 = xi_3 * sin2_slat
    sine, cosine = sine_and_cosine(xi_4)
    x = math.sqrt(sin2) * cosine
    y = math.sqrt(sin2) * sine
    z = math.sqrt(1.0 - sin2)
    nx, ny, nz = direction[light, 0], direction[light, 1], direction[light, 2]
    tx, ty, tz, bx, by, bz = orthonormal_basis(nx, ny, nz)
    # A light that lies in a surface shines from just above it.
    away = offset_distance(px, py, pz, 0.0)
    return (
        px + away * nx,
        py + away * ny,
        pz + away * nz,
        x * tx + y * bx + z * nx,
        x * ty + y * by + z * ny,
        x * tz + y * bz + z * nz,
    )
