# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel "Irradiance Vector Grid" in the Render properties, and the menu that F3 searches."""

from __future__ import annotations

import textwrap
from typing import Any

import bpy

from ..core.grid import grid_bytes
from . import jobs
from .bounds_preview import preview
from .grid_store import default_grid_name
from .summary import count, duration, memory, voxels

NOTICE_ICONS = {"simplified": "INFO", "left out": "CANCEL", "warning": "ERROR"}
UNSAVED = "This file was never saved: the grid is kept in the extension's own folder"
_LABEL_SHARE = 0.4
"""Of a panel's width, as Blender splits names and values of properties."""
MOST_LOOKED_AT = 100
"""Selected objects that are looked at whenever a panel is drawn."""
MOST_SAID = 3
"""Problems of theirs that a panel tells."""
LINE_SCALE = 0.8
"""Height of a line of text, of a button's."""
_CHARACTER_WIDTH = 5.7
"""Of the interface's font, roughly, in pixels at a scale of one."""


def draw_wrapped(
    layout: bpy.types.UILayout,
    context: bpy.types.Context,
    text: str,
    icon: str = "NONE",
    share: float = 1.0,
) -> None:
    """Draw text in as many lines as a share of the region's width needs, an icon at the first."""
    pixels = context.region.width / context.preferences.system.ui_scale - 80
    width = int(share * pixels / _CHARACTER_WIDTH)
    column = layout.column(align=True)
    column.scale_y = LINE_SCALE
    for index, line in enumerate(textwrap.wrap(text, max(width, 20))):
        blank = "NONE" if icon == "NONE" else "BLANK1"
        column.label(text=line, icon=blank if index else icon, translate=False)


def align_names(layout: bpy.types.UILayout) -> bpy.types.UILayout:
    """Have names of properties drawn in a column before their values, and return the layout."""
    layout.use_property_split = True
    # None of them can be animated.
    layout.use_property_decorate = False
    return layout


class RenderPanel:
    """Where all these panels are: in the Render properties, whatever the engine."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"


class IVG_PT_main(RenderPanel, bpy.types.Panel):
    """Bake, its progress, and where the grid goes."""

    bl_label = "Irradiance Vector Grid"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the buttons, or the progress of what they started."""
        layout = self.layout
        settings = context.scene.ivg
        job = jobs.current()
        if job is not None:
            _draw_progress(layout, job)
        else:
            _draw_buttons(layout, context)
        error = jobs.last_error()
        if error:
            box = layout.box()
            row = box.row()
            draw_wrapped(row, context, error, icon="ERROR")
            row.operator("ivg.dismiss_error", text="", icon="X", emboss=False)
        align_names(layout)
        layout.prop(
            settings,
            "filepath",
            text="File",
            placeholder=default_grid_name(context.scene),
        )
        if not settings.filepath and not bpy.data.filepath:
            draw_wrapped(layout, context, UNSAVED, icon="INFO")


