# SPDX-License-Identifier: GPL-3.0-or-later
"""Surroundings that differ from direction to direction, as maps of radiance.

A map is equirectangular, with the axes of Blender's panoramic camera: longitude ℓ and latitude b are

    ω = (cos b cos ℓ, −cos b sin ℓ, sin b)

so the middle of a map of the whole sphere is +x, a quarter to the right of it −y, and the first row
looks straight down. Light comes from ω. Radiance is constant over a texel.

A sun that spans less than a texel would lose its direction. So a sky is several maps: one of the
whole sphere, and small ones with finer texels of what is small and bright; where they are, the
large one is black.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float32 = NDArray[np.float32]
Float64 = NDArray[np.float64]


@dataclass(frozen=True)
class EnvironmentMap:
    """Radiance that arrives from a rectangle of directions.

    Parameters
    ----------
    radiance : (h, w, 3) float32
        W/(m² sr), finite and not negative; see `cleaned`. Longitude grows along a row, latitude from row to row.
    longitude : (float, float)
        Of the first column's left and the last column's right edge, radians.
    latitude : (float, float)
        Of the first row's lower and the last row's upper edge, radians.
    """

    radiance: Float32
    longitude: tuple[float, float] = (-math.pi, math.pi)
    latitude: tuple[float, float] = (-0.5 * math.pi, 0.5 * math.pi)

    @property
    def column_edges(self) -> Float64:
        """Return the longitudes between columns, (w + 1,)."""
        return np.linspace(*self.longitude, self.radiance.shape[1] + 1)

    @property
    def row_edges(self) -> Float64:
        """Return the latitudes between rows, (h + 1,)."""
        return np.linspace(*self.latitude, self.radiance.shape[0] + 1)

    def solid_angles(self) -> Float64:
        """Return what a texel of each row spans, (h,) sr: Δℓ (sin b₁ − sin b₀)."""
        width = (self.longitude[1] - self.longitude[0]) / self.radiance.shape[1]
        angles: Float64 = width * np.diff(np.sin(self.row_edges))
        return angles

    def shines(self) -> bool:
        """Tell whether it is not all black."""
        return bool((self.radiance > 0.0).any())


@dataclass(frozen=True)
class Cleaned:
    """A map without values that no light has, and how many texels had them."""

    radiance: Float32
    not_numbers: int
    negative: int


def cleaned(radiance: ArrayLike) -> Cleaned:
    """Make texels (h, w, 3) with a channel that is infinite or no number black, and cut negative ones off at 0."""
    pixels = np.array(radiance, dtype=np.float32)
    bad = ~np.isfinite(pixels).all(axis=-1)
    pixels[bad] = 0.0
    negative = (pixels < 0.0).any(axis=-1)
    np.maximum(pixels, 0.0, out=pixels)
    return Cleaned(pixels, int(bad.sum()), int(negative.sum()))


MOST_SPOTS = 16
"""Rectangles that `bright_spots` finds at most."""
SPOT_SHARE = 1e-3
"""Share of all light from which on a single texel is too coarse for it."""
_SPOT_CONTRAST = 8.0
"""Times the radiance around it that such a texel has at least."""
_MARGIN = 2


@dataclass(frozen=True)
class Spot:
    """A rectangle of a map's texels: rows and columns from the first up to the one after the last."""

    rows: tuple[int, int]
    columns: tuple[int, int]

    @property
    def texels(self) -> tuple[slice, slice]:
        """Return the rectangle as an index."""
        return slice(*self.rows), slice(*self.columns)

    def scaled(self, factor: int) -> Spot:
        """Return the same rectangle of a map whose texels are so many times finer."""
        (bottom, top), (left, right) = self.rows, self.columns
        return Spot((factor * bottom, factor * top), (factor * left, factor * right))


def bright_spots(whole: EnvironmentMap) -> list[Spot]:
    """Return where a map holds much light in few texels, brightest first: disjoint rectangles with a margin.

    Such a texel has more than `SPOT_SHARE` of all light (by its largest channel) and stands out from the mean of the
    texels around it. Rectangles do not reach over the map's edges.
    """
    strength = whole.radiance.max(axis=-1).astype(np.float64)
    light = strength * whole.solid_angles()[:, None]
    total = float(light.sum())
    if not total > 0.0:
        return []
    spots: list[Spot] = []
    candidates = np.argwhere(light > SPOT_SHARE * total)
    for row, column in candidates[np.argsort(-light[tuple(candidates.T)], kind="stable")]:
        if _stands_out(strength, row, column):
            rows, columns = (_around(at, count) for at, count in zip((row, column), light.shape, strict=True))
            spots = _merged(Spot(rows, columns), spots)
        if len(spots) == MOST_SPOTS:
            break
    return spots


def _around(at: int, count: int) -> tuple[int, int]:
    return max(int(at) - _MARGIN, 0), min(int(at) + 1 + _MARGIN, count)


def _stands_out(strength: Float64, row: int, column: int) -> bool:
    """Tell whether a texel is much brighter than the rim of a window around it."""
    reach = 4 * _MARGIN
    window = strength[max(row - reach, 0) : row + reach + 1, max(column - reach, 0) : column + reach + 1]
    rim = np.concatenate([window[0], window[-1], window[1:-1, 0], window[1:-1, -1]])
    return bool(strength[row, column] > _SPOT_CONTRAST * np.median(rim))


def _merged(spot: Spot, spots: list[Spot]) -> list[Spot]:
    """Add a spot to disjoint ones; it takes in those that it meets."""
    apart: list[Spot] = []
    for other in spots:
        if all(a[0] < b[1] and b[0] < a[1] for a, b in ((spot.rows, other.rows), (spot.columns, other.columns))):
            spot = Spot(
                (min(spot.rows[0], other.rows[0]), max(spot.rows[1], other.rows[1])),
                (min(spot.columns[0], other.columns[0]), max(spot.columns[1], other.columns[1])),
            )
            return _merged(spot, [*apart, *spots[len(apart) + 1 :]])
        apart.append(other)
    return [*apart, spot]


def disjoint(spots: list[Spot]) -> list[Spot]:
    """Return rectangles that cover those given and do not overlap."""
    apart: list[Spot] = []
    for spot in spots:
        apart = _merged(spot, apart)
    return apart


def without_spots(whole: EnvironmentMap, spots: list[Spot]) -> EnvironmentMap:
    """Return a map that is black where the spots are."""
    radiance = whole.radiance.copy()
    for spot in spots:
        radiance[spot.texels] = 0.0
    return replace(whole, radiance=radiance)
