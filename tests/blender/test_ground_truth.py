# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles measures irradiance rightly, and leaves the user's file as it was."""

from __future__ import annotations

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from ivg_addon.blender import ground_truth  # noqa: E402
from ivg_addon.blender.ground_truth import cycles_irradiance, irradiance_steps  # noqa: E402
from ivg_addon.core.errors import SceneError, SettingsError  # noqa: E402

from ..core.steps import drain  # noqa: E402
from ..core.z_tests import assert_means  # noqa: E402
from .cycles_scenes import furnace, lit_room, snapshot  # noqa: E402
from .export_scenes import cube_mesh, empty_scene  # noqa: E402

RHO = (0.7, 0.5, 0.2)
RADIANCE = (1.0, 0.5, 2.0)
SEEDS = range(12)


def places(count: int, low: float, high: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(low, high, size=(count, 3)), rng.normal(size=(count, 3))


def uniform_world() -> bpy.types.Scene:
    scene = empty_scene()
    scene.world = bpy.data.worlds.new("World")
    background = scene.world.node_tree.get_output_node("CYCLES").inputs["Surface"].links[0].from_node
    background.inputs["Color"].default_value = (*RADIANCE, 1.0)
    background.inputs["Strength"].default_value = 1.0
    return scene


@pytest.mark.parametrize("component", ["DIRECT", "ALL"])
def test_a_uniform_world_gives_pi_times_its_radiance_to_any_normal(component: str) -> None:
    """Nothing scatters here but what rounding does to a path in a few thousand."""
    points, normals = places(100, -5.0, 5.0)
    found = cycles_irradiance(uniform_world(), points, normals, component=component, samples=64)
    np.testing.assert_allclose(found, np.broadcast_to(np.pi * np.array(RADIANCE), found.shape), rtol=0.02)
    np.testing.assert_allclose(found.mean(axis=0), np.pi * np.array(RADIANCE), rtol=1e-3)


def test_a_uniform_world_alone_gives_no_indirect_light() -> None:
    points, normals = places(20, -5.0, 5.0)
    assert not cycles_irradiance(uniform_world(), points, normals, samples=32).any()


@pytest.mark.parametrize(("component", "bounces"), [("DIRECT", 3), ("INDIRECT", 1), ("INDIRECT", 3), ("ALL", 2)])
def test_furnace(component: str, bounces: int) -> None:
    """In a cube of albedo ρ that emits L, light of bounce b is ρ^b L from everywhere: E = π L Σ ρ^b.

    Direct light is b = 0, indirect 1 … `bounces`: the number counts what a photon's bounces count.
    """
    scene = furnace(RHO, RADIANCE)
    points, normals = places(40, 0.2, 1.8)
    orders = {"DIRECT": [0], "INDIRECT": range(1, bounces + 1), "ALL": range(bounces + 1)}[component]
    truth = np.pi * np.array(RADIANCE) * sum(np.power(RHO, b) for b in orders)
    batches = [
        cycles_irradiance(scene, points, normals, component=component, samples=32, bounces=bounces, seed=seed).mean(
            axis=0
        )
        for seed in SEEDS
    ]
    assert_means(batches, truth)


def test_the_size_of_the_quads_does_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten times larger and smaller, z-tested point by point between two sets of seeds."""
    scene = lit_room()
    points, normals = places(30, 0.65, 1.05)
    measured = []
    for half in (1e-3, 1e-5):
        monkeypatch.setattr(ground_truth, "_HALF_QUAD", half)
        measured.append([cycles_irradiance(scene, points, normals, samples=64, seed=seed) for seed in SEEDS])
    assert_means(np.array(measured[0]) - np.array(measured[1])[::-1], 0.0)


def test_places_far_from_the_origin() -> None:
    """Where coordinates are large and rounding turns small quads."""
    scene = uniform_world()
    points, normals = places(50, 0.0, 1.0)
    found = cycles_irradiance(scene, points + 1000.0, normals, component="DIRECT", samples=32)
    np.testing.assert_allclose(found.mean(axis=0), np.pi * np.array(RADIANCE), rtol=1e-2)


def test_the_error_is_what_estimates_scatter_by() -> None:
    """Its mean square over points and seeds is the variance of the estimates."""
    scene = lit_room()
    points, normals = places(30, 0.65, 1.05)
    found = [drain(irradiance_steps(scene, points, normals, samples=32, seed=seed)) for seed in SEEDS]
    means = np.array([one.irradiance for one in found])
    errors = np.array([one.error for one in found])
    scatter = (means - means.mean(axis=0)) ** 2 * len(SEEDS) / (len(SEEDS) - 1)
    assert_means((errors**2 - scatter).mean(axis=(1, 2)), 0.0)


def test_nothing_of_the_users_file_changes() -> None:
    scene = lit_room()
    scene.cycles.film_exposure, scene.cycles.use_denoising = 2.0, True
    bpy.data.objects["Block"].select_set(True)
    bpy.context.view_layer.objects.active = bpy.data.objects["Block"]
    bpy.ops.object.mode_set(mode="EDIT")
    before = snapshot(scene)
    steps = irradiance_steps(scene, *places(3, 0.2, 0.9), samples=32)
    next(steps)
    next(steps)
    assert snapshot(scene) == before, "between steps"
    steps.close()
    assert snapshot(scene) == before, "closed early"
    drain(irradiance_steps(scene, *places(3, 0.2, 0.9), samples=32))
    assert snapshot(scene) == before, "done"
    bpy.ops.object.mode_set(mode="OBJECT")


_PORTAL = """
import bpy
import numpy as np
from ivg_addon.blender.ground_truth import cycles_irradiance, irradiance_steps
from tests.blender.cycles_scenes import lit_room, snapshot

scene = lit_room()
scene.world = None
bpy.data.objects.remove(bpy.data.objects["Walls"])  # rays must escape
portal = bpy.data.lights.new("Portal", "AREA")
portal.cycles.is_portal = True
scene.collection.objects.link(bpy.data.objects.new("Portal", portal))
if {rigid}:
    bpy.ops.rigidbody.world_add()
before = snapshot(scene)
steps = irradiance_steps(scene, [[1.0, 0.5, 1.0]], [[0.0, 0.0, 1.0]], component="ALL", samples=32)
next(steps)
next(steps)
steps.close()
assert snapshot(scene) == before, "closed early"
try:
    irradiance_steps.__globals__["_FILTERS"]["INDIRECT"] = set()
    cycles_irradiance(scene, [[1.0, 0.5, 1.0]], [[0.0, 0.0, 1.0]])
except Exception as error:
    assert "cannot bake" in str(error), error
assert snapshot(scene) == before, "failed"
found = cycles_irradiance(scene, [[1.0, 0.5, 1.0]], [[0.0, 0.0, 1.0]], component="ALL", samples=32)
assert found.all(), found
assert snapshot(scene) == before, "done"
"""


@pytest.mark.parametrize("rigid", [False, True])
def test_a_portal_needs_no_world(rigid: bool) -> None:
    """Without any world, rays that escape crash Cycles: in a process of its own.

    With rigid bodies the scene is its own stage.
    """
    root = Path(__file__).resolve().parents[2]
    code = _PORTAL.format(rigid=rigid)
    ended = subprocess.run([sys.executable, "-c", code], cwd=root, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0, ended.stderr[-2000:]


def test_nothing_changes_when_it_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = lit_room()
    before = snapshot(scene)
    monkeypatch.setitem(ground_truth._FILTERS, "INDIRECT", set())
    with pytest.raises(SceneError, match="cannot bake 'Room'"):
        cycles_irradiance(scene, *places(3, 0.2, 0.9))
    assert snapshot(scene) == before


def test_scenes_with_rigid_bodies_are_measured_in_place() -> None:
    """Their copy crashes Blender when it is freed."""
    scene = furnace(RHO, RADIANCE)
    bpy.context.view_layer.objects.active = bpy.data.objects["Furnace"]
    bpy.ops.rigidbody.world_add()
    before = snapshot(scene)
    found = cycles_irradiance(scene, *places(20, 0.2, 1.8), component="DIRECT", samples=64)
    np.testing.assert_allclose(found.mean(axis=0), np.pi * np.array(RADIANCE), rtol=0.1)
    assert snapshot(scene) == before


def test_scenes_that_are_not_the_active_one() -> None:
    """Of two scenes, one bright and one dark."""
    bright = furnace(RHO, RADIANCE)
    dark = bpy.data.scenes.new("Dark")
    dark.collection.objects.link(bpy.data.objects.new("Cube", cube_mesh()))
    points, normals = places(5, 0.2, 0.8)
    assert not cycles_irradiance(dark, points, normals, component="ALL", samples=32).any()
    assert cycles_irradiance(bright, points, normals, component="ALL", samples=32).all()


def test_the_users_simplifications_do_not_count() -> None:
    """Neither clamping nor exposure, nor few bounces, nor another engine, nor objects hidden from view."""
    scene = furnace(RHO, RADIANCE)
    scene.render.engine = "BLENDER_WORKBENCH"
    cycles = scene.cycles
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.01
    cycles.max_bounces, cycles.film_exposure, cycles.use_fast_gi = 0, 5.0, True
    bpy.data.objects["Furnace"].hide_set(True)
    found = cycles_irradiance(scene, *places(40, 0.2, 1.8), samples=128, bounces=2)
    truth = np.pi * np.array(RADIANCE) * (np.array(RHO) + np.power(RHO, 2))
    # 5,120 paths in all leave 1 %; a simplification would cost a factor.
    np.testing.assert_allclose(found.mean(axis=0), truth, rtol=0.1)


@pytest.mark.parametrize(
    ("points", "normals", "message"),
    [
        (np.zeros((2, 3)), np.ones((1, 3)), "shape"),
        (np.zeros((0, 3)), np.zeros((0, 3)), "at least 1"),
        (np.full((1, 3), math.nan), np.ones((1, 3)), "finite"),
        (np.zeros((1, 3)), np.zeros((1, 3)), "length zero"),
    ],
)
def test_places_that_are_none_are_refused(points: np.ndarray, normals: np.ndarray, message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        cycles_irradiance(empty_scene(), points, normals)


def test_objects_do_not_see_the_quads() -> None:
    """A hundred quads in the way of the light change nothing at a place behind them."""
    scene = lit_room()
    behind, down = np.array([[0.4, 0.4, 0.1]]), np.array([[0.0, 0.0, 1.0]])
    crowd = np.column_stack([np.full(100, 0.4), np.full(100, 0.4), np.linspace(0.2, 1.8, 100)])
    alone, among = [], []
    for seed in SEEDS:
        alone.append(cycles_irradiance(scene, behind, down, component="ALL", samples=64, seed=seed))
        both = np.concatenate([behind, crowd]), np.repeat(down, 101, axis=0)
        among.append(cycles_irradiance(scene, *both, component="ALL", samples=64, seed=seed + 100)[:1])
    assert_means(np.array(alone) - np.array(among), 0.0)
