# SPDX-License-Identifier: GPL-3.0-or-later
"""From light datablocks and the world to `core.lights.Lights`.

The conversions are those of Cycles (src/scene/light.cpp), so that what leaves here has no notion of
Blender's "power" any more: a light of strength s = colour · energy · 2^exposure emits

    area    radiance s / (π A)           point, spot    intensity s / (4π)
    sun     irradiance s                 where it faces the light

and without `normalize` a radiance of s/π, s/π and s: of its surface, its sphere or its disc.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, TypeVar

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.environment import EnvironmentMap
from ..core.lights import NO_LIMIT, NO_PATTERN, AreaLights, Lights, Pattern, PointLights, SunLights
from ..core.report import Notice, merge
from .emission_nodes import constant_emission
from .export_colours import ColourReader, Notes
from .export_images import ImageTable
from .left_out import LeftOut
from .light_linking import LinkingReader
from .light_nodes import NodeLight, frame, half_angle, uses_nodes
from .world_map import WorldLight, lights_diffuse, world_of

Float64 = NDArray[np.float64]
Kind = TypeVar("Kind", AreaLights, PointLights, SunLights)
Row = dict[str, Any]

_ALL_BOUNCES = 1024
"""Blender's default of `max_bounces`: no limit in practice."""
_SHEARED = 1e-4
"""Cosine between a light's axes from which on its transform counts as sheared."""
_NEGATIVE = "takes light away: what is negative of its light is ignored"
_UNSEEN = "lights no diffuse surface: its Ray Visibility has Diffuse switched off"
_SHADOWLESS = "casts shadows, although they are switched off"


def export_lights(
    depsgraph: bpy.types.Depsgraph,
    linking: LinkingReader | None = None,
    evaluated: Mapping[str, NodeLight] | None = None,
    world: WorldLight | None = None,
    left_out: LeftOut | None = None,
) -> tuple[Lights, tuple[Notice, ...]]:
    """Return every light that a depsgraph shows, instances too, and the world.

    Portals light nothing, in Cycles as here: they are left out without a word. All else that is not
    taken over exactly gets a `Notice`.

    Parameters
    ----------
    linking
        Learns which lights may not light everything; its `rules` belong to the lights.
    evaluated
        What Cycles found of nodes that are no constants, by the names of their objects; see `light_nodes`.
    world
        What the world is where it is more than one colour; see `world_map`. Without it such a world lights nothing: a
        render, which this may run inside of, is no place to start another.
    left_out
        Learns which lights are left out by their objects' settings.
    """
    linking = linking or LinkingReader()
    left_out = left_out or LeftOut()
    patterns: dict[int, Pattern] = {}
    rows: dict[type, list[Row]] = {AreaLights: [], PointLights: [], SunLights: []}
    notices: list[Notice] = []
    for instance in depsgraph.object_instances:
        light = instance.object
        if light.type != "LIGHT" or not _renders(instance) or left_out.has(instance):
            continue
        notes = Notes(f"light '{light.name}'")
        if not _lights_diffuse(instance):
            notices.append(Notice("left out", f"light '{light.name}'", _UNSEEN))
            continue
        matrix = np.array(instance.matrix_world, dtype=np.float64)
        node_light = (evaluated or {}).get(light.name_full)
        exported = _export(light, matrix, node_light, notes)
        if exported is not None:
            kind, row = exported
            if node_light is not None and node_light.pattern is not None:
                patterns.setdefault(id(node_light.pattern), node_light.pattern)
                row["pattern"] = list(patterns).index(id(node_light.pattern))
            group = linking.group(light, shadows=light.data.use_shadow)
            rows[kind].append({"names": light.name, "group": group, "max_bounces": _limit(light.data), **row})
        notices.extend(notes.notices)
    radiance, environment, world_notices = _world(depsgraph, world)
    lights = _lights(rows, radiance, environment, tuple(patterns.values()))
    return lights, merge([*notices, *world_notices])


def _renders(instance: bpy.types.DepsgraphObjectInstance) -> bool:
    """Tell whether a light is there to shine, in a render."""
    light = instance.object
    return (
        instance.show_self
        # A depsgraph of a render holds what renders, one of the viewport what the viewport shows.
        and not light.hide_render
        and not (light.data.type == "AREA" and light.data.cycles.is_portal)
    )


def _lights_diffuse(instance: bpy.types.DepsgraphObjectInstance) -> bool:
    """Tell whether a light lights diffuse surfaces."""
    light = instance.object
    seers = [light, instance.parent] if instance.is_instance and instance.parent else [light]
    return all(seer.visible_diffuse for seer in seers)


