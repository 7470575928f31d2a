# SPDX-License-Identifier: GPL-3.0-or-later
"""Install the zip into the Blender of this process, use it, disable and enable it: run by test_install.py.

`python use_installed_extension.py EXTENSION.zip GRID.npz PACKAGE …` with BLENDER_USER_RESOURCES naming an empty folder.
"""

from __future__ import annotations

import importlib
import os
import sys
from pathlib import Path

import bpy

MODULE = "bl_ext.user_default.irradiance_vector_grid"


def install(extension_zip: str) -> None:
    """Install and enable the extension. The operator says FINISHED even when it refused: look at the outcome."""
    bpy.ops.extensions.package_install_files(filepath=extension_zip, repo="user_default", enable_on_install=True)
    check_enabled()


def check_enabled() -> None:
    """Check that the extension is there: in the preferences, its operators, its settings."""
    assert MODULE in bpy.context.preferences.addons
    assert "bake" in dir(bpy.ops.ivg)
    assert bpy.context.scene.ivg is not None


def check_packages(packages: list[str]) -> None:
    """Check that packages come out of the extension's wheels."""
    for name in packages:
        path = importlib.import_module(name).__file__ or ""
        assert path.startswith(os.environ["BLENDER_USER_RESOURCES"]), f"{name} comes from {path}"


def make_room() -> None:
    """Replace the scene by a closed white room, two metres wide, with a lamp in it."""
    bpy.ops.wm.read_homefile(use_empty=True)
    x = [(i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)]
    walls = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh = bpy.data.meshes.new("room")
    mesh.from_pydata(x, [], walls)
    mesh.materials.append(bpy.data.materials.new("white"))
    lamp = bpy.data.lights.new("lamp", "POINT")
    lamp.energy = 100.0
    for data in (mesh, lamp):
        bpy.context.scene.collection.objects.link(bpy.data.objects.new(data.name, data))


def files_of_extension() -> dict[Path, int]:
    """Return the files in the installed extension's folder and when they changed; Python's own cache left out."""
    root = Path(sys.modules[MODULE].__file__ or "").parent
    return {path: path.stat().st_mtime_ns for path in root.rglob("*") if path.is_file() and path.suffix != ".pyc"}


def bake(grid: str) -> None:
    """Bake a small grid, as a script would."""
    settings = bpy.context.scene.ivg
    settings.photons = 20_000
    settings.resolution_mode = "MANUAL"
    settings.resolution = (2, 2, 2)
    settings.filepath = grid
    assert bpy.ops.ivg.bake() == {"FINISHED"}
    assert Path(grid).stat().st_size > 0


def main() -> None:
    """Run every check; the first that fails ends the process."""
    extension_zip, grid, *packages = sys.argv[1:]
    install(extension_zip)
    check_packages(packages)
    before = files_of_extension()
    make_room()
    bake(grid)
    assert files_of_extension() == before, "the extension wrote into its own folder"
    bpy.ops.preferences.addon_disable(module=MODULE)
    assert MODULE not in bpy.context.preferences.addons
    assert not hasattr(bpy.types.Scene, "ivg")
    bpy.ops.preferences.addon_enable(module=MODULE)
    check_enabled()


if __name__ == "__main__":
    main()
