# SPDX-License-Identifier: GPL-3.0-or-later
"""The compressed grid's file: `.ivg16.npz`, described in docs/file-format.md.

A zip archive of numpy arrays without pickles, as the grid's own (grid_file.py), of another format.
"""

from __future__ import annotations

import json
import zipfile
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from .compressed import CompressedGrid, Form
from .errors import GridFileError
from .grid_file import DAMAGE, MOST_HEADER_BYTES
from .grid_parts import header, parse_header
from .whole_file import replacing

FORMAT = "irradiance-vector-grid-compressed"
VERSION = 1
SUFFIX = ".ivg16.npz"

_OTHER = "other_"


def save(grid: CompressedGrid, path: Path) -> None:
    """Write a compressed grid, whole or not at all; raises `GridFileError` that names the file."""
    told = {
        "format": FORMAT,
        "version": VERSION,
        "form": grid.form,
        "scale": grid.scale,
        "others": sorted(grid.others),
        **header(grid.lattice, grid.record),
    }
    parts: dict[str, Any] = {"header": np.array(json.dumps(told)), "texels": grid.texels, "validity": grid.validity}
    parts.update((_OTHER + name, array) for name, array in grid.others.items())
    with replacing(path) as stream:
        np.savez(stream, **parts)


def load(path: Path) -> CompressedGrid:
    """Read a compressed grid; raises `GridFileError` that says what is wrong with the file."""
    try:
        with zipfile.ZipFile(path) as archive:
            told = _read_header(archive, path)
            lattice, record = parse_header(told, str(path))
            texels, validity = _read_array(archive, "texels"), _read_array(archive, "validity")
            others = {str(name): _read_array(archive, _OTHER + name) for name in told["others"]}
            form, scale = Form(told["form"]), float(told["scale"])
    except FileNotFoundError as error:
        raise GridFileError(f"{path} does not exist: export it first, or name another") from error
    except (*DAMAGE, KeyError, TypeError) as error:
        raise GridFileError(f"{path} is no compressed grid, or only part of one ({error}): export it again") from error
    except OSError as error:
        raise GridFileError(f"cannot read {path} ({error.strerror or error})") from error
    shape = lattice.shape
    for name, array, expected in (
        ("texels", texels, (*shape, 12, 3)),
        ("validity", validity, shape),
    ):
        if array.shape != expected or array.dtype != np.float16:
            raise GridFileError(
                f"{path}: array '{name}' is {array.dtype} {array.shape}, expected float16 {expected}: export it again"
            )
        if not np.isfinite(array).all():
            raise GridFileError(f"{path} holds numbers in '{name}' that are not finite: export it again")
    if not (np.isfinite(scale) and scale > 0.0):
        raise GridFileError(f"{path} has a damaged header (scale {scale}): export it again")
    return CompressedGrid(texels, validity, form, scale, lattice, record, others)


def _read_header(archive: zipfile.ZipFile, path: Path) -> dict[str, Any]:
    """Return the JSON header after checking the format's name and version."""
    if archive.getinfo("header.npy").file_size > MOST_HEADER_BYTES:
        raise GridFileError(f"{path} has a header that is too long: it is no compressed grid")
    told = json.loads(str(_read_array(archive, "header")[()]))
    if told["format"] != FORMAT:
        raise GridFileError(f"{path} is a '{told['format']}' file: expected '{FORMAT}'")
    if told["version"] != VERSION:
        raise GridFileError(
            f"{path} has format version {told['version']}, this program reads {VERSION}: "
            "update Irradiance Vector Grid, or export it again"
        )
    return dict(told)


def _read_array(archive: zipfile.ZipFile, name: str) -> NDArray[Any]:
    """Return an array; raises one of `DAMAGE` unless the file holds as much as it claims."""
    entry = archive.getinfo(f"{name}.npy")
    if entry.compress_type != zipfile.ZIP_STORED:
        raise ValueError(f"array '{name}' is packed")
    stream = BytesIO(archive.read(entry))
    if npy.read_magic(stream) != (1, 0):
        raise ValueError(f"array '{name}' is of a later format")
    shape, fortran, dtype = npy.read_array_header_1_0(stream)
    if fortran or dtype.hasobject:
        raise ValueError(f"array '{name}' is not of plain numbers")
    return np.frombuffer(stream.read(), dtype=dtype).reshape(shape)
