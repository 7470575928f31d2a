# SPDX-License-Identifier: GPL-3.0-or-later
"""The pilot finds the window, and the grid is the same whether photons are aimed or not, but for its noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ivg_addon.core.aim import aim_steps
from ivg_addon.core.bake import bake, prepare_course
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.emission.division import Leaf, divide, mean_merit
from ivg_addon.core.emission.guide import NUMBERS
from ivg_addon.core.lights import Lights, SunLights
from ivg_addon.core.photon_walk import walk_steps
from ivg_addon.core.progress import finish
from ivg_addon.core.scene import Scene
from ivg_addon.core.settings import BakeSettings

from .emission_checks import array
from .rooms import Part, box, lamp, quad, scene, sky
from .z_tests import assert_means

SETTINGS = BakeSettings((0, 0, 0), (4, 4, 3), (2, 2, 2), photons=1 << 18, threads=2, lit_points=0)
LATTICE = Lattice(SETTINGS.bounds_min, SETTINGS.bounds_max, SETTINGS.resolution)


def room(side: float = 0.8) -> list[Part]:
    """Return a room with a square window to the east, by its walls."""
    t, y0, y1, z0, z1 = 0.2, 2 - side / 2, 2 + side / 2, 1.5 - side / 2, 1.5 + side / 2
    e = 4 + t
    walls = [((-t, -t, -t), (e, e, 0)), ((-t, -t, 3), (e, e, 3 + t)), ((-t, -t, 0), (0, e, 3)), ((0, -t, 0), (e, 0, 3))]
    east = [((4, 0, 0), (e, y0, 3)), ((4, y1, 0), (e, 4, 3)), ((4, y0, 0), (e, y1, z0)), ((4, y0, z1), (e, y1, 3))]
    return [box(*corners) for corners in [*walls, ((0, 4, 0), (e, e, 3)), *east]]


def sunny(parts: list[Part]) -> Scene:
    """Light with a sky and a sun that shines through the window."""
    sun = SunLights(("Sun",), array((-0.8, 0.0, -0.6)), array(0.01), array((3, 2, 1)))
    return scene(parts, lights=replace(sky((0.2, 0.3, 0.5)), sun=sun))


def irradiance(of: Scene, seed: int, aimed: bool, settings: BakeSettings = SETTINGS) -> np.ndarray:
    """Return the sums of one walk as irradiance towards the axes, (cells, 6, 3)."""
    settings = replace(settings, seed=seed)
    course = prepare_course(of, LATTICE, settings.photons)
    if aimed:
        course, aim = finish(aim_steps(course, LATTICE, settings))
        assert aim is not None
        assert aim.gain > 1.1
    walk = finish(walk_steps(course, LATTICE, settings))
    vectors = walk.tally.vectors(course.emission.flux_scale / settings.photons)
    return np.abs(vectors[..., np.arange(6), :, np.arange(6) // 2]).reshape(6, -1, 3)


@pytest.mark.parametrize(("ground", "gain"), [(False, 5.0), (True, 1.0)], ids=["alone", "on ground"])
def test_aimed_photons_bring_the_same_light_with_less_noise(ground: bool, gain: float) -> None:
    """Plain and aimed bakes are tested against each other: the difference of two independent ones has mean zero."""
    of = sunny([*room(), *([quad((-16, -16, -1), (40, 0, 0), (0, 40, 0))] if ground else [])])
    settings = replace(SETTINGS, include_direct=True, photons=1 << 19)
    plain = np.array([irradiance(of, seed, False, settings) for seed in range(16)])
    aimed = np.array([irradiance(of, 100 + seed, True, settings) for seed in range(16)])
    # Sums over the grid: enough photons that a mean of bakes is normal.
    assert_means((plain - aimed).mean(axis=2), np.zeros((6, 3)))
    assert gain * aimed.var(axis=0, ddof=1).sum() < plain.var(axis=0, ddof=1).sum()


def test_pilot_tells_how_many_photons_are_of_use() -> None:
    course = prepare_course(sunny(room()), LATTICE, SETTINGS.photons)
    _, aim = finish(aim_steps(course, LATTICE, SETTINGS))
    assert aim is not None
    assert aim.photons <= SETTINGS.photons / 12
    assert aim.useful_without < 0.02
    assert aim.useful > 5 * aim.useful_without


def test_same_seed_aims_the_same_for_any_number_of_threads() -> None:
    grids = [bake(sunny(room()), replace(SETTINGS, threads=threads)).grid.vectors for threads in (1, 3)]
    np.testing.assert_array_equal(*grids)


def test_nothing_is_aimed_where_nothing_is_gained() -> None:
    """Lamps alone need no pilot; under an open sky, everything that meets the ground is of use."""
    course = prepare_course(scene(room(), lights=lamp((2, 2, 2))), LATTICE, SETTINGS.photons)
    assert finish(aim_steps(course, LATTICE, SETTINGS)) == (course, None)
    few = replace(SETTINGS, photons=1000)
    course = prepare_course(sunny(room()), LATTICE, few.photons)
    assert finish(aim_steps(course, LATTICE, few)) == (course, None)


def test_lamp_in_the_room_gets_its_share() -> None:
    """A lamp of a thousandth of the sky's power gives most of the room's light."""
    of = sunny(room(0.3))
    bulb = replace(of, lights=Lights(world=of.lights.world, sun=of.lights.sun, point=lamp((2, 2, 2), [0.5] * 3).point))
    course = prepare_course(bulb, LATTICE, SETTINGS.photons)
    aimed, _ = finish(aim_steps(course, LATTICE, SETTINGS))
    plain_share = course.emission.strengths[0] / course.emission.flux_scale
    aimed_share = aimed.emission.emitters.cumulative[0] / aimed.emission.flux_scale
    assert plain_share < 0.01
    assert aimed_share > 10 * plain_share


def test_division_finds_a_window() -> None:
    """Photons of use lie in a box of two of the five numbers: leaves follow it, whatever the other three."""
    rng = np.random.default_rng(4)
    leaf = Leaf.whole()
    numbers = rng.random((200_000, NUMBERS))
    inside = (np.abs(numbers[:, 1] - 0.5) < 0.0625) & (np.abs(numbers[:, 3] - 0.25) < 0.0625)
    leaf.add(numbers, inside.astype(float))
    leaves = divide([leaf], 1.0)
    volumes = np.array([one.volume for one in leaves])
    means = np.array([one.merit.mean() for one in leaves])
    assert volumes.sum() == pytest.approx(1.0)
    assert sum(len(one.merit) for one in leaves) == len(numbers)
    # √E[m] of the window is 1 and its volume 1/64: a perfect division costs no more than that.
    assert volumes @ np.sqrt(means) < 1.05 / 64
    assert len(leaves) < 20


def test_division_leaves_noise_alone() -> None:
    """Three photons in ten are of use everywhere: cuts would follow chance. 75 cuts at 4 σ are considered."""
    rng = np.random.default_rng(4)
    leaf = Leaf.whole()
    leaf.add(rng.random((50_000, NUMBERS)), (rng.random(50_000) < 0.3).astype(float))
    assert len(divide([leaf], 1.0)) == 1


def test_what_was_never_seen_may_still_be() -> None:
    assert mean_merit(0.0, 999, 2.0) == pytest.approx(0.001)
    assert mean_merit(500.0, 999, 1.0) == pytest.approx(0.5005)
