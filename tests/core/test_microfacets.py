# SPDX-License-Identifier: GPL-3.0-or-later
"""GGX facets against the formulas of Walter et al., integrated without their sampling."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core.lobes import _energies
from ivg_addon.core.microfacets import dielectric_reflectance, energy_factor, mean_fresnel_factor, single_albedo
from ivg_addon.core.scene import DIELECTRIC, GLASS, GLOSSY, NONE, REFRACTION, SCHLICK

from .lobe_scenes import Outcome, arriving, lobe, meet, surface, uniform_field
from .z_tests import assert_counts, assert_means

Float64 = NDArray[np.float64]


def smith(cosine: Float64, alpha: float) -> Float64:
    return np.asarray(0.5 * (np.sqrt(1 + alpha**2 * (1 - cosine**2) / cosine**2) - 1))


def ggx(cosine: Float64, alpha: float) -> Float64:
    return np.asarray(alpha**2 / (np.pi * (1 + cosine**2 * (alpha**2 - 1)) ** 2))


def reflectance(cosine: Float64, eta: float) -> Float64:
    """Return Fresnel's equations as Snell's law and two polarisations."""
    inside = np.sqrt(np.maximum(0.0, 1 - (1 - cosine**2) / eta**2))
    s = (cosine - eta * inside) / (cosine + eta * inside)
    p = (eta * cosine - inside) / (eta * cosine + inside)
    return np.asarray(np.where(inside > 0, 0.5 * (s**2 + p**2), 1.0))


def scattered(i: Float64, o: Float64, alpha: float, eta: float | None) -> Float64:
    """Return f(i → o) |cos θ_o| of rough glass (mirror: None), by Walter et al.'s equations 20 and 21, Smith's G₂."""
    up = o[..., 2] > 0
    h = i + o if eta is None else np.where(up[..., None], i + o, -(i + eta * o))
    h = h / np.linalg.norm(h, axis=-1, keepdims=True)
    h = h * np.sign(h[..., 2:])
    ih, oh = (h * i).sum(-1), (h * o).sum(-1)
    hidden = 1 / (1 + smith(i[2], alpha) + smith(o[..., 2], alpha))
    common = ggx(h[..., 2], alpha) * hidden / i[2]
    if eta is None:
        return np.asarray(np.where(up & (ih > 0), common / 4, 0.0))
    f = reflectance(np.abs(ih), eta)
    back = f * common / 4
    through = (1 - f) * common * np.abs(ih * oh) * eta**2 / np.maximum(ih + eta * oh, -np.inf) ** 2
    return np.asarray(np.where(up, np.where(ih > 0, back, 0.0), np.where((ih > 0) & (oh < 0), through, 0.0)))


def sphere_quadrature(bins: int, fine: int) -> tuple[Float64, float]:
    """Return directions (bins·fine, bins·fine, 3) at midpoints of z in (−1, 1) and azimuth, and their solid angle."""
    n = bins * fine
    z, turn = np.meshgrid(2 * (np.arange(n) + 0.5) / n - 1, 2 * np.pi * (np.arange(n) + 0.5) / n, indexing="ij")
    sine = np.sqrt(1 - z**2)
    return np.stack([sine * np.cos(turn), sine * np.sin(turn), z], axis=-1), 4 * np.pi / n**2


def histogram(outcome: Outcome, bins: int) -> NDArray[np.float64]:
    azimuth = np.arctan2(outcome.directions[:, 1], outcome.directions[:, 0]) / (2 * np.pi) % 1
    return np.histogram2d(outcome.directions[:, 2], azimuth, bins=bins, range=((-1, 1), (0, 1)))[0]


@pytest.mark.parametrize("cosine", [0.95, 0.4])
@pytest.mark.parametrize("roughness", [0.6, 1.0])
@pytest.mark.parametrize(("kind", "ior"), [(GLOSSY, None), (GLASS, 1.5), (GLASS, 1 / 1.5)])
def test_photons_go_where_the_brdf_sends_them(kind: int, ior: float | None, roughness: float, cosine: float) -> None:
    """Of photons of weight one, roulette leaves f cos θ_o; compared bin by bin over the sphere, and in total."""
    n, bins, fine = 1 << 18, 16, 24
    of = surface(lobe(kind, roughness=roughness, ior=ior or 1.5))
    outcome = meet(of, arriving(cosine, n), seed=3)
    grid, solid_angle = sphere_quadrature(bins, fine)
    density = scattered(-arriving(cosine, 1)[0], grid, roughness**2, ior) * solid_angle
    expected = density.reshape(bins, fine, bins, fine).sum(axis=(1, 3))
    observed = histogram(outcome, bins)
    assert not observed[expected == 0].any()
    many = expected * n > 20
    # The rest are too few, or absorbed.
    assert_counts(
        np.r_[observed[many], n - observed[many].sum()],
        np.r_[expected[many], 1 - expected[many].sum()],
    )


@pytest.mark.parametrize("roughness", [0.3, 0.7, 1.0])
def test_the_tabulated_share_is_that_of_the_brdf(roughness: float) -> None:
    grid, solid_angle = sphere_quadrature(1, 700)
    for cosine in (0.2, 0.9):
        i = np.array([np.sqrt(1 - cosine**2), 0, cosine])
        for eta in (None, 1.5, 1 / 1.5):
            truth = scattered(i, grid, roughness**2, eta).sum() * solid_angle
            assert single_albedo(cosine, roughness**2, eta or 0.0) == pytest.approx(truth, abs=3e-3)


def test_fresnel() -> None:
    cosines = np.linspace(0.01, 1, 50)
    for eta in (1.5, 1 / 1.5, 2.4):
        values = [dielectric_reflectance(c, eta) for c in cosines]
        np.testing.assert_allclose(values, reflectance(cosines, eta), atol=1e-12)
    assert mean_fresnel_factor(SCHLICK, 1.5) == pytest.approx(1 / 21)
    assert mean_fresnel_factor(NONE, 1.5) == 0.0
    mu = (np.arange(10000) + 0.5) / 10000
    truth = ((reflectance(mu, 1.5) * 2 * mu).mean() - 0.04) / 0.96
    # The fit's own error.
    assert mean_fresnel_factor(DIELECTRIC, 1.5) == pytest.approx(truth, abs=3e-3)


def test_a_mirror_and_smooth_glass_need_no_factor() -> None:
    energy, mean = _energies((0.0, 1.5))
    for table in (0, 1):
        assert energy_factor(energy, mean, table, 0.0, 0.5, 1.0) == pytest.approx(1.0, abs=1e-6)
        # White: all is given back; black: nothing.
        assert energy_factor(energy, mean, table, 1.0, 1.0, 1.0) == pytest.approx(1 / energy[table, -1, -1])
        assert energy_factor(energy, mean, table, 1.0, 1.0, 0.0) == 1.0


# --- White furnaces ---------------------------------------------------------------------------------------------------


def furnace(of: object, batches: int = 32, n: int = 1 << 13, bins: int = 4) -> Float64:
    """Return the light that n photons of a uniform field leave in each of `bins` equal shares of cos² below and above.

    (batches, 2 · bins); in units of that of a uniform field of the same radiance.
    """
    made = []
    for seed in range(batches):
        outcome = meet(of, uniform_field(n, seed), seed)  # type: ignore[arg-type]
        z = outcome.directions[:, 2]
        light = np.histogram(np.sign(z) * z**2, bins=2 * bins, range=(-1, 1), weights=outcome.weights[:, 0])[0]
        made.append(light * bins / n)
    return np.stack(made)


@pytest.mark.parametrize("roughness", [0.0, 0.25, 0.55, 1.0])
def test_a_white_rough_mirror_leaves_a_uniform_field_as_it_was(roughness: float) -> None:
    """Seen from anywhere; the table's 10⁻³ are a fraction of the standard errors."""
    light = furnace(surface(lobe(GLOSSY, roughness=roughness, multiscatter=True)))
    assert_means(light, np.r_[np.zeros(4), np.ones(4)])


