# SPDX-License-Identifier: GPL-3.0-or-later
"""Patches of materials in a row under even light, seen from above or aslant, for the renders of either engine."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.exr import read_exr
from ivg_addon.core.grid import IrradianceVectorGrid
from tests.core.grids import grid

PIXELS = 8
"""Along a patch's side."""
TILT = math.radians(50.0)
"""Of the direction of view, against a patch's normal."""
LIGHT = np.array([3.0, 2.0, 1.0])
"""Irradiance from everywhere, W/m²."""


def even_light(size: float = 40.0) -> IrradianceVectorGrid:
    """Return a grid whose light is the same everywhere and from all sides: I_δ = E δ."""
    lattice = Lattice((-size,) * 3, (size,) * 3, (2, 2, 2))
    vectors = np.zeros((*lattice.shape, 6, 3, 3))
    for direction in range(6):
        vectors[..., direction, :, direction // 2] = LIGHT * (1.0 - 2.0 * (direction % 2))
    return grid(vectors, lattice=lattice)


def lay_out(materials: Sequence[bpy.types.Material]) -> None:
    """Lay patches in a row along x, and a camera over them that looks down at an angle of `TILT`."""
    scene = bpy.context.scene
    x = np.arange(len(materials), dtype=float)
    corners = np.stack([np.stack([x + dx, 0 * x + y, 0 * x], -1) for dx, y in ((0, -9), (1, -9), (1, 9), (0, 9))], 1)
    mesh = bpy.data.meshes.new("Patches")
    mesh.from_pydata(corners.reshape(-1, 3).tolist(), [], np.arange(4 * len(x)).reshape(-1, 4).tolist())
    for index, material in enumerate(materials):
        mesh.materials.append(material)
        mesh.polygons[index].material_index = index
    scene.collection.objects.link(bpy.data.objects.new("Patches", mesh))
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", float(len(materials))
    scene.camera = bpy.data.objects.new("Camera", camera)
    scene.collection.objects.link(scene.camera)
    scene.camera.location = (0.5 * len(materials), -5.0 * math.sin(TILT), 5.0 * math.cos(TILT))
    scene.camera.rotation_euler = (TILT, 0.0, 0.0)
    render = scene.render
    render.resolution_x, render.resolution_y = PIXELS * len(materials), PIXELS
    render.dither_intensity = 0.0
    scene.view_settings.view_transform = "Raw"
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.cycles.use_denoising = False
    scene.cycles.samples, scene.eevee.taa_render_samples = 16, 4


def rendered(path: Path, count: int) -> NDArray[np.float64]:
    """Render; return the radiance of each patch, (count, 3), the mean over its middle."""
    bpy.context.scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    channels = read_exr(path)
    picture = np.stack([channels[name] for name in "RGB"], axis=-1).reshape(PIXELS, count, PIXELS, 3)
    return picture[2:-2, :, 2:-2].astype(np.float64).mean(axis=(0, 2))
