# SPDX-License-Identifier: GPL-3.0-or-later
"""A photon meets a surface with lobes: which of them it follows, where to, and what it carries on.

Of light from direction i, Cycles sees a surface send the radiance f(o, i) |i·s| L(i) towards o, s the shading normal.
Photons of that light arrive in proportion to |i·g| and leave in proportion to |o·g|, g the geometric normal; drawn with
density p(o) they must carry on

    w' = w f(o, i) |i·s| |o·g| / (|i·g| p(o))                                         [Veach 1997, §5.3]

For facets (`microfacets`; p(o) is the density of o as the image of i) this is

    reflection   w' = w R G₂/G₁ (|i·s| |o·g|) / (|i·g| |o·s|)
    refraction   w' = w T G₂/G₁ (|i·s| |o·g|) / (|i·g| |o·s|) (n_i/n_o)²

with n the index of refraction on either side. Flux that is refracted keeps its power, and the radiance that it makes
changes by (n_o/n_i)² [Veach 1997, §5.2]. Cycles leaves that factor out of radiance; what it computes is the light of
photons that carry (n_i/n_o)² times as much. Through a closed body the factors cancel; in glass, and behind a single
sheet of it, they do not. They say nothing of how important a photon is, so roulette leaves them out.

A lobe is picked with probability proportional to what it roughly sends on, in the channel where that is most, and
its exact weight is divided by that probability. Roulette then lets the photon live by what is left: of one at a
diffuse or translucent lobe the whole weight decides, as in `scattering`; else what the lobe took off it.

As Cycles sees it, the shader of the side from which a surface is seen decides. So what is reflected is told by the
row of the side that a photon meets, what is let through by the row of the side that it leaves by.

Light that arrives behind the shading normal, and light that facets send through the surface though they reflect it (or
back though they refract it), is absorbed: no light leaks. Cycles turns shading normals of grazing views a little
instead, so that their mirror image stays above the surface.
"""

from __future__ import annotations

from .compiled import inlined, kernel, merged
from .lobes import (
    BACK_ENERGY,
    COLOR,
    COLOR_TEXTURE,
    FRESNEL,
    FRONT_ENERGY,
    IOR,
    KIND,
    MEAN_FRESNEL,
    NO_ENERGY,
    ROUGHNESS,
    ROUGHNESS_TEXTURE,
    SECOND,
    SECOND_TEXTURE,
    UNWEIGHTED,
)
from .microfacets import (
    CLEAR,
    MIRROR_ALPHA,
    dielectric_reflectance,
    energy_factor,
    fresnel_factor,
    refracted_cosine,
    shadowing,
    visible_normal,
)
from .random import STREAM_SCATTER, random4
from .scattering import ABSORBED, CUT, ESCAPED, add_energy, store
from .scene import GLASS, GLOSSY, NO_TEXTURE, NONE, REFRACTION, TRANSLUCENT, TRANSPARENT
from .surface_bins import BACK, FRONT, patch_of
from .surfaces import corner, shading_normal, texture_coordinates
from .tally import WEIGHT_LIMIT
from .textures import sample_texture, surface_albedo
from .vectors import cosine_direction, offset_distance, orthonormal_basis

MOST_PASSAGES = 8
"""Transparent surfaces that a photon passes in its life: Cycles' default `transparent_max_bounces`."""

DIFFUSE = -1
"""Stands for the row of a lobe: the diffuse one is none of them."""
_REFLECTS, _TRANSMITS = 1, 2
"""What a row of the table is asked for: what it sends back, what it lets through, the sum for both."""
_DEAD = -1
"""Stands for the bounces of a photon that ended."""
_LEAST_FACTOR = 0.05
"""Facets turned elsewhere than the surface have other Fresnel factors: none is taken for nothing."""


@inlined
def _largest(a, b, c):
    return max(a, max(b, c))


@merged
def _color(numbers, codes, lobe, column, texture_column, pool, s, t):
    """Return one of a lobe's colours at texture coordinates."""
    red = float(numbers[lobe, column])
    green = float(numbers[lobe, column + 1])
    blue = float(numbers[lobe, column + 2])
    index = codes[lobe, texture_column]
    if index != NO_TEXTURE:
        a, b, c = sample_texture(pool, index, s, t)
        red, green, blue = red * a, green * b, blue * c
    return red, green, blue