def _limit(light: bpy.types.Light) -> int:
    """Return the most bounces of a light."""
    bounces = int(light.cycles.max_bounces)
    return bounces if bounces < _ALL_BOUNCES else NO_LIMIT


def _export(
    light: bpy.types.Object, matrix: Float64, node_light: NodeLight | None, notes: Notes
) -> tuple[type, Row] | None:
    """Return the kind and the fields of a light, or None if it emits nothing."""
    strength = _strength(light.data, node_light, notes)
    if strength is None:
        return None
    if not np.isfinite(matrix).all():
        notes.add("left out", "its transform is not a number")
        return None
    kind, row = _CONVERSIONS[light.data.type](light.data, matrix, strength)
    nowhere = _nowhere(kind, row)
    if nowhere:
        notes.add("left out", nowhere)
        return None
    _note_differences(light, matrix, notes)
    if node_light is not None and "falloff" in row:
        row |= {"falloff": node_light.falloff, "smooth": node_light.smooth}
    if node_light is not None and node_light.pattern is not None and kind is PointLights:
        if abs(node_light.half_angle - half_angle(light.data, matrix)) > _SHEARED:
            notes.add("simplified", "its cone is as wide as that of its first instance")
        row |= {"axes": frame(matrix), "cos_half_angle": math.cos(node_light.half_angle), "blend": 0.0}
    return kind, row


def _strength(light: bpy.types.Light, node_light: NodeLight | None, notes: Notes) -> Float64 | None:
    """Return colour times power, (3,), or None if the light emits nothing."""
    strength = np.array(light.color, dtype=np.float64) * light.energy * 2.0**light.exposure
    if light.use_temperature:
        strength *= np.array(light.temperature_color, dtype=np.float64)
    if node_light is not None:
        strength *= node_light.colour
        for notice in node_light.notices:
            notes.add(notice.kind, notice.message)
    elif uses_nodes(light):
        strength *= constant_emission(light.node_tree, ColourReader(ImageTable(), notes))
    if not np.isfinite(strength).all():
        notes.add("left out", "its colour or power is not a number: enter it anew")
        return None
    if not strength.any():
        notes.add("left out", "emits nothing: its colour, power or nodes are zero")
        return None
    return strength


def _area(light: bpy.types.AreaLight, matrix: Float64, strength: Float64) -> tuple[type, Row]:
    elliptic = light.shape in {"DISK", "ELLIPSE"}
    size_y = light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size
    edge_u, edge_v = matrix[:3, 0] * light.size, matrix[:3, 1] * size_y
    area = np.linalg.norm(edge_u) * np.linalg.norm(edge_v) * (math.pi / 4 if elliptic else 1.0)
    return AreaLights, {
        "center": matrix[:3, 3],
        "edge_u": edge_u,
        "edge_v": edge_v,
        "direction": _unit(-matrix[:3, 2]),
        "elliptic": elliptic,
        "half_spread": 0.5 * light.spread,
        "radiance": strength / (math.pi * (area or 1.0) if light.normalize else math.pi),
        "pattern": NO_PATTERN,
        "falloff": 0,
        "smooth": 0.0,
    }


def _point(light: bpy.types.Light, matrix: Float64, strength: Float64) -> tuple[type, Row]:
    # The object's scale does not change the radius.
    radius = light.shadow_soft_size
    spot = light.type == "SPOT"
    # Not normalised, a point has the radiance s/π of a sphere of radius r, or intensity s/π.
    factor = 1.0 / (4.0 * math.pi) if light.normalize else radius**2 or 1.0 / math.pi
    return PointLights, {
        "position": matrix[:3, 3],
        "radius": radius,
        "soft_falloff": bool(light.use_soft_falloff),
        "intensity": strength * factor,
        "cos_half_angle": math.cos(0.5 * light.spot_size) if spot else -1.0,
        "blend": light.spot_blend if spot else 0.0,
        "axes": matrix[:3, :3] if spot else np.eye(3),
        "pattern": NO_PATTERN,
        "falloff": 0,
        "smooth": 0.0,
    }


def _sun(light: bpy.types.SunLight, matrix: Float64, strength: Float64) -> tuple[type, Row]:
    half_angle = 0.5 * light.angle
    facing = math.pi * math.sin(half_angle) ** 2 if light.angle > 0.0 else 1.0
    return SunLights, {
        "direction": _unit(-matrix[:3, 2]),
        "half_angle": half_angle,
        "irradiance": strength * (1.0 if light.normalize else facing),
    }


_LIGHT_OF = {AreaLights: "radiance", PointLights: "intensity", SunLights: "irradiance"}
_CONVERSIONS = {"AREA": _area, "POINT": _point, "SPOT": _point, "SUN": _sun}


