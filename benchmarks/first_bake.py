# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how long the first bake takes to compile: `python -m benchmarks.first_bake [--times N]`.

From the start of a bake until its first photon has flown, in new processes: with an empty folder for compiled code, as
after installing, and then with what that left there. Exits with 1 if it takes longer than is allowed.
"""

from __future__ import annotations

import argparse
import json
import os
import pickle
import subprocess
import sys
import tempfile
import time
from pathlib import Path

MOST_FIRST, MOST_LATER = 20.0, 1.0
RESOLUTION = (20, 22, 20)


def time_alone(job: Path) -> dict[str, float]:
    """Import the core and bake a pickled (scene, settings) until the first photons have flown; return seconds."""
    start = time.perf_counter()
    from ivg_addon.core.bake import bake_steps

    imported = time.perf_counter()
    scene, settings = pickle.loads(job.read_bytes())
    begun = compiling = time.perf_counter()
    steps = bake_steps(scene, settings)
    for progress in steps:
        if progress.task.startswith("Compiling"):
            compiling = time.perf_counter()
        if progress.task.startswith("Tracing"):
            break
    flown = time.perf_counter()
    steps.close()
    return {"import": imported - start, "prepare": compiling - begun, "compile": flown - compiling}


def time_in_child(job: Path, cache: str) -> dict[str, float]:
    """Do the same in a new process that keeps compiled code in `cache`."""
    command = [sys.executable, "-m", "benchmarks.first_bake", "--job", str(job)]
    environment = {**os.environ, "NUMBA_CACHE_DIR": cache}
    found = subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout
    return {name: float(seconds) for name, seconds in json.loads(found).items()}


def main() -> int:
    """Measure and print a table; return the exit status."""
    parser = argparse.ArgumentParser(description="Measure how long the first bake takes to compile.")
    parser.add_argument("--times", type=int, default=2, help="empty folders to begin with (default 2)")
    parser.add_argument("--job", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.job:
        print(json.dumps(time_alone(options.job)))
        return 0

    from ivg_addon.core.settings import BakeSettings

    from .accuracy import bounds, open_scene

    scene = open_scene("cornell")
    missed = 0
    print("seconds         import  prepare  compile, first photon   the last two  at most")
    with tempfile.TemporaryDirectory() as folder:
        job = Path(folder, "job")
        job.write_bytes(pickle.dumps((scene, BakeSettings(*bounds(scene), RESOLUTION, photons=1))))
        for _ in range(options.times):
            with tempfile.TemporaryDirectory() as cache:
                for name, most in (("first bake", MOST_FIRST), ("later", MOST_LATER)):
                    found = time_in_child(job, cache)
                    total = found["prepare"] + found["compile"]
                    missed += total > most
                    print(
                        f"{name:14} {found['import']:7.2f}  {found['prepare']:7.2f}  {found['compile']:21.2f}"
                        f"   {total:12.2f}  {most:7g}{'  MISSED' if total > most else ''}",
                        flush=True,
                    )
    print(f"\n{missed} not reached")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
