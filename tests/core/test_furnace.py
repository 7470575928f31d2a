# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed rooms of one albedo ρ and one emission L everywhere: the light inside is uniform, L Σ ρ^k over the bounces k.

Their walls shine to both sides, so half of the photons leave at once; solids inside are furnaces of their own, with the
same light in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core.bake import bake
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.scene import Scene
from ivg_addon.core.settings import BakeSettings, Estimator
from ivg_addon.core.tally import GRAZING_COSINE

from .grids import AXES
from .rooms import ball, box, quad, rotation, scene
from .z_tests import assert_means

Float64 = NDArray[np.float64]

ALBEDO = np.array([0.8, 0.5, 0.2])
RADIANCE = np.array([1.0, 2.0, 0.5])
TURN = rotation((1, 2, 3), 0.7)
SETTINGS = BakeSettings((0, 0, 0), (1, 1.5, 2), (3, 2, 3), photons=1 << 15, bounces=6, lit_points=0)
INSIDE_BALL = replace(SETTINGS, bounds_min=(-0.3, -0.4, -0.35), bounds_max=(0.5, 0.4, 0.5))


def furnace(*parts: object) -> Scene:
    return scene(parts, (ALBEDO,), (RADIANCE,))  # type: ignore[arg-type]


def bakes(of: Scene, settings: BakeSettings, seeds: Sequence[int] = range(24)) -> list[IrradianceVectorGrid]:
    return [bake(of, replace(settings, seed=seed)).grid for seed in seeds]


def series(bounces: int, first: int = 1) -> Float64:
    """Return the radiance of light after `first` to `bounces` bounces."""
    return np.asarray(RADIANCE * sum(ALBEDO**k for k in range(first, bounces + 1)))


def assert_uniform(made: list[IrradianceVectorGrid], radiance: Float64) -> None:
    """Test I_δ = π L δ in every dual cell, and the mean of all, which is known more precisely."""
    assert_means([grid.vectors for grid in made], np.pi * AXES[:, None, :] * radiance[:, None])
    share = made[0].lattice.cell_volumes() / made[0].lattice.cell_volumes().sum()
    means = [np.einsum("xyz,xyzdcj,dj->c", share, grid.vectors, AXES) / 6 for grid in made]
    assert_means(means, np.pi * radiance)


@pytest.mark.parametrize("bounces", [1, 2, 12])
def test_a_room_whose_walls_are_the_bounds(bounces: int) -> None:
    """In every dual cell, those that the bounds cut as well."""
    made = bakes(furnace(box((0, 0, 0), (1, 1.5, 2), inward=True)), replace(SETTINGS, bounces=bounces))
    assert_uniform(made, series(bounces))


def test_direct_light_is_the_first_term() -> None:
    settings = replace(SETTINGS, bounces=3, include_direct=True)
    made = bakes(furnace(box((0, 0, 0), (1, 1.5, 2), inward=True)), settings)
    assert_uniform(made, series(3, first=0))


def test_power_is_right_to_a_part_in_two_hundred() -> None:
    """Without reflection all photons go into direct light: the standard error is a tenth of a percent."""
    room = scene([box((0, 0, 0), (1, 1.5, 2), inward=True)], ((0, 0, 0),), (RADIANCE,))
    assert_uniform(bakes(room, replace(SETTINGS, photons=1 << 18, include_direct=True)), RADIANCE)


@pytest.mark.parametrize("estimator", [Estimator.REPORT, Estimator.CROSSING])
def test_the_other_estimators(estimator: Estimator) -> None:
    """Their normal parts, also at vertices on the walls; a face in whose plane a wall lies is crossed to the wall."""
    made = bakes(furnace(box((0, 0, 0), (1, 1.5, 2), inward=True)), replace(SETTINGS, estimator=estimator))
    normal = np.stack([np.einsum("...dcj,dj->...dc", grid.vectors, AXES) for grid in made])
    share = 2 / 3 if estimator is Estimator.REPORT else 1 - GRAZING_COSINE**2 / 3
    assert_means(normal, share * np.pi * series(SETTINGS.bounces))


def test_a_ball_around_the_grid() -> None:
    made = bakes(furnace(ball(1.0, rounds=2, smooth=False, inward=True)), INSIDE_BALL)
    assert_uniform(made, series(SETTINGS.bounces))


def test_a_turned_room_with_solids_and_a_thin_wall() -> None:
    """All that cuts the cells is lit on both sides: only where it parts places is the lit volume not the whole."""
    room = box((-1, -1, -1), (1, 1, 1), inward=True, turn=TURN)
    block = box((-0.3, -0.2, -0.2), (0.2, 0.1, 0.3), turn=rotation((3, 1, 1), 0.5))
    wall = quad((-0.5, 0.3, -0.5), (1, 0.1, 0), (0, 0, 1))
    made = bakes(furnace(room, block, wall), replace(INSIDE_BALL, lit_points=1024))
    rng = np.random.default_rng(0)
    points = rng.uniform(INSIDE_BALL.bounds_min, INSIDE_BALL.bounds_max, (4000, 3))
    normals = rng.normal(size=(4000, 3))
    for grid in made:
        whole = ~grid.partitions.divided.reshape(grid.validity.shape)
        assert whole.any() and not whole.all()
        np.testing.assert_array_equal(grid.validity[whole], 1)
    means = [grid.irradiance(points, normals).mean(axis=0) for grid in made]
    assert_means(means, np.pi * series(SETTINGS.bounces))


def test_a_turned_room_that_cuts_the_outer_cells() -> None:
    """Divided by the lit volume, the mean over what is left of a cell is the same; looked up, it is uniform.

    Lit shares are estimates, too, and 1/share of a share that scatters is a little high: with 1,024 points the mean of
    the look-ups by some 10⁻⁴, a fraction of its standard error here.
    """
    settings = replace(
        SETTINGS, bounds_min=(-1.3, -1.3, -1.3), bounds_max=(1.3, 1.3, 1.3), resolution=(5, 5, 5), lit_points=1024
    )
    made = bakes(furnace(box((-1, -1, -1), (1, 1, 1), inward=True, turn=TURN)), settings)
    rng = np.random.default_rng(0)
    points = rng.uniform(-1, 1, (4000, 3)) @ TURN.T
    normals = rng.normal(size=(4000, 3))
    means = [grid.irradiance(points, normals).mean(axis=0) for grid in made]
    assert_means(means, np.pi * series(SETTINGS.bounces))