@merged
def _share(numbers, codes, lobe, part, front, cosine, w0, w1, w2, pool, s, t):
    """Return roughly what a lobe sends on of the weights, in the channel where that is most; 0 only where it is 0.

    `part` is `_REFLECTS`, `_TRANSMITS` or both, `cosine` that of the arriving light to the shading normal, 0 where
    nothing but transparency counts.
    """
    kind = codes[lobe, KIND]
    reflects = part & _REFLECTS != 0 and (kind == GLOSSY or kind == GLASS)
    transmits = part & _TRANSMITS != 0 and kind != GLOSSY
    share = 0.0
    if (reflects or transmits) and (cosine > 0.0 or kind == TRANSPARENT):
        red, green, blue = _color(numbers, codes, lobe, COLOR, COLOR_TEXTURE, pool, s, t)
        if kind == GLOSSY or kind == GLASS:
            a, b, c = _color(numbers, codes, lobe, SECOND, SECOND_TEXTURE, pool, s, t)
            ior = float(numbers[lobe, IOR])
            if kind == GLOSSY:
                sent = fresnel_factor(codes[lobe, FRESNEL], cosine, ior)
                kept = 1.0 - sent
            else:
                kept = dielectric_reflectance(cosine, ior if front else 1.0 / ior)
                sent = 1.0 - kept
            if kind == GLASS or codes[lobe, FRESNEL] != NONE:
                kept, sent = max(kept, _LEAST_FACTOR), max(sent, _LEAST_FACTOR)
            if kind == GLASS:
                kept = kept if reflects else 0.0
                sent = sent if transmits else 0.0
            red, green, blue = red * kept + a * sent, green * kept + b * sent, blue * kept + c * sent
        share = max(0.0, _largest(w0 * red, w1 * green, w2 * blue))
    return share


@merged
def _pick(first, codes, numbers, near, far, front, cosine, diffuse_share, w0, w1, w2, xi, pool, s, t):
    """Pick one lobe of all, by one number that is uniform again after each.

    `near` and `far` are the materials of the side that light meets and of the other; the rest as for `_share`.

    Returns
    -------
    lobe, part : int
        `DIFFUSE` or a row, and what of that; see `_share`.
    odds : float
        The probability that it is this one; 0 where there is none.
    xi : float
        Uniform anew.
    """
    chosen, chosen_part, share, shares = DIFFUSE, _REFLECTS, diffuse_share, diffuse_share
    of_near = first[near + 1] - first[near]
    of_far = 0 if near == far else first[far + 1] - first[far]
    for candidate in range(of_near + of_far):
        met = candidate < of_near
        lobe = first[near] + candidate if met else first[far] + candidate - of_near
        part = _REFLECTS | _TRANSMITS if near == far else (_REFLECTS if met else _TRANSMITS)
        its_share = _share(numbers, codes, lobe, part, front, cosine, w0, w1, w2, pool, s, t)
        if its_share == 0.0:
            continue
        shares += its_share
        odds = its_share / shares
        if xi < odds:
            chosen, chosen_part, share, xi = lobe, part, its_share, xi / odds
        else:
            xi = (xi - odds) / (1.0 - odds)
    return chosen, chosen_part, (share / shares if shares > 0.0 else 0.0), xi


@merged
def _roughness(numbers, codes, lobe, pool, s, t):
    """Return a lobe's roughness at texture coordinates, in [0, 1]."""
    roughness = float(numbers[lobe, ROUGHNESS])
    if codes[lobe, ROUGHNESS_TEXTURE] != NO_TEXTURE:
        roughness *= sample_texture(pool, codes[lobe, ROUGHNESS_TEXTURE], s, t)[0]
    return min(max(roughness, 0.0), 1.0)


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
def _image(ix, iy, iz, hx, hy, hz, eta, transmitted):
    """Return where a facet mirrors direction i to, or refracts it to (which must be possible)."""
    cosine = ix * hx + iy * hy + iz * hz
    if transmitted:
        along = cosine / eta - refracted_cosine(cosine, eta)
        return along * hx - ix / eta, along * hy - iy / eta, along * hz - iz / eta
    return 2.0 * cosine * hx - ix, 2.0 * cosine * hy - iy, 2.0 * cosine * hz - iz


