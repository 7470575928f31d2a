"""Photons from the lights through the scene: batches, threads, and what they leave behind.

A batch of photons flies as a wavefront: emit, then {intersect, tally, scatter} until none is left.
Threads take batches one after the other and keep their own sums; no photon is ever stored, so
memory does not grow with their number.
"""

from __future__ import annotations

import itertools
import os
import queue
import threading
import time
from collections.abc import Generator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .dual_cells import Lattice
from .embree import Tracer
from .emission import Emission, leave_darkness
from .progress import Progress
from .restricted_light import RestrictedLight
from .scattering import ABSORBED, CUT, ENERGY_STEPS, ESCAPED, scatter
from .scene import Int32
from .settings import BakeSettings
from .surface_bins import SurfaceBins
from .surfaces import Surfaces
from .tally import Tally

BATCH = 1 << 16
"""Photons that fly together: enough to make Python's share negligible, few enough to stay in the
cache and to stop within a tenth of a second."""


@dataclass(frozen=True)
class Walk:
    """What the photons left behind.

    Parameters
    ----------
    tally
        Sums of the irradiance vectors.
    bin_counts : (patches, 2) int32
        Photons received by each side of each patch of surface.
    rays
        Flights traced.
    escaped, absorbed, cut : (3,) float64
        Share of the emitted photons' weight that left the scene, that surfaces absorbed, and
        that was still alive after the last bounce; multiply by `Emission.flux_scale` for watts.
    embree_seconds, seconds
        Time inside Embree (sum over threads) and of the whole walk (wall clock).
    """

    tally: Tally
    bin_counts: Int32
    rays: int
    escaped: NDArray[np.float64]
    absorbed: NDArray[np.float64]
    cut: NDArray[np.float64]
    embree_seconds: float
    seconds: float


@dataclass(frozen=True)
class Course:
    """What every batch needs: the scene as kernels and Embree see it.

    Parameters
    ----------
    emission
        Where photons come from.
    first, later
        What blocks a photon before and after its first bounce. Objects that diffuse rays do not
        see cast shadows all the same, so the two can differ.
    surfaces, bins
        What photons scatter at, and where they are counted.
    restricted
        What some lights may not do; None where all may do everything.
    """

    emission: Emission
    first: Tracer
    later: Tracer
    surfaces: Surfaces
    bins: SurfaceBins
    restricted: RestrictedLight | None = None


class _Worker:
    """One thread's sums and its buffers for a batch."""

    def __init__(self, course: Course, lattice: Lattice, settings: BakeSettings) -> None:
        self.course = course
        self.settings = settings
        self.tally = Tally.empty(lattice, settings.estimator, settings.photons, settings.bounces)
        self.bin_counts = course.bins.empty_counts()
        self.energy = np.zeros((3, 3), dtype=np.int64)
        self.rays = 0
        self.embree_seconds = 0.0
        self.photons = np.empty(BATCH, dtype=np.int64)
        self.origins = np.empty((BATCH, 3), dtype=np.float32)
        self.directions = np.empty((BATCH, 3), dtype=np.float32)
        self.weights = np.empty((BATCH, 3), dtype=np.float32)
        self.dark = np.empty(BATCH, dtype=np.float32)

    def fly(self, batch: int, stop: threading.Event) -> int:
        """Trace one batch to its end, or until `stop`; return how many photons it had."""
        first = batch * BATCH
        size = min(BATCH, self.settings.photons - first)
        self.photons[:size] = np.arange(first, first + size)
        self.course.emission.emit(
            self.settings.seed,
            first,
            self.origins[:size],
            self.directions[:size],
            self.weights[:size],
            self.dark[:size],
        )
        alive = size
        for bounce in range(self.settings.bounces + 1):
            if alive == 0 or stop.is_set():
                break
            alive = self._advance(bounce, self._allowed(bounce, alive))
        return size

    def _allowed(self, bounce: int, n: int) -> int:
        """Take out what has bounced as often as its light may; return how many are left."""
        rules = self.course.restricted
        if bounce == 0 or rules is None or not rules.ends:
            return n
        origins, directions, weights = self.origins[:n], self.directions[:n], self.weights[:n]
        return rules.end(bounce, self.settings.seed, self.photons[:n], origins, directions, weights, self.energy)

    def _advance(self, bounce: int, n: int) -> int:
        """Let n photons fly to their next hit and scatter there; return how many survive."""
        tracer = self.course.first if bounce == 0 else self.course.later
        origins, directions, weights = self.origins[:n], self.directions[:n], self.weights[:n]
        start = time.perf_counter()
        hits = tracer.intersect(origins, directions)
        self.embree_seconds += time.perf_counter() - start
        self.rays += n
        factor = None
        rules = self.course.restricted
        if bounce == 0 and rules is not None and rules.chooses:
            factor = rules.follow(
                tracer, self.settings.seed, self.photons[:n], origins, directions, self.dark[:n], hits
            )
        if bounce == 0 and self.course.emission.flies_dark:
            leave_darkness(origins, directions, self.dark[:n], hits.triangle, hits.distance)
        if bounce > 0 or self.settings.include_direct:
            self.tally.deposit(origins, directions, weights, hits.distance)
        if factor is not None:
            weights *= factor[:, None]
        return int(
            scatter(
                self.photons[:n],
                origins,
                directions,
                weights,
                hits.triangle,
                hits.u,
                hits.v,
                self.settings.seed,
                bounce,
                bounce == self.settings.bounces,
                self.course.surfaces,
                self.bin_counts,
                self.energy,
            )
        )


