# SPDX-License-Identifier: GPL-3.0-or-later
"""A grid's file is written whole or not at all, and where it cannot be one clear error says so."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from ivg_addon.core.errors import GridFileError
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.whole_file import check_writable

from .grid_files import SMALL, assert_refused, assert_same, small
from .grids import grid


def test_saving_replaces_and_leaves_nothing_else(saved: Path) -> None:
    other = grid(np.ones(1), 1.0, SMALL)
    other.save(saved)
    assert_same(IrradianceVectorGrid.load(saved), other)
    assert list(saved.parent.iterdir()) == [saved]


def test_a_saved_grid_is_an_ordinary_file(saved: Path) -> None:
    saved.parent.joinpath("ordinary").touch()
    assert saved.stat().st_mode == saved.parent.joinpath("ordinary").stat().st_mode


def test_a_folder(tmp_path: Path) -> None:
    assert_refused(tmp_path, "cannot read")
    with pytest.raises(GridFileError, match=r"is a folder: name a file in it, for instance grid\.ivg\.npz"):
        small().save(tmp_path)


@pytest.mark.parametrize("where", ["no/such/folder/room.ivg.npz", "file/room.ivg.npz"])
def test_a_place_where_no_file_can_be(tmp_path: Path, where: str) -> None:
    tmp_path.joinpath("file").touch()
    target = tmp_path / where
    with pytest.raises(GridFileError, match=r"cannot write .*: choose a folder that exists and is writable") as caught:
        small().save(target)
    assert str(target) in str(caught.value)
    with pytest.raises(GridFileError):
        IrradianceVectorGrid.load(target)


@pytest.fixture
def read_only(tmp_path: Path) -> Iterator[Path]:
    """Return a folder in which this user may not write, whoever that is."""
    folder = tmp_path / "read-only"
    folder.mkdir()
    folder.chmod(0o500)
    try:
        folder.joinpath("probe").touch()
    except OSError:
        yield folder
    else:  # an administrator may write everywhere, but not here
        folder.joinpath("probe").unlink()
        if not Path("/proc/self").is_dir():
            pytest.skip("this user may write everywhere")
        yield Path("/proc/self")
    folder.chmod(0o700)


def test_a_read_only_folder(read_only: Path) -> None:
    with pytest.raises(GridFileError, match=r"cannot write .*: choose a folder that exists and is writable"):
        check_writable(read_only / "room.ivg.npz")


def test_a_read_only_file(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(GridFileError, match=r"cannot replace .*: it is read-only"):
        small().save(saved)


def test_asking_whether_a_file_can_be_written_leaves_nothing(path: Path) -> None:
    check_writable(path)
    assert list(path.parent.iterdir()) == []


@pytest.mark.parametrize("step", ["savez", "fsync", "chmod", "replace"])
@pytest.mark.parametrize("failure", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt()])
def test_an_interrupted_write_leaves_the_old_file(
    saved: Path, monkeypatch: pytest.MonkeyPatch, step: str, failure: BaseException
) -> None:
    before = saved.read_bytes()

    def fail(*_: object, **__: object) -> None:
        raise failure

    with monkeypatch.context() as patch:
        patch.setattr(np if step == "savez" else os, step, fail)
        expected = KeyboardInterrupt if isinstance(failure, KeyboardInterrupt) else GridFileError
        with pytest.raises(expected) as caught:
            grid(np.ones(1), 1.0, SMALL).save(saved)
    if expected is GridFileError:
        assert "No space left on device" in str(caught.value)
        assert "free some space" in str(caught.value)
        assert "previous file is unchanged" in str(caught.value)
    assert saved.read_bytes() == before
    assert list(saved.parent.iterdir()) == [saved]
