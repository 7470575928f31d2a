# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of a surface's lobes a photon follows, and what a facet does with it.

A lobe is picked with probability proportional to what it roughly sends on, in the channel where that is most, and
its exact weight is divided by that probability.

As Cycles sees it, the shader of the side from which a surface is seen decides. So what is reflected is told by the
row of the side that a photon meets, what is let through by the row of the side that it leaves by.
"""

from __future__ import annotations

from .compiled import inlined, merged
from .lobes import (
    COLOR,
    COLOR_TEXTURE,
    EDGE,
    FRESNEL,
    IOR,
    KIND,
    MEAN_FRESNEL,
    NO_VIEW,
    NORMAL,
    NORMAL_TEXTURE,
    ROUGHNESS,
    ROUGHNESS_TEXTURE,
    SECOND,
    SECOND_TEXTURE,
    UNWEIGHTED,
    VIEW,
)
from .matte import view_factor
from .microfacets import MEAN_EDGE, dielectric_reflectance, edge_factor, fresnel_factor
from .scene import GLASS, GLOSSY, MATTE, NO_TEXTURE, NONE, REFRACTION, SCHLICK, SHEEN, TRANSLUCENT, TRANSPARENT
from .textures import sample_texture
from .vectors import largest_of

DIFFUSE = -1
"""Stands for the row of a lobe: a diffuse one that is nothing but a cosine is none of them."""

_REFLECTS, TRANSMITS = 1, 2
"""What a row of the table is asked for: what it sends back, what it lets through, the sum for both."""
_LEAST_FACTOR = 0.05
"""Facets turned elsewhere than the surface have other Fresnel factors: none is taken for nothing."""


@inlined
def look_up_lobes(own, numbers, codes, start, stop, pool, s, t):
    """Write rows start … stop − 1 of the table to `own`, multiplied by their textures at texture coordinates s, t."""
    for lobe in range(start, stop):
        for colour in range(2):
            index = codes[lobe, COLOR_TEXTURE if colour == 0 else SECOND_TEXTURE]
            column = COLOR if colour == 0 else SECOND
            if index != NO_TEXTURE:
                red, green, blue = sample_texture(pool, index, s, t)
                own[lobe, column] = numbers[lobe, column] * red
                own[lobe, column + 1] = numbers[lobe, column + 1] * green
                own[lobe, column + 2] = numbers[lobe, column + 2] * blue
        index = codes[lobe, ROUGHNESS_TEXTURE]
        if index != NO_TEXTURE:
            red, _, _ = sample_texture(pool, index, s, t)
            own[lobe, ROUGHNESS] = min(max(numbers[lobe, ROUGHNESS] * red, 0.0), 1.0)
        index = codes[lobe, NORMAL_TEXTURE]
        if index != NO_TEXTURE:
            x, y, z = sample_texture(pool, index, s, t)
            own[lobe, NORMAL] = numbers[lobe, NORMAL] * x
            own[lobe, NORMAL + 1] = numbers[lobe, NORMAL + 1] * y
            own[lobe, NORMAL + 2] = numbers[lobe, NORMAL + 2] * z


@merged
def lobe_color(numbers, lobe, column):
    """Return one of a lobe's colours."""
    return float(numbers[lobe, column]), float(numbers[lobe, column + 1]), float(numbers[lobe, column + 2])


@merged
def _share(numbers, codes, views, lobe, part, front, cosine, w0, w1, w2):
    """Return roughly what a lobe sends on of the weights, in the channel where that is most; 0 only where it is 0.

    `part` is `_REFLECTS`, `TRANSMITS` or both, `cosine` that of the arriving light to the shading normal, 0 where
    nothing but transparency counts.
    """
    kind = codes[lobe, KIND]
    diffuse = kind == MATTE or kind == SHEEN
    reflects = part & _REFLECTS != 0 and (kind == GLOSSY or kind == GLASS or diffuse)
    transmits = part & TRANSMITS != 0 and kind != GLOSSY and not diffuse
    share = 0.0
    if (reflects or transmits) and (cosine > 0.0 or kind == TRANSPARENT):
        red, green, blue = lobe_color(numbers, lobe, COLOR)
        if kind == GLOSSY or kind == GLASS:
            a, b, c = lobe_color(numbers, lobe, SECOND)
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
        if codes[lobe, VIEW] != NO_VIEW and not diffuse and kind != TRANSLUCENT:
            # What is smooth is seen from about the angle that light comes from.
            a, b, c = view_factor(views, codes[lobe, VIEW], cosine)
            red, green, blue = (
                red * max(a, _LEAST_FACTOR),
                green * max(b, _LEAST_FACTOR),
                blue * max(c, _LEAST_FACTOR),
            )
        share = largest_of(w0 * red, w1 * green, w2 * blue)
    return share


