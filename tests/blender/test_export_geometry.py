# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry through the viewport's depsgraph: transforms, normals, instances, kinds of objects."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mathutils import Euler, Matrix

from ivg_addon.blender.export import export_steps
from ivg_addon.core.errors import SceneError
from ivg_addon.core.scene import Scene
from tests.blender.export_scenes import (
    add_object,
    area_vectors,
    cube_mesh,
    empty_scene,
    new_material,
    viewport_scene,
    volume,
)

angles = st.floats(-math.pi, math.pi)
places = st.floats(-10, 10)
factors = st.floats(0.1, 5) | st.floats(-5, -0.1)
triples = st.tuples


@pytest.fixture
def scene() -> Iterator[bpy.types.Scene]:
    yield empty_scene()


def notices_of(scene: Scene, name: str) -> list[str]:
    return [f"{notice.kind}: {notice.message}" for notice in scene.notices if notice.subject == f"object '{name}'"]


@given(
    location=triples(places, places, places), rotation=triples(angles, angles, angles), scale=triples(*[factors] * 3)
)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_any_placement(location: tuple[float, ...], rotation: tuple[float, ...], scale: tuple[float, ...]) -> None:
    """The transform is applied analytically to a cube with corners 0 and 1, mirrored or not."""
    empty_scene()
    add_object("Cube", cube_mesh(), location=location, rotation_euler=rotation, scale=scale)
    geometry = viewport_scene().geometry
    turn = np.array(Euler(rotation).to_matrix(), dtype=float)
    linear = turn @ np.diag(scale)

    assert volume(geometry) == pytest.approx(abs(np.prod(scale)), rel=2e-4), "outside is the front"
    x, y, z = np.abs(scale)
    areas = np.linalg.norm(area_vectors(geometry), axis=1)
    assert areas.sum() == pytest.approx(2 * (x * y + y * z + z * x), rel=1e-4)
    want = np.array([corner for corner in np.ndindex(2, 2, 2)], dtype=float) @ linear.T + location
    got = np.unique(np.round(geometry.vertices[geometry.triangles].reshape(-1, 3), 3), axis=0)
    distance = np.linalg.norm(got[:, None] - want, axis=2)
    assert distance.min(axis=1).max() < 2e-3
    assert distance.min(axis=0).max() < 2e-3
    units = area_vectors(geometry) / areas[:, None]
    np.testing.assert_allclose(geometry.corner_normals, np.repeat(units[:, None], 3, axis=1), atol=1e-5)


@pytest.mark.parametrize("scale", [(1, 1, 1), (-1, 1, 1), (1, 1, -1), (-1, -1, 1), (-1, -1, -1)])
def test_the_front_is_cycles_front(scene: bpy.types.Scene, tmp_path: Path, scale: tuple[float, ...]) -> None:
    """A plane that shines on its front only is seen, in a render, from the side that is exported as its front."""

    def build(tree: bpy.types.NodeTree, output: bpy.types.Node) -> None:
        shine = tree.nodes.new("ShaderNodeEmission")
        facing = tree.nodes.new("ShaderNodeNewGeometry")
        invert = tree.nodes.new("ShaderNodeInvert")
        tree.links.new(facing.outputs["Backfacing"], invert.inputs["Color"])
        tree.links.new(invert.outputs["Color"], shine.inputs["Color"])
        tree.links.new(shine.outputs["Emission"], output.inputs["Surface"])

    mesh = bpy.data.meshes.new("Plane")
    mesh.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [], [(0, 1, 2, 3)])
    mesh.materials.append(new_material("Front", build))
    add_object("Plane", mesh, scale=scale)
    normal = area_vectors(viewport_scene().geometry)[0]
    camera = add_object("Camera", bpy.data.cameras.new("Camera"), location=(0, 0, 3 * np.sign(normal[2])))
    camera.rotation_euler = (0 if normal[2] > 0 else math.pi, 0, 0)
    scene.camera = camera
    scene.render.resolution_x = scene.render.resolution_y = 4
    scene.view_settings.view_transform = "Raw"
    scene.render.filepath = str(tmp_path / "seen.png")
    bpy.ops.render.render(write_still=True)
    seen = np.array(bpy.data.images.load(scene.render.filepath).pixels[:]).reshape(-1, 4)
    assert seen[:, :3].min() > 0.9


def ball(name: str = "Ball") -> bpy.types.Object:
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2, radius=1)
    made = bpy.context.object
    made.name = made.data.name = name
    return made


