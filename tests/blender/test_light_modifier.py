# SPDX-License-Identifier: GPL-3.0-or-later
"""What the modifier IVG Light stores is the look-up's irradiance, wherever geometry goes and whatever it is."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix
from numpy.typing import NDArray

from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.partitions import Partitions
from tests.core.grids import AXES, LATTICE, grid

from .export_scenes import add_object, cube_mesh, point_cloud
from .stored_grids import module, store

NAME = "ivg_irradiance"
PLACE = Matrix.LocRotScale((0.2, 2.4, 1.8), Euler((0.4, 0.5, 0.6)), (0.6, -0.3, 1.1))
"""Inside the grid; mirrored, and stretched unevenly."""


def cut_grid(seed: int = 0, planes: bool = False) -> IrradianceVectorGrid:
    """Return a grid of random light, a fifth of its vertices unlit, others cut; with planes beside some vertices."""
    rng = np.random.default_rng(seed)
    validity = np.clip(rng.uniform(-0.2, 1.2, LATTICE.shape), 0.0, 1.0)
    vectors = rng.uniform(1.0, 3.0, (*LATTICE.shape, 1, 3, 1)) * AXES[:, None, :]
    vectors = vectors + rng.normal(scale=0.2, size=(*LATTICE.shape, 6, 3, 3))
    sides = None
    if planes:
        count = rng.integers(0, 2, LATTICE.vertex_count)
        vertex = np.stack(np.meshgrid(*map(np.arange, LATTICE.shape), indexing="ij"), axis=-1).reshape(-1, 3)[count > 0]
        normals = rng.normal(size=vertex.shape)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        offset = (normals * vertex).sum(axis=1) - rng.uniform(0.0, 0.8, len(vertex))
        start = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
        sides = Partitions(start, np.column_stack([normals, offset, np.zeros(len(vertex))]).astype(np.float32))
    return grid(vectors * (validity > 0)[..., None, None, None], validity, partitions=sides)


@pytest.fixture
def baked(extension: str, tmp_path: Path) -> Iterator[IrradianceVectorGrid]:
    """Return the grid of an empty scene."""
    bpy.ops.wm.read_homefile(use_empty=True)
    light = cut_grid()
    store(extension, "Room", light, tmp_path)
    yield light
    bpy.ops.wm.read_homefile(use_empty=True)


def lit_up(*objects: bpy.types.Object) -> set[str]:
    """Select objects and put the modifier on them."""
    for each in bpy.context.scene.objects:
        each.select_set(each in objects)
    return bpy.ops.ivg.modifier_add()


_evaluated: list[bpy.types.GeometrySet] = []
"""What was evaluated last; Blender frees it with its owner."""


def evaluated(target: bpy.types.Object) -> bpy.types.GeometrySet:
    _evaluated[:] = [target.evaluated_get(bpy.context.evaluated_depsgraph_get()).evaluated_geometry()]
    return _evaluated[0]


def column(attribute: bpy.types.Attribute, name: str, width: int) -> NDArray[np.float64]:
    values = np.empty(len(attribute.data) * width, dtype=np.float32)
    attribute.data.foreach_get(name, values)
    return values.reshape(-1, width).astype(np.float64)


def stored(data: bpy.types.ID) -> NDArray[np.float64]:
    return column(data.attributes[NAME], "color", 4)[:, :3]


def at_corners(mesh: bpy.types.Mesh) -> NDArray[np.float64]:
    """Return what is stored, corner by corner, whether it is per corner or per vertex."""
    vertex = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", vertex)
    return stored(mesh)[vertex] if mesh.attributes[NAME].domain == "POINT" else stored(mesh)


def at_vertices(mesh: bpy.types.Mesh, matrix: Matrix) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return a mesh's vertices and their normals, in the world."""
    normals = np.empty(3 * len(mesh.vertices), dtype=np.float32)
    mesh.vertex_normals.foreach_get("vector", normals)
    points = column(mesh.attributes["position"], "vector", 3)
    return in_world(points, matrix), normals_in_world(normals.reshape(-1, 3).astype(np.float64), matrix)


def in_world(points: NDArray[np.float64], matrix: Matrix) -> NDArray[np.float64]:
    m = np.array(matrix)
    return points @ m[:3, :3].T + m[:3, 3]


