# SPDX-License-Identifier: GPL-3.0-or-later
"""Compare the last bake with Cycles."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import jobs
from ..ivg_addon.blender.asking import Asker
from ..ivg_addon.blender.compare_job import CompareRequest, compare_job, picture_of
from ..ivg_addon.blender.grid_store import absolute
from ..ivg_addon.blender.image_view import show_image
from ..ivg_addon.blender.storage import baked_file
from .job_operator import JobOperator


class IVG_OT_compare(JobOperator):
    """Compare, with the scene's look-up settings."""

    bl_idname = "ivg.compare"
    bl_label = "Compare Irradiance Vector Grid with Cycles"
    bl_description = "Render the camera's view by Cycles and by the baked grid, and tell how far they differ"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only after a bake, and with a camera."""
        if not super().poll(context):
            return False
        if not (context.scene.ivg.grid or context.scene.ivg.last_bake.filepath):
            cls.poll_message_set("Bake the scene first")
            return False
        if context.scene.camera is None:
            cls.poll_message_set("The scene has no camera")
            return False
        return True

    def make_job(self, context: bpy.types.Context, run: jobs.Runner, ask: Asker) -> jobs.Job:
        """Return the comparison."""
        stored = context.scene.ivg.grid is not None
        file = baked_file(context.scene)
        return compare_job(context, CompareRequest(None if stored else file, picture_of(file)), run, ask)

    def show_result(self, context: bpy.types.Context) -> None:
        """Show the picture as Blender shows a render."""
        show_image(context, absolute(context.scene.ivg.last_compare.filepath))
