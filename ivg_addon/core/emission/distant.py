# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons from infinitely far away: suns and a world of one colour.

All that matters of such light is what enters a box around the scene. From a uniform radiance L a
face of the box receives L cos θ: the world is a box whose faces shine inwards by Lambert's law,
with power π L times their area. Of a sun's direction d the box blocks the area

    A(d) = Σ_k A_k |d_k|,       A_k: the area of the faces across axis k

so a direction uniform in the sun's cone, then a point uniform over the faces that d enters, is
right in proportion to A(d). Each photon stands for the largest A of the cone; where A(d) is
smaller, the difference is the chance that the photon misses the box.

Where the grid's own box is much smaller than that around the scene, boxes are nested from the one to
the other, and what flies through a box but past the next smaller one is emitted apart: its photons
start as if there was only that box, and go back along their way to the outermost; those that would
fly through the next smaller one fail. So `aim.py` finds what is of use, however large the scene is.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import merged
from ..lights import SunLights
from ..vectors import cosine_direction, orthonormal_basis

Float64 = NDArray[np.float64]

_QUADRATURE_NODES = 128
_MUCH_LARGER = 4.0
"""Times the area that the grid's box shows."""
_MOST_STEPS = 4


class Box(NamedTuple):
    """What distant light enters.

    low, high : (3,) float64
        Corners, metres.
    areas : (3,) float64
        Area of one face across each axis.
    """

    low: Float64
    high: Float64
    areas: Float64

    @classmethod
    def around(cls, low: Float64, high: Float64) -> Box:
        """Return a box that is a little larger, so that no surface lies in its faces."""
        margin = 1e-3 * float(np.linalg.norm(high - low))
        low, high = low - margin, high + margin
        x, y, z = high - low
        return cls(low=low, high=high, areas=np.array([y * z, z * x, x * y]))

    @classmethod
    def nested(cls, whole: Box, grid: Box) -> tuple[Box, ...]:
        """Return boxes from `whole` to `grid`, which lies in it; alone `whole` where the two are much the same.

        Each shows about an eighth of the area that the one before it shows, or less.
        """
        ratio = float(whole.areas.sum() / grid.areas.sum())
        if ratio < _MUCH_LARGER:
            return (whole,)
        steps = min(max(1, round(math.log(ratio, 8.0))), _MOST_STEPS)
        boxes = [whole]
        for step in range(1, steps):
            # Areas grow with the square of lengths.
            share = (math.sqrt(ratio ** (1.0 - step / steps)) - 1.0) / (math.sqrt(ratio) - 1.0)
            x, y, z = extent = (1.0 - share) * (grid.high - grid.low) + share * (whole.high - whole.low)
            low = (1.0 - share) * grid.low + share * whole.low
            boxes.append(cls(low=low, high=low + extent, areas=np.array([y * z, z * x, x * y])))
        return (*boxes, grid)

    @classmethod
    def stacked(cls, boxes: tuple[Box, ...]) -> Box:
        """Return several boxes as one of arrays (boxes, 3)."""
        return cls(*(np.stack(arrays) for arrays in zip(*boxes, strict=True)))


class SunEmitters(NamedTuple):
    """Suns as the kernel sees them, float64; fields as in `lights.SunLights`.

    one_minus_cos : (n,) float64
        1 − cos of the half angle.
    largest_shadow : (boxes, n) float64
        An upper bound of A(d) over the sun's cone, m², for each box that light may enter.
    """

    direction: Float64
    one_minus_cos: Float64
    largest_shadow: Float64

    @classmethod
    def of(cls, lights: SunLights, boxes: tuple[Box, ...]) -> SunEmitters:
        """Gather the arrays that the kernel needs."""
        direction = lights.direction.astype(np.float64)
        half_angle = lights.half_angle.astype(np.float64)
        # |d_k| is largest where the cone comes closest to the axis k.
        to_axis = np.arccos(np.clip(np.abs(direction), 0.0, 1.0))
        closest = np.cos(np.maximum(0.0, to_axis - half_angle[:, None]))
        return cls(
            direction=direction,
            one_minus_cos=2.0 * np.sin(0.5 * half_angle) ** 2,
            largest_shadow=np.stack([np.minimum(closest @ box.areas, np.linalg.norm(box.areas)) for box in boxes]),
        )


