# SPDX-License-Identifier: GPL-3.0-or-later
"""A wall modelled twice is black in Cycles, if it lies across an axis, and in the bake."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from ivg_addon.blender.export import export_render_steps
from ivg_addon.blender.ground_truth import cycles_irradiance
from ivg_addon.core.progress import finish

from .cycles_scenes import plain
from .export_scenes import add_object, empty_scene


@pytest.mark.parametrize("flipped", [False, True])
def test_doubled_faces_are_black(flipped: bool) -> None:
    scene = empty_scene()
    light = bpy.data.lights.new("Lamp", "POINT")
    add_object("Lamp", light, location=(0.3, 0.2, 3.0))
    below = np.random.default_rng(0).uniform((-0.5, -0.5, 1.2), (0.5, 0.5, 2.0), (16, 3))
    down = np.tile((0.0, 0.0, -1.0), (16, 1))
    corners = [(-1, -1, 0.1), (1, -1, 0.1), (1, 1, 0.1), (-1, 1, 0.1)]
    for copy in ("Wall", "Double"):
        mesh = bpy.data.meshes.new(copy)
        mesh.from_pydata(corners, [], [(3, 2, 1, 0) if flipped and copy == "Double" else (0, 1, 2, 3)])
        mesh.materials.append(bpy.data.materials.get("White") or plain("White", (0.8, 0.8, 0.8)))
        add_object(copy, mesh)
        if copy == "Wall":
            assert cycles_irradiance(scene, below, down, samples=32).min() > 0
    assert not cycles_irradiance(scene, below, down, samples=32).any()
    exported = finish(export_render_steps(scene, bpy.context.view_layer))
    assert not exported.materials.albedo[exported.geometry.material].any()
    notices = [str(notice) for notice in exported.notices]
    for name in ("Wall", "Double"):
        told = f"object '{name}': 2 triangles lie exactly in others, black, as in Cycles"
        assert any(told in notice for notice in notices)
