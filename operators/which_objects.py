# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators on objects and their materials have in common: which ones, and that no render reads them."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty


def which_objects(description: str, default: str = "ALL") -> object:
    """Return the property that tells which objects are meant."""
    return EnumProperty(
        name="Objects",
        description=description,
        items=(
            ("ALL", "All", "All objects of the scene", 0),
            ("SELECTED", "Selected", "The selected objects only", 1),
        ),
        default=default,
        options={"SKIP_SAVE"},
    )


def poll_no_render(operator: type[bpy.types.Operator]) -> bool:
    """Tell whether no render is running; if one is, the operator's tooltip will say so."""
    if bpy.app.is_job_running("RENDER"):
        operator.poll_message_set("A render is running: wait until it is done, or cancel it")
        return False
    return True
