# SPDX-License-Identifier: GPL-3.0-or-later
"""Detailed things out of coarse meshes: subdivision and displacement modifiers do the work."""

from __future__ import annotations

from dataclasses import dataclass

import bpy


@dataclass(frozen=True)
class Relief:
    """A displacement along the normals: a texture's type, its features' size and height in metres."""

    texture: str
    size: float
    strength: float


def carve(thing: bpy.types.Object, levels: int, reliefs: tuple[Relief, ...]) -> None:
    """Subdivide an object and displace it by each relief in turn, in viewport and render alike."""
    fine = thing.modifiers.new("Subdivision", "SUBSURF")
    fine.levels = fine.render_levels = levels
    for number, relief in enumerate(reliefs, start=1):
        texture = bpy.data.textures.new(f"{thing.name} Relief {number}", relief.texture)
        texture.noise_scale = relief.size
        displace = thing.modifiers.new(f"Relief {number}", "DISPLACE")
        displace.texture = texture
        displace.texture_coords = "LOCAL"
        displace.strength = relief.strength
        displace.mid_level = 0.5
    for polygon in thing.data.polygons:
        polygon.use_smooth = True
