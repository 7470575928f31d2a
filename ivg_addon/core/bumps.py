# SPDX-License-Identifier: GPL-3.0-or-later
"""Normals that a material gives its lobes: bump and normal maps.

Such a normal n is kept relative to the surface, so that one map serves all instances of a mesh: in the axes t, b, s of
the place, s the smooth normal of the front, t the part of ∂P/∂u at right angles to s, b that of ∂P/∂v at right angles
to both, (u, v) the triangle's texture coordinates.

Cycles lights a lobe by n, with g the geometric normal, i where the light comes from and o where it is seen from. As in
`lobe_scattering`, a photon of that light carries on w' = w f(o, i) |i·n| |o·g| / (|i·g| p(o)) [Veach 1997, §5.3].

**Diffuse lobes** have f times a softening of the terminator [C]: 0 where i·n and i·s differ in sign, else

    G(i) = 1 / (1 + Λ(i·s)),  Λ that of GGX with α² = min(1, tan²(n, s) / 8),

so that w' stays bounded where |i·g| vanishes. Where displacement bends s itself, s is n and there is nothing to soften.

**Glossy lobes** are seen by a normal n'(o) that depends on the direction of view: where the mirror image of o at n
would lie below the surface, n is turned towards g until it lies above by min(0.01, 0.9 o·g); `valid_normal` is that
turn, Cycles' `ensure_valid_specular_reflection`. Facets h of the light are therefore drawn around n, and around three
more normals n_k on the way from n to g, with q/3 of the photons each, q = sin(n, g) but at most ½; whatever is drawn is
weighted by all of them (the balance heuristic [Veach 1997, §9.2]). With D_k = G₁(i·n_k) (i·h) D(h·n_k) / (i·n_k) the
density of a facet,

    w' = w F D(h·n') G₂(i, o) (i·h) |o·g| / (|o·n'| |i·g| Σ q_k D_k),

o the image of i at the facet, by reflection or refraction; whether glass does the one or the other is drawn before, for
what goes through is seen by the other side's normal. A perfect mirror has one facet only: what it would show of grazing
light by n' ≠ n is lost. So is what weighs more than 16: a part of what smooth surfaces, of a roughness below 0.3, show
at their rims where they are tilted by more than some 10°; `shading.Lobe.lost_at_rims` tells about how much.

[C] Conty Estevez, Lecocq & Stein, "A Microfacet-Based Shadowing Function to Solve the Bump Terminator Problem", Ray
Tracing Gems, 2019; in Cycles `bump_shadowing_term`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from .compiled import inlined
from .microfacets import dielectric_reflectance, refracted_cosine, smith_lambda, visible_normal
from .vectors import orthonormal_basis

Float64 = NDArray[np.float64]

OWN, MIRRORED, BENT, MIXED = 1, 2, 4, 8
"""What a lobe's normal is: one of its own; seen from behind tilted towards the same side (a bump) and not to the
opposite one (a normal map); that of the surface itself, by displacement; for a lobe whose `view` goes by the smooth
normal, as mixes by Fresnel or Layer Weight do."""
STEPS = 3
"""Normals on the way from a lobe's own to the surface's, around which facets are drawn besides."""
_LEAST_COSINE = 1e-6


def relative_normals(normals: Float64, smooth: Float64, along_u: Float64, along_v: Float64) -> Float64:
    """Return normals relative to a surface, in the axes of the module's text; all (k, 3), float64.

    Parameters
    ----------
    normals
        Of any length; those of length zero, or that are no numbers, are taken for the smooth ones.
    smooth
        Smooth normals of the front, unit.
    along_u, along_v
        ∂P/∂u and ∂P/∂v, of any length.
    """
    tangent = _unit(along_u - _along(along_u, smooth))
    other = _unit(along_v - _along(along_v, smooth) - _along(along_v, tangent))
    found = np.stack([(normals * axis).sum(axis=1) for axis in (tangent, other, smooth)], axis=1)
    return unit_normals(found)


def unit_normals(normals: Float64) -> Float64:
    """Return relative normals (k, 3) as unit vectors; the surface's own where there is none."""
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    there = np.isfinite(length) & (length > 0.0)
    return np.where(there, normals / np.where(there, length, 1.0), (0.0, 0.0, 1.0))


