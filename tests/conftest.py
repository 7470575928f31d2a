# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender for the tests: an empty configuration, never the developer's own, and the checkout as an extension in it."""

from __future__ import annotations

import atexit
import os
import shutil
import sys
import tempfile
import zlib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent

# Blender reads this once, when bpy is first imported; conftest files are loaded before any test module.
RESOURCES = tempfile.mkdtemp(prefix="ivg-blender-")
os.environ["BLENDER_USER_RESOURCES"] = RESOURCES
atexit.register(shutil.rmtree, RESOURCES, ignore_errors=True)


@pytest.fixture(scope="session")
def extension() -> str:
    """Enable the checkout as an extension, as Blender would, and return its module's name.

    `operators` is imported this way only: its relative imports reach over to `ivg_addon`, so it needs the root package
    above it. Use it through `bpy.ops.ivg` and `scene.ivg`, or by `importlib.import_module(f"{extension}.operators.x")`.
    Its `ivg_addon` is another copy than the one that `import ivg_addon` gives: the classes of the two differ.
    """
    import bpy
    import numba

    import ivg_addon.core.compiled  # noqa: F401 (it says where this version's kernels are kept)

    # Kernels are found again by their file's path and folder: with a link that stays, the next run need not compile.
    # Checkouts that share an environment have one each.
    os.environ["NUMBA_CACHE_DIR"] = numba.config.CACHE_DIR
    folder = Path(sys.prefix, "extension-under-test", f"{zlib.crc32(bytes(ROOT)):08x}")
    folder.mkdir(parents=True, exist_ok=True)
    link = folder / "irradiance_vector_grid"
    # Several workers share the link: it is put in place in one step.
    fresh = folder / f"link-{os.getpid()}"
    fresh.symlink_to(ROOT, target_is_directory=True)
    fresh.replace(link)
    bpy.context.preferences.extensions.repos.new(name="dev", module="dev", custom_directory=str(folder))
    module = "bl_ext.dev.irradiance_vector_grid"
    bpy.ops.preferences.addon_enable(module=module)
    assert module in bpy.context.preferences.addons, "the checkout does not work as an extension: see the output above"
    return module
