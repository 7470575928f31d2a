# SPDX-License-Identifier: GPL-3.0-or-later
"""What the operators of the modifier have in common: on which objects they work, and what they say."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from ..ivg_addon.blender.light_modifier import TYPES, Outcome
from ..ivg_addon.core.report import counted

_MOST_NAMED = 3


def targets(context: bpy.types.Context, objects: str) -> Sequence[bpy.types.Object]:
    """Return the objects to work on."""
    if objects == "SELECTED":
        return list(context.selected_objects)
    return [each for each in context.scene.objects if each.type in TYPES]


def report_left_out(operator: bpy.types.Operator, outcome: Outcome, what: str) -> set[str]:
    """Report what was done and what was left out, and why; return the operator's result."""
    objects = counted(outcome.done, "object")
    left_out = [f"'{name}': {why}" for name, why in outcome.left_out.items()]
    if not outcome.done and not left_out:
        operator.report({"WARNING"}, "No object was changed: select some that are lit, or choose all")
        return {"CANCELLED"}
    if left_out:
        more = f", and {len(left_out) - _MOST_NAMED:,} more" if len(left_out) > _MOST_NAMED else ""
        operator.report({"WARNING"}, f"{what} {objects}. Left out: {'; '.join(left_out[:_MOST_NAMED])}{more}")
    else:
        operator.report({"INFO"}, f"{what} {objects}")
    return {"FINISHED"} if outcome.done else {"CANCELLED"}
