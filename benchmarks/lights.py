# SPDX-License-Identifier: GPL-3.0-or-later
"""Prove every light and world against Cycles: `python -m benchmarks.lights [--quick] [--seed N] [NAME …]`.

Prints one line for each and exits with 1 if one fails. About ten minutes on two cores.
"""

from __future__ import annotations

import argparse
import sys
import time

import bpy

from .cell_tests import Verdict, compare_cells
from .light_cases import CASES, LightCase
from .proof import CELLS, Effort, ask_cycles, bake_scene
from .world_cases import WORLD_CASES

FALSE_ALARM = 1e-4
"""Chance that a light which is right fails, with a new seed."""
QUICK = Effort(bakes=16, photons=1 << 15, points=16)
FULL = Effort(bakes=32, photons=1 << 18, points=64, samples=16)


def prove(case: LightCase, effort: Effort, seed: int = 1, factor: float = 1.0) -> Verdict:
    """Compare one light's direct light.

    Parameters
    ----------
    factor
        Multiplies the bake's light: what is not 1 should fail.
    """
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    case.build()
    baked = bake_scene(effort, seed, ("DIRECT",))
    if baked.notices:
        raise ValueError(f"{case.name}: {baked.notices[0]}")
    return compare_cells(CELLS, factor * baked.light["DIRECT"], ask_cycles(effort, seed, "DIRECT"))


def main() -> int:
    """Run the comparison; return the exit status."""
    parser = argparse.ArgumentParser(description="Compare the direct light of every kind of light with Cycles.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="only lights whose name contains one of these")
    parser.add_argument("--quick", action="store_true", help="few photons and points")
    parser.add_argument("--seed", type=int, default=1, help="other photons and points (default 1)")
    arguments = parser.parse_args()
    effort = QUICK if arguments.quick else FULL
    print(f"{effort.bakes} × {effort.photons:,} photons; {effort.points} points per cell and axis; a light that")
    print(f"is right fails with a probability of {FALSE_ALARM:g}\n")
    print(f"{'light':36} cells  tests  bake / Cycles        largest z        p  verdict")
    failed = 0
    start = time.perf_counter()
    for case in (*CASES, *WORLD_CASES):
        if arguments.names and not any(name in case.name for name in arguments.names):
            continue
        v = prove(case, effort, arguments.seed)
        wrong = v.p < FALSE_ALARM
        failed += wrong
        print(
            f"{case.name:36} {v.cells:5} {v.tests:6}  {v.ratio:.4f} ± {v.ratio_error:.4f}  {v.largest_z:11.2f}"
            f" {v.p:8.2g}  {'FAIL' if wrong else 'pass'}",
            flush=True,
        )
    print(f"\n{failed} failed, {time.perf_counter() - start:.0f} s")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
