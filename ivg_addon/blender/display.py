# SPDX-License-Identifier: GPL-3.0-or-later
"""Light as the scene's colour management shows it."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.scene import Float32
from .cycles_stage import changed, copy_of, removed

_FORMAT = {  # a format belongs to its media type, the rest to the format
    "media_type": "IMAGE",
    "file_format": "PNG",
    "color_mode": "RGB",
    "color_depth": "16",
    "color_management": "FOLLOW_SCENE",
}


def display_pixels(light: Float32, scene: bpy.types.Scene) -> NDArray[np.float64]:
    """Return what a render with this light would look like on the display.

    Parameters
    ----------
    light : (height, width, 3) float32
        Scene-linear radiance, first row at the bottom.
    scene
        Whose exposure, view transform, look, curves and display count.

    Returns
    -------
    (height, width, 3) float64
        Display values in [0, 1].
    """
    exposure = scene.cycles.film_exposure if hasattr(scene, "cycles") else 1.0
    with tempfile.TemporaryDirectory(prefix="ivg-") as folder, copy_of(scene) as stage:
        path = Path(folder, "display.png")
        settings = {(stage.render.image_settings, name): value for name, value in _FORMAT.items()}
        with changed(settings), removed(bpy.data.images, lambda: _image(light * np.float32(exposure))) as image:
            image.save_render(str(path), scene=stage)
        with removed(bpy.data.images, lambda: bpy.data.images.load(str(path))) as shown:
            shown.colorspace_settings.name = "Non-Color"
            return read_pixels(shown)


def read_pixels(image: bpy.types.Image) -> NDArray[np.float64]:
    """Return an image's pixels without alpha, (height, width, 3), first row at the bottom."""
    width, height = image.size
    pixels = np.empty((height, width, image.channels), dtype=np.float32)
    image.pixels.foreach_get(pixels.reshape(-1))
    return pixels[:, :, :3].astype(np.float64)


def _image(light: Float32) -> bpy.types.Image:
    """Return a new image of scene-linear light."""
    height, width, _ = light.shape
    image = bpy.data.images.new("IVG light", width, height, float_buffer=True, alpha=False)
    image.pixels.foreach_set(np.concatenate([light, np.ones((height, width, 1), np.float32)], axis=-1).reshape(-1))
    return image
