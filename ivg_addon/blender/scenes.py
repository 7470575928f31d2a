# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding a scene again after a long job, in which undo may have moved it in memory."""

from __future__ import annotations

import bpy

from ..core.errors import SceneError


def find_scene(name: str, identity: int, done: str) -> bpy.types.Scene:
    """Return the scene with a `session_uid`; raises `SceneError` if it was removed while something was `done`."""
    for scene in bpy.data.scenes:
        if scene.session_uid == identity:
            return scene
    raise SceneError(f"scene '{name}' was removed while it was {done}: nothing was saved")
