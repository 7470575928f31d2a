# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a shader socket's value comes from: through reroutes, node groups and muted nodes."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

ADDED = "ivg_added"
"""Marks a node that `material_light` has put in: the light of a grid is no part of what is baked."""
STAND_IN = "ivg_stand_in"
"""Marks the material that `scene_light` gives to objects without one: it is baked as none is."""


@dataclass(frozen=True)
class Input:
    """An input socket, and the group nodes that it lies inside of, outermost first."""

    socket: bpy.types.NodeSocket
    groups: tuple[bpy.types.Node, ...] = ()


@dataclass(frozen=True)
class Output:
    """An output socket of a node that computes something, and the groups around it."""

    node: bpy.types.Node
    socket: bpy.types.NodeSocket
    groups: tuple[bpy.types.Node, ...] = ()

    def input(self, identifier: str) -> Input:
        """Return one of the node's inputs.

        Raises
        ------
        KeyError
            When the node has no such input.
        """
        return Input(_by_identifier(self.node.inputs, identifier), self.groups)

    @property
    def label(self) -> str:
        """Return what Blender calls this kind of node: "Noise Texture"."""
        return str(self.node.bl_label or self.node.name)


def follow(entry: Input) -> tuple[Input, Output | None]:
    """Go upstream from an input to what it reads.

    Returns
    -------
    Input, Output or None
        The output that is read; or, where nothing is linked, None: then the input that is
        returned holds the value.
    """
    while True:
        link = next((link for link in entry.socket.links if link.is_valid and not link.is_muted), None)
        if link is None:
            return entry, None
        node, groups = link.from_node, entry.groups
        upstream: Input | None
        if node.mute:
            upstream = _bypass(node, link.from_socket, groups)
        elif node.type == "REROUTE":
            upstream = Input(node.inputs[0], groups)
        elif node.type == "GROUP" and node.get(ADDED):
            upstream = Input(node.inputs["BSDF"], groups)
        elif node.type == "GROUP":
            upstream = _into_group(node, link.from_socket, groups)
        elif node.type == "GROUP_INPUT" and groups:
            upstream = Input(_by_identifier(groups[-1].inputs, link.from_socket.identifier), groups[:-1])
        elif node.type == "GROUP_INPUT":
            upstream = None
        else:
            return entry, Output(node, link.from_socket, groups)
        if upstream is None:
            return entry, None
        entry = upstream


def _bypass(node: bpy.types.Node, output: bpy.types.NodeSocket, groups: tuple[bpy.types.Node, ...]) -> Input | None:
    """Return the input that a muted node hands on to one of its outputs."""
    for link in node.internal_links:
        if link.to_socket == output:
            return Input(link.from_socket, groups)
    return None


def _into_group(node: bpy.types.Node, output: bpy.types.NodeSocket, groups: tuple[bpy.types.Node, ...]) -> Input | None:
    """Return the input inside a group that its output shows."""
    if node.node_tree is None:
        return None
    for inner in node.node_tree.nodes:
        if inner.type == "GROUP_OUTPUT" and inner.is_active_output:
            return Input(_by_identifier(inner.inputs, output.identifier), (*groups, node))
    return None


def _by_identifier(sockets: bpy.types.bpy_prop_collection, identifier: str) -> bpy.types.NodeSocket:
    for socket in sockets:
        if socket.identifier == identifier:
            return socket
    raise KeyError(identifier)
