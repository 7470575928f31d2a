# SPDX-License-Identifier: GPL-3.0-or-later
"""The sample scenes are what they promise to be, and the script beside them still makes them."""

from __future__ import annotations

import importlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")
Vector = pytest.importorskip("mathutils").Vector

SAMPLE_DIR = Path(__file__).resolve().parents[2] / "sample_blend"
MAX_BYTES = 300_000
# Positions are single precision and the rooms 25 m long: a few units in the last place.
POSITION_TOLERANCE = 2e-5


@dataclass(frozen=True)
class Promise:
    """What a sample promises: picture size, lights by type, evaluated triangles, extent in metres."""

    resolution: tuple[int, int]
    lights: dict[str, int]
    triangles: tuple[int, int]
    size: tuple[float, float, float] | None
    detailed: tuple[str, ...] = ()


PROMISES = {
    "cornell": Promise((256, 256), {"AREA": 1}, (34, 34), (5.528, 5.592, 5.488)),
    "cornell_tilted": Promise((256, 256), {"AREA": 1}, (34, 34), None),
    "two_rooms": Promise((320, 180), {"AREA": 1}, (50_000, 100_000), (7.5, 23.0, 5.0), ("Torus Knot",)),
    "gallery": Promise(
        (320, 180),
        {"SPOT": 7, "AREA": 2, "POINT": 2},
        (80_000, 150_000),
        (8.5, 24.5, 5.0),
        ("Meteorite", "Flame", "Coral Knot"),
    ),
    "semi_dynamic": Promise(
        (320, 180), {"AREA": 1, "SPOT": 1, "POINT": 1}, (40_000, 60_000), (7.5, 5.5, 3.7), ("Stone",)
    ),
}

every_sample = pytest.mark.parametrize("name", PROMISES)


@pytest.fixture(scope="module", autouse=True)
def _leave_an_empty_session() -> Iterator[None]:
    yield
    bpy.ops.wm.read_homefile(use_empty=True)


def open_sample(name: str) -> bpy.types.Scene:
    """Open a committed sample and return its scene."""
    bpy.ops.wm.open_mainfile(filepath=str(SAMPLE_DIR / f"{name}.blend"), load_ui=False)
    return bpy.context.scene


def evaluated_meshes() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return world-space vertices (n, 3) and triangles (m, 3) of every mesh, modifiers applied."""
    depsgraph = bpy.context.evaluated_depsgraph_get()
    found = {}
    for thing in bpy.context.scene.objects:
        if thing.type != "MESH":
            continue
        evaluated = thing.evaluated_get(depsgraph)
        mesh = evaluated.to_mesh()
        vertices = np.empty((len(mesh.vertices), 3), dtype=np.float32)
        mesh.vertices.foreach_get("co", vertices.ravel())
        triangles = np.empty((len(mesh.loop_triangles), 3), dtype=np.int32)
        mesh.loop_triangles.foreach_get("vertices", triangles.ravel())
        matrix = np.array(evaluated.matrix_world)
        found[thing.name] = (vertices @ matrix[:3, :3].T + matrix[:3, 3], triangles)
        evaluated.to_mesh_clear()
    return found


def data_names() -> dict[str, list[str]]:
    """Return the names of all data that a sample is made of, by kind."""
    kinds = ("objects", "meshes", "materials", "lights", "cameras", "images", "textures", "worlds")
    return {kind: [data.name for data in getattr(bpy.data, kind)] for kind in kinds}


@every_sample
def test_is_small_and_written_by_the_oldest_blender(name: str) -> None:
    """The file weighs little and opens in every Blender that the extension supports."""
    open_sample(name)
    assert (SAMPLE_DIR / f"{name}.blend").stat().st_size < MAX_BYTES
    assert tuple(bpy.data.version)[:2] == (5, 0)


@every_sample
def test_renders_without_bias_in_cycles(name: str) -> None:
    """Nothing in the render settings trades bias against noise or colours the picture."""
    scene = open_sample(name)
    cycles = scene.cycles
    assert scene.camera is not None
    assert scene.render.engine == "CYCLES"
    assert (scene.render.resolution_x, scene.render.resolution_y) == PROMISES[name].resolution
    assert scene.render.resolution_percentage == 100
    assert (cycles.samples, cycles.max_bounces, cycles.diffuse_bounces) == (64, 12, 12)
    assert (cycles.sample_clamp_direct, cycles.sample_clamp_indirect) == (0.0, 0.0)
    assert not cycles.use_denoising
    assert not cycles.use_adaptive_sampling
    assert not cycles.use_animated_seed
    assert scene.view_settings.view_transform == "Standard"
    layer = scene.view_layers[0]
    assert layer.use_pass_diffuse_direct
    assert layer.use_pass_diffuse_indirect
    assert layer.use_pass_diffuse_color


@every_sample
def test_has_the_promised_lights_and_a_black_world(name: str) -> None:
    """The lamps are all the light there is."""
    scene = open_sample(name)
    types = Counter(thing.data.type for thing in scene.objects if thing.type == "LIGHT")
    assert types == PROMISES[name].lights
    (background,) = (n for n in scene.world.node_tree.nodes if n.type == "BACKGROUND")
    assert background.inputs["Strength"].default_value == 0.0
    assert tuple(background.inputs["Color"].default_value)[:3] == (0.0, 0.0, 0.0)


@every_sample
def test_has_the_promised_geometry(name: str) -> None:
    """Bounds and triangle counts are as promised; detail comes from modifiers on coarse meshes."""
    open_sample(name)
    promise = PROMISES[name]
    meshes = evaluated_meshes()
    low, high = promise.triangles
    assert low <= sum(len(triangles) for _, triangles in meshes.values()) <= high
    for detailed in promise.detailed:
        assert 20_000 <= len(meshes[detailed][1]) <= 100_000
        assert len(bpy.data.objects[detailed].data.polygons) < 2_000
    if promise.size is not None:
        points = np.vstack([vertices for vertices, _ in meshes.values()])
        np.testing.assert_allclose(np.ptp(points, axis=0), promise.size, atol=1e-5)


@every_sample
def test_solids_are_closed_with_their_fronts_outside(name: str) -> None:
    """Every mesh of more than one face is a closed, consistently oriented solid of positive volume."""
    open_sample(name)
    for thing, (vertices, triangles) in evaluated_meshes().items():
        if len(triangles) == 2:
            continue
        edges = np.vstack((triangles[:, :2], triangles[:, 1:], triangles[:, ::2][:, ::-1]))
        forward = {(int(a), int(b)) for a, b in edges}
        assert len(forward) == len(edges), f"{thing}: an edge is used twice in one direction"
        assert forward == {(b, a) for a, b in forward}, f"{thing} is open"
        a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
        assert np.sum(a * np.cross(b, c)) > 0.0, f"{thing} is inside out"


@every_sample
def test_carries_nothing_unused_or_outside_the_file(name: str) -> None:
    """All data has a user, images are packed, nothing is linked from elsewhere."""
    open_sample(name)
    assert not bpy.data.libraries
    assert all(image.packed_file is not None for image in bpy.data.images)
    before = data_names()
    bpy.data.orphans_purge(do_recursive=True)
    assert data_names() == before


@every_sample
def test_script_makes_the_committed_file(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Regenerated, a scene has the same objects, the same vertices and the same light."""

    def light() -> list[tuple[str, float, tuple[float, ...]]]:
        lamps = [thing for thing in bpy.context.scene.objects if thing.type == "LIGHT"]
        return [(lamp.name, lamp.data.energy, tuple(lamp.data.color)) for lamp in lamps]

    open_sample(name)
    names, meshes, lamps = data_names(), evaluated_meshes(), light()
    monkeypatch.syspath_prepend(str(SAMPLE_DIR))
    made = importlib.import_module("make_samples").make(name, tmp_path)
    bpy.ops.wm.open_mainfile(filepath=str(made), load_ui=False)
    assert data_names() == names
    assert light() == lamps
    for thing, (vertices, triangles) in evaluated_meshes().items():
        np.testing.assert_allclose(vertices, meshes[thing][0], rtol=0, atol=POSITION_TOLERANCE)
        np.testing.assert_array_equal(triangles, meshes[thing][1])


