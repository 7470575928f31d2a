# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons from the lights through the scene: batches, threads, and what they leave behind.

A batch of photons flies as a wavefront: emit, then {intersect, tally, scatter} until none is left.
Threads take batches one after the other and keep their own sums; no photon is ever stored, so
memory does not grow with their number.
"""

from __future__ import annotations

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
from .embree import Hits, Tracer
from .emission import Emission, leave_darkness
from .landings import Landings
from .lobe_scattering import MOST_PASSAGES, scatter_at_lobes
from .partitions import Partitions
from .progress import Progress
from .restricted_light import RestrictedLight
from .scattering import ABSORBED, CUT, ENERGY_STEPS, ESCAPED, scatter
from .scene import Float32, Int32
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
    received : (patches, 2, 3) float32
        Share of the emitted photons' weight that arrived there as light that the grid counts; multiply by
        `Emission.flux_scale` for watts.
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
    received: Float32
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
        What blocks a photon before and after its first bounce; to pass a transparent surface is none.
        Objects that diffuse rays do not see cast shadows all the same, so the two can differ.
    walls
        What parts places: `later` without what light goes on through.
    surfaces, bins
        What photons scatter at, and where they are counted.
    restricted
        What some lights may not do; None where all may do everything.
    """

    emission: Emission
    first: Tracer
    later: Tracer
    walls: Tracer
    surfaces: Surfaces
    bins: SurfaceBins
    restricted: RestrictedLight | None = None