@merged
def _fate(numbers, codes, lobe, part, cosine, eta, xi, w0, w1, w2, pool, s, t):
    """Tell what a facet does with light at this cosine: sends back or lets through, what of each channel, and more.

    Returns
    -------
    transmitted : bool
    red, green, blue : float
        Divided by the probability that it was this.
    mean_red, mean_green, mean_blue : float
        Fss of `microfacets`.
    """
    kind = codes[lobe, KIND]
    red, green, blue = _color(numbers, codes, lobe, COLOR, COLOR_TEXTURE, pool, s, t)
    a, b, c = red, green, blue
    transmitted = False
    if kind == REFRACTION:
        transmitted = True
        if dielectric_reflectance(cosine, eta) >= 1.0:
            red, green, blue = 0.0, 0.0, 0.0
    else:
        a, b, c = _color(numbers, codes, lobe, SECOND, SECOND_TEXTURE, pool, s, t)
    m0, m1, m2 = a, b, c
    if kind == GLOSSY:
        mean = float(numbers[lobe, MEAN_FRESNEL])
        m0, m1, m2 = red + (a - red) * mean, green + (b - green) * mean, blue + (c - blue) * mean
        factor = fresnel_factor(codes[lobe, FRESNEL], cosine, float(numbers[lobe, IOR]))
        red, green, blue = red + (a - red) * factor, green + (b - green) * factor, blue + (c - blue) * factor
    elif kind == GLASS:
        factor = dielectric_reflectance(cosine, eta)
        red, green, blue = red * factor, green * factor, blue * factor
        a, b, c = a * (1.0 - factor), b * (1.0 - factor), c * (1.0 - factor)
        transmitted = part == _TRANSMITS
        scale = 1.0
        if part == _REFLECTS | _TRANSMITS:
            kept, sent = _largest(w0 * red, w1 * green, w2 * blue), _largest(w0 * a, w1 * b, w2 * c)
            transmitted = xi * (kept + sent) >= kept
            likely = sent if transmitted else kept
            scale = (kept + sent) / likely if likely > 0.0 else 0.0
        if transmitted:
            red, green, blue = a, b, c
        red, green, blue = red * scale, green * scale, blue * scale
    u0, u1, u2 = numbers[lobe, UNWEIGHTED], numbers[lobe, UNWEIGHTED + 1], numbers[lobe, UNWEIGHTED + 2]
    return transmitted, red, green, blue, min(m0 * u0, 1.0), min(m1 * u1, 1.0), min(m2 * u2, 1.0)


