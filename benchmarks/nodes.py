# SPDX-License-Identifier: GPL-3.0-or-later
"""How far the node group is off from the Python look-up: `python -m benchmarks.nodes [--photons N] [SCENE …]`.

Bakes sample scenes, lets the group shine on small squares in Cycles and in EEVEE, at random points and normals in free
space, at points of surfaces with theirs, and there with the normals of bumps, and compares with what Python finds at
the same places. Differences are relative to the mean irradiance of the places, since many are nearly black. Left out
are places where the look-up bends so much within a square (a tenth of a pixel) that the picture cannot show it. Exits
with 1 if a difference is larger than is allowed.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

from ivg_addon.blender import grid_image
from ivg_addon.core.bake import bake
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.progress import finish
from ivg_addon.core.sample_points import Places, find_light_steps, free_space_points, surface_points
from ivg_addon.core.settings import BakeSettings, Spatial

from . import node_stage
from .accuracy import bounds, open_scene

SCENES = {"cornell": (20, 20, 20), "cornell_tilted": (20, 20, 20)}
"""Voxels of each grid."""
MOST = 0.01
"""Largest relative difference allowed."""
STRAIGHT = 1e-4
"""By how much a square's middle may be off from its corners' mean, relative."""
BUMP = 0.5
"""Length of what is added to a normal, in random directions."""


def bumped(normals: node_stage.Float64) -> node_stage.Float64:
    """Return normals of bumps on surfaces."""
    found = normals + BUMP * np.random.default_rng(0).normal(size=normals.shape) / np.sqrt(3.0)
    return np.asarray(found / np.linalg.norm(found, axis=1, keepdims=True))


def measure(kind: str, grid: IrradianceVectorGrid, spatial: Spatial, places: Places, bumps: bool, folder: Path) -> int:
    """Print a line for each engine; return how many miss what is allowed."""
    missed = 0
    found: dict[str, list[node_stage.Float64]] = {engine: [] for engine in node_stage.ENGINES}
    count = 0
    for view in node_stage.VIEWS:
        normals = bumped(places.normals) if bumps else places.normals
        what = node_stage.squares(view, places.points, places.normals, normals)
        expected = node_stage.wanted(grid, spatial, what)
        bpy.ops.wm.read_homefile(use_empty=True)
        image = grid_image.put(grid_image.prepare(grid, spatial), "Grid")
        node_stage.build(image, what, expected, bumps)
        straight = expected.bent() < STRAIGHT
        count += len(straight)
        for engine in node_stage.ENGINES:
            picture = node_stage.render(engine, folder)
            if picture is not None:
                found[engine].append(node_stage.differences(what, picture)[straight])
    for engine, parts in found.items():
        if not parts:
            print(f"  {kind:24}{engine:15}no OpenGL here")
            continue
        off = np.concatenate(parts)
        over = off.max() > MOST
        missed += int(over)
        print(
            f"  {kind:24}{engine:15}{len(off):6,} of {count:6,} points: mean {off.mean():.1e}, "
            f"99.9 % {np.quantile(off, 0.999):.1e}, largest {off.max():.1e}{'  MISSED' if over else ''}",
            flush=True,
        )
    return missed


def main() -> int:
    """Measure and print a table; return the exit status."""
    parser = argparse.ArgumentParser(description="Compare the node group with the Python look-up.")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(SCENES)}; default all")
    parser.add_argument("--photons", type=int, default=2_000_000, help="of each bake (default 2 million)")
    parser.add_argument("--points", type=int, default=6000, help="of either kind (default 6,000)")
    options = parser.parse_args()
    missed = 0
    for name in options.scenes or SCENES:
        scene = open_scene(name)
        box = bounds(scene)
        grid = bake(scene, BakeSettings(*box, SCENES[name], photons=options.photons)).grid
        light = finish(find_light_steps(scene, *box, 0))
        divided = int(grid.partitions.divided.sum())
        print(f"{name}, {grid.validity.size:,} vertices, {divided:,} of them divided", flush=True)
        free = free_space_points(light, options.points, 0)
        surfaces = surface_points(light, options.points, 0)
        with tempfile.TemporaryDirectory() as folder:
            for spatial in Spatial:
                print(f" {spatial.lower()}", flush=True)
                for kind, places, bumps in (
                    ("free", free, False),
                    ("surfaces", surfaces, False),
                    ("surfaces with bumps", surfaces, True),
                ):
                    missed += measure(kind, grid, spatial, places, bumps, Path(folder))
    print(f"\n{missed} above {MOST:g}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
