# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights whose nodes are no constant: IES profiles, slides, textures, blackbodies. Cycles measures them.

A copy of the light shines alone on a scene of small quads, and what they receive is the light's pattern:

    point, spot   quads in all directions of its cone, one metre away, that face it as an exact point
    area          quads before each place of it, one metre away, lit by a spread of zero: straight on
    sun           one quad

A Light Falloff node that is the strength of all that shines is read. What else a pattern cannot hold is said: a light
that looks different from different directions, or falls off otherwise, is taken as it is from one metre away.
"""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial

import bpy
import mathutils
import numpy as np
from numpy.typing import NDArray

from ..core.lights import Pattern
from ..core.progress import Progress
from ..core.report import Notice
from .asking import Asker, Find, here
from .cycles_stage import removed
from .emission_nodes import constant_emission
from .export_colours import ColourReader, Notes
from .export_images import ImageTable
from .ground_truth import bake_irradiance
from .jobs import PatientSteps, Steps
from .left_out import is_left_out
from .light_content import light_key, nodes_in
from .light_falloff import knows_distance, read_falloff

Float64 = NDArray[np.float64]

_ROWS_AROUND, _COLUMNS_AROUND = 180, 360
"""Texels of a point's pattern: one degree; and of a spot's cone."""
_ROWS_ACROSS = 256
"""Texels of an area light's pattern along each side."""
_EVEN = 1e-3
"""Relative difference up to which a pattern is a constant: above the noise of single precision."""
_KEPT = 64
"""Lights that are remembered."""
_IN_WORLD_SPACE = {"OBJECT_INFO", "CAMERA", "ATTRIBUTE", "VECT_TRANSFORM"}
_OF_THE_SHAPE = {"Parametric", "Backfacing", "Pointiness", "Random Per Island"}
_BY_DIRECTION = {"LAYER_WEIGHT", "FRESNEL"}

_known: OrderedDict[str, NDArray[np.float32]] = OrderedDict()
"""Patterns that were measured in this session, by content."""


@dataclass(frozen=True)
class NodeLight:
    """What Cycles found of a light's nodes.

    Parameters
    ----------
    colour : (3,) float64
        What they multiply the light by, where it shines evenly; else one.
    pattern
        What they multiply it by else, the fading of a spot's cone included.
    half_angle
        The angle that the pattern reaches out to; of no meaning without one, or for an area light.
    notices
        What the pattern cannot hold.
    falloff, smooth
        k and s of `core.falloff`.
    """

    colour: Float64
    pattern: Pattern | None
    half_angle: float
    notices: tuple[Notice, ...]
    falloff: int = 0
    smooth: float = 0.0


@dataclass(frozen=True)
class _Conditions:
    """What of the scene a measurement depends on."""

    frame: int
    shading_system: bool


def uses_nodes(light: bpy.types.Light) -> bool:
    """Tell whether a light's node tree counts; from Blender 5.2 on it always does."""
    if light.node_tree is None:
        return False
    return bool(light.bl_rna.properties["use_nodes"].is_deprecated or light.use_nodes)


def frame(matrix: Float64) -> Float64:
    """Return the orthonormal axes (3, 3), as columns, that a light's pattern lies in."""
    z = matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
    x = matrix[:3, 0] - z * (z @ matrix[:3, 0])
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    return np.stack([x, math.copysign(1.0, y @ matrix[:3, 1]) * y, z], axis=1)


def half_angle(light: bpy.types.Light, matrix: Float64) -> float:
    """Return the angle from its axis out to which a point or spot shines, in world space."""
    if light.type != "SPOT":
        return math.pi
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    across, along = math.sin(0.5 * light.spot_size) * lengths[:2].max(), math.cos(0.5 * light.spot_size) * lengths[2]
    return math.atan2(across, max(along, 0.0))


def light_node_steps(
    scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, ask: Asker = here
) -> PatientSteps[dict[str, NodeLight]]:
    """Measure the lights of a scene whose nodes are no constant; return what was found by the objects' full names.

    The file is as it was whenever this yields, ends or fails.

    Raises
    ------
    SceneError
        Cycles cannot bake.
    """
    found: dict[str, NodeLight] = {}
    made: dict[str, tuple[Float64, Pattern | None]] = {}
    if not hasattr(scene, "cycles"):
        return found
    conditions = _Conditions(scene.frame_current, scene.cycles.shading_system)
    lights = [shown for shown in _lights(scene) if _varies(shown.data)]
    if lights:
        view_layer.update()  # places of objects are those of the last evaluation
    # All that is needed of the scene, before the user can change it.
    asked = [
        (shown.name_full, shown.name, matrix)
        for shown in lights
        if np.isfinite(matrix := _matrix(shown)).all() and abs(np.linalg.det(matrix[:3, :3])) > 0.0
    ]
    for index, (full_name, name, matrix) in enumerate(asked):
        find = partial(_found_light, full_name)
        task = f"Evaluating light '{name}' by Cycles ({index + 1} of {len(asked)})"
        key = next((light_key(light, matrix, conditions.frame, conditions.shading_system) for light in find()), "")
        if key and key not in _known:
            _known[key] = yield from ask(_measure, find, task, name, matrix, conditions)
        for light in find() if key else ():
            _known.move_to_end(key)
            while len(_known) > _KEPT:
                _known.popitem(last=False)
            if key not in made:
                made[key] = _colour_or_pattern(light, matrix, _known[key])
            found[full_name] = _node_light(name, light, *made[key], half_angle(light, matrix))
    return found


