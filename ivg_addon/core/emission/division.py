# SPDX-License-Identifier: GPL-3.0-or-later
"""Divide the cube of a photon's numbers into boxes that differ in how useful photons of them are.

A photon of merit m (the second moment of what it adds to the sums) costs the least variance if as
many photons are sent into a leaf as √E[m] there (Veach 1997, §2.2.2). So the cost of a division is
Σ V √ū, ū the mean merit of a leaf, and leaves are cut in two where that lowers it most, at one of
fifteen places along one of the five axes, as long as the two parts differ beyond doubt.
"""

from __future__ import annotations

import heapq
import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .guide import NUMBERS, Leaves

Float64 = NDArray[np.float64]

_BINS = 16
_FEWEST = 16
"""Photons that a leaf is judged by at least."""
_BEYOND_DOUBT = 4.0
"""Standard errors that the means of two parts differ by."""
_LEAST_GAIN = 1e-4
"""Share of the whole cost that a cut saves at least."""
_MOST_LEAVES = 1024


@dataclass
class Leaf:
    """A box of the cube, and the photons that were tried in it.

    Parameters
    ----------
    low, size : (5,) float64
    numbers : (n, 5) float32
        What the photons were made of: uniform in the box.
    merit : (n,) float64
    """

    low: Float64
    size: Float64
    numbers: NDArray[np.float32]
    merit: Float64

    @classmethod
    def whole(cls) -> Leaf:
        """Return the cube, where nothing was tried yet."""
        return cls(np.zeros(NUMBERS), np.ones(NUMBERS), np.empty((0, NUMBERS), np.float32), np.empty(0))

    @property
    def volume(self) -> float:
        """Return V."""
        return float(self.size.prod())

    def add(self, numbers: Float64, merit: Float64) -> None:
        """Take in further photons."""
        self.numbers = np.concatenate([self.numbers, numbers.astype(np.float32)])
        self.merit = np.concatenate([self.merit, merit])

    def split(self, axis: int, share: float) -> tuple[Leaf, Leaf]:
        """Return the two parts below and above a share of the way along an axis."""
        below = self.numbers[:, axis] < np.float32(self.low[axis] + share * self.size[axis])
        first, second = self.size.copy(), self.size.copy()
        first[axis] *= share
        second[axis] -= first[axis]
        beyond = self.low.copy()
        beyond[axis] += first[axis]
        return (
            Leaf(self.low, first, self.numbers[below], self.merit[below]),
            Leaf(beyond, second, self.numbers[~below], self.merit[~below]),
        )


def mean_merit(total: ArrayLike, count: ArrayLike, typical: float) -> Float64:
    """Return the mean merit that `count` photons with a sum of `total` speak for.

    A photon that is of use has a `typical` merit. Half of one more is added: where none of n photons was of use, a
    share of ½/n of the next may be (Jeffreys' prior).
    """
    sums, counts = np.asarray(total, dtype=np.float64), np.asarray(count, dtype=np.float64)
    return np.asarray((sums + 0.5 * typical) / (counts + 1.0))


def divide(leaves: list[Leaf], typical: float) -> list[Leaf]:
    """Cut leaves in two as long as it pays; returns leaves in an order that depends on the photons alone."""
    order = itertools.count()
    waiting: list[tuple[float, int, Leaf, int, float]] = []
    done = []
    whole = sum(leaf.volume * np.sqrt(mean_merit(leaf.merit.sum(), len(leaf.merit), typical)) for leaf in leaves)

    def consider(leaf: Leaf) -> None:
        gain, axis, share = _best_cut(leaf, typical)
        if gain > _LEAST_GAIN * whole:
            heapq.heappush(waiting, (-gain, next(order), leaf, axis, share))
        else:
            done.append(leaf)

    for leaf in leaves:
        consider(leaf)
    while waiting and len(waiting) + len(done) < _MOST_LEAVES:
        _, _, leaf, axis, share = heapq.heappop(waiting)
        for part in leaf.split(axis, share):
            consider(part)
    return [*done, *(leaf for _, _, leaf, _, _ in waiting)]


def _best_cut(leaf: Leaf, typical: float) -> tuple[float, int, float]:
    """Return how much the best cut saves, its axis, and its place as a share; (0, 0, 0) without one."""
    n = len(leaf.merit)
    if n < 2 * _FEWEST or not leaf.merit.any():
        return 0.0, 0, 0.0
    place = (leaf.numbers - leaf.low.astype(np.float32)) * (_BINS / leaf.size).astype(np.float32)
    place = np.clip(place.astype(np.int64), 0, _BINS - 1) + _BINS * np.arange(NUMBERS)
    shape = (NUMBERS, _BINS)
    counts = np.bincount(place.ravel(), minlength=NUMBERS * _BINS).reshape(shape)
    sums = np.bincount(place.ravel(), np.repeat(leaf.merit, NUMBERS), NUMBERS * _BINS).reshape(shape)
    below_n, below = np.cumsum(counts, axis=1)[:, :-1], np.cumsum(sums, axis=1)[:, :-1]
    total = float(leaf.merit.sum())
    above_n, above = n - below_n, total - below
    share = np.arange(1, _BINS) / _BINS
    parts = share * np.sqrt(mean_merit(below, below_n, typical)) + (1 - share) * np.sqrt(
        mean_merit(above, above_n, typical)
    )
    gain = leaf.volume * (np.sqrt(mean_merit(total, n, typical)) - parts)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.sqrt(leaf.merit.var() * (1.0 / below_n + 1.0 / above_n))
        apart = np.abs(below / below_n - above / above_n) > _BEYOND_DOUBT * error
    gain[~(apart & (below_n >= _FEWEST) & (above_n >= _FEWEST))] = 0.0
    axis, cut = np.unravel_index(int(gain.argmax()), gain.shape)
    return float(gain[axis, cut]), int(axis), float(share[cut])


def with_ratios(leaves: list[Leaf], ratio: Float64) -> Leaves:
    """Return leaves for a guide."""
    return Leaves(np.array([leaf.low for leaf in leaves]), np.array([leaf.size for leaf in leaves]), ratio)
