# SPDX-License-Identifier: GPL-3.0-or-later
"""Take the modifier "IVG Light" off objects."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import light_modifier, scene_light
from .modifier_targets import report_left_out, targets
from .which_objects import which_objects


class IVG_OT_modifier_remove(bpy.types.Operator):
    """Take the modifier off objects, and what served it out of the file."""

    bl_idname = "ivg.modifier_remove"
    bl_label = "Remove Irradiance Vector Grid Modifier"
    bl_description = (
        "Take the modifier IVG Light off objects; they are then as they were before. Materials that take their light "
        "from it look the grid up"
    )
    bl_options = {"REGISTER", "UNDO"}
    __annotations__ = {"objects": which_objects("Objects that lose the modifier", default="SELECTED")}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove them; materials that took their light from them look the grid up."""
        outcome = light_modifier.remove(targets(context, self.properties.objects))
        for notice in scene_light.follow_modifiers(context):
            self.report({"WARNING"}, f"{notice.subject} {notice.message}")
        return report_left_out(self, outcome, "IVG Light is off")
