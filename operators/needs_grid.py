# SPDX-License-Identifier: GPL-3.0-or-later
"""What operators on the scene's grid have in common: without one they are greyed out, and say why."""

from __future__ import annotations

import bpy


def poll_grid(operator: type[bpy.types.Operator], context: bpy.types.Context) -> bool:
    """Tell whether the scene has a grid in this file; if not, the operator's tooltip will say so."""
    if context.scene.ivg.grid is None:
        operator.poll_message_set("The scene has no grid in this file")
        return False
    return True
