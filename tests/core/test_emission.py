# SPDX-License-Identifier: GPL-3.0-or-later
"""All emitters together: who is picked, what a photon carries, and that it depends on its index alone."""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from ivg_addon.core.emission import prepare_emission
from ivg_addon.core.environment import EnvironmentMap
from ivg_addon.core.errors import SceneError
from ivg_addon.core.lights import AreaLights, Lights, PointLights, SunLights
from ivg_addon.core.scene import Scene

from .emission_checks import array, assert_total, mesh, photons, scene

BOUNDS = array((-1, -1, -1), (1, 1, 1))
SQUARE = mesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)], [0, 0])


def everything() -> Scene:
    """Return a scene with two emitters of every kind, of powers that differ by a factor of a hundred."""
    lights = Lights(
        world=array(0.1, 0.2, 0.05),
        area=AreaLights(
            names=("Panel", "Disk"),
            center=array((0, 0, 1), (1, 0, 1)),
            edge_u=array((1, 0, 0), (0.1, 0, 0)),
            edge_v=array((0, 1, 0), (0, 0.1, 0)),
            direction=array((0, 0, -1), (0, 0, -1)),
            elliptic=np.array([False, True]),
            half_spread=array(math.pi / 2, 0.3),
            radiance=array((1, 2, 3), (9, 2, 1)),
        ),
        point=PointLights(
            names=("Lamp", "Spot"),
            position=array((0, 0, 2), (1, 1, 2)),
            radius=array(0.1, 0.2),
            soft_falloff=np.array([True, False]),
            intensity=array((1, 1, 1), (5, 0, 1)),
            cos_half_angle=array(-1.0, 0.7),
            blend=array(0.0, 0.3),
            axes=array(np.eye(3), np.diag([1.0, 2.0, 1.0])),
        ),
        sun=SunLights(
            names=("Sun", "Moon"),
            direction=array((0, 0.6, -0.8), (1, 0, 0)),
            half_angle=array(0.3, 0.0),
            irradiance=array((1, 1, 1), (0.1, 0.1, 0.3)),
        ),
        environment=(
            EnvironmentMap(np.linspace(0.0, 0.5, 4 * 8 * 3, dtype=np.float32).reshape(4, 8, 3)),
            EnvironmentMap(np.full((2, 2, 3), 9.0, np.float32), longitude=(1.0, 1.1), latitude=(0.5, 0.6)),
        ),
    )
    return scene(lights, SQUARE, [(2, 0, 1)])


def emit(of: Scene, first: int, n: int, seed: int = 7) -> np.ndarray:
    """Return origins, directions, weights and dark distances, (n, 10)."""
    emission = prepare_emission(of, *BOUNDS)
    arrays = [np.empty((n, 3), dtype=np.float32) for _ in range(3)]
    dark = np.empty(n, dtype=np.float32)
    emission.emit(seed, first, *arrays, dark)
    return np.concatenate([*arrays, dark[:, None]], axis=1)


def test_photons_together_carry_the_power() -> None:
    light = photons(everything(), *BOUNDS)
    assert_total(light)


def test_weights_are_at_most_one_and_directions_unit() -> None:
    light = photons(everything(), *BOUNDS)
    weights = light.flux * len(light.flux) / light.emission.flux_scale
    largest = weights.max(axis=1)
    # A weight of zero is a photon that its light failed to emit; all others fill their largest channel.
    np.testing.assert_allclose(largest[largest > 0.0], 1.0, rtol=1e-6)
    assert (weights >= 0.0).all()
    np.testing.assert_allclose(np.linalg.norm(light.directions, axis=1), 1.0, atol=1e-6)
    assert np.isfinite(light.origins).all()


def test_a_photon_depends_on_seed_and_index_alone() -> None:
    n = 10_000
    whole = emit(everything(), 0, n)
    pieces = [(0, 1), (1, 4095), (4096, n - 4096)]
    with ThreadPoolExecutor(3) as pool:
        parts = list(pool.map(lambda piece: emit(everything(), *piece), pieces))
    np.testing.assert_array_equal(np.concatenate(parts), whole)
    assert (emit(everything(), 0, n, seed=8) != whole).any(axis=1).mean() > 0.99


def test_indices_beyond_32_bits_are_other_photons() -> None:
    assert not np.array_equal(emit(everything(), 1 << 33, 100), emit(everything(), 0, 100))


def test_each_of_many_triangles_is_picked_by_its_power() -> None:
    """A thousand triangles, areas growing with their index, among two strengths."""
    count = 1000
    x = np.arange(count, dtype=float)
    vertices = np.stack(
        [np.stack([x, 0 * x, 0 * x], 1), np.stack([x, 1 + x, 0 * x], 1), np.stack([x, 0 * x, 1 + 0 * x], 1)], 1
    )
    strip = mesh(vertices, np.arange(3 * count), np.arange(count) % 2)
    light = photons(scene(geometry=strip, emission=[(1, 2, 1), (6, 3, 3)]))
    triangle = np.rint(light.origins[:, 0]).astype(int)
    counts = np.bincount(triangle, minlength=count)
    strength = (1 + x) * np.where(np.arange(count) % 2, 6.0, 2.0)
    expected = counts.sum() * strength / strength.sum()
    chi2 = ((counts - expected) ** 2 / np.maximum(expected, 1e-9))[expected > 10].sum()
    k = int((expected > 10).sum())
    assert (chi2 - k) / math.sqrt(2 * k) < 5.5  # a false alarm in less than 10 million runs


@pytest.mark.parametrize("of", [scene(), scene(geometry=SQUARE, emission=[(0, 0, 0)])], ids=["empty", "dark mesh"])
def test_no_light_is_an_error_that_names_the_cure(of: Scene) -> None:
    with pytest.raises(SceneError, match=r"scene 'Test' has no light: add a light"):
        prepare_emission(of, *BOUNDS)


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0])
def test_a_power_that_is_no_number_names_the_light(value: float) -> None:
    sun = SunLights(names=("Sun",), direction=array((0, 0, -1)), half_angle=array(0.0), irradiance=array((1, value, 1)))
    if value != -1.0:  # a lamp may take light away
        with pytest.raises(SceneError, match="light 'Sun' has power"):
            prepare_emission(scene(Lights(world=array(0, 0, 0), sun=sun)), *BOUNDS)
    with pytest.raises(SceneError, match="the world has power"):
        prepare_emission(scene(Lights(world=array(1, value, 1))), *BOUNDS)


def test_lights_of_no_power_emit_no_photon() -> None:
    """Also the last one of the table, however close to one the random number is."""
    dark_world = photons(scene(geometry=SQUARE, emission=[(1, 1, 1)]), n=1 << 16)
    assert (np.abs(dark_world.origins[:, 2]) < 1e-5).all()
