# SPDX-License-Identifier: GPL-3.0-or-later
"""`ivg export`: a grid file in other formats. Needs no Blender."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TextIO

from ...core import IrradianceVectorGrid, compressed_file, vdb_grid
from ...core.errors import SettingsError
from ...core.memory import human
from ..interrupts import Interrupts


def run(options: argparse.Namespace, output: TextIO, interrupts: Interrupts) -> None:
    """Write what was asked for and tell each file's size; raises `IvgError`."""
    outputs = (options.vdb, options.compressed, options.npz)
    if not any(outputs):
        raise SettingsError("nothing to write: give --vdb, --compressed or --npz with a file name")
    grid = _load(options.grid)
    if options.npz:
        grid.save(options.npz)
    if options.vdb:
        vdb_grid.save(grid, options.vdb)
    if options.compressed:
        from ...core.compressed import Form, compress

        compressed_file.save(compress(grid, Form(options.form)), options.compressed)
    for path in filter(None, outputs):
        output.write(f"{'Wrote:':<11}{path}, {human(path.stat().st_size)}\n")


def _load(path: Path) -> IrradianceVectorGrid:
    """Return the grid of a file of any of the formats, told by its name."""
    if path.name.endswith(vdb_grid.SUFFIX):
        return vdb_grid.load(path)
    if path.name.endswith(compressed_file.SUFFIX):
        return compressed_file.load(path).expand()
    return IrradianceVectorGrid.load(path)
