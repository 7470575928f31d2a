# SPDX-License-Identifier: GPL-3.0-or-later
"""A photon meets a surface: diffuse reflection and Russian roulette.

What else a surface may do is left to `lobe_scattering`.

A photon of weight w arrives along −ω at a surface of albedo ρ with geometric normal g and shading
normal s, both on the side it arrives at. It is reflected with density cos θ/π around g and weight

    w' = ρ w max(0, ω·s) / (ω·g).

With s = g this is diffuse reflection; else it is its adjoint for shading normals (Veach, "Robust
Monte Carlo Methods for Light Transport Simulation", 1997, §5.3): the surface then sends out what
Cycles, which lights it by s, sees it send. The photon survives with probability
q = min(1, max |w'|/w₀), w₀ what emission calls the standard of the photon's weight, and weight w'/q:
the expectation is w', and weights stay of the order that emission gave them.
"""

from __future__ import annotations

import numpy as np

from .compiled import kernel, merged
from .embree import MISS
from .random import STREAM_SCATTER, random4
from .scene import NO_TEXTURE
from .surface_bins import BACK, FRONT, patch_of
from .surfaces import corner, place_at, shading_normal, texture_coordinates
from .tally import WEIGHT_LIMIT
from .textures import surface_albedo
from .vectors import cosine_direction, largest_of, offset_distance

ENERGY_STEPS = float(1 << 30)
"""Fixed-point steps of the energy sums for a weight of one."""

ESCAPED = 0
ABSORBED = 1
CUT = 2
"""Rows of the energy sums: left the scene, absorbed by surfaces, still alive after the last
bounce."""


