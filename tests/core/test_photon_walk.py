# SPDX-License-Identifier: GPL-3.0-or-later
"""The walk as a whole: the same bits however it is divided, books that balance, and an end when it is told to stop."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core import photon_walk
from ivg_addon.core.bake import prepare_course
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.photon_walk import Walk, thread_count, walk_steps
from ivg_addon.core.progress import Progress, finish
from ivg_addon.core.scene import Scene
from ivg_addon.core.settings import BakeSettings, Estimator
from ivg_addon.core.tally import Tally

from .rooms import ball, beam, box, lamp, quad, rotation, scene, sky
from .z_tests import assert_means

GREY = ((0.5, 0.5, 0.5),)
SETTINGS = BakeSettings((0, 0, 0), (2, 3, 2.5), (4, 6, 5), photons=20_000, bounces=4, seed=3)


def room(albedo: Any = GREY, **rest: Any) -> Scene:
    """Return a closed room with a turned box in it."""
    block = box((0.3, 0.4, 0.0), (0.8, 1.0, 0.9), turn=rotation((0.1, 0.2, 1), 0.3))
    return scene([box((0, 0, 0), (2, 3, 2.5), inward=True), block], albedo, lights=lamp((1.4, 2, 2)), **rest)


def walk(of: Scene, settings: BakeSettings) -> Walk:
    lattice = Lattice(settings.bounds_min, settings.bounds_max, settings.resolution)
    return finish(walk_steps(prepare_course(of, lattice, settings.photons), lattice, settings))


def assert_same(a: Walk, b: Walk) -> None:
    np.testing.assert_array_equal(a.tally.sums, b.tally.sums)
    np.testing.assert_array_equal(a.bin_counts, b.bin_counts)
    np.testing.assert_array_equal(a.received, b.received)
    assert a.rays == b.rays
    for row in ("escaped", "absorbed", "cut"):
        np.testing.assert_array_equal(getattr(a, row), getattr(b, row))


# --- The same bits ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("estimator", Estimator)
def test_threads_and_batches_change_nothing(monkeypatch: pytest.MonkeyPatch, estimator: Estimator) -> None:
    of, settings = room(((0.7, 0.5, 0.2),)), replace(SETTINGS, estimator=estimator)
    whole = walk(of, replace(settings, threads=1))
    assert whole.tally.sums.any()
    for batch, threads in ((1 << 16, 2), (999, 1), (999, 2), (4096, 3), (1 << 20, 3)):
        monkeypatch.setattr(photon_walk, "BATCH", batch)
        assert_same(walk(of, replace(settings, threads=threads)), whole)


def test_another_seed_is_another_walk() -> None:
    first, second = (walk(room(), replace(SETTINGS, seed=seed)) for seed in (0, 1))
    assert (first.tally.sums != second.tally.sums).any()


def test_more_photons_begin_like_fewer(monkeypatch: pytest.MonkeyPatch) -> None:
    """Photon 7 is the same whoever else flies; only the fixed-point scale depends on their number."""
    monkeypatch.setattr(photon_walk, "BATCH", 500)
    few, many = (walk(room(), replace(SETTINGS, photons=n)) for n in (1000, 2000))
    assert (many.bin_counts >= few.bin_counts).all()
    assert many.bin_counts.sum() > few.bin_counts.sum()


def test_threads_are_no_more_than_there_is_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(photon_walk, "BATCH", 1000)
    assert thread_count(replace(SETTINGS, photons=1, threads=8)) == 1
    assert thread_count(replace(SETTINGS, photons=2001, threads=8)) == 3
    assert thread_count(replace(SETTINGS, photons=10**6, threads=8)) == 8
    monkeypatch.setattr("os.cpu_count", lambda: 5)
    assert thread_count(replace(SETTINGS, photons=10**6, threads=0)) == 5


# --- Energy -----------------------------------------------------------------------------------------------------------


def energies(of: Scene, settings: BakeSettings, seeds: Sequence[int] = range(24)) -> dict[str, NDArray[np.float64]]:
    """Return the three shares of each seed's walk, (seeds, 3 channel)."""
    walks = [walk(of, replace(settings, seed=seed)) for seed in seeds]
    return {row: np.stack([getattr(each, row) for each in walks]) for row in ("escaped", "absorbed", "cut")}


@pytest.mark.parametrize("bounces", [1, 2, 5])
def test_a_closed_room_absorbs_all_but_the_last_bounce(bounces: int) -> None:
    """Of every photon 1 − ρ stays at each hit: Σ = 1 − ρ^(b+1), and ρ^(b+1) is left when it is cut."""
    albedo = np.array([0.9, 0.5, 0.1])
    books = energies(room((albedo,)), replace(SETTINGS, photons=4096, bounces=bounces))
    assert_means(books["cut"], albedo ** (bounces + 1))
    assert_means(books["absorbed"], 1 - albedo ** (bounces + 1))
    # Rounding at an edge may lose one photon in a million.
    assert books["escaped"].max() < 1e-3
    assert books["escaped"].mean() < 1e-4


