# SPDX-License-Identifier: GPL-3.0-or-later
"""A photon meets a surface with lobes: which of them it follows, where to, and what it carries on.

Of light from direction i, Cycles sees a surface send the radiance f(o, i) |i·s| L(i) towards o, s the shading normal.
Photons of that light arrive in proportion to |i·g| and leave in proportion to |o·g|, g the geometric normal; drawn with
density p(o) they must carry on

    w' = w f(o, i) |i·s| |o·g| / (|i·g| p(o))                                         [Veach 1997, §5.3]

For facets (`microfacets`; p(o) is the density of o as the image of i) this is

    reflection   w' = w R G₂/G₁ (|i·s| |o·g|) / (|i·g| |o·s|)
    refraction   w' = w T G₂/G₁ (|i·s| |o·g|) / (|i·g| |o·s|) (n_i/n_o)²

with n the index of refraction on either side, and for diffuse lobes (`matte`, `sheen`; p(o) = |o·g| / π)

    w' = w π f(o, i) |i·s| / |i·g|.

Lobes that have normals of their own, by bump or normal maps, have these in place of s; `bumps` has what comes with it.

A pane sends what facets reflect to the other side, mirrored. What Cycles takes off a lobe by the direction of view
(layers above it, mixes by Fresnel) is a factor of o.

Flux that is refracted keeps its power, and the radiance that it makes changes by (n_o/n_i)² [Veach 1997, §5.2]. Cycles
leaves that factor out of radiance; what it computes is the light of photons that carry (n_i/n_o)² times as much.
Through a closed body the factors cancel; in glass, and behind a single sheet of it, they do not. They say nothing of
how important a photon is, so roulette leaves them out.

`lobe_choice` picks the lobe. Roulette then lets the photon live by what is left: at a diffuse or translucent lobe the
whole weight decides, as in `scattering`; else what the lobe took off it.

Light that arrives behind the shading normal, and light that facets send through the surface though they reflect it (or
back though they refract it), is absorbed: no light leaks. Cycles turns shading normals of grazing views a little
instead, so that their mirror image stays above the surface.
"""

from __future__ import annotations

from .bumps import BENT, bumped_facets, softening
from .compiled import inlined, kernel, merged
from .lobe_choice import (
    DIFFUSE,
    TRANSMITS,
    facet_fate,
    glass_part,
    lobe_color,
    look_up_lobes,
    pick_lobe,
)
from .lobe_normals import own_normal, view_cosine
from .lobes import BACK_ENERGY, BUMP, COLOR, FRONT_ENERGY, IOR, KIND, NO_ENERGY, NO_VIEW, ROUGHNESS, SECOND, VIEW
from .matte import SMOOTH, rough_diffuse, view_factor
from .microfacets import CLEAR, MIRROR_ALPHA, energy_factor, refracted_cosine, shadowing, visible_normal
from .random import STREAM_SCATTER, random4
from .scattering import ABSORBED, CUT, ESCAPED, add_energy, store
from .scene import GLASS, GLOSSY, MATTE, NO_TEXTURE, PANE, REFRACTION, SHEEN, TRANSLUCENT, TRANSPARENT
from .sheen import sheen_shape
from .surface_bins import BACK, FRONT, patch_of
from .surfaces import corner, place_at, shading_normal, texture_coordinates
from .tally import WEIGHT_LIMIT
from .textures import surface_albedo
from .vectors import cosine_direction, largest_of, offset_distance, orthonormal_basis

MOST_PASSAGES = 8
"""Transparent surfaces that a photon passes in its life: Cycles' default `transparent_max_bounces`."""
_DEAD = -1
"""Stands for the bounces of a photon that ended."""


@inlined
def _shadowing(cos_is, cos_ig, cos_os, cos_og, roughness, turned, transmitted, eta):
    """Return G₂/G₁ (|i·s| |o·g|) / (|i·g| |o·s|), 0 where o is on the wrong side of either normal.

    Cosines of o count from the side that it should be on.
    """
    if cos_og <= 0.0 or cos_os <= 0.0:
        return 0.0
    alpha = roughness * roughness
    scale = cos_is * cos_og / (cos_ig * cos_os) if turned else 1.0
    if alpha > MIRROR_ALPHA and not (transmitted and abs(eta - 1.0) < CLEAR):
        scale *= shadowing(cos_is, cos_os, alpha)
    return scale