@kernel
def scatter_at_lobes(
    photons,
    origins,
    directions,
    weights,
    bounces,
    dark,
    hit_triangle,
    hit_u,
    hit_v,
    seed,
    flight,
    most_bounces,
    surfaces,
    bin_counts,
    energy,
    waiting,
    alive,
    late,
):
    """Scatter the photons that `scatter` left waiting; return how many are alive, which move to the front.

    Parameters are those of `scatter`, and the numbers that it returned.
    """
    vertices, triangles, planes, uvs = surfaces.vertices, surfaces.triangles, surfaces.planes, surfaces.uvs
    smooth, material, reflects, back = surfaces.smooth, surfaces.material, surfaces.reflects, surfaces.back
    albedo, texture, corner_normals = surfaces.albedo, surfaces.texture, surfaces.corner_normals
    bin_divisions, bin_offset, pool = surfaces.bin_divisions, surfaces.bin_offset, surfaces.pool
    first, codes, numbers = surfaces.lobes.first, surfaces.lobes.codes, surfaces.lobes.numbers
    energies, mean_energies = surfaces.lobes.energy, surfaces.lobes.mean_energy
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
            bin_counts[patch, side] += 1
        # Where no light arrives yet, and what diffuse rays do not see, lets photons pass and does nothing else.
        scatters = lit and reflects[triangle] and cos_is > 0.0 and cos_ig > 0.0
        s, t = texture_coordinates(uvs, triangle, u, v)

        xi_u, xi_v, xi_survival, xi = random4(seed, photons[row], STREAM_SCATTER + flight)
        diffuse_share = 0.0
        f0, f1, f2 = 0.0, 0.0, 0.0
        if scatters:
            f0, f1, f2 = float(albedo[near, 0]), float(albedo[near, 1]), float(albedo[near, 2])
            if texture[near] != NO_TEXTURE:
                f0, f1, f2 = surface_albedo(near, s, t, albedo, texture, pool)
            diffuse_share = _largest(w0 * f0, w1 * f1, w2 * f2)
        cosine = cos_is if scatters else 0.0
        chosen, part, odds, xi = _pick(
            first, codes, numbers, near, far, front, cosine, diffuse_share, w0, w1, w2, xi, pool, s, t
        )
        if odds == 0.0:
            add_energy(energy, ABSORBED if lit else ESCAPED, w0, w1, w2)
            bounces[row] = _DEAD
            continue

        kind = DIFFUSE if chosen == DIFFUSE else codes[chosen, KIND]
        scale, radiance_scale = 1.0 / odds, 1.0
        transmitted = kind == TRANSLUCENT or kind == TRANSPARENT
        ox, oy, oz = -ix, -iy, -iz
        if transmitted:
            f0, f1, f2 = _color(numbers, codes, chosen, COLOR, COLOR_TEXTURE, pool, s, t)
        if kind == DIFFUSE or kind == TRANSLUCENT:
            sign = -1.0 if transmitted else 1.0
            ox, oy, oz = cosine_direction(sign * gx, sign * gy, sign * gz, xi_u, xi_v)
            if turned:
                scale *= cos_is / cos_ig
        elif kind != TRANSPARENT:
            roughness = _roughness(numbers, codes, chosen, pool, s, t)
            eta = float(numbers[chosen, IOR]) if front else 1.0 / float(numbers[chosen, IOR])
            hx, hy, hz = _facet(ix, iy, iz, sx, sy, sz, cos_is, roughness * roughness, xi_u, xi_v)
            cos_ih = ix * hx + iy * hy + iz * hz
            transmitted, f0, f1, f2, m0, m1, m2 = _fate(
                numbers, codes, chosen, part, cos_ih, eta, xi, w0, w1, w2, pool, s, t
            )
            ox, oy, oz = _image(ix, iy, iz, hx, hy, hz, eta, transmitted)
            sign = -1.0 if transmitted else 1.0
            cos_og = sign * (ox * gx + oy * gy + oz * gz)
            cos_os = sign * (ox * sx + oy * sy + oz * sz) if turned else cos_og
            scale *= _shadowing(cos_is, cos_ig, cos_os, cos_og, roughness, turned, transmitted, eta)
            if transmitted:
                radiance_scale = 1.0 / (eta * eta)
            table = codes[chosen, FRONT_ENERGY if front != transmitted else BACK_ENERGY]
            if table != NO_ENERGY and roughness * roughness > MIRROR_ALPHA:
                f0 *= energy_factor(energies, mean_energies, table, roughness, cos_os, m0)
                f1 *= energy_factor(energies, mean_energies, table, roughness, cos_os, m1)
                f2 *= energy_factor(energies, mean_energies, table, roughness, cos_os, m2)

        scale *= radiance_scale
        r0, r1, r2 = w0 * f0 * scale, w1 * f1 * scale, w2 * f2 * scale
        largest = _largest(r0, r1, r2)
        if largest > WEIGHT_LIMIT:
            cap = WEIGHT_LIMIT / largest
            r0, r1, r2, largest = r0 * cap, r1 * cap, r2 * cap, WEIGHT_LIMIT
        add_energy(energy, ABSORBED if lit else ESCAPED, w0 - r0, w1 - r1, w2 - r2)
        passes = kind == TRANSPARENT
        ends = flight - bounces[row] >= MOST_PASSAGES if passes else bounces[row] >= most_bounces
        if ends:
            add_energy(energy, CUT, r0, r1, r2)
        of = 1.0 if kind == DIFFUSE or kind == TRANSLUCENT else radiance_scale * _largest(w0, w1, w2)
        survival = min(1.0, largest / of)
        if ends or xi_survival >= survival:
            bounces[row] = _DEAD
            continue

        if transmitted and lit:
            # Light leaves from the other side: who sees that side is lit.
            bin_counts[patch, 1 - side] += 1
        p = corner(vertices, triangles, triangle, 0)
        q = corner(vertices, triangles, triangle, 1)
        r = corner(vertices, triangles, triangle, 2)
        w = 1.0 - u - v
        x = w * p[0] + u * q[0] + v * r[0]
        y = w * p[1] + u * q[1] + v * r[1]
        z = w * p[2] + u * q[2] + v * r[2]
        away = offset_distance(x, y, z, float(planes[triangle, 3])) * (-1.0 if transmitted else 1.0)
        store(origins, row, x + away * gx, y + away * gy, z + away * gz)
        store(directions, row, ox, oy, oz)
        store(weights, row, r0 / survival, r1 / survival, r2 / survival)
        if not passes:
            bounces[row] += 1
    return _close_ranks(photons, origins, directions, weights, bounces, dark, waiting, alive, late)


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
