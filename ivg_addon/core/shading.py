# SPDX-License-Identifier: GPL-3.0-or-later
"""What a surface does with light at k of its points, as lobes, and how much of the light that is."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .bumps import MIXED
from .microfacets import MEAN_EDGE
from .principled import COSINE_WEIGHTS, COSINES, facet_means, mean_reflectance, oren_nayar_share
from .scene import DIELECTRIC, GLASS, GLOSSY, MATTE, NONE, SCHLICK, SHEEN, TRANSPARENT
from .sheen import sheen_reflectance

Float64 = NDArray[np.float64]

_MEAN_SCHLICK = 1.0 / 21.0
"""∫₀¹ (1 − μ)⁵ 2μ dμ."""
_BRIGHT = 1.005
"""Reflectance from which on it is said to be too large; below, it is a matter of rounding."""
SMOOTH = 1e-5
"""Below this roughness a diffuse lobe is a cosine, in Cycles."""
_ROUGHNESS = np.linspace(0.0, 1.0, 9)
"""Between these, averages over facets are interpolated."""
_ROUGH_RIM = 0.3
"""From this roughness on next to nothing is lost at the rims of bumps."""
_SHEEN_STEPS = 65
"""Between so many roughnesses, what sheen reflects of even light is interpolated."""


@dataclass(frozen=True)
class OwnNormal:
    """Normals (k, 3) of lobes, and what they are; see `bumps`."""

    values: Float64
    bump: int


@dataclass(frozen=True)
class Lobe:
    """A row of `scene.Lobes` at k points.

    Parameters
    ----------
    color, second : (k, 3)
    roughness : (k, 1)
    weight : (k, 1) or (k, 3)
    view : (directions, 3)
        At `principled.COSINES`, the same at all points; None where it is 1.
    edge : (3,)
        The same at all points; None where it is 0.
    normal : (k, 3)
        Relative, see `bumps`; None where it is the surface's own.
    bump
        What that normal is: flags of `bumps`.
    """

    kind: int
    color: Float64
    second: Float64
    roughness: Float64
    ior: float = 1.5
    fresnel: int = NONE
    multiscatter: bool = False
    weight: Float64 = field(default_factory=lambda: np.ones((1, 1)))
    view: Float64 | None = None
    edge: Float64 | None = None
    normal: Float64 | None = None
    bump: int = 0

    def albedo(self) -> Float64:
        """Return the share of light from all sides, (k, 3), that it does not absorb."""
        match self.kind, self.fresnel:
            case k, _ if k == GLASS:
                reflected = mean_reflectance(self.ior)
                return reflected * self.color + (1.0 - reflected) * self.second
            case k, f if k == GLOSSY and f == SCHLICK:
                behind = 0.0 if self.edge is None else self.edge * MEAN_EDGE
                return self.color + (self.second - self.color) * _MEAN_SCHLICK - self.second * behind
            case k, f if k == GLOSSY and f == DIELECTRIC:
                shape, single = _facet_means(self.ior, self.roughness)
                fresnel = self.color + (self.second - self.color) * shape
                return fresnel * (single + np.minimum(fresnel, 1.0) * (1.0 - single))
            case k, _ if k == MATTE:
                return self.color * oren_nayar_share(self.second, self.roughness)
        return self.color

    def scaled(self, factor: Float64) -> Lobe:
        """Return it with what it reflects and lets through multiplied by (k, 3)."""
        second = self.second if self.kind == MATTE else self.second * factor
        return replace(self, color=self.color * factor, second=second, weight=self.weight * factor)

    def seen_by(self, curve: Float64) -> Lobe:
        """Return it multiplied by a function of the direction of view, (directions, 1) or (directions, 3)."""
        if (curve == curve[0]).all():
            return self.scaled(curve[:1])
        product = curve * (np.ones((1, 3)) if self.view is None else self.view)
        mean = COSINE_WEIGHTS @ product
        view = np.divide(product, mean, out=np.ones_like(product), where=mean > 0.0)
        return replace(self.scaled(mean[None]), view=view)

    def mixed(self, curve: Float64) -> Lobe:
        """Return it as a mix by the direction of view leaves it, which goes by the surface's own normal."""
        seen = self.seen_by(curve)
        alone = self.view is None and seen.view is not None and self.normal is not None
        return replace(seen, bump=self.bump | MIXED) if alone else seen

    def turned(self, to: OwnNormal | None) -> Lobe:
        """Return it with a normal of its own; light goes straight on whatever the normal is."""
        return self if to is None or self.kind == TRANSPARENT else replace(self, normal=to.values, bump=to.bump)

    def lost_at_rims(self) -> float:
        """Return about what share of light is lost where smooth facets are tilted; see `bumps`."""
        if self.normal is None or self.kind not in (GLOSSY, GLASS):
            return 0.0
        smooth = np.clip(1.0 - self.roughness / _ROUGH_RIM, 0.0, 1.0)
        lost = smooth * (1.0 - self.normal[:, 2:] ** 2) * self.albedo().max(axis=1, keepdims=True)
        return float(np.nan_to_num(lost).mean())

    def is_cosine(self) -> bool:
        """Tell whether it is a diffuse lobe that is nothing but a cosine."""
        even = self.view is None and self.normal is None
        return self.kind == MATTE and even and bool((self.roughness < SMOOTH).all())


