# SPDX-License-Identifier: GPL-3.0-or-later
"""Area lights: where photons start, where they go, and how much light arrives."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ivg_addon.core.lights import AreaLights, Lights

from .emission_checks import array, assert_distribution, assert_flux, azimuth, histogram, photons, scene

TILTED = np.array([[0.8, -0.6, 0.0], [0.36, 0.48, -0.8], [0.48, 0.64, 0.6]])
"""A rotation; its columns are the light's axes."""
UNIT = np.linspace(0.0, 1.0, 17)


def area_light(elliptic: bool = False, spread: float = 180.0, axes: np.ndarray = TILTED) -> Lights:
    """Return a light of 0.6 × 1.4 m at (0.3, −0.2, 0.5)."""
    return Lights(
        world=array(0, 0, 0),
        area=AreaLights(
            names=("Key",),
            center=array((0.3, -0.2, 0.5)),
            edge_u=array(0.6 * axes[:, 0]),
            edge_v=array(1.4 * axes[:, 1]),
            direction=array(-axes[:, 2]),
            elliptic=np.array([elliptic]),
            half_spread=array(math.radians(spread / 2)),
            radiance=array((3.0, 2.0, 1.0)),
        ),
    )


def local(vectors: np.ndarray) -> np.ndarray:
    """Return vectors in the light's own axes, z along its direction."""
    return vectors @ TILTED * (1.0, 1.0, -1.0)


@pytest.mark.parametrize("spread", [180.0, 90.0, 20.0, 3.0])
def test_rectangle_emits_uniformly_and_by_its_spread(spread: float) -> None:
    light = photons(scene(area_light(spread=spread)))
    place = local(light.origins - (0.3, -0.2, 0.5))
    np.testing.assert_allclose(place[:, 2], 0.0, atol=1e-5)
    uniform = np.full((16, 16), 1 / 256)
    assert_distribution(histogram((place[:, 0] / 0.6 + 0.5, UNIT), (place[:, 1] / 1.4 + 0.5, UNIT)), uniform)

    d = local(light.directions)
    a = math.radians(spread / 2)
    theta = a * UNIT
    # ∫ (tan a − tan θ) cos θ sin θ dθ from 0; at full spread ∫ cos θ sin θ dθ.
    cut = np.sin(theta) ** 2 * math.tan(a) - theta + np.sin(theta) * np.cos(theta)
    distribution = np.sin(theta) ** 2 if spread == 180.0 else cut / cut[-1]
    angle = np.arctan2(np.hypot(d[:, 0], d[:, 1]), d[:, 2])
    expected = np.diff(distribution)[:, None] * np.full(16, 1 / 16)
    # The last bins hold few photons: the narrow light fades there.
    edges = np.r_[theta[:-2], theta[-1] * (1 + 1e-6)]
    expected = np.concatenate([expected[:-2], expected[-2:].sum(axis=0, keepdims=True)])
    counts = histogram((angle, edges), (azimuth(d[:, 0], d[:, 1]), UNIT))
    assert_distribution(counts, expected)
    assert_distribution(counts.sum(axis=1), expected.sum(axis=1))


def test_ellipse_emits_uniformly_within_its_outline() -> None:
    light = photons(scene(area_light(elliptic=True)))
    place = local(light.origins - (0.3, -0.2, 0.5))
    u, v = place[:, 0] / 0.3, place[:, 1] / 0.7
    uniform = np.full((16, 16), 1 / 256)
    edges = np.r_[UNIT[:-1], 1.0 + 1e-5]
    assert_distribution(histogram((u * u + v * v, edges), (azimuth(u, v), UNIT)), uniform)


@pytest.mark.parametrize("elliptic", [False, True])
@pytest.mark.parametrize("spread", [180.0, 90.0, 20.0, 0.0])
def test_power_is_pi_radiance_area_at_any_spread(elliptic: bool, spread: float) -> None:
    light = photons(scene(area_light(elliptic, spread)))
    area = 0.6 * 1.4 * (math.pi / 4 if elliptic else 1.0)
    truth = math.pi * area * np.array([3.0, 2.0, 1.0])
    np.testing.assert_allclose(light.emission.power, truth, rtol=1e-6)
    # One emitter and no failures: the sum is exact.
    np.testing.assert_allclose(light.flux.sum(axis=0), truth, rtol=1e-5)


def test_spread_of_zero_is_a_parallel_beam() -> None:
    light = photons(scene(area_light(spread=0.0)))
    np.testing.assert_allclose(local(light.directions), np.tile((0.0, 0.0, 1.0), (len(light.dark), 1)), atol=1e-6)


def test_narrow_spread_is_brighter_as_in_cycles() -> None:
    """Below 0.05 rad Cycles normalises by the first term of a series: it emits 1 + 2a²/5 of the power."""
    a = 0.04
    emitted = photons(scene(area_light(spread=math.degrees(2 * a)))).emission.power
    np.testing.assert_allclose(emitted / photons(scene(area_light())).emission.power, 1 + 0.4 * a * a, rtol=1e-5)


def test_disk_lights_a_coaxial_disk_by_its_form_factor() -> None:
    """Flux between coaxial disks of radius r and q at a distance h (Howell, catalogue, C-41)."""
    r, q, h = 0.4, 0.3, 0.7
    lights = Lights(
        world=array(0, 0, 0),
        area=AreaLights(
            names=("Disk",),
            center=array((0, 0, 0)),
            edge_u=array((2 * r, 0, 0)),
            edge_v=array((0, 2 * r, 0)),
            direction=array((0, 0, -1)),
            elliptic=np.array([True]),
            half_spread=array(math.pi / 2),
            radiance=array((1.0, 5.0, 2.0)),
        ),
    )
    light = photons(scene(lights))
    point = light.origins + light.directions * ((-h - light.origins[:, 2]) / light.directions[:, 2])[:, None]
    hit = np.hypot(point[:, 0], point[:, 1]) < q
    x = 1 + (1 + (q / h) ** 2) / (r / h) ** 2
    factor = 0.5 * (x - math.sqrt(x * x - 4 * (q / r) ** 2))
    assert_flux(light, hit, math.pi * math.pi * r * r * factor * np.array([1.0, 5.0, 2.0]))
