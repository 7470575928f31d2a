# SPDX-License-Identifier: GPL-3.0-or-later
"""Emissive triangles, those with textures cut into pieces over which the texture varies little.

A triangle is cut into N² equal ones, N a power of two, until a piece spans about one texel. For each piece
a bound B of its radiance is known: the largest channel of any texel that a look-up inside it can read. A
photon picks a piece in proportion to B times its area, starts at a point p anywhere on it, and carries
L(p) / B ≤ 1. So light follows L(p) exactly; what B is too large by costs photons that carry less, and nothing else.

Pieces lie in rows: the point (r, c), 0 ≤ c ≤ r ≤ N, has the barycentric coordinates (1 − r/N, (r − c)/N, c/N), and
row r holds 2r + 1 pieces, those with a corner towards the first vertex and those with an edge by turns.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import inlined, kernel, merged
from ..scene import NO_TEXTURE, Float32, Geometry, Int32, Materials, Texture
from ..textures import CLIP, EXTEND, REPEAT, TexturePool, pack_textures

Float64 = NDArray[np.float64]

BOTH_SIDES, FRONT_SIDE, BACK_SIDE = range(3)
"""Which sides of its triangle a piece shines from."""

MOST_PIECES = 1 << 22
"""Pieces that textured triangles are cut into at most: where more would be needed, they are larger."""
_DEEPEST = 14
_CELLS = 4
"""A piece's texels are covered by about so many cells of the pyramid of maxima along each axis."""
_SLACK = 1e-6
"""Texels that rounding may move a look-up by."""
_FARTHEST = 1e9


class Pieces(NamedTuple):
    """What shines, piece by piece.

    triangle : (n,) int32
        Index into the geometry's triangles.
    side : (n,) int8
        `BOTH_SIDES`, `FRONT_SIDE` or `BACK_SIDE`.
    material : (n,) int32
        The material that describes the side.
    divisions, part : (n,) int32
        N, and which of the triangle's N² pieces it is.
    bound : (n,) float32
        No channel of its radiance exceeds this in any direction, W/(m² sr).
    """

    triangle: Int32
    side: NDArray[np.int8]
    material: Int32
    divisions: Int32
    part: Int32
    bound: Float32


def cut_into_pieces(geometry: Geometry, materials: Materials, textures: tuple[Texture, ...], shines: Int32) -> Pieces:
    """Return the pieces of the triangles `shines` (m,) that emit, those without light left out."""
    front = geometry.material[shines]
    back = front if materials.back is None else materials.back[front]
    texture = emission_textures(materials)
    alike = (materials.emission[front] == materials.emission[back]).all(axis=1) & (texture[front] == texture[back])
    view = materials.emission_view
    brightest = np.ones(len(materials.emission), dtype=np.float32)
    if view is not None:
        alike &= (view[front] == view[back]).all(axis=(1, 2))
        brightest = np.maximum(view.max(axis=(1, 2)), 1.0).astype(np.float32)
    triangle = np.concatenate([shines[alike], shines[~alike], shines[~alike]])
    material = np.concatenate([front[alike], front[~alike], back[~alike]])
    sizes = np.count_nonzero(alike), np.count_nonzero(~alike), np.count_nonzero(~alike)
    side = np.repeat(np.array([BOTH_SIDES, FRONT_SIDE, BACK_SIDE], dtype=np.int8), sizes)
    emits = materials.emission[material].max(axis=1, initial=0.0) > 0.0
    triangle, material, side = triangle[emits], material[emits], side[emits]

    textured = texture[material] != NO_TEXTURE
    pieces = _plain(triangle[~textured], material[~textured], side[~textured], materials.emission)
    if textured.any():
        pieces = _joined(
            [pieces, *_textured(geometry, materials, textures, triangle[textured], material[textured], side[textured])]
        )
    return pieces._replace(bound=pieces.bound * brightest[pieces.material])


def emission_textures(materials: Materials) -> Int32:
    """Return each material's emission texture, (m,), `NO_TEXTURE` without."""
    if materials.emission_texture is not None:
        return materials.emission_texture
    return np.full(len(materials.emission), NO_TEXTURE, dtype=np.int32)