class Worker:
    """One thread's sums and its buffers for a batch; without `landings` nobody asks where photons land."""

    def __init__(
        self, course: Course, lattice: Lattice, settings: BakeSettings, landings: Landings | None = None
    ) -> None:
        self.course = course
        self.settings = settings
        self.some_pass = bool(course.surfaces.lobes.lets_pass.any())
        self.most_flights = settings.bounces + 1 + (MOST_PASSAGES if self.some_pass else 0)
        self.tally = Tally.empty(lattice, settings.estimator, settings.photons, self.most_flights - 1)
        self.landings = landings
        self.landed = np.empty(2 * BATCH, dtype=np.int64)
        self.brought = np.empty((2 * BATCH, 3), dtype=np.float32)
        self.energy = np.zeros((3, 3), dtype=np.int64)
        self.rays = 0
        self.embree_seconds = 0.0
        self.photons = np.empty(BATCH, dtype=np.int64)
        self.origins = np.empty((BATCH, 3), dtype=np.float32)
        self.directions = np.empty((BATCH, 3), dtype=np.float32)
        self.weights = np.empty((BATCH, 3), dtype=np.float32)
        self.dark = np.empty(BATCH, dtype=np.float32)
        # By the last bits of a photon's index: no two photons of a batch share a place.
        self.standard = np.ones(1 << (BATCH - 1).bit_length(), dtype=np.float32)
        falls = course.emission.falloff is not None
        self.starts = np.empty((len(self.standard) if falls else 0, 4), dtype=np.float32)
        self.bounces = np.empty(BATCH, dtype=np.int16)
        self.waiting = np.empty((BATCH, 2), dtype=np.int32)

    def fly(self, first: int, size: int, stop: threading.Event) -> int:
        """Trace photons first, first + 1, … to their end, or until `stop`; return how many. At most `BATCH`."""
        self.photons[:size] = np.arange(first, first + size)
        self.course.emission.emit(
            self.settings.seed,
            first,
            self.origins[:size],
            self.directions[:size],
            self.weights[:size],
            self.dark[:size],
        )
        if self.course.emission.is_aimed:
            standards = self.course.emission.standards(self.settings.seed, first, size)
            self.standard[self.photons[:size] & (len(self.standard) - 1)] = standards
        if len(self.starts):
            own = self.photons[:size] & (len(self.starts) - 1)
            self.starts[own, :3], self.starts[own, 3] = self.origins[:size], 1.0
        self.bounces[:size] = 0
        alive = size
        for flight in range(self.most_flights):
            if alive == 0 or stop.is_set():
                break
            alive = self._advance(flight, self._allowed(flight, alive))
        return size

    def _allowed(self, flight: int, n: int) -> int:
        """Take out what has bounced as often as its light may; return how many are left."""
        rules = self.course.restricted
        if flight == 0 or rules is None or not rules.ends:
            return n
        return rules.end(
            self.settings.seed,
            self.photons[:n],
            self.origins[:n],
            self.directions[:n],
            self.weights[:n],
            self.bounces[:n],
            self.dark[:n],
            self.energy,
        )

    def _advance(self, flight: int, n: int) -> int:
        """Let n photons fly to their next hit and scatter there; return how many survive."""
        course, settings = self.course, self.settings
        origins, directions, weights = self.origins[:n], self.directions[:n], self.weights[:n]
        bounces, dark = self.bounces[:n], self.dark[:n]
        # Who has only passed transparent surfaces has not bounced: still direct light.
        may_be_direct = flight == 0 or self.some_pass
        start = time.perf_counter()
        hits = self._intersect(flight, origins, directions)
        self.embree_seconds += time.perf_counter() - start
        self.rays += n
        factor = None
        rules = course.restricted
        if may_be_direct and rules is not None and rules.chooses:
            direct = (self.photons[:n], bounces, origins, directions, dark)
            factor = rules.follow(course.first, settings.seed, flight, *direct, hits)
        if may_be_direct and course.emission.flies_dark:
            surfaces = course.surfaces
            leave_darkness(
                origins, directions, dark, hits.triangle, hits.distance, surfaces.material, surfaces.lobes.lets_pass
            )
        if may_be_direct and len(self.starts):
            grown = self._fall_off(flight, hits)
            factor = grown if factor is None else factor * grown
        if settings.include_direct or not may_be_direct:
            self.deposit(origins, directions, weights, hits.distance)
        elif flight > 0:
            self.deposit(origins, directions, weights, np.where(bounces > 0, hits.distance, np.float32(0)))
        if factor is not None:
            weights *= factor[:, None]
        scene = (hits.triangle, hits.u, hits.v, settings.seed, flight, settings.bounces, course.surfaces)
        photons = (self.photons[:n], origins, directions, weights, bounces, dark, self.standard)
        arrived = (0 if settings.include_direct else 1, self.landed, self.brought)
        alive, late, arrivals = scatter(*photons, *scene, *arrived, self.energy, self.waiting)
        if late:
            so_far = (alive, late, arrivals)
            alive, arrivals = scatter_at_lobes(*photons, *scene, *arrived, self.energy, self.waiting, *so_far)
        if self.landings is not None:
            self.landings.receive(self.landed[:arrivals], self.brought[:arrivals])
        return int(alive)

    def _fall_off(self, flight: int, hits: Hits) -> Float32:
        """See `Falloff.apply`."""
        course, settings, n = self.course, self.settings, len(hits.triangle)
        assert course.emission.falloff is not None
        return course.emission.falloff.apply(
            course.emission.emitters,
            settings.seed,
            flight,
            self.photons[:n],
            self.bounces[:n],
            self.starts,
            (self.origins[:n], self.directions[:n], self.weights[:n]),
            hits,
            (course.surfaces.vertices, course.surfaces.triangles),
            (np.asarray(settings.bounds_min, dtype=np.float64), np.asarray(settings.bounds_max, dtype=np.float64)),
        )

    def deposit(self, origins: Float32, directions: Float32, weights: Float32, lengths: Float32) -> None:
        """Add flights that count to the sums; see `Tally.deposit`."""
        self.tally.deposit(origins, directions, weights, lengths)

    def _intersect(self, flight: int, origins: Float32, directions: Float32) -> Hits:
        """Return the photons' hits: before their first bounce on what blocks direct light, then on the rest."""
        first, later = self.course.first, self.course.later
        if flight == 0 or first is later or not self.some_pass:
            return (first if flight == 0 else later).intersect(origins, directions)
        direct = self.bounces[: len(origins)] == 0
        hits = later.intersect(origins, directions)
        passed = first.intersect(origins[direct], directions[direct])
        for name in ("triangle", "u", "v", "distance"):
            getattr(hits, name)[direct] = getattr(passed, name)
        return hits