def normals_in_world(normals: NDArray[np.float64], matrix: Matrix) -> NDArray[np.float64]:
    return normals @ np.linalg.inv(np.array(matrix)[:3, :3])


def assert_close(found: NDArray[np.float64], expected: NDArray[np.float64]) -> None:
    """Positions are of single precision, 10⁻⁷ of 4 m in voxels of 0.25 m."""
    np.testing.assert_allclose(found, expected, atol=1e-4 * expected.mean())
    assert expected.std() > 0.02 * expected.mean()


def expected_at_corners(light: IrradianceVectorGrid, mesh: bpy.types.Mesh, matrix: Matrix) -> NDArray[np.float64]:
    """Return the look-up at a mesh's corners, by its corner normals."""
    vertex = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.loops.foreach_get("vertex_index", vertex)
    normals = np.empty(3 * len(mesh.loops), dtype=np.float32)
    mesh.corner_normals.foreach_get("vector", normals)
    points = column(mesh.attributes["position"], "vector", 3)[vertex]
    return light.irradiance(
        in_world(points, matrix), normals_in_world(normals.reshape(-1, 3).astype(np.float64), matrix)
    ).astype(np.float64)


def smooth_ball() -> bpy.types.Object:
    bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12, radius=0.5)
    bpy.ops.object.shade_smooth()
    return bpy.context.object


def test_flat_and_smooth_meshes_under_any_transform(baked: IrradianceVectorGrid) -> None:
    """Hard edges store a corner's irradiance, smooth ones a vertex's; both in world space, cut cells included."""
    flat, smooth = add_object("Flat", cube_mesh()), smooth_ball()
    for each in (flat, smooth):
        each.matrix_world = PLACE
    assert lit_up(flat, smooth) == {"FINISHED"}
    for each, domain in ((flat, "CORNER"), (smooth, "POINT")):
        mesh = evaluated(each).mesh
        assert mesh.attributes[NAME].domain == domain
        assert_close(at_corners(mesh), expected_at_corners(baked, mesh, PLACE))


def test_walls_between_points_and_vertices_count(extension: str, tmp_path: Path) -> None:
    """Beside thin walls only vertices that speak for a point are heard; single precision decides ties otherwise."""
    bpy.ops.wm.read_homefile(use_empty=True)
    light = cut_grid(3, planes=True)
    store(extension, "Room", light, tmp_path)
    ball = smooth_ball()
    ball.matrix_world = PLACE @ Matrix.Scale(1.5, 4)
    lit_up(ball)
    mesh = evaluated(ball).mesh
    points, normals = at_vertices(mesh, ball.matrix_world)
    expected = light.irradiance(points, normals)
    off = np.abs(stored(mesh) - expected).max(axis=1) > 1e-4 * expected.mean()
    assert off.mean() < 0.01
    whole = grid(light.vectors, light.validity).irradiance(points, normals)
    assert (np.abs(whole - expected).max(axis=1) > 1e-2 * expected.mean()).mean() > 0.2
    bpy.ops.wm.read_homefile(use_empty=True)


def test_follows_animation_and_rendering_sees_the_same(baked: IrradianceVectorGrid) -> None:
    """A parent that moves takes the light along, in the viewport and in renders; the add-on has no part in it."""
    from ivg_addon.blender.export_depsgraph import with_render_depsgraph

    parent, ball = add_object("Parent", None), smooth_ball()
    ball.parent, ball.scale = parent, (0.5, 0.5, 0.5)
    lit_up(ball)
    scene = bpy.context.scene
    for frame, x in ((1, -0.6), (11, 1.0)):
        parent.location = (x, 2.5, 2.0)
        parent.keyframe_insert("location", frame=frame)

    def read(depsgraph: bpy.types.Depsgraph, _: object) -> NDArray[np.float64]:
        return next(stored(each.object.data) for each in depsgraph.object_instances if each.object.name == ball.name)

    seen = []
    for frame in (1, 6, 11):
        scene.frame_set(frame)
        mesh = evaluated(ball).mesh
        seen.append(stored(mesh))
        assert_close(seen[-1], baked.irradiance(*at_vertices(mesh, ball.matrix_world)).astype(np.float64))
        rendered = with_render_depsgraph(scene, bpy.context.view_layer, read)
        np.testing.assert_array_equal(rendered, seen[-1])
    assert np.abs(seen[0] - seen[1]).max() > 0.1


