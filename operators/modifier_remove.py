# SPDX-License-Identifier: GPL-3.0-or-later
"""Take the modifier "IVG Light" off objects."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import light_modifier
from .modifier_targets import report_left_out, targets
from .which_objects import which_objects


class IVG_OT_modifier_remove(bpy.types.Operator):
    """Take the modifier off objects, and what served it out of the file."""

    bl_idname = "ivg.modifier_remove"
    bl_label = "Remove Irradiance Vector Grid Modifier"
    bl_description = "Take the modifier IVG Light off objects; they are then as they were before"
    bl_options = {"REGISTER", "UNDO"}
    __annotations__ = {"objects": which_objects("Objects that lose the modifier", default="SELECTED")}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove them."""
        outcome = light_modifier.remove(targets(context, self.properties.objects))
        return report_left_out(self, outcome, "IVG Light is off")