def _along(vectors: Float64, axis: Float64) -> Float64:
    return np.asarray((vectors * axis).sum(axis=1, keepdims=True) * axis)


def _unit(vectors: Float64) -> Float64:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0.0, length, 1.0))


@inlined
def _perpendicular(x, y, z, ax, ay, az):
    """Return a vector's part at right angles to a unit vector a."""
    along = x * ax + y * ay + z * az
    return x - along * ax, y - along * ay, z - along * az


@inlined
def placed_normal(a, b, c, sx, sy, sz, p, q, r, u0, v0, u1, v1, u2, v2):
    """Return the unit normal a t + b b + c s on the front of a triangle p, q, r with these texture coordinates."""
    qx, qy, qz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    rx, ry, rz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    # ∂P/∂u and ∂P/∂v but for the determinant's size: directions are all that counts.
    sign = math.copysign(1.0, (u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0))
    f, e = sign * (v2 - v0), sign * (v1 - v0)
    tx, ty, tz = _perpendicular(f * qx - e * rx, f * qy - e * ry, f * qz - e * rz, sx, sy, sz)
    length = math.sqrt(tx * tx + ty * ty + tz * tz)
    if length == 0.0:
        return sx, sy, sz
    tx, ty, tz = tx / length, ty / length, tz / length
    f, e = sign * (u1 - u0), sign * (u2 - u0)
    bx, by, bz = _perpendicular(f * rx - e * qx, f * ry - e * qy, f * rz - e * qz, sx, sy, sz)
    bx, by, bz = _perpendicular(bx, by, bz, tx, ty, tz)
    length = math.sqrt(bx * bx + by * by + bz * bz)
    if length == 0.0:
        return sx, sy, sz
    bx, by, bz = bx / length, by / length, bz / length
    x, y, z = a * tx + b * bx + c * sx, a * ty + b * by + c * sy, a * tz + b * bz + c * sz
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return sx, sy, sz
    return x / length, y / length, z / length


@inlined
def softening(cos_is, cos_sn, cos_in):
    """Return G(i) of the module's text, of the cosines between light, smooth normal, and the lobe's own."""
    if cos_is * cos_sn * cos_in < 0.0:
        return 0.0
    light, tilt = abs(cos_is), abs(cos_sn)
    if tilt >= 1.0 or light >= 1.0:
        return 1.0
    if light < _LEAST_COSINE:
        return 0.0
    squared = min(1.0, 0.125 * (1.0 / (tilt * tilt) - 1.0))
    return 1.0 / (1.0 + smith_lambda(light, math.sqrt(squared)))


@inlined
def valid_normal(gx, gy, gz, ox, oy, oz, nx, ny, nz):
    """Return n'(o), a unit vector; g, o and n are unit vectors, o·g > 0."""
    cos_og, cos_on, cos_ng = ox * gx + oy * gy + oz * gz, ox * nx + oy * ny + oz * nz, nx * gx + ny * gy + nz * gz
    least = min(0.9 * cos_og, 0.01)
    x, y, z = nx - cos_ng * gx, ny - cos_ng * gy, nz - cos_ng * gz
    length = math.sqrt(x * x + y * y + z * z)
    if 2.0 * cos_on * cos_ng - cos_og >= least or length == 0.0:
        return nx, ny, nz
    x, y, z = x / length, y / length, z / length
    # n' = √(1 − m) x + √m g with 4 a m² − 2 b m + c = 0: its image of o is at the cosine `least` to g.
    across = ox * x + oy * y + oz * z
    a = across * across + cos_og * cos_og
    b, c = 2.0 * (a + cos_og * least), (least + cos_og) ** 2
    root = math.sqrt(max(0.0, b * b - 4.0 * a * c))
    m = 0.25 * (b + root if across < 0.0 else b - root) / a
    along, up = math.sqrt(max(0.0, 1.0 - m)), math.sqrt(max(0.0, m))
    return along * x + up * gx, along * y + up * gy, along * z + up * gz


@inlined
def _distribution(cosine, alpha):
    """Return GGX's D."""
    if cosine <= 0.0:
        return 0.0
    squared = cosine * cosine
    spread = alpha * alpha * squared + 1.0 - squared
    return alpha * alpha / (math.pi * spread * spread)


