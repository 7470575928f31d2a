# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures for the walls and planks for the floor, painted by formulas; packed into the .blend."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np

Painter = Callable[[np.ndarray, np.ndarray], np.ndarray]


def paint(name: str, painter: Painter, size: tuple[int, int]) -> bpy.types.Image:
    """Return a packed image of (width, height) pixels.

    The painter gets arrays of v in [0, 1], upward, and of u in the same unit, to the right, and
    returns display-encoded RGB.
    """
    width, height = size
    v, u = np.meshgrid((np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / height, indexing="ij")
    pixels = np.ones((height, width, 4), dtype=np.float32)
    pixels[..., :3] = np.clip(painter(u, v), 0.0, 1.0)
    image = bpy.data.images.new(name, width, height, alpha=False)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    return image


def evening(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Paint a low sun over water."""
    sky = _ramp(v, (0.42, 0.6, 0.8, 1.0), ("f6b25a", "e8705a", "8a4a78", "3a3566"))
    water = _ramp(v, (0.0, 0.25, 0.42), ("1f2a4a", "4a4470", "d98a62"))
    picture = np.where((v > 0.42)[..., None], sky, water)
    sun = np.hypot(u - 0.85, v - 0.56) < 0.13
    picture[sun & (v > 0.42)] = _rgb("fff0c0")
    band = (v < 0.42) & (np.abs(u - 0.85) < 0.05 + 0.12 * np.sin(v * 95.0) ** 2 * (0.45 - v))
    picture[band] = _rgb("ffd795")
    return picture


def discs(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Paint rows of squares with rings in them, no two coloured alike."""
    palette = _palette("e4572e", "29335c", "f3a712", "a8c686", "669bbc", "f4ead5", "8c2f39")
    cells = 3.0
    column, row = np.floor(u * cells), np.floor(v * cells)
    distance = np.hypot(u * cells - column - 0.5, v * cells - row - 0.5)
    ring = np.minimum(np.floor(distance * 7.0), 4.0)
    choice = (5.0 * column + 3.0 * row + 2.0 * ring + column * row * ring).astype(int)
    return palette[choice % len(palette)]


def grid(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Paint black lines across white with a few fields of plain colour."""
    picture = np.full((*u.shape, 3), 0.93)
    fields = (
        ((0.0, 0.42), (0.45, 1.0), "c8281e"),
        ((1.05, 1.4), (0.0, 0.3), "1f4e9e"),
        ((0.0, 0.2), (0.0, 0.22), "edc31f"),
        ((1.05, 1.4), (0.78, 1.0), "edc31f"),
    )
    for (left, right), (low, high), colour in fields:
        picture[(u >= left) & (u < right) & (v >= low) & (v < high)] = _rgb(colour)
    lines = [np.abs(u - at) < 0.018 for at in (0.42, 1.05)]
    lines += [np.abs(v - at) < 0.018 for at in (0.45, 0.78)]
    lines += [(np.abs(v - 0.22) < 0.018) & (u < 0.42), (np.abs(u - 0.2) < 0.018) & (v < 0.45)]
    lines += [(np.abs(v - 0.3) < 0.018) & (u > 1.05)]
    picture[np.any(lines, axis=0)] = _rgb("141414")
    return picture


def mountains(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Paint ridges behind ridges in mist."""
    picture = _ramp(v, (0.4, 1.0), ("f5e6d0", "9cc3d5"))
    rng = np.random.default_rng(7)
    shades = ("a9c0c4", "7fa3ad", "55808f", "345c6e", "1c3a4a")
    for layer, shade in enumerate(shades):
        ridge = 0.72 - 0.14 * layer
        for octave in range(1, 6):
            phase = rng.uniform(0.0, 2.0 * np.pi)
            ridge = ridge + 0.09 / octave * np.sin(2.6 * octave * u + phase) * (1.0 - 0.1 * layer)
        picture[v < ridge] = _rgb(shade)
    return picture


def mosaic(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Paint a mosaic of irregular cells, warm in the middle."""
    palette = _palette("f7d27a", "ee9b4a", "d1603d", "8f3b4f", "45395f", "23395b")
    rng = np.random.default_rng(3)
    seeds = rng.uniform((-0.1, -0.1), (1.5, 1.1), size=(90, 2))
    distance = np.hypot(u[..., None] - seeds[:, 0], v[..., None] - seeds[:, 1])
    order = np.argsort(distance, axis=-1)[..., :2]
    nearest, second = np.moveaxis(np.take_along_axis(distance, order, axis=-1), -1, 0)
    cell = order[..., 0]
    from_centre = np.hypot(seeds[:, 0] - 0.67, seeds[:, 1] - 0.5) * 8.5
    choice = np.clip(from_centre + rng.uniform(-0.8, 0.8, len(seeds)), 0, 5).astype(int)
    picture = palette[choice[cell]]
    picture[second - nearest < 0.012] = _rgb("18181c")
    return picture


def ripples(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Paint the waves of two stones thrown into a pond."""
    first, second = np.hypot(u - 0.35, v - 0.3), np.hypot(u - 1.0, v - 0.68)
    height = np.sin(42.0 * first) / (1.0 + 2.5 * first)
    height += np.sin(42.0 * second) / (1.0 + 2.5 * second)
    stops = (-1.2, -0.3, 0.3, 1.2)
    return _ramp(np.round(height * 3.0) / 3.0, stops, ("123b3a", "2f7f79", "8fc9b0", "f3f1dc"))


def ribbons(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Paint wide bands that bend across the canvas."""
    palette = _palette("f2e3c6", "d9583b", "f0a23c", "2c6e7f", "173a4f", "a8323e")
    across = 3.4 * v + 0.55 * np.sin(2.1 * u + 0.6) + 0.25 * np.sin(4.7 * u - 1.4) + 0.6 * u
    return palette[np.floor(across * 2.4).astype(int) % len(palette)]


def planks(u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Paint twelve rows of floor boards along v, two to a row, with edges that match when tiled."""
    rng = np.random.default_rng(11)
    rows = 12
    row = np.floor(u * rows).astype(int)
    along = v * 2.0 + np.array([0.0, 0.62, 0.27, 0.81, 0.43, 0.12] * 2)[row]
    board = np.floor(along).astype(int) % 2
    tint = rng.uniform(0.86, 1.06, size=(rows, 2))[row, board]
    seam = (np.abs(u * rows - row - 0.5) > 0.46) | (np.abs(along - np.round(along)) < 0.006)
    return _rgb("a8784e") * np.where(seam, 0.62, tint)[..., None]


def _rgb(code: str) -> np.ndarray:
    """Return the colour of a six-digit hexadecimal code."""
    return np.array([int(code[i : i + 2], 16) for i in (0, 2, 4)]) / 255.0


def _palette(*codes: str) -> np.ndarray:
    return np.array([_rgb(code) for code in codes])


def _ramp(value: np.ndarray, stops: tuple[float, ...], codes: tuple[str, ...]) -> np.ndarray:
    """Return colours that run linearly between those at the stops."""
    colours = _palette(*codes)
    return np.stack([np.interp(value, stops, colours[:, c]) for c in range(3)], axis=-1)
