# SPDX-License-Identifier: GPL-3.0-or-later
"""The bake from scene to grid: what it returns, what it refuses, and that no scene, however odd, breaks it."""

from __future__ import annotations

import threading
import tracemalloc
from collections.abc import Callable
from dataclasses import fields, replace
from datetime import UTC, datetime
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ivg_addon.core.bake import bake, bake_steps, memory_needed
from ivg_addon.core.errors import IvgError, MemoryLimitError, SceneError
from ivg_addon.core.grid import grid_bytes
from ivg_addon.core.lights import Lights
from ivg_addon.core.progress import Progress, finish
from ivg_addon.core.report import Notice
from ivg_addon.core.scene import Scene, SurfaceRecord
from ivg_addon.core.settings import BakeSettings, Estimator
from ivg_addon.core.version import VERSION

from .rooms import Part, beam, box, lamp, rotation, scene, sky

SETTINGS = BakeSettings((-1, -1, -1), (1, 1, 1), (3, 4, 5), photons=5000, bounces=3, lit_points=32)


def room(**changes: Any) -> Scene:
    """Return a closed room, as large as the grid, with a block in it."""
    block = box((-0.5, -0.4, -0.6), (0.1, 0.3, 0.2), turn=rotation((1, 2, 3), 0.4))
    made = scene([box((-1, -1, -1), (1, 1, 1), inward=True), block], lights=lamp((0.6, 0.6, 0.7), (3, 2, 1)))
    return replace(made, **changes)


# --- What comes out ---------------------------------------------------------------------------------------------------


def test_the_record_tells_how_the_grid_came_to_be() -> None:
    of = room(notices=(Notice("simplified", "material 'Gold'", "taken as diffuse"),))
    result = bake(of, SETTINGS)
    record = result.grid.record
    assert (record.scene, record.settings, record.version) == ("Test", SETTINGS, VERSION)
    assert record.checksum == of.fingerprint()
    read = SurfaceRecord(evaluated=1, seconds=2.0)
    read_otherwise = replace(of, notices=(Notice("warning", "a", "b"),), surfaces=read)
    assert read_otherwise.fingerprint() == record.checksum
    assert abs((datetime.now(UTC) - datetime.fromisoformat(record.created)).total_seconds()) < 60
    np.testing.assert_allclose(record.emitted, (3, 2, 1), rtol=1e-6)
    assert result.notices[0] == of.notices[0]


def test_the_grid_has_the_shape_that_was_asked_for() -> None:
    grid = bake(room(), SETTINGS).grid
    assert grid.vectors.shape == (4, 5, 6, 6, 3, 3)
    assert grid.vectors.dtype == grid.validity.dtype == np.float32
    assert (grid.resolution, tuple(grid.bounds_min), tuple(grid.bounds_max)) == ((3, 4, 5), (-1, -1, -1), (1, 1, 1))
    assert not grid.vectors[grid.validity == 0].any()
    # Of the vectors towards an axis the component along it cannot be negative.
    for hemisphere in range(6):
        axis, sign = divmod(hemisphere, 2)
        assert ((1 - 2 * sign) * grid.vectors[..., hemisphere, :, axis] >= 0).all()


def test_statistics_are_watts_and_balance() -> None:
    result = bake(room(), replace(SETTINGS, photons=100_000))
    told, grid = result.statistics, result.grid
    np.testing.assert_allclose(told.emitted, (3, 2, 1), rtol=1e-6)
    spent = np.add(np.add(told.absorbed, told.escaped), told.cut)
    # Russian roulette keeps this right on average; in a grey room its share of the noise is below one part in 300.
    np.testing.assert_allclose(spent, told.emitted, rtol=5 / 300)
    assert told.photons == 100_000
    assert told.photons < told.rays < 4 * told.photons
    assert told.grid_bytes == grid.vectors.nbytes + grid.validity.nbytes + grid.lit_weights.nbytes
    assert told.threads >= 1
    assert told.photons_per_second == pytest.approx(told.photons / told.photon_seconds)
    assert told.seconds == pytest.approx(told.prepare_seconds + told.photon_seconds + told.lit_seconds)
    assert 0 < told.embree_seconds <= told.threads * told.photon_seconds


@pytest.mark.parametrize("estimator", Estimator)
def test_the_same_seed_gives_the_same_grid(estimator: Estimator) -> None:
    asked = replace(SETTINGS, estimator=estimator, photons=70_000)
    first, second = (bake(room(), replace(asked, threads=threads)).grid for threads in (1, 2))
    np.testing.assert_array_equal(first.vectors, second.vectors)
    np.testing.assert_array_equal(first.validity, second.validity)
    np.testing.assert_array_equal(first.lit_weights, second.lit_weights)
    other = bake(room(), replace(asked, seed=1)).grid
    assert (other.vectors != first.vectors).any()


