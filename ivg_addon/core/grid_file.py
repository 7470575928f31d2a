# SPDX-License-Identifier: GPL-3.0-or-later
"""The grid's file: `.ivg.npz`, described in docs/file-format.md.

A zip archive of numpy arrays without pickles: `vectors`, `validity`, `lit_weights`, `plane_start`, `planes` and
`header`, a JSON text with the format's name and version, the lattice and the record of the bake. It is written to a
temporary file beside the target and renamed, so a reader sees a whole file or the previous one.
"""

from __future__ import annotations

import json
import os
import struct
import tempfile
import zipfile
import zlib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from .dual_cells import Lattice
from .errors import GridFileError, SettingsError
from .grid import BakeRecord, IrradianceVectorGrid
from .memory import require
from .partitions import MOST_PLANES, Partitions
from .settings import BakeSettings, Estimator

FORMAT = "irradiance-vector-grid"
VERSION = 3
SUFFIX = ".ivg.npz"

_MOST_HEADER_BYTES = 1 << 20

_DAMAGE = (
    *(zipfile.BadZipFile, zlib.error, struct.error, EOFError, NotImplementedError, RuntimeError),
    *(ValueError, OverflowError, MemoryError),
)
"""What the readers of zip archives, arrays and JSON raise on files that are not what they claim to be."""


def check_writable(path: Path) -> None:
    """Raise `GridFileError` if a file cannot be made at `path`; leaves nothing behind."""
    if path.is_dir():
        raise GridFileError(f"{path} is a folder: name a file in it, for instance grid{SUFFIX}")
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


def save(grid: IrradianceVectorGrid, path: Path) -> None:
    """Write a grid, whole or not at all; raises `GridFileError` that names the file."""
    check_writable(path)
    header = json.dumps(
        {
            "format": FORMAT,
            "version": VERSION,
            "bounds_min": grid.lattice.bounds_min,
            "bounds_max": grid.lattice.bounds_max,
            "resolution": grid.lattice.resolution,
            "record": asdict(grid.record),
        }
    )
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            np.savez(
                stream,
                header=np.array(header),
                vectors=grid.vectors,
                validity=grid.validity,
                lit_weights=grid.lit_weights,
                plane_start=grid.partitions.start,
                planes=grid.partitions.planes,
            )
            stream.flush()
            os.fsync(stream.fileno())
        # mkstemp makes files that only their owner may read; a grid is an ordinary file.
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(name, 0o666 & ~umask)
        os.replace(name, path)
    except OSError as error:
        raise GridFileError(
            f"cannot write {path} ({error.strerror or error}): free some space or choose "
            "another folder; the previous file is unchanged"
        ) from error
    finally:
        if os.path.exists(name):
            os.unlink(name)


def load(path: Path) -> IrradianceVectorGrid:
    """Read a grid; raises `GridFileError` that says what is wrong with the file."""
    try:
        with zipfile.ZipFile(path) as archive:
            header = _read_header(archive, path)
            lattice, record = _parse_header(header, path)
            shape = lattice.shape
            vectors = _read_array(archive, "vectors", (*shape, 6, 3, 3), np.dtype(np.float32), path)
            validity = _read_array(archive, "validity", shape, np.dtype(np.float32), path)
            lit_weights = _read_array(archive, "lit_weights", (*shape, 3, 3, 3), np.dtype(np.float16), path)
            partitions = _read_partitions(archive, lattice, path)
    except FileNotFoundError as error:
        raise GridFileError(f"{path} does not exist: bake it first, or name another") from error
    except _DAMAGE as error:
        raise GridFileError(f"{path} is not a grid file, or only part of one ({error}): bake it again") from error
    except OSError as error:
        raise GridFileError(f"cannot read {path} ({error.strerror or error})") from error
    if not all(np.isfinite(array).all() for array in (vectors, validity, lit_weights, partitions.planes)):
        raise GridFileError(f"{path} holds numbers that are not finite: bake it again")
    return IrradianceVectorGrid(vectors, validity, lit_weights, partitions, lattice, record)


