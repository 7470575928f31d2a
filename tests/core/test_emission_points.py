# SPDX-License-Identifier: GPL-3.0-or-later
"""Points, spheres, soft falloff and spots: directions, starting places, power, and light received."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ivg_addon.core.embree import MISS
from ivg_addon.core.emission import leave_darkness
from ivg_addon.core.lights import Lights, PointLights

from .emission_checks import (
    Photons,
    array,
    assert_distribution,
    assert_flux,
    assert_total,
    azimuth,
    histogram,
    photons,
    scene,
    through,
)

CENTER = np.array([0.2, -0.1, 0.3])
INTENSITY = np.array([1.0, 4.0, 2.0])
TILTED = np.array([[0.8, -0.6, 0.0], [0.36, 0.48, -0.8], [0.48, 0.64, 0.6]])
UNIT = np.linspace(0.0, 1.0, 17)


def point_light(
    radius: float = 0.0,
    soft: bool = False,
    half_angle: float = 180.0,
    blend: float = 0.0,
    axes: np.ndarray = TILTED,
) -> Photons:
    """Return photons of one light at `CENTER` with `INTENSITY`."""
    lights = Lights(
        world=array(0, 0, 0),
        point=PointLights(
            names=("Lamp",),
            position=array(CENTER),
            radius=array(radius),
            soft_falloff=np.array([soft]),
            intensity=array(INTENSITY),
            cos_half_angle=array(math.cos(math.radians(half_angle))),
            blend=array(blend),
            axes=array(axes),
        ),
    )
    return photons(scene(lights))


def solid_angle(a: float, b: float, h: float) -> float:
    """Return the solid angle of the rectangle (0, a) × (0, b) seen from a height h above its corner."""
    return math.atan(a * b / (h * math.sqrt(a * a + b * b + h * h)))


def test_point_shines_alike_in_all_directions() -> None:
    light = point_light()
    np.testing.assert_array_equal(light.origins, np.tile(array(CENTER), (len(light.dark), 1)))
    np.testing.assert_allclose(light.emission.power, 4 * math.pi * INTENSITY, rtol=1e-6)
    d = light.directions
    uniform = np.full((16, 16), 1 / 256)
    assert_distribution(histogram((0.5 - 0.5 * d[:, 2], UNIT), (azimuth(d[:, 0], d[:, 1]), UNIT)), uniform)


def test_point_lights_a_rectangle_by_its_solid_angle() -> None:
    light = point_light()
    received = through(light, np.add(CENTER, (0.3, 0.4, -0.5)), axis=2, half=(0.3, 0.4), sign=-1.0)
    assert_flux(light, received, INTENSITY * solid_angle(0.6, 0.8, 0.5))


@pytest.mark.parametrize("radius", [0.01, 0.3])
def test_sphere_starts_at_its_surface_by_lamberts_law(radius: float) -> None:
    light = point_light(radius)
    normal = (light.origins - CENTER) / radius
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1.0, atol=1e-4)
    cosine = (normal * light.directions).sum(axis=1)
    uniform = np.full((16, 8, 8), 1 / 1024)
    eight = np.linspace(0.0, 1.0, 9)
    counts = histogram(
        (cosine**2, np.r_[0.0, UNIT[1:-1], 1.001]),
        (0.5 - 0.5 * np.clip(normal[:, 2], -1, 1), eight),
        (azimuth(normal[:, 0], normal[:, 1]), eight),
    )
    assert_distribution(counts, uniform)


def test_sphere_lights_a_coaxial_disk_like_a_point() -> None:
    """The form factor from a sphere to a disk ahead of it depends on the disk's angle only (Howell, C-129)."""
    q, h = 0.5, 0.6
    light = point_light(radius=0.4)
    offset = light.origins - CENTER
    with np.errstate(divide="ignore"):
        t = (h - offset[:, 2]) / light.directions[:, 2]
    point = offset + t[:, None] * light.directions
    hit = (t > 0.0) & (np.hypot(point[:, 0], point[:, 1]) < q)
    share = 0.5 * (1 - h / math.hypot(h, q))
    assert_flux(light, hit, 4 * math.pi * INTENSITY * share)


