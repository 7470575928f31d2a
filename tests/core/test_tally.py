# SPDX-License-Identifier: GPL-3.0-or-later
"""The three estimators: against brute force, against closed forms of a uniform field, and their fixed-point sums."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.reconstruction import coefficients
from ivg_addon.core.settings import Directional, Estimator
from ivg_addon.core.tally import AT_THE_END, GRAZING_COSINE, WEIGHT_LIMIT, Tally

from .z_tests import assert_means

Float64 = NDArray[np.float64]
Flights = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]

LATTICE = Lattice((-0.3, 0.1, -2.0), (1.7, 1.3, 0.5), (4, 3, 5))
LOW, HIGH = np.array(LATTICE.bounds_min), np.array(LATTICE.bounds_max)
DIAGONAL = float(np.linalg.norm(HIGH - LOW))
MISS_LENGTH = np.float32(1e37)
BEYOND = AT_THE_END * float(LATTICE.voxel_size.min())


def float32(*arrays: object) -> Flights:
    return tuple(np.ascontiguousarray(a, dtype=np.float32) for a in arrays)  # type: ignore[return-value]


def tallied(flights: Flights, estimator: Estimator, lattice: Lattice = LATTICE) -> Tally:
    tally = Tally.empty(lattice, estimator, photons=len(flights[3]), bounces=0)
    tally.deposit(*flights)
    return tally


def random_flights(count: int, seed: int) -> Flights:
    """Return segments of all lengths around the lattice, from inside and outside; some never end."""
    rng = np.random.default_rng(seed)
    origins = LOW + (HIGH - LOW) * rng.uniform(-0.25, 1.25, (count, 3))
    directions = rng.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    lengths = np.where(rng.random(count) < 0.3, MISS_LENGTH, rng.exponential(DIAGONAL / 2, count))
    return float32(origins, directions, rng.uniform(0, 2, (count, 3)), lengths)


# --- Brute force ------------------------------------------------------------------------------------------------------


def inside(origin: Float64, direction: Float64, length: float, low: Float64, high: Float64) -> tuple[Float64, Float64]:
    """Return the part (t₀, t₁) of a segment in boxes low, high (…, 3); for directions without zeros."""
    a, b = (low - origin) / direction, (high - origin) / direction
    start = np.maximum(np.minimum(a, b).max(axis=-1), 0.0)
    return start, np.minimum(np.maximum(a, b).min(axis=-1), length)


def reference(flights: Flights, estimator: Estimator) -> Float64:
    """Return what `Tally.vectors(1)` should be: each flight against each dual cell, or each face."""
    vectors = np.zeros((*LATTICE.shape, 6, 3, 3))
    h = LATTICE.voxel_size
    centres = LATTICE.vertex_positions()
    cell_low, cell_high = np.maximum(centres - h / 2, LOW), np.minimum(centres + h / 2, HIGH)
    for o, d, w, length in zip(*(np.asarray(a, dtype=np.float64) for a in flights), strict=True):
        product = np.outer(w, -d)
        start, end = inside(o, d, length, cell_low, cell_high)
        leg = np.maximum(end - start, 0.0)
        for axis in range(3):
            hemisphere = 2 * axis + (1 if d[axis] > 0 else 0)
            if estimator is Estimator.TRACK_LENGTH:
                share = leg / LATTICE.cell_volumes()
            else:
                t = (centres[..., axis] - o[axis]) / d[axis]
                crossing = o + t[..., None] * d
                within = (crossing >= cell_low) & (crossing <= cell_high)
                within[..., axis] = (t >= -BEYOND) & (t <= length + BEYOND)
                cosine = 1.0 if estimator is Estimator.REPORT else max(abs(d[axis]), GRAZING_COSINE)
                share = within.all(axis=-1) / (cosine * LATTICE.face_areas()[..., axis])
            vectors[..., hemisphere, :, :] += share[..., None, None] * product
    return vectors


@pytest.mark.parametrize("estimator", Estimator)
def test_estimators_agree_with_brute_force(estimator: Estimator) -> None:
    flights = random_flights(1500, seed=3)
    expected = reference(flights, estimator)
    assert (expected != 0).any(axis=(-1, -2, -3)).all(), "there are cells that no flight tests"
    # Fixed point cuts off less than one step per deposit, and rounding leaves less than that.
    tally = tallied(flights, estimator)
    step = np.cbrt(LATTICE.voxel_size.prod()) / LATTICE.cell_volumes().min() / tally.steps
    step = max(float(step), float(1 / LATTICE.face_areas().min() / tally.steps))
    np.testing.assert_allclose(tally.vectors(1.0), expected, rtol=1e-9, atol=2 * 1500 * step)


# --- Single segments --------------------------------------------------------------------------------------------------

_PLANES = [
    sorted({float(x) for i in range(2 * n + 1) for x in [LOW[k] + (HIGH - LOW)[k] * i / (2 * n)]})
    for k, n in enumerate(LATTICE.resolution)
]
coordinates = st.tuples(*[st.sampled_from(planes) | st.floats(-4, 4, width=32) for planes in _PLANES])
slopes = st.sampled_from([0.0, -0.0, 1.0, -1.0, 1e-6, -1e-20, 1e-42]) | st.floats(-1, 1, width=32)
headings = st.tuples(slopes, slopes, slopes).filter(lambda v: max(map(abs, v)) > 1e-3)
distances = st.just(float(MISS_LENGTH)) | st.floats(0, 10, width=32) | st.sampled_from([0.0, 1e-30])


def segment(origin: tuple[float, ...], heading: tuple[float, ...], length: float) -> Flights:
    direction = np.array(heading) / np.linalg.norm(heading)
    return float32([origin], [direction], [(1, 1, 1)], [length])


def clipped(flights: Flights) -> tuple[float, float]:
    """Return the part (t₀, t₁) of a single segment in the closed box, by the definition."""
    start, end = 0.0, float(flights[3][0])
    for o, d, low, high in zip(*(a[0].astype(np.float64) for a in flights[:2]), LOW, HIGH, strict=True):
        if d == 0.0:
            if not low <= o <= high:
                return 0.0, 0.0
        else:
            start = max(start, min((low - o) / d, (high - o) / d))
            end = min(end, max((low - o) / d, (high - o) / d))
    return start, max(start, end)


@given(coordinates, headings, distances)
@example((0.0, 0.5, -1.0), (1.0, 0.0, 0.0), 1e37)
@example(tuple(LOW), (1.0, 1.0, 1.0), 1e37)
@example(tuple(HIGH), (1.0, 1.0, 1.0), 1e37)
@example((LOW[0], HIGH[1], 0.0), (0.0, 0.0, 1.0), 1e37)
@settings(max_examples=1000)
def test_the_lengths_in_all_cells_sum_up_to_the_length_in_the_box(
    origin: tuple[float, ...], heading: tuple[float, ...], length: float
) -> None:
    flights = segment(origin, heading, length)
    tally = tallied(flights, Estimator.TRACK_LENGTH)
    start, end = clipped(flights)
    moments = tally.vectors(1.0) * LATTICE.cell_volumes()[..., None, None, None]
    # Each axis has the whole flight once, in one of its two hemispheres.
    summed = moments.reshape(-1, 3, 2, 3, 3).sum(axis=(0, 2))
    expected = -flights[1][0].astype(np.float64) * (end - start)
    # Per cell a step of the sum is cut off; the length is counted in 2⁻⁴⁰ of the diagonal.
    step = np.cbrt(LATTICE.voxel_size.prod()) / tally.steps
    atol = 2 * sum(LATTICE.shape) * step + 4 * 2.0**-40 * DIAGONAL
    np.testing.assert_allclose(summed, np.broadcast_to(expected, (3, 3, 3)), atol=atol)


@given(coordinates, headings, distances)
@settings(max_examples=1000)
def test_every_plane_in_the_box_is_crossed_once(
    origin: tuple[float, ...], heading: tuple[float, ...], length: float
) -> None:
    """Also one that it starts or ends at, unless it grazes it. Right at an edge of the box, rounding may decide."""
    flights = segment(origin, heading, length)
    tally = tallied(flights, Estimator.REPORT)
    fluxes = tally.vectors(1.0) * np.repeat(LATTICE.face_areas(), 2, axis=-1)[..., None, None]
    o, d = (a[0].astype(np.float64) for a in flights[:2])
    for axis in np.flatnonzero(d):
        planes = np.linspace(LOW[axis], HIGH[axis], LATTICE.shape[axis])
        t = (planes - o[axis]) / d[axis]
        with np.errstate(over="ignore", invalid="ignore"):
            at = o + t[:, None] * d
        at[:, axis] = planes
        inside = ((at > LOW + 1e-6) & (at < HIGH - 1e-6)) | (np.arange(3) == axis)
        nearly = (at > LOW - 1e-6) & (at < HIGH + 1e-6)
        margin = 0.0
        if abs(d[axis]) < 0.01:
            margin, nearly = 1e-6 / abs(d[axis]), np.ones_like(nearly)
        least = np.count_nonzero((t >= margin) & (t <= length - margin) & inside.all(axis=1))
        margin += 2 * BEYOND
        most = np.count_nonzero((t > -margin) & (t < length + margin) & nearly.all(axis=1))
        crossings = -fluxes[..., 2 * axis : 2 * axis + 2, :, :].sum(axis=(0, 1, 2, 3))[0] @ d / (d @ d)
        assert least - 1e-6 <= crossings <= most + 1e-6
        assert crossings == pytest.approx(round(crossings), abs=1e-6)


@pytest.mark.parametrize("estimator", Estimator)
@given(
    origin=st.tuples(*[st.sampled_from([-1.0, 0.0, 1.0]) | st.floats(-1, 1)] * 3),
    exponent=st.floats(0, 30),
    heading=headings,
)
@settings(max_examples=100)
def test_flights_from_far_away_stay_in_the_grid(
    estimator: Estimator, origin: tuple[float, ...], exponent: float, heading: tuple[float, ...]
) -> None:
    """However little of their position rounding leaves, they end, and add no more than a diagonal's worth."""
    flights = segment(tuple(10.0**exponent * np.array(origin)), heading, float(MISS_LENGTH))
    tally = tallied(flights, estimator)
    weights = np.abs(tally.sums).reshape(-1, 9).max(axis=1).sum() / tally.steps
    cells = sum(LATTICE.shape)
    largest = {
        Estimator.TRACK_LENGTH: DIAGONAL / np.cbrt(LATTICE.voxel_size.prod()),
        Estimator.REPORT: cells,
        Estimator.CROSSING: cells / GRAZING_COSINE,
    }[estimator]
    assert weights <= largest * (1 + 1e-6)


