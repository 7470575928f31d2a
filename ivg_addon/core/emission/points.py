# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons from points, spheres and spots.

Light leaves along lines of direction d that pass the centre at a distance b < r, uniform over
that disc, with the radiance f(d) I / (π r²); f is the spot's attenuation. Where on its line a
photon starts depends on how Cycles turns a radius into a shape:

- a sphere: where the line leaves the sphere. (Inside of it Cycles lights every surface with π
  times the radiance, whatever lies between; here nothing is lit there.)
- a disk turned towards each point p that is lit ("soft falloff"): p sees the disk at the angle
  whose sine is b / |p| only if its tangent is less than r / |p|. So the line is lit no nearer
  than |p| = b r / √(r² − b²), at a distance s = b² / √(r² − b²) past its closest approach.

The attenuation depends on the cosine z to the axis in the spot's own space. For a cone from c on
and a blend β, with x = (z − c) / (1 − c), it rises over 0 < x < β as the smooth step
3t² − 2t³, t = x/β, and is 1 from there on: ∫ f dω = 2π (1 − c) (1 − β/2). The distribution
function of the rise, 2t³ − t⁴, is that of one of the two largest of four uniform numbers, either
with a probability of one half.

If the spot's space is scaled unevenly, by the matrix M, a direction l of that space becomes M l,
and solid angles grow by J(l) = |det M| / |M l|³. Directions are then taken with the probability
J / max J, in several attempts.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import inlined, merged
from ..lights import NO_PATTERN, PointLights
from ..random import STREAM_EMISSION, random4
from ..vectors import cosine_direction, orthonormal_basis

Float64 = NDArray[np.float64]

ATTEMPTS = 7
"""Directions tried for an unevenly scaled spot; attempt k draws from streams 1 + 2k and 2 + 2k."""

_NODES_COSINE = 64
_NODES_AZIMUTH = 512
_EVEN = 1e-5
"""Relative difference of a spot's scales up to which they count as equal."""


class PointEmitters(NamedTuple):
    """Points and spots as the kernel sees them, float64; fields as in `lights.PointLights`.

    axes : (n, 3, 3) float64
        M, scaled to a determinant of ±1.
    shortest : (n,) float64
        A lower bound of |M l| over the cone, so that J / max J = (shortest / |M l|)³; 1 where
        the scale is even.
    """

    position: Float64
    radius: Float64
    soft_falloff: NDArray[np.bool_]
    cos_half_angle: Float64
    blend: Float64
    axes: Float64
    shortest: Float64

    @classmethod
    def of(cls, lights: PointLights) -> PointEmitters:
        """Gather the arrays that the kernel needs."""
        cos_half_angle = lights.cos_half_angle.astype(np.float64)
        turned = cos_half_angle > -1.0
        if lights.pattern is not None:
            turned |= lights.pattern != NO_PATTERN
        axes = np.where(turned[:, None, None], lights.axes.astype(np.float64), np.eye(3))
        axes /= np.cbrt(np.abs(np.linalg.det(axes)))[:, None, None]
        gram = np.swapaxes(axes, 1, 2) @ axes
        uneven = np.abs(gram - np.eye(3)).max(axis=(1, 2), initial=0.0) > _EVEN
        shortest = np.ones(len(axes))
        for light in np.flatnonzero(uneven):
            shortest[light] = _shortest_image(gram[light], float(cos_half_angle[light]))
        return cls(
            position=lights.position.astype(np.float64),
            radius=lights.radius.astype(np.float64),
            soft_falloff=lights.soft_falloff,
            cos_half_angle=cos_half_angle,
            blend=lights.blend.astype(np.float64),
            axes=axes,
            shortest=shortest,
        )


