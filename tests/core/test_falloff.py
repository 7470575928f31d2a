# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights that fall off otherwise than with the square of the distance: light in the air, at surfaces, behind panes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core.bake import prepare_course
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.falloff import growth
from ivg_addon.core.light_rules import LightRules
from ivg_addon.core.lights import Lights
from ivg_addon.core.photon_walk import Walk, walk_steps
from ivg_addon.core.progress import finish
from ivg_addon.core.scene import TRANSPARENT, Scene
from ivg_addon.core.settings import BakeSettings

from .lobe_scenes import lobe, with_lobes
from .rooms import beam, box, lamp, quad, scene
from .z_tests import assert_means

Float64 = NDArray[np.float64]

BLACK = (0.0, 0.0, 0.0)
GREY = (0.5, 0.5, 0.5)
SETTINGS = BakeSettings((0, 0, 0), (2, 2, 2), (4, 4, 4), photons=20_000, bounces=4, include_direct=True, seed=3)
TOP = 1.9
DOWN = beam((1, 1, TOP), (0, 0.5, 0), (0.5, 0, 0))
GROUND = quad((0, 0, 0), (2, 0, 0), (0, 2, 0))
KINDS = [(1, 0.0), (2, 0.0), (0, 0.7), (2, 1.5)]


def falling(lights: Lights, power: int, smooth: float) -> Lights:
    """Return the same lights with another falloff."""

    def changed(one: object, count: int) -> object:
        return replace(one, falloff=np.full(count, power, np.int32), smooth=np.full(count, smooth, np.float32))

    return replace(
        lights,
        area=changed(lights.area, len(lights.area.names)),
        point=changed(lights.point, len(lights.point.names)),
    )


def walk(of: Scene, settings: BakeSettings = SETTINGS) -> tuple[Walk, Float64]:
    """Return a walk, and the vectors in watts and metres."""
    lattice = Lattice(settings.bounds_min, settings.bounds_max, settings.resolution)
    course = prepare_course(of, lattice, settings.photons)
    done = finish(walk_steps(course, lattice, settings))
    return done, done.tally.vectors(course.emission.flux_scale / settings.photons)


def batches(of: Scene, first: int = 0, settings: BakeSettings = SETTINGS) -> Float64:
    return np.stack([walk(of, replace(settings, seed=seed))[1] for seed in range(first, first + 16)])


@pytest.mark.parametrize(("power", "smooth"), KINDS)
def test_a_beam_grows_along_its_way(power: int, smooth: float) -> None:
    """A parallel beam of one watt over a quarter of a square metre, in layers of cells: its power is g's mean there."""
    of = scene([GROUND], (BLACK,), lights=falling(DOWN, power, smooth))
    lattice = Lattice(SETTINGS.bounds_min, SETTINGS.bounds_max, SETTINGS.resolution)
    # Light comes from above: E towards +z times the cells' volumes over the layer's height is the beam's power.
    made = np.einsum("bxyzc,xyz->bzc", batches(of)[..., 4, :, 2], lattice.cell_volumes())
    edges = np.array([0.0, 0.25, 0.75, 1.25, 1.75, 2.0])
    truth = []
    for low, high in zip(edges, np.minimum(edges[1:], TOP), strict=False):
        heights = low + (high - low) * (np.arange(1000) + 0.5) / 1000
        truth.append((high - low) * np.mean([growth(TOP - z, power, smooth) for z in heights]))
    assert_means(made, 0.25 * np.array(truth)[:, None])


@pytest.mark.parametrize(("power", "smooth"), KINDS)
def test_a_surface_receives_what_it_should(power: int, smooth: float) -> None:
    """At the end of the beam all photons weigh the same, and nothing is left to chance."""
    of = scene([GROUND], (BLACK,), lights=falling(DOWN, power, smooth))
    done, _ = walk(of)
    lattice = Lattice(SETTINGS.bounds_min, SETTINGS.bounds_max, SETTINGS.resolution)
    flux = prepare_course(of, lattice, 1).emission.flux_scale
    np.testing.assert_allclose(done.absorbed * flux, 0.25 * growth(TOP, power, smooth), rtol=1e-5)


def test_no_photon_weighs_more_than_it_did() -> None:
    of = scene([GROUND], (BLACK,), lights=falling(lamp((1, 1, 1)), 2, 0.0))
    done, _ = walk(of)
    assert done.absorbed.max() < 1.0


def test_panes_change_nothing() -> None:
    """What has passed a clear pane is as far from its light as before; soft falloff is dark on the way, too."""
    soft = lamp((1, 1, 1.6))
    soft = replace(soft, point=replace(soft.point, radius=np.float32([0.4]), soft_falloff=np.array([True])))
    for light in (DOWN, soft):
        of = scene([GROUND], (GREY,), lights=falling(light, 1, 0.5))
        panes = [quad((0, 0, height), (2, 0, 0), (0, 2, 0), 1) for height in (1.4, 0.6)]
        behind = scene([GROUND, *panes], (GREY, BLACK), lights=falling(light, 1, 0.5))
        behind = with_lobes(behind, lobe(TRANSPARENT, material=1))
        assert_means(batches(of) - batches(behind, 100), 0.0)


def test_what_casts_no_shadow_is_lit_by_its_own_distance() -> None:
    """A screen half-way that does not block the light receives g there, the ground g at its own distance."""
    screen = quad((0, 0, 0.9), (2, 0, 0), (0, 2, 0), 1)
    rules = LightRules(np.zeros(2, np.int32), np.array([1, 1], np.uint64), np.array([1, 0], np.uint64))
    of = replace(scene([GROUND, screen], (BLACK, BLACK), lights=falling(DOWN, 1, 0.0)), light_rules=rules)
    lattice = Lattice(SETTINGS.bounds_min, SETTINGS.bounds_max, SETTINGS.resolution)
    flux = prepare_course(of, lattice, 1).emission.flux_scale
    made = [walk(of, replace(SETTINGS, seed=seed))[0].absorbed * flux for seed in range(16)]
    assert_means(made, 0.25 * (TOP + TOP - 0.9))
    bare = scene([GROUND], (BLACK,), lights=falling(DOWN, 1, 0.0))
    assert_means(batches(of) - batches(bare, 100), 0.0)


def test_the_grid_may_lie_anywhere() -> None:
    """In front of the light, and it far away: in a grid of its own the beam has what it has in a large one."""
    of = scene([box((-3, -3, -3), (5, 5, 5), inward=True)], (BLACK,), lights=falling(DOWN, 2, 0.0))
    small = replace(SETTINGS, bounds_min=(0.5, 0.5, -2.0), bounds_max=(1.5, 1.5, -1.0), resolution=(1, 1, 1))
    made = batches(of, settings=small)[..., 4, :, 2].mean(axis=(1, 2, 3))
    heights = -2.0 + (np.arange(1000) + 0.5) / 1000
    assert_means(made, 0.25 * np.mean([growth(TOP - z, 2, 0.0) for z in heights]))
