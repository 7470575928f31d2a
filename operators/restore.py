# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the datablocks of the scene's grid anew."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import storage
from ..ivg_addon.core.errors import IvgError
from .needs import poll_grid


class IVG_OT_restore(bpy.types.Operator):
    """Make pixels, volume and the volume's file anew from the stored grid."""

    bl_idname = "ivg.restore"
    bl_label = "Restore Irradiance Vector Grid"
    bl_description = "Make the image's pixels, the volume and its file anew from the grid that the image keeps"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where there is a grid."""
        return poll_grid(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Restore, and say where the volume's file is."""
        image = context.scene.ivg.grid
        try:
            volume = storage.restore(image, context.scene)
        except IvgError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Restored '{image.name}' and {volume.filepath}")
        return {"FINISHED"}
