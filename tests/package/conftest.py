# SPDX-License-Identifier: GPL-3.0-or-later
"""The built extension, which the tests in this folder are about."""

from __future__ import annotations

from pathlib import Path

import pytest

from scripts.build_extension import build
from scripts.wheel_lock import host_platform


@pytest.fixture(scope="session")
def extension_zip(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the zip that `make extension` builds for this machine."""
    return build(host_platform(), tmp_path_factory.mktemp("dist"))
