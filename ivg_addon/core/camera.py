# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera, and how its pixels gather what it sees. Needs neither Blender nor Numba."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .errors import SettingsError

Float64 = NDArray[np.float64]

_TABLE = 1024
"""Steps of the inverted pixel filter."""


class Projection(StrEnum):
    """How a camera maps the world to its picture."""

    PERSPECTIVE = "PERSPECTIVE"
    ORTHOGRAPHIC = "ORTHOGRAPHIC"


class PixelFilter(StrEnum):
    """How the samples of a pixel are spread around its centre; names as in Cycles."""

    BOX = "BOX"
    GAUSSIAN = "GAUSSIAN"
    BLACKMAN_HARRIS = "BLACKMAN_HARRIS"


@dataclass(frozen=True)
class Camera:
    """A camera, and the picture that it takes.

    Parameters
    ----------
    name
        The camera object's name.
    matrix : (4, 4) float64
        Camera to world. The camera looks along −z, y is up; the first three columns are unit vectors.
    projection
        See `Projection`.
    frame
        Left, right, bottom and top of the picture: at depth 1 in perspective, in metres if orthographic. Lens, sensor,
        shift and pixel aspect are all in it.
    clip_start, clip_end
        Depths between which surfaces are seen, metres.
    width, height
        Pixels.
    filter, filter_width
        How the samples of a pixel are spread, and how far, in pixels: see `filter_offsets`.
    """

    name: str
    matrix: Float64
    projection: Projection
    frame: tuple[float, float, float, float]
    clip_start: float
    clip_end: float
    width: int
    height: int
    filter: PixelFilter = PixelFilter.BLACKMAN_HARRIS
    filter_width: float = 1.5

    def __post_init__(self) -> None:
        """Check what would give no picture; raises `SettingsError`."""
        left, right, bottom, top = self.frame
        if min(self.width, self.height) < 1:
            raise SettingsError(f"camera '{self.name}': a picture of {self.width} × {self.height} pixels is empty")
        if not (left < right and bottom < top and 0.0 <= self.clip_start < self.clip_end):
            raise SettingsError(f"camera '{self.name}': lens or clipping distances leave nothing to see")

    @cached_property
    def offsets(self) -> Float64:
        """The inverted pixel filter; see `filter_offsets`."""
        return filter_offsets(self.filter, self.filter_width)

    @property
    def reach(self) -> float:
        """Longest distance along a ray of `camera_rays` that is seen, in units of its direction's length."""
        return self.clip_end - self.clip_start


def filter_offsets(kind: PixelFilter, width: float) -> Float64:
    """Return the inverse of the filter's distribution function at 0, 1/1024 … 1: (1025,) offsets in pixels.

    Samples are sent where the filter wants them, and all weigh the same. With Cycles' meaning of the filter's width w,

        box:              f(x) = 1                                                          |x| ≤ w/2
        Gaussian:         f(x) = exp(−8 x²/w²)                                              |x| ≤ 3w/2
        Blackman-Harris:  f(x) = 0.35875 + 0.48829 cos t + 0.14128 cos 2t + 0.01168 cos 3t  |x| ≤ w, t = π x/w
    """
    reach = width * {PixelFilter.BOX: 0.5, PixelFilter.GAUSSIAN: 1.5, PixelFilter.BLACKMAN_HARRIS: 1.0}[kind]
    x = np.linspace(-reach, reach, 16 * _TABLE + 1)
    t = np.pi * x / width
    if kind is PixelFilter.BOX:
        f = np.ones_like(x)
    elif kind is PixelFilter.GAUSSIAN:
        f = np.exp(-8.0 * (x / width) ** 2)
    else:
        f = 0.35875 + 0.48829 * np.cos(t) + 0.14128 * np.cos(2 * t) + 0.01168 * np.cos(3 * t)
    distribution = np.concatenate([[0.0], np.cumsum(f[1:] + f[:-1])])
    return np.asarray(np.interp(np.linspace(0.0, 1.0, _TABLE + 1), distribution / distribution[-1], x))
