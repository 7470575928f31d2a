# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas as shader nodes: each operation adds one node, and takes and gives sockets; constants may stand for them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

import bpy

Socket = bpy.types.NodeSocket
Number = Socket | float
Vector = Socket | Sequence[float]
Colour = Socket | Sequence[float]
BLACK = (0.0, 0.0, 0.0, 1.0)

_COLUMN, _ROW = 190.0, 160.0
"""Of the node editor's canvas."""


class NodeMaths:
    """Fills a shader node group; each node stands in the column after those that it takes from.

    Parameters
    ----------
    tree
        The group; its nodes are removed, and in the end those of its sockets that nothing here has asked for.
    """

    def __init__(self, tree: bpy.types.ShaderNodeTree) -> None:
        tree.nodes.clear()
        self._tree = tree
        self._unused = {(socket.in_out, socket.name): socket for socket in tree.interface.items_tree}
        self._columns: dict[str, int] = {}
        self._filled: Counter[int] = Counter()

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
            self._tree.interface.remove(socket)
        self._unused = {}

    def _socket(self, way: str, name: str, kind: str) -> bpy.types.NodeTreeInterfaceSocket:
        """Return a socket of the group: the one there was, with the links that users have made to it, or a new one."""
        socket = self._unused.get((way, name))
        if socket is not None and socket.socket_type == f"NodeSocket{kind}":
            return self._unused.pop((way, name))
        return self._tree.interface.new_socket(name, in_out=way, socket_type=f"NodeSocket{kind}")

    def node(self, kind: str, inputs: Mapping[int | str, Number | Vector], **settings: object) -> bpy.types.Node:
        """Add a node of a type, with settings and with what goes into its inputs."""
        node = self._tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        column = 0
        by_identifier = {socket.identifier: socket for socket in node.inputs}
        for key, value in inputs.items():
            socket = node.inputs[key] if isinstance(key, int) else by_identifier.get(key) or node.inputs[key]
            if isinstance(value, Socket):
                self._tree.links.new(value, socket)
                column = max(column, self._columns[value.node.name] + 1)
            else:
                socket.default_value = value
        self._columns[node.name] = column
        node.location = (_COLUMN * column, -_ROW * self._filled[column])
        self._filled[column] += 1
        return node

    def math(self, operation: str, *values: Number) -> Socket:
        """Return what a Math node makes of numbers."""
        return self.node("ShaderNodeMath", dict(enumerate(values)), operation=operation).outputs[0]

    def vector(self, operation: str, *values: Vector) -> Socket:
        """Return the vector that a Vector Math node makes of vectors."""
        return self.node("ShaderNodeVectorMath", dict(enumerate(values)), operation=operation).outputs["Vector"]

    def dot(self, a: Vector, b: Vector) -> Socket:
        """Return ⟨a, b⟩."""
        return self.node("ShaderNodeVectorMath", {0: a, 1: b}, operation="DOT_PRODUCT").outputs["Value"]

    def length(self, a: Vector) -> Socket:
        """Return ‖a‖."""
        return self.node("ShaderNodeVectorMath", {0: a}, operation="LENGTH").outputs["Value"]

    def scaled(self, a: Vector, factor: Number) -> Socket:
        """Return factor · a."""
        return self.node("ShaderNodeVectorMath", {0: a, "Scale": factor}, operation="SCALE").outputs["Vector"]

    def combined(self, x: Number, y: Number, z: Number) -> Socket:
        """Return the vector (x, y, z)."""
        return self.node("ShaderNodeCombineXYZ", {0: x, 1: y, 2: z}).outputs[0]

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
        inputs: dict[int | str, Number | Vector] = {"Factor_Float": factor, "A_Vector": b, "B_Vector": a}
        node = self.node("ShaderNodeMix", inputs, data_type="VECTOR", factor_mode="UNIFORM")
        return next(socket for socket in node.outputs if socket.identifier == "Result_Vector")

    def channel(self, colour: Socket, index: int) -> Socket:
        """Return red, green or blue of a colour."""
        return self.node("ShaderNodeSeparateColor", {0: colour}).outputs[index]

    def separated(self, a: Socket) -> tuple[Socket, Socket, Socket]:
        """Return the three components of a vector."""
        x, y, z = self.node("ShaderNodeSeparateXYZ", {0: a}).outputs
        return x, y, z
