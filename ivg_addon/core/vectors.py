"""Small vector algebra shared by the kernels: frames, directions, ray offsets."""

from __future__ import annotations

import math

from .compiled import inlined

_OFFSET_POSITION = 1e-6
_OFFSET_EXTENT = 2e-7


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
def cosine_direction(nx, ny, nz, u, v):
    """Return a unit direction with density cos θ / π around the unit vector n; u, v in (0, 1)."""
    r = math.sqrt(u)
    phi = 2.0 * math.pi * v
    x = r * math.cos(phi)
    y = r * math.sin(phi)
    z = math.sqrt(max(0.0, 1.0 - u))
    tx, ty, tz, bx, by, bz = orthonormal_basis(nx, ny, nz)
    return x * tx + y * bx + z * nx, x * ty + y * by + z * ny, x * tz + y * bz + z * nz


@inlined
def sphere_direction(u, v):
    """Return a unit direction uniform over the sphere; u, v in (0, 1)."""
    z = 1.0 - 2.0 * u
    r = math.sqrt(max(0.0, 1.0 - z * z))
    phi = 2.0 * math.pi * v
    return r * math.cos(phi), r * math.sin(phi), z


@inlined
def offset_distance(px, py, pz, extent):
    """Return how far to move a ray's origin off the surface it starts on, along the normal.

    Rounding of the point to float32 costs about 1e-7 of its largest coordinate, Embree's own
    arithmetic about 1e-7 of the distance to the triangle's farthest corner (`extent`).
    """
    return _OFFSET_POSITION * max(abs(px), abs(py), abs(pz)) + _OFFSET_EXTENT * extent