def _draw_buttons(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """Draw what can be started, and if baking cannot, why."""
    problem = preview(context).problem
    column = layout.column(align=True)
    bake = column.row(align=True)
    bake.scale_y = 1.4
    bake.enabled = not problem
    bake.operator("ivg.bake", text="Bake", icon="LIGHTPROBE_VOLUME")
    compare = column.row(align=True)
    compare.enabled = bool(context.scene.ivg.grid or context.scene.ivg.last_bake.filepath)
    compare.operator("ivg.compare", text="Compare with Cycles", icon="IMAGE_ALPHA")
    if problem:
        draw_wrapped(layout, context, problem, icon="INFO")


def _draw_progress(layout: bpy.types.UILayout, job: jobs.Job) -> None:
    """Draw how far a job is, what it does now, and the button that stops it."""
    progress = job.progress
    left = progress.seconds_left
    row = layout.row(align=True)
    row.scale_y = 1.4
    row.progress(
        factor=progress.fraction,
        text=f"{progress.task}  {progress.fraction:.0%}",
        translate=False,
    )
    row.operator("ivg.cancel", text="", icon="X")
    layout.label(
        text=f"{job.label}: {'' if left is None else duration(left) + ' left, '}Esc cancels",
        translate=False,
    )


class IVG_PT_bounds(RenderPanel, bpy.types.Panel):
    """Which box the grid fills, and with how many voxels."""

    bl_label = "Bounds"
    bl_parent_id = "IVG_PT_main"

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        """Draw the switch of the viewport's box."""
        shown = context.scene.ivg.show_bounds
        self.layout.prop(
            context.scene.ivg,
            "show_bounds",
            text="",
            icon="HIDE_OFF" if shown else "HIDE_ON",
            emboss=False,
        )

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the box's settings and what comes of them."""
        layout = align_names(self.layout)
        settings = context.scene.ivg
        layout.row().prop(settings, "bounds_mode", expand=True)
        if settings.bounds_mode == "OBJECT":
            row = layout.row(align=True)
            row.prop(settings, "bounds_object")
            row.operator("ivg.bounds_add", text="", icon="ADD")
        else:
            split = layout.split(factor=_LABEL_SHARE)
            split.column()
            split.operator("ivg.bounds_add", text="Add Bounds", icon="CUBE")
        layout.prop(settings, "margin")
        layout.separator()
        layout.row().prop(settings, "resolution_mode", expand=True)
        if settings.resolution_mode == "AUTO":
            layout.prop(settings, "longest_side")
        else:
            layout.column().prop(settings, "resolution")
        found = preview(context)
        if found.box is None or found.resolution is None:
            return
        system = context.scene.unit_settings.system
        sides = (bpy.utils.units.to_string(system, "LENGTH", side, precision=3).strip() for side in found.box.size)
        draw_facts(
            layout,
            ("Size", " × ".join(sides)),
            ("Grid", f"{voxels(found.resolution)} voxels"),
            ("Memory", memory(grid_bytes(found.resolution))),
        )


def draw_facts(layout: bpy.types.UILayout, *facts: tuple[str, str]) -> None:
    """Draw names and values that cannot be edited, aligned with the properties."""
    column = layout.column(align=True)
    column.scale_y = LINE_SCALE
    for name, value in facts:
        row = column.split(factor=_LABEL_SHARE)
        label = row.row()
        label.alignment = "RIGHT"
        label.active = False
        label.label(text=name)
        row.label(text=value, translate=False)


class IVG_PT_sampling(RenderPanel, bpy.types.Panel):
    """How many photons, and how they are counted."""

    bl_label = "Photons"
    bl_parent_id = "IVG_PT_main"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the photons' settings."""
        layout = align_names(self.layout)
        settings = context.scene.ivg
        layout.prop(settings, "photons")
        draw_facts(layout, ("", count(settings.photons)))
        layout.prop(settings, "bounces")
        layout.prop(settings, "seed")
        layout.prop(settings, "threads")
        layout.prop(settings, "estimator")
        layout.prop(settings, "include_direct")


class IVG_PT_look_up(RenderPanel, bpy.types.Panel):
    """How irradiance is read from the grid."""

    bl_label = "Look-Up"
    bl_parent_id = "IVG_PT_main"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the interpolations."""
        layout = align_names(self.layout)
        settings = context.scene.ivg
        layout.prop(settings, "spatial")
        layout.prop(settings, "directional")
        layout.prop(settings, "normal_bias")


class IVG_UL_notices(bpy.types.UIList):
    """The notices of the last bake, a line each."""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: Any,
        item: Any,
        icon: int,
        active_data: Any,
        active_property: str,
    ) -> None:
        """Draw one notice."""
        layout.label(text=f"{item.subject}: {item.message}", icon=NOTICE_ICONS[item.kind])


class IVG_PT_last_bake(RenderPanel, bpy.types.Panel):
    """What the last bake did."""

    bl_label = "Last Bake"
    bl_parent_id = "IVG_PT_main"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Show it only after a bake."""
        return bool(context.scene.ivg.last_bake.rows)

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        """Draw what can be done with the summary."""
        row = self.layout.row(align=True)
        row.operator("ivg.copy_summary", text="", icon="COPYDOWN", emboss=False)
        row.operator("ivg.clear", text="", icon="TRASH", emboss=False)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the summary and the notices."""
        _draw_outcome(self.layout, context, "last_bake")
        if not context.scene.ivg.last_bake.notices:
            self.layout.label(text="Nothing was simplified or left out", icon="CHECKMARK")


class IVG_PT_last_compare(RenderPanel, bpy.types.Panel):
    """How the grid compared with Cycles."""

    bl_label = "Last Comparison"
    bl_parent_id = "IVG_PT_main"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """Show it only after a comparison of the last bake."""
        return bool(context.scene.ivg.last_compare.rows)

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the numbers and the notices."""
        _draw_outcome(self.layout, context, "last_compare")


def _draw_outcome(layout: bpy.types.UILayout, context: bpy.types.Context, name: str) -> None:
    """Draw a summary's rows, a label and a value each, and its notices, the active one in full."""
    outcome = getattr(context.scene.ivg, name)
    rows = [(row.name, row.value) for row in outcome.rows]
    if outcome.filepath:
        rows.insert(0, ("File", outcome.filepath))
    column = layout.column(align=True)
    for label, value in rows:
        split = column.split(factor=0.2)
        left = split.column(align=True)
        left.scale_y = LINE_SCALE
        left.active = False
        left.label(text=label)
        draw_wrapped(split, context, value, share=0.8)
    notices = outcome.notices
    if not notices:
        return
    layout.template_list("IVG_UL_notices", name, outcome, "notices", outcome, "active_notice", rows=3)
    if outcome.active_notice < len(notices):
        active = notices[outcome.active_notice]
        draw_wrapped(layout, context, active.name, icon=NOTICE_ICONS[active.kind])


class IVG_MT_main(bpy.types.Menu):
    """Everything that can be done with irradiance vector grids."""

    bl_label = "Irradiance Vector Grid"

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the operators."""
        layout = self.layout
        layout.operator("ivg.bake", icon="LIGHTPROBE_VOLUME")
        layout.operator("ivg.compare", icon="IMAGE_ALPHA")
        layout.operator("ivg.check", icon="CHECKMARK")
        layout.separator()
        layout.operator("ivg.materials_add", icon="MATERIAL")
        layout.operator("ivg.materials_remove", icon="MATERIAL")
        layout.operator("ivg.direct_only", icon="LIGHT_SUN")
        layout.operator("ivg.direct_only_end", icon="LOOP_BACK")
        layout.separator()
        layout.operator("ivg.export_vdb", icon="EXPORT")
        layout.operator_menu_enum("ivg.inspection_mesh", "kind", icon="MESH_UVSPHERE")
        layout.operator("ivg.restore", icon="FILE_REFRESH")
        layout.operator("ivg.grid_remove", icon="TRASH")
        layout.separator()
        layout.operator("ivg.modifier_add", icon="GEOMETRY_NODES")
        layout.operator("ivg.modifier_remove", icon="X")
        layout.separator()
        layout.operator("ivg.bounds_add", icon="CUBE")
        layout.operator("ivg.copy_summary", icon="COPYDOWN")
        layout.operator("ivg.clear", icon="TRASH")


def draw_menu(menu: bpy.types.Menu, context: bpy.types.Context) -> None:
    """Draw the entry in the top bar's Render menu; F3 finds what menus hold."""
    menu.layout.separator()
    menu.layout.menu("IVG_MT_main")


CLASSES = (
    IVG_UL_notices,
    IVG_PT_bounds,
    IVG_PT_sampling,
    IVG_PT_look_up,
    IVG_PT_last_bake,
    IVG_PT_last_compare,
    IVG_MT_main,
)
"""All but the main panel, in which they are."""
