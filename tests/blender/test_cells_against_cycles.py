# SPDX-License-Identifier: GPL-3.0-or-later
"""One cell's mean irradiance against Cycles: hair, point clouds, and what rays do not see.

A vertex's value towards an axis is the mean of E(p, axis) over the points p of its dual cell; Cycles computes E at
random points of it. Both sides are means of independent samples. Points larger by 10 % would fail, or
hair thicker by 20 %.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import bpy
import numpy as np
import pytest

from ivg_addon.blender.export import export_render_steps
from ivg_addon.blender.ground_truth import irradiance_steps
from ivg_addon.core.bake import prepare_course
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.photon_walk import walk_steps
from ivg_addon.core.progress import finish
from ivg_addon.core.scene import Scene
from ivg_addon.core.settings import BakeSettings
from tests.blender.cycles_scenes import plain
from tests.blender.export_scenes import add_object, cube_mesh, empty_scene, point_cloud

FALSE_ALARM = 1e-5
"""Chance that a right case fails with another seed."""
LOW, HIGH = (-1.0, -1.0, 0.1), (1.0, 1.0, 0.9)
"""A grid of 2 × 2 × 2 voxels: the cell of its middle vertex reaches halfway to its bounds."""
BATCHES, PHOTONS = 64, 1 << 16
POINTS, SAMPLES = 1024, 32
GREY, COPPER = (0.6, 0.6, 0.6), (0.8, 0.5, 0.3)


def plate(**values: object) -> bpy.types.Object:
    mesh = cube_mesh("Plate", 1.0)
    mesh.materials.append(plain("Copper", COPPER))
    return add_object("Plate", mesh, location=(-0.6, -0.5, 1.2), scale=(1.2, 1.0, 0.02), **values)


def hair(shape: str, straight: bool = False) -> None:
    bpy.context.scene.cycles_curves.shape = shape
    rng = np.random.default_rng(3)
    count, keys = 250, 6
    directions = rng.normal(size=(count, 1, 3))
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    positions = directions * np.linspace(0.1, 0.5, keys)[:, None] + 0.01 * rng.normal(size=(count, keys, 3))
    fur = bpy.data.hair_curves.new("Fur")
    fur.add_curves([keys] * count)
    fur.position_data.foreach_set("vector", positions.astype(np.float32).ravel())
    radius = fur.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.tile(np.linspace(0.008, 0.002, keys), count).astype(np.float32))
    if straight:
        fur.set_types(type="POLY")
    fur.materials.append(plain("Copper", COPPER))
    add_object("Fur", fur, location=(0.1, 0.0, 1.5), scale=(1.0, -1.0, 1.0), rotation_euler=(0.3, 0.2, 0.1))


def points() -> None:
    rng = np.random.default_rng(4)
    cloud = point_cloud(rng.normal(scale=0.3, size=(300, 3)), rng.uniform(0.02, 0.08, 300))
    cloud.data.materials.append(plain("Copper", COPPER))
    cloud.location = (0.0, 0.0, 1.7)


def fur_on_a_ball() -> None:
    bpy.ops.mesh.primitive_uv_sphere_add(radius=0.3, location=(0.0, 0.0, 1.6))
    ball = bpy.context.object
    ball.data.materials.append(plain("Copper", COPPER))
    ball.modifiers.new("Fur", "PARTICLE_SYSTEM")
    settings = ball.particle_systems[0].settings
    settings.type, settings.count, settings.hair_length = "HAIR", 800, 0.4
    settings.root_radius, settings.tip_radius, settings.radius_scale = 1.0, 0.2, 0.008
    bpy.context.scene.cycles_curves.shape = "THICK"


def in_indirect_only_collection() -> None:
    collection = bpy.data.collections.new("Indirect")
    bpy.context.scene.collection.children.link(collection)
    made = plate()
    bpy.context.scene.collection.objects.unlink(made)
    collection.objects.link(made)
    bpy.context.view_layer.layer_collection.children["Indirect"].indirect_only = True


CASES: dict[str, Callable[[], object]] = {
    "plate": plate,
    "no shadow": lambda: plate(visible_shadow=False),
    "no diffuse": lambda: plate(visible_diffuse=False),
    "neither": lambda: plate(visible_diffuse=False, visible_shadow=False),
    "camera off": lambda: plate(visible_camera=False, visible_glossy=False, visible_transmission=False),
    "holdout": lambda: plate(is_holdout=True),
    "shadow catcher": lambda: plate(is_shadow_catcher=True),
    "indirect only": in_indirect_only_collection,
    "point cloud": points,
    "hair, ribbons": lambda: hair("RIBBONS"),
    "hair, tubes": lambda: hair("THICK"),
    "hair, straight tubes": lambda: hair("THICK_LINEAR"),
    "hair of particles": fur_on_a_ball,
    "hair, straight curves": lambda: hair("RIBBONS", straight=True),
}


@pytest.mark.parametrize("case", CASES)
def test_mean_over_a_cell(case: str) -> None:
    scene = empty_scene()
    floor = bpy.data.meshes.new("Floor")
    floor.from_pydata([(-3, -3, 0), (3, -3, 0), (3, 3, 0), (-3, 3, 0)], [], [(0, 1, 2, 3)])
    floor.materials.append(plain("Grey", GREY))
    add_object("Floor", floor)
    lamp = bpy.data.lights.new("Lamp", "POINT")
    lamp.energy, lamp.shadow_soft_size = 200.0, 0.0
    add_object("Lamp", lamp, location=(0.3, -0.2, 3.0))
    CASES[case]()
    bpy.context.view_layer.update()
    exported = finish(export_render_steps(scene, bpy.context.view_layer))
    axis, sign = np.arange(6) // 2, np.array([1, -1] * 3)
    vectors = middle_vectors(exported)
    baked = vectors[:, np.arange(6), :, axis].transpose(1, 0, 2) * sign[:, None]

    rng = np.random.default_rng(5)
    middle, half = (np.add(LOW, HIGH) / 2, np.subtract(HIGH, LOW) / 4)
    normals = np.zeros((6, 3))
    normals[np.arange(6), axis] = sign
    places = middle + half * rng.uniform(-1, 1, (POINTS * 6, 3))
    asked = irradiance_steps(scene, places, np.tile(normals, (POINTS, 1)), samples=SAMPLES, bounces=4)
    cycles = finish(asked).irradiance.reshape(POINTS, 6, 3)

    assert cycles.mean() > 0
    deviations = [deviation(baked, cycles), deviation(baked.sum(axis=(1, 2)), cycles.sum(axis=(1, 2)))]
    z = np.concatenate([np.ravel(each) for each in deviations])
    p = z.size * math.erfc(float(z.max()) / math.sqrt(2))
    assert p >= FALSE_ALARM, f"{z.max():.1f} standard errors; {baked.mean(axis=0) / cycles.mean(axis=0)}"


def middle_vectors(exported: Scene) -> np.ndarray:
    """Return the middle vertex's vectors of independent walks, (batches, 6, 3 channel, 3)."""
    settings = BakeSettings(LOW, HIGH, (2, 2, 2), photons=PHOTONS, bounces=4)
    lattice = Lattice(settings.bounds_min, settings.bounds_max, settings.resolution)
    course = prepare_course(exported, lattice, PHOTONS)
    scale = course.emission.flux_scale / PHOTONS
    walks = (finish(walk_steps(course, lattice, replace(settings, seed=seed))) for seed in range(BATCHES))
    return np.stack([each.tally.vectors(scale)[1, 1, 1] for each in walks]).astype(np.float64)


def deviation(baked: np.ndarray, cycles: np.ndarray) -> np.ndarray:
    """Return by how many standard errors the means over the first axes differ.

    Welch's t with the fewest degrees of freedom that it may have, as a z by Wallace: see tests/core/z_tests.py.
    """
    difference = baked.mean(axis=0) - cycles.mean(axis=0)
    error2 = baked.var(axis=0, ddof=1) / BATCHES + cycles.var(axis=0, ddof=1) / POINTS
    # Where nothing scatters, as where no light comes from, only equal numbers will do.
    t2 = np.where(difference == 0.0, 0.0, difference**2 / np.maximum(error2, 1e-300))
    freedom = BATCHES - 1
    return np.sqrt(freedom * np.log1p(t2 / freedom)) * (8 * freedom + 1) / (8 * freedom + 3)
