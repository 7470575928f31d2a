# SPDX-License-Identifier: GPL-3.0-or-later
"""Aim: more photons, each with less light, where they are of use.

A photon of the surroundings (suns, world, environment maps) is a function of five uniform numbers:
they say from where and through which point of the box it flies. A guide divides their unit cube
into leaves, boxes of volume V_l, and sends r_l ≥ 1 times as many photons into each as their share,
with 1/r_l of the flux: whatever the r_l, the expectation of every sum is what it is without a guide.
So an emitter of strength s is picked in proportion to s Σ V_l r_l, and a leaf of it in proportion to
V_l r_l. (Müller, Gross & Novák, "Practical Path Guiding for Efficient Light-Transport Simulation",
EGSR 2017, for the idea of guiding by trees; Guo, Bauszat, Bikker & Eisemann, "Primary Sample Space
Path Guiding", EGSR 2018, for that of dividing the random numbers' cube.) `aim.py` finds leaves and r.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import merged
from .search import first_above

Float64 = NDArray[np.float64]

NUMBERS = 5
"""Uniform numbers that say where a photon of the surroundings flies."""


@dataclass(frozen=True)
class Leaves:
    """A division of the unit cube of five numbers.

    Parameters
    ----------
    low, size : (n, 5) float64
        Boxes that fill the cube and do not overlap.
    ratio : (n,) float64
        r: at least 1.
    """

    low: Float64
    size: Float64
    ratio: Float64

    @classmethod
    def whole(cls) -> Leaves:
        """Return the cube itself, without any aim."""
        return cls(np.zeros((1, NUMBERS)), np.ones((1, NUMBERS)), np.ones(1))

    @property
    def volume(self) -> Float64:
        """Return V, (n,)."""
        volume: Float64 = self.size.prod(axis=1)
        return volume

    @property
    def more(self) -> float:
        """Return Σ V r: how many times more photons there are."""
        return float(self.volume @ self.ratio)


class Guide(NamedTuple):
    """Leaves of all guided emitters as the kernel sees them.

    first_leaf : (emitters + 1,) int64
        Where each emitter's leaves begin.
    sums : (leaves,) float64
        Share of the emitter's photons up to and with each leaf.
    low, size : (leaves, 5) float64
    weight : (leaves,) float64
        1/r.
    rest : (1,) float64
        1/r of all other emitters.
    """

    first_leaf: NDArray[np.int64]
    sums: Float64
    low: Float64
    size: Float64
    weight: Float64
    rest: Float64

    @classmethod
    def of(cls, leaves: list[Leaves], rest: float = 1.0) -> Guide:
        """Gather the arrays that the kernel needs.

        Parameters
        ----------
        leaves
            Of each guided emitter.
        rest
            r of all other emitters.
        """
        shares = [np.cumsum(one.volume * one.ratio) for one in leaves]
        none = np.empty((0, NUMBERS))
        return cls(
            first_leaf=np.cumsum([0, *(len(one.ratio) for one in leaves)]),
            sums=np.concatenate([np.empty(0), *(share / share[-1] for share in shares)]),
            low=np.concatenate([none, *(one.low for one in leaves)]),
            size=np.concatenate([none, *(one.size for one in leaves)]),
            weight=np.concatenate([np.empty(0), *(1.0 / one.ratio for one in leaves)]),
            rest=np.array([1.0 / rest]),
        )


@merged
def pick_leaf(first_leaf, sums, guided, xi):
    """Return the leaf that a uniform number falls on."""
    return first_above(sums, first_leaf[guided], first_leaf[guided + 1] - 1, xi)


@merged
def within_leaf(low, size, leaf, xi_0, xi_1, xi_2, xi_3, xi_4):
    """Return five uniform numbers, moved into a leaf."""
    return (
        low[leaf, 0] + size[leaf, 0] * xi_0,
        low[leaf, 1] + size[leaf, 1] * xi_1,
        low[leaf, 2] + size[leaf, 2] * xi_2,
        low[leaf, 3] + size[leaf, 3] * xi_3,
        low[leaf, 4] + size[leaf, 4] * xi_4,
    )
