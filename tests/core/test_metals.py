# SPDX-License-Identifier: GPL-3.0-or-later
"""Metals: how their curves differ from Schlick's, and that photons follow them."""

from __future__ import annotations

import numpy as np
import pytest

from ivg_addon.core.closures import Caustics, Closure
from ivg_addon.core.metals import conductor_edge, conductor_reflectance, tinted_edge
from ivg_addon.core.microfacets import MEAN_EDGE, edge_factor
from ivg_addon.core.principled import COSINE_WEIGHTS, COSINES
from ivg_addon.core.scene import GLOSSY, SCHLICK
from ivg_addon.core.shade import shade

from .lobe_scenes import arriving, lobe, meet, surface, uniform_field
from .test_closures import RED
from .z_tests import assert_means

BASE, TINT = np.array([[0.8, 0.5, 0.1]]), np.array([[0.0, 0.5, 1.0]])
GOLD, SILICON = (0.18, 3.4), (3.9, 0.02)
BATCHES, PHOTONS = 32, 1 << 12


def curve(cosine: float) -> np.ndarray:
    """Return F of base and tint, (3,)."""
    schlick = BASE[0] + (1 - BASE[0]) * (1 - cosine) ** 5
    return schlick - tinted_edge(BASE, TINT) * edge_factor(cosine)


def test_the_tint_is_what_is_left_of_schlick_at_the_rim() -> None:
    rim = 1 / 7
    schlick = BASE[0] + (1 - BASE[0]) * (1 - rim) ** 5
    np.testing.assert_allclose(curve(rim), TINT[0] * schlick, atol=1e-12)
    np.testing.assert_allclose(curve(1.0), BASE[0])


def test_mean_of_the_dip() -> None:
    """∫ μ (1 − μ)⁶ 2μ dμ = 2 · 2! 6! / 9!."""
    assert COSINE_WEIGHTS @ np.array([edge_factor(c) for c in COSINES]) == pytest.approx(MEAN_EDGE, rel=1e-9)


@pytest.mark.parametrize("cosine", [0.15, 0.3, 0.9])
def test_a_mirror_reflects_by_its_curve(cosine: float) -> None:
    of = surface(lobe(GLOSSY, BASE[0], 1.0, fresnel=SCHLICK, edge=tinted_edge(BASE, TINT)))
    made = [meet(of, arriving(cosine, PHOTONS), seed).weights.sum(axis=0) / PHOTONS for seed in range(BATCHES)]
    assert_means(made, np.maximum(curve(cosine), 0.0))


def test_weights_scale_the_whole_curve() -> None:
    """Under another lobe, and by a texture that is a mask, base and edge shrink together."""
    closure = Closure("METALLIC", {"Color": RED, "Edge Tint": (0.2, 0.3, 0.4), "Roughness": (0.0,)})
    (metal,) = shade([closure], [], Caustics()).lobes
    half = metal.scaled(np.full((1, 3), 0.5))
    for one, share in ((metal, 1.0), (half, 0.5)):
        of = surface(lobe(GLOSSY, one.color[0], one.second[0], fresnel=SCHLICK, edge=one.edge))
        made = [meet(of, uniform_field(PHOTONS, seed), seed).weights.sum(axis=0) / PHOTONS for seed in range(BATCHES)]
        assert_means(made, one.albedo()[0])
        np.testing.assert_allclose(one.albedo(), share * metal.albedo())


@pytest.mark.parametrize(("n", "k"), [GOLD, SILICON])
def test_a_conductor_reflects_what_fresnels_equations_say(n: float, k: float) -> None:
    """At normal incidence and of all light together."""
    index, extinction = np.full((1, 3), n), np.full((1, 3), k)
    exact = conductor_reflectance(COSINES, index, extinction)[:, 0, 0]
    normal = abs((n + 1j * k - 1) / (n + 1j * k + 1)) ** 2
    fitted = normal + (1 - normal) * (1 - COSINES) ** 5
    fitted -= conductor_edge(index, extinction)[0] * np.array([edge_factor(c) for c in COSINES])
    assert COSINE_WEIGHTS @ fitted == pytest.approx(COSINE_WEIGHTS @ exact, rel=1e-9)
    assert np.abs(fitted - exact).max() < 0.06, "about the same at each angle"
    np.testing.assert_allclose(conductor_reflectance(np.ones(1), index, extinction), normal)


def test_a_conductor_that_absorbs_nothing_is_a_dielectric() -> None:
    sine = np.sqrt(1 - COSINES**2)
    inside = np.sqrt(1 - (sine / 1.5) ** 2)
    across = ((COSINES - 1.5 * inside) / (COSINES + 1.5 * inside)) ** 2
    along = ((1.5 * COSINES - inside) / (1.5 * COSINES + inside)) ** 2
    found = conductor_reflectance(COSINES, np.full((1, 3), 1.5), np.zeros((1, 3)))
    np.testing.assert_allclose(found[:, 0, 0], 0.5 * (across + along), rtol=1e-9)