def test_soft_falloff_lights_what_faces_it_like_a_disk_turned_towards_it() -> None:
    """At a distance d, facing the light: E = I / (r² + d²), also closer than the radius."""
    radius = 0.3
    light = point_light(radius, soft=True)
    for d in (0.15, 0.5, 3.0):
        # All light that flies outwards through the sphere of radius d around the light.
        closest = np.linalg.norm(np.cross(light.origins - CENTER, light.directions), axis=1)
        lit = np.hypot(closest, light.dark) < d
        # A flight arrives at the cosine √(1 − b²/d²): irradiance along the normal counts it once.
        assert_flux(light, lit, 4 * math.pi * d * d * INTENSITY / (radius**2 + d * d))


def test_soft_falloff_lights_a_plane() -> None:
    """Irradiance of a rectangle, by quadrature over it and over the disk that each of its points sees."""
    radius, h = 0.4, 0.5
    light = point_light(radius, soft=True)
    received = through(light, np.add(CENTER, (0.5, 0.1, -h)), axis=2, half=(0.25, 0.35), sign=-1.0)

    nodes, weights = np.polynomial.legendre.leggauss(16)
    u, v = np.meshgrid(0.5 + 0.25 * nodes, 0.1 + 0.35 * nodes, indexing="ij")
    p = np.stack([u, v, np.full_like(u, -h)], axis=-1)
    d = np.linalg.norm(p, axis=-1, keepdims=True)
    normal = p / d
    e1 = np.cross(normal, (0.0, 0.0, 1.0))
    e1 /= np.linalg.norm(e1, axis=-1, keepdims=True)
    e2 = np.cross(normal, e1)
    irradiance = np.zeros(p.shape[:2])
    for rho, rho_weight in zip(0.5 * radius * (nodes + 1), 0.5 * radius * weights, strict=True):
        for angle in 2 * math.pi * np.arange(32) / 32:
            q = rho * (math.cos(angle) * e1 + math.sin(angle) * e2)
            way = q - p
            distance = np.linalg.norm(way, axis=-1)
            cos_light = -(way * normal).sum(axis=-1) / distance
            cos_plane = np.clip(way[..., 2] / distance, 0.0, None)
            irradiance += rho * rho_weight / 32 * 2 * math.pi * cos_light * cos_plane / distance**2
    mean = (irradiance * np.outer(weights, weights)).sum() / 4
    truth = mean * 0.5 * 0.7 / (math.pi * radius**2)
    assert_flux(light, received, INTENSITY * truth)


def test_darkness_ends_or_a_surface_ends_the_photon() -> None:
    light = point_light(0.3, soft=True)
    assert light.emission.flies_dark
    assert not point_light(0.3).emission.flies_dark
    origins = array((0, 0, 0), (0, 0, 0), (0, 0, 0))
    directions = array((1, 0, 0), (0, 1, 0), (0, 0, 1))
    triangle, distance, dark = np.array([4, 5, 6], dtype=np.int32), array(2.0, 0.4, 3.0), array(0.5, 0.5, 0.0)
    leave_darkness(origins, directions, dark, triangle, distance, np.zeros(7, dtype=np.int32), np.array([False]))
    np.testing.assert_array_equal(origins, array((0.5, 0, 0), (0, 0, 0), (0, 0, 0)))
    np.testing.assert_array_equal(triangle, [4, MISS, 6])
    np.testing.assert_array_equal(distance, array(1.5, 0.0, 3.0))


def test_darkness_goes_on_behind_what_lets_light_pass() -> None:
    origins, directions = array((0, 0, 0), (0, 0, 0)), array((1, 0, 0), (0, 1, 0))
    triangle, distance, dark = np.array([0, 1], dtype=np.int32), array(0.25, 0.25), array(0.75, 0.75)
    leave_darkness(
        origins, directions, dark, triangle, distance, np.array([0, 1], dtype=np.int32), np.array([True, False])
    )
    np.testing.assert_array_equal(triangle, [0, MISS])
    np.testing.assert_array_equal(distance, 0.0)
    assert dark[0] == 0.5
    np.testing.assert_array_equal(origins, 0.0)


