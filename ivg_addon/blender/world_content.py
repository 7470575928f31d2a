# SPDX-License-Identifier: GPL-3.0-or-later
"""What a world's light depends on, as a key: equal keys mean that nothing changed that Cycles would see."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np

_OF_THE_EDITOR = {
    *("color", "dimensions", "height", "hide", "is_active_output", "label", "location", "location_absolute", "name"),
    *("parent", "rna_type", "select", "show_options", "show_preview", "show_texture", "use_custom_color"),
    *("warning_propagation", "width", "width_hidden", "internal_links", "bl_width_default", "color_tag"),
}
"""Properties of nodes and sockets that say how they are drawn."""
_PLAIN = {"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"}
_SCENE_SETTINGS = ("device", "shading_system")


def world_key(world: bpy.types.World, scene: bpy.types.Scene) -> str:
    """Return a digest of a world's nodes, with their groups, images and objects, and of what else its light depends on.

    Where something is animated, or an image moves, the frame is part of it.
    """
    content: list[str] = [repr([getattr(scene.cycles, name) for name in _SCENE_SETTINGS])]
    content.append(bpy.data.colorspace.working_space if hasattr(bpy.data, "colorspace") else "")
    moves = world.animation_data is not None
    for tree in trees_in(world):
        content.append(_tree(tree))
        moves |= tree.animation_data is not None
    for image in images_in(world):
        moves |= image.source in {"SEQUENCE", "MOVIE"}
    if moves:
        content.append(f"frame {scene.frame_current_final}")
    return hashlib.blake2b("\n".join(content).encode(), digest_size=16).hexdigest()


def trees_in(world: bpy.types.World) -> list[bpy.types.NodeTree]:
    """Return a world's node tree and all groups in it, each once, outer ones first."""
    found: list[bpy.types.NodeTree] = []
    waiting = [world.node_tree]
    while waiting:
        tree = waiting.pop()
        if tree is not None and tree not in found:
            found.append(tree)
            waiting.extend(node.node_tree for node in tree.nodes if node.type == "GROUP")
    return found


def images_in(world: bpy.types.World) -> list[bpy.types.Image]:
    """Return all images that a world's nodes name, each once."""
    nodes = (node for tree in trees_in(world) for node in tree.nodes)
    images = (getattr(node, "image", None) for node in nodes)
    return list(dict.fromkeys(image for image in images if image is not None))


def _tree(tree: bpy.types.NodeTree) -> str:
    """Return what a tree computes, as text."""
    lines = [f"tree {tree.name_full}"]
    for node in tree.nodes:
        lines.append(f"node {node.name} {node.bl_idname} {getattr(node, 'is_active_output', '')}")
        lines.extend(_values(node))
        for socket in (*node.inputs, *node.outputs):
            lines.append(f"socket {socket.identifier}")
            lines.extend(_values(socket))
    for link in tree.links:
        ends = (link.from_node.name, link.from_socket.identifier, link.to_node.name, link.to_socket.identifier)
        lines.append(f"link {ends} {link.is_valid} {link.is_muted}")
    return "\n".join(lines)


def _values(owner: bpy.types.bpy_struct) -> Iterator[str]:
    """Return a structure's settings, with those of the structures that are part of it."""
    for item in owner.bl_rna.properties:
        if item.identifier in _OF_THE_EDITOR or item.identifier in {"inputs", "outputs", "node", "links"}:
            continue
        value = getattr(owner, item.identifier, None)
        if item.type in _PLAIN:
            yield f"{item.identifier} = {_plain(value)}"
        elif item.type == "POINTER" and value is not None:
            if isinstance(value, bpy.types.ID):
                yield f"{item.identifier} is {_datablock(value)}"
            elif not isinstance(value, bpy.types.Node | bpy.types.NodeSocket):
                yield f"{item.identifier}:"
                yield from _values(value)
        elif item.type == "COLLECTION" and value is not None:
            for part in value:
                if not isinstance(part, bpy.types.Node | bpy.types.NodeSocket | bpy.types.NodeLink | bpy.types.ID):
                    yield f"{item.identifier}[]:"
                    yield from _values(part)


def _plain(value: Any) -> str:
    """Return a number, text, set or array as text; single precision in full."""
    if isinstance(value, set):
        return repr(sorted(value))
    return repr(value if isinstance(value, str | int | float) else np.ravel(value).tolist())


def _datablock(value: bpy.types.ID) -> str:
    """Return what a datablock contributes: an image's pixels, an object's place, a text's lines, else its name."""
    name = f"{type(value).__name__} {value.name_full}"
    if isinstance(value, bpy.types.Image):
        return f"{name} {_image(value)}"
    if isinstance(value, bpy.types.Object):
        return f"{name} {[list(row) for row in value.matrix_world]}"
    if isinstance(value, bpy.types.Text):
        return f"{name} {value.as_string()}"
    return name


def _image(image: bpy.types.Image) -> str:
    """Return what tells an image's pixels: those in memory if they are the only ones, else its file."""
    settings = (image.source, image.colorspace_settings.name, image.alpha_mode, tuple(image.size))
    if image.packed_file is not None:
        content = hashlib.blake2b(image.packed_file.data, digest_size=16).hexdigest()
    elif image.is_dirty or image.source == "GENERATED":
        pixels = np.empty(len(image.pixels), dtype=np.float32)
        image.pixels.foreach_get(pixels)
        content = hashlib.blake2b(pixels.data, digest_size=16).hexdigest()
    else:
        path = Path(bpy.path.abspath(image.filepath, library=image.library))
        state = path.stat() if path.is_file() else None
        content = repr((str(path), state and (state.st_mtime_ns, state.st_size)))
    return f"{settings} {content}"
