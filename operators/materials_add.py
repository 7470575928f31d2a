# SPDX-License-Identifier: GPL-3.0-or-later
"""Add the light of the scene's grid to materials."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import scene_light
from ..ivg_addon.blender.properties import light_from_property
from ..ivg_addon.core.errors import IvgError
from ..ivg_addon.core.report import counted
from .needs import poll_grid, poll_no_render
from .which_objects import which_objects


class IVG_OT_materials_add(bpy.types.Operator):
    """Add the grid's light to the materials of all objects, or of the selected ones."""

    bl_idname = "ivg.materials_add"
    bl_label = "Add Irradiance Vector Grid to Materials"
    bl_description = (
        "Let materials have the indirect light of the scene's grid, or bring it up to date where they were edited"
    )
    bl_options = {"REGISTER", "UNDO"}
    __annotations__ = {
        "objects": which_objects("Objects whose materials get the light"),
        "light_from": light_from_property({"SKIP_SAVE"}),
    }

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where there is a grid, and not while a render reads the materials."""
        return poll_grid(cls, context) and poll_no_render(cls)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add it, and name what has none; what was not given is then in the redo panel as it was taken."""
        if not self.properties.is_property_set("light_from"):
            self.light_from = context.scene.ivg.light_from
        try:
            lit = scene_light.add(context, self.objects == "SELECTED", self.light_from)
        except IvgError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        for notice in lit.notices:
            self.report({"WARNING"}, f"{notice.subject} {notice.message}")
        self.report({"INFO"}, f"{counted(lit.materials, 'material')} with the light of '{context.scene.ivg.grid.name}'")
        return {"FINISHED"}
