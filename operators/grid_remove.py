# SPDX-License-Identifier: GPL-3.0-or-later
"""Remove the scene's grid from the file."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import storage
from ..ivg_addon.core.report import counted
from .needs import poll_grid, poll_no_render


class IVG_OT_grid_remove(bpy.types.Operator):
    """Remove the grid's image and volume; the files beside the .blend stay."""

    bl_idname = "ivg.grid_remove"
    bl_label = "Remove Irradiance Vector Grid"
    bl_description = (
        "Remove the scene's grid, its image and its volume, from this file, and its light from materials; "
        "files on disk stay"
    )
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where there is a grid, and not while a render reads it."""
        return poll_grid(cls, context) and poll_no_render(cls)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove it."""
        name = context.scene.ivg.grid.name
        lit = storage.remove(context.scene.ivg.grid, context.scene)
        self.report({"INFO"}, f"Removed '{name}'" + (f", and its light from {counted(lit, 'material')}" if lit else ""))
        return {"FINISHED"}
