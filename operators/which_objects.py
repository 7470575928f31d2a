# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators on objects and their materials have in common: which ones are meant."""

from __future__ import annotations

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
