# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake a furnace: `python -m benchmarks.furnace [--photons N] [--bakes N]`.

A closed box whose walls all have one albedo ρ and one emission L: the indirect light inside is uniform, and every point
with any normal receives E = π L Σ ρᵏ over the bounces k from 1. The colour channels have albedos of their own. E is the
mean over random points and normals; the standard error is measured over bakes with different seeds. Exits with 1 if an
unbiased estimator is off by more than chance allows.
"""

from __future__ import annotations

import argparse
import math
import sys
from dataclasses import replace

import numpy as np

from ivg_addon.core.bake import bake
from ivg_addon.core.settings import BakeSettings, Estimator
from ivg_addon.core.tally import GRAZING_COSINE
from tests.core.rooms import box, scene
from tests.core.z_tests import FALSE_ALARM, largest_z

LOW, HIGH = (0.0, 0.0, 0.0), (1.0, 1.5, 2.0)
RESOLUTION = (4, 6, 8)
ALBEDO = np.array([0.2, 0.5, 0.8])
RADIANCE = np.array([0.5, 2.0, 1.0])
POINTS = 2000
SHARES = {Estimator.TRACK_LENGTH: 1.0, Estimator.CROSSING: 1 - GRAZING_COSINE**2 / 3}
"""What the unbiased estimators return of the light; `CROSSING` caps 1/cos θ."""


def main() -> int:
    """Bake and print a table; return the exit status."""
    parser = argparse.ArgumentParser(description="Bake a furnace and compare with its closed form.")
    parser.add_argument("--photons", type=int, default=1 << 18, help="photons of a bake (default 262,144)")
    parser.add_argument("--bakes", type=int, default=24, help="bakes of each kind (default 24)")
    options = parser.parse_args()
    settings = BakeSettings(LOW, HIGH, RESOLUTION, photons=options.photons)
    room = scene([box(LOW, HIGH, inward=True)], (ALBEDO,), (RADIANCE,))
    rng = np.random.default_rng(0)
    points, normals = rng.uniform(LOW, HIGH, (POINTS, 3)), rng.normal(size=(POINTS, 3))
    series = sum(ALBEDO**k for k in range(1, settings.bounces + 1))
    tests = len(SHARES) * len(ALBEDO)
    failed = 0
    print(f"{'estimator':13} albedo  {'E, W/m²':>17}   closed form     z")
    for estimator, share in SHARES.items():
        baked = (bake(room, replace(settings, estimator=estimator, seed=seed)).grid for seed in range(options.bakes))
        found = np.stack([grid.irradiance(points, normals).mean(axis=0, dtype=np.float64) for grid in baked])
        expected = share * np.pi * RADIANCE * series
        means, errors = found.mean(axis=0), found.std(axis=0, ddof=1) / math.sqrt(options.bakes)
        for channel, albedo in enumerate(ALBEDO):
            z = largest_z(found[:, channel], expected[channel])
            wrong = tests * math.erfc(z / math.sqrt(2.0)) < FALSE_ALARM
            failed += wrong
            z = math.copysign(z, means[channel] - expected[channel])
            print(
                f"{estimator:13} {albedo:6.1f}  {means[channel]:8.5f} ± {errors[channel]:.5f}"
                f"  {expected[channel]:11.5f}  {z:5.1f}{'  WRONG' if wrong else ''}"
            )
    print(f"\n{failed} differ from the closed form")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
