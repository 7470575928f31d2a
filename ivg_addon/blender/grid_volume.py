# SPDX-License-Identifier: GPL-3.0-or-later
"""A grid as a volume datablock: an OpenVDB file beside the grid's file, for geometry nodes and other programs.

Blender reads volumes from files only (it packs them, but does not read what it packed), so the file lies beside the
.blend. It can always be written anew from the grid's image, which points to its volume.

A path that Blender has read once it does not read again in the same session, whatever the file holds by then. So every
bake writes to a path that this session has not used, and the file before goes when the .blend is saved: until then
undo, and the .blend on disk, still need it.
"""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path

import bpy

from ..core import vdb_grid
from ..core.errors import GridFileError
from .grid_image import RESTORE, VOLUME, named
from .grid_store import SUFFIX, absolute
from .marks import KEY, bears

FORMAT = "irradiance-vector-grid-volume"
VERSION = 1
VOLUME_SUFFIX = ".ivg.vdb"
_used: set[Path] = set()
"""Files that Blender may have read in this session."""
_superseded: list[tuple[Path, str]] = []
"""Files of grids that were baked again, and the .blend that was open then."""


def volume_of(image: bpy.types.Image) -> bpy.types.Volume | None:
    """Return the volume of a grid's image, if there is one."""
    found = image[KEY].get(VOLUME)
    return found if isinstance(found, bpy.types.Volume) else None


def is_grid(thing: bpy.types.ID) -> bool:
    """Tell whether a datablock is the volume of a grid."""
    return isinstance(thing, bpy.types.Volume) and bears(thing, FORMAT)


def volume_path(grid_file: Path) -> Path:
    """Return where to write the OpenVDB file of a grid: beside its file, where Blender will read it.

    Parameters
    ----------
    grid_file
        Where the bake writes the grid.
    """
    stem = grid_file.name.removesuffix(SUFFIX)
    used = _used | _in_use()
    number = 1
    while True:
        path = grid_file.with_name(f"{stem}.{number}{VOLUME_SUFFIX}" if number > 1 else stem + VOLUME_SUFFIX)
        if path not in used:
            return path
        number += 1


def _in_use() -> set[Path]:
    """Return the files that volumes read now."""
    volumes = (volume for volume in bpy.data.volumes if volume.filepath and not volume.library)
    return {path for volume in volumes if (path := absolute(volume.filepath)).exists()}


def put(image: bpy.types.Image, path: Path) -> bpy.types.Volume:
    """Give a grid's image a volume that reads the OpenVDB file at `path`, in place of the one that it has."""
    volume = volume_of(image)
    if volume is None or volume.library:
        volume = bpy.data.volumes.new(image.name)
    before = absolute(volume.filepath) if volume.filepath else path
    if before != path and _digest_of(before) == volume[KEY]["grid_digest"]:
        _superseded.append((before, bpy.data.filepath))
    _used.update({before, path})
    volume.filepath = kept_path(path)
    volume.use_fake_user = True
    volume[KEY] = {"format": FORMAT, "version": VERSION, "grid_digest": image[KEY]["grid_digest"]}
    image[KEY][VOLUME] = volume
    return volume


@bpy.app.handlers.persistent
def remove_superseded(saved: str, *_: object) -> None:
    """Remove the files that the .blend needed until it was saved; not when a copy was saved, or under another name."""
    if not bpy.data.filepath or Path(saved) != Path(bpy.data.filepath):
        return
    used = _in_use()
    for entry in tuple(_superseded):
        path, blend = entry
        if blend in {"", bpy.data.filepath}:
            _superseded.remove(entry)
            if path not in used:
                path.unlink(missing_ok=True)


def kept_path(path: Path) -> str:
    """Return a path as the datablock keeps it: relative to the .blend where there is one, so that both can move.

    Blender itself keeps it right when the .blend is saved elsewhere, or the volume is linked or appended.
    """
    if not bpy.data.filepath:
        return str(path)
    try:
        return bpy.path.relpath(str(path))
    except ValueError:  # another drive
        return str(path)


def problem(image: bpy.types.Image) -> str:
    """Return what became of a grid's volume, and the cure; empty if nothing."""
    if image.library:
        return ""
    volume = volume_of(image)
    if volume is None:
        return f"the volume of {named(image)} was removed: {RESTORE}"
    path = absolute(volume.filepath)
    if not path.is_file():
        return f"volume '{volume.name}': its file {path} is missing: {RESTORE}"
    if _digest_of(path) != image[KEY]["grid_digest"]:
        return f"volume '{volume.name}': its file {path} holds something else than {named(image)}: {RESTORE}"
    return ""


def _digest_of(path: Path) -> str:
    """Return the digest of the grid in a file; empty if it holds none."""
    try:
        state = os.stat(path)
    except OSError:
        return ""
    return _digest(path, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=32)
def _digest(path: Path, modified: int, size: int) -> str:
    """Return the digest of the grid in a file as it was at a time; so a file is read once, not at every redraw."""
    try:
        return vdb_grid.stored_digest(path)
    except GridFileError:
        return ""
