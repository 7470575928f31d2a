# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes as Blender evaluates them: what is exported against Blender's own evaluated mesh."""

from __future__ import annotations

import math
from collections.abc import Iterator

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from ivg_addon.core.scene import Scene
from tests.blender.export_scenes import add_object, area_vectors, cube_mesh, empty_scene, viewport_scene, volume


@pytest.fixture(autouse=True)
def scene() -> Iterator[bpy.types.Scene]:
    yield empty_scene()


def blenders_triangles() -> tuple[np.ndarray, np.ndarray]:
    """Return all instances' triangles in world space (n, 3, 3), and the materials' names, as Blender has them."""
    corners, names = [], []
    depsgraph = bpy.context.evaluated_depsgraph_get()
    for instance in depsgraph.object_instances:
        shown = instance.object
        if shown.type != "MESH" or not instance.show_self:
            continue
        mesh = shown.data
        mesh.calc_loop_triangles()
        for triangle in mesh.loop_triangles:
            corners.append([instance.matrix_world @ mesh.vertices[vertex].co for vertex in triangle.vertices])
            slots = [slot.material.name if slot.material else "(none)" for slot in shown.material_slots] or ["(none)"]
            names.append(slots[min(triangle.material_index, len(slots) - 1)])
    return np.array(corners), np.array(names)


def assert_as_evaluated(exported: Scene) -> None:
    """Every triangle has its place, its area and its material, and no other is there."""
    geometry = exported.geometry
    want, names = blenders_triangles()
    assert len(want) == geometry.triangle_count
    mine = geometry.vertices[geometry.triangles]
    # The same points in any order: along any line they lie at the same places.
    for line in np.random.default_rng(1).normal(size=(8, 3)):
        np.testing.assert_allclose(
            np.sort(mine.mean(axis=1) @ line), np.sort(want.mean(axis=1) @ line), atol=1e-5 * np.abs(want).max()
        )
    areas = np.linalg.norm(np.cross(want[:, 1] - want[:, 0], want[:, 2] - want[:, 0]), axis=1) / 2
    np.testing.assert_allclose(
        np.sort(np.linalg.norm(area_vectors(geometry), axis=1)), np.sort(areas), rtol=1e-3, atol=1e-6
    )
    my_names = np.array(exported.materials.names)[geometry.material]
    for name in set(names) | set(my_names):
        assert np.count_nonzero(my_names == name) == np.count_nonzero(names == name)


def test_shape_keys() -> None:
    cube = add_object("Cube", cube_mesh())
    cube.shape_key_add(name="Basis")
    key = cube.shape_key_add(name="Tall")
    for point in key.data:
        point.co.z *= 5
    key.value = 0.5
    bpy.context.view_layer.update()
    exported = viewport_scene()
    assert_as_evaluated(exported)
    assert volume(exported.geometry) == pytest.approx(3, rel=1e-5)


def test_an_armature_at_the_current_frame(scene: bpy.types.Scene) -> None:
    cube = add_object("Cube", cube_mesh())
    bones = bpy.data.armatures.new("Bones")
    rig = add_object("Rig", bones)
    bpy.context.view_layer.objects.active = rig
    bpy.ops.object.mode_set(mode="EDIT")
    bone = bones.edit_bones.new("Bone")
    bone.head, bone.tail = (0, 0, 0), (0, 0, 1)
    bpy.ops.object.mode_set(mode="OBJECT")
    cube.vertex_groups.new(name="Bone").add(range(8), 1.0, "REPLACE")
    cube.modifiers.new("Armature", "ARMATURE").object = rig
    pose = rig.pose.bones["Bone"]
    for frame, place in ((1, 0.0), (11, 10.0)):
        pose.location = (place, 0, 0)
        pose.keyframe_insert("location", frame=frame)
    scene.frame_set(11)
    exported = viewport_scene()
    assert_as_evaluated(exported)
    low, high = exported.geometry.bounds()
    np.testing.assert_allclose((low[0], high[0]), (10, 11), atol=1e-4)