# --- A uniform field --------------------------------------------------------------------------------------------------


def isotropic_flights(count: int, seed: int) -> tuple[Flights, float]:
    """Return lines of a uniform isotropic field, and the flux of each at radiance 1.

    A direction is uniform, the line goes through a uniform point of the enclosing ball's disc across it: the power
    that a field of radiance L sends through the ball is 4π · π r² L.
    """
    rng = np.random.default_rng(seed)
    directions, aside = rng.normal(size=(2, count, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    aside = np.cross(directions, aside)
    aside /= np.linalg.norm(aside, axis=1)[:, None]
    radius = DIAGONAL / 2
    origins = (LOW + HIGH) / 2 + radius * np.sqrt(rng.random(count))[:, None] * aside - 2 * radius * directions
    flights = float32(origins, directions, np.ones((count, 3)), np.full(count, MISS_LENGTH))
    return flights, 4 * math.pi**2 * radius**2 / count


BATCHES = 48


@pytest.fixture(scope="module")
def uniform_field() -> dict[Estimator, Float64]:
    """Independent estimates of a uniform field of radiance 1, (batches, Ni+1, Nj+1, Nk+1, 6, 3 xyz)."""
    estimates: dict[Estimator, list[Float64]] = {estimator: [] for estimator in Estimator}
    for batch in range(BATCHES):
        flights, flux = isotropic_flights(1 << 14, seed=100 + batch)
        for estimator, batches in estimates.items():
            batches.append(tallied(flights, estimator).vectors(flux)[..., 0, :])
    return {estimator: np.stack(batches) for estimator, batches in estimates.items()}


AXES = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], dtype=np.float64)


