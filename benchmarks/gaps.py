# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how long a job keeps the window waiting: `python -m benchmarks.gaps [FILE.blend] [--sky] [--compare]`.

A bake, or a comparison after it, runs as in a window: ticks on the main thread, photons on another one, Cycles in a
second Blender. For every task that a progress names: how often the main thread worked on it, how long at a time, and
how much later than it should a tick then ended, for threads that keep Python to themselves delay it too. That long Esc
waits, and nothing is drawn.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections import defaultdict
from pathlib import Path

import bpy

from ivg_addon.blender import jobs
from ivg_addon.blender.bake_job import bake_job
from ivg_addon.blender.blend_file import open_blend
from ivg_addon.blender.compare_job import CompareRequest, compare_job
from ivg_addon.blender.properties import ensure_registered
from ivg_addon.blender.second_blender import SecondBlender

from .cancel import CORNELL, SLICE_SECONDS, TICK_SECONDS


def measure(job: jobs.Job) -> dict[str, list[tuple[float, float]]]:
    """Run a job to its end; return of each tick the seconds of work and of delay, by the task that it was in."""
    gaps: dict[str, list[tuple[float, float]]] = defaultdict(list)
    while job.running:
        task = job.progress.task
        start = time.perf_counter()
        job.advance(SLICE_SECONDS)
        work = time.perf_counter() - start
        time.sleep(TICK_SECONDS)
        gaps[task].append((work, time.perf_counter() - start - TICK_SECONDS))
    if job.error is not None:
        raise job.error
    return gaps


def main() -> int:
    """Measure and print a table; return the exit status."""
    parser = argparse.ArgumentParser(description="Measure how long a job keeps the window waiting.")
    parser.add_argument("blend", nargs="?", type=Path, default=CORNELL)
    parser.add_argument("--sky", action="store_true", help="put the scene under a Sky Texture")
    parser.add_argument("--compare", action="store_true", help="measure the comparison after the bake")
    parser.add_argument("--photons", type=float, default=2e5, help="photons of the bake (default 2e5)")
    options = parser.parse_args()
    ensure_registered()
    open_blend(options.blend)
    if options.sky:
        _put_under_sky(bpy.context.scene)
    with tempfile.TemporaryDirectory() as folder:
        os.environ["NUMBA_CACHE_DIR"] = folder
        os.environ["XDG_CACHE_HOME"] = folder  # evaluated materials
        grid = Path(folder, "grid.ivg.npz")
        second = SecondBlender()
        baking = {"filepath": str(grid), "photons": int(options.photons)}
        gaps = measure(bake_job(bpy.context, baking, jobs.in_background, second.ask))
        if options.compare:
            request = CompareRequest(grid, Path(folder, "compare.png"), samples=16)
            gaps = measure(compare_job(bpy.context, request, jobs.in_background, second.ask))
        second.end()
    print(f"{'task':60} {'ticks':>7}  {'most work, s':>12}  {'most delay, s':>13}")
    for task, seconds in gaps.items():
        work, delay = (max(column) for column in zip(*seconds, strict=True))
        print(f"{task:60} {len(seconds):7,}  {work:12.3f}  {delay:13.3f}")
    return 0


def _put_under_sky(scene: bpy.types.Scene) -> None:
    scene.world = bpy.data.worlds.new("Sky")
    tree = scene.world.node_tree
    tree.links.new(tree.nodes.new("ShaderNodeTexSky").outputs[0], tree.nodes["Background"].inputs[0])


if __name__ == "__main__":
    sys.exit(main())
