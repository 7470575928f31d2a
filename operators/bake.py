# SPDX-License-Identifier: GPL-3.0-or-later
"""Bake the scene's indirect light."""

from __future__ import annotations

import bpy

from ..ivg_addon.blender import jobs
from ..ivg_addon.blender.asking import Asker
from ..ivg_addon.blender.bake_job import bake_job
from ..ivg_addon.blender.properties import override_properties
from .job_operator import JobOperator


class IVG_OT_bake(JobOperator):
    """Bake, blocking or in the window, with the scene's settings unless others are given."""

    bl_idname = "ivg.bake"
    bl_label = "Bake Irradiance Vector Grid"
    bl_description = "Precompute the scene's indirect light into a grid of irradiance vectors"
    # Without REGISTER: the redo panel would bake again at every change of a setting.
    bl_options = {"UNDO"}
    __annotations__ = override_properties()

    def make_job(self, context: bpy.types.Context, run: jobs.Runner, ask: Asker) -> jobs.Job:
        """Return the bake, with what the call says in place of the scene's settings."""
        given = {name: getattr(self, name) for name in override_properties() if self.properties.is_property_set(name)}
        return bake_job(context, given, run, ask)
