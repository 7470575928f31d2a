# SPDX-License-Identifier: GPL-3.0-or-later
"""Light Falloff nodes, which let a light fall off otherwise than with the square of the distance."""

from __future__ import annotations

import bpy

from .export_nodes import Output, follow
from .light_content import nodes_in

_POWERS = {"Quadratic": 0, "Linear": 1, "Constant": 2}
_READ = {("LIGHT_PATH", "Ray Length"), *(("LIGHT_FALLOFF", name) for name in _POWERS)}
"""Outputs that are read where they are a light's strength."""


def read_falloff(tree: bpy.types.ShaderNodeTree) -> tuple[int, float] | None:
    """Return k and s of `core.falloff` if a tree's only shader has a Light Falloff as its strength, else None.

    So does Light Path's Ray Length: a strength that grows with the distance is a linear falloff.
    Nothing else may know the distance: then all of its light is proportional to that strength.
    """
    node = tree.get_output_node("CYCLES")
    if node is None:
        return None
    _, shader = follow(Output(node, None).input("Surface"))
    if shader is None or shader.node.type != "EMISSION":
        return None
    _, strength = follow(shader.input("Strength"))
    if strength is None or (strength.node.type, strength.socket.name) not in _READ:
        return None
    knowing = [one for one in nodes_in(tree) if knows_distance(one, _linked(one))]
    far = strength.node.type == "LIGHT_PATH"
    links = strength.socket.links if far else [link for output in strength.node.outputs for link in output.links]
    if len(links) != 1 or [one for one in knowing if one != strength.node]:
        return None
    if far:
        return 1, 0.0
    smooth, network = follow(strength.input("Smooth"))
    if network is not None:
        return None
    return _POWERS[strength.socket.name], max(float(smooth.socket.default_value), 0.0)


def knows_distance(node: bpy.types.Node, linked: set[str]) -> bool:
    """Tell whether a node's linked outputs depend on the distance otherwise than light does by itself."""
    if node.type == "LIGHT_FALLOFF":
        smooth = node.inputs["Smooth"]
        return bool(linked & {"Linear", "Constant"} or (linked and (smooth.is_linked or smooth.default_value > 0.0)))
    return node.type == "LIGHT_PATH" and "Ray Length" in linked


def _linked(node: bpy.types.Node) -> set[str]:
    return {output.name for output in node.outputs if output.is_linked}
