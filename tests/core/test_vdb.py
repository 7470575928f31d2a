# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenVDB files: what is written is what OpenVDB reads, and what is read back, to the bit."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from ivg_addon.core import vdb
from ivg_addon.core.errors import GridFileError
from ivg_addon.core.vdb import VdbFile, VdbGrid

from . import openvdb

SIZES = [(2, 2, 2), (8, 16, 9), (21, 23, 21), (130, 5, 140)]
"""Smaller than a leaf, at its edge, several leaves, and several nodes of 128 voxels."""


def random_file(size: tuple[int, int, int]) -> VdbFile:
    """Return a vector and a number per voxel; some are zero, which is what voxels that do not exist are, too."""
    rng = np.random.default_rng(size)
    vectors = rng.normal(size=(*size, 3)).astype(np.float32)
    numbers = rng.normal(size=size).astype(np.float32)
    vectors[-1, -1, -1] = numbers[0] = 0.0
    numbers[1, 0, 0] = -0.0
    grids = (VdbGrid("I_px_R", vectors), VdbGrid("validity", numbers))
    return VdbFile(grids, (0.5, 0.25, 0.1), (1.0, -2.0, 3.0), {"made by": "тест", "number": 7})


def write(file: VdbFile, path: Path) -> Path:
    with path.open("wb") as stream:
        vdb.write(stream, file)
    return path


@pytest.mark.parametrize("size", SIZES)
def test_openvdb_reads_the_same_bits(size: tuple[int, int, int], tmp_path: Path) -> None:
    file = random_file(size)
    arrays, told = openvdb.read(write(file, tmp_path / "a.vdb"), tmp_path)
    grids, metadata = json.loads(told)
    assert metadata == {"made by": "тест", "number": 7}
    assert set(arrays) == {grid.name for grid in file.grids}
    for grid in file.grids:
        assert arrays[grid.name].tobytes() == grid.values.tobytes()
        # Every voxel is active, those that hold zero too.
        assert grids[grid.name]["count"] == np.prod(size)
        np.testing.assert_allclose(grids[grid.name]["origin"], file.translation)
        far = np.add(file.translation, np.multiply(file.scale, np.subtract(size, 1)))
        np.testing.assert_allclose(grids[grid.name]["far"], far)


@pytest.mark.parametrize("size", SIZES)
def test_reading_gives_back_what_was_written(size: tuple[int, int, int], tmp_path: Path) -> None:
    file = random_file(size)
    back = vdb.read(write(file, tmp_path / "a.vdb"))
    assert (back.scale, back.translation, back.metadata) == (file.scale, file.translation, file.metadata)
    for grid, read in zip(file.grids, back.grids, strict=True):
        assert (grid.name, grid.values.tobytes()) == (read.name, read.values.tobytes())


def test_equal_grids_give_equal_files(tmp_path: Path) -> None:
    first, second = (write(random_file((3, 4, 5)), tmp_path / name) for name in ("a.vdb", "b.vdb"))
    assert first.read_bytes() == second.read_bytes()


def test_any_part_of_a_file_is_refused(tmp_path: Path) -> None:
    whole = write(random_file((3, 4, 5)), tmp_path / "a.vdb").read_bytes()
    part = tmp_path / "part.vdb"
    for size in {*range(0, len(whole), 97), len(whole) - 1}:
        part.write_bytes(whole[:size])
        with pytest.raises(GridFileError, match=r"part\.vdb is (not an|only part of an) OpenVDB file"):
            vdb.read(part)


def test_what_openvdb_compressed_is_refused_by_name(tmp_path: Path) -> None:
    copy = tmp_path / "copy.vdb"
    openvdb.save_again(write(random_file((3, 4, 5)), tmp_path / "a.vdb"), copy)
    with pytest.raises(GridFileError, match=r"copy\.vdb has a grid 'I_px_R' with compressed values"):
        vdb.read(copy)


@pytest.mark.parametrize("content", [b"", b"hello", b"\x89PNG\r\n\x1a\n" + bytes(100)])
def test_other_files_are_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "other.vdb"
    path.write_bytes(content)
    with pytest.raises(GridFileError, match=r"other\.vdb is not an OpenVDB file"):
        vdb.read(path)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(GridFileError, match=r"none\.vdb does not exist"):
        vdb.read(tmp_path / "none.vdb")
