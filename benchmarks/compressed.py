# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure what half floats cost: `python -m benchmarks.compressed [--photons N] [--points N] [SCENE …]`.

Bakes the sample scenes, compresses each grid in both forms of 72 bytes a vertex, and compares look-ups with those of
the full grid: relative RMSE, and the largest difference over the mean, at random points and normals in free space and
at points of surfaces with theirs. Exits with 1 if the default form adds more than is allowed. About two minutes on two
cores.
"""

from __future__ import annotations

import argparse
import sys

import numpy as np
from numpy.typing import NDArray

from ivg_addon.core.bake import bake
from ivg_addon.core.compressed import Form, compress
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.memory import human
from ivg_addon.core.progress import finish
from ivg_addon.core.sample_points import Places, find_light_steps, free_space_points, surface_points
from ivg_addon.core.settings import BakeSettings

from .accuracy import bounds, open_scene

SCENES = {"cornell": (20, 20, 20), "cornell_tilted": (20, 20, 20), "gallery": (14, 40, 8), "two_rooms": (30, 92, 20)}
"""Voxels of each grid."""
MOST = 0.01
"""Relative RMSE that the default form may add."""


def added(full: NDArray[np.float32], small: NDArray[np.float32]) -> tuple[float, float]:
    """Return the relative RMSE and the largest difference over the mean of irradiance (n, 3)."""
    difference = small.astype(np.float64) - full
    mean = float(full.mean(dtype=np.float64))
    return float(np.sqrt(np.mean(difference**2))) / mean, float(np.abs(difference).max()) / mean


def measure(name: str, grid: IrradianceVectorGrid, kinds: dict[str, Places]) -> int:
    """Print the lines of a scene; return how many miss what is allowed."""
    missed = 0
    vertices = grid.validity.size
    size = grid.vectors.nbytes
    print(f"{name}, {vertices:,} vertices: {human(size)}, {size / vertices:.0f} bytes a vertex", flush=True)
    for form in Form:
        small = compress(grid, form)
        back = small.expand()
        size = small.texels.nbytes
        print(
            f"  {form.lower():8}{human(size):>9}, {size / vertices:.0f} bytes a vertex, "
            f"and {small.validity.nbytes / vertices:.0f} for the lit share"
        )
        for kind, places in kinds.items():
            rmse, largest = added(
                grid.irradiance(places.points, places.normals), back.irradiance(places.points, places.normals)
            )
            over = form is Form.MOMENTS and rmse > MOST
            missed += over
            print(f"    {kind:9} relative RMSE {rmse:.2e}, largest {largest:.2e}{'  MISSED' if over else ''}")
    return missed


def main() -> int:
    """Measure and print a table; return the exit status."""
    parser = argparse.ArgumentParser(description="Measure what half floats cost.")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(SCENES)}; default all")
    parser.add_argument("--photons", type=int, default=8_000_000, help="of each bake (default 8 million)")
    parser.add_argument("--points", type=int, default=20_000, help="of either kind (default 20,000)")
    options = parser.parse_args()
    missed = 0
    for name in options.scenes or SCENES:
        scene = open_scene(name)
        box = bounds(scene)
        grid = bake(scene, BakeSettings(*box, SCENES[name], photons=options.photons)).grid
        light = finish(find_light_steps(scene, *box, 0))
        kinds = {
            "free": free_space_points(light, options.points, 0),
            "surfaces": surface_points(light, options.points, 0),
        }
        missed += measure(name, grid, kinds)
    print(f"\n{missed} above {MOST:g}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