@pytest.mark.parametrize("scale", [(-1, 1, 1), (1, -2, 1), (-1, -1, -1)])
@pytest.mark.parametrize("smooth", [False, True])
def test_negative_scale_keeps_the_front_outside(scale: tuple[float, ...], smooth: bool) -> None:
    mesh = cube_mesh()
    if smooth:
        mesh.shade_smooth()
    parent = add_object("Parent", None, scale=scale, rotation_euler=(0.4, 0.2, 0.1))
    add_object("Child", mesh, parent=parent, location=(1, 2, 3))
    bpy.context.view_layer.update()
    exported = viewport_scene()
    assert_as_evaluated(exported)
    geometry = exported.geometry
    assert volume(geometry) == pytest.approx(abs(np.prod(scale)), rel=1e-4)
    corners = geometry.vertices[geometry.triangles]
    outward = corners - corners.reshape(-1, 3).mean(axis=0)
    assert np.einsum("ijk,ijk->ij", geometry.corner_normals, outward).min() > 0


def test_several_materials_by_mesh_and_by_object() -> None:
    mesh = cube_mesh()
    for name in ("A", "B"):
        mesh.materials.append(bpy.data.materials.new(name))
    for face, polygon in enumerate(mesh.polygons):
        polygon.material_index = face % 2
    add_object("One", mesh)
    other = add_object("Two", mesh, location=(3, 0, 0))
    other.material_slots[1].link = "OBJECT"
    other.material_slots[1].material = bpy.data.materials.new("C")
    exported = viewport_scene()
    assert_as_evaluated(exported)
    names = np.array(exported.materials.names)[exported.geometry.material]
    assert {name: int(np.count_nonzero(names == name)) for name in "ABC"} == {"A": 12, "B": 6, "C": 6}


def test_surfaces_that_are_no_solids() -> None:
    """Three faces at one edge, a face that is there twice, faces that cross, a loose edge and a concave polygon."""
    mesh = bpy.data.meshes.new("Odd")
    corners = [(0, 0, 0), (0, 0, 2), (1, 0, 0), (1, 0, 2), (-1, 1, 0), (-1, 1, 2), (-1, -1, 0), (-1, -1, 2)]
    corners += [(5, 0, 0), (7, 0, 0), (7, 2, 0), (6, 0.5, 0), (5, 2, 0)]
    faces = [(0, 1, 3, 2), (0, 1, 5, 4), (0, 1, 7, 6), (0, 2, 3, 1), (2, 5, 7), (8, 9, 10, 11, 12)]
    mesh.from_pydata(corners, [(3, 8)], faces)
    add_object("Odd", mesh, rotation_euler=(0.1, 0.2, 0.3))
    assert_as_evaluated(viewport_scene())


def test_instances_of_instances() -> None:
    """A collection that holds an instancer of a collection that holds geometry nodes that spread cubes."""
    group = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    begin, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    spread, cone = group.nodes.new("GeometryNodeInstanceOnPoints"), group.nodes.new("GeometryNodeMeshCone")
    again, cube = group.nodes.new("GeometryNodeInstanceOnPoints"), group.nodes.new("GeometryNodeMeshCube")
    group.links.new(begin.outputs[0], spread.inputs["Points"])
    group.links.new(cube.outputs["Mesh"], again.inputs["Points"])
    group.links.new(cone.outputs["Mesh"], again.inputs["Instance"])
    group.links.new(again.outputs["Instances"], spread.inputs["Instance"])
    group.links.new(spread.outputs["Instances"], end.inputs[0])
    inner, outer = bpy.data.collections.new("Inner"), bpy.data.collections.new("Outer")
    host = bpy.data.objects.new("Host", cube_mesh(size=20.0))
    host.modifiers.new("Nodes", "NODES").node_group = group
    inner.objects.link(host)
    middle = bpy.data.objects.new("Middle", None)
    middle.instance_type, middle.instance_collection = "COLLECTION", inner
    middle.matrix_world = Matrix.Rotation(0.5, 4, "X")
    outer.objects.link(middle)
    for index, mirrored in enumerate((1.0, -1.0)):
        matrix = Matrix.Translation((0, 100 * index, 0)) @ Matrix.Diagonal((mirrored, 1, 1, 1))
        add_object(f"Top {index}", None, instance_type="COLLECTION", instance_collection=outer, matrix_world=matrix)
    exported = viewport_scene()
    assert_as_evaluated(exported)
    cone_triangles = exported.geometry.triangle_count / (2 * 8 * 8)
    assert cone_triangles == int(cone_triangles) > 10
    # A cone of 32 sides, radius 1 and height 2.
    assert volume(exported.geometry) == pytest.approx(2 * 64 * 16 * math.sin(math.pi / 16) * 2 / 3, rel=1e-3)
