# SPDX-License-Identifier: GPL-3.0-or-later
"""From six vectors to the irradiance of any normal: the directional reconstruction.

Irradiance is linear in the six vectors, E(n) = Σ_δ Σ_j c_δj(n) I_δj, so a reconstruction is its 18
coefficients c(n): rows in the order +x, −x, +y, −y, +z, −z, columns x, y, z.
"""

from __future__ import annotations

import math

import numpy as np

from .compiled import merged
from .settings import Directional

REPORT = 0
LEAST_SQUARES = 1

DIRECTIONAL_CODES = {Directional.REPORT: REPORT, Directional.LEAST_SQUARES: LEAST_SQUARES}


@merged
def report_coefficients(n, c):
    """Fill c (6, 3): E = Σ_k n_k² ⟨I_k, n⟩, axis k on the side of n's sign. [IVG §4.1].

    Exact on the axes; in a uniform field E/π falls to |n_x|³ + |n_y|³ + |n_z|³.
    """
    for k in range(3):
        side = 0 if n[k] >= 0.0 else 1
        for j in range(3):
            c[2 * k + side, j] = n[k] * n[k] * n[j]
            c[2 * k + 1 - side, j] = 0.0


@merged
def least_squares_coefficients(n, c):
    """Fill c (6, 3): the least-squares projection of the clamped cosine that is exact up to degree three.

    With F = I_{+k} + I_{−k} (the same for each k: averaged) and D_k = I_{+k} − I_{−k},

        E(n) = ½ F·n + ½ Σ_kj W_kj D_kj,
        W_kl = ½ n_k n_l + (a_k n_l − a_l n_k) / (π − 2),   k ≠ l,   a_k = arcsin n_k,
        W_kk = n_k².

    ½ F·n is all that odd harmonics of the radiance add. W is the projection of |ω·n| onto {sgn(ω_k) ω_j} constrained to
    be exact for every quadratic radiance: that fixes W_kk and W_kl + W_lk (docs/method.md).
    """
    a = (math.asin(n[0]), math.asin(n[1]), math.asin(n[2]))
    for k in range(3):
        for j in range(3):
            if j == k:
                w = n[k] * n[k]
            else:
                w = 0.5 * n[k] * n[j] + (a[k] * n[j] - a[j] * n[k]) / (math.pi - 2.0)
            c[2 * k, j] = 0.5 * (n[j] / 3.0 + w)
            c[2 * k + 1, j] = 0.5 * (n[j] / 3.0 - w)


@merged
def directional_coefficients(directional, n, c):
    """Fill c (6, 3) for one of the codes `REPORT`, `LEAST_SQUARES`; n must be a unit vector."""
    if directional == REPORT:
        report_coefficients(n, c)
    else:
        least_squares_coefficients(n, c)


def coefficients(normal: np.ndarray, directional: Directional) -> np.ndarray:
    """Return c(n), (6, 3) float64, of one unit normal (3,): for inspection and tests."""
    c = np.empty((6, 3))
    directional_coefficients(DIRECTIONAL_CODES[directional], tuple(float(x) for x in normal), c)
    return c