def test_the_report_knows_no_lit_volume() -> None:
    """Its vertices are all valid and divided by whole faces; so are those of others if no points are asked for."""
    for asked in (replace(SETTINGS, estimator=Estimator.REPORT), replace(SETTINGS, lit_points=0)):
        grid = bake(room(), asked).grid
        assert (grid.validity == 1).all()
        np.testing.assert_array_equal(grid.lit_weights, grid.lattice.whole_cell_weights())
    grid = bake(room(), SETTINGS).grid
    assert (grid.validity < 1).any()
    assert (grid.lit_weights != grid.lattice.whole_cell_weights()).any()


def test_direct_light_is_added_when_asked_for() -> None:
    indirect, everything = (bake(room(), replace(SETTINGS, include_direct=d)).grid for d in (False, True))
    assert everything.vectors.sum(axis=(0, 1, 2))[0, 0, 0] > 1.5 * indirect.vectors.sum(axis=(0, 1, 2))[0, 0, 0] > 0


def test_power_scales_the_light_and_nothing_else() -> None:
    one, thousand = (
        bake(room(lights=lamp((0.6, 0.6, 0.7), power)), SETTINGS).grid for power in ((1,) * 3, (1000,) * 3)
    )
    np.testing.assert_array_equal(one.validity, thousand.validity)
    np.testing.assert_allclose(1000 * one.vectors, thousand.vectors, rtol=1e-5, atol=1e-6 * thousand.vectors.max())


# --- Step by step -----------------------------------------------------------------------------------------------------


def test_progress_grows_and_names_the_phases() -> None:
    told = list(bake_steps(room(), SETTINGS))
    fractions = [progress.fraction for progress in told]
    assert fractions == sorted(fractions)
    assert fractions[0] == 0.0
    assert fractions[-1] == 1.0
    phases = list(dict.fromkeys(progress.task.split(" (")[0] for progress in told))
    assert phases[0] == "Preparing the scene"
    assert phases[2:] == [
        "Tracing photons",
        "Looking for thin walls",
        "Measuring lit volumes",
        "Fitting to the surfaces",
    ]


def test_closing_at_any_step_leaves_no_threads() -> None:
    before = set(threading.enumerate())
    steps = len(list(bake_steps(room(), SETTINGS)))
    assert steps >= 4
    for last in range(steps):
        work = bake_steps(room(), SETTINGS)
        for _ in range(last + 1):
            next(work)
        work.close()
        assert set(threading.enumerate()) <= before


# --- What it refuses --------------------------------------------------------------------------------------------------


def test_no_geometry() -> None:
    empty = scene([Part(np.empty((0, 3)), np.empty((0, 3), dtype=np.int32))], lights=sky())
    with pytest.raises(SceneError, match="scene 'Test' has no geometry that renders: add a mesh, or enable"):
        bake(empty, SETTINGS)


def test_no_light() -> None:
    with pytest.raises(SceneError, match="scene 'Test' has no light: add a light"):
        bake(room(lights=Lights.none()), SETTINGS)


def test_a_resolution_that_does_not_fit_is_refused_before_anything_is_allocated() -> None:
    huge = replace(SETTINGS, resolution=(100_000, 100_000, 100_000))
    with pytest.raises(MemoryLimitError) as caught:
        bake(room(), huge)
    message = str(caught.value)
    assert message.startswith("a grid of 100000 × 100000 × 100000 voxels needs ")
    assert message.endswith("lower the resolution or the number of threads")


def test_memory_needed_counts_every_thread_and_the_grid() -> None:
    asked = replace(SETTINGS, resolution=(9, 9, 9), photons=10**6)
    for threads in (1, 2, 4):
        needed = memory_needed(replace(asked, threads=threads))
        assert needed == threads * 1000 * 72 * 8 + 4 * grid_bytes(asked.resolution)
    assert grid_bytes((9, 9, 9)) == 1000 * (55 * 4 + 27 * 2)
    assert grid_bytes((10**6,) * 3) > 10**18


def test_what_is_needed_is_enough() -> None:
    """The peak of what numpy holds, for a grid that outweighs all else."""
    asked = replace(SETTINGS, resolution=(40, 40, 40), photons=1000, threads=1, lit_points=1)
    tracemalloc.start()
    try:
        bake(room(), asked)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    buffers = 32 << 20  # of a batch of photons or lit-volume points
    assert peak < memory_needed(asked) + buffers


