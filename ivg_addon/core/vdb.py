# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenVDB files of dense grids: written and read without OpenVDB, which Blender does not give to Python.

The file format is version 224 of OpenVDB's own (its headers io/Archive.h, io/GridDescriptor.h, tree/*.h): a header, the
file's metadata, then every grid with a descriptor, its metadata, its transform, the topology of its tree and the
values of the leaves. Trees are the standard 5-4-3 ones: a root, nodes of 32³ children, nodes of 16³, leaves of 8³
voxels. A dense grid of up to 4,096 voxels a side fills one node below the root. Only active voxels' values are stored,
uncompressed ("active mask" compression): what other programs write may be compressed by Blosc, and is refused.
"""

from __future__ import annotations

import struct
import uuid
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from .dual_cells import Lattice
from .errors import GridFileError

Float32 = NDArray[np.float32]

MAGIC = struct.pack("<q", 0x56444220)
FILE_VERSION = 224
LIBRARY_VERSION = (10, 0)
"""Of OpenVDB, the oldest whose files are of this version in practice."""

LARGEST_SIDE = 4096
"""Voxels that one node below the root spans along each axis."""

_ACTIVE_MASK = 2
_ALL_INACTIVE_ARE_BACKGROUND = struct.pack("<b", 0)
"""How a node's values are stored: those of its active voxels alone."""
_TREES = {1: "Tree_float_5_4_3", 3: "Tree_vec3s_5_4_3"}
_VALUE_TYPES = {1: "float", 3: "vec3s"}
_TRANSFORM = "ScaleTranslateMap"
_LEAF, _LOWER, _UPPER = 8, 16, 32
"""Children, or voxels, along an edge of a leaf, of the node above it, and of the one above that."""

MetaValue = str | int


@dataclass(frozen=True)
class VdbGrid:
    """One dense grid.

    Parameters
    ----------
    name
        As programs show it.
    values : (Ni, Nj, Nk) or (Ni, Nj, Nk, 3) float32
        Voxel (0, 0, 0) first; all of them are active.
    """

    name: str
    values: Float32


@dataclass(frozen=True)
class VdbFile:
    """What an OpenVDB file holds.

    Parameters
    ----------
    grids
        All of one size, and with one transform.
    scale, translation : (3,)
        Voxel edges and the centre of voxel (0, 0, 0), metres: voxel (i, j, k) lies at translation + scale · (i, j, k).
    metadata
        Of the file, by name.
    """

    grids: Sequence[VdbGrid]
    scale: Sequence[float]
    translation: Sequence[float]
    metadata: Mapping[str, MetaValue] = field(default_factory=dict)


def lattice_transform(lattice: Lattice) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return scale and translation that put one voxel's centre on every vertex of a lattice."""
    return tuple(float(h) for h in lattice.voxel_size), tuple(float(x) for x in lattice.bounds_min)


# --- Writing ----------------------------------------------------------------------------------------------------------


def write(stream: IO[bytes], file: VdbFile) -> None:
    """Write a file to a stream that can seek."""
    stream.write(MAGIC + struct.pack("<III?", FILE_VERSION, *LIBRARY_VERSION, True))
    # OpenVDB tells files apart by it; one that follows from the content gives equal grids equal files.
    stream.write(str(uuid.uuid5(uuid.NAMESPACE_OID, repr(sorted(file.metadata.items())))).encode("ascii"))
    _write_metadata(stream, file.metadata)
    stream.write(struct.pack("<i", len(file.grids)))
    for grid in file.grids:
        _write_grid(stream, grid, file)


