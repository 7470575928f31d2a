# SPDX-License-Identifier: GPL-3.0-or-later
"""The grids that a .blend holds: storing, finding, reading, restoring and removing them.

A grid goes by the name of its image datablock (grid_image.py), which points to its volume (grid_volume.py).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import bpy

from ..core import vdb_grid
from ..core.errors import GridFileError
from ..core.settings import Spatial
from . import grid_image, grid_volume, irradiance_nodes
from .grid_image import PreparedImage, is_grid, scene_grid
from .grid_pixels import put_pixels
from .grid_store import SUFFIX, absolute, default_grid_path
from .material_light import grid_of, lit_materials
from .outcome import grid_file
from .scene_light import take_out

if TYPE_CHECKING:
    from ..core.grid import IrradianceVectorGrid


def grids(data: bpy.types.BlendData) -> list[bpy.types.Image]:
    """Return the images of all grids in a file, linked ones too, in the order of their names."""
    return [image for image in data.images if is_grid(image)]


def load_grid(image: bpy.types.Image) -> IrradianceVectorGrid:
    """Return the grid of an image, to the bit as it was baked.

    Raises
    ------
    GridFileError
        The image holds no grid, one of another version, or was changed by hand, unpacked or resized: what shaders read
        from it is then not that grid.
    """
    wrong = grid_image.pixel_problem(image)
    if wrong:
        raise GridFileError(wrong)
    return grid_image.read(image)


def problem(image: bpy.types.Image) -> str:
    """Return what is wrong with the datablocks of a grid, and the cure; empty if nothing. Fast enough for drawing."""
    return grid_image.problem(image) or grid_volume.problem(image)


def default_name(scene: bpy.types.Scene) -> str:
    """Return the name of a scene's first grid."""
    return f"IVG {scene.name}"


def target_name(scene: bpy.types.Scene, asked: str) -> str:
    """Return the name under which the next bake of a scene is stored: as asked, the scene's grid's, or a new one.

    Raises
    ------
    GridFileError
        What is there was stored by a version that this one does not know.
    """
    current = scene.ivg.grid
    if asked or (current is not None and not current.library):
        name = asked or current.name
        found = find(name)
        wrong = grid_image.version_problem(found) if found is not None else ""
        if wrong:
            raise GridFileError(wrong)
        return name
    first = default_name(scene)
    numbered = (f"{first}.{number:03}" for number in range(1, len(bpy.data.images) + 2))
    return next(name for name in (first, *numbered) if find(name) is None)


def find(name: str) -> bpy.types.Image | None:
    """Return the image of the grid of this name in this file, not a linked one."""
    found = bpy.data.images.get((name, None))
    return found if found is not None and is_grid(found) else None


def store(scene: bpy.types.Scene, name: str, prepared: PreparedImage, volume_file: Path) -> bpy.types.Image:
    """Store a grid under a name, in place of the one that has it, and make it the scene's.

    Parameters
    ----------
    volume_file
        The grid's OpenVDB file, already written.
    """
    image = grid_image.put(prepared, name, find(name))
    grid_volume.put(image, volume_file)
    irradiance_nodes.follow(image)
    scene.ivg.grid = image
    return image


def restore(image: bpy.types.Image, scene: bpy.types.Scene) -> bpy.types.Volume:
    """Make pixels, volume and its file anew from the stored grid; raises `GridFileError` if they cannot be."""
    if image.library:
        raise GridFileError(f"{grid_image.named(image)} is linked: restore it in that file")
    grid = put_pixels(image, scene)
    volume = grid_volume.volume_of(image)
    if volume is not None and not grid_volume.problem(image):
        return volume
    path = _volume_file(volume, scene)
    vdb_grid.save(grid, path, Spatial.TRILINEAR)
    return grid_volume.put(image, path)


def _volume_file(volume: bpy.types.Volume | None, scene: bpy.types.Scene) -> Path:
    """Return where to write a volume's file anew: its place if nothing is there, else beside the grid's file."""
    if volume is not None and volume.filepath:
        path = absolute(volume.filepath)
        if path.parent.is_dir() and not path.exists():
            return path
    baked = baked_file(scene)
    if not baked.parent.is_dir():
        baked = default_grid_path(scene)
    return grid_volume.volume_path(baked)


def baked_file(scene: bpy.types.Scene) -> Path:
    """Return where the last bake wrote the scene's grid, or where a bake would write it."""
    return grid_file(scene) if scene.ivg.last_bake.filepath else default_grid_path(scene)


def suggested_export(scene: bpy.types.Scene) -> str:
    """Return where to export a scene's grid, unless the user says otherwise."""
    baked = baked_file(scene)
    return str(baked.with_name(baked.name.removesuffix(SUFFIX) + vdb_grid.SUFFIX))


def export_vdb(scene: bpy.types.Scene, name: str, filepath: str) -> Path:
    """Write a grid as an OpenVDB file, and return where.

    Parameters
    ----------
    name
        The grid's; empty for the scene's.
    filepath
        As typed by the user; without a suffix it gets one, and empty it is `suggested_export`.

    Raises
    ------
    GridFileError
        There is no such grid, its datablock was changed, or the file cannot be written.
    """
    image = bpy.data.images.get(name) if name else scene_grid(scene)
    if image is None:
        raise GridFileError(f"there is no grid '{name}' in this file: check the name")
    path = absolute(filepath or suggested_export(scene))
    if not path.suffix:
        path = path.with_name(path.name + vdb_grid.SUFFIX)
    vdb_grid.save(load_grid(image), path)
    return path


def remove(image: bpy.types.Image, scene: bpy.types.Scene) -> int:
    """Remove a grid's image and volume from the .blend, and its light from materials; the files stay where they are.

    Returns
    -------
    int
        How many materials had its light.
    """
    lit = [material for material in lit_materials() if grid_of(material) == image]
    take_out(scene, lit)
    volume = grid_volume.volume_of(image)
    if volume is not None and not volume.library:
        bpy.data.volumes.remove(volume)
    bpy.data.images.remove(image)
    return len(lit)
