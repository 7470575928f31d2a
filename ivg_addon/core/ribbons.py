# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces that only their front meets light: hair that Cycles draws as ribbons.

A ribbon of length l and radius r that makes the angle θ with a ray shows it 2 r l sin θ; there is nothing at its ends.
A tube without ends stops another π r² cos θ, what flies in at one end and meets the inside. So light that meets the
inside of a ribbon's tube goes on as if it were not there: what is left is the part of a convex surface that faces the
ray, and that is 2 r l sin θ. (Measured in Cycles for θ from 0 to 80°, l/r of 5 and 20: this for ribbons, and what a
tube without ends stops for curves.)

As Cycles sees a ribbon it has no back: whatever its material does with light from either side, it does at the front.
So what is reflected becomes the front's, what is let through that of the back, for the side that light leaves by tells
it (`scene.Materials`); light that comes to the inside leaves by the front, which lets all of it through.
"""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .scene import GLASS, LETTING_THROUGH, NO_TEXTURE, NONE, TRANSPARENT, Geometry, Int32, Lobes, Materials


def as_ribbons(geometry: Geometry, materials: Materials, triangles: NDArray[np.int64]) -> tuple[Geometry, Materials]:
    """Return a scene's surfaces with some triangles that only their front meets light.

    Parameters
    ----------
    triangles : (k,) int64
        Which of them.
    """
    used, place = np.unique(geometry.material[triangles], return_inverse=True)
    count = len(materials.names)
    # In the order front, back of each that is used.
    front = (count + 2 * np.arange(len(used))).astype(np.int32)
    material = geometry.material.copy()
    material[triangles] = front[place]
    back = np.arange(count, dtype=np.int32) if materials.back is None else materials.back
    emission_texture, view = materials.emission_texture, materials.emission_view
    made = replace(
        materials,
        names=(*materials.names, *(materials.names[row] for row in used for _ in range(2))),
        albedo=_front_only(materials.albedo, used, 0.0),
        texture=_front_only(materials.texture, used, NO_TEXTURE),
        emission=_front_only(materials.emission, used, 0.0),
        emission_texture=None if emission_texture is None else _front_only(emission_texture, used, NO_TEXTURE),
        emission_view=None if view is None else _front_only(view, used, 1.0),
        back=np.concatenate([back, np.repeat(front, 2) + np.tile(np.array([1, 0], dtype=np.int32), len(used))]),
        lobes=_parted(materials.lobes, used, front),
    )
    return replace(geometry, material=material), made


def _front_only(values: NDArray[Any], used: Int32, none: float) -> NDArray[Any]:
    """Append rows (m, …): of each material `used` its own, and one of nothing."""
    more = np.full((2 * len(used), *values.shape[1:]), none, dtype=values.dtype)
    more[::2] = values[used]
    return np.concatenate([values, more])


def _parted(lobes: Lobes, used: Int32, front: Int32) -> Lobes:
    """Append the lobes of new materials: those that reflect and one that lets all pass, and those that let through."""
    rows, owners = [], []
    clear = _clear(lobes)
    for material, index in zip(used, front, strict=True):
        own = np.flatnonzero(lobes.material == material)
        passes = np.isin(lobes.kind[own], LETTING_THROUGH)
        reflecting, passing = own[~passes | (lobes.kind[own] == GLASS)], own[passes]
        rows += [_rows(lobes, reflecting, "second"), clear, _rows(lobes, passing, "color")]
        owners += [np.full(len(reflecting) + 1, index), np.full(len(passing), index + 1)]
    joined: dict[str, Any] = {}
    for name in (each.name for each in fields(Lobes)):
        values = getattr(lobes, name)
        joined[name] = None if values is None else np.concatenate([values, *(row[name] for row in rows)])
    joined["material"] = np.concatenate([lobes.material, *owners]).astype(np.int32)
    return Lobes(**joined)


def _rows(lobes: Lobes, chosen: NDArray[np.int64], glass_without: str) -> dict[str, NDArray[Any]]:
    """Return some lobes' columns; glass, which reflects and lets through, with one of the two."""
    columns = {each.name: getattr(lobes, each.name) for each in fields(Lobes)}
    found = {name: values[chosen] for name, values in columns.items() if values is not None}
    found[glass_without][found["kind"] == GLASS] = 0.0
    return found


def _clear(lobes: Lobes) -> dict[str, NDArray[Any]]:
    """Return the columns of one lobe that lets all light pass."""
    own: dict[str, float] = {
        "kind": TRANSPARENT,
        "color_texture": NO_TEXTURE,
        "second_texture": NO_TEXTURE,
        "roughness_texture": NO_TEXTURE,
        "roughness": 0.0,
        "fresnel": NONE,
        "multiscatter": False,
        "edge": 0.0,
        "bump": 0,
        "normal_texture": NO_TEXTURE,
    }
    columns = {each.name: getattr(lobes, each.name) for each in fields(Lobes)}
    return {
        name: np.full((1, *values.shape[1:]), own.get(name, 1.0), dtype=values.dtype)
        for name, values in columns.items()
        if values is not None
    }