def _write_grid(stream: IO[bytes], grid: VdbGrid, file: VdbFile) -> None:
    """Write a grid and, before it, where its parts lie."""
    components = grid.values.shape[3] if grid.values.ndim == 4 else 1
    size = grid.values.shape[:3]
    _write_text(stream, grid.name)
    _write_text(stream, _TREES[components])
    _write_text(stream, "")
    positions = stream.tell()
    stream.write(struct.pack("<qqq", 0, 0, 0))
    start = stream.tell()
    stream.write(struct.pack("<I", _ACTIVE_MASK))
    corner = struct.pack("<iii", *(n - 1 for n in size))
    _write_metadata(
        stream,
        {"class": "unknown", "name": grid.name, "value_type": _VALUE_TYPES[components]}
        | ({"vector_type": "invariant"} if components == 3 else {})
        | {"file_voxel_count": int(np.prod(size))},
        {"file_bbox_min": ("vec3i", struct.pack("<iii", 0, 0, 0)), "file_bbox_max": ("vec3i", corner)},
    )
    _write_text(stream, _TRANSFORM)
    scale = np.asarray(file.scale, dtype=np.float64)
    for vector in (file.translation, scale, np.abs(scale), 1.0 / scale, 1.0 / scale**2, 0.5 / scale):
        stream.write(np.asarray(vector, dtype="<f8").tobytes())
    leaves = _Leaves(size)
    stream.write(leaves.topology(components))
    blocks = stream.tell()
    leaves.write_values(stream, grid.values.reshape(*size, components))
    end = stream.tell()
    stream.seek(positions)
    stream.write(struct.pack("<qqq", start, blocks, end))
    stream.seek(end)


def _write_text(stream: IO[bytes], text: str) -> None:
    data = text.encode("utf-8")
    stream.write(struct.pack("<I", len(data)) + data)


def _write_metadata(
    stream: IO[bytes], values: Mapping[str, MetaValue], raw: Mapping[str, tuple[str, bytes]] | None = None
) -> None:
    """Write named values: texts and whole numbers, and such whose type and bytes are given."""
    entries = dict(raw or {})
    for name, value in values.items():
        if isinstance(value, str):
            entries[name] = "string", value.encode("utf-8")
        else:
            entries[name] = "int64", struct.pack("<q", value)
    stream.write(struct.pack("<I", len(entries)))
    for name, (kind, data) in entries.items():
        _write_text(stream, name)
        _write_text(stream, kind)
        stream.write(struct.pack("<I", len(data)) + data)


