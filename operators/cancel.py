# SPDX-License-Identifier: GPL-3.0-or-later
"""Stop the job that runs in the window."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import jobs


class IVG_OT_cancel(bpy.types.Operator):
    """Ask the job to stop."""

    bl_idname = "ivg.cancel"
    bl_label = "Cancel"
    bl_description = "Stop what is running; the previous grid stays as it was"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only while something runs."""
        return jobs.current() is not None

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Ask the job to stop; the operator that runs it says so at its next tick."""
        jobs.cancel_current()
        return {"FINISHED"}
