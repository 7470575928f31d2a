# SPDX-License-Identifier: GPL-3.0-or-later
"""Where grids and compiled code are kept on disk."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import bpy

SUFFIX = ".ivg.npz"
_EXTENSION_PREFIX = "bl_ext."


def user_folder(name: str) -> Path:
    """Return this program's own folder `name` for files of the user; it exists afterwards.

    An extension has a folder given by Blender. Outside of one it is in the user's cache, or in
    the temporary folder where there is no home to write to.
    """
    if __package__.startswith(_EXTENSION_PREFIX):
        root_package = ".".join(__package__.split(".")[:3])
        return Path(bpy.utils.extension_path_user(root_package, path=name, create=True))
    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = cache / "irradiance_vector_grid" / name
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        folder = Path(tempfile.gettempdir(), "irradiance_vector_grid", name)
        folder.mkdir(parents=True, exist_ok=True)
    return folder


def default_grid_name(scene: bpy.types.Scene, also_named: str = "") -> str:
    """Return the name of a scene's grid file: the .blend's, and the scene's if there are several.

    `also_named` is the grid's own name where it is not the scene's first.
    """
    stem = Path(bpy.data.filepath).stem or "unsaved"
    if also_named:
        stem += "." + bpy.path.clean_name(also_named)
    elif len(bpy.data.scenes) > 1:
        stem += "." + bpy.path.clean_name(scene.name)
    return stem + SUFFIX


def default_grid_path(scene: bpy.types.Scene, also_named: str = "") -> Path:
    """Return where a scene's grid is kept unless the user says otherwise: beside the .blend.

    A .blend that was never saved has no place of its own: then it is a folder of the user.
    """
    blend = bpy.data.filepath
    folder = Path(blend).parent if blend else user_folder("grids")
    return folder / default_grid_name(scene, also_named)


def absolute(path: str) -> Path:
    """Return a path as typed by the user ("//" is the .blend's folder) as an absolute one."""
    return Path(os.path.abspath(bpy.path.abspath(os.path.expanduser(path))))


def grid_path(scene: bpy.types.Scene, filepath: str, also_named: str = "") -> Path:
    """Return where to write a grid: `filepath` as typed, with the suffix added if there is none."""
    if not filepath:
        return default_grid_path(scene, also_named)
    path = absolute(filepath)
    return path if path.suffix else path.with_name(path.name + SUFFIX)


def compiled_code_folder() -> Path | None:
    """Return where to keep compiled kernels; None: where core, or the user's environment, says.

    An extension keeps them in its folder for the user's files, never beside the code.
    """
    if not __package__.startswith(_EXTENSION_PREFIX) or "NUMBA_CACHE_DIR" in os.environ:
        return None
    return user_folder("compiled")


def keep_compiled_code(folder: Path | None) -> None:
    """Keep kernels in `folder`; call it before anything of core that compiles is imported.

    Touches nothing of Blender, and takes a moment: it imports Numba.
    """
    from ..core.compiled import set_cache_folder

    if folder is not None:
        set_cache_folder(folder)
