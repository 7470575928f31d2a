# SPDX-License-Identifier: GPL-3.0-or-later
"""Aimed photons bring the same light, whatever they are aimed at; so do those that are emitted in parts."""

from __future__ import annotations

import numpy as np
import pytest

from ivg_addon.core.emission import prepare_emission
from ivg_addon.core.emission.guide import NUMBERS, Leaves
from ivg_addon.core.environment import EnvironmentMap
from ivg_addon.core.lights import Lights
from ivg_addon.core.scene import Scene

from .emission_checks import PHOTONS, Photons, array, assert_flux, assert_total, mesh, photons, scene, through
from .rooms import lamp
from .test_emission import everything
from .test_emission_distant import AREAS, AXES, CENTER, DIRECTION, HIGH, IRRADIANCE, LOW, facing_share, sides, sun

SEED = 5


def leaves(rng: np.random.Generator, count: int = 40, largest: float = 64.0) -> Leaves:
    """Return a division that was drawn by lot, and ratios too."""
    low, size = [np.zeros(NUMBERS)], [np.ones(NUMBERS)]
    while len(low) < count:
        index, axis, share = rng.integers(len(low)), rng.integers(NUMBERS), rng.uniform(0.1, 0.9)
        first, second = size[index].copy(), size[index].copy()
        first[axis] *= share
        second[axis] -= first[axis]
        beyond = low[index].copy()
        beyond[axis] += first[axis]
        size[index] = first
        low.append(beyond)
        size.append(second)
    return Leaves(np.array(low), np.array(size), largest ** rng.random(count))


def aimed(of: Scene, rest: float = 1.0, n: int = PHOTONS) -> Photons:
    """Emit n photons with a guide drawn by lot."""
    rng = np.random.default_rng(SEED)
    plain = prepare_emission(of, array(*LOW), array(*HIGH))
    count = plain.guided.stop - plain.guided.start
    emission = plain.aimed([leaves(rng) for _ in range(count)], rest)
    origins, directions, weights = (np.empty((n, 3), dtype=np.float32) for _ in range(3))
    dark = np.empty(n, dtype=np.float32)
    emission.emit(1, 0, origins, directions, weights, dark)
    flux = weights.astype(np.float64) * (emission.flux_scale / n)
    return Photons(emission, origins.astype(np.float64), directions.astype(np.float64), flux, dark.astype(np.float64))


RADIANCE = np.array([0.2, 0.5, 1.0])


FAR = mesh([(-6, -5, -4), (7, 5, -4), (0, 5, 3)], [(0, 1, 2)], [0])
"""Geometry that makes the scene's box so much larger than the grid's that light is emitted in parts."""
ASIDE = ((3.0, -2.0, -1.0), (1.0, 0.8, 0.6))
"""Middle and half sides of a box beside the grid's."""


def worlds(geometry=None) -> Scene:
    return scene(Lights(world=array(*RADIANCE)), geometry, [(0, 0, 0)])


def maps(geometry=None) -> Scene:
    one = EnvironmentMap(np.broadcast_to(RADIANCE, (8, 16, 3)).astype(np.float32))
    return scene(Lights(world=array(0, 0, 0), environment=(one,)), geometry, [(0, 0, 0)])


@pytest.mark.parametrize("of", [worlds, maps])
def test_surroundings_light_every_side_as_they_do_without_aim(of) -> None:
    light = aimed(of())
    for axis, sign in AXES:
        assert_flux(light, through(light, CENTER, axis, sides(axis), sign), np.pi * RADIANCE * AREAS[axis])


@pytest.mark.parametrize("angle", [0.0, 60.0])
def test_sun_lights_every_side_as_it_does_without_aim(angle: float) -> None:
    light = aimed(scene(sun(angle)))
    for axis, sign in AXES:
        truth = IRRADIANCE * AREAS[axis] * facing_share(DIRECTION, angle, axis, sign)
        assert_flux(light, through(light, CENTER, axis, sides(axis), sign), truth)


def test_all_emitters_together_carry_their_power() -> None:
    light = aimed(everything(), rest=7.0)
    assert_total(light)
    weights = light.flux * len(light.flux) / light.emission.flux_scale
    assert weights.max() <= 1.0


