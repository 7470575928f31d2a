# SPDX-License-Identifier: GPL-3.0-or-later
"""Books of the light that arrives at surfaces: what is not reflected there is absorbed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core.bake import prepare_course
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.photon_walk import Walk, walk_steps
from ivg_addon.core.progress import finish
from ivg_addon.core.scene import TRANSLUCENT, Scene
from ivg_addon.core.settings import BakeSettings
from ivg_addon.core.surface_bins import BACK, FRONT

from .lobe_scenes import lobe, with_lobes
from .rooms import box, lamp, quad, scene

ALBEDO = np.array([0.7, 0.4, 0.1])
SETTINGS = BakeSettings((0, 0, 0), (2, 3, 2.5), (2, 2, 2), photons=20_000, bounces=5, seed=3)
ROUNDING = 1e-6
"""Sums are in steps of 2⁻³⁰, weights in single precision."""


def room() -> Scene:
    return scene([box((0, 0, 0), (2, 3, 2.5), inward=True)], (ALBEDO,), lights=lamp((1.4, 2, 2)))


def walk(of: Scene, settings: BakeSettings) -> Walk:
    lattice = Lattice(settings.bounds_min, settings.bounds_max, settings.resolution)
    return finish(walk_steps(prepare_course(of, lattice, settings.photons), lattice, settings))


def total(of: Walk) -> NDArray[np.float64]:
    return np.asarray(of.received.sum(axis=(0, 1), dtype=np.float64))


def test_what_is_received_and_not_reflected_is_absorbed() -> None:
    everything = walk(room(), replace(SETTINGS, include_direct=True))
    received = total(everything)
    np.testing.assert_allclose(received * (1.0 - ALBEDO), everything.absorbed, rtol=ROUNDING)


def test_direct_light_counts_only_where_the_grid_counts_it() -> None:
    """All photons of a closed room land once before they bounce."""
    everything, indirect = (walk(room(), replace(SETTINGS, include_direct=direct)) for direct in (True, False))
    direct = everything.received.sum(axis=(0, 1), dtype=np.float64) - indirect.received.sum(
        axis=(0, 1), dtype=np.float64
    )
    np.testing.assert_allclose(direct, 1.0, rtol=ROUNDING)
    np.testing.assert_array_equal(everything.bin_counts, indirect.bin_counts)


@pytest.mark.parametrize("flipped", [False, True])
def test_light_is_received_by_the_side_that_it_arrives_at(flipped: bool) -> None:
    """A translucent sheet across a black room lights what is below it, and receives nothing from there."""
    edges = ((0, 3, 0), (2, 0, 0)) if flipped else ((2, 0, 0), (0, 3, 0))
    shell = box((0, 0, 0), (2, 3, 2.5), inward=True)
    black = scene([shell, quad((0, 0, 1), *edges, material=1)], np.zeros((2, 3)), lights=lamp((1, 1.5, 2)))
    of = with_lobes(black, lobe(TRANSLUCENT, 0.8, material=1))
    lattice = Lattice(SETTINGS.bounds_min, SETTINGS.bounds_max, SETTINGS.resolution)
    course = prepare_course(of, lattice, SETTINGS.photons)
    found = finish(walk_steps(course, lattice, replace(SETTINGS, include_direct=True)))
    of_sheet = np.repeat(of.geometry.material == 1, course.bins.divisions[:, 1:].prod(axis=1))
    received, counts = found.received[of_sheet].sum(axis=(0, 2)), found.bin_counts[of_sheet].sum(axis=0)
    lit, unlit = (BACK, FRONT) if flipped else (FRONT, BACK)
    assert received[lit] > 0.3
    assert received[unlit] == 0.0
    assert counts[unlit] > 0
    assert found.received[~of_sheet].sum() > 0.3