# --- Warnings ---------------------------------------------------------------------------------------------------------


def subjects(of: Scene, asked: BakeSettings = SETTINGS) -> list[str]:
    return [f"{notice.kind}: {notice.subject}" for notice in bake(of, asked).notices]


def test_a_grid_inside_a_solid_is_doubted() -> None:
    inside = replace(SETTINGS, bounds_min=(-0.05, -0.05, -0.05), bounds_max=(0.05, 0.05, 0.05))
    solid = scene([box((-1, -1, -1), (1, 1, 1))], lights=lamp((3, 0, 0)))
    assert "warning: grid" in subjects(solid, inside)


def test_light_that_is_lost_is_doubted() -> None:
    far = scene([box((-1, -1, -1), (-0.9, -0.9, -0.9))], lights=lamp((5, 5, 5)))
    assert "warning: photons" in subjects(far)


def test_a_good_room_is_not_doubted() -> None:
    assert subjects(room()) == []


# --- Any scene --------------------------------------------------------------------------------------------------------

near = st.floats(-2, 2, width=32)
far = st.sampled_from([0.0, -0.0, 1e-38, 1e-12, 1e4, -1e7, 1e12, -1e18, 3e37])
coordinates = st.one_of(near, near, near, far)
corners = st.lists(st.tuples(coordinates, coordinates, coordinates), min_size=3, max_size=12)
lights: st.SearchStrategy[Callable[[], Lights]] = st.sampled_from(
    [
        lambda: lamp((0.1, 0.2, 0.3)),
        lambda: lamp((1e6, 0, 0)),
        lambda: beam((0, 0, 3), (0, 1, 0), (1, 0, 0)),
        sky,
        Lights.none,
    ]
)


@given(
    points=corners,
    indices=st.lists(st.tuples(*[st.integers(0, 11)] * 3), min_size=1, max_size=30),
    light=lights,
    glow=st.floats(0, 10),
    albedo=st.tuples(*[st.floats(0, 1)] * 3),
    visible=st.booleans(),
    smooth=st.booleans(),
    estimator=st.sampled_from(list(Estimator)),
)
@settings(max_examples=120)
def test_any_triangles_give_a_finite_grid_or_one_clear_error(
    points: list[tuple[float, ...]],
    indices: list[tuple[int, ...]],
    light: Callable[[], Lights],
    glow: float,
    albedo: tuple[float, ...],
    visible: bool,
    smooth: bool,
    estimator: Estimator,
) -> None:
    """Triangles without area, of enormous size, far away, intersecting: whatever the export lets through, and more."""
    triangles = np.array(indices) % len(points)
    normals = None
    if smooth:
        rng = np.random.default_rng(len(points))
        normals = rng.normal(size=(len(triangles), 3, 3))
        normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    soup = Part(np.array(points), triangles, corner_normals=normals, visible=visible)
    wall = Part(np.array([(-2, -2, -1), (2, -2, -1), (0, 2, -1)]), np.array([[0, 1, 2]]), material=1)
    of = scene([soup, wall], [albedo, (0.5, 0.5, 0.5)], [(glow,) * 3, (0, 0, 0)], light())
    try:
        result = bake(of, replace(SETTINGS, photons=500, estimator=estimator, lit_points=8))
    except IvgError as error:
        assert "\n" not in str(error)
        return
    assert np.isfinite(result.grid.vectors).all()
    assert np.isfinite(result.grid.corrections).all()
    assert ((result.grid.validity >= 0) & (result.grid.validity <= 1)).all()
    told = result.statistics
    for row in ("emitted", "escaped", "cut"):
        assert np.isfinite(getattr(told, row)).all()
        assert (np.array(getattr(told, row)) >= 0).all()
    assert np.isfinite(told.absorbed).all()
    assert all(getattr(told, field.name) is not None for field in fields(told) if field.name != "aim")
    finish(iter_look_ups(result.grid.irradiance))


def iter_look_ups(irradiance: Callable[..., Any]) -> Any:
    """Look up everywhere and nowhere; results are finite and not negative."""
    rng = np.random.default_rng(0)
    points = np.concatenate([rng.uniform(-1.5, 1.5, (20, 3)), [(1e30, 0, 0), (0, -1e300, 0)]])
    e = irradiance(points, rng.normal(size=points.shape))
    assert np.isfinite(e).all()
    assert (e >= 0).all()
    yield Progress("Looked up", 1.0)
