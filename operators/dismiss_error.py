# SPDX-License-Identifier: GPL-3.0-or-later
"""Take an error message out of the panel."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import jobs


class IVG_OT_dismiss_error(bpy.types.Operator):
    """Forget why the last job failed."""

    bl_idname = "ivg.dismiss_error"
    bl_label = "Dismiss"
    bl_description = "Do not show this message any longer"
    bl_options = {"INTERNAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Forget the error."""
        jobs.forget_error()
        return {"FINISHED"}
