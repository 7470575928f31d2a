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

from .compiled import kernel
from .embree import MISS, Tracer
from .lobe_choice import lobe_color, look_up_lobes
from .lobe_normals import own_normal, view_cosine
from .lobe_scattering import MOST_PASSAGES
from .lobes import BUMP, COLOR, KIND, NO_VIEW, ROUGHNESS, SECOND, VIEW
from .matte import SMOOTH, rough_albedo, view_factor
from .scene import MATTE, NO_TEXTURE, SHEEN, TRANSLUCENT, TRANSPARENT, Float32
from .surfaces import Surfaces, corner, place_at, shading_normal, texture_coordinates
from .textures import surface_albedo
from .vectors import largest_of, offset_distance

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
        w0, w1, w2 = carried[row, 0], carried[row, 1], carried[row, 2]
        carried[row, 0], carried[row, 1], carried[row, 2] = 0.0, 0.0, 0.0
        ox, oy, oz = -float(directions[row, 0]), -float(directions[row, 1]), -float(directions[row, 2])
        length = np.sqrt(ox * ox + oy * oy + oz * oz)
        ox, oy, oz = ox / length, oy / length, oz / length
        # g and s on the side that is seen.
        gx, gy, gz = float(surfaces.planes[t, 0]), float(surfaces.planes[t, 1]), float(surfaces.planes[t, 2])
        sx, sy, sz = gx, gy, gz
        if surfaces.smooth[t]:
            x, y, z = shading_normal(surfaces.corner_normals, t, u, v)
            if x != 0.0 or y != 0.0 or z != 0.0:
                sx, sy, sz = x, y, z
        front = ox * gx + oy * gy + oz * gz >= 0.0
        material = surfaces.material[t] if front else surfaces.back[surfaces.material[t]]
        if not front:
            gx, gy, gz, sx, sy, sz = -gx, -gy, -gz, -sx, -sy, -sz
        p, q, r = (
            corner(vertices, triangles, t, 0),
            corner(vertices, triangles, t, 1),
            corner(vertices, triangles, t, 2),
        )
        x, y, z = place_at(p, q, r, u, v)
        a, b = texture_coordinates(uvs, t, u, v)
        if surfaces.lobes.textured[material]:
            start, stop = first[material], first[material + 1]
            look_up_lobes(numbers, surfaces.lobes.numbers, codes, start, stop, surfaces.pool, a, b)
        for lobe in range(first[material] - 1, first[material + 1]):
            # Before the lobes comes what is nothing but a cosine.
            kind, bump = MATTE, 0
            nx, ny, nz = sx, sy, sz
            if lobe < first[material]:
                if surfaces.lobes.matte[material]:
                    continue
                # The textures' arrays are touched only where there is one: Numba counts references to them.
                f0, f1, f2 = lobe_color(surfaces.albedo, material, 0)
                if surfaces.texture[material] != NO_TEXTURE:
                    f0, f1, f2 = surface_albedo(material, a, b, surfaces.albedo, surfaces.texture, surfaces.pool)
            else:
                kind, bump = codes[lobe, KIND], codes[lobe, BUMP]
                if kind != MATTE and kind != SHEEN and kind != TRANSLUCENT and kind != TRANSPARENT:
                    continue
                if bump != 0:
                    nx, ny, nz = own_normal(numbers, lobe, bump, front, False, sx, sy, sz, vertices, triangles, uvs, t)
                cosine = ox * nx + oy * ny + oz * nz
                f0, f1, f2 = lobe_color(numbers, lobe, COLOR)
                if kind == MATTE and numbers[lobe, ROUGHNESS] >= SMOOTH:
                    roughness = float(numbers[lobe, ROUGHNESS])
                    m0, m1, m2 = lobe_color(numbers, lobe, SECOND)
                    f0 *= rough_albedo(cosine, roughness, m0)
                    f1 *= rough_albedo(cosine, roughness, m1)
                    f2 *= rough_albedo(cosine, roughness, m2)
                if codes[lobe, VIEW] != NO_VIEW:
                    below = kind == MATTE or kind == SHEEN
                    cosine = view_cosine(bump, below, cosine, ox, oy, oz, gx, gy, gz, nx, ny, nz, sx, sy, sz)
                    m0, m1, m2 = view_factor(views, codes[lobe, VIEW], cosine)
                    f0, f1, f2 = f0 * m0, f1 * m1, f2 * m2
            f0, f1, f2 = w0 * f0, w1 * f1, w2 * f2
            if kind == TRANSPARENT:
                carried[row, 0] += f0
                carried[row, 1] += f1
                carried[row, 2] += f2
            elif largest_of(f0, f1, f2) > 0.0:
                side = -1.0 if kind == TRANSLUCENT else 1.0
                ray[count] = row
                points[count, 0], points[count, 1], points[count, 2] = x, y, z
                facing[count, 0], facing[count, 1], facing[count, 2] = side * sx, side * sy, side * sz
                normals[count, 0], normals[count, 1], normals[count, 2] = side * nx, side * ny, side * nz
                reflectance[count, 0], reflectance[count, 1], reflectance[count, 2] = f0, f1, f2
                count += 1
        if largest_of(carried[row, 0], carried[row, 1], carried[row, 2]) < _LEAST_CARRIED:
            carried[row, 0], carried[row, 1], carried[row, 2] = 0.0, 0.0, 0.0
        else:
            away = offset_distance(x, y, z, float(surfaces.planes[t, 3]))
            origins[row, 0] = np.float32(x - away * gx)
            origins[row, 1] = np.float32(y - away * gy)
            origins[row, 2] = np.float32(z - away * gz)
    return count