def sun_fluxes(lights: SunLights) -> Float64:
    """Return ∫ L dω over each sun's disc, (n, 3) W/m²: power per area across the photons' way.

    A disc of half angle h and radiance L gives a surface that faces it L π sin²h.
    """
    h = lights.half_angle.astype(np.float64)
    wide = h > 0.0
    sines = np.where(wide, np.sin(h), 1.0)
    ratio = np.where(wide, 4.0 * np.sin(0.5 * h) ** 2 / sines**2, 1.0)
    flux: Float64 = lights.irradiance.astype(np.float64) * ratio[:, None]
    return flux


def mean_shadows(lights: SunLights, box: Box) -> Float64:
    """Return the mean of A(d) over each sun's cone, (n,) m², by Gauss-Legendre quadrature.

    On the ring at an angle θ around the sun's axis, d_k = α + β cos ψ with α = a_k cos θ and
    β = √(1 − a_k²) sin θ; the mean of its absolute value over the ring has a closed form.
    """
    nodes, node_weights = np.polynomial.legendre.leggauss(_QUADRATURE_NODES)
    h = lights.half_angle.astype(np.float64)[:, None, None]
    theta = 0.5 * h * (nodes[None, :, None] + 1.0)
    along = np.abs(lights.direction.astype(np.float64))[:, None, :]
    alpha = along * np.cos(theta)
    beta = np.sqrt(np.clip(1.0 - along**2, 0.0, None)) * np.sin(theta)
    ratio = np.clip(alpha / np.maximum(beta, 1e-300), 0.0, 1.0)
    crossing = (2.0 / math.pi) * (alpha * np.arcsin(ratio) + beta * np.sqrt(1.0 - ratio**2))
    ring = np.where(alpha >= beta, alpha, crossing) @ box.areas
    density = np.where(h[:, :, 0] > 0.0, np.sin(theta[:, :, 0]), 1.0) * node_weights
    mean: Float64 = (ring * density).sum(axis=1) / density.sum(axis=1)
    return mean


@merged
def emit_world(box_low, box_high, box_areas, box, xi_0, xi_1, xi_2, xi_3, xi_4):
    """Return the origin on the box and the direction into it, six floats; ξ uniform in (0, 1)."""
    area_x, area_y = box_areas[box, 0], box_areas[box, 1]
    t = xi_0 * (area_x + area_y + box_areas[box, 2])
    axis = 0 if t < area_x else (1 if t < area_x + area_y else 2)
    sign = 1.0 if xi_1 < 0.5 else -1.0
    # Half of a uniform number's range is a uniform number again.
    place = 2.0 * xi_1 if xi_1 < 0.5 else 2.0 * xi_1 - 1.0
    ox, oy, oz = _on_face(box_low, box_high, box, axis, sign, place, xi_2)
    dx, dy, dz = cosine_direction(
        sign if axis == 0 else 0.0,
        sign if axis == 1 else 0.0,
        sign if axis == 2 else 0.0,
        xi_3,
        xi_4,
    )
    return ox, oy, oz, dx, dy, dz


