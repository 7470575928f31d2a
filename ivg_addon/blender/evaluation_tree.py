# SPDX-License-Identifier: GPL-3.0-or-later
"""A copy of a material that shines with the values of its leaves.

The copy lies on a mesh that stands in world space, so what the original reads of its object comes from attributes of
that mesh, what it reads of the ray is fixed to a ray of diffuse light, and the direction of view to one, or averaged.
All else is left to Cycles as it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack

import bpy

from .cycles_stage import removed
from .export_colours import RAY_THAT_SHADES
from .export_needs import READS_GENERATED
from .export_nodes import Output
from .export_sockets import DISPLACEMENT, LeafSource, seen_at

GENERATED, LOCAL, LOCAL_NORMAL = "ivg generated", "ivg local", "ivg local normal"
LOCATION, COLOUR, INDEX, RANDOM = "ivg location", "ivg colour", "ivg index", "ivg random"
DEFAULT_UV, DEFAULT_COLOUR, ATLAS = "ivg uv", "ivg default colour", "ivg atlas"
PROPERTY, INSTANCED = "ivg property ", "ivg instanced "
"""Names of the mesh's attributes; after these two come the names of the object's properties, and of the instance's
attributes."""

_FROM_OBJECT = {
    "Location": (LOCATION, "Vector"),
    "Color": (COLOUR, "Color"),
    "Alpha": (COLOUR, "Alpha"),
    "Object Index": (INDEX, "Fac"),
    "Random": (RANDOM, "Fac"),
}

Groups = tuple[bpy.types.Node, ...]


class StageMaterial:
    """A copy of a material, for as long as `stack` is open.

    What it can show together is told by `passes`, and `normal_passes` for normals: these as halves of them, and ½.

    Parameters
    ----------
    leaves
        What can be shown.
    size
        Texels of the image that it is baked into, (width, height).
    """

    def __init__(
        self, stack: ExitStack, original: bpy.types.Material, leaves: Sequence[LeafSource], size: tuple[int, int]
    ) -> None:
        self._stack = stack
        self._sides: list[bpy.types.Node] = []
        self._views: list[tuple[bpy.types.Node, Output]] = []
        self.passes = _passes(leaves)
        self.normal_passes = [[index] for index, leaf in enumerate(leaves) if leaf.normal]
        self.material = stack.enter_context(removed(bpy.data.materials, original.copy))
        self.material.displacement_method = "BUMP"
        self.material.cycles.emission_sampling = "NONE"
        self._tree = self.material.node_tree
        self._prepare(self._tree, ())
        self._sources = [self._expose(leaf) for leaf in leaves]
        self._leaves = leaves
        self._emission = self._tree.nodes.new("ShaderNodeEmission")
        output = self._tree.get_output_node("CYCLES")
        bent = original.displacement_method == "BUMP"
        for socket in output.inputs:
            if socket.identifier == DISPLACEMENT and bent:
                continue  # it bends the normal that all nodes see
            for link in list(socket.links):
                self._tree.links.remove(link)
        self._tree.links.new(self._emission.outputs[0], output.inputs["Surface"])
        width, height = size
        self.image = stack.enter_context(
            removed(
                bpy.data.images,
                lambda: bpy.data.images.new("Atlas", width, height, float_buffer=True, is_data=True),
            )
        )
        target = self._tree.nodes.new("ShaderNodeTexImage")
        target.image = self.image
        self._tree.nodes.active = target

    def show(self, shown: Sequence[int]) -> None:
        """Shine with the leaves of one of the passes, or not at all without."""
        colour = self._emission.inputs["Color"]
        for link in list(colour.links):
            self._tree.links.remove(link)
        if not shown:
            colour.default_value = (0.0, 0.0, 0.0, 1.0)
            return
        for node in self._sides:
            node.outputs[0].default_value = float(self._leaves[shown[0]].side)
        for node, seen in self._views:
            node.outputs[0].default_value = seen_at(seen, self._leaves[shown[0]].cosine)
        if self._leaves[shown[0]].normal:
            # Light is not negative.
            half = self._tree.nodes.new("ShaderNodeVectorMath")
            half.operation = "MULTIPLY_ADD"
            half.inputs[1].default_value = half.inputs[2].default_value = (0.5, 0.5, 0.5)
            self._tree.links.new(self._sources[shown[0]], half.inputs[0])
            self._tree.links.new(half.outputs[0], colour)
            return
        if self._leaves[shown[0]].colour:
            self._tree.links.new(self._sources[shown[0]], colour)
            return
        combine = self._tree.nodes.new("ShaderNodeCombineXYZ")
        for leaf, socket in zip(shown, combine.inputs, strict=False):
            self._tree.links.new(self._sources[leaf], socket)
        self._tree.links.new(combine.outputs[0], colour)

    def _prepare(self, tree: bpy.types.NodeTree, groups: Groups) -> None:
        """Replace what a tree reads of the object and of the ray, in groups too."""
        for node in list(tree.nodes):
            if node.type == "GROUP" and node.node_tree is not None:
                node.node_tree = self._stack.enter_context(removed(bpy.data.node_groups, node.node_tree.copy))
                self._prepare(node.node_tree, (*groups, node))
            else:
                self._replace(tree, node, groups)

    def _replace(self, tree: bpy.types.NodeTree, node: bpy.types.Node, groups: Groups) -> None:
        match node.type:
            case "TEX_COORD":
                _show(tree, node, "Generated", GENERATED)
                if node.object is None:
                    _show(tree, node, "Object", LOCAL)
                _show(tree, node, "Normal", LOCAL_NORMAL)
            case "OBJECT_INFO":
                for output, (attribute, kind) in _FROM_OBJECT.items():
                    _show(tree, node, output, attribute, kind)
            case "ATTRIBUTE" if node.attribute_type in ("OBJECT", "INSTANCER"):
                kind = PROPERTY if node.attribute_type == "OBJECT" else INSTANCED
                node.attribute_type = "GEOMETRY"
                node.attribute_name = kind + node.attribute_name
            case "VERTEX_COLOR" if not node.layer_name:
                for output in ("Color", "Alpha"):
                    _show(tree, node, output, DEFAULT_COLOUR, output)
            case "LIGHT_PATH":
                for socket in node.outputs:
                    _fix(tree, socket, RAY_THAT_SHADES.get(socket.name, 0.0))
            case "NEW_GEOMETRY":
                self._sides += _fix(tree, node.outputs["Backfacing"], 0.0)
            case "FRESNEL" | "LAYER_WEIGHT":
                for socket in node.outputs:
                    seen = Output(node, socket, groups)
                    self._views += [(made, seen) for made in _fix(tree, socket, seen_at(seen, None))]
            case kind if kind in READS_GENERATED and "Vector" in node.inputs and not node.inputs["Vector"].is_linked:
                tree.links.new(_attribute(tree, GENERATED).outputs["Vector"], node.inputs["Vector"])

    def _expose(self, leaf: LeafSource) -> bpy.types.NodeSocket:
        """Return an output of the uppermost tree that has the value of a leaf."""
        if leaf.normal and leaf.socket == DISPLACEMENT:
            return self._tree.nodes.new("ShaderNodeNewGeometry").outputs["Normal"]
        around = []
        tree = self._tree
        for name in leaf.groups:
            around.append((tree, tree.nodes[name]))
            tree = tree.nodes[name].node_tree
        entry = next(socket for socket in tree.nodes[leaf.node].inputs if socket.identifier == leaf.socket)
        source = next(link for link in entry.links if link.is_valid and not link.is_muted).from_socket
        kind = "NodeSocketVector" if leaf.normal else "NodeSocketColor" if leaf.colour else "NodeSocketFloat"
        for outer, group in reversed(around):
            identifier = tree.interface.new_socket("leaf", in_out="OUTPUT", socket_type=kind).identifier
            end = next(node for node in tree.nodes if node.type == "GROUP_OUTPUT" and node.is_active_output)
            tree.links.new(source, _by_identifier(end.inputs, identifier))
            source = _by_identifier(group.outputs, identifier)
            tree = outer
        return source


def _passes(leaves: Sequence[LeafSource]) -> list[list[int]]:
    """Return which leaves, but for normals, are shown together: colours alone, numbers of one look three at a time."""
    passes = [[index] for index, leaf in enumerate(leaves) if leaf.colour and not leaf.normal]
    looks = dict.fromkeys((leaf.side, leaf.cosine) for leaf in leaves if not leaf.colour)
    for look in looks:
        numbers = [index for index, leaf in enumerate(leaves) if not leaf.colour and (leaf.side, leaf.cosine) == look]
        passes += [numbers[start : start + 3] for start in range(0, len(numbers), 3)]
    return passes


def _show(tree: bpy.types.NodeTree, node: bpy.types.Node, output: str, attribute: str, kind: str = "Vector") -> None:
    """Let all that reads a node's output read an attribute instead."""
    links = list(node.outputs[output].links)
    if links:
        source = _attribute(tree, attribute).outputs[kind]
        for link in links:
            tree.links.new(source, link.to_socket)


def _attribute(tree: bpy.types.NodeTree, name: str) -> bpy.types.Node:
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_name = name
    return node


def _fix(tree: bpy.types.NodeTree, output: bpy.types.NodeSocket, value: float) -> list[bpy.types.Node]:
    """Let all that reads an output read a constant instead; return its node, if there is any."""
    links = list(output.links)
    if not links:
        return []
    node = tree.nodes.new("ShaderNodeValue")
    node.outputs[0].default_value = value
    for link in links:
        tree.links.new(node.outputs[0], link.to_socket)
    return [node]


def _by_identifier(sockets: bpy.types.bpy_prop_collection, identifier: str) -> bpy.types.NodeSocket:
    return next(socket for socket in sockets if socket.identifier == identifier)