def thread_count(settings: BakeSettings) -> int:
    """Return the number of worker threads: as set, else one per processor."""
    batches = -(-settings.photons // BATCH)
    return min(settings.threads or os.cpu_count() or 1, batches)


def walk_steps(course: Course, lattice: Lattice, settings: BakeSettings) -> Generator[Progress, None, Walk]:
    """Trace all photons; yields after every batch, returns a `Walk`.

    Closing the generator stops the threads within one flight of a batch.
    """
    start = time.perf_counter()
    workers = [_Worker(course, lattice, settings) for _ in range(thread_count(settings))]
    batches = itertools.count()
    batch_count = -(-settings.photons // BATCH)
    done: queue.SimpleQueue[int | None] = queue.SimpleQueue()
    stop = threading.Event()

    def run(worker: _Worker) -> None:
        try:
            # next() on itertools.count is atomic under the GIL.
            while not stop.is_set() and (batch := next(batches)) < batch_count:
                done.put(worker.fly(batch, stop))
        except BaseException:
            # What went wrong is told when all have stopped; nothing is worth waiting for.
            stop.set()
            raise
        finally:
            done.put(None)

    with ThreadPoolExecutor(len(workers), thread_name_prefix="ivg-photons") as pool:
        futures: list[Future[None]] = [pool.submit(run, worker) for worker in workers]
        try:
            yield from _progress(done, len(workers), settings.photons, start)
        finally:
            stop.set()
        for future in futures:
            future.result()
    return _merge(workers, settings.photons, time.perf_counter() - start)


def _progress(
    done: queue.SimpleQueue[int | None], running: int, photons: int, start: float
) -> Generator[Progress, None, None]:
    """Yield after every batch until every worker has said None."""
    traced = 0
    while running:
        size = done.get()
        if size is None:
            running -= 1
            continue
        traced += size
        elapsed = time.perf_counter() - start
        yield Progress(
            task=f"Tracing photons ({traced / 1e6:.1f} of {photons / 1e6:.1f} million)",
            fraction=traced / photons,
            seconds_left=elapsed * (photons - traced) / traced,
        )


def _merge(workers: list[_Worker], photons: int, seconds: float) -> Walk:
    """Sum what the threads kept."""
    total = workers[0]
    for worker in workers[1:]:
        total.tally.add(worker.tally)
        np.add(total.bin_counts, worker.bin_counts, out=total.bin_counts)
        total.energy += worker.energy
    share = total.energy / (ENERGY_STEPS * photons)
    return Walk(
        tally=total.tally,
        bin_counts=total.bin_counts,
        rays=sum(worker.rays for worker in workers),
        escaped=share[ESCAPED],
        absorbed=share[ABSORBED],
        cut=share[CUT],
        embree_seconds=sum(worker.embree_seconds for worker in workers),
        seconds=seconds,
    )
