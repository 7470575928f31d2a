# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel of an object's own settings, in the Object properties."""

from __future__ import annotations

import bpy

from .panels import align_names
from .staleness import LIT_TYPES


class IVG_PT_object(bpy.types.Panel):
    """Whether bakes know the object."""

    bl_label = "Irradiance Vector Grid"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "object"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Show it for what could change the light."""
        thing = context.object
        return thing is not None and (thing.type in LIT_TYPES or thing.instance_type != "NONE")

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the setting."""
        layout = align_names(self.layout)
        layout.prop(context.object.ivg, "leave_out")


CLASSES = (IVG_PT_object,)
