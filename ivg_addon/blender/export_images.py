# SPDX-License-Identifier: GPL-3.0-or-later
"""Images as textures: texels, colour space and alpha as Cycles treats them.

`Image.pixels` hands over what Blender keeps: bytes as they were stored (sRGB-encoded, mostly), and
floats that Blender has already made scene-linear. Cycles interpolates images of the sRGB colour
space as they are stored and decodes them afterwards, whether bytes or floats, except for floats
that it does not load from a file itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.report import Notice, merge
from ..core.scene import Float32, Texture

LARGEST = 2048 * 2048
"""Texels of a texture; larger images are averaged down to it."""

_MISSING: Float32 = np.array([[[1.0, 0.0, 1.0]]], dtype=np.float32)
"""What Cycles shows for an image that is not there."""

_LINEAR = {"Linear Rec.709", "scene_linear", "Linear", "Raw"}


@dataclass(frozen=True)
class ImageUse:
    """How a material reads an image.

    Parameters
    ----------
    image
        The image datablock, or None where the node has none.
    interpolate, extension
        As in `scene.Texture`.
    uv_map
        The UV map that it lies on; "" for the one that is active for rendering.
    """

    image: bpy.types.Image | None
    interpolate: bool
    extension: str
    uv_map: str

    @property
    def name(self) -> str:
        """Return the image's name."""
        return "(none)" if self.image is None else str(self.image.name)


class ImageTable:
    """The textures of a scene: each combination of image, interpolation and extension once."""

    def __init__(self) -> None:
        self._images: dict[str, _Image] = {}
        self._index: dict[tuple[str, bool, str], int] = {}
        self._textures: list[Texture] = []
        self._notices: list[Notice] = []

    @property
    def textures(self) -> tuple[Texture, ...]:
        """Return all textures, by index."""
        return tuple(self._textures)

    @property
    def notices(self) -> tuple[Notice, ...]:
        """Return what was noticed about images."""
        return merge(self._notices)

    def texture(self, use: ImageUse) -> int:
        """Return the index of the texture for this use, made at the first call."""
        image = self._image(use)
        key = (_key(use), use.interpolate, use.extension)
        if key not in self._index:
            self._index[key] = len(self._textures)
            self._textures.append(
                Texture(
                    name=use.name,
                    pixels=image.pixels,
                    interpolate=use.interpolate,
                    extension="EXTEND" if image.missing else use.extension,
                    encoded=image.encoded,
                )
            )
        return self._index[key]

    def mean(self, use: ImageUse) -> NDArray[np.float64]:
        """Return an image's mean colour (3,), linear."""
        image = self._image(use)
        texels = image.pixels.reshape(-1, 3)
        return np.asarray((_decode(texels) if image.encoded else texels).mean(axis=0, dtype=np.float64))

    def brightest(self, use: ImageUse) -> float:
        """Return the largest value of an image's texels."""
        return float(np.max(self._image(use).pixels))

    def _image(self, use: ImageUse) -> _Image:
        key = _key(use)
        if key not in self._images:
            self._images[key] = _read(use.image, self._notices)
        return self._images[key]


@dataclass(frozen=True)
class _Image:
    pixels: Float32
    encoded: bool
    missing: bool = False


def _key(use: ImageUse) -> str:
    """Return what tells images apart: names are unique only within a library."""
    return "" if use.image is None else str(use.image.name_full)


def _read(image: bpy.types.Image | None, notices: list[Notice]) -> _Image:
    """Read an image into memory."""
    if image is None:
        return _Image(_MISSING, encoded=False, missing=True)
    subject = f"image '{image.name}'"
    if image.source == "TILED" and len(image.tiles) > 1:
        notices.append(Notice("simplified", subject, f"only tile {image.tiles[0].number} of its UDIM tiles is used"))
    elif image.source in ("MOVIE", "SEQUENCE"):
        notices.append(Notice("simplified", subject, "only the frame that Blender holds now is used"))

    held = image.has_data
    try:
        pixels = _pixels(image)
        if pixels is None:
            path = f" ({image.filepath})" if image.filepath else ""
            notices.append(Notice("warning", subject, f"cannot be read{path}: magenta, as in Cycles"))
            return _Image(_MISSING, encoded=False, missing=True)
        return _as_texels(image, pixels, notices)
    finally:
        if not held and image.source != "GENERATED" and not image.is_dirty:
            image.buffers_free()


