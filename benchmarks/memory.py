# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure how memory grows with the photons: `python -m benchmarks.memory [--scale S]`.

Bakes the Cornell box with 8 and with 80 million photons, each in a process of its own that has only the core loaded,
and compares the most memory that they held. Exits with 1 if it grows by more than is allowed. About a minute on two
cores.
"""

from __future__ import annotations

import argparse
import pickle
import subprocess
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

from ivg_addon.core.bake import bake
from ivg_addon.core.memory import human, peak
from ivg_addon.core.settings import BakeSettings

RESOLUTION = (20, 22, 20)
FEW, MANY = 8_000_000, 80_000_000
MOST_GROWTH = 1.1


def export_scene(file: Path) -> None:
    """Pickle the Cornell box and the settings of its bake; loads Blender."""
    from .accuracy import bounds, open_scene

    scene = open_scene("cornell")
    file.write_bytes(pickle.dumps((scene, BakeSettings(*bounds(scene), RESOLUTION))))


def bake_alone(file: Path, photons: int) -> int:
    """Bake what was pickled; return the most memory held, bytes."""
    scene, settings = pickle.loads(file.read_bytes())
    bake(scene, replace(settings, photons=photons))
    return peak()


def in_child(*arguments: str) -> str:
    """Run this module in a new process; return what it prints.

    Linux hands the peak of a process on to those that it starts: this one must never hold more than a bake does, so
    that Blender, too, runs in a child.
    """
    command = [sys.executable, "-m", "benchmarks.memory", *arguments]
    return subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout


def main() -> int:
    """Measure and print a table; return the exit status."""
    parser = argparse.ArgumentParser(description="Measure how memory grows with the photons.")
    parser.add_argument("--scale", type=float, default=1.0, help="share of the photons to trace (default 1)")
    parser.add_argument("--export", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--bake", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.export:
        export_scene(options.export)
        return 0
    if options.bake:
        print(bake_alone(Path(options.bake[0]), int(options.bake[1])))
        return 0

    peaks = []
    with tempfile.TemporaryDirectory() as folder:
        file = str(Path(folder, "scene"))
        in_child("--export", file)
        for share in (FEW, FEW, MANY):
            photons = max(1, round(options.scale * share))
            peaks.append(int(in_child("--bake", file, str(photons))))
            print(f"{photons:12,} photons  {human(peaks[-1])}", flush=True)
    print(f"{'this process':>20}  {human(peak())}, which must be less")
    if peak() >= min(peaks):
        print("the peaks may be this process's own: nothing was measured")
        return 1
    # The first child may have compiled the kernels, which takes memory of its own.
    growth = peaks[2] / peaks[1]
    missed = growth > MOST_GROWTH
    print(f"grows by a factor of {growth:.3f}, at most {MOST_GROWTH}{'  MISSED' if missed else ''}")
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
