# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender camera, as core's camera rays need it."""

from __future__ import annotations

import bpy
import numpy as np

from ..core.camera import Camera, PixelFilter, Projection
from ..core.errors import SceneError

_PROJECTIONS = {"PERSP": Projection.PERSPECTIVE, "ORTHO": Projection.ORTHOGRAPHIC}
_ONLY = "the comparison needs a perspective or an orthographic one"


def export_camera(depsgraph: bpy.types.Depsgraph, scene: bpy.types.Scene | None = None) -> Camera:
    """Return the scene's camera with the whole picture that a render of it has; no border, no depth of field.

    Parameters
    ----------
    depsgraph
        Where the camera is evaluated.
    scene
        Whose render settings count; the depsgraph's own when not given.

    Raises
    ------
    SceneError
        There is no camera, it is panoramic, or something else serves as one.
    """
    scene = scene or depsgraph.scene
    if scene.camera is None:
        raise SceneError(f"scene '{scene.name}' has no camera to compare from: add one (Ctrl Numpad 0 makes it active)")
    camera = scene.camera.evaluated_get(depsgraph)
    if camera.type != "CAMERA":
        raise SceneError(f"object '{camera.name}' serves as the camera but is none: {_ONLY}")
    data = camera.data
    if data.type not in _PROJECTIONS:
        raise SceneError(f"camera '{camera.name}' is of the type {data.type.lower()}: {_ONLY}")
    width, height = picture_size(scene)
    pixel_filter = PixelFilter(scene.cycles.pixel_filter_type)
    matrix = np.array(camera.matrix_world, dtype=np.float64)
    matrix[:3, :3] /= np.linalg.norm(matrix[:3, :3], axis=0)
    return Camera(
        name=camera.name,
        matrix=matrix,
        projection=_PROJECTIONS[data.type],
        frame=_frame(camera, depsgraph, scene),
        clip_start=data.clip_start,
        clip_end=data.clip_end,
        width=width,
        height=height,
        filter=pixel_filter,
        # Cycles does not use the width that is set for a box.
        filter_width=1.0 if pixel_filter is PixelFilter.BOX else scene.cycles.filter_width,
    )


def picture_size(scene: bpy.types.Scene) -> tuple[int, int]:
    """Return width and height of a render in pixels."""
    render = scene.render
    return (
        max(1, render.resolution_x * render.resolution_percentage // 100),
        max(1, render.resolution_y * render.resolution_percentage // 100),
    )


def hidden_from_camera(depsgraph: bpy.types.Depsgraph) -> frozenset[str]:
    """Return the names of objects, as `Scene.objects` has them, of which camera rays see no instance."""
    seen: set[str] = set()
    unseen: set[str] = set()
    for instance in depsgraph.object_instances:
        shown, parent = instance.object, instance.parent if instance.is_instance else None
        owner = (instance.instance_object if instance.is_instance else shown) or shown
        visible = shown.visible_camera and (parent is None or parent.visible_camera)
        (seen if visible else unseen).add(owner.name)
    return frozenset(unseen - seen)


def _frame(
    camera: bpy.types.Object, depsgraph: bpy.types.Depsgraph, scene: bpy.types.Scene
) -> tuple[float, float, float, float]:
    """Return left, right, bottom and top at depth 1 (perspective), or in metres (orthographic).

    Blender evaluates lens, sensor, shift and pixel aspect into a projection matrix M, which maps the frame's edges to
    ±1: x' = M₀₀ x + M₀₃ if orthographic, and x' = M₀₀ x/d − M₀₂ at depth d in perspective.
    """
    width, height = picture_size(scene)
    render = scene.render
    m = camera.calc_matrix_camera(
        depsgraph, x=width, y=height, scale_x=render.pixel_aspect_x, scale_y=render.pixel_aspect_y
    )
    perspective = camera.data.type == "PERSP"
    shift = (-m[0][2], -m[1][2]) if perspective else (m[0][3], m[1][3])
    left, right = ((edge - shift[0]) / m[0][0] for edge in (-1.0, 1.0))
    bottom, top = ((edge - shift[1]) / m[1][1] for edge in (-1.0, 1.0))
    return left, right, bottom, top