@dataclass(frozen=True)
class Shading:
    """What a surface does with light at k points.

    Parameters
    ----------
    albedo : (k, 3) float64
        All diffuse reflection, that of matte lobes included.
    emission : (k, 3) float64
    lobes
        Those with any weight.
    emission_view : (directions, 3)
        How emission depends on the direction of view, as `Lobe.view`.
    """

    albedo: Float64
    emission: Float64
    lobes: tuple[Lobe, ...] = ()
    emission_view: Float64 | None = None

    def total(self) -> Float64:
        """Return the share of light from all sides that is not absorbed, (k, 3)."""
        return np.asarray(sum((lobe.albedo() for lobe in self.lobes if lobe.kind != MATTE), self.albedo))

    def sound(self) -> tuple[Shading, frozenset[str]]:
        """Return it within what is possible, and what was not: "NaN", "negative", "bright".

        What is no number, infinite or negative becomes 0; where more than all light is reflected, all lobes are scaled
        to 1 in sum, or light would grow at each bounce.
        """
        wrong: set[str] = set()

        def clean(values: Float64) -> Float64:
            finite = np.isfinite(values)
            if not finite.all():
                wrong.add("NaN")
            if (values < 0.0).any():
                wrong.add("negative")
            return np.where(finite & (values > 0.0), values, 0.0)

        lobes = tuple(
            replace(
                lobe,
                color=clean(lobe.color),
                second=clean(lobe.second),
                roughness=np.nan_to_num(np.clip(lobe.roughness, 0.0, 1.0)),
            )
            for lobe in self.lobes
        )
        cleaned = replace(self, albedo=clean(self.albedo), emission=clean(self.emission), lobes=lobes)
        total = cleaned.total()
        if (total > _BRIGHT).any():
            wrong.add("bright")
        if (total > 1.0).any():
            limit = 1.0 / np.maximum(total, 1.0)
            scaled = tuple(lobe.scaled(limit) for lobe in cleaned.lobes)
            cleaned = replace(cleaned, albedo=cleaned.albedo * limit, lobes=scaled)
        return cleaned, frozenset(wrong)


def sheen_lobe(color: Float64, roughness: Float64) -> Lobe:
    """Return a sheen lobe; how it depends on the direction of view is told by the mean roughness."""
    steps = np.linspace(0.0, 1.0, _SHEEN_STEPS)
    amount = np.interp(roughness, steps, [COSINE_WEIGHTS @ sheen_reflectance(COSINES, step) for step in steps])
    even = Lobe(SHEEN, amount * color * np.ones((1, 3)), np.zeros((1, 3)), roughness)
    curve = sheen_reflectance(COSINES, float(roughness.mean()))[:, None]
    mean = COSINE_WEIGHTS @ curve
    return even.seen_by(curve / mean) if mean > 0.0 else even


def _facet_means(ior: float, roughness: Float64) -> tuple[Float64, Float64]:
    """Return `principled.facet_means` at roughnesses."""
    eta = max(ior, 1.0 / ior)
    shape, single = zip(*(facet_means(eta, float(step)) for step in _ROUGHNESS), strict=True)
    return np.interp(roughness, _ROUGHNESS, shape), np.interp(roughness, _ROUGHNESS, single)


def merged(lobes: Iterable[Lobe]) -> Iterator[Lobe]:
    """Add up lobes that differ in color only, and leave out those without weight."""
    groups: dict[tuple[object, ...], Lobe] = {}
    for lobe in lobes:
        reflects = lobe.color if lobe.kind == MATTE else np.maximum(lobe.color, lobe.second)
        if np.max(reflects, initial=0.0) <= 0.0:
            continue
        view = None if lobe.view is None else lobe.view.tobytes()
        own = lobe.second.tobytes() if lobe.kind == MATTE and (lobe.roughness >= SMOOTH).any() else None
        edge = None if lobe.edge is None else lobe.edge.tobytes()
        normal = None if lobe.normal is None else (lobe.normal.tobytes(), lobe.bump)
        shape = (lobe.kind, lobe.ior, lobe.fresnel, lobe.multiscatter)
        key = (*shape, lobe.roughness.tobytes(), view, own, edge, normal)
        if key in groups:
            other = groups[key]
            lobe = replace(
                other,
                color=other.color + lobe.color,
                second=lobe.second if lobe.kind == MATTE else other.second + lobe.second,
                weight=other.weight + lobe.weight,
            )
        groups[key] = lobe
    yield from groups.values()