@pytest.mark.parametrize("blend", [0.0, 0.15, 1.0])
@pytest.mark.parametrize("half_angle", [20.0, 75.0])
def test_spot_shines_by_its_smooth_step(half_angle: float, blend: float) -> None:
    light = point_light(half_angle=half_angle, blend=blend)
    c = math.cos(math.radians(half_angle))
    np.testing.assert_allclose(light.emission.power, 2 * math.pi * (1 - c) * (1 - blend / 2) * INTENSITY, rtol=1e-5)
    d = light.directions @ TILTED * (1.0, 1.0, -1.0)
    x = (d[:, 2] - c) / (1 - c)
    # ∫ f from the edge of the cone: β (t³ − t⁴/2) in the rise, then linear; the first bins are empty.
    rise = np.minimum(UNIT / max(blend, 1e-9), 1.0)
    distribution = blend * (rise**3 - rise**4 / 2) + np.maximum(UNIT - blend, 0.0)
    keep = np.r_[0, np.flatnonzero(distribution > 0.004)]
    expected = np.diff(distribution[keep] / distribution[-1])[:, None] * np.full(16, 1 / 16)
    edges = UNIT[keep].copy()
    edges[0], edges[-1] = -1e-4, 1.0001
    counts = histogram((x, edges), (azimuth(d[:, 0], d[:, 1]), UNIT))
    assert_distribution(counts, expected)
    assert_distribution(counts.sum(axis=1), expected.sum(axis=1))


SCALES = {
    "ellipse": TILTED @ np.diag([1.0, 2.0, 1.0]),
    "narrowed": TILTED @ np.diag([0.5, 0.7, 2.0]),
    "mirrored": TILTED @ np.diag([-1.0, 0.6, 1.5]),
    "sheared": TILTED @ np.array([[1.0, 0.3, 0.0], [0.0, 0.8, 0.4], [0.0, 0.0, 1.0]]),
}


@pytest.mark.parametrize("scale", SCALES)
def test_unevenly_scaled_spot_shines_where_cycles_lets_it(scale: str) -> None:
    """Intensity times attenuation of the direction in the light's own space, over a grid of world directions."""
    axes = SCALES[scale]
    c, blend = math.cos(math.radians(50.0)), 0.4
    light = point_light(half_angle=50.0, blend=blend, axes=axes)

    # 32 × 32 bins of equal solid angle, 64 × 64 points in each.
    fine = (np.arange(2048) + 0.5) / 2048
    z = 1 - 2 * fine[:, None]
    s = np.sqrt(1 - z * z)
    world = np.stack([s * np.cos(2 * np.pi * fine), s * np.sin(2 * np.pi * fine), z + 0 * fine], axis=-1)
    own = world @ np.linalg.inv(axes).T
    t = np.clip((-own[..., 2] / np.linalg.norm(own, axis=-1) - c) / ((1 - c) * blend), 0.0, 1.0)
    attenuation = (t * t * (3 - 2 * t)).reshape(32, 64, 32, 64).mean(axis=(1, 3))
    np.testing.assert_allclose(light.emission.power, 4 * math.pi * attenuation.mean() * INTENSITY, rtol=1e-4)

    there = light.flux[:, 0] > 0.0
    assert there.mean() > 0.9
    d = light.directions[there]
    edges = np.linspace(0.0, 1.0, 33)
    counts = histogram((0.5 - 0.5 * d[:, 2], edges), (azimuth(d[:, 0], d[:, 1]), edges))
    probability = attenuation / attenuation.sum()
    assert counts[probability == 0.0].sum() == 0
    likely = probability > 2e-4
    rest = counts[~likely].sum(), probability[~likely].sum()
    assert_distribution(np.r_[counts[likely], rest[0]], np.r_[probability[likely], rest[1]])
    assert_total(light)