def _shortest_image(gram: Float64, cos_half_angle: float) -> float:
    """Return a lower bound of |M l| over unit vectors l of the cone around −z, gram = MᵀM.

    At an angle θ to the axis, with λ the smaller eigenvalue of gram's xy block and q its zx, zy
    entries, |M l|² ≥ sin²θ λ + cos²θ gram_zz − 2 sin θ cos θ |q|, a sinusoid in 2θ. Without shear
    q = 0, and the bound is reached.
    """
    smaller = float(np.linalg.eigvalsh(gram[:2, :2])[0])
    along = float(gram[2, 2])
    shear = float(np.hypot(gram[2, 0], gram[2, 1]))
    amplitude = math.hypot(0.5 * (along - smaller), shear)
    phase = math.atan2(shear, 0.5 * (along - smaller))
    angle = min(math.pi, phase + 2.0 * math.acos(cos_half_angle))
    in_cone = 0.5 * (along + smaller) + amplitude * math.cos(angle)
    anywhere = float(np.linalg.eigvalsh(gram)[0])
    return math.sqrt(max(in_cone, anywhere))


def acceptance(emitters: PointEmitters) -> Float64:
    """Return, for each light, the mean of J / max J over its cone, (n,), weighted with f."""
    mean = np.ones(len(emitters.shortest))
    nodes, node_weights = np.polynomial.legendre.leggauss(_NODES_COSINE)
    t, t_weights = 0.5 * (nodes + 1.0), 0.5 * node_weights
    azimuth = 2.0 * math.pi * np.arange(_NODES_AZIMUTH) / _NODES_AZIMUTH
    for light in np.flatnonzero(emitters.shortest != 1.0):
        c, blend = emitters.cos_half_angle[light], emitters.blend[light]
        x = np.concatenate([blend * t, blend + (1.0 - blend) * t])
        share = np.concatenate([blend * t_weights * t**2 * (3.0 - 2.0 * t), (1.0 - blend) * t_weights])
        z = (c + (1.0 - c) * x)[:, None]
        s = np.sqrt(np.clip(1.0 - z * z, 0.0, None))
        local = np.stack([s * np.cos(azimuth), s * np.sin(azimuth), -z + 0.0 * azimuth])
        length = np.linalg.norm(np.tensordot(emitters.axes[light], local, axes=1), axis=0)
        ratio = (emitters.shortest[light] / length) ** 3
        mean[light] = (ratio.mean(axis=1) * share).sum() / share.sum()
    return mean


def point_powers(lights: PointLights, emitters: PointEmitters, accepted: Float64) -> Float64:
    """Return each light's power, (n, 3) W: intensity times ∫ f dω.

    `accepted` is what `acceptance` returns: ∫ f dω of the light's own space becomes that of world
    space by the mean of J.
    """
    cone = 2.0 * math.pi * (1.0 - emitters.cos_half_angle) * (1.0 - 0.5 * emitters.blend)
    solid_angle = cone * accepted / emitters.shortest**3
    power: Float64 = lights.intensity.astype(np.float64) * solid_angle[:, None]
    return power


@merged
def emit_point(lights, light, seed, photon, xi_0, xi_1):
    """Return a photon's origin and direction, how far it flies dark, and whether it exists.

    Parameters
    ----------
    lights : PointEmitters
    light
        Index of the light.
    seed, photon
        Address of further random numbers.
    xi_0, xi_1
        Uniform in (0, 1): they place the line of flight.

    Returns
    -------
    tuple
        Six floats; the metres that the photon flies before it carries light; False if no attempt
        found a direction.
    """
    dx, dy, dz, found = _spot_direction(lights, light, seed, photon)
    ox, oy, oz, dark = _on_line(lights, light, dx, dy, dz, xi_0, xi_1)
    return ox, oy, oz, dx, dy, dz, dark, found


