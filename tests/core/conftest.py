# SPDX-License-Identifier: GPL-3.0-or-later
"""What all tests of the core share."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import settings

from .grid_files import small

# The first example of a property may have to wait for its kernels to compile.
settings.register_profile("kernels", deadline=None)
settings.load_profile("kernels")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """Return where a grid's file can be written."""
    return tmp_path / "room.ivg.npz"


@pytest.fixture
def saved(path: Path) -> Path:
    """Return the file of a small grid."""
    small().save(path)
    return path