@merged
def pick_lobe(first, codes, numbers, views, near, far, front, cosine, diffuse_share, w0, w1, w2, xi):
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
        part = _REFLECTS | TRANSMITS if near == far else (_REFLECTS if met else TRANSMITS)
        its_share = _share(numbers, codes, views, lobe, part, front, cosine, w0, w1, w2)
        if its_share == 0.0:
            continue
        shares += its_share
        odds = its_share / shares
        if xi < odds:
            chosen, chosen_part, share, xi = lobe, part, its_share, xi / odds
        else:
            xi = (xi - odds) / (1.0 - odds)
    return chosen, chosen_part, (share / shares if shares > 0.0 else 0.0), xi


@inlined
def glass_part(part, cosine, ior, front, xi):
    """Settle whether glass reflects or lets through, where its normal is not the same for both: see `bumps`.

    Returns
    -------
    part : int
        One of the two.
    odds, xi : float
        As of `pick_lobe`.
    """
    if part != _REFLECTS | TRANSMITS:
        return part, 1.0, xi
    odds = min(max(dielectric_reflectance(cosine, ior if front else 1.0 / ior), _LEAST_FACTOR), 1.0 - _LEAST_FACTOR)
    if xi < odds:
        return _REFLECTS, odds, xi / odds
    return TRANSMITS, 1.0 - odds, (xi - odds) / (1.0 - odds)


@merged
def facet_fate(numbers, codes, lobe, part, cosine, eta, xi, w0, w1, w2):
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
    red, green, blue = lobe_color(numbers, lobe, COLOR)
    a, b, c = red, green, blue
    transmitted = False
    if kind == REFRACTION:
        transmitted = True
        if dielectric_reflectance(cosine, eta) >= 1.0:
            red, green, blue = 0.0, 0.0, 0.0
    else:
        a, b, c = lobe_color(numbers, lobe, SECOND)
    m0, m1, m2 = a, b, c
    if kind == GLOSSY:
        mean = float(numbers[lobe, MEAN_FRESNEL])
        m0, m1, m2 = red + (a - red) * mean, green + (b - green) * mean, blue + (c - blue) * mean
        factor = fresnel_factor(codes[lobe, FRESNEL], cosine, float(numbers[lobe, IOR]))
        red, green, blue = red + (a - red) * factor, green + (b - green) * factor, blue + (c - blue) * factor
        if codes[lobe, FRESNEL] == SCHLICK:
            e0, e1, e2 = lobe_color(numbers, lobe, EDGE)
            m0, m1, m2 = m0 - a * e0 * MEAN_EDGE, m1 - b * e1 * MEAN_EDGE, m2 - c * e2 * MEAN_EDGE
            behind = edge_factor(cosine)
            red = min(max(red - a * e0 * behind, 0.0), a)
            green = min(max(green - b * e1 * behind, 0.0), b)
            blue = min(max(blue - c * e2 * behind, 0.0), c)
    elif kind == GLASS:
        factor = dielectric_reflectance(cosine, eta)
        red, green, blue = red * factor, green * factor, blue * factor
        a, b, c = a * (1.0 - factor), b * (1.0 - factor), c * (1.0 - factor)
        transmitted = part == TRANSMITS
        scale = 1.0
        if part == _REFLECTS | TRANSMITS:
            kept, sent = largest_of(w0 * red, w1 * green, w2 * blue), largest_of(w0 * a, w1 * b, w2 * c)
            transmitted = xi * (kept + sent) >= kept
            likely = sent if transmitted else kept
            scale = (kept + sent) / likely if likely > 0.0 else 0.0
        if transmitted:
            red, green, blue = a, b, c
        red, green, blue = red * scale, green * scale, blue * scale
    u0, u1, u2 = numbers[lobe, UNWEIGHTED], numbers[lobe, UNWEIGHTED + 1], numbers[lobe, UNWEIGHTED + 2]
    return transmitted, red, green, blue, min(m0 * u0, 1.0), min(m1 * u1, 1.0), min(m2 * u2, 1.0)
