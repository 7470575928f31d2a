"""A photon meets a surface: diffuse reflection and Russian roulette.

A photon of weight w arrives along −ω at a surface of albedo ρ with geometric normal g and shading
normal s, both on the side it arrives at. It is reflected with density cos θ/π around g and weight

    w' = ρ w max(0, ω·s) / (ω·g).

With s = g this is diffuse reflection; else it is its adjoint for shading normals (Veach, "Robust
Monte Carlo Methods for Light Transport Simulation", 1997, §5.3): the surface then sends out what
Cycles, which lights it by s, sees it send. The photon survives with probability
q = min(1, max(w')), with weight w'/q: the expectation is w', and weights stay of order one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .compiled import inlined, kernel
from .embree import MISS
from .random import STREAM_SCATTER, random4
from .scene import Float32, Int32, Scene
from .surface_bins import BACK, FRONT, SurfaceBins, patch_of
from .tally import WEIGHT_LIMIT
from .textures import TexturePool, pack_textures, surface_albedo
from .vectors import cosine_direction, offset_distance

ENERGY_STEPS = float(1 << 30)
"""Fixed-point steps of the energy sums for a weight of one."""

ESCAPED = 0
ABSORBED = 1
CUT = 2
"""Rows of the energy sums: left the scene, absorbed by surfaces, still alive after the last
bounce."""


class Surfaces(NamedTuple):
    """The scene's surfaces as kernels see them; fields as in `scene.Geometry` and `Materials`.

    reflects : (nt,) bool
        False for triangles that absorb all: diffuse rays do not see them.
    bin_divisions : (nt,) int32, bin_offset : (nt,) int64
        See `surface_bins.SurfaceBins`.
    """

    vertices: Float32
    triangles: Int32
    corner_normals: Float32
    uvs: Float32
    material: Int32
    reflects: NDArray[np.bool_]
    albedo: Float32
    texture: Int32
    pool: TexturePool
    bin_divisions: Int32
    bin_offset: NDArray[np.int64]

    @classmethod
    def of(cls, scene: Scene, bins: SurfaceBins) -> Surfaces:
        """Gather a scene's surfaces."""
        geometry = scene.geometry
        return cls(
            vertices=geometry.vertices,
            triangles=geometry.triangles,
            corner_normals=geometry.corner_normals,
            uvs=geometry.uvs,
            material=geometry.material,
            reflects=scene.diffuse_visible[geometry.object],
            albedo=scene.materials.albedo,
            texture=scene.materials.texture,
            pool=pack_textures(scene.textures),
            bin_divisions=bins.divisions,
            bin_offset=bins.offset,
        )


@inlined
def corner(vertices, triangles, triangle, index):
    """Return a triangle's corner as three float64."""
    vertex = triangles[triangle, index]
    return float(vertices[vertex, 0]), float(vertices[vertex, 1]), float(vertices[vertex, 2])


@inlined
def unit_normal(p, q, r):
    """Return the unit normal (p, q, r counter-clockwise) and the triangle's longest edge at p."""
    ax, ay, az = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    bx, by, bz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    extent = math.sqrt(max(ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz))
    if length == 0.0:
        return 0.0, 0.0, 1.0, extent
    return nx / length, ny / length, nz / length, extent


@inlined
def shading_normal(corner_normals, triangle, u, v):
    """Return the interpolated unit normal on the front side at barycentric coordinates u, v."""
    w = 1.0 - u - v
    x = w * corner_normals[triangle, 0, 0] + u * corner_normals[triangle, 1, 0] + v * corner_normals[triangle, 2, 0]
    y = w * corner_normals[triangle, 0, 1] + u * corner_normals[triangle, 1, 1] + v * corner_normals[triangle, 2, 1]
    z = w * corner_normals[triangle, 0, 2] + u * corner_normals[triangle, 1, 2] + v * corner_normals[triangle, 2, 2]
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return 0.0, 0.0, 0.0
    return x / length, y / length, z / length


@inlined
def texture_coordinates(uvs, triangle, u, v):
    """Return the texture coordinates at barycentric coordinates u, v."""
    w = 1.0 - u - v
    return (
        w * uvs[triangle, 0, 0] + u * uvs[triangle, 1, 0] + v * uvs[triangle, 2, 0],
        w * uvs[triangle, 0, 1] + u * uvs[triangle, 1, 1] + v * uvs[triangle, 2, 1],
    )