def test_lights_that_are_not_aimed_get_as_many_times_more_photons_as_asked() -> None:
    lights = Lights(world=array(*RADIANCE), point=lamp((0, 0, 0.2)).point)
    light = aimed(scene(lights), rest=16.0)
    assert_total(light)
    of_lamp = np.isclose(light.flux[:, 0] * len(light.flux) / light.emission.flux_scale, 1 / 16)
    strengths = light.emission.strengths
    share = 16.0 * strengths[0] / light.emission.flux_scale
    # Other photons of that weight are few: a leaf would have to have the same ratio.
    assert abs((of_lamp & (light.origins[:, 2] == np.float32(0.2))).mean() - share) < 5 * np.sqrt(share / PHOTONS)


def test_one_leaf_changes_no_bit() -> None:
    plain = photons(worlds(), LOW, HIGH, n=5000)
    emission = plain.emission.aimed([Leaves.whole()], 1.0)
    origins, directions, weights = (np.empty((5000, 3), dtype=np.float32) for _ in range(3))
    emission.emit(1, 0, origins, directions, weights, np.empty(5000, dtype=np.float32))
    np.testing.assert_array_equal(origins, plain.origins.astype(np.float32))
    np.testing.assert_array_equal(directions, plain.directions.astype(np.float32))


def test_draws_are_those_that_photons_are_made_of() -> None:
    light = aimed(everything(), n=20_000)
    drawn = light.emission.draws(1, 0, 20_000)
    guide = light.emission.emitters.guide
    of_guided = drawn.guided >= 0
    assert 0.1 < of_guided.mean() < 0.99
    leaf = drawn.leaf[of_guided]
    np.testing.assert_array_less(guide.low[leaf], drawn.numbers[of_guided])
    np.testing.assert_array_less(drawn.numbers[of_guided], guide.low[leaf] + guide.size[leaf])
    weight = (light.flux * 20_000 / light.emission.flux_scale).max(axis=1)[of_guided]
    flown = weight > 0
    np.testing.assert_allclose(weight[flown], guide.weight[leaf][flown], rtol=1e-6)
    first = guide.first_leaf[drawn.guided[of_guided]]
    assert ((first <= leaf) & (leaf < guide.first_leaf[drawn.guided[of_guided] + 1])).all()


@pytest.mark.parametrize("of", [worlds, maps])
@pytest.mark.parametrize("emitted", [aimed, lambda of: photons(of, LOW, HIGH)], ids=["aimed", "plain"])
def test_light_in_parts_is_the_same_light(of, emitted) -> None:
    light = emitted(of(FAR))
    assert light.emission.boxes == 3
    assert_total(light)
    for axis, sign in AXES:
        truth = np.pi * RADIANCE
        assert_flux(light, through(light, CENTER, axis, sides(axis), sign), truth * AREAS[axis])
        middle, half = ASIDE
        beside = half[(axis + 1) % 3], half[(axis + 2) % 3]
        assert_flux(light, through(light, middle, axis, beside, sign), truth * 4 * beside[0] * beside[1])


@pytest.mark.parametrize("angle", [0.0, 60.0])
def test_sun_in_parts_is_the_same_sun(angle: float) -> None:
    light = aimed(scene(sun(angle), FAR, [(0, 0, 0)]))
    middle, half = ASIDE
    for axis, sign in AXES:
        truth = IRRADIANCE * facing_share(DIRECTION, angle, axis, sign)
        assert_flux(light, through(light, CENTER, axis, sides(axis), sign), truth * AREAS[axis])
        beside = half[(axis + 1) % 3], half[(axis + 2) % 3]
        assert_flux(light, through(light, middle, axis, beside, sign), truth * 4 * beside[0] * beside[1])


def test_boxes_are_nested() -> None:
    boxes = aimed(maps(FAR)).emission.emitters.boxes
    assert (np.diff(boxes.low, axis=0) > 0).all()
    assert (np.diff(boxes.high, axis=0) < 0).all()
    shown = boxes.areas.sum(axis=1)
    assert (shown[1:] < 0.3 * shown[:-1]).all()


def test_photons_through_the_grid_start_on_the_scenes_box() -> None:
    light = photons(maps(FAR), LOW, HIGH, n=20_000)
    box = light.emission.emitters.box
    flown = light.flux[:, 0] > 0
    origins = light.origins[flown]
    on_face = np.isclose(origins, box.low, atol=1e-4) | np.isclose(origins, box.high, atol=1e-4)
    assert on_face.any(axis=1).all()
    assert ((origins > box.low - 1e-4) & (origins < box.high + 1e-4)).all()
