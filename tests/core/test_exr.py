# SPDX-License-Identifier: GPL-3.0-or-later
"""Layered images keep every bit on their way to a file and back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ivg_addon.core.errors import GridFileError
from ivg_addon.core.exr import read_exr, write_exr

LONG_NAME = "A layer with a name of more than thirty-one characters.Combined.R"


def test_round_trip(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    names = ("Grid.Combined.R", "Grid.Combined.G", "Cycles.Combined.R", LONG_NAME)
    channels = {name: rng.normal(size=(5, 7)).astype(np.float32) for name in names}
    write_exr(tmp_path / "x.exr", channels)
    found = read_exr(tmp_path / "x.exr")
    assert set(found) == set(names)
    for name in names:
        np.testing.assert_array_equal(found[name], channels[name])


def test_files_that_are_not_there_or_no_exr_are_named(tmp_path: Path) -> None:
    foreign = tmp_path / "foreign.exr"
    foreign.write_text("not an image")
    for path in (foreign, tmp_path / "missing.exr"):
        with pytest.raises(GridFileError, match=path.name):
            read_exr(path)


def test_a_folder_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(GridFileError, match="nowhere"):
        write_exr(tmp_path / "nowhere" / "x.exr", {"R": np.zeros((2, 2), np.float32)})
