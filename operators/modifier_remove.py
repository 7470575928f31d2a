# SPDX-License-Identifier: GPL-3.0-or-later
"""Take the modifier "IVG Light" off objects."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import light_modifier
from .modifier_scope import report_left_out, scope_property, targets


class IVG_OT_modifier_remove(bpy.types.Operator):
    """Take the modifier off objects, and what served it out of the file."""

    bl_idname = "ivg.modifier_remove"
    bl_label = "Remove Irradiance Vector Grid Modifier"
    bl_description = "Take the modifier IVG Light off objects; they are then as they were before"
    bl_options = {"REGISTER", "UNDO"}
    __annotations__ = {"scope": scope_property()}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Remove them."""
        outcome = light_modifier.remove(targets(context, self.properties.scope))
        return report_left_out(self, outcome, "IVG Light is off")
