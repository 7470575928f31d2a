# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of the scene that must not matter, or must."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from .nodes import emission, material, node, set_world
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


def _world_of_layer(**switches: bool) -> Callable[[bpy.types.Scene], None]:
    """Return what lights a scene by its world too, and switches parts of the view layer."""

    def change(scene: bpy.types.Scene) -> None:
        set_world(TESTED, node("Background", Color=(0.4, 0.6, 0.9)))
        for name, value in switches.items():
            setattr(scene.view_layers[0], name, value)

    return change


def _world_override(scene: bpy.types.Scene) -> None:
    first = set_world(TESTED, node("Background", Color=(0.1, 0.6, 0.9)))
    set_world("Other", node("Background", Color=(0.9, 0.2, 0.1)))
    scene.view_layers[0].world_override = first


def _world_unseen(scene: bpy.types.Scene) -> None:
    set_world(TESTED, node("Background", Color=(0.4, 0.6, 0.9))).cycles_visibility.diffuse = False


def _world_few_bounces(scene: bpy.types.Scene) -> None:
    set_world(TESTED, node("Background", Color=(0.4, 0.6, 0.9))).cycles.max_bounces = 0


def _lamp_few_bounces(scene: bpy.types.Scene) -> None:
    lamp("POINT", TESTED, (-0.8, 0.6, 2.4), energy=60.0).data.cycles.max_bounces = 0


def _lamp_without_mis(scene: bpy.types.Scene) -> None:
    lamp("POINT", TESTED, (-0.8, 0.6, 2.4), energy=60.0).data.cycles.use_multiple_importance_sampling = False


def _transparent_film(scene: bpy.types.Scene) -> None:
    set_world(TESTED, node("Background", Color=(0.4, 0.6, 0.9)))
    scene.render.film_transparent = True


def _simplified(scene: bpy.types.Scene) -> None:
    modifier = bpy.data.objects[TESTED].modifiers.new("Subdivision", "SUBSURF")
    modifier.render_levels = 3
    scene.render.use_simplify, scene.render.simplify_subdivision_render = True, 0


def _frame(scene: bpy.types.Scene) -> None:
    """Let a lamp grow brighter over time, and the scene stand at its end."""
    data = lamp("POINT", TESTED, (-0.8, 0.6, 2.4), energy=1.0).data
    data.keyframe_insert("energy", frame=1)
    data.energy = 80.0
    data.keyframe_insert("energy", frame=10)
    scene.frame_set(10)


CASES = (
    Case("setting: view layer without sky", _room_with(_world_of_layer(use_sky=False))),
    Case("setting: view layer without ambient occlusion", _room_with(_world_of_layer(use_ao=False))),
    Case("setting: world of the view layer", _room_with(_world_override)),
    Case("setting: world hidden from diffuse rays", _room_with(_world_unseen)),
    Case("setting: world of no bounces", _room_with(_world_few_bounces)),
    Case("setting: lamp of no bounces", _room_with(_lamp_few_bounces)),
    Case("setting: lamp without multiple importance", _room_with(_lamp_without_mis)),
    Case("setting: transparent film", _room_with(_transparent_film)),
    Case("setting: simplify", _room_with(_simplified)),
    Case("setting: a later frame", _room_with(_frame)),
    Case("setting: film exposure and view transform", _room_with(_film)),
    Case("setting: clamping, fast GI, few bounces", _room_with(_biased)),
    Case("setting: units", _room_with(_units)),
    Case("setting: another engine, a second layer", _room_with(_second_layer)),
    Case("setting: material override", _room_with(_material_override)),
    Case("setting: material override over a shining card", _light_override),
    Case("setting: without light tree", _room_with(_light_tree)),
)
