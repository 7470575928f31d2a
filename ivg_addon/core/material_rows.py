# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadings made into the arrays of `scene.Materials`, as constants, images or textures of evaluated values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .principled import COSINES
from .scene import NO_TEXTURE, TRANSPARENT, VIEW_STEPS, Lobes, Materials
from .shading import Shading

Float64 = NDArray[np.float64]
AddTexture = Callable[[Float64], int]
"""Makes a texture of values (k, 3) and returns its index."""

_EQUAL = 1e-6
"""Values that differ by no more than this are one."""

PROBES: Float64 = np.array([[0, 0, 0], [1, 1, 1], [0.5, 0.5, 0.5], [0.2, 0.7, 0.4], [0.9, 0.1, 0.6]], dtype=np.float64)
"""Colours by which a shading shows whether it is proportional to an image."""
_WHITE = 1


@dataclass(frozen=True)
class Quantity:
    """A colour (3,), or that many times a texture."""

    colour: Float64
    texture: int = NO_TEXTURE


@dataclass(frozen=True)
class LobeRow:
    """A row of `scene.Lobes`; parameters as there, but for `view`, which is that of `shading.Lobe`."""

    kind: int
    color: Quantity
    second: Quantity
    roughness: Quantity
    ior: float
    fresnel: int
    multiscatter: bool
    weight: Float64
    view: Float64 | None = None
    edge: Float64 | None = None
    normal: Quantity | None = None
    bump: int = 0


@dataclass(frozen=True)
class MaterialRow:
    """A row of `scene.Materials`; `back` is the index of another row, or its own."""

    name: str
    albedo: Quantity
    emission: Quantity
    lobes: tuple[LobeRow, ...]
    back: int
    emission_view: Float64 | None = None


def make_row(name: str, shading: Shading, back: int, quantity: Callable[[Float64], Quantity]) -> MaterialRow:
    """Return a row; `quantity` says how values (k, 3) are kept."""
    return MaterialRow(
        name=name,
        albedo=quantity(shading.albedo),
        emission=quantity(shading.emission),
        lobes=tuple(
            LobeRow(
                lobe.kind,
                quantity(lobe.color),
                quantity(lobe.second),
                quantity(np.repeat(lobe.roughness, 3, axis=1)),
                lobe.ior,
                lobe.fresnel,
                lobe.multiscatter,
                np.broadcast_to(lobe.weight.max(axis=0), 3),  # none of the colours is larger than its weight
                lobe.view,
                lobe.edge,
                None if lobe.normal is None else quantity(lobe.normal),
                lobe.bump,
            )
            for lobe in shading.lobes
        ),
        back=back,
        emission_view=shading.emission_view,
    )


def as_constant(values: Float64) -> Quantity:
    """Return values (k, 3) as their mean."""
    return Quantity(values.mean(axis=0))


def as_texture(add: AddTexture) -> Callable[[Float64], Quantity]:
    """Return what keeps values (k, 3) as a constant where they are one, else as a texture."""

    def keep(values: Float64) -> Quantity:
        if np.ptp(values, axis=0).max() <= _EQUAL * max(1.0, float(np.abs(values).max())):
            return as_constant(values[:1])
        return Quantity(np.ones(3), add(values))

    return keep


def as_image(texture: int) -> Callable[[Float64], Quantity]:
    """Return what keeps values at `PROBES` as a constant, or as a multiple of an image."""

    def keep(values: Float64) -> Quantity:
        if len(values) == 1 or _is_constant(values):
            return Quantity(values[_WHITE % len(values)])
        return Quantity(values[_WHITE], texture)

    return keep


def is_proportional(shading: Shading) -> bool:
    """Tell whether all of a shading at `PROBES` is constant, or a constant times the probe."""
    quantities = [shading.albedo, shading.emission]
    for lobe in shading.lobes:
        quantities += [lobe.color, lobe.second]
        if not _is_constant(lobe.roughness):
            return False
    return all(
        len(values) == 1 or _is_constant(values) or np.allclose(values, values[_WHITE] * PROBES, atol=_EQUAL)
        for values in quantities
    )