def _nowhere(kind: type, row: Row) -> str:
    """Return why a light cannot shine, in Cycles neither; empty if it can."""
    if kind is AreaLights and not (row["edge_u"].any() and row["edge_v"].any()):
        return "has no area: give it a size"
    if "direction" in row and not row["direction"].any():
        return "is scaled to nothing along its axis"
    if kind is PointLights and not abs(np.linalg.det(row["axes"])) > 0.0:
        return "is scaled to nothing along one of its axes"
    with np.errstate(over="ignore"):
        if not np.isfinite(np.float32(row[_LIGHT_OF[kind]])).all():
            return "is brighter than single precision can say: lower its power"
    return ""


def _note_differences(light: bpy.types.Object, matrix: Float64, notes: Notes) -> None:
    """Say what Cycles would do otherwise with a light that is exported."""
    if light.data.type == "AREA":
        axes = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
        if np.abs(axes.T @ axes - np.eye(3)).max() > _SHEARED:
            notes.add("simplified", "its transform is sheared: apply it to its parents to be exact")


def _world(
    depsgraph: bpy.types.Depsgraph, evaluated: WorldLight | None
) -> tuple[NDArray[np.float32], tuple[EnvironmentMap, ...], tuple[Notice, ...]]:
    """Return the world's radiance, (3,) if it is the same from everywhere, and else as maps."""
    black = np.zeros(3, dtype=np.float32)
    world = world_of(depsgraph.scene_eval, depsgraph.view_layer_eval)
    if world is None or not lights_diffuse(world):
        return black, (), ()
    subject = f"world '{world.name}'"
    notes = Notes(subject)
    if world.node_tree is None:
        radiance = np.array(world.color, dtype=np.float64)
    else:
        radiance = constant_emission(world.node_tree, ColourReader(ImageTable(), notes))
    if evaluated is not None:
        left_out = (notice for notice in notes.notices if notice.kind == "left out")
        return black, evaluated.maps, (*left_out, *evaluated.notices, *_world_differences(world, subject))
    for notice in notes.notices:
        if notice.kind == "simplified":
            # The reader's note says what it took a constant for; here no constant is taken.
            node = notice.message.rpartition("instead of ")[2]
            why = f"lights nothing: of one colour it would, but it has {node}, which only Cycles can evaluate"
            return black, (), (Notice("left out", subject, why),)
    if not np.isfinite(radiance).all():
        notes.add("left out", "lights nothing: its colour is not a number")
        return black, (), notes.notices
    if (radiance < 0.0).any():
        notes.add("simplified", _NEGATIVE)
    return np.maximum(radiance, 0.0).astype(np.float32), (), (*notes.notices, *_world_differences(world, subject))


def _world_differences(world: bpy.types.World, subject: str) -> tuple[Notice, ...]:
    """Say what Cycles would do otherwise with a world that is exported."""
    notes = Notes(subject)
    if not getattr(world.cycles, "use_shadows", True):
        notes.add("simplified", _SHADOWLESS)
    if world.cycles.max_bounces < _ALL_BOUNCES:
        notes.add("simplified", f"lights every bounce, not only the first {world.cycles.max_bounces}")
    return notes.notices


def _unit(vector: Float64) -> Float64:
    """Return a vector of length one, or zero if it has no length."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0.0 else vector


def _lights(
    rows: dict[type, list[Row]],
    world: NDArray[np.float32],
    environment: tuple[EnvironmentMap, ...],
    patterns: tuple[Pattern, ...],
) -> Lights:
    """Return lights of their rows, which are in the order in which `Lights` counts them, and of the world."""
    in_order = [row for kind in rows for row in rows[kind]]
    return Lights(
        world=world,
        environment=environment,
        patterns=patterns,
        group=np.array([row.pop("group") for row in in_order], dtype=np.int32),
        max_bounces=np.array([row.pop("max_bounces") for row in in_order], dtype=np.int32),
        area=_stack(AreaLights, rows[AreaLights]),
        point=_stack(PointLights, rows[PointLights]),
        sun=_stack(SunLights, rows[SunLights]),
    )


def _stack(kind: type[Kind], rows: list[Row]) -> Kind:
    """Turn rows into arrays: float32, int32 or bool."""
    if not rows:
        return kind()
    columns: dict[str, Any] = {"names": tuple(row["names"] for row in rows)}
    for name in rows[0].keys() - {"names"}:
        column = np.array([row[name] for row in rows])
        columns[name] = column.astype({"b": np.bool_, "i": np.int32}.get(column.dtype.kind, np.float32))
    return kind(**columns)
