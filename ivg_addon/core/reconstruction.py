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
    """Fill c (6, 3): the least-squares projection of the clamped cosine (design in docs/method.md).

    With F = I_{+k} + I_{−k} (the same for each k: averaged) and D_k = I_{+k} − I_{−k},

        E(n) = ½ F·n + ½ Σ_kj W_kj D_kj,
        W_kk = (r_k − mean(r)) / (π − 2) + 1/3,     r_k = 2 (a_k n_k + s_k),
        W_kl = 2 (π a_k n_l − 2 a_l n_k) / (π² − 4),   a_k = arcsin n_k,  s_k = √(1 − n_k²).
    """
    a0, a1, a2 = math.asin(n[0]), math.asin(n[1]), math.asin(n[2])
    a = (a0, a1, a2)
    r0 = 2.0 * (a0 * n[0] + math.sqrt(max(0.0, 1.0 - n[0] * n[0])))
    r1 = 2.0 * (a1 * n[1] + math.sqrt(max(0.0, 1.0 - n[1] * n[1])))
    r2 = 2.0 * (a2 * n[2] + math.sqrt(max(0.0, 1.0 - n[2] * n[2])))
    r = (r0, r1, r2)
    mean = (r0 + r1 + r2) / 3.0
    for k in range(3):
        for j in range(3):
            if j == k:
                w = (r[k] - mean) / (math.pi - 2.0) + 1.0 / 3.0
            else:
                w = 2.0 * (math.pi * a[k] * n[j] - 2.0 * a[j] * n[k]) / (math.pi * math.pi - 4.0)
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
