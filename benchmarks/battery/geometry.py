# SPDX-License-Identifier: GPL-3.0-or-later
"""Kinds of objects, and what an object may say of its visibility."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np

from .nodes import diffuse, emission, material, node, set_world
from .stage import (
    ABOVE,
    GREEN,
    TESTED,
    TILT,
    Case,
    add_object,
    ball,
    ball_mesh,
    box_mesh,
    card,
    card_mesh,
    lamp,
    mesh,
    plain,
    room,
)


def _in_room(make: Callable[[bpy.types.Material], object]) -> Callable[[], None]:
    def build() -> None:
        room()
        make(plain(TESTED, GREEN))

    return build


def _hair(of: bpy.types.Material) -> None:
    """Hang a brush of 60 thick strands."""
    data = bpy.data.hair_curves.new(TESTED)
    data.add_curves([5] * 60)
    rng = np.random.default_rng(4)
    roots = rng.uniform(-0.5, 0.5, (60, 1, 2))
    points = np.zeros((60, 5, 3))
    points[:, :, :2] = roots + np.cumsum(rng.normal(0.0, 0.03, (60, 5, 2)), axis=1)
    points[:, :, 2] = np.linspace(0.0, 0.4, 5)
    data.points.foreach_set("position", points.astype(np.float32).ravel())
    radius = data.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.full(300, 0.02, dtype=np.float32))
    data.materials.append(of)
    add_object(TESTED, data, location=(-0.1, 0.0, 1.7))


def _shaped(shape: str, make: Callable[[bpy.types.Material], object]) -> Callable[[bpy.types.Material], object]:
    """Return what makes hair of a shape that is not Cycles' default."""

    def made(of: bpy.types.Material) -> None:
        bpy.context.scene.cycles_curves.shape = shape
        make(of)

    return made


def _points(of: bpy.types.Material) -> None:
    """Hang a cloud of 80 spheres."""
    data = bpy.data.pointclouds.new(TESTED)
    data.resize(80)
    places = np.random.default_rng(6).uniform((-0.6, -0.6, 0.0), (0.6, 0.6, 0.4), (80, 3))
    data.points.foreach_set("co", places.astype(np.float32).ravel())
    data.points.foreach_set("radius", np.full(80, 0.06, dtype=np.float32))
    data.materials.append(of)
    add_object(TESTED, data, location=(-0.1, 0.0, 1.7))


def _metaball(of: bpy.types.Material) -> None:
    data = bpy.data.metaballs.new(TESTED)
    data.resolution = data.render_resolution = 0.05
    for x in (-0.2, 0.2):
        element = data.elements.new()
        element.co, element.radius = (x, 0.0, 0.0), 0.4
    data.materials.append(of)
    add_object(TESTED, data, location=(0.0, 0.0, 1.95))


def _text(of: bpy.types.Material) -> None:
    data = bpy.data.curves.new(TESTED, "FONT")
    data.body, data.size, data.extrude, data.align_x = "IVG", 0.8, 0.05, "CENTER"
    data.materials.append(of)
    add_object(TESTED, data, location=(0.0, -0.2, 1.8), rotation_euler=(0.3, 0.2, 0.0))


def _curve(of: bpy.types.Material) -> None:
    data = bpy.data.curves.new(TESTED, "CURVE")
    data.dimensions, data.bevel_depth = "3D", 0.08
    spline = data.splines.new("POLY")
    spline.points.add(3)
    for point, place in zip(
        spline.points, ((-0.6, 0, 0, 1), (-0.2, 0.3, 0.2, 1), (0.2, -0.3, 0, 1), (0.6, 0, 0.2, 1)), strict=True
    ):
        point.co = place
    data.materials.append(of)
    add_object(TESTED, data, location=(0.0, 0.0, 1.8))


