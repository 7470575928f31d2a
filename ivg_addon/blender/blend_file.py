# SPDX-License-Identifier: GPL-3.0-or-later
"""Opening and saving .blend files for the command line, with errors that say what is wrong."""

from __future__ import annotations

from pathlib import Path

import bpy

from ..core.errors import IvgError

_MAGIC = (b"BLENDER", b"\x28\xb5\x2f\xfd", b"\x1f\x8b")
"""How a .blend begins: plain, compressed by Zstandard, compressed by gzip (before 3.0)."""


class BlendFileError(IvgError):
    """A .blend is missing, unreadable, foreign, from a newer Blender, or cannot be written."""


def open_blend(path: Path) -> None:
    """Open a .blend without running its scripts; raises `BlendFileError`.

    A file from a newer Blender is refused: what this one does not know of it is lost silently.
    """
    _check_readable(path)
    try:
        bpy.ops.wm.open_mainfile(filepath=str(path.resolve()), load_ui=False, use_scripts=False)
    except RuntimeError as error:
        raise BlendFileError(
            f"cannot open {path} ({_reason(error)}): the file is damaged, or only part of one"
        ) from error
    written = bpy.data.version[:2]
    if written > bpy.app.version[:2]:
        raise BlendFileError(
            f"{path} was saved by Blender {written[0]}.{written[1]}, "
            f"this is {bpy.app.version[0]}.{bpy.app.version[1]}: use the newer one"
        )


def check_can_save(path: Path) -> None:
    """Raise `BlendFileError` if a .blend cannot be made at `path`."""
    if path.suffix != ".blend":
        raise BlendFileError(f"{path} does not end in .blend: name a .blend file")
    if not path.parent.is_dir():
        raise BlendFileError(f"cannot write {path}: the folder {path.parent} does not exist")


def save_blend(path: Path) -> None:
    """Save the open scene as a copy; raises `BlendFileError`."""
    try:
        bpy.ops.wm.save_as_mainfile(filepath=str(path.resolve()), copy=True)
    except RuntimeError as error:
        raise BlendFileError(f"cannot write {path} ({_reason(error)}): choose a folder that is writable") from error


def _reason(error: RuntimeError) -> str:
    """Return the last part of Blender's report: the ones before it repeat what was tried."""
    return str(error).strip().rpartition(": ")[2]


def _check_readable(path: Path) -> None:
    """Raise `BlendFileError` unless the file is there, readable and begins like a .blend."""
    try:
        with path.open("rb") as stream:
            start = stream.read(8)
    except FileNotFoundError as error:
        raise BlendFileError(f"{path} does not exist: check the name of the .blend") from error
    except IsADirectoryError as error:
        raise BlendFileError(f"{path} is a folder: name a .blend file in it") from error
    except OSError as error:
        raise BlendFileError(
            f"cannot read {path} ({error.strerror}): check its permissions, and that no other program has locked it"
        ) from error
    if not start.startswith(_MAGIC):
        raise BlendFileError(f"{path} is not a .blend file: it begins with {start!r}")
