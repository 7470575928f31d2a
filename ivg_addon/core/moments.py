# SPDX-License-Identifier: GPL-3.0-or-later
"""The twelve vectors in which the six irradiance vectors of a vertex are contained.

The two hemispheres of an axis k make up the sphere, so I_{+k} + I_{−k} = ∫ L(ω) ω dω = F for every k. Of the 54
numbers of a vertex 36 are therefore free: F, and for each axis the difference D_k = I_{+k} − I_{−k}. Irradiance by
least squares is E(n) = ½ (F·n + Σ_kj W_kj(n) D_kj) (reconstruction.py), and the six vectors are I_{±k} = ½ (F ± D_k).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

NAMES = ("F_x", "F_y", "F_z", *(f"D_{k}{j}" for k in "xyz" for j in "xyz"))
"""In their order; each is one number per channel."""

Float64 = NDArray[np.float64]


def moments(vectors: NDArray[Any]) -> Float64:
    """Return F and D (…, 12, 3 channel) of vectors (…, 6, 3 channel, 3 xyz).

    F is the mean over the axes, which differ where photons were counted at faces.
    """
    pairs = vectors.astype(np.float64).reshape(*vectors.shape[:-3], 3, 2, 3, 3)
    result = np.empty((*vectors.shape[:-3], len(NAMES), 3))
    result[..., :3, :] = (pairs.sum(axis=(-4, -3)) / 3.0).swapaxes(-1, -2)
    difference = pairs[..., 0, :, :] - pairs[..., 1, :, :]
    result[..., 3:, :] = difference.swapaxes(-1, -2).reshape(*vectors.shape[:-3], 9, 3)
    return result


def vectors(values: NDArray[Any]) -> Float64:
    """Return I_{±k} = ½ (F ± D_k), (…, 6, 3 channel, 3 xyz), of F and D (…, 12, 3 channel)."""
    exact = values.astype(np.float64)
    total = exact[..., :3, :].swapaxes(-1, -2)[..., None, :, :]
    difference = exact[..., 3:, :].reshape(*values.shape[:-2], 3, 3, 3).swapaxes(-1, -2)
    return np.stack([0.5 * (total + difference), 0.5 * (total - difference)], axis=-3).reshape(
        *values.shape[:-2], 6, 3, 3
    )
