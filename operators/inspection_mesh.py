# SPDX-License-Identifier: GPL-3.0-or-later
"""Make an object that shows the scene's grid."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty

from ..ivg_addon.blender.inspection_mesh import KINDS, make_inspection_mesh
from ..ivg_addon.blender.inspection_properties import LOOK_OF_KIND, look_properties
from ..ivg_addon.blender.panels import align_names
from ..ivg_addon.core.errors import IvgError
from .needs import poll_grid


class IVG_OT_inspection_mesh(bpy.types.Operator):
    """Make spheres, arrows or a slice; what is not given is as in the panel."""

    bl_idname = "ivg.inspection_mesh"
    bl_label = "Make Irradiance Vector Grid Inspection Mesh"
    bl_description = (
        "Make an object that shows the grid in renders, in place of the one that was made before. It lights nothing, "
        "and bakes leave it out"
    )
    bl_options = {"REGISTER", "UNDO"}
    __annotations__ = {
        "kind": EnumProperty(name="Kind", description="What to make", items=KINDS, options={"SKIP_SAVE"}),
        **look_properties({"SKIP_SAVE"}),
    }

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Only where there is a grid, and objects can be added."""
        if context.mode != "OBJECT":
            cls.poll_message_set("Objects are added in object mode")
            return False
        return poll_grid(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Make it; what was not given is then in the redo panel as it was taken."""
        settings = context.scene.ivg.inspection
        for name in look_properties():
            if not self.properties.is_property_set(name):
                setattr(self.properties, name, getattr(settings, name))
        look = {name: getattr(self.properties, name) for name in look_properties()}
        try:
            made = make_inspection_mesh(context.scene, self.properties.kind, look)
        except IvgError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Made '{made.name}'")
        return {"FINISHED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw what matters for the kind."""
        layout = align_names(self.layout)
        for name in ("kind", *LOOK_OF_KIND[self.properties.kind], "exposure"):
            layout.prop(self.properties, name)
