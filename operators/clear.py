# SPDX-License-Identifier: GPL-3.0-or-later
"""Forget the last bake."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import outcome
from .needs import poll_bake


class IVG_OT_clear(bpy.types.Operator):
    """Forget the last bake but not its file."""

    bl_idname = "ivg.clear"
    bl_label = "Forget Irradiance Vector Grid"
    bl_description = "Forget the last bake; its grid file stays on disk"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only after a bake."""
        return poll_bake(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Forget it, and say which file stays."""
        path = context.scene.ivg.last_bake.filepath
        outcome.forget(context.scene.ivg.last_bake)
        outcome.forget(context.scene.ivg.last_compare)
        self.report({"INFO"}, f"Forgot the last bake; {path} is still there")
        return {"FINISHED"}
