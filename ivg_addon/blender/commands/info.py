# SPDX-License-Identifier: GPL-3.0-or-later
"""`ivg info`: tell what is in a grid file. Needs no Blender."""

from __future__ import annotations

import argparse
from typing import TextIO

from ...core import IrradianceVectorGrid
from ..interrupts import Interrupts
from ..summary import grid_rows, table


def run(options: argparse.Namespace, output: TextIO, interrupts: Interrupts) -> None:
    """Print what the grid is; raises `GridFileError`."""
    grid = IrradianceVectorGrid.load(options.grid)
    record = grid.record
    rows = [
        *grid_rows(grid),
        ("Light", "{:.4g}, {:.4g}, {:.4g} W emitted (linear RGB)".format(*record.emitted)),
        ("Checksum", f"{record.checksum} of what was baked"),
    ]
    output.write(table([("File", str(options.grid)), *rows]) + "\n")
