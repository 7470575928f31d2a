# SPDX-License-Identifier: GPL-3.0-or-later
"""EEVEE in a process of its own: it needs OpenGL, and where there is none, asking for it ends the process.

Mesa's driver tells of no video memory, and then light probes are not baked: it is made to tell nothing.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ivg_addon.blender import direct_light

_ROOT = Path(__file__).resolve().parent.parent
_CHILD = """
import sys
from importlib import import_module
import bpy, gpu
gpu.init()
print("gpu", flush=True)
import numpy as np
from ivg_addon.blender.properties import ensure_registered
ensure_registered()
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
scene = bpy.context.scene
scene.render.engine = "BLENDER_EEVEE"
scene.eevee.taa_render_samples = 16
np.savez(sys.argv[2], **import_module(sys.argv[3]).in_eevee())
"""


def by_eevee(module: str) -> dict[str, NDArray[np.float64]] | None:
    """Return what a module's `in_eevee` returns in the open file, set to direct light; None without OpenGL.

    Raises
    ------
    RuntimeError
        It failed; with what it wrote.
    """
    scene = bpy.context.scene
    with tempfile.TemporaryDirectory() as folder:
        blend, found = Path(folder, "a.blend"), Path(folder, "a.npz")
        direct_light.switch_to_direct(scene)
        bpy.ops.wm.save_as_mainfile(filepath=str(blend), copy=True)
        direct_light.switch_back(scene)
        command = [sys.executable, "-c", _CHILD, str(blend), str(found), module]
        environment = os.environ | {
            "BLENDER_USER_RESOURCES": folder,
            "MESA_EXTENSION_OVERRIDE": "-GL_NVX_gpu_memory_info -GL_ATI_meminfo",
        }
        done = subprocess.run(command, cwd=_ROOT, env=environment, capture_output=True, text=True, check=False)
        if "gpu\n" not in done.stdout:
            print("EEVEE: no OpenGL here (libegl1, libgl1-mesa-dri)")
            return None
        if done.returncode:
            raise RuntimeError(done.stderr)
        with np.load(found) as file:
            return {name: np.asarray(file[name]) for name in file.files}
