# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers as colours: signed differences (too bright glows orange, too dark blue), and amounts from dark to bright."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64 = NDArray[np.float64]

_STEPS = (1.0, 2.0, 5.0, 10.0)

# From −1 to 1, sRGB; as light at both ends, so that either sign stands out alike.
_STOPS = (-1.0, -0.5, 0.0, 0.5, 1.0)
_COLORS = (
    (0.62, 0.86, 1.00),
    (0.10, 0.42, 0.90),
    (0.06, 0.06, 0.07),
    (0.90, 0.32, 0.06),
    (1.00, 0.85, 0.55),
)

_LIGHT_STOPS = (0.0, 0.25, 0.5, 0.75, 1.0)
_LIGHT_COLORS = (
    (0.00, 0.00, 0.01),
    (0.34, 0.06, 0.43),
    (0.74, 0.22, 0.33),
    (0.98, 0.56, 0.04),
    (0.99, 1.00, 0.65),
)


def luminance(rgb: ArrayLike) -> Float64:
    """Return the luminance (…) of linear RGB (…, 3), Rec. 709."""
    return np.asarray(np.asarray(rgb, dtype=np.float64) @ (0.2126, 0.7152, 0.0722))


def difference_colors(values: ArrayLike) -> Float64:
    """Return display colours (…, 3) in [0, 1] of values (…) in [−1, 1]; beyond, the last colour."""
    v = np.clip(np.asarray(values, dtype=np.float64), -1.0, 1.0)
    return np.stack([np.interp(v, _STOPS, channel) for channel in zip(*_COLORS, strict=True)], axis=-1)


def light_colors(values: ArrayLike) -> Float64:
    """Return display colours (…, 3) in [0, 1] of amounts (…) in [0, 1]; more is lighter, beyond is the last colour."""
    v = np.clip(np.asarray(values, dtype=np.float64), 0.0, 1.0)
    return np.stack([np.interp(v, _LIGHT_STOPS, channel) for channel in zip(*_LIGHT_COLORS, strict=True)], axis=-1)


def linear(colors: ArrayLike) -> Float64:
    """Return the light of display colours: sRGB decoded (IEC 61966-2-1)."""
    c = np.asarray(colors, dtype=np.float64)
    return np.where(c <= 0.04045, c / 12.92, ((np.maximum(c, 0.04045) + 0.055) / 1.055) ** 2.4)


def round_scale(values: ArrayLike) -> float:
    """Return 1, 2 or 5 times a power of ten that nineteen of twenty values stay within, signs aside; 0.01 at least."""
    wide = max(float(np.percentile(np.abs(np.asarray(values)), 95.0)), 0.01)
    power = 10.0 ** np.floor(np.log10(wide))
    return float(next(step * power for step in _STEPS if step * power >= wide * (1.0 - 1e-4)))


def local_mean(values: ArrayLike, weights: ArrayLike, size: int) -> Float64:
    """Return the weighted means of the values around each pixel.

    The weights fall linearly from each pixel outward along either axis, over `size` pixels: two box filters in a row.

    Parameters
    ----------
    values, weights : (height, width)
        Zero where all weights around are zero.
    size
        Odd; 1 changes nothing.
    """
    w = np.asarray(weights, dtype=np.float64)
    total = _square_sums(_square_sums(np.asarray(values) * w, size), size)
    weight = _square_sums(_square_sums(w, size), size)
    return np.divide(total, weight, out=np.zeros_like(total), where=weight > 1e-9)


def _square_sums(values: Float64, size: int) -> Float64:
    """Return sums over the square of pixels around each pixel, by differences of running sums along either axis."""
    for axis in (0, 1):
        padding = [(0, 0), (0, 0)]
        padding[axis] = (size // 2 + 1, size // 2)
        running = np.cumsum(np.pad(values, padding), axis=axis)
        count = running.shape[axis]
        values = np.take(running, np.arange(size, count), axis) - np.take(running, np.arange(count - size), axis)
    return values
