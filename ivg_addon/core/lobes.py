# SPDX-License-Identifier: GPL-3.0-or-later
"""Lobes as kernels see them: few arrays of many columns, for a reference to each array costs time."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .microfacets import ENERGY_STEPS_COSINE, ENERGY_STEPS_ROUGHNESS, fill_energy, mean_fresnel_factor
from .scene import GLASS, GLOSSY, MATTE, NO_TEXTURE, PANE, TRANSPARENT, VIEW_STEPS, Float32, Int32, Lobes, Materials

KIND, FRESNEL, COLOR_TEXTURE, SECOND_TEXTURE, ROUGHNESS_TEXTURE, FRONT_ENERGY, BACK_ENERGY, VIEW, BUMP = range(9)
NORMAL_TEXTURE = 9
"""Columns of `LobeTable.codes`; energy tables are those of the lobe as seen from each side."""
COLOR, SECOND, UNWEIGHTED, ROUGHNESS, IOR, MEAN_FRESNEL, EDGE, NORMAL = 0, 3, 6, 9, 10, 11, 12, 15
"""Columns of `LobeTable.numbers`; the first three and `EDGE` are colours."""
NO_ENERGY = -1
"""The lobe loses what bounces between its facets."""
NO_VIEW = -1
"""The lobe sends the same towards all directions, but for what its kind tells."""

_LEAST_IOR = 1e-5


class LobeTable(NamedTuple):
    """All lobes of a scene; m materials, l lobes, t energy tables, v views.

    first : (m + 1,) int64
        Row of each material's first lobe; its last is before that of the next material.
    codes : (l, 10) int32, numbers : (l, 18) float32
        Columns as named above. `UNWEIGHTED` is what turns a colour into one without the lobe's weight.
    scatters : (m,) bool
        The material, or that of its back side, has lobes.
    lets_pass : (m,) bool
        It has transparent ones.
    matte : (m,) bool
        It has matte ones, which are all of its diffuse reflection.
    textured : (m,) bool
        Some of the material's own lobes have textures.
    energy, mean_energy : (t, …) float32
        See `microfacets.fill_energy`.
    views : (v, VIEW_STEPS, 3) float32
        See `scene.Lobes`.
    """

    first: NDArray[np.int64]
    codes: Int32
    numbers: Float32
    scatters: NDArray[np.bool_]
    lets_pass: NDArray[np.bool_]
    matte: NDArray[np.bool_]
    textured: NDArray[np.bool_]
    energy: Float32
    mean_energy: Float32
    views: Float32

    @classmethod
    def of(cls, materials: Materials, back: Int32) -> LobeTable:
        """Gather the lobes of materials whose back sides are the materials `back` (m,)."""
        lobes, count = materials.lobes, len(materials.names)
        first = np.searchsorted(lobes.material, np.arange(count + 1)).astype(np.int64)
        ior = np.maximum(lobes.ior, _LEAST_IOR).astype(np.float32)
        tables, etas = _energy_tables(lobes, ior)
        energy, mean_energy = _energies(etas)
        has_lobes = np.diff(first) > 0
        transparent, matte = (
            np.bincount(lobes.material[lobes.kind == kind], minlength=count) > 0 for kind in (TRANSPARENT, MATTE)
        )
        textures = np.column_stack([lobes.color_texture, lobes.second_texture, lobes.roughness_texture])
        bump = np.zeros_like(lobes.kind) if lobes.bump is None else lobes.bump
        normal = np.zeros_like(lobes.color) if lobes.normal is None else lobes.normal
        plain = np.full_like(lobes.kind, NO_TEXTURE)
        normal_texture = plain if lobes.normal_texture is None else lobes.normal_texture
        has_texture = (textures != NO_TEXTURE).any(axis=1) | (normal_texture != NO_TEXTURE)
        means = [mean_fresnel_factor(int(shape), float(eta)) for shape, eta in zip(lobes.fresnel, ior, strict=True)]
        weight = np.ones_like(lobes.color) if lobes.weight is None else lobes.weight
        edge = np.zeros_like(lobes.color) if lobes.edge is None else lobes.edge
        view, views = _views(lobes)
        return cls(
            first=first,
            codes=np.column_stack([lobes.kind, lobes.fresnel, textures, tables, view, bump, normal_texture]).astype(
                np.int32
            ),
            numbers=np.column_stack(
                [
                    *(lobes.color, lobes.second, np.divide(1.0, weight, out=np.zeros_like(weight), where=weight > 0)),
                    *(np.clip(lobes.roughness, 0.0, 1.0), ior, np.array(means, dtype=np.float32), edge, normal),
                ]
            ).astype(np.float32),
            scatters=has_lobes | has_lobes[back],
            lets_pass=transparent | transparent[back],
            matte=matte,
            textured=np.bincount(lobes.material[has_texture], minlength=count) > 0,
            energy=energy,
            mean_energy=mean_energy,
            views=views,
        )


def _views(lobes: Lobes) -> tuple[Int32, Float32]:
    """Return each lobe's place among the views, (l,), and those that are not all ones."""
    place = np.full(len(lobes.kind), NO_VIEW, dtype=np.int32)
    if lobes.view is None:
        return place, np.zeros((0, VIEW_STEPS, 3), dtype=np.float32)
    uneven = (lobes.view != 1.0).any(axis=(1, 2))
    place[uneven] = np.arange(np.count_nonzero(uneven))
    return place, np.ascontiguousarray(lobes.view[uneven])


def _energy_tables(lobes: Lobes, ior: Float32) -> tuple[Int32, tuple[float, ...]]:
    """Return each lobe's tables, (l, 2), and what they are for; see `fill_energy`."""
    etas: dict[float, int] = {}
    tables = np.full((len(lobes.kind), 2), NO_ENERGY, dtype=np.int32)
    for row in np.flatnonzero(lobes.multiscatter):
        if lobes.kind[row] in (GLOSSY, PANE):
            seen = (0.0, 0.0)
        elif lobes.kind[row] == GLASS:
            seen = (float(ior[row]), 1.0 / float(ior[row]))
        else:
            continue
        tables[row] = [etas.setdefault(eta, len(etas)) for eta in seen]
    return tables, tuple(etas)


@lru_cache(maxsize=4)
def _energies(etas: tuple[float, ...]) -> tuple[Float32, Float32]:
    """Tabulate E and Ē for indices of refraction; 0.1 s each."""
    energy = np.empty((len(etas), ENERGY_STEPS_ROUGHNESS, ENERGY_STEPS_COSINE), dtype=np.float32)
    mean = np.empty((len(etas), ENERGY_STEPS_ROUGHNESS), dtype=np.float32)
    fill_energy(np.array(etas, dtype=np.float64), energy, mean)
    return energy, mean