def _plain(triangle: Int32, material: Int32, side: NDArray[np.int8], emission: Float32) -> Pieces:
    """Return triangles of constant radiance, each as one piece."""
    return Pieces(
        triangle=triangle.astype(np.int32),
        side=side,
        material=material.astype(np.int32),
        divisions=np.ones(len(triangle), dtype=np.int32),
        part=np.zeros(len(triangle), dtype=np.int32),
        bound=emission[material].max(axis=1, initial=0.0),
    )


def _textured(
    geometry: Geometry,
    materials: Materials,
    textures: tuple[Texture, ...],
    triangle: Int32,
    material: Int32,
    side: NDArray[np.int8],
) -> list[Pieces]:
    """Cut triangles (t,); one item per material."""
    texture = emission_textures(materials)[material]
    divisions = _divisions(geometry.uvs[triangle], textures, texture)
    parts = []
    for one in np.unique(material):
        rows = np.flatnonzero(material == one)
        pool = pack_textures([textures[texture[rows[0]]]])
        pyramid, offset, width = _pyramid(pool, materials.emission[one])
        counts = divisions[rows].astype(np.int64) ** 2
        bound = np.empty(counts.sum(), dtype=np.float32)
        bound_pieces(geometry.uvs, triangle[rows], divisions[rows], pool, pyramid, offset, width, bound)
        first = np.cumsum(counts) - counts
        lit = np.flatnonzero(bound > 0.0)
        owner = np.searchsorted(first, lit, side="right") - 1
        parts.append(
            Pieces(
                triangle=triangle[rows][owner].astype(np.int32),
                side=side[rows][owner],
                material=material[rows][owner].astype(np.int32),
                divisions=divisions[rows][owner],
                part=(lit - first[owner]).astype(np.int32),
                bound=bound[lit],
            )
        )
    return parts


