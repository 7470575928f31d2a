# SPDX-License-Identifier: GPL-3.0-or-later
"""Export the scene's grid as an OpenVDB file."""

from __future__ import annotations

import bpy
from bpy.props import StringProperty

from ..ivg_addon.blender import storage
from ..ivg_addon.core.errors import IvgError


class IVG_OT_export_vdb(bpy.types.Operator):
    """Write one vector grid per direction and channel, one voxel per vertex."""

    bl_idname = "ivg.export_vdb"
    bl_label = "Export Irradiance Vector Grid as OpenVDB"
    bl_description = "Write the scene's grid as an OpenVDB file, one vector grid per direction and channel"
    bl_options = {"REGISTER"}
    __annotations__ = {
        "filepath": StringProperty(
            name="File",
            description="Where to write it",
            subtype="FILE_PATH",
            options={"PATH_SUPPORTS_BLEND_RELATIVE"},
        ),
        "filter_glob": StringProperty(default="*.vdb", options={"HIDDEN"}),
        "grid": StringProperty(
            name="Grid",
            description="Name of another grid in this file. Empty: the scene's",
            options={"SKIP_SAVE"},
        ),
    }

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where there is a grid."""
        if not storage.grids(bpy.data):
            cls.poll_message_set("There is no grid in this file")
            return False
        return True

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Ask for the file."""
        if not self.properties.is_property_set("filepath"):
            self.properties.filepath = storage.suggested_export(context.scene)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Write it."""
        try:
            path = storage.export_vdb(context.scene, self.properties.grid, self.properties.filepath)
        except IvgError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Wrote {path}")
        return {"FINISHED"}
