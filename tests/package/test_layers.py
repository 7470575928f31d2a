# SPDX-License-Identifier: GPL-3.0-or-later
"""The core runs where there is no Blender."""

from __future__ import annotations

import subprocess
import sys

from scripts.wheel_lock import ROOT

IMPORT_CORE = """
import importlib, pkgutil, sys
sys.modules["bpy"] = None
import ivg_addon.core
for module in pkgutil.walk_packages(ivg_addon.core.__path__, "ivg_addon.core."):
    importlib.import_module(module.name)
ivg_addon.core.IrradianceVectorGrid
print(sorted({"bpy_extras", "gpu", "mathutils", "ivg_addon.blender", "operators"} & set(sys.modules)))
"""


def test_core_imports_without_blender() -> None:
    command = [sys.executable, "-c", IMPORT_CORE]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False, timeout=120)
    assert result.returncode == 0, result.stderr
    assert (result.stdout, result.stderr) == ("[]\n", "")
