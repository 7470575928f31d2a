# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials that are awkward to give light to, and all that a material is, as text."""

from __future__ import annotations

from typing import Any

import bpy

_NOT_ITS_OWN = {"rna_type", "session_uid", "bl_rna", "users", "internal_links", "dimensions", "preview", "use_nodes"}


def tree_of(name: str) -> tuple[bpy.types.Material, Any, bpy.types.Node]:
    """Return a new material, a function that adds a node, and its output node."""
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    tree.nodes.clear()

    def add(kind: str, **inputs: Any) -> bpy.types.Node:
        node = tree.nodes.new("ShaderNode" + kind)
        for key, value in inputs.items():
            socket = node.inputs[key.replace("_", " ")]
            if isinstance(value, bpy.types.NodeSocket):
                tree.links.new(value, socket)
            else:
                socket.default_value = value
        return node

    return material, add, add("OutputMaterial")


def diffuse(color: tuple[float, ...] = (0.8, 0.5, 0.2, 1.0)) -> bpy.types.Material:
    """Return a Diffuse BSDF of a colour."""
    material, add, output = tree_of("Diffuse")
    material.node_tree.links.new(add("BsdfDiffuse", Color=color).outputs[0], output.inputs[0])
    return material


def mixed() -> bpy.types.Material:
    """Return half of two diffuse colours, one by way of reroutes, one link muted, one BSDF used twice, with bumps."""
    material, add, output = tree_of("Mixed")
    tree = material.node_tree
    bump = add("Bump", Height=add("TexNoise").outputs[0]).outputs[0]
    first = add("BsdfDiffuse", Color=(0.8, 0.4, 0.2, 1.0), Normal=bump)
    second = add("BsdfPrincipled", Base_Color=(0.2, 0.4, 0.8, 1.0), Normal=bump)
    second.parent = tree.nodes.new("NodeFrame")
    reroute = tree.nodes.new("NodeReroute")
    tree.links.new(first.outputs[0], reroute.inputs[0])
    mix = tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(reroute.outputs[0], mix.inputs[1])
    tree.links.new(second.outputs[0], mix.inputs[2])
    unused = tree.nodes.new("ShaderNodeAddShader")
    tree.links.new(first.outputs[0], unused.inputs[0]).is_muted = True
    tree.links.new(mix.outputs[0], output.inputs[0])
    first.select = False
    tree.nodes.active = bump.node
    return material


def grouped() -> bpy.types.Material:
    """Return a diffuse surface in a group in a group, its colour from outside, mixed with glass."""
    inner = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
    inner.interface.new_socket("Tint", in_out="INPUT", socket_type="NodeSocketColor")
    inner.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    come, go, bsdf = (inner.nodes.new(kind) for kind in ("NodeGroupInput", "NodeGroupOutput", "ShaderNodeBsdfDiffuse"))
    inner.links.new(come.outputs[0], bsdf.inputs["Color"])
    inner.links.new(bsdf.outputs[0], go.inputs[0])
    outer = inner.copy()
    outer.name = "Outer"
    outer.nodes.remove(outer.nodes["Diffuse BSDF"])
    within = outer.nodes.new("ShaderNodeGroup")
    within.node_tree = inner
    outer.links.new(outer.nodes["Group Input"].outputs[0], within.inputs[0])
    outer.links.new(within.outputs[0], outer.nodes["Group Output"].inputs[0])
    material, add, output = tree_of("Grouped")
    group = material.node_tree.nodes.new("ShaderNodeGroup")
    group.node_tree = outer
    group.inputs[0].default_value = (0.1, 0.6, 0.3, 1.0)
    both = add("AddShader")
    material.node_tree.links.new(group.outputs[0], both.inputs[0])
    material.node_tree.links.new(add("BsdfGlass").outputs[0], both.inputs[1])
    material.node_tree.links.new(both.outputs[0], output.inputs[0])
    return material


def two_outputs() -> bpy.types.Material:
    """Return another surface for EEVEE than for Cycles, one of which shines."""
    material, add, output = tree_of("Two Outputs")
    output.target = "CYCLES"
    other = add("OutputMaterial")
    other.target = "EEVEE"
    material.node_tree.links.new(add("BsdfPrincipled", Emission_Strength=2.0).outputs[0], output.inputs[0])
    material.node_tree.links.new(add("SubsurfaceScattering").outputs[0], other.inputs[0])
    material.cycles.emission_sampling = "FRONT"
    return material


def glass() -> bpy.types.Material:
    """Return a material that needs no light: glass, a diffuse node that is muted, one that goes nowhere."""
    material, add, output = tree_of("Glass")
    add("BsdfDiffuse")
    muted = add("BsdfDiffuse")
    muted.mute = True
    both = add("AddShader")
    for shader, socket in ((add("BsdfGlass"), both.inputs[0]), (muted, both.inputs[1])):
        material.node_tree.links.new(shader.outputs[0], socket)
    material.node_tree.links.new(both.outputs[0], output.inputs[0])
    return material


def content(owner: bpy.types.bpy_struct) -> dict[str, Any]:
    """Return the settings of Blender data, as far as they are values, and its custom properties."""
    found: dict[str, Any] = {}
    for prop in owner.bl_rna.properties:
        if prop.identifier in _NOT_ITS_OWN or prop.type == "COLLECTION":
            continue
        value = getattr(owner, prop.identifier)
        if isinstance(value, bpy.types.bpy_struct):
            value = value.name if hasattr(value, "name") else None
        elif prop.type in {"FLOAT", "INT", "BOOLEAN"} and getattr(prop, "is_array", False):
            value = repr([tuple(part) if hasattr(part, "__len__") else part for part in value])
        found[prop.identifier] = value
    if isinstance(owner, bpy.types.ID | bpy.types.Node):
        found["custom"] = sorted(owner.keys())
    return found


def fingerprint(tree: bpy.types.NodeTree) -> dict[str, Any]:
    """Return every node with its settings and sockets, and every link, of a tree."""
    return {
        "nodes": {
            node.name: (content(node), [content(socket) for socket in (*node.inputs, *node.outputs)])
            for node in tree.nodes
        },
        "links": sorted(
            (
                link.from_node.name,
                link.from_socket.identifier,
                link.to_node.name,
                link.to_socket.identifier,
                link.is_muted,
            )
            for link in tree.links
        ),
        "active": tree.nodes.active and tree.nodes.active.name,
    }


def everything() -> dict[str, Any]:
    """Return all materials and node groups of the file."""
    materials = {
        material.name: (
            content(material),
            material.cycles.emission_sampling,
            material.cycles.is_property_set("emission_sampling"),
            fingerprint(material.node_tree),
        )
        for material in bpy.data.materials
    }
    groups = {group.name: (group.users, content(group), fingerprint(group)) for group in bpy.data.node_groups}
    return {"materials": materials, "groups": groups}