@merged
def emit_patterned_point(lights, light, row, rows, column, columns, seed, photon, xi_0, xi_1):
    """Return a photon's origin and direction, and how far it flies dark: seven floats.

    Parameters
    ----------
    row, rows, column, columns
        Which texel of the light's pattern it starts from; see `lights.Pattern`.
    lights … xi_1
        As in `emit_point`.
    """
    xi_row, xi_column, xi_2, xi_3 = random4(seed, photon, STREAM_EMISSION + 2)
    half_angle = math.acos(lights.cos_half_angle[light])
    low, high = math.cos(half_angle * row / rows), math.cos(half_angle * (row + 1) / rows)
    z = low + xi_row * (high - low)
    s = math.sqrt(max(0.0, 1.0 - z * z))
    azimuth = 2.0 * math.pi * (column + xi_column) / columns
    x, y = s * math.cos(azimuth), s * math.sin(azimuth)
    axes = lights.axes[light]
    dx = axes[0, 0] * x + axes[0, 1] * y - axes[0, 2] * z
    dy = axes[1, 0] * x + axes[1, 1] * y - axes[1, 2] * z
    dz = axes[2, 0] * x + axes[2, 1] * y - axes[2, 2] * z
    ox, oy, oz, dark = _on_line(lights, light, dx, dy, dz, xi_0, xi_1)
    radius = lights.radius[light]
    if radius > 0.0 and not lights.soft_falloff[light] and lights.cos_half_angle[light] <= -1.0:
        # The pattern's direction is the normal of a place on the sphere.
        ox = lights.position[light, 0] + radius * dx
        oy = lights.position[light, 1] + radius * dy
        oz = lights.position[light, 2] + radius * dz
        dx, dy, dz = cosine_direction(dx, dy, dz, xi_2, xi_3)
    return ox, oy, oz, dx, dy, dz, dark


@merged
def _on_line(lights, light, dx, dy, dz, xi_0, xi_1):
    """Return where on its line a photon of direction d starts, and how far it flies dark: four floats."""
    radius = lights.radius[light]
    tx, ty, tz, bx, by, bz = orthonormal_basis(dx, dy, dz)
    b = radius * math.sqrt(xi_0)
    x = b * math.cos(2.0 * math.pi * xi_1)
    y = b * math.sin(2.0 * math.pi * xi_1)
    if lights.soft_falloff[light]:
        z = 0.0
        dark = radius * xi_0 / math.sqrt(1.0 - xi_0)
    else:
        z = radius * math.sqrt(1.0 - xi_0)
        dark = 0.0
    return (
        lights.position[light, 0] + x * tx + y * bx + z * dx,
        lights.position[light, 1] + x * ty + y * by + z * dy,
        lights.position[light, 2] + x * tz + y * bz + z * dz,
        dark,
    )


@merged
def _spot_direction(lights, light, seed, photon):
    """Return a unit direction with density ∝ f (three floats), and whether one was found."""
    cos_half_angle, blend = lights.cos_half_angle[light], lights.blend[light]
    shortest = lights.shortest[light]
    axes = lights.axes[light]
    # Share of ∫ f dω that lies where f = 1.
    full = (1.0 - blend) / (1.0 - 0.5 * blend)
    dx, dy, dz = 0.0, 0.0, 1.0
    for attempt in range(ATTEMPTS):
        stream = STREAM_EMISSION + 1 + 2 * attempt
        xi_x, xi_azimuth, xi_coin, xi_accept = random4(seed, photon, stream)
        if xi_x < full:
            x = blend + (1.0 - blend) * xi_x / full
        else:
            x = blend * _one_of_two_largest(seed, photon, stream + 1, xi_coin)
        z = cos_half_angle + (1.0 - cos_half_angle) * x
        s = math.sqrt(max(0.0, 1.0 - z * z))
        lx = s * math.cos(2.0 * math.pi * xi_azimuth)
        ly = s * math.sin(2.0 * math.pi * xi_azimuth)
        dx = axes[0, 0] * lx + axes[0, 1] * ly - axes[0, 2] * z
        dy = axes[1, 0] * lx + axes[1, 1] * ly - axes[1, 2] * z
        dz = axes[2, 0] * lx + axes[2, 1] * ly - axes[2, 2] * z
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx / length, dy / length, dz / length
        ratio = shortest / length
        if shortest == 1.0 or xi_accept < ratio * ratio * ratio:
            return dx, dy, dz, True
    return dx, dy, dz, False


@inlined
def _one_of_two_largest(seed, photon, stream, xi_coin):
    """Return the largest or, as often, the second largest of four uniform numbers."""
    a, b, c, d = random4(seed, photon, stream)
    high, low = max(a, b), min(a, b)
    other_high, other_low = max(c, d), min(c, d)
    if xi_coin < 0.5:
        return max(high, other_high)
    return max(min(high, other_high), max(low, other_low))
