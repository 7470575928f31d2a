# SPDX-License-Identifier: GPL-3.0-or-later
"""The normals of lobes at a place: which one a lobe has, and by which one its layers are seen. See `bumps`."""

from __future__ import annotations

from .bumps import MIRRORED, MIXED, placed_normal, valid_normal
from .compiled import inlined, merged
from .lobes import NORMAL
from .surfaces import corner


@merged
def own_normal(numbers, lobe, bump, front, through, sx, sy, sz, vertices, triangles, uvs, triangle):
    """Return a lobe's normal on the side that light meets; s is the smooth one there.

    What goes `through` is seen from the other side.
    """
    a, b, c = float(numbers[lobe, NORMAL]), float(numbers[lobe, NORMAL + 1]), float(numbers[lobe, NORMAL + 2])
    side = 1.0 if front else -1.0
    if front == through and bump & MIRRORED != 0:
        a, b = -a, -b
    p = corner(vertices, triangles, triangle, 0)
    q = corner(vertices, triangles, triangle, 1)
    r = corner(vertices, triangles, triangle, 2)
    u0, v0 = float(uvs[triangle, 0, 0]), float(uvs[triangle, 0, 1])
    u1, v1 = float(uvs[triangle, 1, 0]), float(uvs[triangle, 1, 1])
    u2, v2 = float(uvs[triangle, 2, 0]), float(uvs[triangle, 2, 1])
    x, y, z = placed_normal(a, b, c, side * sx, side * sy, side * sz, p, q, r, u0, v0, u1, v1, u2, v2)
    return side * x, side * y, side * z


@inlined
def view_cosine(bump, below, cosine, ox, oy, oz, gx, gy, gz, nx, ny, nz, sx, sy, sz):
    """Return the cosine by which a lobe's `view` is looked up.

    Parameters
    ----------
    below
        The lobe lies below layers: it reflects diffusely.
    cosine
        That of o to the lobe's normal, where it has none of its own.
    o, g, n, s
        Where it is seen from; the geometric normal, the lobe's, and the smooth one on that side.
    """
    if bump & MIXED != 0:
        return abs(ox * sx + oy * sy + oz * sz)
    if bump != 0 and below:
        # What lies above is glossy: it is seen by the normal that it is turned to.
        x, y, z = valid_normal(gx, gy, gz, ox, oy, oz, nx, ny, nz)
        return ox * x + oy * y + oz * z
    return cosine
