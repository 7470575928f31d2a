# SPDX-License-Identifier: GPL-3.0-or-later
"""Diffuse reflection that is rough, or depends on the direction of view, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ivg_addon.core.matte import rough_diffuse
from ivg_addon.core.principled import oren_nayar_share
from ivg_addon.core.scattering import ABSORBED
from ivg_addon.core.scene import GLOSSY, MATTE, TRANSLUCENT, TRANSPARENT, VIEW_STEPS

from .lobe_scenes import arriving, lobe, meet, plate, surface, uniform_field
from .rooms import scene
from .z_tests import assert_means

COLOUR = np.array([0.9, 0.5, 0.1])
BATCHES, PHOTONS = 32, 1 << 12
LINEAR = 1.5 * np.linspace(0.0, 1.0, VIEW_STEPS)[:, None]
"""A view that grows with the cosine μ; ∫ 1.5 μ 2μ dμ = 1."""


@pytest.mark.parametrize("roughness", [0.3, 1.0])
@pytest.mark.parametrize("cosine", [0.05, 0.5, 1.0])
def test_a_white_rough_surface_reflects_all_light(roughness: float, cosine: float) -> None:
    """From any direction: what facets keep from each other they send out in the end."""
    white = surface(lobe(MATTE, 1.0, 1.0, roughness=roughness))
    made = [meet(white, arriving(cosine, PHOTONS), seed).weights.sum(axis=0) / PHOTONS for seed in range(BATCHES)]
    assert_means(made, 1.0)


@pytest.mark.parametrize("roughness", [0.4, 1.0])
def test_a_rough_surface_reflects_its_share_of_even_light(roughness: float) -> None:
    coloured = surface(lobe(MATTE, 0.8 * COLOUR, COLOUR, roughness=roughness))
    made = [meet(coloured, uniform_field(PHOTONS, seed), seed) for seed in range(BATCHES)]
    truth = 0.8 * COLOUR * oren_nayar_share(COLOUR, roughness)
    assert_means([each.weights.sum(axis=0) / PHOTONS for each in made], truth)
    assert_means([each.energy[ABSORBED] for each in made], 1.0 - truth)


def test_a_rough_surface_sends_light_back_where_it_came_from() -> None:
    """Below μ = 0.3, single scattering of a dark one: A + B t, t averaged over each half of the azimuths."""
    cosine, roughness = 0.1, 1.0
    dark = surface(lobe(MATTE, 1.0, 0.0, roughness=roughness))
    arrival = arriving(cosine, PHOTONS)
    made = []
    for seed in range(BATCHES):
        out = meet(dark, arrival, seed)
        low = out.directions[:, 2] < 0.3
        back = out.directions[:, :2] @ arrival[0, :2] < 0.0
        made.append([out.weights[low & side, 0].sum() / PHOTONS for side in (back, ~back)])
    a = math.pi / (math.pi + roughness * (math.pi / 2 - 2 / 3))
    n = 400
    mu, angle = np.meshgrid(0.3 * (np.arange(n) + 0.5) / n, math.pi * ((np.arange(n) + 0.5) / n - 0.5))
    t = np.sqrt((1 - cosine**2) * (1 - mu**2)) * np.cos(angle)
    share = [(a + roughness * a * each) * mu for each in (t / np.maximum(mu, cosine), -t)]
    assert_means(made, [0.3 * each.mean() for each in share])


def test_light_may_go_either_way() -> None:
    for x, y, between in ((0.2, 0.9, 0.5), (0.7, 0.3, -0.2)):
        assert rough_diffuse(x, y, between, 0.7, 0.8) == pytest.approx(rough_diffuse(y, x, between, 0.7, 0.8))


def test_no_roughness_is_a_cosine() -> None:
    smooth = surface(lobe(MATTE, COLOUR, COLOUR))
    plain = scene([plate()], (COLOUR,))
    made = [
        np.subtract(*(meet(of, arriving(0.6, PHOTONS), seed).weights.sum(axis=0) for of in (smooth, plain)))
        for seed in range(BATCHES)
    ]
    assert_means(np.stack(made) / PHOTONS, 0.0)


@pytest.mark.parametrize("kind", [MATTE, TRANSLUCENT])
def test_what_is_seen_of_a_lobe_depends_on_the_direction(kind: int) -> None:
    """In quarters of μ²: ∫ 1.5 μ 2μ dμ = [μ³]."""
    of = surface(lobe(kind, COLOUR, view=LINEAR * (1.0, 1.0, 0.0)))
    made = []
    for seed in range(BATCHES):
        out = meet(of, uniform_field(PHOTONS, seed), seed)
        quarter = np.minimum((4 * out.directions[:, 2] ** 2).astype(int), 3)
        made.append([out.weights[quarter == q].sum(axis=0) / PHOTONS for q in range(4)])
    shares = np.diff((np.arange(5) / 4) ** 1.5)
    assert_means(made, shares[:, None] * COLOUR * (1.0, 1.0, 0.0))


@pytest.mark.parametrize("kind", [GLOSSY, TRANSPARENT])
def test_mirrors_and_panes_are_seen_from_the_angle_of_arrival(kind: int) -> None:
    made = [
        meet(surface(lobe(kind, COLOUR, view=LINEAR)), arriving(0.4, PHOTONS), seed).weights.sum(axis=0) / PHOTONS
        for seed in range(BATCHES)
    ]
    assert_means(made, 0.6 * COLOUR)


def test_the_shading_normal_decides() -> None:
    """Light that leaves at a cosine to the shading normal s is seen at that; the adjoint's factor is |i·s|/|i·g|."""
    tilt = (math.sin(0.3), 0.0, math.cos(0.3))
    of = surface(lobe(MATTE, 1.0, view=LINEAR), shading=tilt)
    arrival = arriving(0.6, PHOTONS)
    lit = -arrival[0] @ tilt / 0.6
    seen = []
    for seed in range(BATCHES):
        out = meet(of, arrival, seed)
        seen.append(out.weights[:, 0].sum() / PHOTONS)
    # ∫ 1.5 max(0, o·s) |o·g| / π do, by quadrature.
    n = 1000
    z, angle = np.meshgrid((np.arange(n) + 0.5) / n, 2 * math.pi * (np.arange(n) + 0.5) / n)
    along = np.maximum(0.0, np.sqrt(1 - z**2) * np.cos(angle) * tilt[0] + z * tilt[2])
    assert_means(seen, lit * (1.5 * along * 2 * z).mean())
