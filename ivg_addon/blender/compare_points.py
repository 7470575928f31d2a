# SPDX-License-Identifier: GPL-3.0-or-later
"""A grid against Cycles at random points: in free space, where things move, and on the surfaces themselves."""

from __future__ import annotations

import functools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import bpy

from ..core.metrics import Agreement
from ..core.metrics import compare as agreement_of
from ..core.progress import Progress, part
from ..core.report import Notice, merge
from .asking import Asker, here
from .compare import grid_notices, rmse_words
from .export import export_render_steps
from .ground_truth import Measured, irradiance_steps
from .jobs import PatientSteps, Runner, Steps, in_foreground
from .summary import Row

if TYPE_CHECKING:
    from ..core.grid import IrradianceVectorGrid
    from ..core.picture import LookUp
    from ..core.sample_points import Places
    from ..core.scene import Scene

_EXPORTED, _FOUND = 0.05, 0.15


@dataclass(frozen=True)
class PointComparison:
    """How a grid compares with Cycles at random points.

    Parameters
    ----------
    scene
        The scene's name.
    points
        Points of either kind.
    samples
        Cycles' paths per point.
    free_space, surfaces
        Irradiance E(p, n), three channels: in lit free space with normals from all over the sphere, and on the lit
        sides of surfaces with their own normals.
    notices
        What should be known about the comparison.
    """

    scene: str
    points: int
    samples: int
    free_space: Agreement
    surfaces: Agreement
    notices: tuple[Notice, ...]

    def rows(self) -> list[Row]:
        """Return the numbers in words."""
        return [
            ("Points", f"{self.points:,} in free space and {self.points:,} on surfaces, {self.samples:,} paths each"),
            ("Free", _words(self.free_space)),
            ("Surfaces", _words(self.surfaces)),
        ]


def compare_points_steps(
    scene: bpy.types.Scene,
    view_layer: bpy.types.ViewLayer,
    grid: IrradianceVectorGrid,
    points: int,
    look_up: LookUp | None = None,
    *,
    samples: int = 1024,
    seed: int = 0,
    run: Runner = in_foreground,
    ask: Asker = here,
) -> PatientSteps[PointComparison]:
    """Compare a grid with Cycles at random points within the grid's box; returns a `PointComparison`.

    Parameters
    ----------
    points
        Of either kind.
    look_up
        How the grid is looked up.
    samples
        Cycles' paths per point.
    run
        How the part that never touches Blender is drained.
    ask
        Where Cycles is asked.

    Raises
    ------
    SceneError
        No geometry, no light, no lit place within the box; Cycles is missing or busy.
    SettingsError
        No points, settings of the look-up out of range.
    """
    arrays = yield from part(export_render_steps(scene, view_layer, ask, run), 0.0, _EXPORTED)
    kinds = yield from part(run(_place_steps(arrays, grid, points, seed)), _EXPORTED, _FOUND)
    settings = grid.record.settings
    measure = functools.partial(
        irradiance_steps,
        scene,
        view_layer=view_layer,
        component="ALL" if settings.include_direct else "INDIRECT",
        samples=samples,
        bounces=settings.bounces,
        seed=seed,
        ask=ask,
    )
    middle = 0.5 * (_FOUND + 1.0)
    agreements = []
    for places, low, high in zip(kinds, (_FOUND, middle), (middle, 1.0), strict=True):
        measuring = measure(places.points, places.normals)
        truth = yield from part(measuring, low, high)
        agreements.append(_agreement(grid, places, truth, look_up))
    return PointComparison(
        scene=scene.name,
        points=points,
        samples=samples,
        free_space=agreements[0],
        surfaces=agreements[1],
        notices=merge((*grid_notices(arrays, grid), *arrays.notices)),
    )


def _words(agreement: Agreement) -> str:
    return f"{rmse_words(agreement)}; energy {agreement.energy_ratio:.4f} of Cycles'"


def _place_steps(scene: Scene, grid: IrradianceVectorGrid, points: int, seed: int) -> Steps[tuple[Places, Places]]:
    """Find the points; touches nothing of Blender, so any thread will do."""
    yield Progress("Loading Numba and Embree", 0.0)
    from ..core.sample_points import find_light_steps, free_space_points, surface_points

    light = yield from find_light_steps(scene, grid.lattice.bounds_min, grid.lattice.bounds_max, seed)
    free = free_space_points(light, points, seed)
    yield Progress("Choosing points", 1.0)
    return free, surface_points(light, points, seed)


def _agreement(grid: IrradianceVectorGrid, places: Places, truth: Measured, look_up: LookUp | None) -> Agreement:
    from ..core.picture import LookUp

    how = look_up or LookUp()
    looked_up = grid.irradiance(places.points, places.normals, how.spatial, how.directional, how.normal_bias)
    return agreement_of(looked_up, truth.irradiance, truth.error)
