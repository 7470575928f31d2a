# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how fast a grid is looked up: `python -m benchmarks.look_up [--points N] [--rounds N]`.

A grid of the Cornell box, 20 × 22 × 20 voxels, at random points with random normals, in calls of a million points.
Exits with 1 if less is reached than is asked for.
"""

from __future__ import annotations

import argparse
import os
import statistics
import sys
import time
from unittest.mock import patch

import numpy as np
from numpy.typing import NDArray

from ivg_addon.core import look_up
from ivg_addon.core.bake import bake
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.settings import BakeSettings, Spatial

from .accuracy import bounds, open_scene

RESOLUTION = (20, 22, 20)
PHOTONS = 1_000_000
LEAST = {Spatial.TRILINEAR: 7.0, Spatial.TRICUBIC: 1.0}
"""Million look-ups a second that all processors together are to reach."""

Places = tuple[NDArray[np.float64], NDArray[np.float64]]


def seconds(grid: IrradianceVectorGrid, places: Places, spatial: Spatial, chunk: int) -> float:
    """Return the time of one call; `chunk` points at a time go to a thread."""
    with patch.object(look_up, "CHUNK", chunk):
        start = time.perf_counter()
        grid.irradiance(*places, spatial)
        return time.perf_counter() - start


def main() -> int:
    """Measure and print a table; return the exit status."""
    parser = argparse.ArgumentParser(description="Measure how fast a grid is looked up.")
    parser.add_argument("--points", type=int, default=1_000_000, help="points of a call (default 1 million)")
    parser.add_argument("--rounds", type=int, default=7, help="calls of each kind (default 7)")
    options = parser.parse_args()
    scene = open_scene("cornell")
    grid = bake(scene, BakeSettings(*bounds(scene), RESOLUTION, photons=PHOTONS)).grid
    rng = np.random.default_rng(0)
    places = (
        rng.uniform(grid.bounds_min, grid.bounds_max, (options.points, 3)),
        rng.normal(size=(options.points, 3)),
    )
    chunks = {1: options.points, os.cpu_count() or 1: look_up.CHUNK}
    print("million look-ups a second; median (range)")
    missed = 0
    for spatial, least in LEAST.items():
        seconds(grid, places, spatial, look_up.CHUNK)  # compiles the kernels and deconvolves the vectors
        rates: dict[int, list[float]] = {threads: [] for threads in chunks}
        for _ in range(options.rounds):
            for threads, chunk in chunks.items():
                rates[threads].append(options.points / seconds(grid, places, spatial, chunk) / 1e6)
        for threads, measured in rates.items():
            median = statistics.median(measured)
            judged = threads == max(chunks)
            missed += judged and median < least
            print(
                f"{spatial.lower():10} {threads} thread{'s' if threads > 1 else ' '} {median:7.2f}"
                f"   ({min(measured):.2f} to {max(measured):.2f}){f'   at least {least:g}' if judged else ''}"
            )
    print(f"\n{missed} not reached")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