@kernel
def scatter(
    photons,
    origins,
    directions,
    weights,
    bounces,
    dark,
    standard,
    hit_triangle,
    hit_u,
    hit_v,
    seed,
    flight,
    most_bounces,
    surfaces,
    counted_from,
    landed,
    brought,
    energy,
    waiting,
):
    """Scatter n photons at their hits; survivors move to the front of the arrays.

    Parameters
    ----------
    photons : (n,) int64
        Indices, which address the random numbers.
    origins, directions, weights : (n, 3) float32
        The flights that ended; changed in place into the survivors' next flights.
    bounces : (n,) int16
        How often each has bounced; changed in place.
    dark : (n,) float32
        See `emission.leave_darkness`; moved with the survivors.
    standard : (2^k,) float32
        w₀ by the last k bits of a photon's index.
    hit_triangle : (n,) int32, hit_u, hit_v : (n,) float32
        From `embree.Tracer.intersect`.
    seed
        Key of the random numbers.
    flight
        Flights that the photons had before the one that ended.
    most_bounces
        After so many bounces no further one follows.
    surfaces : Surfaces
    counted_from
        Light that has bounced so often is the grid's.
    landed : (2 n,) int64, brought : (2 n, 3) float32
        Filled with 2 · patch + side of all arrivals, and what weight of the grid's light arrived there: see `Landings`.
    energy : (3, 3) int64
        Rows `ESCAPED`, `ABSORBED`, `CUT` by channel, in `ENERGY_STEPS`; changed in place.

    waiting : (n, 2) int32
        Filled with the photons that met special surfaces: their row among the survivors, where `lobe_scattering`
        finds the flight that ended (but its origin), and the row of their hit.

    Returns
    -------
    alive, late, arrivals : int
        The number of survivors, waiting ones included; that of those that wait; and of arrivals so far.
    """
    vertices, triangles, planes = surfaces.vertices, surfaces.triangles, surfaces.planes
    smooth, material, special = surfaces.smooth, surfaces.material, surfaces.special
    albedo, texture, back = surfaces.albedo, surfaces.texture, surfaces.back
    bin_divisions, bin_offset = surfaces.bin_divisions, surfaces.bin_offset
    standard_mask = len(standard) - 1
    arrivals = 0
    alive = 0
    late = 0
    for ray in range(len(photons)):
        triangle = hit_triangle[ray]
        w0, w1, w2 = float(weights[ray, 0]), float(weights[ray, 1]), float(weights[ray, 2])
        if triangle == MISS:
            add_energy(energy, ESCAPED, w0, w1, w2)
            continue
        dx, dy, dz = float(directions[ray, 0]), float(directions[ray, 1]), float(directions[ray, 2])
        if special[triangle]:
            waiting[late, 0], waiting[late, 1] = alive, ray
            late += 1
            photons[alive], bounces[alive], dark[alive] = photons[ray], bounces[ray], dark[ray]
            store(directions, alive, dx, dy, dz)
            store(weights, alive, w0, w1, w2)
            alive += 1
            continue
        u, v = float(hit_u[ray]), float(hit_v[ray])
        gx, gy, gz = float(planes[triangle, 0]), float(planes[triangle, 1]), float(planes[triangle, 2])
        cos_g = -(dx * gx + dy * gy + dz * gz)
        side = FRONT if cos_g > 0.0 else BACK
        landed[arrivals] = 2 * patch_of(triangle, u, v, bin_divisions, bin_offset) + side
        share = 1.0 if bounces[ray] >= counted_from else 0.0
        store(brought, arrivals, share * w0, share * w1, share * w2)
        arrivals += 1
        # The textures' arrays are touched only where there is one: Numba counts references to them.
        surface = material[triangle] if side == FRONT else back[material[triangle]]
        red, green, blue = float(albedo[surface, 0]), float(albedo[surface, 1]), float(albedo[surface, 2])
        if texture[surface] != NO_TEXTURE:
            s, t = texture_coordinates(surfaces.uvs, triangle, u, v)
            red, green, blue = surface_albedo(surface, s, t, albedo, texture, surfaces.pool)
        r0, r1, r2 = w0 * red, w1 * green, w2 * blue
        if smooth[triangle]:
            # max(0, ω·s) / (ω·g): both cosines change sign on the back side, their ratio does not.
            sx, sy, sz = shading_normal(surfaces.corner_normals, triangle, u, v)
            cos_s = -(dx * sx + dy * sy + dz * sz)
            factor = max(0.0, cos_s / cos_g) if cos_g != 0.0 else 0.0
            r0, r1, r2 = r0 * factor, r1 * factor, r2 * factor
        largest = largest_of(r0, r1, r2)
        if largest > WEIGHT_LIMIT:
            # Grazing hits on a coarse smooth mesh, several in a row: too rare to be measured.
            cap = WEIGHT_LIMIT / largest
            r0, r1, r2, largest = r0 * cap, r1 * cap, r2 * cap, WEIGHT_LIMIT
        add_energy(energy, ABSORBED, w0 - r0, w1 - r1, w2 - r2)
        if bounces[ray] >= most_bounces:
            add_energy(energy, CUT, r0, r1, r2)
            continue
        survival = min(1.0, largest / standard[photons[ray] & standard_mask])
        xi_u, xi_v, xi_survival, _ = random4(seed, photons[ray], STREAM_SCATTER + flight)
        if xi_survival >= survival:
            continue

        if side == BACK:
            gx, gy, gz = -gx, -gy, -gz
        p = corner(vertices, triangles, triangle, 0)
        q = corner(vertices, triangles, triangle, 1)
        r = corner(vertices, triangles, triangle, 2)
        x, y, z = place_at(p, q, r, u, v)
        away = offset_distance(x, y, z, float(planes[triangle, 3]))
        ox, oy, oz = cosine_direction(gx, gy, gz, xi_u, xi_v)
        photons[alive], bounces[alive], dark[alive] = photons[ray], bounces[ray] + 1, 0.0
        store(origins, alive, x + away * gx, y + away * gy, z + away * gz)
        store(directions, alive, ox, oy, oz)
        store(weights, alive, r0 / survival, r1 / survival, r2 / survival)
        alive += 1
    return alive, late, arrivals


@merged
def store(rows, row, x, y, z):
    """Write one float32 row."""
    rows[row, 0] = np.float32(x)
    rows[row, 1] = np.float32(y)
    rows[row, 2] = np.float32(z)


@merged
def add_energy(energy, row, red, green, blue):
    """Add a weight to one row of the energy sums."""
    energy[row, 0] += np.int64(red * ENERGY_STEPS)
    energy[row, 1] += np.int64(green * ENERGY_STEPS)
    energy[row, 2] += np.int64(blue * ENERGY_STEPS)
