# SPDX-License-Identifier: GPL-3.0-or-later
"""EEVEE's own volume light probe against a grid: `python -m benchmarks.eevee_probe [--pictures FOLDER]`.

The room of `sample_blend/cornell.blend`, 8³ voxels or 8 × 8 × 8 capture points, both shown by EEVEE, ray tracing off.
Indirect light is the picture with either minus the picture with neither. Prints, for both, the share of Cycles'
indirect light that arrives, the relative RMSE over the picture (but for the lamp and its edge, and without Cycles' own
noise), and how long the bake took. Exits with 1 if no bake of the grid is ahead of every probe on all three.

A probe fades into the world's light where its box ends, so the box must end outside of the walls. How far was tried
out for it, as were its biases, dilation, clamping and thresholds of validity: what is not in the table made no
difference, or was worse in the share of light and in the RMSE.
Mesa computes EEVEE on processors where there is no GPU; the grid's bake uses the same ones, and no GPU. Each bakes once
before, to compile. Ten minutes on two cores.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from ivg_addon.blender import scene_light
from ivg_addon.blender.grid_image import is_grid
from ivg_addon.blender.marks import KEY as GRID_KEY
from ivg_addon.blender.properties import ensure_registered

from .eevee_child import by_eevee
from .grid_shots import Picture, baked, open_scene, reference, save, shoot

RESOLUTION = 8
PHOTONS = (1_000_000, 8_000_000)
"""Of the bakes of the grid; the latter is the default of bakes."""


@dataclass(frozen=True)
class Probe:
    """A light probe that is as Blender adds it, but for what is said.

    Parameters
    ----------
    points
        Capture points along the room; the rest is outside of its walls: the box is RESOLUTION/points as large.
    surfels
        Along a unit of the probe's own space, half its box.
    normal_bias
        By how much of the points' distance light is looked up before surfaces.
    facing_bias
        How much light of points behind a surface may count: 0 for none.
    """

    points: float
    surfels: int = 20
    normal_bias: float = 0.3
    facing_bias: float = 0.5

    @property
    def name(self) -> str:
        """Return what the table calls it."""
        bias = f"biases {self.normal_bias:g} {self.facing_bias:g}"
        return f"probe, {self.points:g} points a room, {self.surfels} surfels, {bias}"


@dataclass(frozen=True)
class Row:
    """What was measured of a grid or a probe: its light over Cycles', relative RMSE, and how long its bake took."""

    energy_ratio: float
    rmse: float
    seconds: float

    @property
    def light_off(self) -> float:
        """Return by how much the light is too much or too little."""
        return abs(self.energy_ratio - 1.0)


PROBES = (Probe(7.6), Probe(6.3), Probe(6.3, 20, 0.6, 0.0), Probe(6.3, 40, 0.6, 0.0))


def main() -> int:
    """Bake both, render and compare; return the exit status."""
    parser = argparse.ArgumentParser(description="Compare EEVEE's volume light probe with a grid.")
    parser.add_argument("--samples", type=int, default=1024, help="of the reference (default 1024)")
    parser.add_argument("--size", type=int, default=256, help="pixels along a picture's edge (default 256)")
    parser.add_argument("--pictures", type=Path, help="folder to leave the pictures in")
    arguments = parser.parse_args()
    ensure_registered()
    open_scene(arguments.size)
    truth = reference(arguments.samples)
    seconds = bake_grids()
    found = by_eevee("benchmarks.eevee_probe")
    if found is None:
        return 1
    seconds |= {probe.name: float(found[f"{probe.name}, seconds"]) for probe in PROBES}
    rows = {
        name: Row(truth.indirect_agreement(found[name]).energy_ratio, truth.rmse(found[name]), bake_seconds)
        for name, bake_seconds in seconds.items()
    }
    if arguments.pictures:
        arguments.pictures.mkdir(parents=True, exist_ok=True)
        for name in rows:
            save(arguments.pictures / f"{name}.png", ("Cycles", name), truth.indirect, found[name])
    return table(rows)


def bake_grids() -> dict[str, float]:
    """Bake grids of the open scene and keep them in it; return how long each took, by name."""
    scene = bpy.context.scene
    baked(PHOTONS[0], (RESOLUTION,) * 3)
    bpy.data.images.remove(scene.ivg.grid)
    seconds = {}
    for photons in PHOTONS:
        scene.ivg.grid = None
        start = time.perf_counter()
        baked(photons, (RESOLUTION,) * 3)
        name = f"grid, {photons // 1_000_000} million photons"
        seconds[name] = time.perf_counter() - start
        scene.ivg.grid.name = name
    return seconds


def in_eevee() -> dict[str, Picture]:
    """Return the indirect light of the open file in EEVEE by each grid and probe, and the seconds of probes' bakes."""
    context = bpy.context
    context.scene.eevee.use_raytracing = False
    low, high = (np.array(context.scene.ivg.grid[GRID_KEY][name]) for name in ("bounds_min", "bounds_max"))
    direct = shoot().picture
    found = {}
    for image in [image for image in bpy.data.images if is_grid(image)]:
        context.scene.ivg.grid = image
        scene_light.add(context)
        found[image.name] = shoot().picture - direct
        scene_light.remove(context)
    bake_probe(Probe(RESOLUTION, 1), low, high)
    for probe in PROBES:
        found[f"{probe.name}, seconds"] = np.array(bake_probe(probe, low, high))
        found[probe.name] = shoot().picture - direct
    return found


def bake_probe(probe: Probe, low: Picture, high: Picture) -> float:
    """Bake a light probe around a box, in place of one that there is; return how long it took."""
    context = bpy.context
    for old in [each for each in context.scene.objects if each.type == "LIGHT_PROBE"]:
        bpy.data.objects.remove(old)
    data = bpy.data.lightprobes.new("Probe", "VOLUME")
    data.resolution_x = data.resolution_y = data.resolution_z = RESOLUTION
    data.surfel_density = probe.surfels
    data.normal_bias, data.facing_bias = probe.normal_bias, probe.facing_bias
    box = bpy.data.objects.new("Probe", data)
    box.location = 0.5 * (low + high)
    box.scale = 0.5 * (high - low) * RESOLUTION / probe.points
    context.scene.collection.objects.link(box)
    context.view_layer.objects.active = box
    context.view_layer.update()
    start = time.perf_counter()
    bpy.ops.object.lightprobe_cache_bake(subset="ACTIVE")
    return time.perf_counter() - start


def table(rows: dict[str, Row]) -> int:
    """Print what was measured and who is ahead; return the exit status."""
    print(f"\n{'':60}  energy    RMSE   bake, s")
    for name, row in rows.items():
        print(f"{name:60}  {row.energy_ratio:6.3f}  {row.rmse:6.4f}  {row.seconds:8.2f}")
    probes = [row for name, row in rows.items() if not name.startswith("grid")]
    ahead_in_all = False
    for name, row in rows.items():
        if not name.startswith("grid"):
            continue
        ahead = {
            "light that arrives": row.light_off < min(probe.light_off for probe in probes),
            "RMSE": row.rmse < min(probe.rmse for probe in probes),
            "bake time": row.seconds < min(probe.seconds for probe in probes),
        }
        told = ", ".join(f"{what}: {'ahead' if first else 'BEHIND'}" for what, first in ahead.items())
        print(f"{name}, against the best probe in each: {told}")
        ahead_in_all = ahead_in_all or all(ahead.values())
    return 0 if ahead_in_all else 1


if __name__ == "__main__":
    sys.exit(main())