def _pixels(image: bpy.types.Image) -> Float32 | None:
    """Return an image's pixels, (height, width, 4) float32, as Blender holds them."""
    width, height = image.size  # loads the file
    channels = image.channels
    if not width or not height or not image.has_data or len(image.pixels) != width * height * channels:
        return None
    raw = np.empty(width * height * channels, dtype=np.float32)
    image.pixels.foreach_get(raw)
    raw = raw.reshape(height, width, channels)
    if channels == 4:
        return raw
    pixels = np.ones((height, width, 4), dtype=np.float32)
    pixels[..., :3] = raw[..., :1] if channels < 3 else raw[..., :3]
    return pixels


def _as_texels(image: bpy.types.Image, pixels: Float32, notices: list[Notice]) -> _Image:
    """Treat colour space and alpha as Cycles does, and limit the size."""
    subject = f"image '{image.name}'"
    space = image.colorspace_settings
    encoded = _is_encoded(image)
    texels = np.ascontiguousarray(pixels[..., :3])
    if encoded and image.is_float:
        texels = _encode(texels)
    if _straight_alpha(image):
        texels *= pixels[..., 3:]
    if not image.is_float and not (space.is_data or encoded or space.name in _LINEAR):
        notices.append(Notice("simplified", subject, f"colour space '{space.name}' taken as sRGB"))
        encoded = True
    if not np.isfinite(texels).all():
        notices.append(Notice("warning", subject, "has pixels that are not numbers: taken as black"))
        texels = np.nan_to_num(texels, nan=0.0, posinf=0.0, neginf=0.0)
    height, width = texels.shape[:2]
    if height * width > LARGEST:
        texels = _averaged(texels, math.ceil(math.sqrt(height * width / LARGEST)), encoded)
        size = f"{texels.shape[1]} × {texels.shape[0]}"
        notices.append(Notice("simplified", subject, f"{width} × {height} pixels averaged to {size}"))
    return _Image(texels, encoded)


def _is_encoded(image: bpy.types.Image) -> bool:
    """Tell whether Cycles interpolates this image sRGB-encoded."""
    if image.colorspace_settings.name != "sRGB":
        return False
    return not image.is_float or (image.source == "FILE" and image.packed_file is None)


def _straight_alpha(image: bpy.types.Image) -> bool:
    """Tell whether Cycles multiplies colours by alpha, of pixels as Blender hands them over.

    Blender keeps bytes straight and floats associated.
    """
    if image.is_float or image.colorspace_settings.is_data:
        return False
    return image.alpha_mode in ("STRAIGHT", "PREMUL")


def _averaged(texels: Float32, block: int, encoded: bool) -> Float32:
    """Return the means of block × block texels; those at the far edges may be smaller."""
    linear = _decode(texels) if encoded else texels
    for axis in (0, 1):
        starts = np.arange(0, linear.shape[axis], block)
        counts = np.diff(np.append(starts, linear.shape[axis]))
        sums = np.add.reduceat(linear, starts, axis=axis, dtype=np.float32)
        sizes = counts.astype(np.float32).reshape((-1, 1, 1) if axis == 0 else (1, -1, 1))
        linear = np.divide(sums, sizes, dtype=np.float32)
    return _encode(linear) if encoded else linear


def _decode(values: Float32) -> Float32:
    """Return linear values of sRGB-encoded ones (IEC 61966-2-1)."""
    bright = np.power((np.maximum(values, 0.04045) + 0.055) / 1.055, 2.4, dtype=np.float32)
    return np.where(values <= 0.04045, values / np.float32(12.92), bright).astype(np.float32)


def _encode(values: Float32) -> Float32:
    """Return sRGB-encoded values of linear ones (IEC 61966-2-1)."""
    bright = 1.055 * np.power(np.maximum(values, 0.0031308), 1 / 2.4, dtype=np.float32) - 0.055
    return np.where(values <= 0.0031308, values * np.float32(12.92), bright).astype(np.float32)