def test_cornell_walls_face_the_room() -> None:
    """The fronts of the five one-plane walls look at the middle of the box."""
    open_sample("cornell")
    middle = np.array((5.528, 5.592, 5.488)) / 2.0
    walls = {name: data for name, data in evaluated_meshes().items() if len(data[1]) == 2}
    assert set(walls) == {"Floor", "Ceiling", "Back Wall", "Left Wall", "Right Wall"}
    for vertices, triangles in walls.values():
        a, b, c = vertices[triangles[0]]
        assert np.dot(np.cross(b - a, c - a), middle - a) > 0.0


def test_tilted_box_is_the_upright_one_turned() -> None:
    """One rigid turn takes one box to the other, lamp and camera too; no wall faces along an axis."""
    open_sample("cornell")
    upright = {thing.name: np.array(thing.matrix_world) for thing in bpy.context.scene.objects}
    open_sample("cornell_tilted")
    tilted = {thing.name: np.array(thing.matrix_world) for thing in bpy.context.scene.objects}
    turn = tilted["Floor"] @ np.linalg.inv(upright["Floor"])
    for name, matrix in upright.items():
        np.testing.assert_allclose(tilted[name], turn @ matrix, atol=1e-5)
    rotation = turn[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
    assert np.abs(rotation).max() < 0.95


def test_knot_in_the_dark_room_gets_indirect_light_only() -> None:
    """The partition stands between the knot and the corners of the lamp."""
    scene = open_sample("two_rooms")
    lamp = scene.objects["Lamp"]
    half = lamp.data.size / 2.0
    corners = [lamp.matrix_world @ Vector((x, y, 0.0)) for x in (-half, half) for y in (-half, half)]
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for point in evaluated_meshes()["Torus Knot"][0][::37]:
        for corner in corners:
            *_, thing, _ = scene.ray_cast(depsgraph, corner, Vector(point.tolist()) - corner)
            assert thing is not None
            assert thing.name == "Partition Wall"


def test_stone_flies_and_is_left_out_of_the_bake() -> None:
    """It is clear of walls and screen in every frame, behind the screen where the lamp does not reach in the last."""
    from ivg_addon.blender.properties import ensure_registered

    ensure_registered()
    scene = open_sample("semi_dynamic")
    stone = scene.objects["Stone"]
    assert [thing.name for thing in scene.objects if thing.ivg.leave_out] == ["Stone"]
    for frame in range(scene.frame_start, scene.frame_end + 1, 3):
        scene.frame_set(frame)
        vertices = evaluated_meshes()["Stone"][0]
        assert (np.abs(vertices) < (3.5, 2.5, 3.2)).all()
        assert (vertices[:, 2] > 0.0).all()
        screen = np.array(scene.objects["Screen"].bound_box)
        assert not ((vertices > screen.min(axis=0)) & (vertices < screen.max(axis=0))).all(axis=1).any()
    stone.hide_viewport = True
    lamp = scene.objects["Lamp"].matrix_world.translation
    depsgraph = bpy.context.evaluated_depsgraph_get()
    *_, thing, _ = scene.ray_cast(depsgraph, lamp, stone.matrix_world.translation - lamp)
    assert thing.name == "Screen"
