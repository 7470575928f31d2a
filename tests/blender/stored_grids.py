# SPDX-License-Identifier: GPL-3.0-or-later
"""Grids of random numbers, stored in a scene as a bake stores them, and processes that read them anew."""

from __future__ import annotations

import importlib
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ivg_addon.core import vdb_grid
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.settings import Spatial
from tests.core.grids import LATTICE, grid

ROOT = Path(__file__).resolve().parents[2]


def random_grid(seed: int = 0, lattice: Lattice = LATTICE) -> IrradianceVectorGrid:
    """Return a grid all of whose numbers differ, some vertices unlit, over thirty powers of ten."""
    rng = np.random.default_rng(seed)
    validity = np.clip(rng.uniform(-0.2, 1.2, lattice.shape), 0.0, 1.0)
    size = 10.0 ** rng.uniform(-15.0, 15.0, lattice.shape)
    vectors = rng.normal(size=(*lattice.shape, 6, 3, 3)) * size[..., None, None, None]
    weights = rng.uniform(size=(*lattice.shape, 3, 3, 3)).astype(np.float16)
    return grid(vectors * (validity > 0)[..., None, None, None], validity, lattice, weights)


def module(extension: str, name: str) -> Any:
    """Return a module of the extension's copy of `ivg_addon.blender`, the one that has the handlers."""
    return importlib.import_module(f"{extension}.ivg_addon.blender.{name}")


def store(extension: str, name: str, baked: IrradianceVectorGrid, folder: Path) -> bpy.types.Image:
    """Store a grid as a bake does."""
    storage, grid_image, grid_volume = (module(extension, name) for name in ("storage", "grid_image", "grid_volume"))
    path = grid_volume.volume_path(folder / "room.ivg.npz")
    vdb_grid.save(baked, path, Spatial.TRILINEAR)
    return storage.store(bpy.context.scene, name, grid_image.prepare(baked), path)


def in_fresh_process(code: str, *arguments: object) -> str:
    """Run code in a new process that has bpy, `storage`, `digest` and `arguments`; return what it prints last."""
    head = (
        "import sys, bpy\n"
        "from ivg_addon.blender import storage\n"
        "from ivg_addon.blender.properties import ensure_registered\n"
        "from ivg_addon.core.grid_parts import digest\n"
        "ensure_registered()\n"
        "arguments = sys.argv[1:]\n"
    )
    with tempfile.TemporaryDirectory() as resources:
        result = subprocess.run(
            [sys.executable, "-c", head + code, *(str(argument) for argument in arguments)],
            cwd=ROOT,
            env=os.environ | {"BLENDER_USER_RESOURCES": resources},
            capture_output=True,
            text=True,
            check=False,
            timeout=300,
        )
    assert result.returncode == 0, result.stderr
    return result.stdout.splitlines()[-1]
