# SPDX-License-Identifier: GPL-3.0-or-later
"""How near any grid of a size could come: `python -m benchmarks.limits [--points N] [--fine N] [--voxels N] [SCENE …]`.

Look-ups are linear in the vertices' vectors. So the vectors that suit them best can be found, given the truth at many
places: by least squares, over points and normals at random in lit free space. The truth is a much finer grid's there;
how near both come is measured with Cycles at other points, as `benchmarks.accuracy` does. What is left of the error
with the best vectors is what trilinear look-ups on so many vertices cannot say; what they gain over the baked ones is
what another bake could gain at most.

Medians are over draws of 1,000 of the points: few points decide the mean square. Six minutes on two cores.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ivg_addon.core.bake import bake
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.metrics import compare
from ivg_addon.core.moments import moments
from ivg_addon.core.progress import finish
from ivg_addon.core.readings import MOMENTS, Readings
from ivg_addon.core.sample_points import LitBox, Places, find_light_steps, free_space_points, surface_points
from ivg_addon.core.settings import BakeSettings, Spatial

from .accuracy import AT_POINTS, bounds, open_scene, truth_at

Float64 = NDArray[np.float64]

_DRAWN, _DRAWS = 1000, 1000
_STEPS = 25
"""Of conjugate gradients; the error at points that were not fitted has settled by then."""
_RIDGE = 0.3
"""Points that the baked vectors count for, each: vertices that hardly a point asks keep theirs."""


def best_moments(grid: IrradianceVectorGrid, places: Places, truth: Float64) -> Float64:
    """Return the moments, (vertices, 12, 3 channels), whose look-ups are nearest to the truth (n, 3).

    Conjugate gradients for the normal equations, from the baked ones.
    """
    readings = readings_of(grid, places)
    baked = baked_moments(grid)
    change = np.zeros_like(baked)
    residual = readings.transposed(truth - readings.irradiance(baked))
    direction, norm = residual.copy(), (residual**2).sum(axis=(0, 1))
    for _ in range(_STEPS):
        image = readings.transposed(readings.irradiance(direction)) + _RIDGE * direction
        step = norm / (direction * image).sum(axis=(0, 1))
        change += step * direction
        residual -= step * image
        before, norm = norm, (residual**2).sum(axis=(0, 1))
        direction = residual + norm / before * direction
    return baked + change


def readings_of(grid: IrradianceVectorGrid, places: Places) -> Readings:
    """Return what look-ups at places read of a grid's moments."""
    return Readings.of(grid, places.points, places.normals, np.eye(MOMENTS))


def baked_moments(grid: IrradianceVectorGrid) -> Float64:
    """Return what a grid's look-ups interpolate, (vertices, 12, 3 channels)."""
    return moments(grid.interpolated(Spatial.TRILINEAR)).reshape(-1, MOMENTS, 3)


def main() -> int:
    """Fit, compare and print a table; return the exit status."""
    parser = argparse.ArgumentParser(description="Tell how near any grid of a size could come to Cycles.")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(AT_POINTS)}; default all")
    parser.add_argument("--points", type=int, default=12_000, help="points of either kind (default 12000)")
    parser.add_argument("--samples", type=int, default=1024, help="Cycles' paths per point (default 1024)")
    parser.add_argument("--fitted", type=int, default=1_000_000, help="points that are fitted (default 1000000)")
    parser.add_argument("--voxels", type=int, default=20, help="of the grid, along each side (default 20)")
    parser.add_argument("--fine", type=int, default=80, help="of the finer grid, along each side (default 80)")
    parser.add_argument("--photons", type=int, default=8_000_000, help="of the grid (default 8 million)")
    parser.add_argument("--fine-photons", type=int, default=64_000_000, help="(default 64 million)")
    parser.add_argument("--seed", type=int, default=0, help="other photons, points and paths (default 0)")
    arguments = parser.parse_args()
    print(f"{'':40} free: RMSE, its median      surfaces", flush=True)
    for name in arguments.scenes or AT_POINTS:
        fit_scene(name, arguments)
    return 0


def fit_scene(name: str, arguments: argparse.Namespace) -> None:
    """Bake both grids of a scene, fit, and print what each comes to."""
    scene = open_scene(name)
    box = bounds(scene)
    light: LitBox = finish(find_light_steps(scene, *box, arguments.seed))
    kinds = [make(light, arguments.points, arguments.seed) for make in (free_space_points, surface_points)]
    truths = [truth_at(places, arguments) for places in kinds]
    settings = BakeSettings(*box, (arguments.voxels,) * 3, photons=arguments.photons, seed=arguments.seed)
    grid = bake(scene, settings).grid
    settings = replace(settings, resolution=(arguments.fine,) * 3, photons=arguments.fine_photons)
    fine = bake(scene, settings).grid
    fitted = free_space_points(light, arguments.fitted, arguments.seed + 1)
    best = best_moments(grid, fitted, fine.irradiance(fitted.points, fitted.normals).astype(np.float64))
    for label, values in (("as baked", baked_moments(grid)), ("the best vectors", best), ("the finer grid", None)):
        words = []
        for places, truth in zip(kinds, truths, strict=True):
            if values is None:
                found = fine.irradiance(places.points, places.normals).astype(np.float64)
            else:
                found = np.maximum(0.0, readings_of(grid, places).irradiance(values))
            whole = compare(found, truth.irradiance, truth.error)
            rng = np.random.default_rng(0)
            draws = [rng.choice(len(found), min(_DRAWN, len(found)), replace=False) for _ in range(_DRAWS)]
            median = np.median([compare(found[i], truth.irradiance[i], truth.error[i]).own_rmse for i in draws])
            words.append(f"{whole.own_rmse:.3f} ± {whole.own_rmse_error:.3f}, {median:.3f}")
        print(f"{f'{name}: {label}':40} {words[0]}        {words[1]}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