def _found_light(name: str) -> list[bpy.types.Light]:
    """Return the light of an object by its full name, for undo may have moved it; none if it was removed."""
    return [shown.data for shown in bpy.data.objects if shown.name_full == name and shown.type == "LIGHT"][:1]


def _lights(scene: bpy.types.Scene) -> Iterator[bpy.types.Object]:
    """Yield the light objects of a scene and of the collections that are instanced in it."""
    waiting, seen = [scene.collection], set()
    while waiting:
        collection = waiting.pop()
        for item in collection.all_objects:
            if item.type == "LIGHT" and item.name_full not in seen and not is_left_out(item):
                seen.add(item.name_full)
                yield item
            inner = item.instance_collection
            if inner is not None and f"collection {inner.name_full}" not in seen:
                seen.add(f"collection {inner.name_full}")
                waiting.append(inner)


def _varies(light: bpy.types.Light) -> bool:
    """Tell whether a light's nodes are more than what is read as a constant."""
    if not uses_nodes(light):
        return False
    notes = Notes("")
    constant_emission(light.node_tree, ColourReader(ImageTable(), notes))
    return any(notice.kind == "simplified" for notice in notes.notices)


def _matrix(shown: bpy.types.Object) -> Float64:
    """Return where a light is measured: where it is if its nodes can tell, else at the origin and a metre in size."""
    # What the viewport hides is not evaluated; its own transform is right all the same.
    placed = shown.matrix_world if shown.parent or shown.constraints else shown.matrix_basis
    for node in nodes_in(shown.data.node_tree):
        linked = {output.name for output in node.outputs if output.is_linked}
        vector = node.inputs.get("Vector")
        if (
            node.type in _IN_WORLD_SPACE
            or (node.type == "NEW_GEOMETRY" and linked - _OF_THE_SHAPE)
            or (node.type == "TEX_COORD" and (node.object is not None or linked - {"UV", "Normal", "Object"}))
            or (node.type.startswith("TEX_") and node.type != "TEX_IES" and vector is not None and not vector.is_linked)
        ):
            return np.array(placed, dtype=np.float64)
    scale = np.array(placed.to_scale(), dtype=np.float64)
    if shown.data.type == "AREA":
        # Its nodes know places in its own space, whatever its scale; the quads have a size of their own.
        scale /= max(np.abs(scale[:2] * _sizes(shown.data)).max(), 1e-30)
    return np.diag([*scale, 1.0])


def _measure(find: Find, task: str, name: str, matrix: Float64, conditions: _Conditions) -> Steps[NDArray[np.float32]]:
    """Return what a light's nodes multiply its light by, (rows, columns, 3), as Cycles has it."""
    yield Progress(task, 0.0)
    (light,) = find()
    places, normals = _quads(light, matrix)
    points = places.reshape(-1, 3)
    with _stage(light, name, matrix, conditions) as stage:
        found = bake_irradiance(
            stage, stage.view_layers[0], points, normals.reshape(-1, 3), "DIRECT", 1, 0, conditions.frame
        )
    return found.reshape(places.shape).astype(np.float32)


def _quads(light: bpy.types.Light, matrix: Float64) -> tuple[Float64, Float64]:
    """Return where quads lie and how they face, each (rows, columns, 3)."""
    axes, center = frame(matrix), matrix[:3, 3]
    if light.type == "AREA":
        across = (np.arange(_ROWS_ACROSS) + 0.5) / _ROWS_ACROSS - 0.5
        u, v = (matrix[:3, axis] * size for axis, size in enumerate(_sizes(light)))
        places = center + across[None, :, None] * u + across[:, None, None] * v - axes[:, 2]
        return places, np.broadcast_to(axes[:, 2], places.shape)
    if light.type == "SUN":
        return (center - axes[:, 2])[None, None], axes[:, 2][None, None]
    theta = half_angle(light, matrix) * (np.arange(_ROWS_AROUND) + 0.5)[:, None, None] / _ROWS_AROUND
    phi = 2.0 * math.pi * (np.arange(_COLUMNS_AROUND) + 0.5)[None, :, None] / _COLUMNS_AROUND
    towards = np.sin(theta) * (np.cos(phi) * axes[:, 0] + np.sin(phi) * axes[:, 1]) - np.cos(theta) * axes[:, 2]
    return center + towards, -towards


