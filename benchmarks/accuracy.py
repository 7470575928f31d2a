# SPDX-License-Identifier: GPL-3.0-or-later
"""How close grids come to Cycles: `python -m benchmarks.accuracy [--points N] [--pictures FOLDER] [PART …]`.

Prints one line per grid and kind of place, with what is asked for at least, and exits with 1 if something is not
reached. The relative RMSE is without Cycles' own noise (in squares), which stands beside it; ± is the standard error
that comes from the choice of the places. About six minutes on two cores.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import bpy

from ivg_addon.blender.compare import compare_steps
from ivg_addon.blender.export import export_render_steps
from ivg_addon.blender.ground_truth import Measured, irradiance_steps
from ivg_addon.core.bake import bake
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.metrics import Agreement, compare
from ivg_addon.core.picture import LookUp
from ivg_addon.core.progress import finish
from ivg_addon.core.sample_points import (
    Places,
    clear_of_surfaces,
    find_light_steps,
    free_space_points,
    surface_points,
)
from ivg_addon.core.scene import Scene
from ivg_addon.core.settings import BakeSettings, Directional, Estimator

SCENES = Path(__file__).resolve().parent.parent / "sample_blend"
ENERGY = 0.02
"""How far the energy ratio may be from one."""


@dataclass(frozen=True)
class Method:
    """A way to bake and to look up.

    Parameters
    ----------
    judged
        Whether it is to reach what is asked for; the others are for comparison.
    """

    name: str
    estimator: Estimator = Estimator.TRACK_LENGTH
    look_up: LookUp = field(default_factory=LookUp)
    judged: bool = False


METHODS = (
    Method("default", judged=True),
    Method("report's formulas", Estimator.REPORT, LookUp(directional=Directional.REPORT, normal_bias=0.0)),
    Method("crossings, report's look-up", Estimator.CROSSING, LookUp(directional=Directional.REPORT, normal_bias=0.0)),
    Method("crossings, least squares", Estimator.CROSSING),
)

AT_POINTS = {"cornell": (0.035, 0.045), "cornell_tilted": (0.04, 0.06)}
"""Relative RMSE asked for in free space and on surfaces, by scene."""

PICTURES = (("two_rooms", (30, 92, 20)), ("two_rooms", (12, 20, 8)))
"""Scenes and grids (x, y, z) whose pictures are compared; the report's fig. 5 has y up."""


def main() -> int:
    """Run the comparisons; return the exit status."""
    parser = argparse.ArgumentParser(description="Compare grids of the sample scenes with Cycles.")
    parser.add_argument(
        "parts", nargs="*", metavar="PART", help=f"of {', '.join([*AT_POINTS, 'two_rooms'])}; default all"
    )
    parser.add_argument("--points", type=int, default=2000, help="points of either kind (default 2000)")
    parser.add_argument("--samples", type=int, default=4096, help="Cycles' paths per point (default 4096)")
    parser.add_argument("--picture-samples", type=int, default=256, help="Cycles' paths per pixel (default 256)")
    parser.add_argument("--photons", type=int, default=8_000_000, help="photons of each bake (default 8 million)")
    parser.add_argument("--seed", type=int, default=0, help="other photons, points and paths (default 0)")
    parser.add_argument("--pictures", type=Path, help="folder to leave the pictures in")
    arguments = parser.parse_args()
    start = time.perf_counter()
    print(f"{'':53} RMSE          asked   ratio  noise of Cycles")
    failed = 0
    for name in AT_POINTS:
        if not arguments.parts or name in arguments.parts:
            failed += at_points(name, arguments)
    for name, resolution in PICTURES:
        if not arguments.parts or name in arguments.parts:
            in_picture(name, resolution, arguments)
    print(f"\n{failed} not reached, {time.perf_counter() - start:.0f} s")
    return 1 if failed else 0


