# SPDX-License-Identifier: GPL-3.0-or-later
"""Sheen: what is seen of it from where, and what it leaves to what lies below."""

from __future__ import annotations

import numpy as np
import pytest

from ivg_addon.core.closures import Caustics, Closure
from ivg_addon.core.principled import COSINE_WEIGHTS, COSINES, Layers, diffuse_share, through_layers, through_sheen
from ivg_addon.core.scene import GLOSSY, MATTE, SHEEN, VIEW_STEPS
from ivg_addon.core.shade import shade
from ivg_addon.core.sheen import sheen_reflectance, sheen_transform

from .lobe_scenes import lobe, meet, surface, uniform_field
from .test_closures import RED, principled
from .z_tests import assert_means

BATCHES, PHOTONS = 32, 1 << 13
COLOUR = np.array([0.9, 0.5, 0.1])

# Radiance of a sphere of white sheen in a white world, seen by an orthographic camera: that is ∫ R 2μ dμ.
# Blender 5.2.3, 64 samples a pixel.
MEASURED = [(0.4, 0.07012), (0.6, 0.17704), (0.8, 0.31302), (1.0, 0.44703)]


@pytest.mark.parametrize("roughness", [0.4, 0.7, 1.0])
def test_of_even_light_each_direction_sees_what_it_should(roughness: float) -> None:
    """The cosine, transformed, is still a distribution: photons of even light leave as the view says, by quarters."""
    steps = np.linspace(0, 1, VIEW_STEPS)
    view = 1.5 * steps
    of = surface(lobe(SHEEN, COLOUR, roughness=roughness, view=view[:, None]))
    made = []
    for seed in range(BATCHES):
        out = meet(of, uniform_field(PHOTONS, seed), seed)
        quarter = np.minimum((4 * out.directions[:, 2] ** 2).astype(int), 3)
        made.append([out.weights[quarter == q].sum(axis=0) / PHOTONS for q in range(4)])
    assert_means(made, np.diff((np.arange(5) / 4) ** 1.5)[:, None] * COLOUR)


@pytest.mark.parametrize("roughness", [0.3, 0.6])
def test_light_and_view_belong_together_as_the_transformation_says(roughness: float) -> None:
    """Views of a cosine's distribution, each with light drawn by the transformation, are what photons are drawn to."""

    def pairs(light: np.ndarray, view: np.ndarray, weight: np.ndarray) -> np.ndarray:
        steep = (light[:, 2] > 0.4).astype(int) + 2 * (view[:, 2] > 0.4)
        back = ((light * view)[:, :2].sum(axis=1) > 0.0).astype(int)
        return np.bincount(2 * steep + back, weights=weight, minlength=8) / PHOTONS

    made = []
    for seed in range(BATCHES):
        arrival = uniform_field(PHOTONS, seed)
        out = meet(surface(lobe(SHEEN, roughness=roughness)), arrival, seed)
        photons = pairs(-arrival[out.photons], out.directions, out.weights[:, 0])
        view, drawn = -uniform_field(PHOTONS, 100 + seed), -uniform_field(PHOTONS, 200 + seed)
        a, b = np.array([sheen_transform(c, roughness) for c in view[:, 2]]).T
        along = view[:, :2] / np.linalg.norm(view[:, :2], axis=1)[:, None]
        x, y, z = drawn[:, 0] - drawn[:, 2] * b, drawn[:, 1], a * drawn[:, 2]
        light = np.column_stack([x * along[:, 0] - y * along[:, 1], x * along[:, 1] + y * along[:, 0], z])
        light /= np.linalg.norm(light, axis=1)[:, None]
        made.append(photons - pairs(light, view, np.ones(PHOTONS)))
    assert_means(made, 0.0)


def test_sheen_lies_over_everything() -> None:
    closure = principled(Sheen_Weight=(0.5,), Sheen_Roughness=(0.6,), Sheen_Tint=RED, Coat_Weight=(0.3,))
    shading = shade([closure], [], Caustics())
    assert [one.kind for one in shading.lobes] == [SHEEN, GLOSSY, MATTE, GLOSSY]
    sheen, coat, matte, _ = shading.lobes
    layers = Layers(sheen=0.5 * max(RED), sheen_roughness=0.6, coat=0.3)
    reflected = sheen_reflectance(COSINES, 0.6)
    np.testing.assert_allclose(sheen.color * sheen.view, 0.5 * np.outer(reflected, RED), rtol=1e-3)
    np.testing.assert_allclose(through_sheen(layers)[:, 0], 1 - 0.5 * max(RED) * reflected)
    np.testing.assert_allclose(coat.color * coat.view, np.tile(0.3 * 0.04 * through_sheen(layers), 3), rtol=1e-9)
    np.testing.assert_allclose(matte.color * matte.view, RED * through_layers(layers), rtol=1e-9)
    np.testing.assert_allclose(shading.albedo[0], diffuse_share(layers) * RED, rtol=1e-9)


def test_without_roughness_there_is_none() -> None:
    shading = shade([Closure("SHEEN", {"Color": RED, "Roughness": (0.0,)})], [], Caustics())
    assert shading.total().max() < 1e-3


@pytest.mark.parametrize(("roughness", "measured"), MEASURED)
def test_reflects_what_cycles_does(roughness: float, measured: float) -> None:
    assert COSINE_WEIGHTS @ sheen_reflectance(COSINES, roughness) == pytest.approx(measured, rel=0.015)
