# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair and point clouds: what is read of them, and what becomes of it."""

from __future__ import annotations

import math
from collections.abc import Iterator

import bpy
import numpy as np
import pytest

from ivg_addon.blender import export_geometry, export_strands
from ivg_addon.blender.export import export_render_steps
from ivg_addon.core.progress import finish
from ivg_addon.core.scene import Scene
from ivg_addon.core.strand_ends import end_triangles
from tests.blender.export_scenes import (
    add_object,
    area_vectors,
    cube_mesh,
    empty_scene,
    new_material,
    point_cloud,
    viewport_scene,
    volume,
)


@pytest.fixture(autouse=True)
def scene() -> Iterator[bpy.types.Scene]:
    yield empty_scene()


def rendered_scene() -> Scene:
    return finish(export_render_steps(bpy.context.scene, bpy.context.view_layer))


def area(exported: Scene) -> float:
    return float(np.linalg.norm(area_vectors(exported.geometry), axis=1).sum())


def needles(count: int = 3, **values: object) -> bpy.types.Object:
    """Add hair: straight, one metre long, a metre apart."""
    fur = bpy.data.hair_curves.new("Fur")
    fur.add_curves([3] * count)
    positions = [(i, 0, z) for i in range(count) for z in (0.0, 0.5, 1.0)]
    fur.position_data.foreach_set("vector", np.array(positions, dtype=np.float32).ravel())
    return add_object("Fur", fur, **values)


def radius_of(data: bpy.types.ID, values: list[float], domain: str = "POINT") -> None:
    attribute = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", domain)
    attribute.data.foreach_set("value", np.array(values, dtype=np.float32))


def cloud(centers: list[tuple[float, ...]], radii: list[float] | None = None, **values: object) -> bpy.types.Object:
    made = point_cloud(np.array(centers), None if radii is None else np.array(radii))
    for name, value in values.items():
        setattr(made, name, value)
    return made


def test_curves_without_radius_have_that_of_cycles() -> None:
    needles()
    assert area(viewport_scene()) == pytest.approx(3 * 2 * math.pi * 0.005, rel=2e-3)


def test_radius_of_points_and_of_curves() -> None:
    points = needles().data
    radius_of(points, [0.01, 0.02, 0.03] * 3)
    assert area(viewport_scene()) == pytest.approx(3 * 2 * math.pi * 0.02, rel=2e-3)
    empty_scene()
    radius_of(needles().data, [0.01, 0.02, 0.03], "CURVE")
    assert area(viewport_scene()) == pytest.approx(3 * 2 * math.pi * 0.02, rel=2e-3)


@pytest.mark.parametrize("scale", [(1, 1, 1), (-2, 2, 2)])
def test_curves_are_where_they_are(scale: tuple[float, ...]) -> None:
    needles(scale=scale, location=(0, 5, 0))
    exported = viewport_scene()
    low, high = exported.geometry.bounds()
    s = abs(scale[0])
    x = sorted((0.0, 2.0 * scale[0]))
    np.testing.assert_allclose(low, (x[0], 5, 0), atol=0.006 * s)
    np.testing.assert_allclose(high, (x[1], 5, s), atol=0.006 * s)
    assert volume(exported.geometry) > 0
    assert area(exported) == pytest.approx(3 * 2 * math.pi * 0.005 * s * s, rel=2e-3)


def test_shape_of_hair_and_type_of_curves_make_corners(scene: bpy.types.Scene) -> None:
    """Ribbons and tubes are splines; linear tubes and poly curves are straight between their points."""
    counts = {}
    for shape, poly in (("RIBBONS", False), ("THICK", False), ("THICK_LINEAR", False), ("THICK", True)):
        scene = empty_scene()
        scene.cycles_curves.shape = shape
        fur = needles(1).data
        fur.position_data.foreach_set("vector", np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0)], dtype=np.float32).ravel())
        if poly:
            fur.set_types(type="POLY")
        counts[shape, poly] = viewport_scene().geometry.triangle_count
    assert counts["THICK_LINEAR", False] - end_triangles(9) == counts["THICK", True] == 2 * 2 * 9
    assert counts["RIBBONS", False] == counts["THICK", False] > 2 * counts["THICK", True]


def test_hair_is_of_the_first_material() -> None:
    fur = needles().data
    for name in ("First", "Second"):
        fur.materials.append(bpy.data.materials.new(name))
    exported = viewport_scene()
    assert {exported.materials.names[i] for i in exported.geometry.material} == {"First"}