@pytest.mark.parametrize("scale", [(1, 1, 1), (2, 1, 0.5), (-2, 1, 0.5)])
def test_smooth_normals(scene: bpy.types.Scene, scale: tuple[float, ...]) -> None:
    sphere = ball()
    sphere.data.shade_smooth()
    sphere.scale = scale
    geometry = viewport_scene().geometry
    # The normal of the ellipsoid x²/a² + y²/b² + z²/c² = 1 is its gradient.
    gradient = geometry.vertices[geometry.triangles] / np.square(scale)
    gradient /= np.linalg.norm(gradient, axis=-1)[..., None]
    # An icosphere's vertex normals are not exactly radial: they lean by a share of its edges' angle.
    cosine = np.einsum("ijk,ijk->ij", gradient, geometry.corner_normals)
    assert cosine.min() > math.cos(math.radians(5))
    np.testing.assert_allclose(np.linalg.norm(geometry.corner_normals, axis=-1), 1, atol=1e-6)
    assert volume(geometry) > 0


def test_flat_faces_that_are_bent_have_the_normals_of_their_triangles(scene: bpy.types.Scene) -> None:
    """As in Cycles, whose flat shading knows triangles only."""
    mesh = bpy.data.meshes.new("Bent")
    mesh.from_pydata([(0, 0, 0), (1, 0, 1), (1, 1, 0), (0, 1, 1)], [], [(0, 1, 2, 3)])
    mesh.shade_flat()
    add_object("Bent", mesh)
    geometry = viewport_scene().geometry
    vectors = area_vectors(geometry)
    units = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    assert units[0] @ units[1] < 0.5
    np.testing.assert_allclose(geometry.corner_normals, np.repeat(units[:, None], 3, axis=1), atol=1e-6)


def test_sharp_edges_split_normals(scene: bpy.types.Scene) -> None:
    mesh = cube_mesh()
    mesh.shade_smooth()
    mesh.set_sharp_from_angle(angle=math.radians(30))
    add_object("Cube", mesh)
    geometry = viewport_scene().geometry
    vectors = area_vectors(geometry)
    units = vectors / np.linalg.norm(vectors, axis=1)[:, None]
    np.testing.assert_allclose(geometry.corner_normals, np.repeat(units[:, None], 3, axis=1), atol=1e-6)


def test_custom_normals(scene: bpy.types.Scene) -> None:
    mesh = cube_mesh()
    leaning = np.array((1, 2, 3)) / math.sqrt(14)
    mesh.normals_split_custom_set_from_vertices([leaning] * 8)
    add_object("Cube", mesh, rotation_euler=(0, 0, math.pi / 2), scale=(2, 2, 2))
    geometry = viewport_scene().geometry
    np.testing.assert_allclose(
        geometry.corner_normals, np.broadcast_to((-leaning[1], leaning[0], leaning[2]), (12, 3, 3)), atol=1e-3
    )


def test_modifiers_count(scene: bpy.types.Scene) -> None:
    cube = add_object("Cube", cube_mesh())
    array = cube.modifiers.new("Array", "ARRAY")
    array.count = 3
    assert viewport_scene().geometry.triangle_count == 36


@pytest.mark.parametrize("kind", ["curve", "text", "surface", "metaball"])
def test_what_becomes_a_mesh(scene: bpy.types.Scene, kind: str) -> None:
    match kind:
        case "curve":
            bpy.ops.curve.primitive_bezier_circle_add()
            bpy.context.object.data.bevel_depth = 0.1
        case "text":
            bpy.ops.object.text_add()
        case "surface":
            bpy.ops.surface.primitive_nurbs_surface_sphere_add()
        case "metaball":
            bpy.ops.object.metaball_add()
    made = bpy.context.object
    exported = viewport_scene()
    assert exported.objects == (made.name,)
    assert exported.geometry.triangle_count > 50
    assert not any(message.startswith("left out") for message in notices_of(exported, made.name))


def test_what_is_left_out_is_named(scene: bpy.types.Scene) -> None:
    add_object("Cube", cube_mesh())
    add_object("Fog", bpy.data.volumes.new("Fog"))
    add_object("Drawing", bpy.data.grease_pencils.new("Drawing"))
    for silent in ("EMPTY", "LATTICE"):
        add_object(silent, None if silent == "EMPTY" else bpy.data.lattices.new("Lattice"))
    exported = viewport_scene()
    assert notices_of(exported, "Fog") == ["left out: volumes are not baked"]
    assert notices_of(exported, "Drawing") == [
        "left out: Grease Pencil strokes are not baked: Cycles does not render them either"
    ]
    assert sum(notice.subject.startswith("object") for notice in exported.notices) == 2


