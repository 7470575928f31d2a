# SPDX-License-Identifier: GPL-3.0-or-later
"""Take the light of grids out of materials."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import material_light, scene_light
from ..ivg_addon.core.report import counted
from .needs import poll_no_render
from .which_objects import which_objects


class IVG_OT_materials_remove(bpy.types.Operator):
    """Leave materials as they were before a grid's light was added, but for what was edited since."""

    bl_idname = "ivg.materials_remove"
    bl_label = "Remove Irradiance Vector Grid from Materials"
    bl_description = "Take the light of grids out of materials, which are then as they were without"
    bl_options = {"REGISTER", "UNDO"}
    __annotations__ = {"objects": which_objects("Objects whose materials lose the light")}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where materials have it, and not while a render reads them."""
        if not material_light.lit_materials():
            cls.poll_message_set("No material has the light of a grid")
            return False
        return poll_no_render(cls)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove it."""
        lit = scene_light.remove(context, self.objects == "SELECTED")
        self.report({"INFO"}, f"Removed the light of grids from {counted(lit.materials, 'material')}")
        return {"FINISHED"}
