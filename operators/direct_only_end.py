# SPDX-License-Identifier: GPL-3.0-or-later
"""Let renders compute indirect light again."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import direct_light


class IVG_OT_direct_only_end(bpy.types.Operator):
    """Put the render settings back that were changed for rendering with the grid."""

    bl_idname = "ivg.direct_only_end"
    bl_label = "Render Indirect Light by the Engine Again"
    bl_description = "Put the settings of Cycles and EEVEE back that were switched for rendering with the grid"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where they were changed."""
        if not direct_light.is_direct_only(context.scene):
            cls.poll_message_set("Indirect light was not switched off")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Put them back."""
        direct_light.switch_back(context.scene)
        return {"FINISHED"}
