# SPDX-License-Identifier: GPL-3.0-or-later
"""A copy of a world that shows a camera what diffuse surfaces receive."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from .export_colours import RAY_THAT_SHADES

_AFTER_ONE_BOUNCE = {"Ray Depth": 1.0, "Diffuse Depth": 1.0, "Ray Length": 3.4028234663852886e38}
"""Light Path outputs on the way from a surface to the world: that far away is what Cycles calls infinite."""


@contextmanager
def as_diffuse_rays_see(world: bpy.types.World, smallest_sun: float = 0.0) -> Iterator[bpy.types.World]:
    """Copy a world, and in it and all its groups put constants in the place of what depends on the path of light.

    Discs of Sky Textures span at least `smallest_sun`, radians.
    """
    copy = world.copy()
    groups: dict[bpy.types.NodeTree, bpy.types.NodeTree] = {}
    try:
        _adapt(copy.node_tree, groups, smallest_sun)
        yield copy
    finally:
        bpy.data.worlds.remove(copy)
        for group in groups.values():
            bpy.data.node_groups.remove(group)


def _adapt(tree: bpy.types.NodeTree, groups: dict[bpy.types.NodeTree, bpy.types.NodeTree], smallest_sun: float) -> None:
    """Change a tree that is a copy; groups in it become copies too."""
    for node in list(tree.nodes):
        if node.type == "GROUP" and node.node_tree is not None:
            original = node.node_tree
            if original not in groups:
                groups[original] = original.copy()
                _adapt(groups[original], groups, smallest_sun)
            node.node_tree = groups[original]
        elif node.type == "LIGHT_PATH":
            _freeze(tree, node)
        elif node.type == "TEX_SKY":
            node.sun_size = max(node.sun_size, smallest_sun)


def _freeze(tree: bpy.types.NodeTree, node: bpy.types.Node) -> None:
    """Put constants in the place of a Light Path node."""
    told = {**_AFTER_ONE_BOUNCE, **RAY_THAT_SHADES}
    for output in node.outputs:
        targets = [link.to_socket for link in output.links]
        if not targets:
            continue
        value = tree.nodes.new("ShaderNodeValue")
        value.outputs[0].default_value = told.get(output.name, 0.0)
        for target in targets:
            tree.links.new(value.outputs[0], target)