@inlined
def _facet(ix, iy, iz, sx, sy, sz, cosine, alpha, u, v):
    """Return the unit normal of a facet that direction i sees; the surface's own for a mirror."""
    if alpha <= MIRROR_ALPHA:
        return sx, sy, sz
    tx, ty, tz, bx, by, bz = orthonormal_basis(sx, sy, sz)
    a, b, c = visible_normal(ix * tx + iy * ty + iz * tz, ix * bx + iy * by + iz * bz, cosine, alpha, u, v)
    return a * tx + b * bx + c * sx, a * ty + b * by + c * sy, a * tz + b * bz + c * sz


@inlined
def _is_spread(kind, roughness, ior):
    """Tell whether a lobe's facets are spread, so that `bumps` can draw them in several ways."""
    rough = roughness * roughness > MIRROR_ALPHA
    return rough and (kind == GLOSSY or ((kind == GLASS or kind == REFRACTION) and abs(ior - 1.0) >= CLEAR))


@inlined
def _image(ix, iy, iz, hx, hy, hz, eta, transmitted):
    """Return where a facet mirrors direction i to, or refracts it to (which must be possible)."""
    cosine = ix * hx + iy * hy + iz * hz
    if transmitted:
        along = cosine / eta - refracted_cosine(cosine, eta)
        return along * hx - ix / eta, along * hy - iy / eta, along * hz - iz / eta
    return 2.0 * cosine * hx - ix, 2.0 * cosine * hy - iy, 2.0 * cosine * hz - iz


