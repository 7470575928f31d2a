# SPDX-License-Identifier: GPL-3.0-or-later
"""The grid's file: `.ivg.npz`, described in docs/file-format.md.

A zip archive of numpy arrays without pickles: those of the grid, and `header`, a JSON text with the format's name and
version, the lattice and the record of the bake. It is written to a temporary file beside the target and renamed, so a
reader sees a whole file or the previous one.
"""

from __future__ import annotations

import json
import struct
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from . import grid_parts
from .dual_cells import Lattice
from .errors import GridFileError
from .grid import IrradianceVectorGrid
from .memory import require
from .partitions import MOST_PLANES
from .whole_file import replacing

FORMAT = "irradiance-vector-grid"
VERSION = 4
_KNOWN = (3, VERSION)
"""Version 3 has no corrections; a grid without any is written as such, so that older programs read it."""
SUFFIX = ".ivg.npz"

MOST_HEADER_BYTES = 1 << 20

DAMAGE = (
    *(zipfile.BadZipFile, zlib.error, struct.error, EOFError, NotImplementedError, RuntimeError),
    *(ValueError, OverflowError, MemoryError),
)
"""What the readers of zip archives, arrays and JSON raise on files that are not what they claim to be."""


def save(grid: IrradianceVectorGrid, path: Path) -> None:
    """Write a grid, whole or not at all; raises `GridFileError` that names the file."""
    header = {"format": FORMAT, "version": _KNOWN[0], **grid_parts.header(grid.lattice, grid.record)}
    if len(grid.corrected):
        header |= {"version": VERSION, "corrected": len(grid.corrected)}
    arrays: dict[str, Any] = {"header": np.array(json.dumps(header)), **grid_parts.arrays(grid)}
    with replacing(path) as stream:
        np.savez(stream, **arrays)


def load(path: Path) -> IrradianceVectorGrid:
    """Read a grid; raises `GridFileError` that says what is wrong with the file."""
    try:
        with zipfile.ZipFile(path) as archive:
            header = _read_header(archive, path)
            lattice, record = grid_parts.parse_header(header, str(path))
            shape = lattice.shape
            expected: dict[str, tuple[tuple[int, ...], type[np.generic]]] = {
                "vectors": ((*shape, 6, 3, 3), np.float32),
                "validity": (shape, np.float32),
                "lit_weights": ((*shape, 3, 3, 3), np.float16),
                "plane_start": ((lattice.vertex_count + 1,), np.int32),
            }
            arrays = {name: _read_array(archive, name, *form, path) for name, form in expected.items()}
            count = min(max(int(arrays["plane_start"][-1]), 0), MOST_PLANES * lattice.vertex_count)
            arrays["planes"] = _read_array(archive, "planes", (count, 5), np.float32, path)
            if header["version"] == VERSION:
                count = _corrected(header, lattice, path)
                arrays["corrected"] = _read_array(archive, "corrected", (count,), np.int32, path)
                arrays["corrections"] = _read_array(archive, "corrections", (count, 12, 3), np.float32, path)
    except FileNotFoundError as error:
        raise GridFileError(f"{path} does not exist: bake it first, or name another") from error
    except DAMAGE as error:
        raise GridFileError(f"{path} is not a grid file, or only part of one ({error}): bake it again") from error
    except OSError as error:
        raise GridFileError(f"cannot read {path} ({error.strerror or error})") from error
    return grid_parts.assemble(lattice, record, arrays, str(path))


def _member(archive: zipfile.ZipFile, name: str, path: Path) -> zipfile.ZipInfo:
    """Return the archive's entry of an array."""
    try:
        return archive.getinfo(f"{name}.npy")
    except KeyError as error:
        raise GridFileError(f"{path} has no array '{name}': it was not written by Irradiance Vector Grid") from error


def _read_header(archive: zipfile.ZipFile, path: Path) -> dict[str, Any]:
    """Return the JSON header after checking the format's name and version."""
    entry = _member(archive, "header", path)
    if entry.file_size > MOST_HEADER_BYTES:
        raise GridFileError(f"{path} has a header of {entry.file_size} bytes: it is not a grid file")
    try:
        with archive.open(entry) as stream:
            header = json.loads(str(npy.read_array(stream, allow_pickle=False)[()]))
        name, version = header["format"], header["version"]
    except (*DAMAGE, KeyError, TypeError) as error:
        raise GridFileError(f"{path} has an unreadable header ({error}): bake it again") from error
    if name != FORMAT:
        raise GridFileError(f"{path} is a '{name}' file: expected '{FORMAT}'")
    if not isinstance(version, int) or version < 1:
        raise GridFileError(f"{path} has no valid version number ({version!r}): bake it again")
    if version < _KNOWN[0]:
        raise GridFileError(f"{path} has format version {version}, this program reads {_KNOWN[0]} on: bake it again")
    if version > VERSION:
        raise GridFileError(
            f"{path} has format version {version}, this program reads {VERSION}: update Irradiance Vector Grid"
        )
    return dict(header)


def _corrected(header: dict[str, Any], lattice: Lattice, path: Path) -> int:
    """Return how many vertices have corrections."""
    count = header.get("corrected")
    if not isinstance(count, int) or not 0 < count <= lattice.vertex_count:
        raise GridFileError(f"{path} has a damaged header ({count!r} corrected vertices): bake it again")
    return count


def _read_array(
    archive: zipfile.ZipFile, name: str, shape: tuple[int, ...], kind: type[np.generic], path: Path
) -> NDArray[Any]:
    """Return an array, after checking that the file holds as much as it claims."""
    dtype = np.dtype(kind)
    entry = _member(archive, name, path)
    size = int(np.prod(shape, dtype=object)) * dtype.itemsize
    if not size <= entry.file_size <= size + (1 << 16):
        raise GridFileError(
            f"{path}: array '{name}' holds {entry.file_size} bytes where a grid of its resolution "
            f"has {size}: bake it again"
        )
    require(size, f"the grid in {path}", "close other programs or bake a smaller grid")
    with archive.open(entry) as stream:
        try:
            array = npy.read_array(stream, allow_pickle=False)
        except DAMAGE as error:
            raise GridFileError(f"{path}: array '{name}' is damaged ({error}): bake it again") from error
    if array.shape != shape or array.dtype != dtype:
        raise GridFileError(f"{path}: array '{name}' is {array.dtype} {array.shape}, expected {dtype} {shape}")
    return np.ascontiguousarray(array)
