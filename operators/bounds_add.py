# SPDX-License-Identifier: GPL-3.0-or-later
"""Add a box that the user can move: the grid's bounds."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender.bounds import add_bounds_object
from ..ivg_addon.core.errors import IvgError


class IVG_OT_bounds_add(bpy.types.Operator):
    """Add an empty and make it the bounds."""

    bl_idname = "ivg.bounds_add"
    bl_label = "Add Irradiance Vector Grid Bounds"
    bl_description = "Add an empty fitted to the scene, and use its box as the grid's bounds"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Objects are added in object mode."""
        if context.mode != "OBJECT":
            cls.poll_message_set("Bounds are added in object mode")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Add the empty, select it and show the box."""
        try:
            added = add_bounds_object(context)
        except IvgError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"The grid fills the box of '{added.name}'")
        return {"FINISHED"}
