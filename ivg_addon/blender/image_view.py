# SPDX-License-Identifier: GPL-3.0-or-later
"""Showing a picture that was written, as Blender shows a render."""

from __future__ import annotations

import functools
from pathlib import Path

import bpy

_REDRAW_SECONDS = 0.3


def show_image(context: bpy.types.Context, path: Path) -> None:
    """Load a picture, or load it anew, and show it: in an open image editor, else in a window."""
    image = bpy.data.images.load(str(path), check_existing=True)
    image.reload()
    area = _image_editor(context)
    if area is None:
        bpy.ops.wm.window_new()
        area = context.window_manager.windows[-1].screen.areas[0]
        area.type = "IMAGE_EDITOR"
    area.spaces.active.image = image
    # The editor gets its size at the next redraw: only then can the picture be fitted into it.
    bpy.app.timers.register(functools.partial(_fit, image.name), first_interval=_REDRAW_SECONDS)


def _fit(name: str) -> None:
    """Fit a picture into the editors that show it; the user may have closed them already."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type != "IMAGE_EDITOR":
                continue
            shown = area.spaces.active.image
            if shown is not None and shown.name == name:
                region = next(region for region in area.regions if region.type == "WINDOW")
                with bpy.context.temp_override(window=window, area=area, region=region):
                    bpy.ops.image.view_all(fit_view=True)


def _image_editor(context: bpy.types.Context) -> bpy.types.Area | None:
    """Return the largest image editor that is open, if any."""
    areas = [
        area
        for window in context.window_manager.windows
        for area in window.screen.areas
        if area.type == "IMAGE_EDITOR" and area.ui_type == "IMAGE_EDITOR"
    ]
    return max(areas, key=lambda area: area.width * area.height, default=None)
