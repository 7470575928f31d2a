# SPDX-License-Identifier: GPL-3.0-or-later
"""Texture look-up inside kernels, with Cycles' conventions.

Texture coordinates (u, v) fall on the texel plane at (u·width, v·height); texel (i, j) covers the
unit square from there on and its centre is at (i + ½, j + ½). An image that is stored sRGB-encoded
is interpolated as it is stored and decoded afterwards, as Cycles does: at the border between a
black and a white texel the result is 0.21, not 0.5.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .compiled import inlined
from .scene import NO_TEXTURE, Float32, Int32, Texture

REPEAT, EXTEND, CLIP, MIRROR = range(4)
"""What lies outside of an image: see `Texture.extension`."""

_EXTENSIONS = {"REPEAT": REPEAT, "EXTEND": EXTEND, "CLIP": CLIP, "MIRROR": MIRROR}
_FARTHEST = 1e9
"""Texels from the origin beyond which coordinates no longer fit into a 32-bit index."""


class TexturePool(NamedTuple):
    """All textures of a scene in one array, as kernels see them.

    texels : (n, 3) float32
        Rows of the first texture from v = 0 up, then those of the next.
    offset : (t,) int64
        Where each texture starts in `texels`.
    width, height : (t,) int32
    interpolate, encoded : (t,) bool
        See `Texture`.
    extension : (t,) int32
        `REPEAT`, `EXTEND`, `CLIP` or `MIRROR`.
    """

    texels: Float32
    offset: NDArray[np.int64]
    width: Int32
    height: Int32
    interpolate: NDArray[np.bool_]
    encoded: NDArray[np.bool_]
    extension: Int32


def pack_textures(textures: Sequence[Texture]) -> TexturePool:
    """Gather textures, in their order, for `sample_texture`."""
    sizes = [texture.pixels.shape[0] * texture.pixels.shape[1] for texture in textures]
    texels = np.empty((sum(sizes), 3), dtype=np.float32)
    offset = np.cumsum([0, *sizes], dtype=np.int64)
    for texture, start, stop in zip(textures, offset[:-1], offset[1:], strict=True):
        texels[start:stop] = texture.pixels.reshape(-1, 3)
    return TexturePool(
        texels=texels,
        offset=offset[:-1].copy(),
        width=np.array([texture.pixels.shape[1] for texture in textures], dtype=np.int32),
        height=np.array([texture.pixels.shape[0] for texture in textures], dtype=np.int32),
        interpolate=np.array([texture.interpolate for texture in textures], dtype=np.bool_),
        encoded=np.array([texture.encoded for texture in textures], dtype=np.bool_),
        extension=np.array([_EXTENSIONS[texture.extension] for texture in textures], dtype=np.int32),
    )


@inlined
def decode_srgb(value):
    """Return the linear value of an sRGB-encoded one (IEC 61966-2-1)."""
    if value <= 0.04045:
        return value / 12.92
    return math.pow((value + 0.055) / 1.055, 2.4)


@inlined
def _wrap(index, count, extension):
    """Return the row or column that stands at `index`, or −1 where there is none."""
    if extension == REPEAT:
        return index % count
    if extension == EXTEND:
        return min(max(index, 0), count - 1)
    if extension == MIRROR:
        index = index % (2 * count)
        return index if index < count else 2 * count - 1 - index
    return index if 0 <= index < count else -1


@inlined
def _texel(pool, texture, column, row):
    """Return the stored colour at integer texel coordinates, black outside of a clipped image."""
    width, height = int(pool.width[texture]), int(pool.height[texture])
    i = _wrap(column, width, pool.extension[texture])
    j = _wrap(row, height, pool.extension[texture])
    if i < 0 or j < 0:
        return 0.0, 0.0, 0.0
    at = pool.offset[texture] + j * width + i
    return float(pool.texels[at, 0]), float(pool.texels[at, 1]), float(pool.texels[at, 2])


@inlined
def _bilinear(pool, texture, x, y):
    """Return the stored colours around (x, y), in texels, weighted by nearness."""
    left, low = math.floor(x - 0.5), math.floor(y - 0.5)
    s, t = x - 0.5 - left, y - 0.5 - low
    i, j = int(left), int(low)
    a = _texel(pool, texture, i, j)
    b = _texel(pool, texture, i + 1, j)
    c = _texel(pool, texture, i, j + 1)
    d = _texel(pool, texture, i + 1, j + 1)
    wa, wb, wc, wd = (1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t
    return (
        wa * a[0] + wb * b[0] + wc * c[0] + wd * d[0],
        wa * a[1] + wb * b[1] + wc * c[1] + wd * d[1],
        wa * a[2] + wb * b[2] + wc * c[2] + wd * d[2],
    )


@inlined
def sample_texture(pool, texture, u, v):
    """Return linear RGB (three float64) of a texture of the pool at texture coordinates u, v.

    Coordinates that are not numbers, or too far out to be indices, count as 0.
    """
    x = u * pool.width[texture]
    y = v * pool.height[texture]
    if not abs(x) < _FARTHEST:
        x = 0.0
    if not abs(y) < _FARTHEST:
        y = 0.0
    if pool.interpolate[texture]:
        red, green, blue = _bilinear(pool, texture, x, y)
    else:
        red, green, blue = _texel(pool, texture, math.floor(x), math.floor(y))
    if pool.encoded[texture]:
        return decode_srgb(red), decode_srgb(green), decode_srgb(blue)
    return red, green, blue


@inlined
def surface_albedo(material, u, v, albedo, texture, pool):
    """Return a material's diffuse reflectance (three float64 in [0, 1]) at texture coordinates.

    Parameters
    ----------
    material
        Index into `albedo` and `texture`.
    u, v
        Texture coordinates; of no meaning where the material has no texture.
    albedo : (m, 3) float32, texture : (m,) int32
        See `scene.Materials`.
    pool : TexturePool
    """
    red, green, blue = float(albedo[material, 0]), float(albedo[material, 1]), float(albedo[material, 2])
    index = texture[material]
    if index != NO_TEXTURE:
        r, g, b = sample_texture(pool, index, u, v)
        red = min(max(red * r, 0.0), 1.0)
        green = min(max(green * g, 0.0), 1.0)
        blue = min(max(blue * b, 0.0), 1.0)
    return red, green, blue