def textured(name: str) -> bpy.types.Material:
    image = bpy.data.images.new("Image", 4, 4)

    def build(tree: bpy.types.NodeTree, output: bpy.types.Node) -> None:
        texture, shader = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeBsdfDiffuse")
        texture.image = image
        tree.links.new(texture.outputs["Color"], shader.inputs["Color"])
        tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])

    return new_material(name, build)


def test_curves_take_their_roots_texture_coordinates() -> None:
    fur = needles().data
    uvs = np.array([(0.1, 0.9), (0.5, 0.5), (0.7, 0.2)], dtype=np.float32)
    fur.attributes.new("surface_uv", "FLOAT2", "CURVE").data.foreach_set("vector", uvs.ravel())
    fur.materials.append(textured("Textured"))
    geometry = viewport_scene().geometry
    strand = np.round(geometry.vertices[geometry.triangles][:, :, 0]).astype(int)
    np.testing.assert_allclose(geometry.uvs, uvs[strand])


def test_point_clouds_are_spheres() -> None:
    cloud([(0, 0, 0), (3, 0, 0)], [0.5, 1.0], location=(0, 0, 1), scale=(-2, 2, 2))
    exported = viewport_scene()
    assert area(exported) == pytest.approx(4 * math.pi * (1 + 4), rel=1e-4)
    assert volume(exported.geometry) == pytest.approx(4 / 3 * math.pi * (1 + 8), rel=0.03)
    low, high = exported.geometry.bounds()
    np.testing.assert_allclose(low, (-8, -2, -1), atol=0.05)
    np.testing.assert_allclose(high, (1, 2, 3), atol=0.05)
    assert not [notice for notice in exported.notices if notice.subject == "object 'Cloud'"]


def test_points_without_radius_have_that_of_cycles() -> None:
    cloud([(0, 0, 0)])
    data = bpy.data.objects["Cloud"].data
    if data.attributes.get("radius"):
        data.attributes.remove(data.attributes["radius"])
    assert area(viewport_scene()) == pytest.approx(4 * math.pi * 0.01**2, rel=1e-4)


def test_points_of_uneven_scale_are_named() -> None:
    cloud([(0, 0, 0)], [1.0], scale=(1, 1, 3))
    messages = [notice.message for notice in viewport_scene().notices if notice.subject == "object 'Cloud'"]
    assert messages == ["points of uneven scale shaded as ellipsoids, by Cycles as spheres"]


def test_points_of_geometry_nodes_in_instances() -> None:
    """A mesh whose nodes make points only, instanced by a collection: there is no mesh, and no point cloud object."""
    group = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    begin, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    points = group.nodes.new("GeometryNodeMeshToPoints")
    points.inputs["Radius"].default_value = 0.1
    group.links.new(begin.outputs[0], points.inputs[0])
    group.links.new(points.outputs[0], end.inputs[0])
    content = bpy.data.collections.new("Content")
    host = bpy.data.objects.new("Host", cube_mesh())
    host.modifiers.new("Nodes", "NODES").node_group = group
    content.objects.link(host)
    for index in range(3):
        add_object(f"Top {index}", None, instance_type="COLLECTION", instance_collection=content)
    exported = viewport_scene()
    assert area(exported) == pytest.approx(3 * 8 * 4 * math.pi * 0.01, rel=1e-3)
    assert exported.objects == ("Host",)


def furry(**settings: object) -> bpy.types.Object:
    """Add a ball with a hundred hairs of particles, each straight and a metre long."""
    bpy.ops.mesh.primitive_uv_sphere_add(radius=1)
    host = bpy.context.object
    host.name = "Host"
    host.modifiers.new("Fur", "PARTICLE_SYSTEM")
    particles = host.particle_systems[0].settings
    values = {
        "type": "HAIR",
        "count": 100,
        "hair_length": 1.0,
        "radius_scale": 0.01,
        "tip_radius": 1.0,
        "use_close_tip": False,
    }
    for name, value in {**values, "display_step": 2, "render_step": 3, **settings}.items():
        setattr(particles, name, value)
    bpy.context.view_layer.update()
    return host


def hair_area(exported: Scene, ball: bool = True) -> float:
    """Return the area without that of the ball, whose 512 flat faces are known."""
    if not ball:
        return area(exported)
    faces = bpy.data.objects["Host"].data.polygons
    return area(exported) - sum(face.area for face in faces)