def _divisions(uvs: Float32, textures: tuple[Texture, ...], texture: Int32) -> Int32:
    """Return N of triangles with `uvs` (t, 3, 2) that show `texture` (t,)."""
    size = np.array([image.pixels.shape[1::-1] for image in textures], dtype=np.float64)[texture]
    corners = uvs.astype(np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        extent = ((corners.max(axis=1) - corners.min(axis=1)) * size).max(axis=1)
    extent = np.where(np.isfinite(extent), np.clip(extent, 1.0, 2.0**_DEEPEST), 1.0)
    depth = np.ceil(np.log2(extent)).astype(np.int64)
    deepest = _DEEPEST
    while deepest and (4 ** np.minimum(depth, deepest)).sum() > MOST_PIECES:
        deepest -= 1
    return np.asarray(2 ** np.minimum(depth, deepest), dtype=np.int32)


def _joined(parts: list[Pieces]) -> Pieces:
    return Pieces(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def _pyramid(image: TexturePool, emission: Float32) -> tuple[Float32, NDArray[np.int64], Int32]:
    """Return the largest channel of texels times emission, then maxima of 2 × 2 of those, and so on.

    Returns
    -------
    (n,) float32, (levels,) int64, (levels,) int32
        All levels, where each begins, and how wide it is. Values are rounded up.
    """
    texels = image.texels.reshape(image.height[0], image.width[0], 3).astype(np.float64)
    if image.encoded[0]:
        bright = ((np.maximum(texels, 0.04045) + 0.055) / 1.055) ** 2.4
        texels = np.where(texels <= 0.04045, texels / 12.92, bright)
    level = np.nextafter((texels * emission.astype(np.float64)).max(axis=2).astype(np.float32), np.float32(np.inf))
    level[~(texels * emission > 0.0).any(axis=2)] = 0.0
    levels = [level]
    while max(level.shape) > 1:
        height, wide = level.shape
        padded = np.pad(level, ((0, height % 2), (0, wide % 2)))
        level = padded.reshape(padded.shape[0] // 2, 2, padded.shape[1] // 2, 2).max(axis=(1, 3))
        levels.append(level)
    offset = np.cumsum([0, *(level.size for level in levels)], dtype=np.int64)[:-1]
    return (
        np.concatenate([level.reshape(-1) for level in levels]),
        offset,
        np.array([level.shape[1] for level in levels], dtype=np.int32),
    )


@kernel
def bound_pieces(uvs, triangle, divisions, image, pyramid, offset, width, bound):
    """Fill `bound` (Σ N²,) for triangles (t,) cut into divisions²; image and pyramid are those of one material."""
    wide, high = int(image.width[0]), int(image.height[0])
    extension = image.extension[0]
    reach = _SLACK + (0.5 if image.interpolate[0] else 0.0)
    piece = 0
    for t in range(len(triangle)):
        n = divisions[t]
        u = uvs[triangle[t], :, 0].astype(np.float64) * wide
        v = uvs[triangle[t], :, 1].astype(np.float64) * high
        near = (np.abs(u) < 0.5 * _FARTHEST).all() and (np.abs(v) < 0.5 * _FARTHEST).all()
        for index in range(n * n):
            if not near:
                bound[piece] = pyramid[offset[-1]]
                piece += 1
                continue
            x_low, x_high, y_low, y_high = _FARTHEST, -_FARTHEST, _FARTHEST, -_FARTHEST
            for c in range(3):
                s, p, q = place_in_triangle(n, index, c == 1, c == 2)
                x = s * u[0] + p * u[1] + q * u[2]
                y = s * v[0] + p * v[1] + q * v[2]
                x_low, x_high = min(x_low, x), max(x_high, x)
                y_low, y_high = min(y_low, y), max(y_high, y)
            a0, a1, b0, b1 = _texels_read(math.floor(x_low - reach), math.floor(x_high + reach), wide, extension)
            c0, c1, d0, d1 = _texels_read(math.floor(y_low - reach), math.floor(y_high + reach), high, extension)
            largest = _largest(pyramid, offset, width, a0, a1, c0, c1)
            largest = max(largest, _largest(pyramid, offset, width, a0, a1, d0, d1))
            largest = max(largest, _largest(pyramid, offset, width, b0, b1, c0, c1))
            bound[piece] = max(largest, _largest(pyramid, offset, width, b0, b1, d0, d1))
            piece += 1


@inlined
def place_in_triangle(divisions, index, u, v):
    """Return the barycentric coordinates in a triangle of the point (1 − u − v, u, v) of one of its pieces."""
    row = int(math.sqrt(index + 0.5))
    along = index - row * row
    column = along // 2
    if along % 2 == 0:
        r = row + u + v
        c = column + v
    else:
        r = row + u
        c = column + u + v
    return 1.0 - r / divisions, (r - c) / divisions, c / divisions


@inlined
def _texels_read(first, last, count, extension):
    """Return the columns (or rows) that stand at first … last, as two ranges; one is empty if its end precedes it."""
    if extension == EXTEND:
        return min(max(first, 0), count - 1), min(max(last, 0), count - 1), 0, -1
    if extension == CLIP:
        return max(first, 0), min(last, count - 1), 0, -1
    if last - first + 1 >= count:
        return 0, count - 1, 0, -1
    if extension == REPEAT:
        low = first % count
        high = low + last - first
        return low, min(high, count - 1), 0, high - count
    low = first % (2 * count)
    high = low + last - first
    if low < count:
        # Up to the edge, and what lies beyond it mirrored back.
        return low, min(high, count - 1), 2 * count - 1 - high, count - 1 if high >= count else -1
    return 2 * count - 1 - min(high, 2 * count - 1), 2 * count - 1 - low, 0, high - 2 * count


@merged
def _largest(pyramid, offset, width, x0, x1, y0, y1):
    """Return the maximum over texels x0 … x1 by y0 … y1, or of somewhat more; 0 of none."""
    level, span = 0, max(x1 - x0, y1 - y0)
    while span >> level > _CELLS:
        level += 1
    largest = np.float32(0.0)
    if x1 >= x0 and y1 >= y0:
        for y in range(y0 >> level, (y1 >> level) + 1):
            for x in range(x0 >> level, (x1 >> level) + 1):
                largest = max(largest, pyramid[offset[level] + y * width[level] + x])
    return largest
