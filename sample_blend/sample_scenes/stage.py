# SPDX-License-Identifier: GPL-3.0-or-later
"""What every sample scene shares: render settings, the black world, the camera, saving."""

from __future__ import annotations

from pathlib import Path

import bpy

from .assets import add, aim
from .shapes import Point

SAMPLES = 64
BOUNCES = 12
SQUARE = (256, 256)
WIDE = (320, 180)


def start(name: str, resolution: tuple[int, int]) -> bpy.types.Scene:
    """Empty the session and return its one scene, set up for an unbiased, reproducible render."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    scene.name = name
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = resolution
    scene.render.resolution_percentage = 100
    _set_sampling(scene.cycles)
    scene.view_settings.view_transform = "Standard"
    scene.view_settings.look = "None"
    scene.view_settings.exposure = 0.0
    scene.view_settings.gamma = 1.0
    layer = scene.view_layers[0]
    layer.use_pass_diffuse_direct = True
    layer.use_pass_diffuse_indirect = True
    layer.use_pass_diffuse_color = True
    scene.world = _black_world()
    return scene


def camera(location: Point, target: Point, *, lens: float, sensor: float = 36.0) -> bpy.types.Object:
    """Return the scene's camera, looking at a point; lens and sensor width in millimetres."""
    scene = bpy.context.scene
    data = bpy.data.cameras.new("Camera")
    data.lens = lens
    data.sensor_width = sensor
    made = add(scene.collection, "Camera", data, location)
    aim(made, target)
    scene.camera = made
    return made


def save(path: Path) -> None:
    """Write the session to a compressed .blend, without unused data or a backup of an older file."""
    bpy.data.orphans_purge(do_recursive=True)
    path.unlink(missing_ok=True)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)


def _set_sampling(cycles: bpy.types.PropertyGroup) -> None:
    """Ask for plain path tracing: whatever trades bias against noise is switched off."""
    cycles.samples = SAMPLES
    cycles.seed = 0
    cycles.use_animated_seed = False
    cycles.use_adaptive_sampling = False
    cycles.use_denoising = False
    cycles.max_bounces = BOUNCES
    cycles.diffuse_bounces = BOUNCES
    cycles.sample_clamp_direct = 0.0
    cycles.sample_clamp_indirect = 0.0
    cycles.blur_glossy = 0.0


def _black_world() -> bpy.types.World:
    """Return a world that gives no light."""
    world = bpy.data.worlds.new("Black World")
    tree = world.node_tree
    tree.nodes.clear()
    background = tree.nodes.new("ShaderNodeBackground")
    background.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    background.inputs["Strength"].default_value = 0.0
    output = tree.nodes.new("ShaderNodeOutputWorld")
    output.location = (320.0, 0.0)
    tree.links.new(background.outputs["Background"], output.inputs["Surface"])
    return world