def _nested_instances(of: bpy.types.Material) -> None:
    """Instance a collection that holds instances of a collection."""
    inner, outer = (bpy.data.collections.new(name) for name in ("Inner", "Outer"))
    inner.objects.link(bpy.data.objects.new(TESTED, card_mesh(0.15, of)))
    for x in (-0.2, 0.2):
        holder = bpy.data.objects.new("Pair", None)
        holder.instance_type, holder.instance_collection = "COLLECTION", inner
        holder.location, holder.rotation_euler = (x, 0.0, 0.0), (0.3, 2 * x, 0.0)
        outer.objects.link(holder)
    for y in (-0.4, 0.0, 0.4):
        holder = add_object("Row", None, location=(0.0, y, 1.8), scale=(1.5, 1.0, 1.0), rotation_euler=(0.0, 0.0, y))
        holder.instance_type, holder.instance_collection = "COLLECTION", outer


def _mirrored(of: bpy.types.Material) -> None:
    """Hang a one-sided lamp of a mesh, turned inside out by its scale."""
    made = material(TESTED, emission((4.0, 3.0, 2.0), node("NewGeometry", "Backfacing")))
    card(made, scale=(-1.0, 1.0, 1.0))
    add_object("Ball", ball_mesh(0.2, of), location=(0.5, -0.4, 1.8), scale=(1.0, -0.7, 1.3))


def _shape_key(of: bpy.types.Material) -> None:
    made = card(of)
    made.shape_key_add(name="Basis")
    key = made.shape_key_add(name="Wide")
    for point in key.data:
        point.co.x *= 2.0
    key.value = 0.7


def _ray(**values: bool) -> Callable[[bpy.types.Material], object]:
    return lambda of: card(of, **values)


def _collection(**values: bool) -> Callable[[bpy.types.Material], object]:
    """Return what puts a card into a collection that the view layer shows in part."""

    def make(of: bpy.types.Material) -> None:
        made = card(of)
        collection = bpy.data.collections.new(TESTED)
        bpy.context.scene.collection.children.link(collection)
        bpy.context.scene.collection.objects.unlink(made)
        collection.objects.link(made)
        layer = bpy.context.view_layer.layer_collection.children[TESTED]
        for name, value in values.items():
            setattr(layer, name, value)

    return make


def _self_intersecting(of: bpy.types.Material) -> None:
    """Hang two boxes that cross each other and share an edge with a fin, as one mesh."""
    data = mesh(
        "Crossing",
        [(-0.5, 0, -0.2), (0.5, 0, -0.2), (0.5, 0.1, 0.3), (-0.5, 0, 0.3), (0, -0.5, 0), (0, 0.5, -0.1), (0.1, 0, 0.3)],
        [(0, 1, 2, 3), (4, 5, 6), (0, 1, 6), (0, 1, 5)],
        of,
    )
    add_object(TESTED, data, location=ABOVE, rotation_euler=(0.6, 0.3, 0.0))


def _hidden_instancer(of: bpy.types.Material) -> None:
    """Instance a card on the vertices of a square that does not itself render."""
    parent = card(plain("Parent"), 0.4, (0.0, 0.0, 1.9), (0.0, 0.0, 0.0))
    parent.instance_type, parent.show_instancer_for_render = "VERTS", False
    child = add_object("Leaf", card_mesh(0.18, of), rotation_euler=TILT)
    child.parent = parent


def _particles(of: bpy.types.Material) -> None:
    """Grow hair by a particle system, out of an upright card into the light."""
    made = card(of, 0.35, (0.0, 0.6, 1.9), (np.pi / 2, 0.0, 0.0))
    system = made.modifiers.new("Hair", "PARTICLE_SYSTEM").particle_system
    settings = system.settings
    settings.type, settings.count, settings.hair_length = "HAIR", 60, 0.7
    settings.root_radius = settings.tip_radius = 1.0
    settings.radius_scale = 0.02