def test_particle_hair() -> None:
    furry()
    # Diameters of a hundredth of a metre; where hair grows from faces it may be a little longer or shorter.
    want = 100 * math.pi * 0.01
    for exported, keys in ((viewport_scene(), 5), (rendered_scene(), 9)):
        assert hair_area(exported) == pytest.approx(want, rel=0.02)
        ball = sum(len(face.vertices) - 2 for face in bpy.data.objects["Host"].data.polygons)
        assert exported.geometry.triangle_count - ball == 100 * (keys - 1) * 2 * 9
        assert not any(notice.kind == "left out" for notice in exported.notices)


def test_the_tip_of_particle_hair_may_be_closed() -> None:
    furry(use_close_tip=True)
    # The radius is a spline, as Cycles has it: see test_a_closed_tip_is_as_thick_as_the_spline_of_its_radius.
    share = (6 + (1 + 1 / 24) + 131 / 240) / 8
    assert hair_area(rendered_scene()) == pytest.approx(share * 100 * math.pi * 0.01, rel=0.02)


def test_particle_hair_narrows_to_its_tip() -> None:
    furry(tip_radius=0.0)
    # A cone has half of a cylinder's area.
    assert hair_area(rendered_scene()) == pytest.approx(50 * math.pi * 0.01, rel=0.02)


def test_children_take_the_place_of_their_parents() -> None:
    furry(child_type="SIMPLE", rendered_child_count=7)
    children = rendered_scene().geometry.triangle_count
    empty_scene()
    furry()
    parents = rendered_scene().geometry.triangle_count
    ball = sum(len(face.vertices) - 2 for face in bpy.data.objects["Host"].data.polygons)
    assert children - ball == 7 * (parents - ball)


def test_hair_of_a_hidden_emitter() -> None:
    host = furry()
    host.show_instancer_for_viewport = host.show_instancer_for_render = False
    for exported in (viewport_scene(), rendered_scene()):
        assert exported.objects == ("Host",)
        assert hair_area(exported, ball=False) == pytest.approx(100 * math.pi * 0.01, rel=0.02)


def test_hair_of_particles_has_its_slots_material_and_its_roots_texture_coordinates() -> None:
    host = furry(material=2)
    host.data.materials.append(bpy.data.materials.new("Skin"))
    host.data.materials.append(textured("Hair"))
    exported = rendered_scene()
    names = np.array(exported.materials.names)[exported.geometry.material]
    ball = sum(len(face.vertices) - 2 for face in host.data.polygons)
    assert np.count_nonzero(names == "Skin") == ball
    hair = names == "Hair"
    assert np.count_nonzero(hair) == len(hair) - ball
    uvs = exported.geometry.uvs[hair]
    assert np.ptp(uvs, axis=1).max() == 0, "one place of the emitter for all of a strand"
    # The texture coordinates of a ball are the longitude and the latitude.
    corners = exported.geometry.vertices[exported.geometry.triangles[hair]].mean(axis=1)
    latitude = np.arcsin(corners[:, 2] / np.linalg.norm(corners, axis=1)) / math.pi + 0.5
    assert np.abs(uvs[:, 0, 1] - latitude).max() < 0.05


def test_a_layer_without_hair_has_none() -> None:
    needles()
    furry()
    bpy.context.view_layer.use_strand = False
    exported = rendered_scene()
    assert exported.objects == ("Host",)
    assert hair_area(exported) == pytest.approx(0, abs=1e-3)


def test_instanced_hair() -> None:
    content = bpy.data.collections.new("Content")
    fur = needles()
    bpy.context.scene.collection.objects.unlink(fur)
    content.objects.link(fur)
    for index in range(4):
        add_object(f"Top {index}", None, instance_type="COLLECTION", instance_collection=content)
    exported = viewport_scene()
    assert area(exported) == pytest.approx(4 * 3 * 2 * math.pi * 0.005, rel=2e-3)
    assert exported.geometry.triangle_count == 4 * 3 * 2 * 2 * 9
    assert exported.objects == ("Fur",)


def test_too_much_hair_is_thinned_and_named(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (export_strands, export_geometry):
        if hasattr(module, "MOST_TRIANGLES"):
            monkeypatch.setattr(module, "MOST_TRIANGLES", 6 * 9 * 20)
    furry()
    exported = rendered_scene()
    assert hair_area(exported) == pytest.approx(100 * math.pi * 0.01, rel=0.1)
    messages = [notice.message for notice in exported.notices if notice.subject == "object 'Host'"]
    assert messages == ["20 of 100 hairs taken and made larger to cover as much: more need too much memory"]
