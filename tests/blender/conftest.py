# SPDX-License-Identifier: GPL-3.0-or-later
"""What all tests with Blender share."""

from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def kept_materials(monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Evaluate materials anew in every test, and keep them in a folder of its own, which is returned."""
    from ivg_addon.blender import evaluation, evaluation_cache

    folder = tmp_path_factory.mktemp("materials")
    evaluation_cache.forget()
    monkeypatch.setattr(evaluation, "cache_folder", lambda: folder)
    return folder
