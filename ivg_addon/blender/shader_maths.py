# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas as the nodes of a shader's node group: its inputs and outputs, and what is mixed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import bpy

from .node_formulas import NodeFormulas, Number, Socket, Vector

Colour = Socket | Sequence[float]
Inputs = dict[int | str, Number | Vector]
"""What goes into a node, by the numbers or names of its sockets."""
BLACK = (0.0, 0.0, 0.0, 1.0)


class ShaderMaths(NodeFormulas):
    """Fills a shader node group.

    Parameters
    ----------
    tree
        The group; its nodes are removed, and in the end those of its sockets that nothing here has asked for.
    """

    def __init__(self, tree: bpy.types.ShaderNodeTree) -> None:
        super().__init__(tree)
        tree.nodes.clear()
        self._unused = {(socket.in_out, socket.name): socket for socket in tree.interface.items_tree}

    def inputs(self, kinds: Mapping[str, str]) -> dict[str, Socket]:
        """Return what comes into the group by inputs of these names and types, "Float", "Vector" or "Color"."""
        for name, kind in kinds.items():
            self._socket("INPUT", name, kind).hide_value = True
        node = self.node("NodeGroupInput", {})
        return {name: node.outputs[name] for name in kinds}

    def outputs(self, values: Mapping[str, tuple[str, Socket]]) -> None:
        """Let the group have outputs of these names, types and values."""
        for name, (kind, _) in values.items():
            self._socket("OUTPUT", name, kind)
        self.node("NodeGroupOutput", {name: value for name, (_, value) in values.items()})
        for socket in self._unused.values():
            self.tree.interface.remove(socket)
        self._unused = {}
        self.arrange()

    def _socket(self, way: str, name: str, kind: str) -> bpy.types.NodeTreeInterfaceSocket:
        """Return a socket of the group: the one there was, with the links that users have made to it, or a new one."""
        socket = self._unused.get((way, name))
        if socket is not None and socket.socket_type == f"NodeSocket{kind}":
            return self._unused.pop((way, name))
        return self.tree.interface.new_socket(name, in_out=way, socket_type=f"NodeSocket{kind}")

    def node(self, kind: str, inputs: Mapping[int | str, Number | Vector], **settings: object) -> bpy.types.Node:
        """Add a node of a type, with settings and with what goes into its inputs."""
        node = self.new(kind, **settings)
        by_identifier = {socket.identifier: socket for socket in node.inputs}
        for key, value in inputs.items():
            self.feed(node.inputs[key] if isinstance(key, int) else by_identifier.get(key) or node.inputs[key], value)
        return node

    def added(self, total: Colour, factor: Number, colour: Colour) -> Socket:
        """Return total + factor · colour.

        As colours: what Cycles converts it computes last, and 5.0 runs out of memory for all that waits for it.
        """
        node = self.node(
            "ShaderNodeMix",
            {"Factor_Float": factor, "A_Color": total, "B_Color": colour},
            data_type="RGBA",
            blend_type="ADD",
            clamp_factor=False,
        )
        return next(socket for socket in node.outputs if socket.identifier == "Result_Color")

    def chosen(self, factor: Socket, a: Vector, b: Vector) -> Socket:
        """Return the vector a where factor is 1, and b where it is 0."""
        inputs: Inputs = {"Factor_Float": factor, "A_Vector": b, "B_Vector": a}
        node = self.node("ShaderNodeMix", inputs, data_type="VECTOR", factor_mode="UNIFORM")
        return next(socket for socket in node.outputs if socket.identifier == "Result_Vector")

    def channel(self, colour: Socket, index: int) -> Socket:
        """Return red, green or blue of a colour."""
        return self.node("ShaderNodeSeparateColor", {0: colour}).outputs[index]
