# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that appear whole or not at all: written beside their place, then renamed."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

from .errors import GridFileError


def check_writable(path: Path) -> None:
    """Raise `GridFileError` if a file cannot be made at `path`; leaves nothing behind."""
    if path.is_dir():
        raise GridFileError(f"{path} is a folder: name a file in it, for instance grid.ivg.npz")
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    except OSError as error:
        raise GridFileError(
            f"cannot write {path} ({error.strerror}): choose a folder that exists and is writable"
        ) from error
    os.close(handle)
    os.unlink(name)
    if path.exists() and not os.access(path, os.W_OK):
        raise GridFileError(f"cannot replace {path}: it is read-only; choose another file")


@contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """Give a stream whose content takes the place of a file when all went well.

    Raises
    ------
    GridFileError
        The file cannot be written; it is as it was.
    """
    check_writable(path)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        # mkstemp makes files that only their owner may read; these are ordinary ones.
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(name, 0o666 & ~umask)
        os.replace(name, path)
    except OSError as error:
        raise GridFileError(
            f"cannot write {path} ({error.strerror or error}): free some space or choose another folder; "
            "the previous file is unchanged"
        ) from error
    finally:
        if os.path.exists(name):
            os.unlink(name)
