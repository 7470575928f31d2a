# SPDX-License-Identifier: GPL-3.0-or-later
"""Copy the last bake's summary."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import outcome
from .needs import poll_bake


class IVG_OT_copy_summary(bpy.types.Operator):
    """Put the last bake's summary on the clipboard."""

    bl_idname = "ivg.copy_summary"
    bl_label = "Copy Irradiance Vector Grid Summary"
    bl_description = "Copy the last bake's summary and notices to the clipboard as text"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only after a bake."""
        return poll_bake(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Copy it."""
        context.window_manager.clipboard = outcome.text(context.scene.ivg.last_bake)
        self.report({"INFO"}, "Copied the summary of the last bake")
        return {"FINISHED"}