def test_track_length_is_unbiased_in_every_cell(uniform_field: dict[Estimator, Float64]) -> None:
    """I_δ = π δ, in cells that the bounds cut as well."""
    assert_means(uniform_field[Estimator.TRACK_LENGTH], math.pi * AXES)


def test_report_gives_two_thirds_in_every_cell(uniform_field: dict[Estimator, Float64]) -> None:
    """∫ cos²θ dω = 2π/3 where ∫ cos θ dω = π is right."""
    assert_means(uniform_field[Estimator.REPORT], 2 / 3 * math.pi * AXES)


def test_crossing_is_unbiased_in_every_cell(uniform_field: dict[Estimator, Float64]) -> None:
    """The cap of 1/cos θ takes c²/3 of the normal part; tangential parts have long tails, so only all are tested."""
    vectors = uniform_field[Estimator.CROSSING]
    assert_means(np.einsum("...dj,dj->...d", vectors, AXES), math.pi * (1 - GRAZING_COSINE**2 / 3))
    assert_means((vectors * (AXES == 0)).mean(axis=(1, 2, 3)), 0.0)


@pytest.mark.parametrize(("normal", "report"), [((1, 0, 0), 1.0), ((1, 0, -1), 0.5**0.5), ((-1, 1, 1), 3**-0.5)])
@pytest.mark.parametrize("estimator", [Estimator.TRACK_LENGTH, Estimator.CROSSING])
def test_reconstructions_of_a_uniform_field(
    uniform_field: dict[Estimator, Float64], estimator: Estimator, normal: tuple[float, ...], report: float
) -> None:
    """The report's directional interpolation falls to Σ|n_k|³ of E = π: 0.707 and 0.577; least squares is exact."""
    n = np.array(normal) / np.linalg.norm(normal)
    mean = uniform_field[estimator][:, 1:-1, 1:-1, 1:-1].mean(axis=(1, 2, 3))
    truth = math.pi * (1 - GRAZING_COSINE**2 / 3 if estimator is Estimator.CROSSING else 1)
    for directional, share in ((Directional.REPORT, report), (Directional.LEAST_SQUARES, 1.0)):
        assert_means(np.einsum("dj,bdj->b", coefficients(n, directional), mean), share * truth)