@inlined
def _between(gx, gy, gz, nx, ny, nz, step):
    """Return the normal that is so many of `STEPS` on the way from n to g."""
    t = step / STEPS
    x, y, z = nx + t * (gx - nx), ny + t * (gy - ny), nz + t * (gz - nz)
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@inlined
def _step_share(step, share):
    """Return the share of photons whose facets are drawn around such a normal."""
    return 1.0 - share if step == 0 else share / STEPS


@inlined
def bumped_facets(ix, iy, iz, gx, gy, gz, nx, ny, nz, alpha, eta, through, xi_u, xi_v, xi):
    """Draw where facets of width α around n send light from i; see the module's text.

    Parameters
    ----------
    eta
        Index of refraction of what lies behind over what lies before.
    through
        Facets refract; else they reflect.

    Returns
    -------
    o : three floats
        A unit vector.
    cos_ih, cos_os : float
        Of the light to the facet, and of o to n'(o).
    scale : float
        w' / (w F), without what refraction does to radiance; 0 where no light goes there.
    """
    cos_gn = gx * nx + gy * ny + gz * nz
    share = min(0.5, math.sqrt(max(0.0, 1.0 - cos_gn * cos_gn)))
    total, step = 0.0, -1
    for each in range(STEPS + 1):
        mx, my, mz = _between(gx, gy, gz, nx, ny, nz, each)
        if ix * mx + iy * my + iz * mz > 0.0:
            part = _step_share(each, share)
            total += part
            # One of them, by one number that is uniform again after each.
            if xi * total < part:
                step, xi = each, xi * total / part
            else:
                xi = (xi * total - part) / (total - part)
    if step < 0 or total == 0.0:
        return ix, iy, iz, 1.0, 1.0, 0.0
    mx, my, mz = _between(gx, gy, gz, nx, ny, nz, step)
    tx, ty, tz, bx, by, bz = orthonormal_basis(mx, my, mz)
    x, y, z = ix * tx + iy * ty + iz * tz, ix * bx + iy * by + iz * bz, ix * mx + iy * my + iz * mz
    a, b, c = visible_normal(x, y, z, alpha, xi_u, xi_v)
    hx, hy, hz = a * tx + b * bx + c * mx, a * ty + b * by + c * my, a * tz + b * bz + c * mz
    cos_ih = ix * hx + iy * hy + iz * hz
    if cos_ih <= 0.0:
        return ix, iy, iz, 1.0, 1.0, 0.0
    if through:
        if dielectric_reflectance(cos_ih, eta) >= 1.0:
            return ix, iy, iz, 1.0, 1.0, 0.0
        along = cos_ih / eta - refracted_cosine(cos_ih, eta)
        ox, oy, oz = along * hx - ix / eta, along * hy - iy / eta, along * hz - iz / eta
    else:
        ox, oy, oz = 2.0 * cos_ih * hx - ix, 2.0 * cos_ih * hy - iy, 2.0 * cos_ih * hz - iz
    # From where o is seen the surface and its normals point to the viewer.
    side = -1.0 if through else 1.0
    cos_og = side * (ox * gx + oy * gy + oz * gz)
    if cos_og <= 0.0:
        return ox, oy, oz, cos_ih, 1.0, 0.0
    vx, vy, vz = valid_normal(side * gx, side * gy, side * gz, ox, oy, oz, side * nx, side * ny, side * nz)
    cos_os, cos_iv = ox * vx + oy * vy + oz * vz, side * (ix * vx + iy * vy + iz * vz)
    facing = side * (hx * vx + hy * vy + hz * vz)
    if cos_os <= 0.0 or cos_iv <= 0.0 or facing <= 0.0:
        return ox, oy, oz, cos_ih, 1.0, 0.0
    density = 0.0
    for each in range(STEPS + 1):
        mx, my, mz = _between(gx, gy, gz, nx, ny, nz, each)
        cosine = ix * mx + iy * my + iz * mz
        if cosine > 0.0:
            facets = _distribution(hx * mx + hy * my + hz * mz, alpha) / (cosine * (1.0 + smith_lambda(cosine, alpha)))
            density += _step_share(each, share) / total * facets
    seen = _distribution(facing, alpha) / (cos_os * (1.0 + smith_lambda(cos_iv, alpha) + smith_lambda(cos_os, alpha)))
    scale = seen * cos_og / ((ix * gx + iy * gy + iz * gz) * density)
    return ox, oy, oz, cos_ih, cos_os, scale
