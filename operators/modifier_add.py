# SPDX-License-Identifier: GPL-3.0-or-later
"""Put the modifier "IVG Light" on objects."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import light_modifier
from ..ivg_addon.core.errors import IvgError
from .modifier_targets import report_left_out, targets
from .needs import poll_grid
from .which_objects import which_objects


class IVG_OT_modifier_add(bpy.types.Operator):
    """Make geometry nodes store the grid's irradiance at the points of objects."""

    bl_idname = "ivg.modifier_add"
    bl_label = "Add Irradiance Vector Grid Modifier"
    bl_description = (
        "Store the grid's irradiance at the points of objects, as a colour attribute, wherever they move. "
        "Modifiers that are there already read the scene's grid"
    )
    bl_options = {"REGISTER", "UNDO"}
    __annotations__ = {"objects": which_objects("Objects that get the modifier", default="SELECTED")}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where there is a grid."""
        return poll_grid(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add them."""
        settings = context.scene.ivg
        try:
            outcome = light_modifier.add(settings.grid, targets(context, self.properties.objects), settings.normal_bias)
        except IvgError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return report_left_out(self, outcome, "IVG Light is on")
