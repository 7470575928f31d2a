# SPDX-License-Identifier: GPL-3.0-or-later
"""What the light of a lamp's nodes depends on, as a key: equal keys mean that nothing changed that Cycles would see."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator

import bpy
import numpy as np
from numpy.typing import NDArray

from .evaluation_cache import tree_content

Float64 = NDArray[np.float64]

_SHAPE = ("type", "shape", "size", "size_y", "spot_size", "spot_blend")


def nodes_in(tree: bpy.types.NodeTree) -> Iterator[bpy.types.Node]:
    """Yield the nodes of a tree and of the groups in it."""
    for inner in _trees_in(tree):
        yield from inner.nodes


def _trees_in(tree: bpy.types.NodeTree) -> Iterator[bpy.types.NodeTree]:
    yield tree
    for node in tree.nodes:
        if node.type == "GROUP" and node.node_tree is not None:
            yield from _trees_in(node.node_tree)


def light_key(light: bpy.types.Light, matrix: Float64, frame: int, shading_system: bool) -> str:
    """Return a digest of all that a measurement depends on."""
    shape = [getattr(light, name, None) for name in _SHAPE]
    parts = [repr(shape), matrix.round(6).tolist(), shading_system, *tree_content(light.node_tree)]
    if light.animation_data is not None or any(tree.animation_data is not None for tree in _trees_in(light.node_tree)):
        parts.append(f"frame {frame}")
    return hashlib.blake2b(repr(parts).encode(), digest_size=16).hexdigest()
