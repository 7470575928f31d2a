# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how fast a bake is cancelled: `python -m benchmarks.cancel [FILE.blend] [--times N]`.

A bake runs as in a window: ticks on the main thread, the work on another one. Esc comes at a random moment of each
phase. Until Blender is idle again is what the user feels; until the thread has ended, its processors are busy. The
first bake compiles into an empty folder, as it would after installing.
"""

from __future__ import annotations

import argparse
import os
import random
import statistics
import sys
import tempfile
import threading
import time
from pathlib import Path

import bpy

from ivg_addon.blender import jobs
from ivg_addon.blender.bake_job import bake_job
from ivg_addon.blender.blend_file import open_blend
from ivg_addon.blender.properties import ensure_registered

CORNELL = Path(__file__).resolve().parents[1] / "sample_blend" / "cornell.blend"
PHASES = ("Compiling", "Tracing", "Measuring", "Fitting")
"""How the tasks of a bake begin that take long."""
TICK_SECONDS, SLICE_SECONDS = 0.05, 0.02
MOST_SECONDS_INTO_PHASE = 1.0


def advance_into(job: jobs.Job, phase: str, seconds: float) -> bool:
    """Tick until a job has been in a phase for some seconds; False if it was over before."""
    since = None
    while job.running:
        job.advance(SLICE_SECONDS)
        time.sleep(TICK_SECONDS)
        if job.progress.task.startswith(phase):
            since = since or time.perf_counter()
            if time.perf_counter() - since >= seconds:
                return True
    return False


def measure(grid: Path, phase: str) -> tuple[float, float] | None:
    """Return the seconds from Esc to idle and to the thread's end; None if the bake was over before."""
    job = bake_job(bpy.context, {"filepath": str(grid)}, jobs.in_background)
    if not advance_into(job, phase, random.uniform(0.0, MOST_SECONDS_INTO_PHASE)):
        return None
    start = time.perf_counter()
    job.advance(SLICE_SECONDS)  # Esc waits for the tick that is under way
    job.cancel()
    idle = time.perf_counter() - start
    while any(thread.name.startswith("ivg-") for thread in threading.enumerate()):
        time.sleep(0.002)
    return idle, time.perf_counter() - start


def main() -> int:
    """Measure and print a table; return the exit status."""
    parser = argparse.ArgumentParser(description="Measure how fast a bake is cancelled.")
    parser.add_argument("blend", nargs="?", type=Path, default=CORNELL)
    parser.add_argument("--times", type=int, default=10, help="measurements per phase (default 10)")
    options = parser.parse_args()
    ensure_registered()
    open_blend(options.blend)
    print(f"{'':12} {'':5}   Esc to idle, s     to the thread's end, s")
    print(f"{'phase':12} {'times':>5}   median  largest    median  largest")
    with tempfile.TemporaryDirectory() as folder:
        os.environ["NUMBA_CACHE_DIR"] = folder
        for phase in PHASES:
            times = 1 if phase == "Compiling" else options.times
            found = [measure(Path(folder, "grid.ivg.npz"), phase) for _ in range(times)]
            known = [times for times in found if times is not None]
            columns = [f"{statistics.median(column):7.3f}  {max(column):7.3f}" for column in zip(*known, strict=True)]
            print(f"{phase:12} {len(known):5}  {'   '.join(columns)}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
