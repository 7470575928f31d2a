# SPDX-License-Identifier: GPL-3.0-or-later
"""The pixels of a stored grid's image, made anew for the interpolation that a scene's look-ups have."""

from __future__ import annotations

import bpy

from ..core.grid import IrradianceVectorGrid
from ..core.settings import Spatial
from . import grid_image, irradiance_nodes, staleness


def put_pixels(image: bpy.types.Image, scene: bpy.types.Scene) -> IrradianceVectorGrid:
    """Make pixels anew from the stored grid, and nodes that read them; return the grid.

    Raises
    ------
    GridFileError
        The stored grid is damaged, or of a version that this one does not know.
    """
    grid = grid_image.read(image)
    with staleness.no_change_of_light(scene):
        grid_image.put(grid_image.prepare(grid, Spatial(scene.ivg.spatial)), image.name, image)
        irradiance_nodes.follow(image)
    return grid


def interpolate(image: bpy.types.Image, scene: bpy.types.Scene) -> None:
    """Make pixels anew if they are for another interpolation than the scene's; linked ones stay as they are.

    Raises
    ------
    GridFileError
        They cannot be made.
    """
    if not image.library and not grid_image.problem(image) and grid_image.spatial(image) != scene.ivg.spatial:
        put_pixels(image, scene)
