# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces that cast no shadow: light flies through them and lights every one of them in full."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from ivg_addon.core.bake import bake, prepare_course
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.light_rules import LightRules
from ivg_addon.core.photon_walk import Walk, walk_steps
from ivg_addon.core.progress import finish
from ivg_addon.core.scene import GLOSSY, Scene
from ivg_addon.core.settings import BakeSettings

from .lobe_scenes import lobe, with_lobes
from .rooms import Part, box, lamp, quad, scene
from .z_tests import assert_means

LOW, HIGH = (-2.0, -2.0, -2.0), (2.0, 2.0, 2.0)
SETTINGS = BakeSettings(LOW, HIGH, (4, 4, 4), photons=4096, bounces=1, threads=1)
GREY, BLACK = 0, 1
ALBEDO = ((0.5, 0.4, 0.3), (0.0, 0.0, 0.0))


def shells(count: int) -> list[Part]:
    """Return closed grey boxes around the origin, one in the other, with different turns to their fronts."""
    return [box([-s] * 3, [s] * 3, GREY, inward=bool(i % 2)) for i, s in enumerate(np.linspace(0.5, 1.5, count))]


def room_with(parts: Sequence[Part], casts: bool) -> Scene:
    """Return parts in a black room, around a lamp that is not in the planes of their diagonals."""
    made = scene([*parts, box(LOW, HIGH, BLACK, inward=True)], ALBEDO, lights=lamp((0.03, -0.05, 0.07)))
    blocks = np.array([casts] * len(parts) + [True], dtype=np.uint64)
    rules = LightRules(np.zeros(len(blocks), dtype=np.int32), receives=np.ones_like(blocks), blocks=blocks)
    return replace(made, light_rules=rules)


def walk(of: Scene, settings: BakeSettings) -> Walk:
    lattice = Lattice(settings.bounds_min, settings.bounds_max, settings.resolution)
    return finish(walk_steps(prepare_course(of, lattice, settings.photons), lattice, settings))


@pytest.mark.parametrize("count", [1, 2, 7])
def test_every_surface_on_the_way_receives_the_whole_light(count: int) -> None:
    """Of k shells each absorbs 1 − ρ, and sends ρ back inwards to grey shells; the black room gets all light once."""
    of = room_with(shells(count), casts=False)
    walks = [walk(of, replace(SETTINGS, seed=seed)) for seed in range(24)]
    rho = np.array(ALBEDO[GREY])
    assert_means([each.cut for each in walks], count * rho**2)
    assert_means([each.absorbed for each in walks], count * (1 - rho**2) + 1)
    assert max(each.escaped.max() for each in walks) == 0.0


@pytest.mark.parametrize("mirror", [0, 1])
def test_a_mirror_is_lit_only_where_nothing_hides_the_lamp_from_it(mirror: int) -> None:
    """Of a grey shell in a mirror's, or around it, what reflects ρ and m sends so much back to itself.

    The black room gets all light; so does a mirror that is not quite one.
    """
    parts = shells(2)
    parts[mirror] = replace(parts[mirror], material=2)
    of = room_with(parts, casts=False)
    of = replace(of, materials=scene(parts, (*ALBEDO, ALBEDO[BLACK])).materials)
    rho2, m2 = np.array(ALBEDO[GREY]) ** 2, 0.25

    def walks(roughness: float) -> list[Walk]:
        made = with_lobes(of, lobe(GLOSSY, 0.5, material=2, roughness=roughness))
        return [walk(made, replace(SETTINGS, seed=seed)) for seed in range(24)]

    hidden = mirror == 1
    assert_means([each.cut for each in walks(0.0)], rho2 + (0.0 if hidden else m2))
    assert_means([each.absorbed for each in walks(0.0)], (1 - rho2) + (0.0 if hidden else 1 - m2) + 1)
    assert np.mean([each.cut for each in walks(0.02)]) > rho2.mean() + 0.9 * m2


def test_light_falls_as_if_they_were_not_there() -> None:
    """To the rounding of a flight's length, which is the sum of four of 32 bits."""
    settings = replace(SETTINGS, include_direct=True)
    of, alone = room_with(shells(3), casts=False), room_with([], casts=True)
    of = replace(of, materials=replace(of.materials, albedo=np.zeros_like(of.materials.albedo)))
    through, free = walk(of, settings), walk(alone, settings)
    assert free.tally.sums.any()
    np.testing.assert_allclose(
        through.tally.sums, free.tally.sums, rtol=0, atol=4 * 2**-23 * np.abs(free.tally.sums).max()
    )


def test_they_reflect_what_an_ordinary_surface_reflects() -> None:
    """One sheet in a black room: what the floor behind it gets goes nowhere, so its shadow makes no difference."""
    sheet = [quad((-1, -1, 1), (2, 0, 0), (0, 2, 0), GREY)]
    settings = replace(SETTINGS, photons=1 << 14, lit_points=0)
    passed, stopped = (
        np.stack([bake(room_with(sheet, casts), replace(settings, seed=seed)).grid.vectors for seed in seeds])
        for casts, seeds in ((False, range(24)), (True, range(100, 124)))
    )
    assert stopped.mean(axis=0).max() > 0
    sums = [vectors.sum(axis=(1, 2, 3), dtype=np.float64) for vectors in (passed, stopped)]
    assert_means(sums[0] - sums[1], 0.0)


def test_the_same_bits_however_it_is_divided() -> None:
    of = room_with(shells(3), casts=False)
    settings = replace(SETTINGS, photons=150_000, bounces=3)
    one, two = walk(of, settings), walk(of, replace(settings, threads=2))
    np.testing.assert_array_equal(one.tally.sums, two.tally.sums)
    np.testing.assert_array_equal(one.bin_counts, two.bin_counts)
