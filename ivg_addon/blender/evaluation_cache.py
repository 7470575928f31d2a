# SPDX-License-Identifier: GPL-3.0-or-later
"""Evaluated materials, kept by content: for the session in memory, and from session to session in the user's folder."""

from __future__ import annotations

import hashlib
import zipfile
from collections import OrderedDict
from collections.abc import Iterable
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from .grid_store import user_folder

Float32 = NDArray[np.float32]

_MEMORY_BYTES = 256 << 20
_DISK_BYTES = 512 << 20
_SUFFIX = ".npz"
_SKIPPED = {
    "rna_type", "name", "label", "location", "location_absolute", "width", "width_hidden", "height", "dimensions",
    "select", "color", "use_custom_color", "show_options", "show_preview", "hide", "show_texture", "parent", "inputs",
    "outputs", "internal_links", "warning_propagation", "bl_icon", "bl_label", "bl_description",
}  # fmt: skip
"""Properties of nodes that have no part in what they compute."""

_memory: OrderedDict[str, list[Float32]] = OrderedDict()


def recall(key: str, folder: Path) -> list[Float32] | None:
    """Return what was kept under a key, if anything. Touches nothing of Blender."""
    if key in _memory:
        _memory.move_to_end(key)
        return _memory[key]
    path = folder / (key + _SUFFIX)
    try:
        with path.open("rb") as opened, np.load(opened, allow_pickle=False) as file:
            arrays = [file[f"arr_{index}"] for index in range(len(file.files))]
        path.touch()
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None  # not there, or damaged: then it is evaluated anew
    _hold(key, arrays)
    return arrays


def keep(key: str, arrays: list[Float32], folder: Path) -> None:
    """Keep arrays under a key; the oldest ones make room. Touches nothing of Blender."""
    _hold(key, arrays)
    fresh = folder / f".{key}.new"
    try:
        with fresh.open("wb") as file:
            np.savez(file, *arrays)
        fresh.replace(folder / (key + _SUFFIX))
        _prune(folder)
    except OSError:
        fresh.unlink(missing_ok=True)  # a full disk is no reason to fail: it is kept in memory


def forget() -> None:
    """Keep nothing in memory any more."""
    _memory.clear()


def _hold(key: str, arrays: list[Float32]) -> None:
    _memory[key] = arrays
    _memory.move_to_end(key)
    while len(_memory) > 1 and sum(array.nbytes for kept in _memory.values() for array in kept) > _MEMORY_BYTES:
        _memory.popitem(last=False)


def cache_folder() -> Path:
    """Return where arrays are kept from session to session."""
    return user_folder("materials")


def _prune(folder: Path) -> None:
    """Remove the files that were not used for longest, until the rest fits."""
    files = sorted(((path.stat(), path) for path in folder.glob("*" + _SUFFIX)), key=lambda item: -item[0].st_mtime)
    total = 0
    for status, path in files:
        total += status.st_size
        if total > _DISK_BYTES:
            path.unlink(missing_ok=True)


def content_key(parts: Iterable[bytes]) -> str:
    """Return the hash of content."""
    digest = hashlib.blake2b(digest_size=20)
    for part in parts:
        digest.update(len(part).to_bytes(8, "little"))
        digest.update(part)
    return digest.hexdigest()


def tree_content(tree: bpy.types.NodeTree) -> Iterable[bytes]:
    """Return all that a node tree computes with, for a hash: nodes, their settings, values, links, groups, images."""
    for node in tree.nodes:
        yield f"node {node.bl_idname} {node.name} {node.mute}".encode()
        yield from _settings(node)
        for socket in (*node.inputs, *node.outputs):
            value = getattr(socket, "default_value", None)
            yield f"{socket.identifier} {_plain(value)}".encode()
    for link in tree.links:
        ends = (link.from_node.name, link.from_socket.identifier, link.to_node.name, link.to_socket.identifier)
        yield f"link {ends} {link.is_muted} {link.is_valid}".encode()


def _settings(struct: bpy.types.bpy_struct) -> Iterable[bytes]:
    """Return a node's own properties."""
    for prop in struct.bl_rna.properties:
        name = prop.identifier
        if name in _SKIPPED:
            continue
        value = getattr(struct, name, None)
        match value:
            case bpy.types.Image():
                yield from _image(value)
            case bpy.types.NodeTree():
                yield from tree_content(value)
            case bpy.types.Object():
                yield f"{name} {value.name_full} {_plain(value.matrix_world)}".encode()
            case bpy.types.Text():
                yield f"{name} {value.as_string()}".encode()
            case bpy.types.ID():
                yield f"{name} {value.name_full}".encode()
            case bpy.types.ColorRamp():
                stops = [(stop.position, tuple(stop.color)) for stop in value.elements]
                yield f"{name} {value.color_mode} {value.interpolation} {value.hue_interpolation} {stops}".encode()
            case bpy.types.CurveMapping():
                points = [[(*point.location, point.handle_type) for point in c.points] for c in value.curves]
                ends = (tuple(value.black_level), tuple(value.white_level), value.extend, value.tone)
                yield f"{name} {points} {ends}".encode()
            case bpy.types.bpy_struct():
                yield name.encode()
                yield from _settings(value)
            case _:
                yield f"{name} {_plain(value)}".encode()


def _plain(value: object) -> str:
    """Return a value as text that tells different ones apart."""
    if value is None or isinstance(value, bool | int | float | str):
        return repr(value)
    try:
        return repr([_plain(part) for part in value])  # type: ignore[attr-defined]
    except TypeError:
        return ""


def _image(image: bpy.types.Image) -> Iterable[bytes]:
    """Return what an image shows: its file as it lies on the disk, or its pixels."""
    space = image.colorspace_settings.name
    yield f"image {image.name_full} {image.source} {image.alpha_mode} {space} {tuple(image.size)}".encode()
    path = Path(bpy.path.abspath(image.filepath, library=image.library)) if image.filepath else None
    if image.packed_file is None and not image.is_dirty and path is not None and path.is_file():
        status = path.stat()
        yield f"{path} {status.st_mtime_ns} {status.st_size}".encode()
    elif image.packed_file is not None and not image.is_dirty:
        yield bytes(image.packed_file.data)
    elif image.has_data or image.source == "GENERATED":
        pixels = np.empty(len(image.pixels), dtype=np.float32)
        image.pixels.foreach_get(pixels)
        yield pixels.tobytes()
