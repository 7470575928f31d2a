# SPDX-License-Identifier: GPL-3.0-or-later
"""Remove the scene's grid from the file."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import storage
from .needs_grid import poll_grid


class IVG_OT_grid_remove(bpy.types.Operator):
    """Remove the grid's image and volume; the files beside the .blend stay."""

    bl_idname = "ivg.grid_remove"
    bl_label = "Remove Irradiance Vector Grid"
    bl_description = "Remove the scene's grid, its image and its volume, from this file; files on disk stay"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where there is a grid."""
        return poll_grid(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove it."""
        name = context.scene.ivg.grid.name
        storage.remove(context.scene.ivg.grid)
        self.report({"INFO"}, f"Removed '{name}'")
        return {"FINISHED"}
