# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a grid still is that of its scene.

Only an export tells: its checksum is the grid's, or not. So the scene remembers the checksum of its last export (of a
bake, or of a check), and from then on a handler watches what Blender evaluates anew. What could change the light marks
the scene as changed, which is all that is done at a redraw or an edit.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from enum import Enum

import bpy
import numpy as np

from . import grid_image, grid_volume, light_modifier
from .inspection_mark import inspection_objects, is_inspection
from .left_out import is_left_out

LIT_TYPES = frozenset(
    {"MESH", "CURVE", "SURFACE", "FONT", "META", "CURVES", "POINTCLOUD", "LIGHT", "VOLUME", "GREASEPENCIL"}
)
_DATA = (
    *(bpy.types.Mesh, bpy.types.Curve, bpy.types.MetaBall, bpy.types.Curves, bpy.types.PointCloud),
    *(bpy.types.Light, bpy.types.Material, bpy.types.World, bpy.types.Image, bpy.types.Texture, bpy.types.Key),
    *(bpy.types.ShaderNodeTree, bpy.types.GeometryNodeTree, bpy.types.ParticleSettings),
)

_edits: dict[int, int] = {}
"""By scene: how often something that could change the light was evaluated anew."""
_inventories: dict[int, tuple[object, ...]] = {}
"""By scene: what is in it, when it was last looked at."""
_unnoticed = False
"""Whether what is evaluated now changes no light."""


class Freshness(Enum):
    """What is known of a scene's grid; the value is what the user is told."""

    FRESH = "Up to date with the scene"
    CHANGED = "The scene has changed since it was last compared with the grid, which may be stale"
    STALE = "Stale: geometry, lights or materials are not those that were baked"
    UNKNOWN = "Never compared with this scene: it may be stale"


def freshness(scene: bpy.types.Scene) -> Freshness | None:
    """Return what is known of a scene's grid, None if it has none that can be read. Fast enough for drawing."""
    settings = scene.ivg
    if settings.grid is None or grid_image.version_problem(settings.grid):
        return None
    if not settings.seen_checksum:
        return Freshness.UNKNOWN
    if settings.changed_since:
        return Freshness.CHANGED
    same = settings.seen_checksum == grid_image.record(settings.grid).checksum
    return Freshness.FRESH if same else Freshness.STALE


def edits(scene: bpy.types.Scene) -> int:
    """Return a number that grows with every edit of a scene: take it when the scene was read."""
    return _edits.get(scene.session_uid, 0)


def saw(scene: bpy.types.Scene, checksum: str, edits_then: int) -> None:
    """Remember what an export of a scene gave.

    Parameters
    ----------
    checksum
        `Scene.fingerprint` of the export.
    edits_then
        `edits` right after it.
    """
    _inventories[scene.session_uid] = _inventory(scene)
    scene.ivg.seen_checksum = checksum
    scene.ivg.changed_since = edits(scene) != edits_then


@contextmanager
def no_change_of_light(scene: bpy.types.Scene) -> Iterator[None]:
    """Edit what has no part in a bake of a scene, without being told that the grid may be stale."""
    global _unnoticed
    view_layer = bpy.context.view_layer if bpy.context.scene == scene else scene.view_layers[0]
    # What was edited before is noticed first.
    view_layer.update()
    try:
        yield
    finally:
        _unnoticed = True
        try:
            view_layer.update()
        finally:
            _unnoticed = False


@bpy.app.handlers.persistent
def watch(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
    """Mark a scene as changed when what was evaluated anew could change its light."""
    if _unnoticed:
        return
    rebuilt = depsgraph.id_type_updated("SCENE")
    another_grid = any(grid_volume.is_grid(update.id) for update in depsgraph.updates)
    if any(_matters(update, rebuilt, another_grid) for update in depsgraph.updates) or (
        rebuilt and _contents_changed(scene)
    ):
        edited(scene)


def edited(scene: bpy.types.Scene) -> None:
    """Mark a scene as changed."""
    _edits[scene.session_uid] = edits(scene) + 1
    if scene.ivg.seen_checksum and not scene.ivg.changed_since and scene.is_editable:
        scene.ivg.changed_since = True


def _matters(update: bpy.types.DepsgraphUpdate, rebuilt: bool, another_grid: bool) -> bool:
    """Tell whether an update could change light: selecting does not, nor do cameras and empties that move.

    Where Blender has `rebuilt` the relations between datablocks, it calls the shading of every object updated; where
    the volume has `another_grid`, objects whose modifier stores its light are updated, but not what light meets.
    """
    changed = update.id
    if is_inspection(changed):
        return False
    if isinstance(changed, bpy.types.Object):
        if changed.type == "VOLUME" and grid_volume.is_grid(changed.data):
            return False
        reshaped = update.is_updated_geometry and not (another_grid and light_modifier.of(changed) is not None)
        told = reshaped or update.is_updated_transform or (update.is_updated_shading and not rebuilt)
        lights_or_is_lit = changed.type in LIT_TYPES or changed.instance_type != "NONE"
        return told and lights_or_is_lit and not is_left_out(changed.original)
    if isinstance(changed, bpy.types.Image):
        return not grid_image.is_grid(changed)
    return isinstance(changed, _DATA)


def _contents_changed(scene: bpy.types.Scene) -> bool:
    """Tell whether objects came, went, or were hidden from renders; Blender tells of that as of selecting them."""
    now = _inventory(scene)
    before = _inventories.setdefault(scene.session_uid, now)
    _inventories[scene.session_uid] = now
    return now != before


def _inventory(scene: bpy.types.Scene) -> tuple[object, ...]:
    """Return what is in a scene and hidden from renders, but for what only shows a grid."""
    collections = scene.collection.children_recursive
    # Where nothing was ever made to show a grid, as in most files, no object need be asked.
    asked = any(is_inspection(collection) for collection in bpy.data.collections)
    shows = {shown.name for shown in inspection_objects(scene)} if asked else set()
    hidden = np.empty(len(scene.objects), dtype=bool)
    scene.objects.foreach_get("hide_render", hidden)
    hidden = np.delete(hidden, [scene.objects.find(name) for name in shows])
    return (
        np.packbits(hidden).tobytes(),
        len(hidden),
        tuple(collection.hide_render for collection in collections if not is_inspection(collection)),
        tuple(len(layer.objects) - sum(name in layer.objects for name in shows) for layer in scene.view_layers),
        scene.world.session_uid if scene.world else 0,
    )
