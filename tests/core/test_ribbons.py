# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair that is drawn as ribbons, against the closed forms of what ribbons and tubes stop."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ivg_addon.core.bake import prepare_course
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.photon_walk import walk_steps
from ivg_addon.core.progress import finish
from ivg_addon.core.ribbons import as_ribbons
from ivg_addon.core.scene import GLASS, GLOSSY, MATTE, REFRACTION, TRANSLUCENT, TRANSPARENT, Lobes, Scene
from ivg_addon.core.settings import BakeSettings
from ivg_addon.core.strands import Strands, strand_tubes

from .lobe_scenes import arriving, lobe, meet, with_lobes
from .rooms import Part, beam, scene
from .z_tests import assert_means

RADIUS, LENGTH, COUNT, SIDES = 0.01, 0.2, 25, 9
BATCHES = 16


def made_ribbons(of: Scene) -> Scene:
    geometry, materials = as_ribbons(of.geometry, of.materials, np.arange(of.geometry.triangle_count))
    return replace(of, geometry=geometry, materials=materials)


def fence(angle: float, width: float, height: float) -> Scene:
    """Return black upright strands in a row across a beam that makes this angle with them."""
    keys = np.zeros((COUNT, 2, 3), dtype=np.float32)
    keys[:, :, 1] = np.linspace(-1, 1, COUNT)[:, None]
    keys[:, :, 2] = (-LENGTH / 2, LENGTH / 2)
    offsets = (2 * np.arange(COUNT + 1)).astype(np.int32)
    radii = np.full(2 * COUNT, RADIUS, dtype=np.float32)
    mesh = strand_tubes(Strands(offsets, keys.reshape(-1, 3), radii, False, {})).mesh
    direction = np.array([math.sin(angle), 0.0, -math.cos(angle)])
    across = np.cross([0, width, 0], direction) * height / width
    light = beam(-direction, across, (0, width, 0))
    return scene([Part(mesh.positions, mesh.triangle_corners)], ((0.0, 0.0, 0.0),), lights=light)


@pytest.mark.parametrize("degrees", [0.0, 20.0, 70.0])
def test_ribbons_stop_what_faces_the_ray_and_tubes_what_enters_their_ends_too(degrees: float) -> None:
    """2 r l sin θ, and at most the area of the end more (but along the strand, where all comes out again)."""
    angle, width, height = math.radians(degrees), 2.5, 0.5
    side = 2 * RADIUS * LENGTH * math.sin(angle)
    end = (math.pi * RADIUS) ** 2 / (SIDES * math.tan(math.pi / SIDES)) * math.cos(angle) if degrees else 0.0
    settings = BakeSettings((-2, -2, -2), (2, 2, 2), (2, 2, 2), photons=1 << 14, bounces=1)
    lattice = Lattice(settings.bounds_min, settings.bounds_max, settings.resolution)
    tubes = fence(angle, width, height)
    for of, area in ((made_ribbons(tubes), side), (tubes, side + end)):
        course = prepare_course(of, lattice, settings.photons)
        walks = [finish(walk_steps(course, lattice, replace(settings, seed=seed))) for seed in range(BATCHES)]
        assert_means([walk.absorbed[0] for walk in walks], COUNT * area / (width * height))


LOBES = (
    lobe(GLOSSY, (0.3, 0.2, 0.1), roughness=0.4),
    lobe(GLASS, (0.2, 0.3, 0.1), (0.1, 0.2, 0.3), roughness=0.3),
    lobe(REFRACTION, (0.1, 0.05, 0.1), roughness=0.5),
    lobe(TRANSLUCENT, (0.05, 0.1, 0.1)),
    lobe(TRANSPARENT, (0.1, 0.1, 0.05)),
)


@pytest.mark.parametrize("lobes", [LOBES, (lobe(MATTE, 0.4, 0.4, roughness=0.5),), ()])
def test_light_at_the_front_meets_the_material_and_light_at_the_back_nothing(lobes: tuple[Lobes, ...]) -> None:
    plate = Part(np.array([(-10.0, -10, 0), (20, -10, 0), (-10, 20, 0)]), np.array([[0, 1, 2]]))
    plain = scene([plate, plate], ((0.2, 0.1, 0.15),))
    if lobes:
        plain = with_lobes(plain, *lobes)
    ribbon = made_ribbons(plain)
    n = 20_000
    from_behind = meet(ribbon, arriving(-0.3, n), weight=(0.5, 0.7, 0.2))
    assert len(from_behind.photons) == n
    np.testing.assert_array_equal(from_behind.directions, arriving(-0.3, n).astype(np.float32))
    np.testing.assert_array_equal(from_behind.weights, np.float32([[0.5, 0.7, 0.2]] * n))
    assert not from_behind.bounces.any()

    def sent(of: Scene, seed: int) -> np.ndarray:
        """Return what goes up and down of a photon, (2, 3), and in which direction, (3,)."""
        met = meet(of, arriving(0.6, n), seed=seed)
        up = met.directions[:, 2] > 0
        parts = [met.weights[where].sum(axis=0) for where in (up, ~up)]
        return np.stack([*parts, met.directions.sum(axis=0)]) / n

    differences = [sent(ribbon, seed) - sent(plain, 100 + seed) for seed in range(BATCHES)]
    assert_means(differences, 0.0)
    assert sent(ribbon, 0)[1].any() == (len(lobes) > 1), "light goes through"


def test_only_the_front_shines_and_other_triangles_stay() -> None:
    plate = Part(np.array([(0.0, 0, 0), (1, 0, 0), (0, 1, 0)]), np.array([[0, 1, 2]]))
    of = scene([plate, replace(plate, material=1), plate], ((0.1,) * 3, (0.2,) * 3), ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0)))
    geometry, materials = as_ribbons(of.geometry, of.materials, np.array([1, 2]))
    assert materials.back is not None
    sides = np.stack([geometry.material, materials.back[geometry.material]], axis=1)
    emission = [[(1, 2, 3), (1, 2, 3)], [(4, 5, 6), (0, 0, 0)], [(1, 2, 3), (0, 0, 0)]]
    np.testing.assert_array_equal(materials.emission[sides], emission)
    np.testing.assert_allclose(materials.albedo[sides][:, :, 0], [(0.1, 0.1), (0.2, 0), (0.1, 0)])
