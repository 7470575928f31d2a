# SPDX-License-Identifier: GPL-3.0-or-later
"""What several operators need: without it they are greyed out, and their tooltips say why."""

from __future__ import annotations

import bpy

Operator = type[bpy.types.Operator]


def poll_grid(operator: Operator, context: bpy.types.Context) -> bool:
    """Tell whether the scene has a grid in this file."""
    if context.scene.ivg.grid is None:
        operator.poll_message_set("The scene has no grid in this file")
        return False
    return True


def poll_bake(operator: Operator, context: bpy.types.Context) -> bool:
    """Tell whether the scene was baked."""
    if not context.scene.ivg.last_bake.filepath:
        operator.poll_message_set("Nothing has been baked in this scene")
        return False
    return True


def poll_editable(operator: Operator, context: bpy.types.Context) -> bool:
    """Tell whether the scene itself can be changed."""
    if not context.scene.is_editable:
        operator.poll_message_set("The scene is linked from another file and cannot be changed")
        return False
    return True


def poll_no_render(operator: Operator) -> bool:
    """Tell whether no render is running, which reads materials."""
    if bpy.app.is_job_running("RENDER"):
        operator.poll_message_set("A render is running: wait until it is done, or cancel it")
        return False
    return True
