# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the scene that must not matter, or must."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from .nodes import emission, material
from .stage import GREEN, TESTED, Case, card, lamp, plain, room


def _room_with(change: Callable[[bpy.types.Scene], object]) -> Callable[[], None]:
    def build() -> None:
        room()
        card(plain(TESTED, GREEN))
        change(bpy.context.scene)

    return build


def _film(scene: bpy.types.Scene) -> None:
    scene.cycles.film_exposure = 3.0
    scene.view_settings.exposure, scene.view_settings.gamma = 2.0, 1.5
    scene.view_settings.view_transform = "Standard"


def _biased(scene: bpy.types.Scene) -> None:
    """Switch on what `cycles_stage.truthful` switches off: both sides must ignore it."""
    cycles = scene.cycles
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.05
    cycles.blur_glossy, cycles.max_bounces, cycles.use_fast_gi = 5.0, 1, True


def _units(scene: bpy.types.Scene) -> None:
    scene.unit_settings.system, scene.unit_settings.scale_length = "METRIC", 0.01


def _second_layer(scene: bpy.types.Scene) -> None:
    scene.view_layers.new("Other")
    scene.render.engine = "BLENDER_WORKBENCH"


def _material_override(scene: bpy.types.Scene) -> None:
    scene.view_layers[0].material_override = plain("Override", (0.3, 0.5, 0.7))


def _light_override() -> None:
    """Hold a shining card up to an overridden material: it then shines no more."""
    room()
    card(material(TESTED, emission((4.0, 3.0, 2.0))))
    bpy.context.view_layer.material_override = plain("Override")


def _light_tree(scene: bpy.types.Scene) -> None:
    scene.cycles.use_light_tree = False
    lamp("POINT", "Second", (-0.8, 0.6, 2.4), energy=20.0)


CASES = (
    Case("setting: film exposure and view transform", _room_with(_film)),
    Case("setting: clamping, fast GI, few bounces", _room_with(_biased)),
    Case("setting: units", _room_with(_units)),
    Case("setting: another engine, a second layer", _room_with(_second_layer)),
    Case("setting: material override", _room_with(_material_override)),
    Case("setting: material override over a shining card", _light_override),
    Case("setting: without light tree", _room_with(_light_tree)),
)
