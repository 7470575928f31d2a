# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel that shows the scene's grid in the viewports, and makes meshes of what it shows."""

from __future__ import annotations

import bpy

from . import inspection_overlay
from .inspection_properties import LOOK_OF_KIND
from .panels import RenderPanel, align_names, draw_facts, draw_wrapped

_SHOWN = (
    ("SPHERES", "show_spheres", "MESH_UVSPHERE"),
    ("ARROWS", "show_arrows", "EMPTY_SINGLE_ARROW"),
    ("SLICE", "show_slice", "MESH_PLANE"),
)
"""Kind, switch, and the button's icon."""


class IVG_PT_inspection(RenderPanel, bpy.types.Panel):
    """What the viewports show of the scene's grid."""

    bl_label = "Inspect"
    bl_parent_id = "IVG_PT_grid"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Show it where there is a grid."""
        return context.scene.ivg.grid is not None

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the switches, how each thing looks, and what is shown."""
        layout = align_names(self.layout)
        settings = context.scene.ivg.inspection
        for kind, switch, icon in _SHOWN:
            header, body = layout.panel(f"IVG_{switch}", default_closed=True)
            header.use_property_split = False
            header.prop(settings, switch)
            header.operator("ivg.inspection_mesh", text="Make Mesh", icon=icon).kind = kind
            if body is not None:
                for name in LOOK_OF_KIND[kind]:
                    body.prop(settings, name)
        column = layout.column(heading="Show")
        column.prop(settings, "show_box")
        column.prop(settings, "show_unlit")
        layout.prop(settings, "exposure")
        if inspection_overlay.shows(context.scene):
            _draw_shown(layout, context)


def _draw_shown(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw how much of the grid is shown and how bright, or why it is not."""
    shown = inspection_overlay.view_of(context.scene)
    if isinstance(shown, str):
        draw_wrapped(layout, context, shown, icon="ERROR")
        return
    settings = context.scene.ivg.inspection
    draw_facts(
        layout,
        ("Vertices", shown.vertices_shown(settings.every)),
        ("Mean", f"{shown.mean:.3g} W/m²"),
        ("White", f"{1.0 / shown.gain(settings.exposure):.3g} W/m²"),
    )


CLASSES = (IVG_PT_inspection,)
