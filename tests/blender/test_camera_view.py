# SPDX-License-Identifier: GPL-3.0-or-later
"""What of even light a surface shows the camera, from steep to grazing angles: by lobes, and by Cycles."""

from __future__ import annotations

import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from ivg_addon.blender.cycles_render import render_steps  # noqa: E402
from ivg_addon.blender.export import export_render_steps  # noqa: E402
from ivg_addon.blender.export_camera import export_camera  # noqa: E402
from ivg_addon.core.picture import shade_steps  # noqa: E402

from ..core.steps import drain  # noqa: E402
from ..core.test_picture import uniform_light  # noqa: E402
from .export_scenes import Build, add_object, empty_scene, new_material  # noqa: E402
from .export_trees import RED, pair, shader, surface  # noqa: E402

SIZE = 24
BANDS = 4
"""Of rows, from the foreground, seen at 60° to the ground, to the distance, at 7°."""
CLOSE = 0.01
"""How near white light's reflectances are to be to Cycles', besides six standard errors: 1 % of white."""

MATERIALS = {
    "smooth": surface(shader("BsdfPrincipled", Base_Color=RED, Roughness=0.15)),
    "dense": surface(shader("BsdfPrincipled", Base_Color=RED, Roughness=0.5, IOR=1.8)),
    "coated": surface(shader("BsdfPrincipled", Base_Color=RED, Coat_Weight=1.0, Coat_Tint=(0.6, 0.9, 0.9))),
    "fuzzy": surface(shader("BsdfPrincipled", Base_Color=RED, Sheen_Weight=0.7, Sheen_Roughness=0.4)),
    "sheen": surface(shader("BsdfSheen", Color=RED, Roughness=0.3)),
    "rough": surface(shader("BsdfDiffuse", Color=RED, Roughness=1.0)),
    "translucent": surface(shader("BsdfTranslucent", Color=RED)),
    "half there": surface(shader("BsdfPrincipled", Base_Color=RED, Alpha=0.4)),
    "Fresnel": surface(
        pair(
            "MixShader",
            shader("BsdfDiffuse", Color=RED),
            shader("BsdfGlossy", Roughness=0.3),
            shader("Fresnel", IOR=1.6),
        )
    ),
}


def ground(build: Build) -> bpy.types.Scene:
    """Make a large ground under a white sky, and a camera that looks over it."""
    scene = empty_scene()
    mesh = bpy.data.meshes.new("Ground")
    mesh.from_pydata([(-90, -90, 0), (90, -90, 0), (90, 90, 0), (-90, 90, 0)], [], [(0, 1, 2, 3)])
    mesh.materials.append(new_material("Tested", build))
    add_object("Ground", mesh)
    world = bpy.data.worlds.new("White")
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    scene.world = world
    camera = bpy.data.cameras.new("Camera")
    camera.angle = math.radians(53.0)
    scene.camera = add_object(
        "Camera", camera, location=(0.0, 0.0, 2.0), rotation_euler=(math.radians(90.0 - 33.5), 0.0, 0.0)
    )
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    bpy.context.view_layer.update()
    return scene


def bands(image: np.ndarray) -> np.ndarray:
    """Return the means over bands of rows, (BANDS, 3)."""
    return np.asarray(image.reshape(BANDS, -1, 3).mean(axis=1), dtype=np.float64)


@pytest.mark.parametrize("caustics", [True, False])
@pytest.mark.parametrize("name", MATERIALS)
def test_surfaces_show_of_even_light_what_they_show_in_cycles(name: str, caustics: bool) -> None:
    """Caustics are switched off for photons; what the camera sees has its gloss all the same."""
    scene = ground(MATERIALS[name])
    scene.cycles.caustics_reflective = scene.cycles.caustics_refractive = caustics
    cycles = drain(render_steps(scene, bpy.context.view_layer, samples=256, include_direct=True))
    even = uniform_light(np.ones(3))
    arrays = drain(export_render_steps(scene, bpy.context.view_layer, to_camera=True))
    camera = export_camera(bpy.context.evaluated_depsgraph_get())
    shaded = drain(shade_steps(arrays, even, camera, 16))
    error = np.sqrt(bands(cycles.error**2) / (SIZE * SIZE / BANDS))
    found, truth = bands(shaded.light), bands(cycles.light)
    assert truth.max() > 0.1
    assert (np.abs(found - truth) < CLOSE + 6.0 * error).all(), (found, truth, error)