def _geometry_nodes(of: bpy.types.Material) -> None:
    """Make a ring by geometry nodes, out of an object without faces."""
    tree = bpy.data.node_groups.new("Ring", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    cylinder = tree.nodes.new("GeometryNodeMeshCylinder")
    cylinder.inputs["Radius"].default_value, cylinder.inputs["Depth"].default_value = 0.5, 0.2
    paint = tree.nodes.new("GeometryNodeSetMaterial")
    paint.inputs["Material"].default_value = of
    output = tree.nodes.new("NodeGroupOutput")
    tree.links.new(cylinder.outputs["Mesh"], paint.inputs["Geometry"])
    tree.links.new(paint.outputs["Geometry"], output.inputs[0])
    made = add_object(TESTED, bpy.data.meshes.new("Nothing"), location=(0.0, 0.0, 1.9), rotation_euler=TILT)
    made.modifiers.new("Nodes", "NODES").node_group = tree


def _subdivided(of: bpy.types.Material) -> None:
    made = add_object(TESTED, box_mesh((0.8, 0.8, 0.6), of), location=(0.0, 0.0, 2.0))
    modifier = made.modifiers.new("Subdivision", "SUBSURF")
    modifier.levels, modifier.render_levels = 0, 3


def _displaced(of: bpy.types.Material) -> None:
    """Displace a fine card by its material."""
    tree = of.node_tree
    bump = tree.nodes.new("ShaderNodeDisplacement")
    bump.inputs["Scale"].default_value, bump.inputs["Height"].default_value = 1.0, 0.8
    tree.links.new(bump.outputs[0], tree.get_output_node("CYCLES").inputs["Displacement"])
    of.displacement_method = "DISPLACEMENT"
    add_object(TESTED, card_mesh(0.45, of, cuts=16), location=ABOVE, rotation_euler=TILT)


def _material_of_object(of: bpy.types.Material) -> None:
    made = card(plain("Data", (0.9, 0.1, 0.1)))
    made.material_slots[0].link = "OBJECT"
    made.material_slots[0].material = of


def _volume(of: bpy.types.Material) -> None:
    """Hang a box of thick smoke."""
    smoke = material(TESTED, diffuse(GREEN))
    tree = smoke.node_tree
    output = tree.get_output_node("CYCLES")
    tree.links.remove(output.inputs["Surface"].links[0])
    scatter = tree.nodes.new("ShaderNodeVolumeScatter")
    scatter.inputs["Density"].default_value = 3.0
    tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    add_object(TESTED, box_mesh((0.8, 0.8, 0.5), smoke), location=(0.0, 0.0, 2.0))


def _fast_lamp(of: bpy.types.Material) -> None:
    """Let a ball move while the shutter is open, which a bake does not show."""
    made = ball(of)
    made.keyframe_insert("location", frame=1)
    made.location.x += 0.8
    made.keyframe_insert("location", frame=2)
    bpy.context.scene.render.use_motion_blur = True
    bpy.context.scene.frame_set(1)


def _coarse_and_smooth(of: bpy.types.Material) -> None:
    """Hang a smooth box: its shading normals are far from its faces' own."""
    data = box_mesh((0.8, 0.8, 0.6), of)
    data.shade_smooth()
    add_object(TESTED, data, location=(0.0, 0.0, 2.0), rotation_euler=TILT)


def _custom_normals(of: bpy.types.Material) -> None:
    made = card(of)
    made.data.normals_split_custom_set([(0.5, 0.3, 0.8)] * len(made.data.loops))


def _without_material(of: bpy.types.Material) -> None:
    add_object(TESTED, card_mesh(0.45), location=ABOVE, rotation_euler=TILT)


def _empty_slot(of: bpy.types.Material) -> None:
    made = card(of)
    made.data.materials.clear()
    made.data.materials.append(None)


def _smoothed_by_angle(of: bpy.types.Material) -> None:
    made = ball(of)
    made.data.set_sharp_from_angle(angle=0.1)


def _turned_over(of: bpy.types.Material) -> None:
    """Hang a ball that is inside out."""
    ball(of).data.flip_normals()


def _fluffy_mesh(of: bpy.types.Material) -> None:
    """Hang a card whose mesh has loose edges and points, which render nothing."""
    data = mesh(TESTED, [(-0.4, -0.4, 0), (0.4, -0.4, 0), (0, 0.4, 0), (0, 0, 0.5), (0.2, 0.2, 0.6)], [(0, 1, 2)], of)
    data.edges.add(1)
    data.edges[-1].vertices = (3, 4)
    add_object(TESTED, data, location=ABOVE)


def _grease_pencil(of: bpy.types.Material) -> None:
    bpy.ops.object.grease_pencil_add(type="MONKEY", location=(0.0, 0.0, 2.0))
    bpy.context.object.name = TESTED


def _portal() -> None:
    """Hang a portal, which lights nothing by itself; without a world, Cycles of Blender 5.2 crashes."""
    room()
    set_world("World", node("Background", Color=(0.4, 0.6, 0.9)))
    lamp("AREA", TESTED, (0.8, 0.8, 2.5)).data.cycles.is_portal = True


CASES = (
    Case("object: coarse and smooth", _in_room(_coarse_and_smooth)),
    Case("object: custom normals", _in_room(_custom_normals)),
    Case("object: without material", _in_room(_without_material)),
    Case("object: empty material slot", _in_room(_empty_slot)),
    Case("object: sharp by angle", _in_room(_smoothed_by_angle)),
    Case("object: inside out", _in_room(_turned_over)),
    Case("object: loose edges and points", _in_room(_fluffy_mesh)),
    Case("object: Grease Pencil", _in_room(_grease_pencil)),
    Case("object: hair curves", _in_room(_hair)),
    Case("object: hair curves, tubes", _in_room(_shaped("THICK", _hair))),
    Case("object: hair curves, linear tubes", _in_room(_shaped("THICK_LINEAR", _hair))),
    Case("object: hair particles", _in_room(_particles)),
    Case("object: point cloud", _in_room(_points)),
    Case("object: metaball", _in_room(_metaball)),
    Case("object: text", _in_room(_text)),
    Case("object: curve with bevel", _in_room(_curve)),
    Case("object: geometry nodes", _in_room(_geometry_nodes)),
    Case("object: subdivided for renders", _in_room(_subdivided)),
    Case("object: displaced by its material", _in_room(_displaced)),
    Case("object: volume", _in_room(_volume)),
    Case("object: instances of instances", _in_room(_nested_instances)),
    Case("object: instances on vertices", _in_room(_hidden_instancer)),
    Case("object: negative scale", _in_room(_mirrored)),
    Case("object: shape key", _in_room(_shape_key)),
    Case("object: self-intersecting, non-manifold", _in_room(_self_intersecting)),
    Case("object: material of the object", _in_room(_material_of_object)),
    Case("object: motion blur", _in_room(_fast_lamp)),
    Case("visible: not to diffuse rays", _in_room(_ray(visible_diffuse=False))),
    Case("visible: not to shadow rays", _in_room(_ray(visible_shadow=False))),
    Case("visible: not to the camera", _in_room(_ray(visible_camera=False))),
    Case("visible: not to glossy rays", _in_room(_ray(visible_glossy=False))),
    Case("visible: not to transmission rays", _in_room(_ray(visible_transmission=False))),
    Case("visible: holdout", _in_room(_ray(is_holdout=True))),
    Case("visible: shadow catcher", _in_room(_ray(is_shadow_catcher=True))),
    Case("visible: hidden in renders", _in_room(_ray(hide_render=True))),
    Case("visible: hidden in the viewport", _in_room(_ray(hide_viewport=True))),
    Case("visible: excluded collection", _in_room(_collection(exclude=True))),
    Case("visible: indirect-only collection", _in_room(_collection(indirect_only=True))),
    Case("visible: holdout collection", _in_room(_collection(holdout=True))),
    Case(
        "visible: shining, not to diffuse rays",
        lambda: (room(), card(material(TESTED, emission((4.0, 3.0, 2.0))), visible_diffuse=False)),
    ),
    Case(
        "visible: shining, not to the camera",
        lambda: (room(), card(material(TESTED, emission((4.0, 3.0, 2.0))), visible_camera=False)),
    ),
    Case("visible: lamp, a portal", _portal),
)
