# SPDX-License-Identifier: GPL-3.0-or-later
"""`ivg export`: the same grid in every format that keeps it whole, without Blender."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from ivg_addon.blender.command_line import DONE, FAILED, WRONG_USAGE, main
from ivg_addon.core import IrradianceVectorGrid
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.grid import BakeRecord
from ivg_addon.core.grid_parts import digest
from ivg_addon.core.settings import BakeSettings

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def baked(tmp_path: Path) -> Path:
    """Return the file of a grid of random numbers."""
    lattice = Lattice((0.0, -1.0, 2.0), (1.0, 3.0, 2.5), (3, 4, 5))
    rng = np.random.default_rng(8)
    grid = IrradianceVectorGrid(
        vectors=rng.uniform(size=(*lattice.shape, 6, 3, 3)).astype(np.float32),
        validity=np.ones(lattice.shape, dtype=np.float32),
        lit_weights=lattice.whole_cell_weights(),
        plane_start=np.minimum(np.arange(lattice.vertex_count + 1), 2).astype(np.int32),
        planes=rng.uniform(size=(2, 5)).astype(np.float32),
        lattice=lattice,
        record=BakeRecord(
            scene="Room",
            checksum="00",
            settings=BakeSettings(lattice.bounds_min, lattice.bounds_max, lattice.resolution),
            created="2026-01-01T00:00:00+00:00",
            version="0",
            emitted=(1.0, 2.0, 3.0),
        ),
    )
    path = tmp_path / "room.ivg.npz"
    grid.save(path)
    return path


def test_there_and_back_to_the_bit(baked: Path, capfd: pytest.CaptureFixture[str]) -> None:
    volume, again = baked.with_name("room.vdb"), baked.with_name("again.ivg.npz")
    assert main(["export", str(baked), "--vdb", str(volume)], "ivg") == DONE
    assert main(["export", str(volume), "--npz", str(again)], "ivg") == DONE
    assert digest(IrradianceVectorGrid.load(again)) == digest(IrradianceVectorGrid.load(baked))
    told = capfd.readouterr().out
    assert f"{volume}, " in told
    assert f"{again}, " in told


@pytest.mark.parametrize("form", ["moments", "REPORT"])
def test_half_floats_come_back_as_a_grid(baked: Path, form: str) -> None:
    small, again = baked.with_name("room.ivg16.npz"), baked.with_name("again.ivg.npz")
    assert main(["export", str(baked), "--compressed", str(small), "--form", form], "ivg") == DONE
    assert main(["export", str(small), "--npz", str(again)], "ivg") == DONE
    assert IrradianceVectorGrid.load(again).record == IrradianceVectorGrid.load(baked).record


def test_it_needs_no_blender(baked: Path, tmp_path: Path) -> None:
    (tmp_path / "bpy.py").write_text("raise ImportError('no Blender here')", encoding="utf-8")
    command = [sys.executable, "-m", "ivg_addon", "export", str(baked), "--vdb", str(tmp_path / "room.vdb")]
    result = subprocess.run(
        command, cwd=ROOT, env=os.environ | {"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True, check=False
    )
    assert (result.returncode, result.stderr) == (DONE, "")


@pytest.mark.parametrize(
    ("arguments", "status", "message"),
    [
        (["room.ivg.npz"], FAILED, "nothing to write: give --vdb"),
        (["none.vdb", "--npz", "a.ivg.npz"], FAILED, "none.vdb does not exist"),
        (["room.ivg.npz", "--vdb", "nowhere/room.vdb"], FAILED, "cannot write nowhere/room.vdb"),
        (["room.ivg.npz", "--compressed", "a.ivg16.npz", "--form", "other"], WRONG_USAGE, "invalid choice"),
    ],
)
def test_errors(
    baked: Path,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
    arguments: list[str],
    status: int,
    message: str,
) -> None:
    monkeypatch.chdir(baked.parent)
    assert main(["export", *arguments], "ivg") == status
    assert message in capfd.readouterr().err