def _read_partitions(archive: zipfile.ZipFile, lattice: Lattice, path: Path) -> Partitions:
    """Return the planes of vertices after checking that each vertex finds its own."""
    start = _read_array(archive, "plane_start", (lattice.vertex_count + 1,), np.dtype(np.int32), path)
    if start[0] != 0 or not (0 <= np.diff(start)).all() or start[-1] > MOST_PLANES * lattice.vertex_count:
        raise GridFileError(f"{path}: array 'plane_start' is damaged: bake it again")
    planes = _read_array(archive, "planes", (int(start[-1]), 5), np.dtype(np.float32), path)
    return Partitions(start, planes)


def _member(archive: zipfile.ZipFile, name: str, path: Path) -> zipfile.ZipInfo:
    """Return the archive's entry of an array."""
    try:
        return archive.getinfo(f"{name}.npy")
    except KeyError as error:
        raise GridFileError(f"{path} has no array '{name}': it was not written by Irradiance Vector Grid") from error


def _read_header(archive: zipfile.ZipFile, path: Path) -> dict[str, Any]:
    """Return the JSON header after checking the format's name and version."""
    entry = _member(archive, "header", path)
    if entry.file_size > _MOST_HEADER_BYTES:
        raise GridFileError(f"{path} has a header of {entry.file_size} bytes: it is not a grid file")
    try:
        with archive.open(entry) as stream:
            header = json.loads(str(npy.read_array(stream, allow_pickle=False)[()]))
        name, version = header["format"], header["version"]
    except (*_DAMAGE, KeyError, TypeError) as error:
        raise GridFileError(f"{path} has an unreadable header ({error}): bake it again") from error
    if name != FORMAT:
        raise GridFileError(f"{path} is a '{name}' file: expected '{FORMAT}'")
    if not isinstance(version, int) or version < 1:
        raise GridFileError(f"{path} has no valid version number ({version!r}): bake it again")
    if version < VERSION:
        raise GridFileError(f"{path} has format version {version}, this program reads {VERSION}: bake it again")
    if version > VERSION:
        raise GridFileError(
            f"{path} has format version {version}, this program reads {VERSION}: update Irradiance Vector Grid"
        )
    return dict(header)


def _parse_header(header: dict[str, Any], path: Path) -> tuple[Lattice, BakeRecord]:
    """Return lattice and record."""
    try:
        settings = dict(header["record"]["settings"])
        settings["estimator"] = Estimator(settings["estimator"])
        for name in ("bounds_min", "bounds_max", "resolution"):
            settings[name] = tuple(settings[name])
        record = dict(header["record"])
        record["settings"] = BakeSettings(**settings)
        record["emitted"] = _vec3(record["emitted"])
        lattice = Lattice(
            bounds_min=_vec3(header["bounds_min"]),
            bounds_max=_vec3(header["bounds_max"]),
            resolution=tuple(int(n) for n in header["resolution"]),  # type: ignore[arg-type]
        )
        if len(lattice.resolution) != 3 or min(lattice.resolution) < 1:
            raise SettingsError(f"resolution {lattice.resolution}")
        if not np.less(lattice.bounds_min, lattice.bounds_max).all():
            raise SettingsError(f"bounds {lattice.bounds_min} to {lattice.bounds_max}")
        return lattice, BakeRecord(**record)
    except (KeyError, TypeError, ValueError, SettingsError) as error:
        raise GridFileError(f"{path} has a damaged header ({error}): bake it again") from error


def _vec3(values: Any) -> tuple[float, float, float]:
    """Return three finite floats."""
    x, y, z = (float(value) for value in values)
    if not np.isfinite((x, y, z)).all():
        raise ValueError(f"{values} where finite numbers belong")
    return x, y, z


def _read_array(
    archive: zipfile.ZipFile, name: str, shape: tuple[int, ...], dtype: np.dtype[Any], path: Path
) -> NDArray[Any]:
    """Return an array, after checking that the file holds as much as it claims."""
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
        except _DAMAGE as error:
            raise GridFileError(f"{path}: array '{name}' is damaged ({error}): bake it again") from error
    if array.shape != shape or array.dtype != dtype:
        raise GridFileError(f"{path}: array '{name}' is {array.dtype} {array.shape}, expected {dtype} {shape}")
    return np.ascontiguousarray(array)
