# SPDX-License-Identifier: GPL-3.0-or-later
"""What Cycles takes for the same error as a render with the grid's light, with and without its denoiser."""

from __future__ import annotations

import math
from collections.abc import Sequence

import bpy
import numpy as np

from ivg_addon.blender import scene_light
from ivg_addon.blender.cycles_render import render_steps
from ivg_addon.core.progress import finish

from .grid_shots import BOUNCES, Picture, Shot, Truth, cycles, fastest

_GRID_SAMPLES = (1, 4, 16)
_FULL_SAMPLES = (16, 64)
_DENOISED_SAMPLES = (1, 4, 16, 64)

LitShots = dict[int, tuple[Shot, Picture]]
"""Renders with the grid's light, and the indirect light in them, by samples."""
Row = tuple[int, Shot, float]
"""Samples, a render, and the error that it is compared by."""


def lit_shots() -> LitShots:
    """Render with the grid's light; return, by samples, what that is, and the indirect light in it.

    Of the same seed, direct light has the same noise with the grid's light and without: the difference has none.
    """
    without = {samples: cycles(samples, direct=True).picture for samples in _GRID_SAMPLES}
    scene_light.add(bpy.context)
    found = {samples: fastest(samples, direct=True) for samples in _GRID_SAMPLES}
    return {samples: (shot, shot.picture - without[samples]) for samples, shot in found.items()}


def times(truth: Truth, with_grid: LitShots) -> None:
    """Print what Cycles takes for the same error, of the indirect light and of whole pictures that are denoised."""
    scene_light.add(bpy.context)
    smooth = [_denoised(truth, n, direct=True) for n in _GRID_SAMPLES]
    scene_light.remove(bpy.context)
    grid = [(n, shot, truth.rmse(indirect)) for n, (shot, indirect) in with_grid.items()]
    full = [(n, fastest(n), _indirect_error(truth, n)) for n in _FULL_SAMPLES]
    clean = [_denoised(truth, n) for n in _DENOISED_SAMPLES]
    scale = truth.indirect[truth.surfaces].mean() / (truth.indirect + truth.direct)[truth.surfaces].mean()
    print(f"\nRMSE relative to the mean indirect light, which is {scale:.3f} of all light")
    print("                            samples  seconds   RMSE: indirect light, whole picture")
    for name, rows in (("with the grid", grid), ("Cycles", full)):
        for n, shot, error in rows:
            whole = truth.whole_rmse(shot.picture)
            print(f"{name:28} {n:6}   {shot.seconds:6.2f}    {error:.4f}   {whole:.4f}", flush=True)
    for name, rows in (("with the grid, denoised", smooth), ("Cycles, denoised", clean)):
        for n, shot, error in rows:
            print(f"{name:28} {n:6}   {shot.seconds:6.2f}         –   {error:.4f}", flush=True)
    for n, shot, error in grid:
        longer = _seconds_for(error, full) / shot.seconds, _seconds_for(error, clean) / shot.seconds
        told = f"Cycles {longer[0]:.0f} times as long, denoised {longer[1]:.1f} times"
        print(f"for the indirect error of the grid at {n} samples: {told}   (asked: 10, 2)", flush=True)
    for n, shot, error in smooth:
        told = f"Cycles, denoised, {_seconds_for(error, clean) / shot.seconds:.1f} times as long"
        print(f"for the whole picture's error with the grid, denoised, at {n} samples: {told}", flush=True)


def _denoised(truth: Truth, samples: int, *, direct: bool = False) -> Row:
    """Render the open scene as it is, and denoise."""
    shot = fastest(samples, denoise=True, direct=direct)
    return samples, shot, truth.whole_rmse(shot.picture)


def _indirect_error(truth: Truth, samples: int) -> float:
    """Return the error of Cycles' own indirect light, as its pass has it."""
    seen = finish(render_steps(bpy.context.scene, bpy.context.view_layer, samples=samples, bounces=BOUNCES, seed=7))
    return truth.rmse(seen.light.astype(np.float64))


def _seconds_for(error: float, rows: Sequence[Row]) -> float:
    """Return the time after which an error is reached: both go by powers of the samples between two measurements.

    Beyond the last measurement time grows with the samples, and the error falls as it did before.
    """
    table = np.array([(count, shot.seconds, error) for count, shot, error in rows])
    n, seconds, errors = table.T
    falling = np.minimum.accumulate(errors)
    if error >= falling[0]:
        return float(seconds[0])
    if error < falling[-1]:
        slope = math.log(errors[-1] / errors[-2]) / math.log(n[-1] / n[-2])
        if slope >= 0.0:
            return math.inf
        wanted = n[-1] * (error / errors[-1]) ** (1.0 / slope)
        per_sample = (seconds[-1] - seconds[-2]) / (n[-1] - n[-2])
        return float(seconds[-1] + per_sample * (wanted - n[-1]))
    wanted = math.exp(float(np.interp(-math.log(error), -np.log(falling), np.log(n))))
    return float(np.interp(wanted, n, seconds))
