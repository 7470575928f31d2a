# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces that cast no shadow: light flies through them, and lights them all the same.

In Cycles a shadow ray passes objects that shadow rays do not see, whatever surface it starts from: the first flight of
a photon ends at the first surface that casts a shadow, and all surfaces on its way receive its light in full. Of these
j surfaces the photon meets one, each with the probability 1/j, with j times its weight: every surface receives, on
average, what is due to it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .compiled import kernel
from .embree import MISS, Hits, Tracer
from .random import STREAM_EMISSION, random4
from .scene import Float32
from .tally import WEIGHT_LIMIT

_STREAM = STREAM_EMISSION + 14
"""A stream of emission that no light draws from."""
_STEP = 2e-6
"""By what share of the largest coordinate a flight goes on behind a surface that it passes."""


def choose_lit(
    passed: Tracer,
    seed: int,
    photons: NDArray[np.int64],
    origins: Float32,
    directions: Float32,
    hits: Hits,
) -> Float32:
    """Choose the surface that each of n first flights meets; return the factors of their weights, (n,) float32.

    Of more than `WEIGHT_LIMIT` surfaces on a flight, those nearest to the light are lit, and what stops it.

    Parameters
    ----------
    passed
        The surfaces that light flies through.
    seed
        Key of the random numbers.
    photons : (n,) int64, origins, directions : (n, 3) float32
        The flights.
    hits
        Where they end; triangle and place are changed to those of the chosen surface, the distance is not.
    """
    ends = hits.distance
    lit = (hits.triangle != MISS).astype(np.int32)
    coin = np.empty(len(photons))
    draw(seed, photons, coin)
    rows = np.arange(len(photons))
    travelled = np.zeros(len(photons), dtype=np.float32)
    last = np.full(len(photons), MISS, dtype=np.int32)
    while len(rows):
        onward = np.ascontiguousarray(directions[rows])
        met = passed.intersect(origins[rows] + travelled[rows, None] * onward, onward)
        place = travelled[rows] + met.distance
        meets = (met.triangle != MISS) & (place < ends[rows]) & (lit[rows] < WEIGHT_LIMIT)
        rows, place = rows[meets], place[meets]
        triangle, u, v = met.triangle[meets], met.u[meets], met.v[meets]
        # A step that was too short meets the same triangle once more.
        new = triangle != last[rows]
        last[rows] = triangle
        lit[rows[new]] += 1
        share = 1.0 / lit[rows]
        chosen = new & (coin[rows] < share)
        # What is left of a uniform number after it has decided is a uniform number again.
        rest = np.where(chosen, coin[rows] / share, (coin[rows] - share) / np.maximum(1.0 - share, 1e-12))
        coin[rows[new]] = rest[new]
        for kept, met_there in ((hits.triangle, triangle), (hits.u, u), (hits.v, v)):
            kept[rows[chosen]] = met_there[chosen]
        reach = np.abs(origins[rows]).max(axis=1, initial=0.0) + place
        travelled[rows] = place + np.float32(_STEP) * reach
    factors: Float32 = np.maximum(lit, 1).astype(np.float32)
    return factors


@kernel
def draw(seed, photons, numbers):
    """Fill numbers (n,) float64 with a uniform number of each photon."""
    for i in range(len(photons)):
        numbers[i] = random4(seed, photons[i], _STREAM)[0]
