# SPDX-License-Identifier: GPL-3.0-or-later
"""What camera rays see of the surfaces that they meet: how much of even light each diffuse lobe sends towards them.

Seen from o, a surface in light of irradiance E shows the radiance Σ ρ_l(o) E(p, n_l) / π of its diffuse lobes l, each
with its own normal n_l; of translucent ones E is that of the other side. With f the lobe's reflectance at all
directions, ρ(o) = ∫ f(o, i) cos_i di: a colour, times what the layers above let out towards o. What mirrors and glass
show is not diffuse; through transparent surfaces, rays go on.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .compiled import kernel, merged
from .embree import MISS, Tracer
from .lobe_choice import lobe_color, look_up_lobes
from .lobe_normals import own_normal, view_cosine
from .lobe_scattering import MOST_PASSAGES
from .lobes import BUMP, COLOR, KIND, NO_VIEW, ROUGHNESS, SECOND, VIEW
from .matte import SMOOTH, rough_albedo, view_factor
from .scattering import store
from .scene import MATTE, NO_TEXTURE, SHEEN, TRANSLUCENT, TRANSPARENT, Float32
from .surfaces import Surfaces, corner, place_at, shading_normal, texture_coordinates
from .textures import surface_albedo
from .vectors import largest_of, offset_distance, unit

Float64 = NDArray[np.float64]

_LEAST_CARRIED = 1e-4
"""Rays end where less is left of them."""


@dataclass(frozen=True)
class SeenLobes:
    """Diffuse lobes that rays meet, n of them.

    Parameters
    ----------
    met : (k,) int64
        Rays that meet a surface, whatever it is.
    ray : (n,) int64
        Which ray; one may meet several lobes.
    points : (n, 3) float64
        Metres.
    facing : (n, 3) float64
        The surface's smooth normal on the side that the light comes from.
    normals : (n, 3) float64
        The lobe's own.
    reflectance : (n, 3) float64
        ρ(o), times what the ray still carries.
    """

    met: NDArray[np.int64]
    ray: NDArray[np.int64]
    points: Float64
    facing: Float64
    normals: Float64
    reflectance: Float64


class DiffuseView:
    """The surfaces of a scene as camera rays see them."""

    def __init__(self, surfaces: Surfaces) -> None:
        self._surfaces = surfaces
        kinds = surfaces.lobes.codes[:, KIND]
        of = np.repeat(np.arange(len(surfaces.lobes.matte)), np.diff(surfaces.lobes.first))
        diffuse = np.isin(kinds, (MATTE, SHEEN, TRANSLUCENT))
        self._most = 1 + int(np.bincount(of[diffuse], minlength=1).max())
        self.has_bumps = bool((surfaces.lobes.codes[diffuse, BUMP] != 0).any())
        """Whether some lobe's normal may be another one than the surface's."""

    def along(self, tracer: Tracer, origins: Float32, directions: Float32, reach: float) -> Iterator[SeenLobes]:
        """Yield what rays see where they first meet something, then what those see that go on.

        Parameters
        ----------
        origins, directions : (n, 3) float32
            Of the rays.
        reach
            How far they see, in units of their directions' lengths.
        """
        rays = np.arange(len(origins))
        carried, gone = np.ones((len(rays), 3)), np.zeros(len(rays))
        for _ in range(MOST_PASSAGES + 1):
            hits = tracer.intersect(origins[rays], directions[rays])
            gone[rays] += hits.distance
            met = np.flatnonzero((hits.triangle != MISS) & (gone[rays] <= reach))
            rays = rays[met]
            capacity = self._most * len(rays)
            ray = np.empty(capacity, dtype=np.int64)
            points, facing, normals, reflectance = (np.empty((capacity, 3)) for _ in range(4))
            count = see(
                *(rays, hits.triangle[met], hits.u[met], hits.v[met], origins, directions, self._surfaces, carried),
                *(ray, points, facing, normals, reflectance),
            )
            yield SeenLobes(rays, ray[:count], points[:count], facing[:count], normals[:count], reflectance[:count])
            rays = rays[carried[rays].any(axis=1)]
            if len(rays) == 0:
                return


@kernel
def see(
    rays, triangle, hit_u, hit_v, origins, directions, surfaces, carried, ray, points, facing, normals, reflectance
):
    """Fill the arrays of `SeenLobes` by what `rays` (k,) meet; return how many lobes there are.

    triangle, hit_u, hit_v : (k,)
        What each of them meets.
    origins : (n, 3) float32
        Of all rays; changed to where they go on.
    carried : (n, 3) float64
        What all rays carry, per channel; changed to what transparent lobes let go on, 0 where that is next to nothing.
    """
    vertices, triangles, uvs = surfaces.vertices, surfaces.triangles, surfaces.uvs
    first, codes, views = surfaces.lobes.first, surfaces.lobes.codes, surfaces.lobes.views
    # The table as it is where the ray is: texture by texture looked up.
    numbers = surfaces.lobes.numbers.copy()
    count = 0
    for index in range(len(rays)):
        row, t, u, v = rays[index], triangle[index], float(hit_u[index]), float(hit_v[index])
        o = unit(-float(directions[row, 0]), -float(directions[row, 1]), -float(directions[row, 2]))
        front, g, s = _side_seen(surfaces.planes, surfaces.smooth, surfaces.corner_normals, t, u, v, o)
        material = surfaces.material[t] if front else surfaces.back[surfaces.material[t]]
        p = corner(vertices, triangles, t, 0)
        x, y, z = place_at(p, corner(vertices, triangles, t, 1), corner(vertices, triangles, t, 2), u, v)
        a, b = texture_coordinates(uvs, t, u, v)
        start, stop = first[material], first[material + 1]
        if surfaces.lobes.textured[material]:
            look_up_lobes(numbers, surfaces.lobes.numbers, codes, start, stop, surfaces.pool, a, b)
        on0, on1, on2 = 0.0, 0.0, 0.0
        # Before the lobes comes what is nothing but a cosine.
        for lobe in range(start if surfaces.lobes.matte[material] else start - 1, stop):
            kind = MATTE if lobe < start else codes[lobe, KIND]
            if kind != MATTE and kind != SHEEN and kind != TRANSLUCENT and kind != TRANSPARENT:
                continue
            n = s
            if lobe < start:
                f0, f1, f2 = lobe_color(surfaces.albedo, material, 0)
                # The textures' arrays are touched only where there is one: Numba counts references to them.
                if surfaces.texture[material] != NO_TEXTURE:
                    f0, f1, f2 = surface_albedo(material, a, b, surfaces.albedo, surfaces.texture, surfaces.pool)
            else:
                if codes[lobe, BUMP] != 0:
                    n = own_normal(
                        numbers, lobe, codes[lobe, BUMP], front, False, s[0], s[1], s[2], vertices, triangles, uvs, t
                    )
                f0, f1, f2 = _seen_color(numbers, codes, views, lobe, o, g, n, s)
            f0, f1, f2 = carried[row, 0] * f0, carried[row, 1] * f1, carried[row, 2] * f2
            if kind == TRANSPARENT:
                on0, on1, on2 = on0 + f0, on1 + f1, on2 + f2
            elif largest_of(f0, f1, f2) > 0.0:
                side = -1.0 if kind == TRANSLUCENT else 1.0
                ray[count] = row
                points[count, 0], points[count, 1], points[count, 2] = x, y, z
                reflectance[count, 0], reflectance[count, 1], reflectance[count, 2] = f0, f1, f2
                for axis in range(3):
                    facing[count, axis], normals[count, axis] = side * s[axis], side * n[axis]
                count += 1
        if largest_of(on0, on1, on2) < _LEAST_CARRIED:
            on0, on1, on2 = 0.0, 0.0, 0.0
        carried[row, 0], carried[row, 1], carried[row, 2] = on0, on1, on2
        away = offset_distance(x, y, z, float(surfaces.planes[t, 3]))
        store(origins, row, x - away * g[0], y - away * g[1], z - away * g[2])
    return count


@merged
def _side_seen(planes, smooth, corner_normals, t, u, v, o):
    """Return whether o sees a triangle's front, and the geometric and the smooth normal on the side that it sees."""
    g = (float(planes[t, 0]), float(planes[t, 1]), float(planes[t, 2]))
    s = g
    if smooth[t]:
        x, y, z = shading_normal(corner_normals, t, u, v)
        if x != 0.0 or y != 0.0 or z != 0.0:
            s = (x, y, z)
    front = o[0] * g[0] + o[1] * g[1] + o[2] * g[2] >= 0.0
    side = 1.0 if front else -1.0
    return front, (side * g[0], side * g[1], side * g[2]), (side * s[0], side * s[1], side * s[2])


@merged
def _seen_color(numbers, codes, views, lobe, o, g, n, s):
    """Return what of even light a lobe sends towards o; its normal is n."""
    cosine = o[0] * n[0] + o[1] * n[1] + o[2] * n[2]
    f0, f1, f2 = lobe_color(numbers, lobe, COLOR)
    kind, roughness = codes[lobe, KIND], float(numbers[lobe, ROUGHNESS])
    if kind == MATTE and roughness >= SMOOTH:
        m0, m1, m2 = lobe_color(numbers, lobe, SECOND)
        f0 *= rough_albedo(cosine, roughness, m0)
        f1 *= rough_albedo(cosine, roughness, m1)
        f2 *= rough_albedo(cosine, roughness, m2)
    if codes[lobe, VIEW] != NO_VIEW:
        below = kind == MATTE or kind == SHEEN
        bump = codes[lobe, BUMP]
        cosine = view_cosine(
            bump, below, cosine, o[0], o[1], o[2], g[0], g[1], g[2], n[0], n[1], n[2], s[0], s[1], s[2]
        )
        m0, m1, m2 = view_factor(views, codes[lobe, VIEW], cosine)
        f0, f1, f2 = f0 * m0, f1 * m1, f2 * m2
    return f0, f1, f2