def test_ray_visibility(scene: bpy.types.Scene) -> None:
    add_object("Plain", cube_mesh())
    add_object(
        "Unseen",
        cube_mesh(),
        location=(2, 0, 0),
        visible_diffuse=False,
        visible_glossy=False,
        visible_transmission=False,
    )
    add_object("Shadowless", cube_mesh(), location=(4, 0, 0), visible_shadow=False)
    rays = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")
    add_object("Gone", cube_mesh(), **{f"visible_{ray}": False for ray in rays})
    exported = viewport_scene()
    assert exported.light_rules is not None
    casts = (exported.light_rules.blocks & 1).astype(bool)
    visible = zip(exported.diffuse_visible, casts, strict=True)
    assert dict(zip(exported.objects, visible, strict=True)) == {
        "Plain": (True, True),
        "Unseen": (False, True),
        "Shadowless": (True, False),
    }
    assert not [notice for notice in exported.notices if notice.subject.startswith("object")]
    scene.world = bpy.data.worlds.new("World")
    exported = viewport_scene()
    message = (
        "simplified: blocks the world's light as its shadow rays say: of a uniform world, Cycles asks diffuse rays"
    )
    assert [notices_of(exported, name) for name in ("Plain", "Unseen", "Shadowless")] == [[], [message], [message]]


def centres(exported: Scene) -> np.ndarray:
    """Return the middle of each run of 12 triangles, sorted."""
    corners = exported.geometry.vertices[exported.geometry.triangles].reshape(-1, 36, 3)
    return np.array(sorted(np.round((corners.min(axis=1) + corners.max(axis=1)) / 2, 4).tolist()))


def test_collection_instances(scene: bpy.types.Scene) -> None:
    content = bpy.data.collections.new("Content")
    inner = bpy.data.objects.new("Inner", cube_mesh(size=2.0))
    inner.matrix_world = Matrix.Translation((1, 0, 0))
    content.objects.link(inner)
    scene.collection.children.link(content)
    bpy.context.view_layer.layer_collection.children["Content"].exclude = True
    mirror = Matrix.Translation((0, 10, 0)) @ Matrix.Diagonal((-1, 1, 1, 1))
    for name, matrix in (("One", Matrix.Translation((0, 0, 10))), ("Two", mirror)):
        add_object(name, None, instance_type="COLLECTION", instance_collection=content, matrix_world=matrix)
    exported = viewport_scene()
    np.testing.assert_allclose(centres(exported), [(-2, 11, 1), (2, 1, 11)], atol=1e-4)
    assert volume(exported.geometry) == pytest.approx(16, rel=1e-5)
    assert exported.objects == ("Inner",)


def test_instancer_decides_on_visibility_too(scene: bpy.types.Scene) -> None:
    content = bpy.data.collections.new("Content")
    content.objects.link(bpy.data.objects.new("Inner", cube_mesh()))
    for name, seen in (("One", True), ("Two", False)):
        add_object(name, None, instance_type="COLLECTION", instance_collection=content, visible_diffuse=seen)
    exported = viewport_scene()
    assert exported.objects == ("Inner", "Inner")
    assert sorted(exported.diffuse_visible) == [False, True]


def test_vertex_instances_and_their_hidden_instancer(scene: bpy.types.Scene) -> None:
    """The viewport shows what is instanced at its own place as well; a render does not."""
    host = add_object("Host", cube_mesh(size=8.0), instance_type="VERTS")
    host.show_instancer_for_viewport = False
    add_object("Child", cube_mesh(), parent=host)
    exported = viewport_scene()
    assert exported.geometry.triangle_count == (8 + 1) * 12
    assert exported.objects == ("Child",)
    assert volume(exported.geometry) == pytest.approx(8 + 1, rel=1e-5)
    assert any("12 triangles became 108" in notice.message for notice in exported.notices)


