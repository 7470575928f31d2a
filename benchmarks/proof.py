# SPDX-License-Identifier: GPL-3.0-or-later
"""Is a Blender scene lit by the bake as by Cycles? Direct and indirect light, cell by cell (`cell_tests`).

The scene goes the way of every bake: through `export_render_steps`. Direct light is what a bake with it has more than
one without of the same seed, whose photons are the same. Cycles is asked by `ground_truth`, at points of its own for
either kind of light, with caustics and without its simplifications (`cycles_stage.truthful`).
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Literal, get_args

import bpy
import numpy as np

from ivg_addon.blender.export import export_render_steps
from ivg_addon.blender.ground_truth import irradiance_steps
from ivg_addon.core.bake import bake
from ivg_addon.core.errors import SceneError
from ivg_addon.core.progress import finish
from ivg_addon.core.report import Notice
from ivg_addon.core.scene import Scene
from ivg_addon.core.settings import BakeSettings

from .cell_tests import AXES, Cells, Float64, Verdict, compare_cells

Light = Literal["DIRECT", "INDIRECT"]
LIGHTS: tuple[Light, ...] = get_args(Light)

CELLS = Cells((-1.0, -1.0, 0.0), (1.0, 1.0, 1.5), (8, 8, 6))
"""Every scene leaves this box empty: no light, for there the variance of a cell's mean is infinite, and no surface,
for a cell that one cuts is compared over its lit part."""
BOUNCES = 12
_CYCLES_BATCHES = 2


@dataclass(frozen=True)
class Effort:
    """How much work the two sides do.

    Parameters
    ----------
    bakes, photons
        Bakes, and photons of each.
    points
        Random points per cell and axis.
    samples
        Cycles' paths for each point; rounded up to a multiple of 8.
    """

    bakes: int
    photons: int
    points: int
    samples: int = 8


@dataclass(frozen=True)
class Baked:
    """What bakes of a scene found.

    Parameters
    ----------
    light : {light: (bakes, cells, 6, 3) float64}
        W/m².
    notices
        What the export and the bakes said.
    """

    light: dict[Light, Float64]
    notices: tuple[Notice, ...]


def bake_scene(effort: Effort, seed: int, lights: Sequence[Light] = LIGHTS) -> Baked:
    """Export the current scene and bake it with several seeds; a scene without light gives zeros."""
    scene = finish(export_render_steps(bpy.context.scene, bpy.context.view_layer))
    _require_empty_cells(scene)
    seeds = range(1000 * seed, 1000 * seed + effort.bakes)
    with ThreadPoolExecutor() as pool:
        try:
            baked = list(pool.map(lambda one: _bake(scene, lights, effort.photons, one), seeds))
        except SceneError as error:
            dark = np.zeros((effort.bakes, CELLS.count, AXES, 3))
            return Baked(dict.fromkeys(lights, dark), (*scene.notices, Notice("warning", "scene", str(error))))
    return Baked({light: np.stack([one[light] for one in baked]) for light in lights}, scene.notices)


def _require_empty_cells(scene: Scene) -> None:
    """Raise `ValueError` if the box around a triangle touches a cell."""
    low, high = CELLS.box()
    corners = scene.geometry.vertices[scene.geometry.triangles]
    inside = (corners.max(axis=1) > low).all(axis=1) & (corners.min(axis=1) < high).all(axis=1)
    if inside.any():
        name = scene.objects[scene.geometry.object[inside][0]]
        raise ValueError(f"object '{name}' may cut cells: keep it out of {low} … {high}")


def _bake(scene: Scene, lights: Sequence[Light], photons: int, seed: int) -> dict[Light, Float64]:
    """Return one bake's light in each cell, (cells, 6, 3)."""
    settings = BakeSettings(
        bounds_min=CELLS.bounds_min,
        bounds_max=CELLS.bounds_max,
        resolution=CELLS.resolution,
        photons=photons,
        bounces=BOUNCES if "INDIRECT" in lights else 1,
        seed=seed,
        threads=1,
        lit_points=0,
    )
    found = {"INDIRECT": CELLS.towards_axes(bake(scene, settings).grid.vectors)}
    if "DIRECT" in lights:
        everything = bake(scene, replace(settings, include_direct=True)).grid.vectors
        found["DIRECT"] = CELLS.towards_axes(everything) - found["INDIRECT"]
    return {light: found[light] for light in lights}


def ask_cycles(effort: Effort, seed: int, light: Light) -> Float64:
    """Return Cycles' irradiance at random points of each cell of the current scene, (points, cells, 6, 3)."""
    points, normals = CELLS.random_points(effort.points, seed)
    scene = bpy.context.scene
    # One sequence spread over all points: their sum scatters less than independent points' (0.6 to 0.8 of the
    # variance was measured), so that errors are on the safe side. The tabulated pattern has 256 values for the first
    # sample of any point: its sums scatter more (1.2 to 1.9).
    scene.cycles.sampling_pattern = "BLUE_NOISE"
    measured = finish(
        irradiance_steps(
            scene,
            points.reshape(-1, 3),
            normals.reshape(-1, 3),
            component=light,
            samples=effort.samples,
            bounces=BOUNCES,
            seed=seed,
            batches=_CYCLES_BATCHES,
        )
    )
    return measured.irradiance.reshape(points.shape)


def prove(effort: Effort, seed: int = 1, lights: Sequence[Light] = LIGHTS) -> tuple[dict[Light, Verdict], Baked]:
    """Compare the current scene's light; return how each kind compares, and what was baked."""
    baked = bake_scene(effort, seed, lights)
    verdicts = {
        light: compare_cells(CELLS, baked.light[light], ask_cycles(effort, 2 * seed + index, light))
        for index, light in enumerate(lights)
    }
    return verdicts, baked
