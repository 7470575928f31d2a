# SPDX-License-Identifier: GPL-3.0-or-later
"""Patterns of lights that do not shine evenly: a texel by its share of the light, then a place in it.

A pattern's factors f multiply the light of a lamp, texel by texel. A photon picks a texel of size a, solid angle or
area, in proportion to a · max f, and has the weight f / max f there.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import merged
from ..lights import NO_PATTERN, Lights, Pattern
from ..scene import Float32, Int32
from .search import first_above

Float64 = NDArray[np.float64]


class PatternEmitters(NamedTuple):
    """Patterns as the kernel sees them, texels of all p patterns in a row.

    area : (areas,) int32, point : (points,) int32
        The pattern of each light, or `NO_PATTERN`.
    first : (p + 1,) int64
        Where the texels of each begin.
    columns, rows : (p,) int32
    sums : (texels,) float64
        Share of the pattern's light up to and with each texel; starts anew with each pattern.
    color : (texels, 3) float32
        f / max f.
    """

    area: Int32
    point: Int32
    first: NDArray[np.int64]
    columns: Int32
    rows: Int32
    sums: Float64
    color: Float32

    @classmethod
    def of(cls, lights: Lights) -> PatternEmitters:
        """Gather the arrays that the kernel needs."""
        half_angle = _half_angles(lights)
        sums, color = [np.zeros(0)], [np.zeros((0, 3), dtype=np.float32)]
        for index, pattern in enumerate(lights.patterns):
            largest = pattern.factor.max(axis=2)
            light = np.cumsum(_sizes(pattern, half_angle[index]) * largest, dtype=np.float64)
            sums.append(light / (light[-1] or 1.0))
            share = np.divide(
                pattern.factor, largest[..., None], where=largest[..., None] > 0.0, out=0 * pattern.factor
            )
            color.append(share.reshape(-1, 3))
        return cls(
            area=_pattern_of(lights.area.pattern, len(lights.area.names)),
            point=_pattern_of(lights.point.pattern, len(lights.point.names)),
            first=np.cumsum([0, *(pattern.factor[..., 0].size for pattern in lights.patterns)], dtype=np.int64),
            columns=np.array([pattern.factor.shape[1] for pattern in lights.patterns], dtype=np.int32),
            rows=np.array([pattern.factor.shape[0] for pattern in lights.patterns], dtype=np.int32),
            sums=np.concatenate(sums),
            color=np.concatenate(color),
        )


def _pattern_of(pattern: Int32 | None, count: int) -> Int32:
    return np.full(count, NO_PATTERN, dtype=np.int32) if pattern is None else pattern


def _half_angles(lights: Lights) -> dict[int, float]:
    """Return the angle that each pattern of a point or spot reaches out to; others have none."""
    angles = dict.fromkeys(range(len(lights.patterns)), 0.0)
    for pattern, cosine in zip(
        _pattern_of(lights.point.pattern, len(lights.point.names)), lights.point.cos_half_angle, strict=True
    ):
        angles[int(pattern)] = math.acos(max(-1.0, min(1.0, float(cosine))))
    return angles


def _sizes(pattern: Pattern, half_angle: float) -> Float64:
    """Return the texels' shares of the pattern's area or solid angle, (rows, columns)."""
    rows, columns = pattern.factor.shape[:2]
    if half_angle == 0.0:
        return np.full((rows, columns), 1.0 / (rows * columns))
    bands = -np.diff(np.cos(np.linspace(0.0, half_angle, rows + 1))) / (1.0 - math.cos(half_angle))
    return np.broadcast_to(bands[:, None] / columns, (rows, columns))


def apply_patterns(lights: Lights, powers: list[Float64], sampled: list[Float64]) -> None:
    """Multiply the powers of area lights and of points by their patterns, in place.

    Parameters
    ----------
    powers, sampled
        First those of area lights (areas, 3), then those of points (points, 3): what they emit, and what photons
        stand for. An ellipse's photons are picked from the whole rectangle; those outside do not exist.
    """
    half_angle = _half_angles(lights)
    elliptic = lights.area.elliptic, np.zeros(len(lights.point.names), dtype=np.bool_)
    means: dict[tuple[int, bool], tuple[Float64, float]] = {}
    for kind, pattern in enumerate((lights.area.pattern, lights.point.pattern)):
        for light, index in enumerate(() if pattern is None else pattern.tolist()):
            if index == NO_PATTERN:
                continue
            key = index, bool(elliptic[kind][light])
            if key not in means:
                means[key] = _means(lights.patterns[index], half_angle[index], key[1])
            powers[kind][light] *= means[key][0]
            sampled[kind][light] *= means[key][1]


def _means(pattern: Pattern, half_angle: float, cut: bool) -> tuple[Float64, float]:
    """Return the mean of f, (3,), within an ellipse if one cuts the pattern, and what photons stand for over it."""
    factor, sizes = pattern.factor.astype(np.float64), _sizes(pattern, half_angle)
    inside = _inside(*sizes.shape) * sizes if cut else sizes
    largest = float((factor.max(axis=2) * sizes).sum()) * (4.0 / math.pi if cut else 1.0)
    return (factor * inside[..., None]).sum(axis=(0, 1)) / inside.sum(), largest


def _inside(rows: int, columns: int) -> Float64:
    """Return 1 for texels whose middle lies in the ellipse, else 0; (rows, columns)."""
    x, y = (np.arange(columns) + 0.5) / columns - 0.5, (np.arange(rows) + 0.5) / rows - 0.5
    return (x**2 + y[:, None] ** 2 < 0.25).astype(np.float64)


@merged
def pick_texel(first, columns, sums, pattern, xi):
    """Return the texel that a number uniform in (0, 1) falls on, counted through all patterns; its row; its column."""
    texel = first_above(sums, first[pattern], first[pattern + 1] - 1, xi)
    row, column = divmod(texel - first[pattern], columns[pattern])
    return texel, row, column