def instancing_tree(inside: bpy.types.Object) -> bpy.types.NodeTree:
    """Return nodes that place an object, as instances, on the points of a mesh."""
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    info = tree.nodes.new("GeometryNodeObjectInfo")
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = inside, True
    place = tree.nodes.new("GeometryNodeInstanceOnPoints")
    tree.links.new(tree.nodes.new("NodeGroupInput").outputs[0], place.inputs["Points"])
    tree.links.new(info.outputs["Geometry"], place.inputs["Instance"])
    tree.links.new(place.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    return tree


def test_nested_instances_have_light_of_their_own(baked: IrradianceVectorGrid) -> None:
    cube = add_object("Cube", cube_mesh(size=0.2))
    pair = add_object("Pair", bpy.data.meshes.new("Pair"))
    pair.data.from_pydata([(0, 0, 0), (0.4, 0, 0)], [], [])
    pair.modifiers.new("Scatter", "NODES").node_group = instancing_tree(cube)
    row = add_object("Row", bpy.data.meshes.new("Row"))
    row.data.from_pydata([(0, 0, 0), (0, 0.3, 0.5), (0.3, 0.1, 1.5)], [], [])
    row.matrix_world = Matrix.Translation((-0.5, 2.3, 1.0))
    row.modifiers.new("Scatter", "NODES").node_group = instancing_tree(pair)
    lit_up(row)
    mesh = evaluated(row).mesh
    assert len(mesh.loops) == 6 * 24
    assert_close(stored(mesh), expected_at_corners(baked, mesh, row.matrix_world))


def test_points_and_curves_store_the_mean_over_normals(baked: IrradianceVectorGrid) -> None:
    """What has no surface has no normal; geometry of several kinds is lit as a whole, text as its surface."""
    places = np.random.default_rng(1).uniform(-0.5, 0.5, (30, 3))
    cloud = point_cloud(places)
    bpy.ops.curve.primitive_nurbs_path_add()
    curve = bpy.context.object
    bpy.ops.object.text_add()
    text = bpy.context.object
    for each in (cloud, curve, text):
        each.matrix_world = Matrix.Translation((0.2, 2.5, 2.0)) @ Matrix.Scale(0.3, 4)
    lit_up(cloud, curve, text)
    for each, part in ((cloud, "pointcloud"), (curve, "curves")):
        data = getattr(evaluated(each), part)
        points = in_world(column(data.attributes["position"], "vector", 3), each.matrix_world)
        assert_close(stored(data), mean_irradiance(baked, points))
    mesh = evaluated(text).mesh
    assert_close(at_corners(mesh), expected_at_corners(baked, mesh, text.matrix_world))


def mean_irradiance(light: IrradianceVectorGrid, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return Σ_k D_kk/6 of the lit vertices around points, by their trilinear weights: without a normal none leans.

    That is the mean of E over the six axes, and over all normals: there W_kl is 0 and W_kk 1/3.
    """
    interpolated = np.asarray(light.interpolated("TRILINEAR"))
    mean = np.einsum("...kcj,kj->...c", interpolated, AXES) / 6.0
    lit = light.validity > 0
    g = (points - light.bounds_min) / light.lattice.voxel_size
    base = np.minimum(np.floor(g).astype(int), np.array(light.resolution) - 1)
    total, weight = np.zeros((len(points), 3)), np.zeros(len(points))
    for corner in np.ndindex(2, 2, 2):
        at = tuple((base + corner).T)
        share = np.prod(1.0 - np.abs(base + corner - g), axis=1) * lit[at]
        total, weight = total + share[:, None] * mean[at], weight + share
    return total / weight[:, None]


def test_a_new_bake_is_read_at_once(extension: str, baked: IrradianceVectorGrid, tmp_path: Path) -> None:
    ball = smooth_ball()
    ball.matrix_world = PLACE
    lit_up(ball)
    before = stored(evaluated(ball).mesh)
    staleness, scene = module(extension, "staleness"), bpy.context.scene
    again = cut_grid(seed=1)
    staleness.saw(scene, again.record.checksum, staleness.edits(scene))
    store(extension, "Room", again, tmp_path)
    bpy.context.view_layer.update()
    assert staleness.freshness(scene) is staleness.Freshness.FRESH
    mesh = evaluated(ball).mesh
    assert np.abs(stored(mesh) - before).max() > 0.1
    assert_close(at_corners(mesh), expected_at_corners(again, mesh, PLACE))


def test_missing_file_out_of_the_grid_and_other_objects(
    extension: str, baked: IrradianceVectorGrid, tmp_path: Path
) -> None:
    """A grid that cannot be read leaves black and is said, where it is; what cannot be lit is named."""
    light_modifier, storage = module(extension, "light_modifier"), module(extension, "storage")
    image = bpy.context.scene.ivg.grid
    ball, camera = smooth_ball(), add_object("Camera", bpy.data.cameras.new("Camera"))
    assert lit_up(camera) == {"CANCELLED"}
    lit_up(ball, camera)
    assert light_modifier.of(camera) is None
    assert "reaches out" in next(light_modifier.problems(image, [ball]))
    ball.matrix_world = PLACE
    bpy.context.view_layer.update()
    assert not list(light_modifier.problems(image, [ball]))
    assert not ball.modifiers[0].node_warnings
    image["ivg"]["volume"].filepath = str(tmp_path / "gone.vdb")
    bpy.context.view_layer.update()
    np.testing.assert_array_equal(stored(evaluated(ball).mesh), 0.0)
    assert "missing" in storage.problem(image)
    assert "missing" in next(light_modifier.problems(image, [ball]))
    bpy.ops.ivg.restore()
    assert not list(light_modifier.problems(image, [ball]))
    assert_close(at_corners(evaluated(ball).mesh), expected_at_corners(baked, evaluated(ball).mesh, PLACE))


def test_of_a_newer_version_is_left_alone_and_an_older_one_replaced(extension: str, baked: object) -> None:
    light_modifier = module(extension, "light_modifier")
    ball = smooth_ball()
    lit_up(ball)
    tree = ball.modifiers[0].node_group
    version = tree["ivg"]["version"]
    tree["ivg"]["version"] = version + 1
    assert lit_up(ball) == {"CANCELLED"}
    assert "newer" in light_modifier.hindrance(ball)
    assert "another version" in next(light_modifier.problems(bpy.context.scene.ivg.grid, [ball]))
    tree["ivg"]["version"] = 0
    assert lit_up(ball) == {"FINISHED"}
    assert len(ball.modifiers) == 1
    assert ball.modifiers[0].node_group["ivg"]["version"] == version


def test_taken_off_it_leaves_nothing(extension: str, baked: object) -> None:
    light_modifier = module(extension, "light_modifier")
    ball = smooth_ball()
    groups, objects = len(bpy.data.node_groups), len(bpy.data.objects)
    lit_up(ball)
    assert light_modifier.in_use()
    assert bpy.ops.ivg.modifier_remove(objects="ALL") == {"FINISHED"}
    assert not ball.modifiers
    assert not light_modifier.in_use()
    assert (len(bpy.data.node_groups), len(bpy.data.objects)) == (groups, objects)


def test_goes_with_objects_into_other_files(extension: str, baked: IrradianceVectorGrid, tmp_path: Path) -> None:
    """Linked, an object brings its light along and is left alone; nodes need neither the scene nor its settings."""
    ball = smooth_ball()
    ball.name = "Ball"
    ball.matrix_world = PLACE
    lit_up(ball)
    here = stored(evaluated(ball).mesh)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "room.blend"))
    bpy.ops.wm.read_homefile(use_empty=True)
    with bpy.data.libraries.load(str(tmp_path / "room.blend"), link=True) as (_, wanted):
        wanted.objects = ["Ball"]
    (linked,) = wanted.objects
    bpy.context.scene.collection.objects.link(linked)
    np.testing.assert_array_equal(stored(evaluated(linked).mesh), here)
    assert "linked" in module(extension, "light_modifier").hindrance(linked)
