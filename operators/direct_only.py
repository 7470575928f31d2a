# SPDX-License-Identifier: GPL-3.0-or-later
"""Let renders compute direct light only."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import direct_light
from .needs import poll_editable


class IVG_OT_direct_only(bpy.types.Operator):
    """Switch off what Cycles and EEVEE compute of indirect diffuse light."""

    bl_idname = "ivg.direct_only"
    bl_label = "Render Direct Light and Irradiance Vector Grid"
    bl_description = (
        "Switch off the diffuse bounces of Cycles, and of EEVEE what stands for them, so that no light counts twice"
    )
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only in a scene that can be changed, and where something is to be changed."""
        if not poll_editable(cls, context):
            return False
        if direct_light.is_direct_only(context.scene) and not direct_light.counts_twice(context.scene):
            cls.poll_message_set("Indirect light is switched off already")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Switch it off."""
        direct_light.switch_to_direct(context.scene)
        return {"FINISHED"}