@kernel
def scatter(
    photons,
    origins,
    directions,
    weights,
    hit_triangle,
    hit_u,
    hit_v,
    seed,
    bounce,
    last,
    surfaces,
    bin_counts,
    energy,
):
    """Scatter n photons at their hits; survivors move to the front of the arrays.

    Parameters
    ----------
    photons : (n,) int64
        Indices, which address the random numbers.
    origins, directions, weights : (n, 3) float32
        The flights that ended; changed in place into the survivors' next flights.
    hit_triangle : (n,) int32, hit_u, hit_v : (n,) float32
        From `embree.Tracer.intersect`.
    seed
        Key of the random numbers.
    bounce
        Bounces that the photons had before this one.
    last
        True when no further flight follows.
    surfaces : Surfaces
    bin_counts : (patches, 2) int32
        Photons received per patch and side; changed in place.
    energy : (3, 3) int64
        Rows `ESCAPED`, `ABSORBED`, `CUT` by channel, in `ENERGY_STEPS`; changed in place.

    Returns
    -------
    int
        The number of survivors.
    """
    alive = 0
    for ray in range(len(photons)):
        triangle = hit_triangle[ray]
        w0, w1, w2 = float(weights[ray, 0]), float(weights[ray, 1]), float(weights[ray, 2])
        if triangle == MISS:
            _add_energy(energy, ESCAPED, w0, w1, w2)
            continue
        u, v = float(hit_u[ray]), float(hit_v[ray])
        p = corner(surfaces.vertices, surfaces.triangles, triangle, 0)
        q = corner(surfaces.vertices, surfaces.triangles, triangle, 1)
        r = corner(surfaces.vertices, surfaces.triangles, triangle, 2)
        gx, gy, gz, extent = unit_normal(p, q, r)
        dx, dy, dz = float(directions[ray, 0]), float(directions[ray, 1]), float(directions[ray, 2])
        cos_g = -(dx * gx + dy * gy + dz * gz)
        side = FRONT if cos_g > 0.0 else BACK
        patch = patch_of(triangle, u, v, surfaces.bin_divisions, surfaces.bin_offset)
        bin_counts[patch, side] += 1
        if not surfaces.reflects[triangle]:
            _add_energy(energy, ABSORBED, w0, w1, w2)
            continue

        # ρ max(0, ω·s) / (ω·g): both cosines change sign on the back side, their ratio does not.
        sx, sy, sz = shading_normal(surfaces.corner_normals, triangle, u, v)
        factor = max(0.0, -(dx * sx + dy * sy + dz * sz) / cos_g) if cos_g != 0.0 else 0.0
        s, t = texture_coordinates(surfaces.uvs, triangle, u, v)
        red, green, blue = surface_albedo(
            surfaces.material[triangle], s, t, surfaces.albedo, surfaces.texture, surfaces.pool
        )
        r0, r1, r2 = w0 * red * factor, w1 * green * factor, w2 * blue * factor
        largest = max(r0, max(r1, r2))
        if largest > WEIGHT_LIMIT:
            # Grazing hits on a coarse smooth mesh, several in a row: too rare to be measured.
            cap = WEIGHT_LIMIT / largest
            r0, r1, r2, largest = r0 * cap, r1 * cap, r2 * cap, WEIGHT_LIMIT
        _add_energy(energy, ABSORBED, w0 - r0, w1 - r1, w2 - r2)
        if last:
            _add_energy(energy, CUT, r0, r1, r2)
            continue
        survival = min(1.0, largest)
        xi_u, xi_v, xi_survival, _ = random4(seed, photons[ray], STREAM_SCATTER + bounce)
        if xi_survival >= survival:
            continue

        if side == BACK:
            gx, gy, gz = -gx, -gy, -gz
        w = 1.0 - u - v
        x = w * p[0] + u * q[0] + v * r[0]
        y = w * p[1] + u * q[1] + v * r[1]
        z = w * p[2] + u * q[2] + v * r[2]
        away = offset_distance(x, y, z, extent)
        ox, oy, oz = cosine_direction(gx, gy, gz, xi_u, xi_v)
        photons[alive] = photons[ray]
        _store(origins, alive, x + away * gx, y + away * gy, z + away * gz)
        _store(directions, alive, ox, oy, oz)
        _store(weights, alive, r0 / survival, r1 / survival, r2 / survival)
        alive += 1
    return alive


@inlined
def _store(rows, row, x, y, z):
    """Write one float32 row."""
    rows[row, 0] = np.float32(x)
    rows[row, 1] = np.float32(y)
    rows[row, 2] = np.float32(z)


@inlined
def _add_energy(energy, row, red, green, blue):
    """Add a weight to one row of the energy sums."""
    energy[row, 0] += np.int64(red * ENERGY_STEPS)
    energy[row, 1] += np.int64(green * ENERGY_STEPS)
    energy[row, 2] += np.int64(blue * ENERGY_STEPS)
