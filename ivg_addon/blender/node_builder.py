# SPDX-License-Identifier: GPL-3.0-or-later
"""Writing trees of geometry nodes as formulas: each call adds a node, and gives the socket that has its value."""

from __future__ import annotations

from collections import Counter
from typing import Any

import bpy

Value = bpy.types.NodeSocket | float | tuple[float, ...] | str | bool
"""What goes into a socket: another's value, or a constant."""

_COLUMN, _ROW = 190.0, 190.0
"""Between nodes, in the editor's units."""


class NodeBuilder:
    """Adds nodes to a tree.

    Parameters
    ----------
    tree
        An empty tree of geometry nodes.
    """

    def __init__(self, tree: bpy.types.GeometryNodeTree) -> None:
        self.tree = tree

    def node(self, kind: str, *inputs: Value, **settings: Any) -> bpy.types.Node:
        """Return a new node; `inputs` are those of its sockets that are enabled, in order."""
        node = self.tree.nodes.new(kind)
        for name, value in settings.items():
            setattr(node, name, value)
        sockets = [socket for socket in node.inputs if socket.enabled]
        for socket, value in zip(sockets, inputs, strict=False):
            self.feed(socket, value)
        return node

    def value(self, kind: str, *inputs: Value, **settings: Any) -> bpy.types.NodeSocket:
        """Return the first enabled output of a new node."""
        return next(socket for socket in self.node(kind, *inputs, **settings).outputs if socket.enabled)

    def feed(self, socket: bpy.types.NodeSocket, value: Value) -> None:
        """Give an input a value: a link, or a constant."""
        if isinstance(value, bpy.types.NodeSocket):
            self.tree.links.new(value, socket)
        else:
            socket.default_value = value

    def math(self, operation: str, *inputs: Value) -> bpy.types.NodeSocket:
        """Return a number of numbers."""
        return self.value("ShaderNodeMath", *inputs, operation=operation)

    def vector(self, operation: str, *inputs: Value) -> bpy.types.NodeSocket:
        """Return a vector, or the number, that Vector Math makes of vectors."""
        return self.value("ShaderNodeVectorMath", *inputs, operation=operation)

    def scaled(self, vector: Value, by: Value) -> bpy.types.NodeSocket:
        """Return a vector times a number."""
        return self.vector("SCALE", vector, by)

    def join(self, *numbers: Value) -> bpy.types.NodeSocket:
        """Return the vector of three numbers."""
        return self.value("ShaderNodeCombineXYZ", *numbers)

    def split(self, vector: Value) -> tuple[bpy.types.NodeSocket, ...]:
        """Return the three numbers of a vector."""
        return tuple(self.node("ShaderNodeSeparateXYZ", vector).outputs)

    def choose(self, kind: str, condition: Value, yes: Value, no: Value) -> bpy.types.NodeSocket:
        """Return one of two values; where the condition is the same for all points, the other is not computed."""
        return self.value("GeometryNodeSwitch", condition, no, yes, input_type=kind)

    def repeat(self, times: int, **start: tuple[str, Value]) -> tuple[bpy.types.NodeSocket, Repeat]:
        """Open a zone that is run `times` times.

        Parameters
        ----------
        start
            What it keeps from one time to the next, by name: a socket's type, and the value before the first time.

        Returns
        -------
        socket, Repeat
            How many times the zone has been run, and the zone.
        """
        first = self.tree.nodes.new("GeometryNodeRepeatInput")
        last = self.tree.nodes.new("GeometryNodeRepeatOutput")
        first.pair_with_output(last)
        last.repeat_items.clear()
        for name, (kind, _) in start.items():
            last.repeat_items.new(kind, name)
        first.inputs["Iterations"].default_value = times
        for name, (_, value) in start.items():
            self.feed(first.inputs[name], value)
        return first.outputs["Iteration"], Repeat(self, first, last)

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


class Repeat:
    """A zone of nodes that is run several times."""

    def __init__(self, builder: NodeBuilder, first: bpy.types.Node, last: bpy.types.Node) -> None:
        self._builder, self._first, self._last = builder, first, last

    def __getitem__(self, name: str) -> bpy.types.NodeSocket:
        """Return, within the zone, what it keeps under a name."""
        return self._first.outputs[name]

    def close(self, **values: Value) -> tuple[bpy.types.NodeSocket, ...]:
        """Keep values for the next time; return what is kept after the last, in the order of `values`."""
        for name, value in values.items():
            self._builder.feed(self._last.inputs[name], value)
        return tuple(self._last.outputs[name] for name in values)
