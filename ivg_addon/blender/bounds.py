# SPDX-License-Identifier: GPL-3.0-or-later
"""The grid's box and its voxels: from the scene, from an object, or as given."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import SceneError, SettingsError
from ..core.settings import Vec3
from .left_out import LeftOut

Float64 = NDArray[np.float64]
Resolution = tuple[int, int, int]

SURFACE_TYPES = frozenset({"MESH", "CURVE", "SURFACE", "META", "FONT"})
"""Object types that become triangles."""

EXACT_VERTICES = 500_000
"""The panel shows the scene's box at every redraw: so many vertices take a few milliseconds."""

AUTOMATIC_VERTICES = 2_000_000
"""The automatic resolution stays below this many vertices: 432 MB of irradiance vectors."""

SLACK = 1e-3
"""How far objects may reach out of a grid before it is said, as a share of the box's longest side: a part of a voxel,
where the light of the border is theirs too."""


@dataclass(frozen=True)
class Box:
    """An axis-aligned box in world space, metres."""

    low: Vec3
    high: Vec3

    @classmethod
    def between(cls, low: ArrayLike, high: ArrayLike) -> Box:
        """Return the box between two corners (3,)."""
        return cls(_vec3(low), _vec3(high))

    @classmethod
    def around(cls, points: Float64) -> Box:
        """Return the smallest box around points (n, 3), n ≥ 1."""
        return cls.between(points.min(axis=0), points.max(axis=0))

    def grown(self, margin: float) -> Box:
        """Return the box made larger by `margin` metres on every side."""
        return Box.between(np.asarray(self.low) - margin, np.asarray(self.high) + margin)

    @property
    def size(self) -> Vec3:
        """Return the lengths of the sides."""
        return _vec3(np.asarray(self.high) - np.asarray(self.low))


def _vec3(values: ArrayLike) -> Vec3:
    x, y, z = (float(value) for value in np.asarray(values))
    return x, y, z


def _in_world(points: Float64, matrix_world: bpy.types.Matrix) -> Float64:
    """Return points (n, 3) of an object's space in world space."""
    matrix = np.array(matrix_world, dtype=np.float64)
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def reaches_out(thing: bpy.types.Object, box: Box) -> bool:
    """Tell whether the box of an object in its own space lies partly out of a box, by more than `SLACK`."""
    corners = _in_world(np.array(thing.bound_box, dtype=np.float64), thing.matrix_world)
    beyond = SLACK * max(box.size)
    inside = (corners >= np.asarray(box.low) - beyond) & (corners <= np.asarray(box.high) + beyond)
    return not inside.all()


def scene_box(depsgraph: bpy.types.Depsgraph) -> Box:
    """Return a box around everything in an evaluated scene that is rendered as a surface.

    It is the smallest one up to `EXACT_VERTICES` vertices of turned meshes; of those beyond, the
    boxes in their own space are taken, so it may be larger than needed, never smaller. What is left
    out of the bake does not count.
    A bake takes the box of the triangles that it traces. Raises `SceneError` when nothing is
    rendered.
    """
    points = []
    left_out = LeftOut()
    vertices_left = EXACT_VERTICES
    for instance in depsgraph.object_instances:
        shown = instance.object
        if shown.type not in SURFACE_TYPES or not instance.show_self or shown.hide_render or left_out.has(instance):
            continue
        own = np.array(shown.bound_box, dtype=np.float64)
        if not np.isfinite(own).all() or not np.ptp(own, axis=0).any():
            continue
        if _is_turned(instance.matrix_world) and shown.type == "MESH":
            vertices = shown.data.vertices
            if 0 < len(vertices) <= vertices_left:
                vertices_left -= len(vertices)
                own = np.empty((len(vertices), 3), dtype=np.float32)
                vertices.foreach_get("co", own.reshape(-1))
        points.append(Box.around(_in_world(own, instance.matrix_world)))
    if not points:
        raise SceneError(
            f"scene '{depsgraph.scene.name}' has no surface that is rendered: add an object, or enable one in renders"
        )
    return Box.around(np.array([corner for box in points for corner in (box.low, box.high)]))


def _is_turned(matrix_world: bpy.types.Matrix) -> bool:
    """Tell whether a transform takes axes to other directions than axes."""
    return bool((np.abs(np.array(matrix_world.to_3x3())) > 1e-6).sum() > 3)


def object_box(bounds_object: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> Box:
    """Return the world-space box of an empty (its display size) or of an evaluated mesh.

    Raises `SettingsError` for an object that has no such box, or is not in the scene: a setting
    keeps an object that was deleted.
    """
    scene = depsgraph.scene
    if scene.objects.get(bounds_object.name) != bounds_object:
        raise SettingsError(f"bounds object '{bounds_object.name}' is not in scene '{scene.name}': choose another")
    if bounds_object.type == "EMPTY":
        size = bounds_object.empty_display_size
        corners = np.array(
            [(x, y, z) for x in (-size, size) for y in (-size, size) for z in (-size, size)],
            dtype=np.float64,
        )
        return Box.around(_in_world(corners, bounds_object.matrix_world))
    if bounds_object.type == "MESH":
        evaluated = bounds_object.evaluated_get(depsgraph)
        corners = np.array(evaluated.bound_box, dtype=np.float64)
        return Box.around(_in_world(corners, evaluated.matrix_world))
    raise SettingsError(
        f"bounds object '{bounds_object.name}' is a {bounds_object.type.lower()}: choose an empty or a mesh"
    )


def automatic_resolution(size: Vec3, longest_side: int) -> Resolution:
    """Return voxels along x, y, z that are close to cubes.

    Parameters
    ----------
    size
        Lengths of the box's sides; a box without any has one voxel.
    longest_side
        Voxels along the longest side; fewer where the grid would pass `AUTOMATIC_VERTICES`.
    """
    shares = np.maximum(size, 0.0) / max(*size, 1e-30)
    for voxels in range(longest_side, 0, -1):
        counts = np.maximum(np.rint(shares * voxels), 1).astype(int)
        if np.prod(counts + 1) <= AUTOMATIC_VERTICES:
            break
    x, y, z = (int(count) for count in counts)
    return x, y, z


def add_bounds_object(context: bpy.types.Context) -> bpy.types.Object:
    """Add an empty whose box is the scene's, select it, and make it the grid's bounds.

    Raises `SceneError` when nothing is rendered.
    """
    box = scene_box(context.evaluated_depsgraph_get())
    sides = np.asarray(box.size)
    added = bpy.data.objects.new("IVG Bounds", None)
    added.empty_display_type = "CUBE"
    added.empty_display_size = 1.0
    added.location = (np.asarray(box.low) + np.asarray(box.high)) / 2
    added.scale = np.maximum(sides, 0.01 * sides.max()) / 2
    context.collection.objects.link(added)
    for selected in context.selected_objects:
        selected.select_set(False)
    added.select_set(True)
    context.view_layer.objects.active = added
    settings = context.scene.ivg
    settings.bounds_mode = "OBJECT"
    settings.bounds_object = added
    settings.show_bounds = True
    return added
