# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenVDB's own Python module, which Debian packages for the system's Python: it runs in a process of its own."""

from __future__ import annotations

import functools
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

PYTHON = "/usr/bin/python3"
_IMPORT = "try:\n    import openvdb as vdb\nexcept ImportError:\n    import pyopenvdb as vdb\n"
_READ = """
import json, sys
import numpy as np
grids, metadata = vdb.readAll(sys.argv[1])
told = {}
arrays = {}
for grid in grids:
    (low, high) = grid.evalActiveVoxelBoundingBox()
    size = tuple(b + 1 for b in high)
    three = grid.valueTypeName == "vec3s"
    array = np.empty(size + ((3,) if three else ()), dtype=np.float32)
    grid.copyToArray(array)
    arrays[grid.name] = array
    told[grid.name] = dict(
        low=low, count=grid.activeVoxelCount(),
        origin=grid.transform.indexToWorld((0, 0, 0)), far=grid.transform.indexToWorld(high),
    )
np.savez(sys.argv[2], **arrays)
print(json.dumps([told, {name: value for name, value in metadata.items() if isinstance(value, (str, int))}]))
"""
_SAVE_AGAIN = """
import sys
grids, metadata = vdb.readAll(sys.argv[1])
vdb.write(sys.argv[2], grids=grids, metadata=metadata)
"""


@functools.cache
def missing() -> str:
    """Return why OpenVDB's module cannot be used; empty if it can."""
    if not Path(PYTHON).exists():
        return f"OpenVDB's module needs {PYTHON}"
    tried = subprocess.run([PYTHON, "-c", _IMPORT], capture_output=True, text=True, check=False)
    return "" if tried.returncode == 0 else "Debian's python3-openvdb is not installed, and could not be"


def run(code: str, *arguments: Path) -> str:
    """Run code that uses `vdb`; skips the test where there is no such module."""
    if missing():
        pytest.skip(missing())
    command = [PYTHON, "-c", _IMPORT + code, *(str(argument) for argument in arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=120).stdout


def read(path: Path, folder: Path) -> tuple[dict[str, NDArray[np.float32]], str]:
    """Return a file's grids, as OpenVDB reads them, and what it tells of them and of the file, as JSON."""
    told = run(_READ, path, folder / "read.npz")
    with np.load(folder / "read.npz") as arrays:
        return dict(arrays), told


def save_again(path: Path, copy: Path) -> None:
    """Let OpenVDB read a file and write it in its own way, compressed."""
    run(_SAVE_AGAIN, path, copy)
