# SPDX-License-Identifier: GPL-3.0-or-later
"""Panes that are single faces: what they reflect and let through, and where to."""

from __future__ import annotations

import numpy as np
import pytest

from ivg_addon.core.closures import Caustics
from ivg_addon.core.principled import COSINE_WEIGHTS, COSINES, dielectric_curve
from ivg_addon.core.scene import GLOSSY, PANE, TRANSPARENT
from ivg_addon.core.shade import shade
from ivg_addon.core.surface_bins import BACK, FRONT
from ivg_addon.core.thin_walls import thin_wall

from .lobe_scenes import arriving, lobe, meet, surface, uniform_field
from .test_closures import RED, principled
from .z_tests import assert_means

ONE = np.ones((1, 3))
BATCHES, PHOTONS = 32, 1 << 12


def test_a_clear_pane_reflects_as_both_its_sides_do() -> None:
    """2F/(1 + F) from each direction; the rest goes straight on."""
    pane = principled(Transmission_Weight=(1.0,), Thin_Wall=(1.0,), Base_Color=(1.0, 1.0, 1.0), Roughness=(0.0,))
    mirror, through = shade([pane], [], Caustics()).lobes
    assert (mirror.kind, through.kind) == (GLOSSY, TRANSPARENT)
    fresnel = np.tile(dielectric_curve(1.5)[:, None], 3)
    np.testing.assert_allclose(mirror.color * mirror.view, 2 * fresnel / (1 + fresnel), rtol=1e-3)
    np.testing.assert_allclose(mirror.color * mirror.view + through.color * through.view, 1.0, rtol=1e-3)


def test_a_coloured_pane_absorbs_on_the_way() -> None:
    """By the series of what goes to and fro, for even light."""
    mirror, through = thin_wall(ONE, ONE, np.array([RED]), np.zeros((1, 1)), 1.5, Caustics())
    fresnel = dielectric_curve(1.5)
    inside = np.sqrt(1 - (1 - COSINES**2) / 1.5**2)
    for channel, colour in enumerate(RED):
        once = colour ** (1 / inside)
        passages = [(1 - fresnel) ** 2 * once * (fresnel * once) ** n for n in range(200)]
        passed, returned = sum(passages[0::2]), fresnel + sum(passages[1::2])
        # The steps between which colours are interpolated cost up to 3e-4.
        assert through.color[0, channel] == pytest.approx(COSINE_WEIGHTS @ passed, abs=3e-4)
        assert mirror.color[0, channel] == pytest.approx(COSINE_WEIGHTS @ returned, abs=3e-4)
        np.testing.assert_allclose(through.view[:, channel], passed / (COSINE_WEIGHTS @ passed), rtol=1e-9)


def test_without_caustics_there_is_less() -> None:
    rough = np.full((1, 1), 0.5)
    (mirror, through) = thin_wall(ONE, ONE, ONE, rough, 1.5, Caustics(reflective=False))
    assert not mirror.color.any()
    np.testing.assert_allclose(through.color, COSINE_WEIGHTS @ (1 - dielectric_curve(1.5)) ** 2, rtol=1e-6)
    (mirror, through) = thin_wall(ONE, ONE, ONE, rough, 1.5, Caustics(refractive=False))
    assert not through.color.any()
    np.testing.assert_allclose(mirror.color, COSINE_WEIGHTS @ dielectric_curve(1.5), rtol=1e-6)


def test_rough_panes_blur_what_is_behind_them() -> None:
    (_, through) = thin_wall(ONE, ONE, ONE, np.full((1, 1), 0.5), 1.5, Caustics())
    assert through.kind == PANE
    assert through.roughness[0, 0] ** 2 == pytest.approx(0.25 * np.sqrt(3.4 * 0.5 / 1.5**3))


@pytest.mark.parametrize("cosine", [0.3, 0.9, -0.5])
def test_what_passes_is_a_mirrored_reflection(cosine: float) -> None:
    """On the other side, with the same weights; counted on both sides."""
    of = {kind: surface(lobe(kind, RED, RED, roughness=0.6, multiscatter=True)) for kind in (GLOSSY, PANE)}
    made = {kind: meet(of[kind], arriving(cosine, PHOTONS)) for kind in of}
    np.testing.assert_array_equal(made[PANE].photons, made[GLOSSY].photons)
    np.testing.assert_allclose(made[PANE].directions, made[GLOSSY].directions * (1, 1, -1), atol=1e-6)
    np.testing.assert_allclose(made[PANE].weights, made[GLOSSY].weights, rtol=1e-5)
    alive = len(made[PANE].photons) / PHOTONS
    near, far = (FRONT, BACK) if cosine > 0 else (BACK, FRONT)
    assert made[PANE].counts[near] == 1.0
    assert made[PANE].counts[far] == pytest.approx(alive)


def test_a_white_pane_loses_nothing() -> None:
    """Of even light: what facets keep from each other they give back."""
    of = surface(lobe(PANE, roughness=0.7, multiscatter=True))
    made = [meet(of, uniform_field(PHOTONS, seed), seed).weights.sum(axis=0) / PHOTONS for seed in range(BATCHES)]
    assert np.abs(np.mean(made) - 1.0) < 0.005
    glossy = surface(lobe(GLOSSY, roughness=0.7, multiscatter=True))
    same = [meet(glossy, uniform_field(PHOTONS, 99 + s), 99 + s).weights.sum(axis=0) / PHOTONS for s in range(BATCHES)]
    assert_means(np.stack(made) - np.stack(same), 0.0)
