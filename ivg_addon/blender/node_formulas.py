# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas as nodes, of shaders and of geometry: an operation adds a node, and gives the socket that has its value."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

import bpy

Socket = bpy.types.NodeSocket
Number = Socket | float
Vector = Socket | Sequence[float]
Value = Number | Vector | str | bool
"""What goes into a socket: another's value, or a constant."""

_COLUMN, _ROW = 190.0, 190.0
"""Between nodes, in the editor's units."""


class NodeFormulas:
    """Adds nodes to a tree.

    Parameters
    ----------
    tree
        Of shader or of geometry nodes.
    """

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self.tree = tree

    def made(self, kind: str, *inputs: Value, **settings: Any) -> bpy.types.Node:
        """Return a new node; `inputs` are those of its sockets that are enabled, in order."""
        node = self.new(kind, **settings)
        sockets = [socket for socket in node.inputs if socket.enabled]
        for socket, value in zip(sockets, inputs, strict=False):
            self.feed(socket, value)
        return node

    def new(self, kind: str, **settings: Any) -> bpy.types.Node:
        """Return a new node with some settings."""
        node = self.tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        return node

    def value(self, kind: str, *inputs: Value, **settings: Any) -> Socket:
        """Return the first enabled output of a new node."""
        return next(socket for socket in self.made(kind, *inputs, **settings).outputs if socket.enabled)

    def feed(self, socket: bpy.types.NodeSocket, value: Value) -> None:
        """Give an input a value: a link, or a constant."""
        if isinstance(value, Socket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def math(self, operation: str, *inputs: Number) -> Socket:
        """Return what a Math node makes of numbers."""
        return self.value("ShaderNodeMath", *inputs, operation=operation)

    def vector(self, operation: str, *inputs: Vector | Number) -> Socket:
        """Return the vector, or the number, that a Vector Math node makes of vectors."""
        return self.value("ShaderNodeVectorMath", *inputs, operation=operation)

    def dot(self, a: Vector, b: Vector) -> Socket:
        """Return ⟨a, b⟩."""
        return self.vector("DOT_PRODUCT", a, b)

    def length(self, a: Vector) -> Socket:
        """Return ‖a‖."""
        return self.vector("LENGTH", a)

    def scaled(self, a: Vector, factor: Number) -> Socket:
        """Return factor · a."""
        return self.vector("SCALE", a, factor)

    def combined(self, x: Number, y: Number, z: Number) -> Socket:
        """Return the vector (x, y, z)."""
        return self.value("ShaderNodeCombineXYZ", x, y, z)

    def separated(self, a: Vector) -> tuple[Socket, Socket, Socket]:
        """Return the three components of a vector."""
        x, y, z = self.made("ShaderNodeSeparateXYZ", a).outputs
        return x, y, z

    def arrange(self) -> None:
        """Put every node to the right of those that it reads from."""
        depth: dict[bpy.types.Node, int] = {}
        before: dict[bpy.types.Node, list[bpy.types.Node]] = {node: [] for node in self.tree.nodes}
        for link in self.tree.links:
            before[link.to_node].append(link.from_node)
        for node in self.tree.nodes:
            if node.bl_idname == "GeometryNodeRepeatInput":
                before[node.paired_output].append(node)
        pending = [*self.tree.nodes]
        while pending:
            node = pending.pop()
            missing = [other for other in before[node] if other not in depth]
            if missing:
                pending += [node, *missing]
            else:
                depth[node] = 1 + max((depth[other] for other in before[node]), default=-1)
        rows = Counter[int]()
        for node in self.tree.nodes:
            node.location = (depth[node] * _COLUMN, -rows[depth[node]] * _ROW)
            rows[depth[node]] += 1