@kernel
def scatter_at_lobes(
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
    alive,
    late,
    arrivals,
):
    """Scatter the photons that `scatter` left waiting; return how many live, which move to the front, and arrivals.

    Parameters are those of `scatter`, and the numbers that it returned.
    """
    vertices, triangles, planes, uvs = surfaces.vertices, surfaces.triangles, surfaces.planes, surfaces.uvs
    smooth, material, reflects, back = surfaces.smooth, surfaces.material, surfaces.reflects, surfaces.back
    albedo, texture, corner_normals = surfaces.albedo, surfaces.texture, surfaces.corner_normals
    bin_divisions, bin_offset = surfaces.bin_divisions, surfaces.bin_offset
    first, codes, textured = surfaces.lobes.first, surfaces.lobes.codes, surfaces.lobes.textured
    # The table as it is where the photon is: texture by texture looked up.
    numbers = surfaces.lobes.numbers.copy()
    energies, mean_energies, views = surfaces.lobes.energy, surfaces.lobes.mean_energy, surfaces.lobes.views
    for index in range(late - 1, -1, -1):
        row, ray = waiting[index, 0], waiting[index, 1]
        triangle = hit_triangle[ray]
        u, v = float(hit_u[ray]), float(hit_v[ray])
        w0, w1, w2 = float(weights[row, 0]), float(weights[row, 1]), float(weights[row, 2])
        # i points to where the light comes from; g and s to the side that this is on.
        ix, iy, iz = -float(directions[row, 0]), -float(directions[row, 1]), -float(directions[row, 2])
        gx, gy, gz = float(planes[triangle, 0]), float(planes[triangle, 1]), float(planes[triangle, 2])
        cos_ig = ix * gx + iy * gy + iz * gz
        sx, sy, sz = gx, gy, gz
        turned = smooth[triangle]
        if turned:
            sx, sy, sz = shading_normal(corner_normals, triangle, u, v)
        front = cos_ig > 0.0
        side = FRONT if front else BACK
        near, far = material[triangle], back[material[triangle]]
        if not front:
            near, far = far, near
            cos_ig, gx, gy, gz, sx, sy, sz = -cos_ig, -gx, -gy, -gz, -sx, -sy, -sz
        cos_is = ix * sx + iy * sy + iz * sz if turned else cos_ig
        lit = dark[row] == 0.0
        patch = patch_of(triangle, u, v, bin_divisions, bin_offset)
        if lit:
            landed[arrivals] = 2 * patch + side
            share = 1.0 if bounces[row] >= counted_from else 0.0
            store(brought, arrivals, share * w0, share * w1, share * w2)
            arrivals += 1
        # Where no light arrives yet, and what diffuse rays do not see, lets photons pass and does nothing else.
        scatters = lit and reflects[triangle] and cos_is > 0.0 and cos_ig > 0.0
        s, t = texture_coordinates(uvs, triangle, u, v)

        xi_u, xi_v, xi_survival, xi = random4(seed, photons[row], STREAM_SCATTER + flight)
        diffuse_share = 0.0
        f0, f1, f2 = 0.0, 0.0, 0.0
        if scatters and not surfaces.lobes.matte[near]:
            f0, f1, f2 = float(albedo[near, 0]), float(albedo[near, 1]), float(albedo[near, 2])
            if texture[near] != NO_TEXTURE:
                f0, f1, f2 = surface_albedo(near, s, t, albedo, texture, surfaces.pool)
            diffuse_share = largest_of(w0 * f0, w1 * f1, w2 * f2)
        for described in (near, far):
            if textured[described]:
                look_up_lobes(
                    numbers, surfaces.lobes.numbers, codes, first[described], first[described + 1], surfaces.pool, s, t
                )
        cosine = cos_is if scatters else 0.0
        chosen, part, odds, xi = pick_lobe(
            first, codes, numbers, views, near, far, front, cosine, diffuse_share, w0, w1, w2, xi
        )
        if odds == 0.0:
            add_energy(energy, ABSORBED if lit else ESCAPED, w0, w1, w2)
            bounces[row] = _DEAD
            continue

        kind = DIFFUSE if chosen == DIFFUSE else codes[chosen, KIND]
        scale, radiance_scale = 1.0 / odds, 1.0
        transmitted = kind == TRANSLUCENT or kind == TRANSPARENT
        ox, oy, oz = -ix, -iy, -iz
        diffuse = kind == DIFFUSE or kind == MATTE or kind == SHEEN or kind == TRANSLUCENT
        bump = 0 if kind == DIFFUSE else codes[chosen, BUMP]
        spread, through = False, False
        ux, uy, uz = sx, sy, sz
        if bump != 0:
            if kind == GLASS:
                part, odds, xi = glass_part(part, cos_is, float(numbers[chosen, IOR]), front, xi)
                scale /= odds
            through = transmitted or kind == REFRACTION or kind == PANE or (kind == GLASS and part == TRANSMITS)
            nx, ny, nz = own_normal(
                numbers, chosen, bump, front, through, sx, sy, sz, vertices, triangles, uvs, triangle
            )
            cos_in = ix * nx + iy * ny + iz * nz
            if diffuse and bump & BENT == 0:
                scale *= softening(cos_is, sx * nx + sy * ny + sz * nz, cos_in)
            if bump & BENT != 0:
                ux, uy, uz = nx, ny, nz
            sx, sy, sz, cos_is, turned = nx, ny, nz, cos_in, True
            spread = _is_spread(kind, numbers[chosen, ROUGHNESS], numbers[chosen, IOR])
            if cos_is <= 0.0 and not spread:
                add_energy(energy, ABSORBED, w0, w1, w2)
                bounces[row] = _DEAD
                continue
        cos_os = abs(cos_is)
        if transmitted or kind == MATTE or kind == SHEEN:
            f0, f1, f2 = lobe_color(numbers, chosen, COLOR)
        if diffuse:
            sign = -1.0 if transmitted else 1.0
            ox, oy, oz = cosine_direction(sign * gx, sign * gy, sign * gz, xi_u, xi_v)
            if turned:
                scale *= cos_is / cos_ig
            cos_os = sign * (ox * sx + oy * sy + oz * sz)
            roughness = 0.0 if kind == DIFFUSE else float(numbers[chosen, ROUGHNESS])
            cosine = ix * ox + iy * oy + iz * oz
            if kind == SHEEN:
                scale *= sheen_shape(cos_is, cos_os, cosine, roughness)
            if kind == MATTE and roughness >= SMOOTH:
                m0, m1, m2 = lobe_color(numbers, chosen, SECOND)
                f0 *= rough_diffuse(cos_is, cos_os, cosine, roughness, m0)
                f1 *= rough_diffuse(cos_is, cos_os, cosine, roughness, m1)
                f2 *= rough_diffuse(cos_is, cos_os, cosine, roughness, m2)
        elif kind != TRANSPARENT:
            roughness = float(numbers[chosen, ROUGHNESS])
            eta = float(numbers[chosen, IOR]) if front else 1.0 / float(numbers[chosen, IOR])
            if spread:
                ox, oy, oz, cos_ih, cos_os, sent = bumped_facets(
                    ix, iy, iz, gx, gy, gz, sx, sy, sz, roughness * roughness, eta, through, xi_u, xi_v, xi
                )
                scale *= sent
                transmitted, f0, f1, f2, m0, m1, m2 = facet_fate(
                    numbers, codes, chosen, part, cos_ih, eta, xi, w0, w1, w2
                )
            else:
                hx, hy, hz = _facet(ix, iy, iz, sx, sy, sz, cos_is, roughness * roughness, xi_u, xi_v)
                cos_ih = ix * hx + iy * hy + iz * hz
                transmitted, f0, f1, f2, m0, m1, m2 = facet_fate(
                    numbers, codes, chosen, part, cos_ih, eta, xi, w0, w1, w2
                )
                ox, oy, oz = _image(ix, iy, iz, hx, hy, hz, eta, transmitted)
                if kind == PANE:
                    transmitted, eta = True, 1.0
                    along = 2.0 * (ox * sx + oy * sy + oz * sz)
                    ox, oy, oz = ox - along * sx, oy - along * sy, oz - along * sz
                sign = -1.0 if transmitted else 1.0
                cos_og = sign * (ox * gx + oy * gy + oz * gz)
                cos_os = sign * (ox * sx + oy * sy + oz * sz) if turned else cos_og
                scale *= _shadowing(
                    cos_is, cos_ig, cos_os, cos_og, roughness, turned, transmitted and kind != PANE, eta
                )
            if transmitted:
                radiance_scale = 1.0 / (eta * eta)
            table = codes[chosen, FRONT_ENERGY if front != transmitted else BACK_ENERGY]
            if table != NO_ENERGY and roughness * roughness > MIRROR_ALPHA:
                f0 *= energy_factor(energies, mean_energies, table, roughness, cos_os, m0)
                f1 *= energy_factor(energies, mean_energies, table, roughness, cos_os, m1)
                f2 *= energy_factor(energies, mean_energies, table, roughness, cos_os, m2)

        if kind != DIFFUSE and codes[chosen, VIEW] != NO_VIEW:
            below = diffuse and not transmitted
            cos_os = view_cosine(bump, below, cos_os, ox, oy, oz, gx, gy, gz, sx, sy, sz, ux, uy, uz)
            m0, m1, m2 = view_factor(views, codes[chosen, VIEW], cos_os)
            f0, f1, f2 = f0 * m0, f1 * m1, f2 * m2
        scale *= radiance_scale
        r0, r1, r2 = w0 * f0 * scale, w1 * f1 * scale, w2 * f2 * scale
        largest = largest_of(r0, r1, r2)
        if largest > WEIGHT_LIMIT:
            cap = WEIGHT_LIMIT / largest
            r0, r1, r2, largest = r0 * cap, r1 * cap, r2 * cap, WEIGHT_LIMIT
        add_energy(energy, ABSORBED if lit else ESCAPED, w0 - r0, w1 - r1, w2 - r2)
        passes = kind == TRANSPARENT
        ends = flight - bounces[row] >= MOST_PASSAGES if passes else bounces[row] >= most_bounces
        if ends:
            add_energy(energy, CUT, r0, r1, r2)
        of = radiance_scale * largest_of(w0, w1, w2)
        if diffuse:
            of = standard[photons[row] & (len(standard) - 1)]
        survival = min(1.0, largest / of)
        if ends or xi_survival >= survival:
            bounces[row] = _DEAD
            continue

        if transmitted and lit:
            # Light leaves from the other side: who sees that side is lit.
            landed[arrivals] = 2 * patch + 1 - side
            store(brought, arrivals, 0.0, 0.0, 0.0)
            arrivals += 1
        p = corner(vertices, triangles, triangle, 0)
        q = corner(vertices, triangles, triangle, 1)
        r = corner(vertices, triangles, triangle, 2)
        x, y, z = place_at(p, q, r, u, v)
        away = offset_distance(x, y, z, float(planes[triangle, 3])) * (-1.0 if transmitted else 1.0)
        store(origins, row, x + away * gx, y + away * gy, z + away * gz)
        store(directions, row, ox, oy, oz)
        store(weights, row, r0 / survival, r1 / survival, r2 / survival)
        if not passes:
            bounces[row] += 1
    return _close_ranks(photons, origins, directions, weights, bounces, dark, waiting, alive, late), arrivals


@merged
def _close_ranks(photons, origins, directions, weights, bounces, dark, waiting, alive, late):
    """Put the last photons in the places of those that are dead; return how many are alive."""
    for index in range(late - 1, -1, -1):
        row = waiting[index, 0]
        if bounces[row] == _DEAD:
            alive -= 1
            photons[row], bounces[row], dark[row] = photons[alive], bounces[alive], dark[alive]
            for axis in range(3):
                origins[row, axis] = origins[alive, axis]
                directions[row, axis] = directions[alive, axis]
                weights[row, axis] = weights[alive, axis]
    return alive
