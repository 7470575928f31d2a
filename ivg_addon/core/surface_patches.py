# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the patches of `surface_bins` lie, and how large they are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .compiled import kernel, merged
from .scene import Float32, Geometry, Int32
from .surface_bins import SurfaceBins
from .surfaces import corner


@dataclass(frozen=True)
class Patches:
    """All patches of a scene.

    Parameters
    ----------
    centre : (p, 3) float32
        Of the part within the triangle; metres.
    area : (p,) float32
        Of that part, m²; 0 for patches that have none.
    triangle : (p,) int32
    """

    centre: Float32
    area: Float32
    triangle: Int32

    @classmethod
    def of(cls, geometry: Geometry, bins: SurfaceBins) -> Patches:
        """Measure them."""
        centre = np.zeros((bins.count, 3), dtype=np.float32)
        area = np.zeros(bins.count, dtype=np.float32)
        triangle = np.zeros(bins.count, dtype=np.int32)
        measure(geometry.vertices, geometry.triangles, bins.divisions, bins.offset, centre, area, triangle)
        return cls(centre, area, triangle)


@kernel
def measure(vertices, triangles, divisions, offset, centre, area, owner):
    """Fill the arrays of `Patches`.

    A patch is a rectangle [a, a + 1]/m × [b, b + 1]/n of barycentric coordinates s, t; the triangle is s + t ≤ 1.
    """
    s, t = np.empty(5), np.empty(5)
    for triangle in range(len(triangles)):
        c, m, n = divisions[triangle, 0], divisions[triangle, 1], divisions[triangle, 2]
        p = corner(vertices, triangles, triangle, c)
        q = corner(vertices, triangles, triangle, (c + 1) % 3)
        r = corner(vertices, triangles, triangle, (c + 2) % 3)
        ux, uy, uz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
        vx, vy, vz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        whole = np.sqrt(x * x + y * y + z * z)
        for a in range(m):
            for b in range(n):
                patch = offset[triangle] + a * n + b
                owner[patch] = triangle
                corners = _within(a / m, (a + 1.0) / m, b / n, (b + 1.0) / n, s, t)
                # The centre of a polygon is that of the triangles which it falls into.
                double, along_s, along_t = 0.0, 0.0, 0.0
                for i in range(1, corners - 1):
                    part = (s[i] - s[0]) * (t[i + 1] - t[0]) - (s[i + 1] - s[0]) * (t[i] - t[0])
                    double += part
                    along_s += part * (s[0] + s[i] + s[i + 1]) / 3.0
                    along_t += part * (t[0] + t[i] + t[i + 1]) / 3.0
                if double > 0.0:
                    area[patch] = 0.5 * double * whole
                    along_s, along_t = along_s / double, along_t / double
                    centre[patch, 0] = p[0] + along_s * ux + along_t * vx
                    centre[patch, 1] = p[1] + along_s * uy + along_t * vy
                    centre[patch, 2] = p[2] + along_s * uz + along_t * vz


@merged
def _within(s0, s1, t0, t1, s, t):
    """Fill s, t with the corners of the part of a rectangle where s + t ≤ 1, counter-clockwise; return how many."""
    count = 0
    for i in range(4):
        sa, ta = (s1 if i == 1 or i == 2 else s0), (t1 if i >= 2 else t0)
        sb, tb = (s1 if i < 2 else s0), (t1 if i == 1 or i == 2 else t0)
        inside, next_inside = 1.0 - sa - ta, 1.0 - sb - tb
        if inside >= 0.0:
            s[count], t[count] = sa, ta
            count += 1
        if (inside > 0.0 and next_inside < 0.0) or (inside < 0.0 and next_inside > 0.0):
            f = inside / (inside - next_inside)
            s[count], t[count] = sa + f * (sb - sa), ta + f * (tb - ta)
            count += 1
    return count


@kernel
def spokes(vertices, triangles, divisions, offset, patches, of_triangle, which, ends):
    """Fill ends (n, 3) with a corner, 0 to 3, of each of n patches: of the whole rectangle held within the triangle."""
    for row in range(len(patches)):
        triangle = of_triangle[row]
        c, m, n = divisions[triangle, 0], divisions[triangle, 1], divisions[triangle, 2]
        index = patches[row] - offset[triangle]
        s = (index // n + (1 if which == 1 or which == 2 else 0)) / m
        t = (index % n + (1 if which >= 2 else 0)) / n
        beyond = max(1.0, s + t)
        s, t = s / beyond, t / beyond
        p = corner(vertices, triangles, triangle, c)
        q = corner(vertices, triangles, triangle, (c + 1) % 3)
        r = corner(vertices, triangles, triangle, (c + 2) % 3)
        for axis in range(3):
            ends[row, axis] = p[axis] + s * (q[axis] - p[axis]) + t * (r[axis] - p[axis])