def at_points(name: str, arguments: argparse.Namespace) -> int:
    """Compare grids of 20³ voxels at random points of a scene; return how many numbers miss what is asked for."""
    scene = open_scene(name)
    box = bounds(scene)
    light = finish(find_light_steps(scene, *box, arguments.seed))
    kinds = {
        "free": free_space_points(light, arguments.points, arguments.seed),
        "surfaces": surface_points(light, arguments.points, arguments.seed),
    }
    truths = {kind: truth_at(places, arguments) for kind, places in kinds.items()}
    failed = 0
    for method in METHODS:
        settings = BakeSettings(*box, (20, 20, 20), photons=arguments.photons, seed=arguments.seed)
        grid = bake(scene, replace(settings, estimator=method.estimator)).grid
        for (kind, places), asked in zip(kinds.items(), AT_POINTS[name], strict=True):
            found = agreement(grid, places, truths[kind], method.look_up)
            failed += line(f"{name}, {kind}: {method.name}", found, asked if method.judged else None)
            if method.judged and kind == "free":
                apart = clear_of_surfaces(scene, places.points, 0.5 * float(grid.lattice.voxel_size.min()))
                known = Measured(truths[kind].irradiance[apart], truths[kind].error[apart])
                found = agreement(grid, Places(places.points[apart], places.normals[apart]), known, method.look_up)
                line(f"{name}, free, half a voxel off surfaces", found, None)
    return failed


def truth_at(places: Places, arguments: argparse.Namespace) -> Measured:
    """Ask Cycles."""
    return finish(
        irradiance_steps(
            bpy.context.scene,
            places.points,
            places.normals,
            samples=arguments.samples,
            bounces=BakeSettings.bounces,
            seed=arguments.seed,
        )
    )


def agreement(grid: IrradianceVectorGrid, places: Places, truth: Measured, how: LookUp) -> Agreement:
    """Look a grid up and compare."""
    found = grid.irradiance(places.points, places.normals, how.spatial, how.directional, how.normal_bias)
    return compare(found, truth.irradiance, truth.error)


def in_picture(name: str, resolution: tuple[int, int, int], arguments: argparse.Namespace) -> None:
    """Compare a grid in the camera's view."""
    scene = open_scene(name)
    settings = BakeSettings(*bounds(scene), resolution, photons=arguments.photons, seed=arguments.seed)
    grid = bake(scene, settings).grid
    label = "×".join(map(str, resolution))
    with tempfile.TemporaryDirectory() as folder:
        if arguments.pictures:
            arguments.pictures.mkdir(parents=True, exist_ok=True)
        output = (arguments.pictures or Path(folder)) / f"{name}_{label}.png"
        steps = compare_steps(
            bpy.context.scene, bpy.context.view_layer, grid, output, samples=arguments.picture_samples
        )
        line(f"{name}, picture: {label}", finish(steps).agreement, None)


def line(what: str, found: Agreement, asked: float | None) -> int:
    """Print a result; return 1 if it misses what is asked for, else 0."""
    missed = asked is not None and not (found.own_rmse <= asked and abs(found.energy_ratio - 1.0) <= ENERGY)
    rmse = f"{found.own_rmse:.3f} ± {found.own_rmse_error:.3f}"
    wanted = "     –" if asked is None else f"{asked:6.3f}"
    print(
        f"{what:53} {rmse} {wanted}  {found.energy_ratio:6.3f}  {found.noise:.3f}{'  MISSED' if missed else ''}",
        flush=True,
    )
    return int(missed)


def open_scene(name: str) -> Scene:
    """Open a sample scene and export it."""
    bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{name}.blend"))
    return finish(export_render_steps(bpy.context.scene, bpy.context.view_layer))


def bounds(scene: Scene) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the box around a scene."""
    low, high = scene.geometry.bounds()
    return tuple(map(float, low)), tuple(map(float, high))


if __name__ == "__main__":
    sys.exit(main())
