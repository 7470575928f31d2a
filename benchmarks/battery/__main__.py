# SPDX-License-Identifier: GPL-3.0-or-later
"""Hold the bake against Cycles: `python -m benchmarks.battery [CASE …] [--quick] [--list] [--seed N]`.

Prints one line per small scene, and what the bake said of what is tested where it failed. "named" is a failure that the
bake's notices foretell; exits with 1 if a case fails without a word. About ten minutes on two quiet cores, `--quick`
four.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter

from ..cell_tests import Verdict
from ..proof import LIGHTS
from .outcome import CASES, DEFAULT, FALSE_ALARM, QUICK, Outcome, passed, run


def main() -> int:
    """Run the comparison; return the exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.battery", description="Compare small scenes, one feature each, with Cycles."
    )
    parser.add_argument("cases", nargs="*", metavar="CASE", help="only cases whose name contains one of these")
    parser.add_argument("--quick", action="store_true", help="fewer photons and points")
    parser.add_argument("--list", action="store_true", help="print the names of the cases and stop")
    parser.add_argument("--seed", type=int, default=1, help="other photons and points (default 1)")
    arguments = parser.parse_args()
    chosen = [case for case in CASES if not arguments.cases or any(part in case.name for part in arguments.cases)]
    if arguments.list:
        print("\n".join(case.name for case in chosen))
        return 0
    effort = QUICK if arguments.quick else DEFAULT
    print(
        f"{effort.bakes} × {effort.photons:,} photons; {effort.points} points per cell and axis, {effort.samples} paths"
    )
    print(
        "each; bake / Cycles, its standard error, the largest deviation (z); * where a factor of 1.03 goes unnoticed\n"
    )
    print(f"{'':45} {'direct':>15} {'z':>7}  {'indirect':>15} {'z':>7}   verdict")
    start = time.perf_counter()
    outcomes = []
    for case in chosen:
        outcomes.append(run(case, effort, arguments.seed))
        show(outcomes[-1])
    count = Counter(outcome.status for outcome in outcomes)
    found = sum(all(outcome.found.values()) for outcome in outcomes if outcome.status == "pass")
    print(
        f"\n{count['pass']} pass, {count['named']} named, {count['FAIL']} fail at a family-wise false-alarm rate of "
        f"{FALSE_ALARM:g}; in {found} of the {count['pass']} a factor of 1.03 would be seen; "
        f"{time.perf_counter() - start:.0f} s"
    )
    return 1 if count["FAIL"] else 0


def show(outcome: Outcome) -> None:
    """Print a case's line."""
    if outcome.error:
        print(f"{outcome.name:45} {outcome.error}   FAIL", flush=True)
        return
    columns = "  ".join(_column(outcome.verdicts[light], outcome.found[light]) for light in LIGHTS)
    print(f"{outcome.name:45} {columns}   {outcome.status}", flush=True)
    if outcome.status != "pass":
        for notice in outcome.notices:
            print(f"    {notice}")


def _column(verdict: Verdict, found: bool) -> str:
    if not verdict.tests:
        return f"{'no light':>15} {'':7}"
    z = f"{verdict.largest_z:.1f}{'' if passed(verdict) else '!'}"
    return f"{verdict.ratio:7.4f} ±{verdict.ratio_error:6.4f}{' ' if found else '*'}{z:>7}"


if __name__ == "__main__":
    sys.exit(main())
