# SPDX-License-Identifier: GPL-3.0-or-later
"""Worlds that are proved one by one: skies, images and networks of nodes, for `lights`."""

from __future__ import annotations

import math
from collections.abc import Callable

import bpy
import numpy as np

from .light_cases import ASIDE, SHADING, LightCase, plate_at

Make = Callable[[bpy.types.NodeTree], bpy.types.NodeSocket]


def world(make: Make, strength: float = 1.0, *, shaded: bool = False) -> Callable[[], None]:
    """Return what makes a world whose background has the colour of a socket."""

    def build() -> None:
        made = bpy.data.worlds.new("World")
        tree = made.node_tree
        background = tree.get_output_node("CYCLES").inputs["Surface"].links[0].from_node
        background.inputs["Strength"].default_value = strength
        tree.links.new(make(tree), background.inputs["Color"])
        bpy.context.scene.world = made
        plate_at(*((0.4, SHADING) if shaded else (0.02, ASIDE)))

    return build


def sky(kind: str, *, disc: bool, size: float = 0.545, elevation: float = 40.0) -> Make:
    """Return what makes a Sky Texture; angles in degrees."""

    def make(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
        node = tree.nodes.new("ShaderNodeTexSky")
        node.sky_type, node.sun_disc = kind, disc
        node.sun_size = math.radians(size)
        node.sun_elevation, node.sun_rotation = math.radians(elevation), 2.0
        return node.outputs["Color"]

    return make


def picture(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
    """Make an Environment Texture of a picture of 256 × 128 pixels with a spot of four, turned about two axes."""
    rng = np.random.default_rng(1)
    pixels = np.ones((128, 256, 4), dtype=np.float32)
    pixels[:, :, :3] = 0.2 + 0.6 * rng.random((8, 16, 3)).repeat(16, axis=0).repeat(16, axis=1)
    pixels[100:102, 60:62, :3] = (4000.0, 3000.0, 1000.0)
    image = bpy.data.images.new("Picture", 256, 128, float_buffer=True, is_data=True)
    image.pixels.foreach_set(pixels.ravel())
    coordinates, mapping = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = (0.3, 0.0, 1.1)
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    return texture.outputs["Color"]


def gradient(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
    """Make a ramp of colours over the height, hidden from the camera: it sees white."""
    coordinates, split = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeSeparateXYZ")
    ramp, mix, path = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("ValToRGB", "Mix", "LightPath"))
    ramp.color_ramp.elements[0].color = (0.8, 0.2, 0.05, 1.0)
    ramp.color_ramp.elements[1].color = (0.1, 0.3, 0.9, 1.0)
    mix.data_type = "RGBA"
    factor, first, second = (mix.inputs[name] for name in (0, 6, 7))
    second.default_value = (9.0, 9.0, 9.0, 1.0)
    tree.links.new(coordinates.outputs["Generated"], split.inputs["Vector"])
    tree.links.new(split.outputs["Z"], ramp.inputs["Fac"])
    tree.links.new(path.outputs["Is Camera Ray"], factor)
    tree.links.new(ramp.outputs["Color"], first)
    return mix.outputs[2]


WORLD_CASES = (
    LightCase("sky, multiple scattering, disc", world(sky("MULTIPLE_SCATTERING", disc=True), 0.1)),
    LightCase("sky, multiple scattering, no disc", world(sky("MULTIPLE_SCATTERING", disc=False), 0.1)),
    LightCase("sky, single scattering, disc of 0.1°", world(sky("SINGLE_SCATTERING", disc=True, size=0.1), 0.1)),
    LightCase("sky, single scattering, low sun", world(sky("SINGLE_SCATTERING", disc=True, elevation=4.0), 0.1)),
    LightCase("sky, no disc, shadow", world(sky("MULTIPLE_SCATTERING", disc=False), 0.1, shaded=True)),
    LightCase("picture with a bright spot", world(picture)),
    LightCase("picture with a bright spot, shadow", world(picture, shaded=True)),
    LightCase("gradient behind a camera ray", world(gradient)),
)
