"""Prove every light against Cycles: `python -m benchmarks.lights [--quick] [--seed N] [NAME …]`.

Prints one line per light and exits with 1 if one fails. About ten minutes on two cores.
"""

from __future__ import annotations

import argparse
import sys
import time

from .light_cases import CASES
from .light_proof import FALSE_ALARM, FULL, QUICK, prove


def main() -> int:
    """Run the comparison; return the exit status."""
    parser = argparse.ArgumentParser(description="Compare the direct light of every kind of light with Cycles.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="only lights whose name contains one of these")
    parser.add_argument("--quick", action="store_true", help="few photons and points")
    parser.add_argument("--seed", type=int, default=1, help="other photons and points (default 1)")
    arguments = parser.parse_args()
    effort = QUICK if arguments.quick else FULL
    print(f"{effort.batches} × {effort.photons:,} photons; {effort.points} points per cell and axis; a light that")
    print(f"is right fails with a probability of {FALSE_ALARM:g}\n")
    print(f"{'light':36} cells  tests  bake / Cycles       largest |z|        p  verdict")
    failed = 0
    start = time.perf_counter()
    for case in CASES:
        if arguments.names and not any(name in case.name for name in arguments.names):
            continue
        v = prove(case, effort, arguments.seed)
        failed += not v.passed
        print(
            f"{v.name:36} {v.cells:5} {v.tests:6}  {v.ratio:.4f} ± {v.ratio_error:.4f}  {v.largest_z:14.2f}"
            f" {v.p:8.2g}  {'pass' if v.passed else 'FAIL'}",
            flush=True,
        )
    print(f"\n{failed} failed, {time.perf_counter() - start:.0f} s")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
