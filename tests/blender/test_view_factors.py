# SPDX-License-Identifier: GPL-3.0-or-later
"""Mixes by Fresnel become factors of the direction in which light leaves."""

from __future__ import annotations

import numpy as np

from ivg_addon.core.principled import COSINE_WEIGHTS, COSINES
from ivg_addon.core.scene import GLOSSY, MATTE, REFRACTION, VIEW_STEPS
from tests.blender.evaluation_scenes import evaluated_scene, hills
from tests.blender.export_scenes import empty_scene, new_material
from tests.blender.export_trees import RED, Build, pair, said, shader, surface


def show(build: Build) -> None:
    empty_scene()
    hills(new_material("Tested", build))


def reflectance(eta: float) -> np.ndarray:
    """Return Fresnel's of a dielectric at `COSINES`, by Snell's law."""
    cosine = COSINES
    inside = np.sqrt(np.maximum(0.0, 1 - (1 - cosine**2) / eta**2))
    across = (cosine - eta * inside) / (cosine + eta * inside)
    along = (eta * cosine - inside) / (eta * cosine + inside)
    return 0.5 * (across**2 + along**2)


def tabulated(values: np.ndarray) -> np.ndarray:
    """Return what is known at `COSINES` at the steps of a view, (VIEW_STEPS, 1)."""
    return np.interp(np.linspace(0, 1, VIEW_STEPS), COSINES, values)[:, None]


def test_a_mix_by_fresnel_is_a_factor_of_the_direction_of_view() -> None:
    glossy, matt = shader("BsdfGlossy", Roughness=0.2), shader("BsdfDiffuse", Color=RED, Roughness=0.0)
    show(surface(pair("MixShader", matt, glossy, shader("Fresnel", IOR=1.45))))
    scene = evaluated_scene()
    lobes = scene.materials.lobes
    for side, eta in ((0, 1.45), (1, 1 / 1.45)):
        rows = np.flatnonzero(lobes.material == side)
        assert lobes.kind[rows].tolist() == [MATTE, GLOSSY]
        curve = reflectance(eta)
        for row, share in zip(rows, (1 - curve, curve), strict=True):
            own = np.array(RED) if lobes.kind[row] == MATTE else np.full(3, 0.8)
            np.testing.assert_allclose(lobes.color[row] * lobes.view[row], own * tabulated(share), atol=1e-5)
        left = 1 - COSINE_WEIGHTS @ curve
        np.testing.assert_allclose(scene.materials.albedo[side], left * np.array(RED), rtol=1e-5)
    assert said(scene) == []


def test_refraction_and_gloss_by_fresnel_share_the_light() -> None:
    through_it, over = shader("BsdfRefraction", IOR=1.5, Roughness=0.0), shader("BsdfGlossy", Roughness=0.0)
    show(surface(pair("MixShader", through_it, over, shader("Fresnel", IOR=1.5))))
    lobes = evaluated_scene().materials.lobes
    for side, eta in ((0, 1.5), (1, 1 / 1.5)):
        rows = np.flatnonzero(lobes.material == side)
        assert lobes.kind[rows].tolist() == [REFRACTION, GLOSSY]
        glossy = lobes.color[rows[1]] * lobes.view[rows[1]] / 0.8
        np.testing.assert_allclose(glossy, np.tile(tabulated(reflectance(eta)), 3), atol=1e-5)
        np.testing.assert_allclose(lobes.color[rows[0]] * lobes.view[rows[0]] + glossy, 1.0, rtol=1e-5)
