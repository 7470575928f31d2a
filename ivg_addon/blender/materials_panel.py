# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel of the grid's light in materials."""

from __future__ import annotations

from itertools import islice

import bpy

from ..core.report import counted
from . import direct_light, material_light, scene_light, staleness, stored_light
from .grid_image import box, is_grid
from .panels import MOST_LOOKED_AT, MOST_SAID, RenderPanel, draw_wrapped

_outside: tuple[tuple[object, ...], str] = ((), "")
"""What objects outside of the grid were last, and for what: asked at every redraw."""


class IVG_PT_materials(RenderPanel, bpy.types.Panel):
    """The light of the scene's grid in materials."""

    bl_label = "Materials"
    bl_parent_id = "IVG_PT_grid"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the buttons, how many materials have the light, and whether it counts once."""
        layout = self.layout
        scene = context.scene
        lit = material_light.lit_materials()
        choice = layout.column()
        choice.use_property_split = True
        choice.use_property_decorate = False
        choice.row(align=True).prop(scene.ivg, "light_from", expand=True)
        row = layout.row(align=True)
        row.operator("ivg.materials_add", text="Add Light", icon="ADD")
        row.operator("ivg.materials_remove", text="Remove", icon="REMOVE")
        lost = [material for material in lit if material_light.grid_of(material) is None]
        if lost:
            materials = counted(len(lost), "material")
            told = f"The grid of {materials}, such as '{lost[0].name}', was removed: remove their light"
            draw_wrapped(layout, context, told, icon="ERROR")
        if scene.ivg.grid is not None and is_grid(scene.ivg.grid):
            draw_wrapped(layout, context, scene_light.summary(scene.ivg.grid), icon="INFO")
            told = scene_light.interpolation_message(scene)
            if lit and told:
                draw_wrapped(layout, context, told, icon="INFO")
            told = _outside_message(scene)
            if lit and told:
                draw_wrapped(layout, context, told, icon="INFO")
        selected = islice(context.selected_objects, MOST_LOOKED_AT)
        for problem in islice(stored_light.problems(selected, material_light.takes_stored), MOST_SAID):
            draw_wrapped(layout, context, problem, icon="ERROR")
        if direct_light.is_direct_only(scene):
            layout.operator("ivg.direct_only_end", text="Switch Indirect Light Back On", icon="LOOP_BACK")
        else:
            layout.operator("ivg.direct_only", text="Switch Indirect Light Off", icon="LIGHT_SUN")
        if lit and direct_light.counts_twice(scene):
            told = "Indirect light counts twice: it is also computed by the render engine"
            draw_wrapped(layout, context, told, icon="ERROR")


def _outside_message(scene: bpy.types.Scene) -> str:
    """Return what is to be said of objects outside of the scene's grid; computed anew after edits."""
    global _outside
    image = scene.ivg.grid
    key = (scene.session_uid, staleness.edits(scene), box(image), len(scene.objects))
    if _outside[0] != key:
        _outside = (key, scene_light.outside_message(scene_light.objects_outside(scene, image)))
    return _outside[1]


CLASSES = (IVG_PT_materials,)