class _Leaves:
    """The leaves of a dense grid from the origin, in the order of the file: node by node, z fastest in each."""

    def __init__(self, size: Sequence[int]) -> None:
        self.size = tuple(size)
        counts = [-(-n // _LEAF) for n in size]
        self._lower: list[tuple[int, list[tuple[int, int, int]]]] = []
        """For every node of 16³ its place among its 32³, and its leaves, in voxels."""
        span = _LEAF * _LOWER
        for a, b, c in np.ndindex(*(-(-n // span) for n in size)):
            inside = (
                range(_LOWER * p, min(_LOWER * (p + 1), count)) for p, count in zip((a, b, c), counts, strict=True)
            )
            x, y, z = (list(places) for places in inside)
            leaves = [(_LEAF * i, _LEAF * j, _LEAF * k) for i in x for j in y for k in z]
            self._lower.append(((a * _UPPER + b) * _UPPER + c, leaves))

    def __iter__(self) -> Iterator[tuple[slice, slice, slice]]:
        """Yield the part of the grid that each leaf holds."""
        for _, leaves in self._lower:
            for corner in leaves:
                yield self._part(corner)

    def _part(self, corner: tuple[int, int, int]) -> tuple[slice, slice, slice]:
        """Return the part of the grid in the leaf that begins at a voxel."""
        x, y, z = (slice(low, min(low + _LEAF, n)) for low, n in zip(corner, self.size, strict=True))
        return x, y, z

    def mask(self, part: tuple[slice, slice, slice]) -> bytes:
        """Return the bits of a leaf's active voxels."""
        active = np.zeros((_LEAF,) * 3, dtype=bool)
        x, y, z = (p.stop - p.start for p in part)
        active[:x, :y, :z] = True
        return _bits(active)

    def topology(self, components: int) -> bytes:
        """Return the tree without its leaves' values."""
        out = BytesIO()
        background = bytes(4 * components)
        # One buffer; the background; no tiles and one child, which begins at the origin.
        out.write(struct.pack("<i", 1) + background + struct.pack("<IIiii", 0, 1, 0, 0, 0))
        children = np.zeros(_UPPER**3, dtype=bool)
        children[[place for place, _ in self._lower]] = True
        # The masks of children and of tiles; no tile is active, so none has a value.
        out.write(_bits(children) + bytes(_UPPER**3 // 8) + _ALL_INACTIVE_ARE_BACKGROUND)
        for _, leaves in self._lower:
            filled = np.zeros((_LOWER,) * 3, dtype=bool)
            for corner in leaves:
                filled[tuple(low // _LEAF % _LOWER for low in corner)] = True
            out.write(_bits(filled) + bytes(_LOWER**3 // 8) + _ALL_INACTIVE_ARE_BACKGROUND)
            for corner in leaves:
                out.write(self.mask(self._part(corner)))
        return out.getvalue()

    def write_values(self, stream: IO[bytes], values: Float32) -> None:
        """Write every leaf's mask again, and its active voxels' values."""
        little = np.ascontiguousarray(values, dtype="<f4")
        for part in self:
            stream.write(self.mask(part) + _ALL_INACTIVE_ARE_BACKGROUND)
            stream.write(little[part].tobytes())


def _bits(mask: NDArray[np.bool_]) -> bytes:
    """Return a node's mask as OpenVDB saves it."""
    return np.packbits(mask.reshape(-1), bitorder="little").tobytes()


# --- Reading ----------------------------------------------------------------------------------------------------------


def read_metadata(path: Path) -> dict[str, MetaValue]:
    """Return a file's own texts and whole numbers; raises `GridFileError`."""
    with _opened(path) as stream:
        return _Reader(stream, path).begin()


def read(path: Path) -> VdbFile:
    """Return a file's dense grids; raises `GridFileError` that says what is wrong with it."""
    with _opened(path) as stream:
        reader = _Reader(stream, path)
        metadata = reader.begin()
        (count,) = reader.numbers("<i")
        grids = []
        transforms = set()
        for _ in range(count):
            grid, transform = reader.grid()
            grids.append(grid)
            transforms.add(transform)
        if len(transforms) != 1 or len({grid.values.shape[:3] for grid in grids}) != 1:
            raise GridFileError(f"{path} holds grids of different boxes: it was not written by Irradiance Vector Grid")
        ((translation, scale),) = transforms
        return VdbFile(tuple(grids), scale, translation, metadata)


def _opened(path: Path) -> IO[bytes]:
    try:
        return path.open("rb")
    except FileNotFoundError as error:
        raise GridFileError(f"{path} does not exist: export it first, or name another") from error
    except OSError as error:
        raise GridFileError(f"cannot read {path} ({error.strerror or error})") from error


class _Reader:
    """Reads one file from its start."""

    def __init__(self, stream: IO[bytes], path: Path) -> None:
        self._stream = stream
        self._path = path
        self._left = path.stat().st_size

    def take(self, size: int) -> bytes:
        """Return the next `size` bytes."""
        data = self._stream.read(size) if size <= self._left else b""
        if len(data) != size:
            raise GridFileError(f"{self._path} is only part of an OpenVDB file: export it again")
        self._left -= size
        return data

    def numbers(self, form: str) -> tuple[Any, ...]:
        """Return what `struct` unpacks next."""
        return struct.unpack(form, self.take(struct.calcsize(form)))

    def text(self) -> str:
        """Return the next text."""
        (size,) = self.numbers("<I")
        return self.take(size).decode("utf-8", "replace")

    def expect(self, expected: bytes, what: str) -> None:
        """Read what must be there."""
        if self.take(len(expected)) != expected:
            raise self.foreign(what)

    def foreign(self, what: str) -> GridFileError:
        """Return the error of a file that another program wrote, or changed."""
        return GridFileError(
            f"{self._path} has {what}: it was written or changed by another program; export it again, "
            "or use the .ivg.npz file"
        )

    def begin(self) -> dict[str, MetaValue]:
        """Read the header, and return the file's metadata."""
        if self._left < len(MAGIC) or self.take(len(MAGIC)) != MAGIC:
            raise GridFileError(f"{self._path} is not an OpenVDB file: choose a .vdb file")
        version, _, _, offsets = self.numbers("<III?")
        if version != FILE_VERSION or not offsets:
            raise self.foreign(f"version {version} of OpenVDB's format where {FILE_VERSION} was expected")
        self.take(36)
        return self.metadata()

    def metadata(self) -> dict[str, MetaValue]:
        """Return the next table of values, those that are texts and whole numbers."""
        (count,) = self.numbers("<I")
        values: dict[str, MetaValue] = {}
        for _ in range(count):
            name, kind = self.text(), self.text()
            (size,) = self.numbers("<I")
            data = self.take(size)
            if kind == "string":
                values[name] = data.decode("utf-8", "replace")
            elif kind == "int64" and size == 8:
                (values[name],) = struct.unpack("<q", data)
        return values

    def grid(self) -> tuple[VdbGrid, tuple[tuple[float, ...], tuple[float, ...]]]:
        """Return the next grid, and its translation and scale."""
        name, tree, parent = self.text(), self.text(), self.text()
        components = {kind: n for n, kind in _TREES.items()}.get(tree)
        if components is None or parent:
            raise self.foreign(f"a grid '{name}' of type {tree}")
        self.numbers("<qqq")
        (compression,) = self.numbers("<I")
        if compression != _ACTIVE_MASK:
            raise self.foreign(f"a grid '{name}' with compressed values")
        self.metadata()
        if self.text() != _TRANSFORM:
            raise self.foreign(f"a grid '{name}' with another transform")
        translation, scale = self.numbers("<ddd"), self.numbers("<ddd")
        self.take(8 * 12)
        size = self._topology(name, components)
        values = self._values(name, size, components)
        return VdbGrid(name, values if components == 3 else values[..., 0]), (translation, scale)

    def _topology(self, name: str, components: int) -> tuple[int, int, int]:
        """Read a tree without values; return the size of the dense grid that it is."""
        buffers, *background = self.numbers(f"<i{components}f")
        tiles, children, *origin = self.numbers("<IIiii")
        if buffers != 1 or any(background) or (tiles, children) != (0, 1) or any(origin):
            raise self.foreign(f"a grid '{name}' that is not dense")
        upper = self._mask(_UPPER)
        self._no_tiles(name, _UPPER)
        size = np.zeros(3, dtype=np.int64)
        for place in np.argwhere(upper):
            lower = self._mask(_LOWER)
            self._no_tiles(name, _LOWER)
            for within in np.argwhere(lower):
                active = self._mask(_LEAF)
                corner = (place * _LOWER + within) * _LEAF
                if active.any():
                    size = np.maximum(size, corner + np.argwhere(active).max(axis=0) + 1)
        ni, nj, nk = (int(n) for n in size)
        # What is left must hold all values: no array is made on the word of a damaged file.
        if min(ni, nj, nk) < 1 or ni * nj * nk * 4 * components > self._left:
            raise GridFileError(f"{self._path} is only part of an OpenVDB file: export it again")
        return ni, nj, nk

    def _no_tiles(self, name: str, edge: int) -> None:
        """Read the masks and values of a node's tiles, of which there must be none."""
        self.expect(bytes(edge**3 // 8), f"a grid '{name}' with tiles")
        self.expect(_ALL_INACTIVE_ARE_BACKGROUND, f"a grid '{name}' with tiles")

    def _mask(self, edge: int) -> NDArray[np.bool_]:
        """Return the next mask of a node with `edge` entries along each axis."""
        bits = np.frombuffer(self.take(edge**3 // 8), dtype=np.uint8)
        return np.unpackbits(bits, bitorder="little").astype(bool).reshape(edge, edge, edge)

    def _values(self, name: str, size: tuple[int, int, int], components: int) -> Float32:
        """Return the values of a dense grid's leaves, (Ni, Nj, Nk, components)."""
        values = np.empty((*size, components), dtype=np.float32)
        leaves = _Leaves(size)
        for part in leaves:
            self.expect(leaves.mask(part), f"a grid '{name}' that is not dense")
            self.expect(_ALL_INACTIVE_ARE_BACKGROUND, f"a grid '{name}' with compressed values")
            inside = values[part]
            inside[:] = np.frombuffer(self.take(inside.size * 4), dtype="<f4").reshape(inside.shape)
        return values