@pytest.mark.parametrize("weight", [1.0, 0.4])
def test_what_a_coloured_mirror_gives_back_is_coloured_more_than_once(weight: float) -> None:
    """The lobe's weight in its material is no colour."""
    color, energy, mean = 0.5, *_energies((0.0,))
    light = furnace(surface(lobe(GLOSSY, weight * color, roughness=1.0, multiscatter=True, weight=weight)))
    mu = (np.arange(4000) + 0.5) / 4000
    share = np.interp(mu, np.linspace(0, 1, energy.shape[2]), energy[0, -1])
    truth = weight * color * share * np.array([energy_factor(energy, mean, 0, 1.0, c, color) for c in mu]) * 2 * mu
    bins = np.histogram(mu**2, bins=4, range=(0, 1), weights=truth)[0] * 4 / len(mu)
    assert_means(light[:, 4:], bins)


@pytest.mark.parametrize("roughness", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("ior", [1.5, 1 / 1.5, 1.00001])
def test_white_glass_reflects_and_refracts_all(roughness: float, ior: float) -> None:
    """From light on both sides: each view gets R + T = 1, for Cycles' radiance does not grow in glass."""
    made = []
    for side in (1.0, -1.0):
        of = surface(lobe(GLASS, roughness=roughness, ior=ior if side > 0 else 1 / ior, multiscatter=True))
        made.append(furnace(of)[:, :: int(side)])
    assert_means(made[0] + made[1], 1.0)


def test_single_scattering_loses_what_the_table_says() -> None:
    energy, _ = _energies((0.0,))
    light = furnace(surface(lobe(GLOSSY, roughness=1.0)))
    mu = (np.arange(4000) + 0.5) / 4000
    share = np.interp(mu, np.linspace(0, 1, energy.shape[2]), energy[0, -1])
    assert_means(light[:, 4:].sum(axis=1) / 4, np.mean(2 * mu * share))


def test_light_goes_from_a_to_b_as_from_b_to_a() -> None:
    """A uniform field's transfer between shares of cos² is symmetric: reflection without compensation is reciprocal."""
    differences = []
    for seed in range(32):
        arrival = uniform_field(1 << 13, seed)
        outcome = meet(surface(lobe(GLOSSY, 0.2, 1.0, roughness=0.8, ior=1.5, fresnel=DIELECTRIC)), arrival, seed)
        before, after = arrival[outcome.photons, 2] ** 2, outcome.directions[:, 2] ** 2
        moved = np.histogram2d(before, after, bins=5, range=((0, 1), (0, 1)), weights=outcome.weights[:, 0])[0]
        differences.append((moved - moved.T)[np.triu_indices(5, 1)])
    assert_means(differences, 0.0)


# --- Perfect facets ---------------------------------------------------------------------------------------------------


def test_a_mirror_mirrors() -> None:
    outcome = meet(surface(lobe(GLOSSY)), arriving(0.6, 100))
    assert len(outcome.photons) == 100
    np.testing.assert_allclose(outcome.directions, arriving(0.6, 100) * (1, 1, -1), atol=1e-6)
    np.testing.assert_allclose(outcome.weights, 1.0, atol=1e-6)
    assert (outcome.bounces == 1).all()
    assert (outcome.origins[:, 2] > 0).all()


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_snells_law(side: float) -> None:
    arrival = arriving(side * 0.8, 100)
    outcome = meet(surface(lobe(REFRACTION, ior=1.5)), arrival)
    eta = 1.5 if side > 0 else 1 / 1.5
    assert len(outcome.photons) == 100
    np.testing.assert_allclose(outcome.directions[:, :2], arrival[:, :2] / eta, atol=1e-6)
    assert (side * outcome.directions[:, 2] < 0).all()
    assert (side * outcome.origins[:, 2] < 0).all()
    # Cycles' radiance does not grow in glass, so photons carry less.
    np.testing.assert_allclose(outcome.weights, eta**-2, rtol=1e-6)
    np.testing.assert_allclose(outcome.counts, 1.0)


def test_total_internal_reflection() -> None:
    outcome = meet(surface(lobe(GLASS, ior=1.5)), arriving(-0.6, 100))
    assert len(outcome.photons) == 100
    np.testing.assert_allclose(outcome.directions, arriving(-0.6, 100) * (1, 1, -1), atol=1e-6)
    assert len(meet(surface(lobe(REFRACTION, ior=1.5)), arriving(-0.6, 100)).photons) == 0


@pytest.mark.parametrize("fresnel", [NONE, SCHLICK, DIELECTRIC])
def test_the_mirrors_colour_changes_with_the_angle(fresnel: int) -> None:
    color, second, cosine, n = np.array([0.8, 0.2, 0.1]), np.array([1.0, 0.9, 0.1]), 0.3, 1 << 12
    of = surface(lobe(GLOSSY, color, second, fresnel=fresnel, ior=1.8))
    f = {
        NONE: 0.0,
        SCHLICK: 0.7**5,
        DIELECTRIC: float((reflectance(np.array(cosine), 1.8) - (0.8 / 2.8) ** 2) / (1 - (0.8 / 2.8) ** 2)),
    }[fresnel]
    made = [meet(of, arriving(cosine, n), seed).weights.sum(axis=0) / n for seed in range(16)]
    assert_means(made, color + (second - color) * f)
