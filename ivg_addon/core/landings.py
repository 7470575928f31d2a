# SPDX-License-Identifier: GPL-3.0-or-later
"""What arrived at the surfaces: how many photons, and how much light, at each side of each patch.

All threads add to the same sums, one batch at a time: there may be more patches than vertices of a grid. The sums are
integers, so their order does not matter.
"""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from .compiled import kernel
from .scattering import ENERGY_STEPS
from .scene import Float32, Int32
from .surface_bins import SurfaceBins


class Landings:
    """The sums of one walk over the patches of some bins."""

    def __init__(self, bins: SurfaceBins) -> None:
        # A row for each side of each patch: photons, and their weights in steps. They lie together, for what takes
        # time is to find them in memory.
        self._sums = np.zeros((bins.count, 2, 4), dtype=np.int64)
        self._lock = threading.Lock()

    @property
    def counts(self) -> Int32:
        """Return how many photons each side received, (patches, 2): a copy."""
        return self._sums[..., 0].astype(np.int32)

    @property
    def weights(self) -> Float32:
        """Return how much weight of the grid's light arrived there, (patches, 2, 3)."""
        return np.divide(self._sums[..., 1:], ENERGY_STEPS, dtype=np.float32, casting="same_kind")

    def receive(self, places: NDArray[np.int64], weights: Float32) -> None:
        """Add n photons: 2 · patch + side, (n,), and what of their weight counts, (n, 3)."""
        with self._lock:
            add_up(places, weights, self._sums.reshape(-1, 4))


@kernel
def add_up(places, weights, sums):
    """Count n photons at their places, and add their weights."""
    for row in range(len(places)):
        place = np.uint64(places[row])
        sums[place, 0] += 1
        sums[place, 1] += np.int64(weights[row, 0] * ENERGY_STEPS)
        sums[place, 2] += np.int64(weights[row, 1] * ENERGY_STEPS)
        sums[place, 3] += np.int64(weights[row, 2] * ENERGY_STEPS)
