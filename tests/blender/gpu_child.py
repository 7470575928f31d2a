# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawing in a Blender of its own: where there is no OpenGL, `gpu.init()` ends the process that calls it."""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bpy
import gpu
import numpy as np
import pytest
from numpy.typing import NDArray

from .stored_grids import ROOT

CHILD = """
import importlib, json, sys
import bpy
import gpu
gpu.init()
print("gpu", flush=True)
module, function, arguments = json.loads(sys.argv[1])
getattr(importlib.import_module(module), function)(*arguments)
"""

draws = pytest.mark.skipif(not hasattr(gpu, "init"), reason="the module of this Blender draws only with a window")
"""Of tests that call what follows."""


def call_where_it_draws(folder: Path, function: Callable[..., object], *arguments: str | int) -> None:
    """Call a module's function in a Blender that can draw, its own files in `folder`; skip the test without OpenGL."""
    done = subprocess.run(
        [sys.executable, "-c", CHILD, json.dumps((function.__module__, function.__name__, arguments))],
        cwd=ROOT,
        env=os.environ | {"BLENDER_USER_RESOURCES": str(folder / "resources")},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    if done.returncode < 0 and "gpu\n" not in done.stdout:
        pytest.skip("no OpenGL here: install libegl1 and libgl1-mesa-dri")
    assert done.returncode == 0, done.stderr


def rendered_by_eevee(folder: Path, render: Callable[..., NDArray[Any]], *arguments: int) -> NDArray[Any]:
    """Return what `render(path of the picture, *arguments)`, a module's function, returns of this scene in EEVEE."""
    bpy.context.scene.render.engine = "BLENDER_EEVEE"
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "a.blend"))
    call_where_it_draws(folder, _render, str(folder), render.__module__, render.__name__, *arguments)
    return np.asarray(np.load(folder / "found.npy"))


def _render(folder: str, module: str, function: str, *arguments: int) -> None:
    """Do in the other Blender what `rendered_by_eevee` asks for."""
    bpy.ops.wm.open_mainfile(filepath=str(Path(folder, "a.blend")))
    render = getattr(importlib.import_module(module), function)
    np.save(Path(folder, "found.npy"), render(Path(folder, "found.exr"), *arguments))
