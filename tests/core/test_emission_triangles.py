# SPDX-License-Identifier: GPL-3.0-or-later
"""Emissive triangles: both sides, by area and strength, clear of their own surface."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from ivg_addon.core.embree import MISS, Tracer
from ivg_addon.core.errors import SceneError
from ivg_addon.core.scene import VIEW_STEPS

from .emission_checks import (
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
from .z_tests import assert_means

RADIANCE = [(0.0, 0.0, 0.0), (1.0, 3.0, 2.0), (5.0, 0.0, 1.0)]
TRIANGLES = mesh(
    [(0, 0, 0), (1, 0, 0), (0, 2, 0), (0, 0, 1), (0.5, 0, 1), (0, 0.5, 1.5), (3, 3, 3)],
    [(0, 1, 2), (3, 4, 5), (0, 1, 3), (6, 6, 6)],
    [1, 2, 0, 1],
)
UNIT = np.linspace(0.0, 1.0, 17)


def test_power_is_two_pi_radiance_area() -> None:
    light = photons(scene(geometry=TRIANGLES, emission=RADIANCE))
    areas = np.array([1.0, 0.5 * 0.5 * math.hypot(0.5, 0.5)])
    truth = 2 * math.pi * (areas @ np.array(RADIANCE[1:]))
    np.testing.assert_allclose(light.emission.power, truth, rtol=1e-6)
    assert_total(light)


def test_emits_uniformly_from_both_sides_by_lamberts_law() -> None:
    light = photons(scene(geometry=TRIANGLES, emission=RADIANCE))
    first = np.abs(light.origins[:, 2]) < 0.5
    p, d = light.origins[first], light.directions[first]
    np.testing.assert_array_equal(np.sign(p[:, 2]), np.sign(d[:, 2]))
    # Of the triangle x + y/2 < 1 the share below x is 1 − (1 − x)²; y/2 is uniform up to 1 − x.
    four = np.linspace(0.0, 1.0, 5)
    below = 1 - (1 - p[:, 0]) ** 2
    along = 0.5 * p[:, 1] / (1 - p[:, 0])
    counts = histogram(
        (below, four),
        (along, np.r_[0.0, four[1:-1], 1.0001]),
        (d[:, 2] ** 2 * np.sign(d[:, 2]), np.linspace(-1.0, 1.0, 9)),
        (azimuth(d[:, 0], d[:, 1]), four),
    )
    assert_distribution(counts, np.full((4, 4, 8, 4), 1 / 512))


def test_lights_a_parallel_rectangle() -> None:
    """Two opposite unit squares one apart: form factor 0.1998 (Howell, catalogue, C-11)."""
    square = mesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)], [0, 0])
    light = photons(scene(geometry=square, emission=[RADIANCE[1]]))
    root = math.sqrt(2)
    factor = (2 / math.pi) * (math.log(2 / math.sqrt(3)) + 2 * root * math.atan(1 / root) - math.pi / 2)
    for sign in (1.0, -1.0):
        received = through(light, (0.5, 0.5, sign), axis=2, half=(0.5, 0.5), sign=sign)
        assert_flux(light, received, math.pi * factor * np.array(RADIANCE[1]))


@pytest.mark.parametrize("offset", [0.0, 300.0])
def test_no_photon_starts_behind_its_own_surface(offset: float) -> None:
    """From a closed shape's outside no photon meets it, from its inside every one does; also far from the origin."""
    rng = np.random.default_rng(3)
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    triangles = [(a, b, c) for a, b, c, _ in quads] + [(a, c, d) for a, _, c, d in quads]
    cube = mesh(corners @ turn.T + offset, triangles, [0] * 12)
    light = photons(scene(geometry=cube, emission=[RADIANCE[1]]), n=1 << 16)
    hits = Tracer(cube).intersect(light.origins.astype(np.float32), light.directions.astype(np.float32))
    missed = int((hits.triangle == MISS).sum())
    n = len(hits.triangle)
    # Half of them start outside of a convex shape: binomial, with the false-alarm rate of `LARGEST_Z`.
    assert abs(missed - n / 2) < 5 * math.sqrt(n) / 2
    assert (hits.distance[hits.triangle != MISS] > 1e-4).mean() > 0.999


def test_objects_that_diffuse_rays_do_not_see_light_nothing() -> None:
    hidden = dataclasses.replace(
        scene(geometry=TRIANGLES, emission=RADIANCE), diffuse_visible=np.zeros(1, dtype=np.bool_)
    )
    with pytest.raises(SceneError, match="no light"):
        photons(hidden)


def test_shines_towards_directions_as_its_view_tells() -> None:
    """By 3μ/2, which is 1 on average: power towards the cosine μ grows with its square."""
    steps = np.linspace(0.0, 1.0, VIEW_STEPS, dtype=np.float32)
    view = np.repeat(1.5 * steps[None, :, None], 3, axis=2)
    square = mesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)], [0, 0])
    plain = scene(geometry=square, emission=[RADIANCE[1]])
    light = photons(dataclasses.replace(plain, materials=dataclasses.replace(plain.materials, emission_view=view)))
    np.testing.assert_allclose(light.emission.power, 2 * math.pi * np.array(RADIANCE[1]), rtol=1e-6)
    assert_total(light)
    # Of a unit of power μ³ goes to cosines below μ: ∫ 3 μ² dμ.
    cosine, carried = np.abs(light.directions[:, 2]), light.flux[:, 1]
    batches = np.array_split(np.arange(len(cosine)), 32)
    shares = [[(carried[b] * (cosine[b] < m)).sum() / carried[b].sum() for m in (0.4, 0.7)] for b in batches]
    assert_means(shares, np.array([0.4, 0.7]) ** 3)
