# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel of the scene's grid: what it is, whether it is intact and up to date, and what can be done with it."""

from __future__ import annotations

import bpy

from ..core.errors import GridFileError
from . import grid_image, storage
from .panels import RenderPanel, align_names, draw_facts, draw_wrapped
from .staleness import Freshness, freshness
from .summary import created, voxels

_ICONS = {
    Freshness.FRESH: "CHECKMARK",
    Freshness.CHANGED: "INFO",
    Freshness.STALE: "ERROR",
    Freshness.UNKNOWN: "QUESTION",
}

_STATE_SHARE = 0.75
"""Of a panel's width, beside the button."""


class IVG_PT_grid(RenderPanel, bpy.types.Panel):
    """The grid that the .blend holds for this scene."""

    bl_label = "Grid"
    bl_parent_id = "IVG_PT_main"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Show it once the file has a grid."""
        return bool(context.scene.ivg.grid) or bool(storage.grids(bpy.data))

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the grid's facts, what is wrong with it, and the buttons."""
        layout = align_names(self.layout)
        layout.prop(context.scene.ivg, "grid")
        image = context.scene.ivg.grid
        if image is None:
            draw_wrapped(layout, context, "The next bake makes a new grid", icon="INFO")
            return
        wrong = storage.problem(image)
        if wrong:
            box = layout.box()
            draw_wrapped(box, context, wrong, icon="ERROR")
            if not image.library and not grid_image.version_problem(image):
                box.operator("ivg.restore", text="Restore", icon="FILE_REFRESH")
        self._draw_state(context, image)
        row = layout.row(align=True)
        row.operator("ivg.export_vdb", text="Export OpenVDB", icon="EXPORT")
        row.operator("ivg.grid_remove", text="", icon="TRASH")

    def _draw_state(self, context: bpy.types.Context, image: bpy.types.Image) -> None:
        """Draw when the grid was baked, and whether it still is that of the scene."""
        layout = self.layout
        try:
            state = freshness(context.scene)
            if state is None:
                return
            record = grid_image.record(image)
            draw_facts(
                layout,
                ("Baked", created(record)),
                ("Scene", record.scene),
                ("Voxels", voxels(record.settings.resolution)),
            )
        except GridFileError as error:
            draw_wrapped(layout, context, str(error), icon="ERROR")
            return
        if state is Freshness.FRESH:
            draw_wrapped(layout, context, state.value, icon=_ICONS[state])
            return
        split = layout.split(factor=_STATE_SHARE)
        draw_wrapped(split, context, state.value, icon=_ICONS[state], share=_STATE_SHARE)
        split.operator("ivg.check", text="Check")


CLASSES = (IVG_PT_grid,)
