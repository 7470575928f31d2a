# SPDX-License-Identifier: GPL-3.0-or-later
"""Attributes of instances, as a node of the type "Instancer" finds them; the battery holds the same against Cycles."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ivg_addon.blender.instancers import Instancers
from tests.blender.export_scenes import add_object, cube_mesh, empty_scene

NAME = "shade"
Made = dict[tuple[float, ...], tuple[float, ...]]


def nodes(
    levels: Sequence[Sequence[float]], leaf: bpy.types.Object | bpy.types.Collection | None, ids: Sequence[int] = ()
) -> bpy.types.Object:
    """Return an object of instances along x, those again along y …, with an attribute on each level that has values."""
    tree = bpy.data.node_groups.new("Instances", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    if isinstance(leaf, bpy.types.Collection):
        info = tree.nodes.new("GeometryNodeCollectionInfo")
        info.inputs["Collection"].default_value = leaf
        made = info.outputs[0]
    elif leaf is not None:
        info = tree.nodes.new("GeometryNodeObjectInfo")
        info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = leaf, True
        made = info.outputs["Geometry"]
    else:
        made = tree.nodes.new("GeometryNodeMeshCube").outputs[0]
    for axis, values in enumerate(levels):
        mesh = bpy.data.meshes.new("Points")
        places = np.zeros((2, 3))
        places[1, axis] = 1.0
        mesh.from_pydata(places.tolist(), [], [])
        if values:
            mesh.attributes.new("value", "FLOAT", "POINT").data.foreach_set("value", list(values))
        if ids:
            mesh.attributes.new("id", "INT", "POINT").data.foreach_set("value", list(ids))
        source = tree.nodes.new("GeometryNodeObjectInfo")
        source.inputs["Object"].default_value = bpy.data.objects.new("Points", mesh)
        spread = tree.nodes.new("GeometryNodeInstanceOnPoints")
        tree.links.new(source.outputs["Geometry"], spread.inputs["Points"])
        tree.links.new(made, spread.inputs["Instance"])
        made = spread.outputs[0]
        if values:
            read = tree.nodes.new("GeometryNodeInputNamedAttribute")
            read.inputs["Name"].default_value = "value"
            store = tree.nodes.new("GeometryNodeStoreNamedAttribute")
            store.domain, store.inputs["Name"].default_value = "INSTANCE", NAME
            tree.links.new(made, store.inputs["Geometry"])
            tree.links.new(read.outputs["Attribute"], store.inputs["Value"])
            made = store.outputs[0]
    tree.links.new(made, tree.nodes.new("NodeGroupOutput").inputs[0])
    host = add_object("Host", bpy.data.meshes.new("Nothing"))
    host.modifiers.new("Nodes", "NODES").node_group = tree
    return host


def found() -> tuple[Made, list[str]]:
    """Return the attribute of each instance by where it is, and what was said."""
    instancers = Instancers()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    looked_up = {
        tuple(round(x) for x in instance.matrix_world.translation): instancers.look_up(instance, NAME)
        for instance in depsgraph.object_instances
        if instance.is_instance
    }
    return looked_up, [notice.subject for notice in instancers.notices]


def grey(value: float) -> tuple[float, ...]:
    return (value, value, value, 1.0)


def test_the_innermost_instances_speak_first() -> None:
    for leaf in (None, "object"):
        empty_scene()
        made = bpy.data.objects.new("Leaf", cube_mesh("Leaf", 0.1)) if leaf else None
        nodes([(0.25, 0.5), (0.75, 1.0)], made)
        assert found()[0] == {(0, y, 0): grey(0.25) for y in (0, 1)} | {(1, y, 0): grey(0.5) for y in (0, 1)}
        empty_scene()
        made = bpy.data.objects.new("Leaf", cube_mesh("Leaf", 0.1)) if leaf else None
        nodes([(), (0.75, 1.0)], made, ids=(70, -3))
        assert found()[0] == {(x, 0, 0): grey(0.75) for x in (0, 1)} | {(x, 1, 0): grey(1.0) for x in (0, 1)}


def test_without_an_attribute_the_instancer_and_then_the_object_is_asked() -> None:
    empty_scene()
    leaf = bpy.data.objects.new("Leaf", cube_mesh("Leaf", 0.1))
    host = nodes([()], leaf)
    assert set(found()[0].values()) == {(0.0, 0.0, 0.0, 0.0)}
    leaf[NAME] = 0.5
    leaf.update_tag()
    assert set(found()[0].values()) == {grey(0.5)}
    host[NAME] = (0.25, 0.5, 0.75)
    host.update_tag()
    assert set(found()[0].values()) == {(0.25, 0.5, 0.75, 1.0)}


def test_collections_are_instanced_as_one_and_what_is_nested_in_them_is_named() -> None:
    empty_scene()
    leaves = bpy.data.collections.new("Leaves")
    for x in (0.0, 5.0):
        leaves.objects.link(bpy.data.objects.new("Leaf", cube_mesh("Leaf", 0.1)))
        leaves.objects[-1].location.x = x
    nodes([(0.25, 0.5)], leaves)
    made, notices = found()
    assert made == {(0, 0, 0): grey(0.25), (5, 0, 0): grey(0.25), (1, 0, 0): grey(0.5), (6, 0, 0): grey(0.5)}
    assert not notices
    outer = bpy.data.collections.new("Outer")
    outer.objects.link(bpy.data.objects["Host"])
    add_object("Holder", None, instance_type="COLLECTION", instance_collection=outer)
    assert "object 'Holder'" in found()[1]


def test_instances_that_share_an_id_are_named() -> None:
    empty_scene()
    nodes([(0.25, 0.5)], None, ids=(7, 7))
    made, notices = found()
    assert made[0, 0, 0] == grey(0.25)
    assert notices == ["object 'Host'"]