def _is_constant(values: Float64) -> bool:
    return bool(np.allclose(values, values[:1], atol=_EQUAL))


def lets_light_pass(shading: Shading) -> bool:
    """Tell whether a surface does nothing at all to light."""
    return (
        not shading.albedo.any()
        and not shading.emission.any()
        and len(shading.lobes) == 1
        and shading.lobes[0].kind == TRANSPARENT
        and bool((shading.lobes[0].color >= 1.0 - _EQUAL).all())
    )


def pack_materials(rows: Sequence[MaterialRow]) -> Materials:
    """Return rows as arrays."""
    lobes = [(index, lobe) for index, row in enumerate(rows) for lobe in row.lobes]

    def colours(quantities: Sequence[Quantity]) -> NDArray[np.float32]:
        return np.array([quantity.colour for quantity in quantities], dtype=np.float32).reshape(-1, 3)

    def textures(quantities: Sequence[Quantity]) -> NDArray[np.int32]:
        return np.array([quantity.texture for quantity in quantities], dtype=np.int32)

    normal = [Quantity(np.zeros(3)) if lobe.normal is None else lobe.normal for _, lobe in lobes]
    color, second, roughness = ([getattr(lobe, name) for _, lobe in lobes] for name in ("color", "second", "roughness"))
    return Materials(
        names=tuple(row.name for row in rows),
        albedo=colours([row.albedo for row in rows]),
        texture=textures([row.albedo for row in rows]),
        emission=colours([row.emission for row in rows]),
        emission_texture=textures([row.emission for row in rows]),
        back=np.array([row.back for row in rows], dtype=np.int32),
        emission_view=_views([row.emission_view for row in rows]),
        lobes=Lobes(
            material=np.array([index for index, _ in lobes], dtype=np.int32),
            kind=np.array([lobe.kind for _, lobe in lobes], dtype=np.int32),
            color=colours(color),
            color_texture=textures(color),
            second=colours(second),
            second_texture=textures(second),
            roughness=np.ascontiguousarray(colours(roughness)[:, 0]),
            roughness_texture=textures(roughness),
            ior=np.array([lobe.ior for _, lobe in lobes], dtype=np.float32),
            fresnel=np.array([lobe.fresnel for _, lobe in lobes], dtype=np.int32),
            multiscatter=np.array([lobe.multiscatter for _, lobe in lobes], dtype=np.bool_),
            weight=np.array([lobe.weight for _, lobe in lobes], dtype=np.float32).reshape(-1, 3),
            edge=np.array(
                [np.zeros(3) if lobe.edge is None else lobe.edge for _, lobe in lobes], dtype=np.float32
            ).reshape(-1, 3),
            bump=np.array([lobe.bump for _, lobe in lobes], dtype=np.int32),
            normal=colours(normal),
            normal_texture=textures(normal),
            view=np.array([_tabulated(lobe.view) for _, lobe in lobes], dtype=np.float32).reshape(-1, VIEW_STEPS, 3),
        ),
    )


def _views(views: Sequence[Float64 | None]) -> NDArray[np.float32] | None:
    """Return views at evenly spaced cosines, (m, VIEW_STEPS, 3), None where all are ones."""
    if all(view is None for view in views):
        return None
    return np.array([_tabulated(view) for view in views], dtype=np.float32)


def _tabulated(view: Float64 | None) -> Float64:
    """Return a view at evenly spaced cosines, (VIEW_STEPS, 3)."""
    steps = np.linspace(0.0, 1.0, VIEW_STEPS)
    if view is None:
        return np.ones((VIEW_STEPS, 3))
    return np.stack([np.interp(steps, COSINES, np.broadcast_to(view, (len(view), 3))[:, c]) for c in range(3)], axis=1)
