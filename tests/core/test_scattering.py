# SPDX-License-Identifier: GPL-3.0-or-later
"""A photon meets a surface: where it goes, what it carries on, and that no energy is lost in the books."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core.embree import MISS
from ivg_addon.core.landings import Landings
from ivg_addon.core.lobe_scattering import scatter_at_lobes
from ivg_addon.core.scattering import ABSORBED, CUT, ENERGY_STEPS, ESCAPED, scatter
from ivg_addon.core.scene import Scene
from ivg_addon.core.surface_bins import BACK, FRONT, SurfaceBins
from ivg_addon.core.surfaces import Surfaces
from ivg_addon.core.tally import WEIGHT_LIMIT

from .rooms import Part, scene
from .z_tests import assert_counts, assert_means

Float64 = NDArray[np.float64]

NORMAL = np.array([2.0, -1.0, 2.0]) / 3.0
"""Of the triangle that photons meet, front side."""


def triangle(shading: Float64 | None = None, visible: bool = True) -> Part:
    """Return a triangle across `NORMAL`, with one shading normal all over."""
    u = np.cross(NORMAL, [1.0, 0.0, 0.0])
    u /= np.linalg.norm(u)
    corners = np.array([1.0, 2.0, 3.0]) + np.stack([0 * u, u, np.cross(NORMAL, u)])
    normals = None if shading is None else np.broadcast_to(shading, (1, 3, 3))
    return Part(corners, np.array([[0, 1, 2]]), corner_normals=normals, visible=visible)


@dataclass(frozen=True)
class Outcome:
    """What became of n photons; energies (3, 3) per photon, by row and channel."""

    photons: NDArray[np.int64]
    origins: Float64
    directions: Float64
    weights: Float64
    energy: Float64
    bin_counts: NDArray[np.int32]


def meet(of: Scene, directions: Float64, weights: Float64, seed: int = 0, last: bool = False, hit: int = 0) -> Outcome:
    """Let photons arrive at random points of the triangle."""
    n = len(directions)
    u, v = np.sort(np.random.default_rng(seed).random((2, n)), axis=0).astype(np.float32)
    u, v = u, v - u
    bins = SurfaceBins.of(of.geometry, 0.3)
    photons = np.arange(n, dtype=np.int64)
    flights = [np.ascontiguousarray(a, dtype=np.float32) for a in (np.zeros((n, 3)), directions, weights)]
    landings, energy = Landings(bins), np.zeros((3, 3), dtype=np.int64)
    landed, brought = np.empty(2 * n, dtype=np.int64), np.empty((2 * n, 3), dtype=np.float32)
    hits = (np.full(n, hit, dtype=np.int32), u, v)
    bounces, dark = np.ones(n, dtype=np.int16), np.zeros(n, dtype=np.float32)
    most, waiting = 1 if last else 2, np.empty((n, 2), dtype=np.int32)
    state = (bounces, dark, np.ones(1, dtype=np.float32))
    sums = (1, landed, brought, energy, waiting)
    rest = (photons, *flights, *state, *hits, seed, 1, most, Surfaces.of(of, bins), *sums)
    alive, arrivals = scatter_at_lobes(*rest, *scatter(*rest))
    landings.receive(landed[:arrivals], brought[:arrivals])
    assert (bounces[:alive] == 2).all()
    o, d, w = (a[:alive].astype(np.float64) for a in flights)
    return Outcome(photons[:alive], o, d, w, energy / (ENERGY_STEPS * n), landings.counts)


def arriving(n: int, seed: int, side: float = 1.0) -> Float64:
    """Return directions of photons that a uniform field sends to the front (or −1, the back): cosine-distributed."""
    rng = np.random.default_rng(seed)
    sin, phi = np.sqrt(rng.random(n)), 2 * math.pi * rng.random(n)
    x = np.cross(NORMAL, [0.0, 1.0, 0.0])
    x /= np.linalg.norm(x)
    y = np.cross(NORMAL, x)
    towards = (
        np.sqrt(1 - sin**2)[:, None] * NORMAL + (sin * np.cos(phi))[:, None] * x + (sin * np.sin(phi))[:, None] * y
    )
    return np.asarray(-side * towards)


def white(n: int) -> Float64:
    return np.ones((n, 3))


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_photons_leave_by_the_cosine_law_on_the_side_they_came_from(side: float) -> None:
    n = 1 << 17
    outcome = meet(scene([triangle()], albedo=(1, 1, 1)), arriving(n, 1, side), white(n))
    assert len(outcome.photons) == n
    cosine = outcome.directions @ (side * NORMAL)
    x = np.cross(NORMAL, [0.0, 1.0, 0.0])
    x /= np.linalg.norm(x)
    azimuth = np.arctan2(outcome.directions @ np.cross(NORMAL, x), outcome.directions @ x) / (2 * math.pi) % 1
    assert (cosine > 0).all()
    assert_counts(np.histogram2d(cosine**2, azimuth, bins=16, range=((0, 1), (0, 1)))[0], 1 / 256)
    # They start right above the surface: the plane through (1, 2, 3).
    above = (outcome.origins - [1.0, 2.0, 3.0]) @ (side * NORMAL)
    assert (above > 0).all()
    assert above.max() < 1e-5


def test_weights_are_reflected_in_expectation() -> None:
    """Russian roulette: what survives carries ρ w on average, in each channel."""
    albedo, weight, n = np.array([0.8, 0.3, 0.05]), np.array([0.5, 1.0, 0.2]), 1 << 13
    room = scene([triangle()], albedo=albedo)
    reflected, surviving = [], []
    for seed in range(32):
        outcome = meet(room, arriving(n, seed), np.tile(weight, (n, 1)), seed)
        reflected.append(outcome.weights.sum(axis=0) / n)
        surviving.append(len(outcome.photons) / n)
        # The books: what is not reflected was absorbed, to the rounding of the weights.
        np.testing.assert_allclose(outcome.energy[ABSORBED], weight * (1 - albedo), atol=1e-6)
        assert not outcome.energy[[ESCAPED, CUT]].any()
        # Weights stay of order one: the largest channel is 1 after roulette.
        np.testing.assert_allclose(outcome.weights.max(axis=1), 1.0, rtol=1e-6)
    assert_means(reflected, weight * albedo)
    assert_means(surviving, (weight * albedo).max())


def test_after_the_last_bounce_energy_is_cut() -> None:
    n = 1000
    outcome = meet(scene([triangle()], albedo=(0.8, 0.3, 0.0)), arriving(n, 0), white(n), last=True)
    assert len(outcome.photons) == 0
    np.testing.assert_allclose(outcome.energy[CUT], [0.8, 0.3, 0.0], atol=1e-6)
    np.testing.assert_allclose(outcome.energy.sum(axis=0), 1.0, atol=1e-6)


def test_what_hits_nothing_escapes() -> None:
    outcome = meet(scene([triangle()]), arriving(1000, 0), 0.25 * white(1000), hit=MISS)
    assert len(outcome.photons) == 0
    np.testing.assert_allclose(outcome.energy[ESCAPED], 0.25, atol=1e-6)
    assert not outcome.bin_counts.any()


def test_what_diffuse_rays_do_not_see_absorbs_all() -> None:
    outcome = meet(scene([triangle(visible=False)], albedo=(1, 1, 1)), arriving(1000, 0), white(1000))
    assert len(outcome.photons) == 0
    np.testing.assert_allclose(outcome.energy[ABSORBED], 1.0, atol=1e-6)


@pytest.mark.parametrize(("side", "column"), [(1.0, FRONT), (-1.0, BACK)])
def test_every_photon_is_counted_on_its_side(side: float, column: int) -> None:
    n = 20_000
    outcome = meet(scene([triangle()]), arriving(n, 0, side), white(n))
    received = outcome.bin_counts[:, column]
    assert received.sum() == n
    assert not outcome.bin_counts[:, 1 - column].any()
    # Points were uniform over the triangle, whose patches are whole or, on the long edge, half.
    d = round(math.sqrt(len(received)))
    a, b = np.divmod(np.arange(d * d), d)
    shares = np.where(a + b < d - 1, 2, np.where(a + b == d - 1, 1, 0)) / d**2
    assert_counts(received[shares > 0], shares[shares > 0])


def test_survivors_keep_their_number_and_order() -> None:
    n = 5000
    outcome = meet(scene([triangle()], albedo=(0.4, 0.4, 0.4)), arriving(n, 0), white(n))
    assert 0 < len(outcome.photons) < n
    assert (np.diff(outcome.photons) > 0).all()


# --- Shading normals --------------------------------------------------------------------------------------------------


def expected_reflection(angle: float, limit: float = WEIGHT_LIMIT) -> float:
    """Return ∫ min(cos θ_s / cos θ_g, limit) cos θ_g / π dω over the front hemisphere, by the midpoint rule.

    Without the limit it is (1 + cos α)/2 for shading normals turned by α.
    """
    n = 2000
    z, phi = np.meshgrid((np.arange(n) + 0.5) / n, (np.arange(n) + 0.5) / n * math.pi, indexing="ij")
    cos_s = math.cos(angle) * z + math.sin(angle) * np.sqrt(1 - z * z) * np.cos(phi)
    value = np.minimum(np.maximum(cos_s, 0.0), limit * z)
    return float(value.mean() * 2.0)


def tilted(angle: float) -> Float64:
    x = np.cross(NORMAL, [0.0, 0.0, 1.0])
    return np.asarray(math.cos(angle) * NORMAL + math.sin(angle) * x / np.linalg.norm(x))


def test_the_quadrature_knows_the_closed_form() -> None:
    for angle in (0.0, 0.3, 0.8):
        assert expected_reflection(angle, math.inf) == pytest.approx((1 + math.cos(angle)) / 2, abs=1e-5)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("angle", [0.05, 0.4, 1.0])
def test_shading_normals_reflect_what_they_are_lit_with(side: float, angle: float) -> None:
    """In a uniform field the surface is lit by ∫ max(0, ω·s) dω, and sends that out by the cosine law around g."""
    n = 1 << 14
    room = scene([triangle(tilted(angle))], albedo=(1, 0.5, 0.25))
    outcomes = [meet(room, arriving(n, seed, side), white(n), seed) for seed in range(32)]
    reflected = expected_reflection(angle) * np.array([1, 0.5, 0.25])
    assert_means([outcome.weights.sum(axis=0) / n for outcome in outcomes], reflected)
    assert_means([outcome.energy[ABSORBED] for outcome in outcomes], 1 - reflected)
    assert max(outcome.weights.max() for outcome in outcomes) <= WEIGHT_LIMIT * (1 + 1e-6)
    assert (outcomes[0].directions @ (side * NORMAL) > 0).all()


def test_light_behind_the_shading_normal_is_not_reflected() -> None:
    """A photon that arrives in front of the surface, but behind its shading normal."""
    n = 100
    towards = tilted(-1.2)
    outcome = meet(scene([triangle(tilted(1.0))], albedo=(1, 1, 1)), np.tile(-towards, (n, 1)), white(n))
    assert len(outcome.photons) == 0
    np.testing.assert_allclose(outcome.energy[ABSORBED], 1.0, atol=1e-6)