def _sizes(light: bpy.types.AreaLight) -> tuple[float, float]:
    return light.size, light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size


@contextmanager
def _stage(original: bpy.types.Light, name: str, matrix: Float64, conditions: _Conditions) -> Iterator[bpy.types.Scene]:
    """Set up a scene in which a light's copy gives every quad an irradiance of one, but for its nodes."""
    data = bpy.data
    with ExitStack() as stack:
        stage = stack.enter_context(removed(data.scenes, lambda: data.scenes.new("Light")))
        light = stack.enter_context(removed(data.lights, original.copy))
        stage.frame_current = conditions.frame
        stage.cycles.light_sampling_threshold = 0.0
        stage.cycles.shading_system = conditions.shading_system
        light.color, light.exposure, light.use_temperature, light.normalize = (1.0, 1.0, 1.0), 0.0, False, True
        light.use_shadow, light.cycles.max_bounces = True, 1024
        if light.type == "AREA":
            u, v = (size * np.linalg.norm(matrix[:3, axis]) for axis, size in enumerate(_sizes(light)))
            light.size, light.size_y = _sizes(light)
            light.shape, light.spread, light.energy = "RECTANGLE", 0.0, u * v
            light.cycles.is_portal = False
        elif light.type == "SUN":
            light.angle, light.energy = 0.0, 1.0
        else:
            light.shadow_soft_size, light.energy = 0.0, 4.0 * math.pi
        made = stack.enter_context(removed(data.objects, lambda: data.objects.new(name, light)))
        made.matrix_world = mathutils.Matrix(matrix)
        stage.collection.objects.link(made)
        yield stage


def _colour_or_pattern(
    light: bpy.types.Light, matrix: Float64, factor: NDArray[np.float32]
) -> tuple[Float64, Pattern | None]:
    """Tell a constant from a pattern; see `NodeLight`."""
    if not np.isfinite(factor).all():
        return np.full(3, np.nan), None
    even = np.ones(factor.shape[:2]) if light.type != "SPOT" else _attenuation(light, matrix)
    bright = even > 0.1
    colour = np.median(factor[bright] / even[bright, None], axis=0).astype(np.float64)
    if np.abs(factor - even[..., None] * colour).max() <= _EVEN * np.abs(factor).max():
        return colour, None
    return np.ones(3), Pattern(np.maximum(factor, 0.0))


def _node_light(name: str, light: bpy.types.Light, colour: Float64, pattern: Pattern | None, angle: float) -> NodeLight:
    """Say what the pattern cannot hold."""
    notes = Notes(f"light '{name}'")
    read = None if light.type == "SUN" else read_falloff(light.node_tree)
    _note_limits(light, read is not None, notes)
    return NodeLight(colour, pattern, angle, notes.notices, *(read or (0, 0.0)))


def _attenuation(light: bpy.types.SpotLight, matrix: Float64) -> Float64:
    """Return how much of a spot's light its cone leaves in each texel's direction, (rows, columns)."""
    own = (matrix[:3, 3] - _quads(light, matrix)[0]) @ np.linalg.inv(matrix[:3, :3]).T
    cosine = own[..., 2] / np.linalg.norm(own, axis=-1)
    edge = math.cos(0.5 * light.spot_size)
    t = np.clip((cosine - edge) / max((1.0 - edge) * light.spot_blend, 1e-9), 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t))


def _note_limits(light: bpy.types.Light, falloff_read: bool, notes: Notes) -> None:
    """Say what a pattern cannot hold of a light's nodes."""
    for node in nodes_in(light.node_tree):
        linked = {output.name for output in node.outputs if output.is_linked}
        if light.type != "SUN" and not falloff_read and knows_distance(node, linked):
            notes.add("simplified", "falls off with the square of the distance, from what its nodes give at 1 m")
        if light.type == "AREA" and (node.type in _BY_DIRECTION or "Incoming" in linked):
            notes.add("simplified", "from all sides as bright as its nodes make it straight on")
    places = any(node.type.startswith("TEX_") or node.type == "NEW_GEOMETRY" for node in nodes_in(light.node_tree))
    if light.type == "SUN" and light.angle > 0.0 and places:
        notes.add("simplified", "all of its disc as bright as its nodes make the middle")