def test_what_is_emitted_is_absorbed_escapes_or_is_cut() -> None:
    """A room with an open side, under a sky: expectation by expectation the books balance."""
    walls = [
        quad((0, 0, 0), (2, 0, 0), (0, 3, 0)),
        quad((0, 0, 0), (0, 3, 0), (0, 0, 2.5)),
        quad((2, 0, 0), (0, 0, 2.5), (0, 3, 0)),
    ]
    of = scene(walls, ((0.8, 0.6, 0.3),), lights=sky((1.0, 0.5, 0.25)))
    books = energies(of, replace(SETTINGS, photons=4096, bounces=3))
    assert_means(sum(books.values()), [1.0, 0.5, 0.25])
    assert books["escaped"].mean() > 0.1
    assert books["absorbed"].mean() > 0.1
    assert books["cut"].mean() > 0


def test_black_surfaces_end_every_photon() -> None:
    result = walk(room(((0, 0, 0),)), SETTINGS)
    assert result.rays == SETTINGS.photons
    np.testing.assert_allclose(result.absorbed, 1.0, atol=1e-4)
    assert not result.tally.sums.any()
    assert result.bin_counts.sum() >= SETTINGS.photons - 2


# --- What diffuse rays do not see -------------------------------------------------------------------------------------


def test_an_object_that_diffuse_rays_do_not_see_blocks_and_reflects_nothing() -> None:
    """A lamp in a box that is invisible to diffuse rays: all its light stays there."""
    shade = box((1.2, 1.8, 1.8), (1.6, 2.2, 2.2), inward=True)
    of = scene([box((0, 0, 0), (2, 3, 2.5), inward=True), replace(shade, visible=False)], lights=lamp((1.4, 2, 2)))
    result = walk(of, SETTINGS)
    assert result.rays == SETTINGS.photons
    assert not result.tally.sums.any()
    np.testing.assert_allclose(result.absorbed, 1.0, atol=1e-6)


def test_reflected_light_passes_through_it() -> None:
    """A beam that misses a plate lights the room as if the plate were not there; one that is seen stands in the way."""
    walls, plate = box((0, 0, 0), (2, 3, 2.5), inward=True), quad((0.5, 0.5, 1), (1, 0, 0), (0, 1, 0))
    light = beam((1, 2.5, 2.4), (0, 0.5, 0), (0.5, 0, 0))
    empty, invisible, visible = (
        walk(scene(parts, lights=light), SETTINGS)
        for parts in ([walls], [walls, replace(plate, visible=False)], [walls, plate])
    )
    np.testing.assert_array_equal(invisible.tally.sums, empty.tally.sums)
    patches = len(empty.bin_counts)
    assert not invisible.bin_counts[patches:].any()
    assert visible.bin_counts[patches:].sum() > 100
    assert (visible.tally.sums != empty.tally.sums).any()


# --- Progress, cancel, failure ----------------------------------------------------------------------------------------


def photon_threads() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate() if thread.name.startswith("ivg-photons")]


def test_progress_grows_to_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(photon_walk, "BATCH", 3000)
    lattice = Lattice(SETTINGS.bounds_min, SETTINGS.bounds_max, SETTINGS.resolution)
    told: list[Progress] = list(
        walk_steps(prepare_course(room(), lattice, 10**6), lattice, replace(SETTINGS, threads=2))
    )
    assert len(told) == 7
    fractions = [progress.fraction for progress in told]
    assert fractions == sorted(set(fractions))
    assert fractions[-1] == 1.0
    assert told[-1].seconds_left == 0.0
    assert told[0].task == "Tracing photons (0.0 of 0.0 million)"


def test_closing_stops_all_threads() -> None:
    """Two billion photons would take half an hour."""
    lattice = Lattice(SETTINGS.bounds_min, SETTINGS.bounds_max, SETTINGS.resolution)
    steps = walk_steps(prepare_course(room(), lattice, 10**6), lattice, replace(SETTINGS, photons=2 * 10**9, threads=2))
    next(steps)
    assert len(photon_threads()) == 2
    start = time.perf_counter()
    steps.close()
    assert time.perf_counter() - start < 5.0
    assert not photon_threads()


def test_what_goes_wrong_in_one_thread_ends_all(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = iter(range(10**9))
    deposit = Tally.deposit

    def fails_once(tally: Tally, *flights: Any) -> None:
        if next(calls) == 5:
            raise ValueError("a defect")
        deposit(tally, *flights)

    monkeypatch.setattr(Tally, "deposit", fails_once)
    with pytest.raises(ValueError, match="a defect"):
        walk(room(), replace(SETTINGS, photons=2 * 10**9, threads=2))
    assert not photon_threads()


def test_memory_does_not_grow_with_the_number_of_photons(monkeypatch: pytest.MonkeyPatch) -> None:
    """Buffers are a batch long, sums as large as the grid."""
    monkeypatch.setattr(photon_walk, "BATCH", 100)
    lattice = Lattice(SETTINGS.bounds_min, SETTINGS.bounds_max, SETTINGS.resolution)
    course = prepare_course(scene([ball(inward=True)], lights=lamp((0, 0, 0))), lattice, 1000)

    def held(photons: int) -> int:
        worker = photon_walk.Worker(course, lattice, replace(SETTINGS, photons=photons))
        arrays = [value for value in vars(worker).values() if isinstance(value, np.ndarray)]
        return sum(array.nbytes for array in arrays) + worker.tally.sums.nbytes

    assert held(10**3) == held(10**9)
