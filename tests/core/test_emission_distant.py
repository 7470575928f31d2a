# SPDX-License-Identifier: GPL-3.0-or-later
"""Suns and the world: what enters the box around the scene."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ivg_addon.core.lights import Lights, SunLights

from .emission_checks import (
    array,
    assert_distribution,
    assert_flux,
    assert_total,
    azimuth,
    histogram,
    mesh,
    photons,
    scene,
    through,
)

LOW, HIGH = (-1.0, -0.5, 0.0), (1.0, 0.5, 0.4)
IRRADIANCE = np.array([2.0, 1.0, 3.0])
DIRECTION = np.array([0.48, 0.64, -0.6])
UNIT = np.linspace(0.0, 1.0, 17)
CENTER, HALF = (0.0, 0.0, 0.2), (0.9, 0.45, 0.18)
"""Rectangles that receive light lie in the middle of the box and nearly fill it."""
AREAS = [4 * HALF[1] * HALF[2], 4 * HALF[2] * HALF[0], 4 * HALF[0] * HALF[1]]
AXES = [(axis, sign) for axis in range(3) for sign in (1.0, -1.0)]


def sun(angle: float, direction: np.ndarray = DIRECTION) -> Lights:
    """Return a sun that spans `angle` degrees."""
    return Lights(
        world=array(0, 0, 0),
        sun=SunLights(
            names=("Sun",),
            direction=array(direction),
            half_angle=array(math.radians(angle / 2)),
            irradiance=array(IRRADIANCE),
        ),
    )


def sides(axis: int) -> tuple[float, float]:
    """Return half the sides of the rectangle across an axis, in cyclic order."""
    return HALF[(axis + 1) % 3], HALF[(axis + 2) % 3]


def facing_share(direction: np.ndarray, angle: float, axis: int, sign: float) -> float:
    """Return the flux through a unit square that the photons cross in direction `sign`, over E facing the sun."""
    if angle == 0.0:
        return max(0.0, float(direction[axis]) * sign)
    h = math.radians(angle / 2)
    nodes, weights = np.polynomial.legendre.leggauss(400)
    theta = 0.5 * h * (nodes + 1)[:, None]
    psi = 2 * np.pi * np.arange(1000) / 1000
    a = float(direction[axis]) * sign
    cosine = a * np.cos(theta) + math.sqrt(1 - a * a) * np.sin(theta) * np.cos(psi)
    ring = np.maximum(cosine, 0.0).mean(axis=1)
    integral = 2 * np.pi * 0.5 * h * (weights * np.sin(theta[:, 0]) * ring).sum()
    return float(integral / (np.pi * math.sin(h) ** 2))


@pytest.mark.parametrize("angle", [0.0, 5.0, 60.0, 180.0])
def test_sun_lights_rectangles_inside_the_box(angle: float) -> None:
    light = photons(scene(sun(angle)), LOW, HIGH)
    for axis, sign in AXES:
        truth = IRRADIANCE * AREAS[axis] * facing_share(DIRECTION, angle, axis, sign)
        assert_flux(light, through(light, CENTER, axis, sides(axis), sign), truth)


@pytest.mark.parametrize("angle", [0.0, 5.0, 60.0])
def test_power_of_a_sun_is_what_its_photons_carry(angle: float) -> None:
    light = photons(scene(sun(angle)), LOW, HIGH)
    if angle == 0.0:
        np.testing.assert_allclose(light.flux.sum(axis=0), light.emission.power, rtol=1e-5)
    else:
        assert_total(light)
    assert (light.flux[:, 0] > 0.0).mean() > 0.6


def test_directions_fill_the_suns_disc() -> None:
    """Solid angle times the area that the box shows along each direction."""
    half = math.radians(30.0)
    light = photons(scene(sun(60.0, np.array([0.0, 0.0, -1.0]))), LOW, HIGH)
    d = light.directions[light.flux[:, 0] > 0.0]
    fine = (np.arange(1024) + 0.5) / 1024
    z = 1 - fine[:, None] * (1 - math.cos(half))
    s = np.sqrt(1 - z * z)
    box = light.emission.emitters.box
    shown = box.areas[0] * s * np.abs(np.cos(2 * np.pi * fine)) + box.areas[1] * s * np.abs(np.sin(2 * np.pi * fine))
    shown = (shown + box.areas[2] * z).reshape(16, 64, 16, 64).mean(axis=(1, 3))
    height = (1 + d[:, 2]) / (1 - math.cos(half))
    counts = histogram((height, np.r_[-1e-4, UNIT[1:-1], 1.0001]), (azimuth(d[:, 0], d[:, 1]), UNIT))
    assert_distribution(counts, shown / shown.sum())


def test_photons_that_miss_fly_away_from_everything() -> None:
    light = photons(scene(sun(60.0)), LOW, HIGH)
    missing = light.flux[:, 0] == 0.0
    assert missing.any()
    assert (light.origins[missing] > HIGH).all()
    assert (light.directions[missing] > 0.5).all()


def test_world_lights_every_side_with_pi_times_its_radiance() -> None:
    radiance = np.array([0.2, 0.5, 1.0])
    light = photons(scene(Lights(world=array(*radiance))), LOW, HIGH)
    for axis, sign in AXES:
        assert_flux(light, through(light, CENTER, axis, sides(axis), sign), math.pi * radiance * AREAS[axis])
    np.testing.assert_allclose(light.flux.sum(axis=0), light.emission.power, rtol=1e-5)


def test_box_holds_the_geometry_and_no_surface_lies_in_it() -> None:
    floor = mesh([(-5, -5, -1), (5, -5, -1), (0, 5, -1)], [(0, 1, 2)], [0])
    box = photons(scene(sun(0.0), floor, [(0, 0, 0)]), LOW, HIGH, n=8).emission.emitters.box
    assert (box.low < (-5, -5, -1)).all()
    assert (box.high > (5, 5, 0.4)).all()
