# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure the photon phase against Embree alone: `python -m benchmarks.photon_phase [--photons N] [--rounds N]`.

The Cornell box with a grid of 20 × 22 × 20 voxels. Rounds of one and of two threads take turns, so that whatever else
the machine does weighs on both; medians are printed, of ratios the median of the rounds' ratios. Exits with 1 if less
is reached than is asked for. About two minutes on two cores.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

from ivg_addon.core.bake import prepare_course
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.embree import Hits, Tracer
from ivg_addon.core.photon_walk import BATCH, Course, Walk, walk_steps
from ivg_addon.core.progress import finish
from ivg_addon.core.scene import Float32
from ivg_addon.core.settings import BakeSettings

from .accuracy import bounds, open_scene

RESOLUTION = (20, 22, 20)
THREADS = (1, 2)
LEAST_SPEED_UP, MOST_OVER_EMBREE = 1.8, 3.0
WARM_UP_PHOTONS = 4 * BATCH

Flight = tuple[Tracer, Float32, Float32]
"""The rays of a batch between two bounces, and what they were intersected with."""


class RecordingTracer(Tracer):
    """A tracer that keeps the rays it is asked about: a list of flights for every batch."""

    def __init__(self, tracer: Tracer, batches: list[list[Flight]], begins_batch: bool) -> None:
        self._tracer, self._batches, self._begins_batch = tracer, batches, begins_batch

    def intersect(self, origins: Float32, directions: Float32) -> Hits:
        """Keep a copy of the rays and return their hits."""
        if self._begins_batch:
            self._batches.append([])
        self._batches[-1].append((self._tracer, origins.copy(), directions.copy()))
        return self._tracer.intersect(origins, directions)


@dataclass(frozen=True)
class Round:
    """One round's measurements with a number of threads.

    Parameters
    ----------
    walk
        Of all photons.
    processors
        How many the machine gave to it, on average: fewer than threads where something else runs.
    over_replay
        Time of the photon phase over that of Embree alone, both of the recorded batches.
    """

    threads: int
    walk: Walk
    processors: float
    over_replay: float

    @property
    def over_embree(self) -> float:
        """Return the threads' time over what of it they spent inside Embree."""
        return self.walk.seconds * self.threads / self.walk.embree_seconds


def record(course: Course, lattice: Lattice, settings: BakeSettings) -> list[list[Flight]]:
    """Return the flights of all batches."""
    batches: list[list[Flight]] = []
    first = RecordingTracer(course.first, batches, begins_batch=True)
    later = RecordingTracer(course.later, batches, begins_batch=False)
    finish(walk_steps(replace(course, first=first, later=later), lattice, replace(settings, threads=1)))
    return batches


def replay(batches: list[list[Flight]], threads: int) -> float:
    """Return the seconds that Embree alone takes for the recorded flights."""

    def fly(batch: list[Flight]) -> None:
        for tracer, origins, directions in batch:
            tracer.intersect(origins, directions)

    start = time.perf_counter()
    with ThreadPoolExecutor(threads) as pool:
        list(pool.map(fly, batches))
    return time.perf_counter() - start


def column(name: str, values: list[float], form: str) -> float:
    """Print a median with its range and return it."""
    median = statistics.median(values)
    print(f"{name:50} {median:{form}}   ({min(values):{form}} to {max(values):{form}})")
    return median


def main() -> int:
    """Measure and print a table; return the exit status."""
    parser = argparse.ArgumentParser(description="Measure the photon phase against Embree alone.")
    parser.add_argument("--photons", type=int, default=8_000_000, help="photons of a bake (default 8 million)")
    parser.add_argument("--rounds", type=int, default=5, help="rounds (default 5)")
    parser.add_argument("--batches", type=int, default=32, help=f"batches of {BATCH:,} to replay (default 32)")
    options = parser.parse_args()
    scene = open_scene("cornell")
    settings = BakeSettings(*bounds(scene), RESOLUTION, photons=options.photons)
    lattice = Lattice(settings.bounds_min, settings.bounds_max, RESOLUTION)
    course = prepare_course(scene, lattice, options.photons)
    finish(walk_steps(course, lattice, replace(settings, photons=WARM_UP_PHOTONS)))
    part = replace(settings, photons=options.batches * BATCH)
    batches = record(course, lattice, part)
    rounds: dict[int, list[Round]] = {threads: [] for threads in THREADS}
    for _ in range(options.rounds):
        for threads in THREADS:
            used = time.process_time()
            walk = finish(walk_steps(course, lattice, replace(settings, threads=threads)))
            processors = (time.process_time() - used) / walk.seconds
            whole = finish(walk_steps(course, lattice, replace(part, threads=threads))).seconds
            rounds[threads].append(Round(threads, walk, processors, whole / replay(batches, threads)))

    print(f"{options.photons:,} photons, {options.rounds} rounds; median (range)")
    missed = 0
    for threads in THREADS:
        measured = rounds[threads]
        flights = measured[0].walk.rays / options.photons
        print(f"\n{threads} thread{'s' if threads > 1 else ''}, {flights:.2f} flights per photon")
        column("  photon phase, s", [r.walk.seconds for r in measured], "6.2f")
        column("  million photons/s", [options.photons / r.walk.seconds / 1e6 for r in measured], "6.2f")
        column("  processors that the machine gave", [r.processors for r in measured], "6.2f")
        column("  over the time inside Embree", [r.over_embree for r in measured], "6.2f")
        ratio = column(
            f"  over Embree alone, replayed; at most {MOST_OVER_EMBREE}", [r.over_replay for r in measured], "6.2f"
        )
        missed += ratio > MOST_OVER_EMBREE
    pairs = zip(*(rounds[threads] for threads in THREADS), strict=True)
    print()
    speed_up = column(
        f"two threads are faster by; at least {LEAST_SPEED_UP}",
        [one.walk.seconds / two.walk.seconds for one, two in pairs],
        "6.2f",
    )
    missed += speed_up < LEAST_SPEED_UP
    print(f"\n{missed} not reached")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
