# SPDX-License-Identifier: GPL-3.0-or-later
"""Check whether the scene's grid still is that of the scene."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import jobs
from ..ivg_addon.blender.asking import Asker
from ..ivg_addon.blender.check_job import check_job
from .job_operator import JobOperator
from .needs import poll_grid


class IVG_OT_check(JobOperator):
    """Check the scene's grid, blocking or in the window."""

    bl_idname = "ivg.check"
    bl_label = "Check Irradiance Vector Grid"
    bl_description = "Compare the scene with what was baked, and the grid's pixels with those that were stored"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where there is a grid."""
        return super().poll(context) and poll_grid(cls, context)

    def make_job(self, context: bpy.types.Context, run: jobs.Runner, ask: Asker) -> jobs.Job:
        """Return the check."""
        return check_job(context, run, ask)
