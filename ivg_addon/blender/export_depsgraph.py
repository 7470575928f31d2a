# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene evaluated as a render would, not as the viewport does.

`Context.evaluated_depsgraph_get` gives the viewport's evaluation: viewport subdivision levels,
modifiers that only show in the viewport, and without what is hidden there. There is no call for
the other one, so a render engine that draws nothing is asked to render, and is handed it. It
renders a copy of the scene that shares all its contents, so that the user's settings and last
render are not touched; only a scene with a rigid body world is rendered itself. (The way not
taken: switching every viewport setting to its render counterpart and back changes the user's data,
and misses nodes such as Is Viewport.)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from typing import Any, ClassVar, TypeVar

import bpy

from ..core.errors import SceneError

Result = TypeVar("Result")

_RESULT_IMAGE = "Render Result"
_FEATURES = ("compositing", "sequencer", "border", "multiview", "motion_blur", "freestyle")


class _Reader(bpy.types.RenderEngine):
    """A render engine whose only work is to read the scene."""

    bl_idname = "IVG_SCENE_READER"
    bl_label = "Irradiance Vector Grid scene reader"
    read: ClassVar[Callable[[bpy.types.Depsgraph, Callable[[], bool]], Any]]
    outcome: ClassVar[list[Any]]
    error: ClassVar[list[BaseException]]

    def render(self, depsgraph: bpy.types.Depsgraph) -> None:
        """Read; Blender would print an error and go on, so it is kept for the caller."""
        try:
            self.outcome.append(type(self).read(depsgraph, self.test_break))
        except BaseException as error:
            self.error.append(error)


def with_render_depsgraph(
    scene: bpy.types.Scene,
    view_layer: bpy.types.ViewLayer,
    read: Callable[[bpy.types.Depsgraph, Callable[[], bool]], Result],
) -> Result:
    """Evaluate a view layer with render settings and return what `read` makes of it.

    Parameters
    ----------
    read
        Called once, at once and on this thread, with the depsgraph and a function that tells
        whether the user asks to stop. Nothing of the depsgraph may be kept: it is freed afterwards.

    Raises
    ------
    SceneError
        When Blender cannot evaluate it: a render is running.
    """
    if bpy.app.is_job_running("RENDER"):
        raise SceneError("a render is running: wait until it is done, or cancel it")
    had_result = _RESULT_IMAGE in bpy.data.images
    _Reader.read, _Reader.outcome, _Reader.error = staticmethod(read), [], []
    # A rigid body world must not be copied: Blender 5.0 to 5.2 crash when the copy is freed.
    stage = _copy_of(scene) if scene.rigidbody_world is None else nullcontext(scene)
    with _registered(_Reader), stage as staged, _small_render(staged, view_layer.name):
        try:
            bpy.ops.render.render(scene=staged.name)
        except RuntimeError as error:
            raise SceneError(f"scene '{scene.name}' cannot be evaluated for rendering: {error}") from error
    if not had_result and _RESULT_IMAGE in bpy.data.images:
        bpy.data.images.remove(bpy.data.images[_RESULT_IMAGE])
    if _Reader.error:
        raise _Reader.error.pop()
    if not _Reader.outcome:
        raise SceneError(f"scene '{scene.name}' could not be evaluated for rendering: render it once to see why")
    outcome: Result = _Reader.outcome.pop()
    return outcome


@contextmanager
def _registered(engine: type[bpy.types.RenderEngine]) -> Iterator[None]:
    """Register a render engine for a moment, so that it never shows in the list of engines."""
    bpy.utils.register_class(engine)
    try:
        yield
    finally:
        bpy.utils.unregister_class(engine)


@contextmanager
def _copy_of(scene: bpy.types.Scene) -> Iterator[bpy.types.Scene]:
    """Make a copy of a scene that shares its objects."""
    copy = scene.copy()
    try:
        yield copy
    finally:
        bpy.data.scenes.remove(copy)


@contextmanager
def _small_render(scene: bpy.types.Scene, view_layer: str) -> Iterator[None]:
    """Set a scene so that it renders one view layer and next to no pixels, for a moment."""
    render = scene.render
    settings = {
        (scene, "camera"): scene.camera,
        (render, "engine"): _Reader.bl_idname,
        (render, "resolution_x"): 4,
        (render, "resolution_y"): 4,
        (render, "resolution_percentage"): 100,
        **{(render, f"use_{feature}"): False for feature in _FEATURES},
        # The operator's own choice of a layer is ignored where a scene is given.
        **{(layer, "use"): layer.name == view_layer for layer in scene.view_layers},
    }
    before = {setting: getattr(*setting) for setting in settings}
    camera = None
    try:
        if scene.camera is None:  # without one, Blender 5.0 refuses to render
            camera = bpy.data.cameras.new("")
            settings[scene, "camera"] = bpy.data.objects.new("", camera)
        for (owner, name), value in settings.items():
            setattr(owner, name, value)
        yield
    finally:
        stand_in = scene.camera
        for (owner, name), value in before.items():
            setattr(owner, name, value)
        if camera is not None:
            bpy.data.objects.remove(stand_in)
            bpy.data.cameras.remove(camera)
