# SPDX-License-Identifier: GPL-3.0-or-later
"""How much memory there is, in words, and the refusal before too much is asked for."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import psutil
import pytest

from ivg_addon.core.errors import MemoryLimitError
from ivg_addon.core.memory import human, peak, require

from .grids import UNIFORM, grid

ROOT = Path(__file__).resolve().parents[2]
GIB = 1 << 30


@pytest.mark.parametrize(
    ("size", "words"),
    [
        (0, "0 bytes"),
        (1023, "1023 bytes"),
        (1024, "1 KiB"),
        (1536 * 1024, "2 MiB"),
        (GIB, "1.0 GiB"),
        (1.5 * GIB, "1.5 GiB"),
        (1e4 * GIB, "10000.0 GiB"),
    ],
)
def test_sizes_for_people(size: float, words: str) -> None:
    assert human(size) == words


def test_what_fits_is_allowed_and_what_does_not_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=10 * GIB))
    require(9 * GIB, "a grid", "lower the resolution")
    with pytest.raises(MemoryLimitError) as caught:
        require(12 * GIB, "a grid of 900 × 900 × 900 voxels", "lower the resolution")
    assert str(caught.value) == (
        "a grid of 900 × 900 × 900 voxels needs 12.0 GiB of memory, of which 10.0 GiB are free: lower the resolution"
    )


def test_the_peak_grows_with_what_is_held() -> None:
    before = peak()
    assert before > 10 << 20
    held = np.ones(256 << 20, dtype=np.uint8)
    assert peak() >= before
    assert peak() >= held.nbytes


LOOK_UP = """
import sys
for absent in ("bpy", "embreex", "psutil", "OpenEXR"):
    sys.modules[absent] = None
from ivg_addon.core import IrradianceVectorGrid
grid = IrradianceVectorGrid.load(sys.argv[1])
print(grid.irradiance([(0.5, 2.5, 1.5)], [(0, 0, 1)]).shape)
"""


def test_grids_are_looked_up_with_numpy_and_numba_alone(tmp_path: Path) -> None:
    path = tmp_path / "room.ivg.npz"
    grid(UNIFORM).save(path)
    command = [sys.executable, "-c", LOOK_UP, str(path)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=120)
    assert (result.stdout, result.stderr) == ("(1, 3)\n", "")
