# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights that do not shine evenly: each texel of a pattern has its own light, whatever the shape of the lamp."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from ivg_addon.core.lights import AreaLights, Lights, Pattern, PointLights

from .emission_checks import Photons, array, photons, scene
from .test_emission_area import TILTED, area_light, local
from .z_tests import assert_means

BATCHES = 16
INTENSITY = np.array((1.0, 0.5, 0.25))


def noise(rows: int, columns: int) -> np.ndarray:
    """Return factors that span two orders of magnitude, and some that are zero."""
    rng = np.random.default_rng(2)
    factor = 10.0 ** rng.uniform(-2.0, 0.0, (rows, columns, 3))
    factor[rng.random((rows, columns)) < 0.2] = 0.0
    return factor.astype(np.float32)


def lamp(factor: np.ndarray, angle: float = math.pi, radius: float = 0.0, soft: bool = True) -> Lights:
    """Return a lamp at the origin that is turned, with a pattern out to an angle from its axis −z."""
    point = PointLights(
        names=("Lamp",),
        position=array((0, 0, 0)),
        radius=array(radius),
        soft_falloff=np.array([soft]),
        intensity=array(INTENSITY),
        cos_half_angle=array(math.cos(angle)),
        blend=array(0.0),
        axes=array(TILTED),
        pattern=np.zeros(1, dtype=np.int32),
    )
    return Lights(world=array(0, 0, 0), point=point, patterns=(Pattern(factor),))


def per_texel(light: Photons, row: np.ndarray, column: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Return the watts of each texel, (batches, rows, columns, 3)."""
    batch = np.arange(len(row)) * BATCHES // len(row)
    flux = np.zeros((BATCHES, *shape, 3))
    rows, columns = (np.clip(value.astype(int), 0, n - 1) for value, n in zip((row, column), shape, strict=True))
    np.add.at(flux, (batch, rows, columns), BATCHES * light.flux)
    return flux


def texel_of(directions: np.ndarray, angle: float, shape: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return row and column, as fractions, of directions (n, 3)."""
    own = directions @ TILTED
    theta = np.arccos(np.clip(-own[:, 2], -1.0, 1.0))
    return theta / angle * shape[0], np.arctan2(own[:, 1], own[:, 0]) / (2 * np.pi) % 1.0 * shape[1]


def solid_angles(angle: float, rows: int, columns: int) -> np.ndarray:
    return -2 * np.pi / columns * np.diff(np.cos(np.linspace(0.0, angle, rows + 1)))[:, None, None]


@pytest.mark.parametrize("angle", [math.pi, 0.6])
@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_lamp_sends_each_texel_into_its_directions(angle: float, radius: float) -> None:
    factor = noise(6, 8)
    light = photons(scene(lamp(factor, angle, radius)))
    truth = INTENSITY * factor * solid_angles(angle, 6, 8)
    assert_means(per_texel(light, *texel_of(light.directions, angle, (6, 8)), (6, 8)), truth)
    np.testing.assert_allclose(light.emission.power, truth.sum(axis=(0, 1)), rtol=1e-5)


def test_sphere_shines_by_the_pattern_of_its_surface() -> None:
    """A place of normal n emits the radiance f(n) I / (π r²) by Lambert's law: f I leaves a solid angle of n."""
    factor = noise(6, 8)
    light = photons(scene(lamp(factor, radius=0.5, soft=False)))
    normal = light.origins / 0.5
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, rtol=1e-5)
    truth = INTENSITY * factor * solid_angles(math.pi, 6, 8)
    assert_means(per_texel(light, *texel_of(normal, math.pi, (6, 8)), (6, 8)), truth)
    cosine = (normal * light.directions).sum(axis=1)
    whole = light.flux.sum(axis=1).reshape(BATCHES, -1)
    # Lambert's law: half of the light leaves with a squared cosine below one half.
    assert_means((whole * (cosine**2 < 0.5).reshape(BATCHES, -1)).sum(axis=1) - 0.5 * whole.sum(axis=1), 0.0)
    assert cosine.min() > 0.0


@pytest.mark.parametrize("elliptic", [False, True])
def test_area_light_shines_by_its_texels(elliptic: bool) -> None:
    factor = noise(5, 4)
    plain = area_light(elliptic, spread=90.0)
    area = dataclasses.replace(plain.area, pattern=np.zeros(1, dtype=np.int32))
    light = photons(scene(dataclasses.replace(plain, area=area, patterns=(Pattern(factor),))))
    place = local(light.origins - (0.3, -0.2, 0.5))
    x, y = place[:, 0] / 0.6, place[:, 1] / 1.4
    exists = light.flux.max(axis=1) > 0.0
    assert exists.all() or elliptic
    x, y = np.where(exists, x, 0.0), np.where(exists, y, 0.0)
    # The share of each texel that lies in the outline, by a fine raster.
    fine = (np.arange(1000) + 0.5) / 1000 - 0.5
    inside = (fine[None, :] ** 2 + fine[:, None] ** 2 < 0.25) if elliptic else np.ones((1000, 1000), dtype=np.bool_)
    covered = inside.reshape(5, 200, 4, 250).mean(axis=(1, 3))
    truth = np.pi * np.array((3.0, 2.0, 1.0)) * 0.6 * 1.4 / 20 * factor * covered[..., None]
    assert_means(per_texel(light, (y + 0.5) * 5, (x + 0.5) * 4, (5, 4)), truth)
    np.testing.assert_allclose(light.emission.power, truth.sum(axis=(0, 1)), rtol=0.1 if elliptic else 1e-5)


def test_patterns_leave_other_lights_alone() -> None:
    """A pattern of ones is no pattern, for a lamp beside one without."""
    one, two = lamp(np.ones((3, 4, 3), dtype=np.float32)), lamp(np.ones((3, 4, 3), dtype=np.float32))
    both = dataclasses.replace(
        one.point,
        **{
            name: np.concatenate([getattr(one.point, name), getattr(two.point, name)])
            for name in ("position", "radius", "soft_falloff", "intensity", "cos_half_angle", "blend", "axes")
        },
        names=("Even", "Patterned"),
        pattern=np.array([-1, 0], dtype=np.int32),
    )
    panel = AreaLights(
        names=("Panel",),
        center=array((3, 0, 0)),
        edge_u=array((1, 0, 0)),
        edge_v=array((0, 1, 0)),
        direction=array((0, 0, 1)),
        elliptic=np.array([True]),
        half_spread=array(math.pi / 2),
        radiance=array((1, 1, 1)),
    )
    light = photons(scene(dataclasses.replace(one, point=both, area=panel)))
    truth = 8 * math.pi * INTENSITY + math.pi * math.pi / 4
    np.testing.assert_allclose(light.emission.power, truth, rtol=1e-5)
    of_lamps = light.flux * (np.abs(light.origins).max(axis=1) < 1e-3)[:, None]
    assert_means(BATCHES * of_lamps.reshape(BATCHES, -1, 3).sum(axis=1), 8 * math.pi * INTENSITY)
