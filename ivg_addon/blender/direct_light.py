# SPDX-License-Identifier: GPL-3.0-or-later
"""The render settings with which Cycles and EEVEE compute direct light, and leave indirect light to the grid.

What is diffusely reflected has its indirect light from the materials, so rays that continue it would count it twice.
Rays of mirrors and glass go on, and find surfaces that have all of their light.

- Cycles: no diffuse bounces, and no ambient term in their place (fast global illumination).
- EEVEE: its ray tracing leaves diffuse surfaces to fast global illumination while traced roughness stays at ½ or below,
  and that computes ambient occlusion only. (Without it, they would be traced.) Volume light probes, which hold indirect
  light, have an intensity of 0. Sphere probes and the world's light stay.
"""

from __future__ import annotations

import json
from collections.abc import Iterator

import bpy

Setting = tuple[str, str, str, object]
"""The datablock, "" for the scene, else the name of a light probe's data; a path in it; a property; a value."""

_ROUGHEST = 0.5
"""Of what EEVEE traces: beyond, diffuse surfaces are traced too, more and more."""


def is_direct_only(scene: bpy.types.Scene) -> bool:
    """Tell whether a scene's settings were changed here."""
    return bool(scene.ivg.settings_before)


def counts_twice(scene: bpy.types.Scene) -> bool:
    """Tell whether some setting of the scene makes light count twice that materials have from a grid."""
    return any(_value(scene, setting) != setting[3] for setting in _wanted(scene))


def switch_to_direct(scene: bpy.types.Scene) -> None:
    """Let renders compute direct light only, and remember the settings before."""
    before = _before(scene)
    for setting in _wanted(scene):
        value = _value(scene, setting)
        if value != setting[3]:
            before[setting] = value
            _set(scene, setting, setting[3])
    # Also where nothing had to be changed: the user has asked for it.
    scene.ivg.settings_before = json.dumps([[*setting, value] for setting, value in before.items()])


def switch_back(scene: bpy.types.Scene) -> None:
    """Put the settings back, but for those that somebody has changed since."""
    for setting, value in _before(scene).items():
        if _owner(scene, setting) is not None and _value(scene, setting) == setting[3]:
            _set(scene, setting, value)
    scene.ivg.settings_before = ""


def _before(scene: bpy.types.Scene) -> dict[Setting, object]:
    """Return the settings that were changed, and their values before."""
    stored = json.loads(scene.ivg.settings_before or "[]")
    return {(probe, path, name, value): before for probe, path, name, value, before in stored}


def _wanted(scene: bpy.types.Scene) -> Iterator[Setting]:
    """Yield the settings for direct light."""
    if hasattr(scene, "cycles"):
        yield "", "cycles", "diffuse_bounces", 0
        yield "", "cycles", "use_fast_gi", False
    yield "", "eevee", "use_fast_gi", True
    yield "", "eevee", "fast_gi_method", "AMBIENT_OCCLUSION_ONLY"
    roughness = scene.eevee.ray_tracing_options.trace_max_roughness
    if roughness > _ROUGHEST:
        yield "", "eevee.ray_tracing_options", "trace_max_roughness", _ROUGHEST
    for probe in sorted({each.data.name for each in scene.objects if _is_volume_probe(each)}):
        yield probe, "", "intensity", 0.0


def _is_volume_probe(candidate: bpy.types.Object) -> bool:
    return candidate.type == "LIGHT_PROBE" and candidate.data.type == "VOLUME" and candidate.data.is_editable


def _owner(scene: bpy.types.Scene, setting: Setting) -> bpy.types.bpy_struct | None:
    probe, path, *_ = setting
    owner = bpy.data.lightprobes.get((probe, None)) if probe else scene
    return owner.path_resolve(path) if owner is not None and path else owner


def _value(scene: bpy.types.Scene, setting: Setting) -> object:
    return getattr(_owner(scene, setting), setting[2])


def _set(scene: bpy.types.Scene, setting: Setting, value: object) -> None:
    setattr(_owner(scene, setting), setting[2], value)
