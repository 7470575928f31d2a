# SPDX-License-Identifier: GPL-3.0-or-later
"""A grid as an OpenVDB file: one vector grid per direction and channel, one voxel per vertex (docs/file-format.md).

Grids that are there to be looked at go with them. What a voxel cannot hold, or OpenVDB not exactly, is in the file's
metadata as text, so that the file gives back the whole grid to the bit.
"""

from __future__ import annotations

import base64
import binascii
import json
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import vdb
from .errors import GridFileError
from .grid import IrradianceVectorGrid
from .grid_parts import arrays, assemble, digest, header, parse_header
from .moments import moments
from .partitions import MOST_PLANES
from .settings import Spatial
from .whole_file import replacing

SUFFIX = ".vdb"
FORMAT = "irradiance-vector-grid-vdb"
VERSION = 1

DIRECTIONS = ("px", "nx", "py", "ny", "pz", "nz")
"""p for positive, n for negative, in the order of `IrradianceVectorGrid.vectors`."""
RESOLUTION = "resolution"
DIVIDED = "divided"
PLANE_NORMALS = tuple(f"plane_{number}" for number in range(1, MOST_PLANES + 1))
PLANE_OFFSETS, PLANE_SLACKS = "plane_offsets", "plane_slacks"
"""Names of grids that look-ups read, besides F and D."""
CHANNELS = "RGB"
AXES = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], dtype=np.float32)

_IN_VOXELS = ("vectors", "validity")
_ARRAY = "ivg_array_"


def vector_grid_name(direction: int, channel: int) -> str:
    """Return the name of one vector grid: ``I_px_R`` for +x and red."""
    return f"I_{DIRECTIONS[direction]}_{CHANNELS[channel]}"


def save(grid: IrradianceVectorGrid, path: Path, look_up: Spatial | None = None) -> None:
    """Write a grid as an OpenVDB file, whole or not at all; raises `GridFileError` that names the file.

    Parameters
    ----------
    look_up
        Write also what look-ups with this interpolation read, for geometry nodes.
    """
    with replacing(path) as stream:
        vdb.write(stream, as_vdb(grid, look_up))


def as_vdb(grid: IrradianceVectorGrid, look_up: Spatial | None = None) -> vdb.VdbFile:
    """Return what the file holds: the vectors, grids to look at, those to look up, transform and metadata."""
    scale, translation = vdb.lattice_transform(grid.lattice)
    others = {name: array for name, array in arrays(grid).items() if name not in _IN_VOXELS}
    told = header(grid.lattice, grid.record) | {
        "arrays": {name: {"dtype": array.dtype.str, "shape": array.shape} for name, array in others.items()}
    }
    metadata: dict[str, vdb.MetaValue] = {
        "creator": f"Irradiance Vector Grid {grid.record.version}",
        "ivg_format": FORMAT,
        "ivg_version": VERSION,
        "ivg_digest": digest(grid),
        "ivg_header": json.dumps(told),
    }
    for name, array in others.items():
        packed = zlib.compress(np.ascontiguousarray(array).tobytes())
        metadata[_ARRAY + name] = base64.b64encode(packed).decode("ascii")
    grids = [*_grids(grid), *([] if look_up is None else _look_up_grids(grid, look_up))]
    return vdb.VdbFile(grids, scale, translation, metadata)


def _grids(grid: IrradianceVectorGrid) -> Iterator[vdb.VdbGrid]:
    """Yield the vectors, then what people want to look at."""
    for direction in range(6):
        for channel in range(3):
            yield vdb.VdbGrid(vector_grid_name(direction, channel), grid.vectors[..., direction, channel, :])
    irradiance = np.einsum("...dcx,dx->...dc", grid.vectors, AXES)
    for direction, name in enumerate(DIRECTIONS):
        yield vdb.VdbGrid(f"irradiance_{name}", irradiance[..., direction, :])
    yield vdb.VdbGrid("irradiance_mean", irradiance.mean(axis=-2))
    yield vdb.VdbGrid("validity", grid.validity)