# --- Fixed point ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("estimator", Estimator)
@given(pieces=st.lists(st.integers(0, 200), max_size=6), seed=st.integers(0, 5))
@settings(max_examples=15)
def test_sums_have_the_same_bits_however_photons_are_split(estimator: Estimator, pieces: list[int], seed: int) -> None:
    flights = random_flights(200, seed)
    whole = tallied(flights, estimator)
    order = np.random.default_rng(seed).permutation(200)
    bounds = [0, *sorted(pieces), 200]
    total = Tally.empty(LATTICE, estimator, photons=200, bounces=0)
    for start, stop in itertools.pairwise(bounds):
        part = Tally.empty(LATTICE, estimator, photons=200, bounces=0)
        part.deposit(*(np.ascontiguousarray(a[order[start:stop]]) for a in flights))
        total.add(part)
    np.testing.assert_array_equal(total.sums, whole.sums)


@pytest.mark.parametrize("estimator", Estimator)
@given(
    photons=st.integers(1, 10**12),
    bounces=st.integers(1, 1000),
    voxel=st.tuples(*[st.sampled_from([1.0, 0.1, 30.0])] * 3),
)
@settings(max_examples=100)
def test_sums_cannot_overflow(
    estimator: Estimator, photons: int, bounces: int, voxel: tuple[float, float, float]
) -> None:
    """Every flight of every photon along a cell's diagonal, through a vertex, as heavy as can be."""
    lattice = Lattice((0, 0, 0), tuple(4 * h for h in voxel), (4, 4, 4))  # type: ignore[arg-type]
    tally = Tally.empty(lattice, estimator, photons, bounces)
    h = np.array(voxel)
    diagonal = float(np.linalg.norm(h))
    for direction in (h / diagonal, (1.0, GRAZING_COSINE, 0.0), (0.0, 0.0, 1.0)):
        tally.sums[:] = 0
        tally.deposit(*float32([1.5 * h], [direction], [[WEIGHT_LIMIT] * 3], [diagonal]))
        assert np.abs(tally.sums).max() > 0
        assert int(np.abs(tally.sums).max()) * photons * (bounces + 1) < 2**63


def test_fixed_point_is_finer_than_any_noise() -> None:
    """What is cut off a deposit of order one, for as many photons as a day allows: less than one in a million."""
    for estimator in Estimator:
        steps = Tally.empty(LATTICE, estimator, photons=10**9, bounces=12).steps
        largest = 1 / GRAZING_COSINE if estimator is Estimator.CROSSING else 1.0
        assert steps >= 1e6 / largest


@pytest.mark.parametrize("estimator", Estimator)
def test_bytes_are_what_a_tally_takes(estimator: Estimator) -> None:
    assert Tally.bytes(LATTICE, estimator) == Tally.empty(LATTICE, estimator, photons=1, bounces=1).sums.nbytes
