# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects that a bake leaves out though they render.

Those that move, and take their light from the grid; and what only shows a grid (inspection_mark.py), without a word.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy

from ..core.report import Notice
from .inspection_mark import is_inspection

_BY_ITS_SETTING = "Leave Out of the Bake is set"


def is_left_out(thing: bpy.types.Object) -> bool:
    """Tell whether an object is left out."""
    return _by_its_setting(thing) or is_inspection(thing)


def _by_its_setting(thing: bpy.types.Object) -> bool:
    """Tell whether the user has said so; where the setting is not registered nobody has."""
    settings = getattr(thing, "ivg", None)
    return settings is not None and bool(settings.leave_out)


def left_out(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the objects of a scene that are left out, not those that it instances."""
    return [thing for thing in scene.objects if is_left_out(thing)]


class LeftOut:
    """Tells which instances of a depsgraph are left out: of objects that are, or made by them. Keeps their names."""

    def __init__(self) -> None:
        # Scenes may have a million instances, and are usually taken as a whole.
        self._any = any(is_left_out(thing) for thing in bpy.data.objects)
        self._names: dict[str, None] = {}

    def has(self, instance: bpy.types.DepsgraphObjectInstance) -> bool:
        """Tell whether an instance is left out."""
        if not self._any:
            return False
        for thing in (instance.object, instance.parent, instance.instance_object):
            if thing is not None and is_left_out(thing.original):
                if _by_its_setting(thing.original):
                    self._names[thing.name] = None
                return True
        return False

    def notices(self) -> Iterator[Notice]:
        """Yield what to say of the objects."""
        for name in self._names:
            yield Notice("left out", f"object '{name}'", _BY_ITS_SETTING)
