# SPDX-License-Identifier: GPL-3.0-or-later
"""A small grid for tests of its file, and what such a file must be, or be refused as."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.errors import GridFileError
from ivg_addon.core.grid import IrradianceVectorGrid

from .grids import grid

SMALL = Lattice((0.0, 0.0, 0.0), (1.0, 2.0, 3.0), (2, 1, 1))
one_temporary_folder = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=50)


def small() -> IrradianceVectorGrid:
    values = np.arange(np.prod(SMALL.shape) * 54, dtype=np.float32).reshape(*SMALL.shape, 6, 3, 3)
    return grid(values, 0.5, SMALL)


def assert_refused(path: Path, *words: str) -> None:
    """Check that loading raises one line that names the file."""
    with pytest.raises(GridFileError) as caught:
        IrradianceVectorGrid.load(path)
    message = str(caught.value)
    assert "\n" not in message
    for word in (path.name, *words):
        assert word in message


def assert_same(a: IrradianceVectorGrid, b: IrradianceVectorGrid) -> None:
    assert a.vectors.tobytes() == b.vectors.tobytes()
    assert a.validity.tobytes() == b.validity.tobytes()
    assert a.lit_weights.tobytes() == b.lit_weights.tobytes()
    assert a.plane_start.tobytes() == b.plane_start.tobytes()
    assert a.planes.tobytes() == b.planes.tobytes()
    assert a.corrected.tobytes() == b.corrected.tobytes()
    assert a.corrections.tobytes() == b.corrections.tobytes()
    assert (a.lattice, a.record) == (b.lattice, b.record)
