# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel of the modifier "IVG Light": on and off at a click, and what hinders it on the selected objects."""

from __future__ import annotations

from itertools import islice

import bpy

from . import grid_image, light_modifier
from .modifier_nodes import ATTRIBUTE
from .panels import MOST_LOOKED_AT, MOST_SAID, RenderPanel, draw_wrapped


class IVG_PT_modifier(RenderPanel, bpy.types.Panel):
    """Light for things that move."""

    bl_label = "Geometry Nodes"
    bl_parent_id = "IVG_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the buttons, where the light is stored, and problems."""
        layout = self.layout
        for objects, text in (("SELECTED", "Selected"), ("ALL", "All")):
            row = layout.row(align=True)
            row.operator("ivg.modifier_add", text=f"Light {text} Objects", icon="GEOMETRY_NODES").objects = objects
            row.operator("ivg.modifier_remove", text="", icon="X").objects = objects
        if light_modifier.in_use():
            button = layout.operator("ivg.materials_add", text="Use in Materials of Selected", icon="MATERIAL")
            button.objects, button.light_from = "SELECTED", "MODIFIER"
            text = f"Irradiance is in the colour attribute '{ATTRIBUTE}'"
            draw_wrapped(layout, context, text, icon="INFO")
        image = context.scene.ivg.grid
        if image is not None and grid_image.version_problem(image):
            return
        found = light_modifier.problems(image, islice(context.selected_objects, MOST_LOOKED_AT))
        for problem in islice(found, MOST_SAID):
            draw_wrapped(layout, context, problem, icon="ERROR")


CLASSES = (IVG_PT_modifier,)
