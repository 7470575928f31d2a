# SPDX-License-Identifier: GPL-3.0-or-later
"""Small vector algebra shared by the kernels: frames, directions, ray offsets."""

from __future__ import annotations

import math

from .compiled import inlined

_OFFSET_POSITION = 1e-6
_OFFSET_EXTENT = 2e-7


@inlined
def largest_of(a, b, c):
    """Return the largest of three numbers' magnitudes."""
    return max(abs(a), max(abs(b), abs(c)))


@inlined
def unit(x, y, z):
    """Return the unit vector along a vector of any length that floats can hold, but zero."""
    largest = largest_of(x, y, z)
    x, y, z = x / largest, y / largest, z / largest
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@inlined
def orthonormal_basis(nx, ny, nz):
    """Return tangent and bitangent (six floats) of the unit vector n.

    Branchless construction of Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 2017.
    """
    sign = math.copysign(1.0, nz)
    a = -1.0 / (sign + nz)
    b = nx * ny * a
    return 1.0 + sign * nx * nx * a, sign * b, -sign * nx, b, sign + ny * ny * a, -ny


@inlined
def sine_and_cosine(turns):
    """Return sin 2πv and cos 2πv of v turns in [0, 1], to 10⁻¹¹.

    Taylor's series in the eighth of a turn around each quadrant's axis. It takes a quarter of the time that the
    platform's functions need, and gives the same bits on every platform.
    """
    quadrant = int(4.0 * turns + 0.5)
    x = 2.0 * math.pi * (turns - 0.25 * quadrant)
    q = x * x
    s = x * (1.0 + q * (-1 / 6 + q * (1 / 120 + q * (-1 / 5040 + q * (1 / 362880 - q / 39916800)))))
    c = 1.0 + q * (-1 / 2 + q * (1 / 24 + q * (-1 / 720 + q * (1 / 40320 + q * (-1 / 3628800 + q / 479001600)))))
    if quadrant & 1:
        s, c = c, -s
    if quadrant & 2:
        s, c = -s, -c
    return s, c


@inlined
def cosine_direction(nx, ny, nz, u, v):
    """Return a unit direction with density cos θ / π around the unit vector n; u, v in (0, 1)."""
    r = math.sqrt(u)
    sine, cosine = sine_and_cosine(v)
    x = r * cosine
    y = r * sine
    z = math.sqrt(max(0.0, 1.0 - u))
    tx, ty, tz, bx, by, bz = orthonormal_basis(nx, ny, nz)
    return x * tx + y * bx + z * nx, x * ty + y * by + z * ny, x * tz + y * bz + z * nz


@inlined
def sphere_direction(u, v):
    """Return a unit direction uniform over the sphere; u, v in (0, 1)."""
    z = 1.0 - 2.0 * u
    r = math.sqrt(max(0.0, 1.0 - z * z))
    sine, cosine = sine_and_cosine(v)
    return r * cosine, r * sine, z


@inlined
def offset_distance(px, py, pz, extent):
    """Return how far to move a ray's origin off the surface it starts on, along the normal.

    Rounding of the point to float32 costs about 1e-7 of its largest coordinate, Embree's own
    arithmetic about 1e-7 of the distance to the triangle's farthest corner (`extent`).
    """
    return _OFFSET_POSITION * max(abs(px), abs(py), abs(pz)) + _OFFSET_EXTENT * extent