@merged
def emit_sun(suns, sun, box_low, box_high, box_areas, box, xi_0, xi_1, xi_2, xi_3, xi_4):
    """Return the photon's origin on the box and direction, six floats, and whether it hits the box.

    Parameters
    ----------
    suns : SunEmitters
    sun
        Index of the sun.
    box_low, box_high, box_areas
        The fields of `Box.stacked`.
    box
        Index of the box.
    xi_0 … xi_4
        Uniform in (0, 1): two pick the direction, one the face, two the place.
    """
    ax, ay, az = suns.direction[sun, 0], suns.direction[sun, 1], suns.direction[sun, 2]
    dz = 1.0 - xi_0 * suns.one_minus_cos[sun]
    r = math.sqrt(max(0.0, 1.0 - dz * dz))
    x = r * math.cos(2.0 * math.pi * xi_1)
    y = r * math.sin(2.0 * math.pi * xi_1)
    tx, ty, tz, bx, by, bz = orthonormal_basis(ax, ay, az)
    d0 = x * tx + y * bx + dz * ax
    d1 = x * ty + y * by + dz * ay
    d2 = x * tz + y * bz + dz * az
    t = xi_2 * suns.largest_shadow[box, sun]
    ox, oy, oz, enters = enter_box(box_low, box_high, box_areas, box, d0, d1, d2, t, xi_3, xi_4)
    return ox, oy, oz, d0, d1, d2, enters


@merged
def enter_box(box_low, box_high, box_areas, box, d0, d1, d2, t, u, v):
    """Return where a photon of direction d enters a box, three floats, and whether it does.

    Parameters
    ----------
    t
        Uniform between 0 and a bound of the shadow of the box along d, m²: it picks a face by its share of the shadow;
        beyond the shadow the photon misses.
    u, v
        Uniform in (0, 1): the place on the face.
    """
    shadow_0 = box_areas[box, 0] * abs(d0)
    shadow_1 = box_areas[box, 1] * abs(d1)
    shadow_2 = box_areas[box, 2] * abs(d2)
    if t < shadow_0:
        axis, sign = 0, math.copysign(1.0, d0)
    elif t < shadow_0 + shadow_1:
        axis, sign = 1, math.copysign(1.0, d1)
    else:
        axis, sign = 2, math.copysign(1.0, d2)
    x, y, z = _on_face(box_low, box_high, box, axis, sign, u, v)
    return x, y, z, t < shadow_0 + shadow_1 + shadow_2


@merged
def _on_face(low, high, box, axis, sign, u, v):
    """Return the point (u, v) of a box's face across `axis` through which `sign` points inwards."""
    entry = 0.0 if sign > 0.0 else 1.0
    x = entry if axis == 0 else u
    y = entry if axis == 1 else (u if axis == 0 else v)
    z = entry if axis == 2 else v
    return (
        low[box, 0] + x * (high[box, 0] - low[box, 0]),
        low[box, 1] + y * (high[box, 1] - low[box, 1]),
        low[box, 2] + z * (high[box, 2] - low[box, 2]),
    )


@merged
def through_nested(low, high, box, ox, oy, oz, dx, dy, dz):
    """Return where on the outermost box a photon starts, three floats, and whether it flies past the next of its box.

    Parameters
    ----------
    low, high
        Corners of the boxes, the outermost first.
    box
        Index of the box.
    ox … dz
        Where the photon enters it, and its direction.
    """
    past = True
    if box + 1 < len(low):
        enters, leaves = _way_into(low, high, box + 1, ox, oy, oz, dx, dy, dz)
        past = enters > leaves
    if box > 0:
        enters, leaves = _way_into(low, high, 0, ox, oy, oz, dx, dy, dz)
        ox, oy, oz = ox + enters * dx, oy + enters * dy, oz + enters * dz
    return ox, oy, oz, past


@merged
def _way_into(low, high, box, ox, oy, oz, dx, dy, dz):
    """Return where a line enters and leaves a box, in lengths of its direction; it misses where it leaves first."""
    start, end = -math.inf, math.inf
    for axis in range(3):
        o = ox if axis == 0 else (oy if axis == 1 else oz)
        d = dx if axis == 0 else (dy if axis == 1 else dz)
        if d == 0.0:
            if o < low[box, axis] or o > high[box, axis]:
                end = -math.inf
        else:
            first, second = (low[box, axis] - o) / d, (high[box, axis] - o) / d
            start = max(start, min(first, second))
            end = min(end, max(first, second))
    return start, end