def _look_up_grids(grid: IrradianceVectorGrid, spatial: Spatial) -> Iterator[vdb.VdbGrid]:
    """Yield F and D_k (moments.py) of the values that look-ups interpolate, and where they may: 12 vectors and a mask.

    E(n) = ½ (F·n + Σ_k D_k·W_k(n)) per channel, W_k the rows of the least-squares reconstruction. Nodes learn how many
    voxels there are from a grid that says so in each, for they cannot ask a file.
    """
    shape = grid.lattice.shape
    yield vdb.VdbGrid(RESOLUTION, np.broadcast_to(np.array(grid.resolution, dtype=np.float32), (*shape, 3)))
    lit = grid.validity > 0.0
    values = moments(grid.interpolated(spatial)) * lit[..., None, None]
    for start, name in enumerate(("F", "D_x", "D_y", "D_z")):
        for channel, letter in enumerate(CHANNELS):
            vectors = values[..., 3 * start : 3 * start + 3, channel]
            yield vdb.VdbGrid(f"{name}_{letter}", vectors.astype(np.float32))
    yield vdb.VdbGrid("lit", lit.astype(np.float32))
    divided = len(grid.planes) > 0
    yield vdb.VdbGrid(DIVIDED, np.full(shape, divided, dtype=np.float32))
    if divided:
        yield from _plane_grids(grid)


def _plane_grids(grid: IrradianceVectorGrid) -> Iterator[vdb.VdbGrid]:
    """Yield the planes that divide vertices (partitions.py), zeros where there are none."""
    planes = np.zeros((grid.lattice.vertex_count, MOST_PLANES, 5), dtype=np.float32)
    count = np.diff(grid.plane_start)
    vertex = np.repeat(np.arange(len(count)), count)
    planes[vertex, np.arange(len(vertex)) - grid.plane_start[vertex]] = grid.planes
    planes = planes.reshape(*grid.lattice.shape, MOST_PLANES, 5)
    for index, name in enumerate(PLANE_NORMALS):
        yield vdb.VdbGrid(name, planes[..., index, :3])
    yield vdb.VdbGrid(PLANE_OFFSETS, planes[..., 3])
    yield vdb.VdbGrid(PLANE_SLACKS, planes[..., 4])


def load(path: Path) -> IrradianceVectorGrid:
    """Return the grid of a file that `save` wrote; raises `GridFileError` that says what is wrong with it."""
    file = vdb.read(path)
    told = _header(file.metadata, path)
    lattice, record = parse_header(told, str(path))
    grids = {item.name: item.values for item in file.grids}
    try:
        vectors = np.stack(
            [np.stack([grids[vector_grid_name(d, c)] for c in range(3)], axis=-2) for d in range(6)], axis=-3
        )
        parts: dict[str, NDArray[Any]] = {"vectors": vectors, "validity": grids["validity"]}
        for name, kind in told["arrays"].items():
            packed = base64.b64decode(str(file.metadata[_ARRAY + name]), validate=True)
            parts[name] = np.frombuffer(zlib.decompress(packed), dtype=kind["dtype"]).reshape(kind["shape"])
    except (KeyError, TypeError, ValueError, AttributeError, binascii.Error, zlib.error) as error:
        raise GridFileError(f"{path} is damaged, or not all of a grid ({error}): export it again") from error
    grid = assemble(lattice, record, parts, str(path))
    if digest(grid) != file.metadata["ivg_digest"]:
        raise GridFileError(f"{path} was changed after it was written: export it again")
    return grid


def stored_digest(path: Path) -> str:
    """Return the digest of the grid in a file, without reading the grid; raises `GridFileError`."""
    metadata = vdb.read_metadata(path)
    _header(metadata, path)
    return str(metadata.get("ivg_digest"))


def _header(metadata: dict[str, vdb.MetaValue] | Any, path: Path) -> dict[str, Any]:
    """Return the header after checking the format's name and version."""
    if metadata.get("ivg_format") != FORMAT:
        raise GridFileError(f"{path} holds no irradiance vector grid: export one by 'ivg export', or choose another")
    version = metadata.get("ivg_version")
    if version != VERSION:
        raise GridFileError(
            f"{path} has format version {version}, this program reads {VERSION}: update Irradiance Vector Grid, "
            "or export it again"
        )
    try:
        return dict(json.loads(str(metadata["ivg_header"])))
    except (KeyError, TypeError, ValueError) as error:
        raise GridFileError(f"{path} has an unreadable header ({error}): export it again") from error
