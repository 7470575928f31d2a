# SPDX-License-Identifier: GPL-3.0-or-later
"""A Principled BSDF as lobes: layers, each of which takes its share of what comes from below it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .bumps import unit_normals
from .closures import Caustics, Closure, Float64, Values, usable_index
from .metals import tinted_edge
from .principled import (
    COSINE_WEIGHTS,
    Layers,
    coat_share,
    diffuse_share,
    normal_reflectance,
    reflectance_of_ior,
    through_coat,
    through_layers,
    through_sheen,
)
from .scene import DIELECTRIC, GLASS, GLOSSY, MATTE, SCHLICK, TRANSPARENT
from .shading import Lobe, OwnNormal, Shading, sheen_lobe
from .thin_walls import thin_wall

_COMBINATIONS = 256
"""Most combinations of layers for which shares are computed; values are rounded until there are no more."""


def shade_principled(closure: Closure, values: Values, weight: Float64, caustics: Caustics) -> Shading:
    """Return what a Principled BSDF amounts to: layers, each of which takes its share of what comes from below it.

    How much that is, is told point by point, how it depends on the direction of view by the means of the inputs.
    """
    inputs = closure.inputs
    base = np.maximum(values(inputs["Base Color"]), 0.0)
    tint = np.maximum(values(inputs["Specular Tint"]), 0.0)
    coat_tint = np.maximum(values(inputs["Coat Tint"]), 0.0)
    alpha, coat, metallic, transmission, roughness, coat_roughness, sheen_roughness = (
        values.share(inputs[name])
        for name in (
            *("Alpha", "Coat Weight", "Metallic", "Transmission Weight"),
            *("Roughness", "Coat Roughness", "Sheen Roughness"),
        )
    )
    sheen = np.nan_to_num(np.maximum(values(inputs["Sheen Weight"]) * values(inputs["Sheen Tint"]), 0.0))
    fuzz = sheen.max(axis=1, keepdims=True)
    ior, level = (np.nan_to_num(values(inputs[name])) for name in ("IOR", "Specular IOR Level"))
    coat_ior = np.nan_to_num(values(inputs["Coat IOR"]))
    facets = [ior, level, tint.max(axis=1, keepdims=True), roughness]
    parameters = [*facets, coat, coat_roughness, coat_ior, coat_tint, fuzz, sheen_roughness]
    below, under_coat, under_sheen = _shares(parameters, closure.multiscatter, caustics.reflective)
    means = _layers(
        np.nan_to_num(np.concatenate([each.mean(axis=0) for each in parameters])),
        closure.multiscatter,
        caustics.reflective,
    )
    opaque = weight * alpha
    inside = opaque * under_coat
    ones = np.ones((1, 3))
    emission = inside * values(inputs["Emission Color"]) * values(inputs["Emission Strength"])
    bare = [Lobe(TRANSPARENT, weight * (1.0 - alpha) * ones, weight * (1.0 - alpha) * ones, np.zeros((1, 1)))]
    own, over_coat = values.normal(closure.normal), values.normal(closure.coat_normal)
    bare.append(sheen_lobe(opaque * sheen, sheen_roughness).turned(_between(own, over_coat, coat)))
    lobes: list[Lobe] = []
    if caustics.reflective:
        dense = max(float(coat_ior.mean()), 1.0)
        over = opaque * coat * under_sheen
        varnish = Lobe(GLOSSY, over * reflectance_of_ior(dense), over, coat_roughness, dense, DIELECTRIC)
        bare.append(_seen(varnish, through_sheen(means)).turned(over_coat))
        metal = inside * metallic
        lobes.append(
            Lobe(
                GLOSSY,
                metal * np.minimum(base, 1.0),
                metal,
                roughness,
                1.5,
                SCHLICK,
                closure.multiscatter,
                metal,
                edge=tinted_edge(base, tint),
            )
        )
        plain = inside * (1.0 - metallic) * (1.0 - transmission)
        f0, _ = normal_reflectance(ior, level)
        eta = float(normal_reflectance(ior.mean(), level.mean())[1])
        if eta != 1.0:
            reflected = plain * np.minimum(f0 * tint, 1.0)
            lobes.append(Lobe(GLOSSY, reflected, plain, roughness, eta, DIELECTRIC, closure.multiscatter, plain))
    glass = inside * (1.0 - metallic) * transmission
    inner = usable_index(float(ior.mean()))
    if values.mean(inputs.get("Thin Wall", (0.0,))) > 0.5:
        lobes += thin_wall(glass, tint, np.minimum(base, 1.0), roughness, inner, caustics)
    else:
        through = glass * np.sqrt(np.minimum(base, 1.0)) * caustics.refractive
        over = glass * tint * caustics.reflective
        lobes.append(Lobe(GLASS, over, through, roughness, inner, DIELECTRIC, closure.multiscatter, glass))
    looks = values.looks(inputs["Base Color"])
    layers = through_layers(means)
    passed = _mean_of_both(layers, looks)
    diffuse = opaque * (1.0 - metallic) * (1.0 - transmission) * below * base * passed
    matte = Lobe(MATTE, diffuse, base, values.share(inputs["Diffuse Roughness"]))
    coated = through_coat(means)
    bare.append(_seen(matte, layers * looks).turned(own))
    shining = coated * values.looks(inputs["Emission Color"]) * values.looks(inputs["Emission Strength"])
    mean = COSINE_WEIGHTS @ coated
    view = np.divide(shining, mean, out=np.ones_like(shining), where=mean > 0.0)
    return Shading(np.zeros((1, 3)), emission, (*bare, *(_seen(lobe, coated).turned(own) for lobe in lobes)), view)


def _between(first: OwnNormal | None, second: OwnNormal | None, share: Float64) -> OwnNormal | None:
    """Return the normals between two by a share (k, 1) of the second, as the sheen's are; None is the surface's own."""
    bump = first.bump if first is not None else second.bump if second is not None else 0
    if not bump:
        return None
    start, end = (np.array([[0.0, 0.0, 1.0]]) if each is None else each.values for each in (first, second))
    return OwnNormal(unit_normals((1.0 - share) * start + share * end), bump)


def _mean_of_both(layers: Float64, looks: Float64) -> Float64:
    """Return the mean of a product of functions of the direction of view over that of the first alone.

    What looks brighter where layers let less through reflects less than its own mean says.
    """
    alone, both = COSINE_WEIGHTS @ layers, COSINE_WEIGHTS @ (layers * looks)
    return np.asarray(np.divide(both, alone, out=np.ones_like(both), where=alone > 0.0))


def _seen(lobe: Lobe, curve: Float64) -> Lobe:
    """Return a lobe, whose amount is known, with the shape of a function of the direction of view."""
    mean = COSINE_WEIGHTS @ curve
    return lobe if (mean <= 0.0).any() else lobe.seen_by(curve / mean)


def _shares(parameters: Sequence[Float64], multiscatter: bool, specular: bool) -> tuple[Float64, Float64, Float64]:
    """Return the shares (k, 3) that the layers leave to the diffuse lobe, and those that coat and sheen leave.

    `parameters` are IOR, specular level, the largest channel of the specular tint, roughness, the coat's weight,
    roughness, IOR, and tint, and the sheen's strength and roughness. They are rounded to steps at which there are few
    combinations.
    """
    k = max(len(array) for array in parameters)
    table = np.concatenate([np.broadcast_to(array, (k, array.shape[1])) for array in parameters], axis=1)
    unique, where = _combinations(np.nan_to_num(table))
    below, through, fuzz = (np.empty((len(unique), 3)) for _ in range(3))
    for row, values in enumerate(unique):
        layers = _layers(values, multiscatter, specular)
        below[row], through[row] = diffuse_share(layers), coat_share(layers)
        fuzz[row] = COSINE_WEIGHTS @ through_sheen(layers)
    return below[where], through[where], fuzz[where]


def _layers(parameters: Float64, multiscatter: bool, specular: bool) -> Layers:
    """Return layers of the parameters (12,) of `_shares`."""
    ior, level, tint, roughness, coat, coat_roughness, coat_ior, red, green, blue, sheen, fuzz = map(float, parameters)
    return Layers(
        ior=ior,
        specular_ior_level=level,
        specular_tint=(tint, tint, tint),
        roughness=roughness,
        coat=coat,
        coat_roughness=coat_roughness,
        coat_ior=coat_ior,
        coat_tint=(red, green, blue),
        sheen=sheen,
        sheen_roughness=fuzz,
        multiscatter=multiscatter,
        specular=specular,
    )


def _combinations(table: Float64) -> tuple[Float64, NDArray[np.intp]]:
    """Return the different rows of a table, rounded until they are few, and which of them each row is."""
    varied = np.flatnonzero((table != table[0]).any(axis=0))
    steps = 256.0
    while True:
        rounded = table[:, varied] if len(table) <= _COMBINATIONS else np.round(table[:, varied] * steps) / steps
        keys = np.zeros(len(table), dtype=np.int64)
        for column in rounded.T:
            _, rank = np.unique(column, return_inverse=True)
            _, keys = np.unique(keys * (rank.max() + 1) + rank.reshape(-1), return_inverse=True)
            keys = keys.reshape(-1)
        _, first = np.unique(keys, return_index=True)
        if len(first) <= _COMBINATIONS:
            unique = np.repeat(table[:1], len(first), axis=0)
            unique[:, varied] = rounded[first]
            return unique, keys
        steps /= 2.0
