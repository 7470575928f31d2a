# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure what estimators and look-ups make of a uniform field: `python -m benchmarks.uniform_field [--photons N]`.

Straight lines of an isotropic field of radiance 1 fly through a lattice; E should be π for every normal. Numbers are in
units of π, the mean over the inner vertices, ± their standard error; beside them stand the closed forms: the report's
estimator loses a third, ∫ cos²θ dω = 2π/3, and its look-up falls to |n_x|³ + |n_y|³ + |n_z|³. Exits with 1 if
something is not what its closed form says.
"""

from __future__ import annotations

import argparse
import math
import sys

import numpy as np
from numpy.typing import NDArray

from ivg_addon.core.reconstruction import coefficients
from ivg_addon.core.settings import Directional, Estimator
from ivg_addon.core.tally import GRAZING_COSINE
from tests.core.test_tally import isotropic_flights, tallied
from tests.core.z_tests import FALSE_ALARM, largest_z

Float64 = NDArray[np.float64]

BATCHES = 48
NORMALS = ((1, 0, 0), (1, 0, -1), (-1, 1, 1), (3, 2, 1))
SHARES = {Estimator.REPORT: 2 / 3, Estimator.CROSSING: 1 - GRAZING_COSINE**2 / 3, Estimator.TRACK_LENGTH: 1.0}
"""What is left of ∫ cos θ dω; `CROSSING` caps 1/cos θ."""


def estimates(photons: int, seed: int) -> dict[Estimator, Float64]:
    """Return independent estimates of the mean vectors over the inner vertices, (batches, 6, 3 xyz), over π."""
    made: dict[Estimator, list[Float64]] = {estimator: [] for estimator in Estimator}
    for batch in range(BATCHES):
        flights, flux = isotropic_flights(photons // BATCHES, seed * BATCHES + batch)
        for estimator, batches in made.items():
            vectors = tallied(flights, estimator).vectors(flux)[1:-1, 1:-1, 1:-1, :, 0, :]
            batches.append(vectors.mean(axis=(0, 1, 2)) / math.pi)
    return {estimator: np.stack(batches) for estimator, batches in made.items()}


def main() -> int:
    """Measure and print a table; return the exit status."""
    parser = argparse.ArgumentParser(description="Measure what estimators and look-ups make of a uniform field.")
    parser.add_argument("--photons", type=int, default=16_000_000, help="lines (default 16 million)")
    parser.add_argument("--seed", type=int, default=0, help="other lines (default 0)")
    options = parser.parse_args()
    tests = len(Estimator) * len(Directional) * len(NORMALS)
    failed = 0
    print(f"{'estimator':13} {'look-up':14} {'normal':11} {'E/π':>19}   closed form     z")
    for estimator, vectors in estimates(options.photons, options.seed).items():
        for directional in Directional:
            for normal in NORMALS:
                n = np.array(normal) / np.linalg.norm(normal)
                fall = float((np.abs(n) ** 3).sum()) if directional is Directional.REPORT else 1.0
                expected = SHARES[estimator] * fall
                found = np.einsum("dj,bdj->b", coefficients(n, directional), vectors)
                error = found.std(ddof=1) / math.sqrt(BATCHES)
                z = largest_z(found, expected)
                wrong = tests * math.erfc(z / math.sqrt(2.0)) < FALSE_ALARM
                failed += wrong
                print(
                    f"{estimator:13} {directional:14} {normal!s:11} {found.mean():8.5f} ± {error:.5f}"
                    f"   {expected:11.5f}  {math.copysign(z, found.mean() - expected):4.1f}{'  WRONG' if wrong else ''}"
                )
    print(f"\n{failed} differ from their closed forms")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