def geometry_nodes(name: str = "Nodes") -> tuple[bpy.types.NodeTree, bpy.types.NodeSocket, bpy.types.NodeSocket]:
    """Return a new geometry node group, what comes in and what goes out."""
    group = bpy.data.node_groups.new(name, "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    begin, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    return group, begin.outputs[0], end.inputs[0]


def test_geometry_nodes_instances_with_materials(scene: bpy.types.Scene) -> None:
    group, begin, end = geometry_nodes()
    spread = group.nodes.new("GeometryNodeInstanceOnPoints")
    cube = group.nodes.new("GeometryNodeMeshCube")
    paint = group.nodes.new("GeometryNodeSetMaterial")
    paint.inputs["Material"].default_value = bpy.data.materials.new("Painted")
    group.links.new(begin, spread.inputs["Points"])
    group.links.new(cube.outputs["Mesh"], paint.inputs["Geometry"])
    group.links.new(paint.outputs["Geometry"], spread.inputs["Instance"])
    group.links.new(spread.outputs["Instances"], end)
    host = add_object("Host", cube_mesh(size=4.0))
    host.modifiers.new("Nodes", "NODES").node_group = group
    exported = viewport_scene()
    assert exported.geometry.triangle_count == 8 * 12
    assert volume(exported.geometry) == pytest.approx(8, rel=1e-5)
    assert {exported.materials.names[i] for i in exported.geometry.material} == {"Painted"}


def test_particle_instances(scene: bpy.types.Scene) -> None:
    host = ball("Host")
    shown = add_object("Leaf", cube_mesh(), location=(0, 0, 90))
    host.modifiers.new("Particles", "PARTICLE_SYSTEM")
    particles = host.particle_systems[0].settings
    particles.type, particles.count, particles.render_type = "HAIR", 7, "OBJECT"
    particles.instance_object, particles.particle_size, particles.hair_length = shown, 0.5, 1.0
    exported = viewport_scene()
    leaf = exported.objects.index("Leaf")
    assert np.count_nonzero(exported.geometry.object == leaf) == (7 + 1) * 12


def test_bad_triangles_are_counted(scene: bpy.types.Scene) -> None:
    mesh = cube_mesh()
    mesh.vertices[7].co = (float("nan"), 0, 0)
    add_object("Broken", mesh)
    line = bpy.data.meshes.new("Line")
    line.from_pydata([(0, 0, 0), (1, 0, 0), (2, 0, 0)], [], [(0, 1, 2)])
    add_object("Line", line)
    exported = viewport_scene()
    lost = 12 - exported.geometry.triangle_count
    assert 3 <= lost <= 6, "the corner belongs to three faces of two triangles"
    message = "without area or with coordinates that are not numbers left out"
    assert notices_of(exported, "Broken") == [f"warning: {lost} triangles {message}"]
    assert notices_of(exported, "Line") == [f"warning: 1 triangle {message}"]


def test_nothing_to_light(scene: bpy.types.Scene) -> None:
    add_object("Edges", bpy.data.meshes.new("Edges"))
    with pytest.raises(SceneError, match=r"no mesh, curve, .* or point cloud .*: add one, or show it in renders"):
        viewport_scene()


def test_what_mirrors_see_otherwise_is_named(scene: bpy.types.Scene) -> None:
    add_object("Ghost", cube_mesh(), visible_diffuse=False)
    add_object("Vampire", cube_mesh(), visible_glossy=False)
    exported = viewport_scene()
    message = "simplified: to glossy and transmission rays as visible as to diffuse rays"
    assert notices_of(exported, "Ghost") == notices_of(exported, "Vampire") == [message]


def test_nothing_but_triangles_without_area(scene: bpy.types.Scene) -> None:
    mesh = bpy.data.meshes.new("Lines")
    mesh.vertices.add(300_000)
    mesh.loops.add(300_000)
    mesh.loops.foreach_set("vertex_index", np.arange(300_000, dtype=np.int32))
    mesh.polygons.add(100_000)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 300_000, 3, dtype=np.int32))
    mesh.update()
    add_object("Lines", mesh)
    with pytest.raises(SceneError, match=r"all 100,000 triangles are without area or not finite"):
        viewport_scene()


def test_steps_are_small_and_may_be_left(scene: bpy.types.Scene) -> None:
    for index in range(5):
        add_object(f"Cube {index}", cube_mesh())
    depsgraph = bpy.context.evaluated_depsgraph_get()
    fractions = [step.fraction for step in export_steps(depsgraph)]
    assert len(fractions) >= 6
    assert fractions == sorted(fractions)
    assert 0 <= fractions[0] < fractions[-1] <= 1
    before = len(bpy.data.meshes), len(bpy.data.objects)
    for taken in range(len(fractions)):
        steps = export_steps(depsgraph)
        for _ in range(taken):
            next(steps)
        steps.close()
        assert (len(bpy.data.meshes), len(bpy.data.objects)) == before
