# SPDX-License-Identifier: GPL-3.0-or-later
"""The box and the voxels that a bake would use, for the panel and the viewport.

Asked at every redraw, so the scene's box is kept until something changes, and in scenes of many
instances it is allowed to be a moment old.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import bpy

from ..core.errors import IvgError
from .bounds import Box, Resolution, automatic_resolution, object_box, scene_box

_SHARE_OF_TIME = 0.1
"""At most this share of the time goes into the scene's box while things move."""


@dataclass(frozen=True)
class Preview:
    """What a bake would fill: a box and its voxels, or a reason why there is none."""

    box: Box | None = None
    resolution: Resolution | None = None
    problem: str = ""


@dataclass
class _SceneBox:
    """The scene's box as it was computed last."""

    key: tuple[int, str] = (0, "")
    preview: Preview = Preview()
    stale: bool = True
    next_time: float = 0.0


_kept = _SceneBox()


def preview(context: bpy.types.Context) -> Preview:
    """Return what a bake of the context's scene would fill, without evaluating anything."""
    settings = context.scene.ivg
    depsgraph = context.view_layer.depsgraph
    if depsgraph is None:
        return Preview(problem="The scene has not been evaluated yet")
    if settings.bounds_mode == "SCENE":
        found = _scene_preview(context, depsgraph)
    elif settings.bounds_object is None:
        return Preview(problem="Choose an empty or a mesh, or add a bounds box")
    else:
        try:
            found = Preview(box=object_box(settings.bounds_object, depsgraph))
        except IvgError as error:
            return Preview(problem=str(error))
    if found.box is None:
        return found
    box = found.box.grown(settings.margin)
    if min(box.size) <= 0.0:
        return Preview(box=box, problem="The box has no volume: give it a margin")
    if settings.resolution_mode == "MANUAL":
        resolution: Resolution = tuple(settings.resolution)
    else:
        resolution = automatic_resolution(box.size, settings.longest_side)
    return Preview(box=box, resolution=resolution)


def _scene_preview(context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> Preview:
    """Return the box around the scene, as it is or was a moment ago."""
    key = (context.scene.session_uid, context.view_layer.name)
    now = time.perf_counter()
    if _kept.key != key or (_kept.stale and now >= _kept.next_time):
        try:
            _kept.preview = Preview(box=scene_box(depsgraph))
        except IvgError as error:
            _kept.preview = Preview(problem=str(error))
        _kept.key = key
        _kept.stale = False
        end = time.perf_counter()
        _kept.next_time = end + (end - now) / _SHARE_OF_TIME
    return _kept.preview


@bpy.app.handlers.persistent
def _scene_changed(*_: object) -> None:
    _kept.stale = True


_HANDLERS = ("depsgraph_update_post", "frame_change_post", "load_post", "undo_post", "redo_post")


def register() -> None:
    """Notice when something changes."""
    for name in _HANDLERS:
        getattr(bpy.app.handlers, name).append(_scene_changed)


def unregister() -> None:
    """Notice nothing any more."""
    for name in _HANDLERS:
        getattr(bpy.app.handlers, name).remove(_scene_changed)
