# SPDX-License-Identifier: GPL-3.0-or-later
"""What the light of a lamp's nodes depends on, as a key: equal keys mean that nothing changed that Cycles would see."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

Float64 = NDArray[np.float64]

_SHAPE = ("type", "shape", "size", "size_y", "spot_size", "spot_blend")
_OF_THE_EDITOR = ("location", "select", "width", "height", "hide", "show", "color", "use_custom_color", "label")


def nodes_in(tree: bpy.types.NodeTree) -> Iterator[bpy.types.Node]:
    """Yield the nodes of a tree and of the groups in it."""
    for inner in _trees_in(tree):
        yield from inner.nodes


def _trees_in(tree: bpy.types.NodeTree) -> Iterator[bpy.types.NodeTree]:
    yield tree
    for node in tree.nodes:
        if node.type == "GROUP" and node.node_tree is not None:
            yield from _trees_in(node.node_tree)


def light_key(light: bpy.types.Light, matrix: Float64, scene: bpy.types.Scene) -> str:
    """Return a digest of all that a measurement depends on."""
    shape = [getattr(light, name, None) for name in _SHAPE]
    parts = [repr(shape), matrix.round(6).tolist(), scene.cycles.shading_system, *_content(light.node_tree)]
    if light.animation_data is not None or any(tree.animation_data is not None for tree in _trees_in(light.node_tree)):
        parts.append(f"frame {scene.frame_current}")
    return hashlib.blake2b(repr(parts).encode(), digest_size=16).hexdigest()


def _content(tree: bpy.types.NodeTree) -> Iterator[str]:
    """Yield what a tree and its groups compute."""
    for inner in _trees_in(tree):
        for node in inner.nodes:
            yield f"{node.bl_idname} {node.name} {node.mute}"
            yield from _values(node)
            for socket in (*node.inputs, *node.outputs):
                yield f"{socket.identifier} {_plain(getattr(socket, 'default_value', None))}"
        for link in inner.links:
            ends = (link.from_node.name, link.from_socket.identifier, link.to_node.name, link.to_socket.identifier)
            yield f"{ends} {link.is_valid} {link.is_muted}"


def _values(owner: bpy.types.bpy_struct) -> Iterator[str]:
    """Yield a node's settings, with the contents of what it names."""
    for item in owner.bl_rna.properties:
        value = getattr(owner, item.identifier, None)
        if item.identifier.startswith(_OF_THE_EDITOR):
            continue
        if item.type in {"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"}:
            yield f"{item.identifier} {_plain(value)}"
        elif isinstance(value, bpy.types.Text):
            yield value.as_string()
        elif isinstance(value, bpy.types.Image):
            yield f"{value.name_full} {value.colorspace_settings.name} {value.alpha_mode} {_pixels(value)}"
        elif isinstance(value, bpy.types.ColorRamp):
            yield from (f"{stop.position} {_plain(stop.color)}" for stop in value.elements)
        elif isinstance(value, bpy.types.CurveMapping):
            yield from (_plain(point.location) for curve in value.curves for point in curve.points)
        elif isinstance(value, bpy.types.Object):
            yield repr([list(row) for row in value.matrix_world])


def _pixels(image: bpy.types.Image) -> str:
    """Return what tells an image's pixels: its file as it lies on the disk, or those in memory."""
    path = Path(bpy.path.abspath(image.filepath, library=image.library)) if image.filepath else None
    if path is not None and path.is_file() and not image.is_dirty and image.packed_file is None:
        status = path.stat()
        return f"{path} {status.st_mtime_ns} {status.st_size}"
    pixels = np.empty(len(image.pixels), dtype=np.float32)
    image.pixels.foreach_get(pixels)
    return hashlib.blake2b(pixels.data, digest_size=16).hexdigest()


def _plain(value: Any) -> str:
    if value is None or isinstance(value, str | int | float):
        return repr(value)
    return repr(sorted(value) if isinstance(value, set) else [float(x) for x in np.ravel(value)])