def thread_count(settings: BakeSettings) -> int:
    """Return the number of worker threads: as set, else one per processor."""
    batches = -(-settings.photons // BATCH)
    return min(settings.threads or os.cpu_count() or 1, batches)


def walk_steps(course: Course, lattice: Lattice, settings: BakeSettings) -> Generator[Progress, None, Walk]:
    """Trace all photons; yields after every batch, returns a `Walk`.

    Closing the generator stops the threads within one flight of a batch.
    """
    walkers = Walkers(course, lattice, settings)
    yield from walkers.fly_steps(0, settings.photons)
    return walkers.walk()


class Walkers:
    """The threads' sums, over one range of photons after another."""

    def __init__(self, course: Course, lattice: Lattice, settings: BakeSettings) -> None:
        self._photons = settings.photons
        self._landings = Landings(course.bins)
        self._workers = [Worker(course, lattice, settings, self._landings) for _ in range(thread_count(settings))]
        self._traced = 0
        self._seconds = 0.0

    def fly_steps(self, first: int, last: int) -> Generator[Progress, None, None]:
        """Trace the photons first … last − 1; yields after every batch, closing it stops as `walk_steps` does."""
        start = time.perf_counter()
        firsts = iter(range(first, last, BATCH))
        done: queue.SimpleQueue[int | None] = queue.SimpleQueue()
        stop = threading.Event()

        def run(worker: Worker) -> None:
            try:
                # next() on the iterator of a range is atomic under the GIL.
                while not stop.is_set() and (at := next(firsts, None)) is not None:
                    done.put(worker.fly(at, min(BATCH, last - at), stop))
            except BaseException:
                # What went wrong is told when all have stopped; nothing is worth waiting for.
                stop.set()
                raise
            finally:
                done.put(None)

        with ThreadPoolExecutor(len(self._workers), thread_name_prefix="ivg-photons") as pool:
            futures: list[Future[None]] = [pool.submit(run, worker) for worker in self._workers]
            try:
                yield from self._progress(done, start)
            finally:
                stop.set()
            for future in futures:
                future.result()
        self._seconds += time.perf_counter() - start

    def _progress(self, done: queue.SimpleQueue[int | None], start: float) -> Generator[Progress, None, None]:
        """Yield after every batch until every worker has said None."""
        running = len(self._workers)
        while running:
            size = done.get()
            if size is None:
                running -= 1
                continue
            self._traced += size
            elapsed = self._seconds + time.perf_counter() - start
            yield Progress(
                task=f"Tracing photons ({self._traced / 1e6:.1f} of {self._photons / 1e6:.1f} million)",
                fraction=self._traced / self._photons,
                seconds_left=elapsed * (self._photons - self._traced) / self._traced,
            )

    def divide(self, partitions: Partitions) -> None:
        """Let vertices count on their sides only, from here on; what divided ones have counted is forgotten."""
        for worker in self._workers:
            worker.tally = worker.tally.divide(partitions)

    def bin_counts(self) -> Int32:
        """Return the photons received so far by each side of each patch, (patches, 2)."""
        return self._landings.counts

    def walk(self) -> Walk:
        """Sum what the threads kept."""
        tally, energy = self._workers[0].tally, self._workers[0].energy
        for worker in self._workers[1:]:
            tally.add(worker.tally)
            energy = energy + worker.energy
        share = energy / (ENERGY_STEPS * self._photons)
        return Walk(
            tally=tally,
            bin_counts=self._landings.counts,
            received=self._landings.weights / np.float32(self._photons),
            rays=sum(worker.rays for worker in self._workers),
            escaped=share[ESCAPED],
            absorbed=share[ABSORBED],
            cut=share[CUT],
            embree_seconds=sum(worker.embree_seconds for worker in self._workers),
            seconds=self._seconds,
        )
