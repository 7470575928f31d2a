# SPDX-License-Identifier: GPL-3.0-or-later
"""Light linking and bounce limits: who is lit, who shades, and when light ends."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from ivg_addon.core.bake import bake
from ivg_addon.core.embree import MISS, Hits, Tracer
from ivg_addon.core.emission import prepare_emission
from ivg_addon.core.light_rules import LightRules
from ivg_addon.core.lights import NO_LIMIT, AreaLights, Lights, PointLights
from ivg_addon.core.restricted_light import RestrictedLight
from ivg_addon.core.scene import Scene
from ivg_addon.core.settings import BakeSettings

from .emission_checks import array, mesh, scene
from .z_tests import assert_means

N = 1 << 16
BATCHES = 16
FLOOR, SHELF, PLATE = range(3)


def square(half: float, z: float) -> list[tuple[float, float, float]]:
    return [(-half, -half, z), (half, -half, z), (half, half, z), (-half, half, z)]


def stack(rules: LightRules | None, *, radius: float = 0.0, group: int = 1) -> Scene:
    """Return a lamp at the origin above a plate, a shelf and a floor, objects that all subtend the same angle."""
    geometry = mesh(
        square(3.0, -3.0) + square(2.0, -2.0) + square(1.0, -1.0),
        [(4 * o + a, 4 * o + b, 4 * o + c) for o in range(3) for a, b, c in ((0, 1, 2), (0, 2, 3))],
        [0] * 6,
    )
    geometry = dataclasses.replace(geometry, object=np.repeat(np.arange(3, dtype=np.int32), 2))
    lamp = PointLights(
        names=("Lamp",),
        position=array((0, 0, 0)),
        radius=array(radius),
        soft_falloff=np.array([True]),
        intensity=array((1, 0.5, 0.25)),
        cos_half_angle=array(-1.0),
        blend=array(0.0),
        axes=array(np.eye(3)),
    )
    lights = Lights(world=array(0, 0, 0), point=lamp, group=np.full(1, group, dtype=np.int32))
    of = scene(lights, geometry, [(0, 0, 0)])
    return dataclasses.replace(of, light_rules=rules)


def rules(receives: tuple[int, ...], blocks: tuple[int, ...], others: bool = True) -> LightRules:
    """Return rules by which the lamp lights, and is blocked by, some objects alone."""

    def mask(objects: tuple[int, ...]) -> np.ndarray:
        return np.array([3 if o in objects else 1 for o in range(3)], dtype=np.uint64)

    return LightRules(
        object_group=np.zeros(3, dtype=np.int32),
        receives=mask(receives),
        blocks=mask(blocks),
        lights_others=np.array([True, others]),
    )


def first_flights(of: Scene, seed: int = 3, flight: int = 0, bounces: int = 0) -> tuple[np.ndarray, Hits, np.ndarray]:
    """Return the flux per photon at the surface that it meets (n, 3), what it meets, and its direction."""
    emission = prepare_emission(of, (-4, -4, -4), (4, 4, 4))
    origins, directions, weights = (np.empty((N, 3), dtype=np.float32) for _ in range(3))
    dark = np.empty(N, dtype=np.float32)
    emission.emit(seed, 0, origins, directions, weights, dark)
    tracer = Tracer(of.geometry)
    hits = tracer.intersect(origins, directions)
    restricted = RestrictedLight.of(of, emission)
    assert restricted is not None
    bounces = np.full(N, bounces, dtype=np.int16)
    factor = restricted.follow(tracer, seed, flight, np.arange(N), bounces, origins, directions, dark, hits)
    return weights * factor[:, None] * (emission.flux_scale / N), hits, directions


def received(flux: np.ndarray, hits: Hits, target: int) -> np.ndarray:
    """Return the watts that an object receives, (batches, 3)."""
    meets = (hits.triangle != MISS) & (hits.triangle // 2 == target)
    return BATCHES * (flux * meets[:, None]).reshape(BATCHES, -1, 3).sum(axis=1)


# A square seen under the solid angle of a cube's face.
LIGHT = np.array((1.0, 0.5, 0.25)) * 4 * math.pi / 6


@pytest.mark.parametrize("radius", [0.0, 0.05])
def test_light_that_nothing_blocks_lights_everything_in_its_way(radius: float) -> None:
    flux, hits, _ = first_flights(stack(rules((FLOOR, SHELF, PLATE), ()), radius=radius))
    for target in (FLOOR, SHELF, PLATE):
        truth = LIGHT if radius == 0.0 else received(flux, hits, FLOOR).mean(axis=0)
        assert_means(received(flux, hits, target), truth)
    assert (hits.distance > 1e30).all()


def test_what_does_not_block_is_lit_as_well_as_what_is_behind() -> None:
    flux, hits, directions = first_flights(stack(rules((FLOOR, SHELF, PLATE), (SHELF,))))
    assert_means(received(flux, hits, PLATE), LIGHT)
    assert_means(received(flux, hits, SHELF), LIGHT)
    assert not received(flux, hits, FLOOR).any()
    downwards = hits.distance < 1e30
    np.testing.assert_allclose((hits.distance * directions[:, 2])[downwards], -2.0, rtol=1e-5)


def test_light_that_passed_something_transparent_is_as_restricted() -> None:
    flux, hits, _ = first_flights(stack(rules((FLOOR, SHELF, PLATE), (SHELF,))), flight=2)
    assert_means(received(flux, hits, PLATE), LIGHT)
    assert_means(received(flux, hits, SHELF), LIGHT)


def test_reflected_light_knows_no_restriction() -> None:
    flux, hits, _ = first_flights(stack(rules((FLOOR,), (FLOOR,))), bounces=1)
    assert_means(received(flux, hits, PLATE), LIGHT)
    assert not received(flux, hits, FLOOR).any()


def test_what_is_no_receiver_shades_and_stays_dark() -> None:
    flux, hits, directions = first_flights(stack(rules((FLOOR, SHELF), (FLOOR, PLATE))))
    assert (hits.triangle == MISS).all()
    downwards = hits.distance < 1e30
    np.testing.assert_allclose((hits.distance * directions[:, 2])[downwards], -1.0, rtol=1e-5)
    assert flux.sum() > 0.0


def test_what_is_neither_is_as_good_as_absent() -> None:
    flux, hits, _ = first_flights(stack(rules((FLOOR,), (FLOOR,))))
    assert_means(received(flux, hits, FLOOR), LIGHT)
    assert not received(flux, hits, PLATE).any()
    # There is no other surface to choose: every photon has its own weight.
    assert len(np.unique(flux[:, 0])) == 1


def test_light_for_some_objects_alone_is_not_in_the_air() -> None:
    _, hits, _ = first_flights(stack(rules((FLOOR,), (FLOOR,), others=False)))
    assert not hits.distance.any()


def test_scenes_without_restrictions_have_none() -> None:
    for of in (stack(None), stack(rules((), ()), group=0)):
        assert RestrictedLight.of(of, prepare_emission(of, (-4, -4, -4), (4, 4, 4))) is None


SETTINGS = BakeSettings(
    bounds_min=(-1, -1, -1), bounds_max=(1, 1, 1), resolution=(2, 2, 2), photons=1 << 12, bounces=6, lit_points=0
)


def box(limit: int) -> Scene:
    """Return a white box around an area light whose bounces are limited."""
    x = [-1.0, 1.0]
    corners = [(a, b, c) for a in x for b in x for c in x]
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [(a, b, c) for a, b, c, _ in quads] + [(a, c, d) for a, _, c, d in quads]
    panel = AreaLights(
        names=("Panel",),
        center=array((0, 0, 0)),
        edge_u=array((0.5, 0, 0)),
        edge_v=array((0, 0.5, 0)),
        direction=array((0, 0, -1)),
        elliptic=np.array([False]),
        half_spread=array(math.pi / 2),
        radiance=array((1, 1, 1)),
    )
    of = scene(
        Lights(world=array(0, 0, 0), area=panel, max_bounces=np.full(1, limit, dtype=np.int32)),
        mesh(corners, triangles, [0] * 12),
        [(0, 0, 0)],
    )
    edges = np.array(corners)[np.array(triangles)]
    normals = np.cross(edges[:, 1] - edges[:, 0], edges[:, 2] - edges[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    flat = np.repeat(normals[:, None, :], 3, axis=1).astype(np.float32)
    white = dataclasses.replace(of.materials, albedo=np.full((1, 3), 0.8, dtype=np.float32))
    return dataclasses.replace(
        of,
        geometry=dataclasses.replace(of.geometry, corner_normals=flat),
        materials=white,
    )


@pytest.mark.parametrize("limit", [0, 1, 3])
def test_light_ends_after_its_bounces(limit: int) -> None:
    """To the bit as if the bake itself ended there."""
    limited = bake(box(limit), SETTINGS)
    whole = bake(box(NO_LIMIT), dataclasses.replace(SETTINGS, bounces=max(limit, 1)))
    expected = whole.grid.vectors if limit else np.zeros_like(whole.grid.vectors)
    np.testing.assert_array_equal(limited.grid.vectors, expected)
    energy = np.sum([limited.statistics.absorbed, limited.statistics.escaped, limited.statistics.cut], axis=0)
    assert limited.grid.vectors.any() == (limit > 0)
    if limit:
        # What Russian roulette takes is right on average only.
        np.testing.assert_allclose(energy, limited.statistics.emitted, rtol=0.1)


def test_restrictions_do_not_depend_on_threads() -> None:
    of = dataclasses.replace(stack(rules((FLOOR, SHELF, PLATE), (SHELF,))), materials=box(1).materials)
    settings = dataclasses.replace(SETTINGS, photons=1 << 18, include_direct=True)
    one, two = (bake(of, dataclasses.replace(settings, threads=threads)).grid.vectors for threads in (1, 2))
    assert one.any()
    np.testing.assert_array_equal(one, two)
