# SPDX-License-Identifier: GPL-3.0-or-later
"""Formulas as geometry nodes: what they have beyond those of shaders."""

from __future__ import annotations

import bpy

from .node_formulas import NodeFormulas, Value


class GeometryMaths(NodeFormulas):
    """Adds nodes to an empty tree of geometry nodes."""

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


class Repeat:
    """A zone of nodes that is run several times."""

    def __init__(self, maths: GeometryMaths, first: bpy.types.Node, last: bpy.types.Node) -> None:
        self._maths, self._first, self._last = maths, first, last

    def __getitem__(self, name: str) -> bpy.types.NodeSocket:
        """Return, within the zone, what it keeps under a name."""
        return self._first.outputs[name]

    def close(self, **values: Value) -> tuple[bpy.types.NodeSocket, ...]:
        """Keep values for the next time; return what is kept after the last, in the order of `values`."""
        for name, value in values.items():
            self._maths.feed(self._last.inputs[name], value)
        return tuple(self._last.outputs[name] for name in values)
