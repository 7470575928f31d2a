# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators on materials have in common: whose materials, and that no render reads them."""

from __future__ import annotations

import bpy
from bpy.props import EnumProperty


def which_objects(description: str) -> object:
    """Return the property that tells whose materials are meant."""
    return EnumProperty(
        name="Objects",
        description=description,
        items=(
            ("ALL", "All", "Those of all objects of the scene, and of what they show instances of", 0),
            ("SELECTED", "Selected", "Those of the selected objects only", 1),
        ),
        default="ALL",
        options={"SKIP_SAVE"},
    )


def poll_no_render(operator: type[bpy.types.Operator]) -> bool:
    """Tell whether no render is running; if one is, the operator's tooltip will say so."""
    if bpy.app.is_job_running("RENDER"):
        operator.poll_message_set("A render is running: wait until it is done, or cancel it")
        return False
    return True
