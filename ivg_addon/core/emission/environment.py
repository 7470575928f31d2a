# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons from environment maps: a texel by its light, a direction in it, a point of the box.

Light of radiance L from the solid angle Ω of a texel enters the box around the scene with the power
L ∫_Ω A(d) dω, A(d) = Σ_k A_k |d_k| the area that the box shows (`distant.py`). A texel is picked in
proportion to the largest channel of L Ω A*, A* an upper bound of A over the texel; a direction
uniform in it, then a point uniform over the faces that it enters. Where A(d) is smaller than A*,
the difference is the chance that the photon misses the box.

Rows are picked by one uniform number and the texel of the row by another, each by inverting sums:
neighbouring numbers are neighbouring directions, which is what lets `guide.py` aim.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import merged
from ..environment import EnvironmentMap, Float32
from ..vectors import sine_and_cosine
from .distant import Box, enter_box
from .search import first_above

Float64 = NDArray[np.float64]
Int64 = NDArray[np.int64]

_TURN = 2.0 * math.pi


class MapEmitters(NamedTuple):
    """Environment maps as the kernel sees them, one after the other in each array, for one box after the other.

    first_row, first_column, first_texel : (boxes · maps + 1,) int64
        Where each map begins in the arrays below.
    row_sums : (rows,) float64
        Share of the map's strength up to and with each row.
    texel_sums : (texels,) float64
        Share of the row's strength up to and with each texel.
    color : (texels, 3) float32
        Radiance over its largest channel; not repeated from box to box.
    latitude, longitude : (maps, 2) float64
        Of the map's lower or left edge, and of one texel; longitudes in turns, latitudes in radians.
    row_bounds : (rows, 3) float64, column_bounds : (columns, 3) float64
        Upper bounds of the factors of |d_k|: (cos b, cos b, sin b) over each row, (cos ℓ, sin ℓ, 1) over each column.
    """

    first_row: Int64
    first_column: Int64
    first_texel: Int64
    row_sums: Float64
    texel_sums: Float64
    color: Float32
    latitude: Float64
    longitude: Float64
    row_bounds: Float64
    column_bounds: Float64

    @classmethod
    def of(cls, maps: tuple[EnvironmentMap, ...], boxes: tuple[Box, ...]) -> MapEmitters:
        """Gather the arrays that the kernel needs."""
        everywhere = maps * len(boxes)
        shapes = [one.radiance.shape[:2] for one in everywhere]
        bounds = [_bounds(one) for one in everywhere]
        sums = [_sums(one, box) for box in boxes for one in maps]
        return cls(
            first_row=np.cumsum([0, *(h for h, _ in shapes)]),
            first_column=np.cumsum([0, *(w for _, w in shapes)]),
            first_texel=np.cumsum([0, *(h * w for h, w in shapes)]),
            row_sums=_joined([rows for rows, _ in sums], ()),
            texel_sums=_joined([texels for _, texels in sums], ()),
            color=_joined([_color(one) for one in maps], (3,)).astype(np.float32),
            latitude=np.array([_start_and_step(one.row_edges) for one in everywhere]).reshape(-1, 2),
            longitude=np.array([_start_and_step(one.column_edges) for one in everywhere]).reshape(-1, 2)
            / (2.0 * math.pi),
            row_bounds=_joined([rows for rows, _ in bounds], (3,)),
            column_bounds=_joined([columns for _, columns in bounds], (3,)),
        )


def map_powers(maps: tuple[EnvironmentMap, ...], box: Box) -> Float64:
    """Return each map's power, (maps, 3) W: Σ L ∫_Ω A(d) dω over its texels, in closed form.

    ∫ |cos ℓ| dℓ ∫ cos² b db for the faces across x, |sin ℓ| for those across y, Δℓ ∫ |sin b| cos b db for z.
    """
    powers = np.zeros((len(maps), 3))
    for index, one in enumerate(maps):
        rows = np.stack([_cos2(one.row_edges), _cos2(one.row_edges), _sin_cos(one.row_edges)], axis=1)
        edges = one.column_edges
        columns = np.stack([_abs_cos(edges), _abs_cos(edges - 0.5 * math.pi), np.diff(edges)], axis=1)
        # By faces first: no array of the map's size in double precision.
        for axis in range(3):
            powers[index] += box.areas[axis] * np.einsum("h,hwc,w->c", rows[:, axis], one.radiance, columns[:, axis])
    return powers


def map_strengths(maps: tuple[EnvironmentMap, ...], box: Box) -> Float64:
    """Return the largest channel of what each map emits, photons that miss the box included: (maps,) W."""
    return np.array([float(_strength(one, box).sum()) for one in maps])


def _strength(one: EnvironmentMap, box: Box) -> Float64:
    """Return max_c L Ω A* of each texel, (h, w)."""
    rows, columns = _bounds(one)
    shown = np.minimum((rows * box.areas) @ columns.T, np.linalg.norm(box.areas))
    strength: Float64 = one.radiance.max(axis=-1) * (shown * one.solid_angles()[:, None])
    return strength


def _sums(one: EnvironmentMap, box: Box) -> tuple[Float64, Float64]:
    """Return the shares of rows in the map and of texels in their row, summed up: (h,) and (h · w,)."""
    strength = _strength(one, box)
    by_row = np.cumsum(strength, axis=1)
    of_rows = np.cumsum(by_row[:, -1])
    for total in (by_row[:, -1:], of_rows[-1:]):
        total[total == 0.0] = 1.0
    return of_rows / of_rows[-1], (by_row / by_row[:, -1:]).ravel()


def _bounds(one: EnvironmentMap) -> tuple[Float64, Float64]:
    """Return upper bounds of the factors of |d_k|, (h, 3) by row and (w, 3) by column."""
    sin_b, cos_b = np.abs(np.sin(one.row_edges)), np.cos(one.row_edges)
    across = one.row_edges[:-1] * one.row_edges[1:] < 0.0
    cos_row = np.where(across, 1.0, _larger(np.maximum(cos_b, 0.0)))
    columns = [
        np.where(_meets(one.column_edges, peak), 1.0, _larger(np.abs(np.cos(one.column_edges - peak))))
        for peak in (0.0, 0.5 * math.pi)
    ]
    ones = np.ones(one.radiance.shape[1])
    return np.stack([cos_row, cos_row, _larger(sin_b)], axis=1), np.stack([*columns, ones], axis=1)


def _larger(edges: Float64) -> Float64:
    return np.maximum(edges[:-1], edges[1:])


def _meets(edges: Float64, peak: float) -> NDArray[np.bool_]:
    """Tell between which edges there is a longitude `peak` + n π."""
    periods = (edges - peak) / math.pi
    return np.floor(periods[1:]) >= np.ceil(periods[:-1])


def _color(one: EnvironmentMap) -> Float32:
    """Return radiance over its largest channel, (h · w, 3)."""
    largest = one.radiance.max(axis=-1, keepdims=True)
    color: Float32 = np.divide(one.radiance, largest, out=np.zeros_like(one.radiance), where=largest > 0.0)
    return color.reshape(-1, 3)


def _start_and_step(edges: Float64) -> tuple[float, float]:
    return float(edges[0]), float(edges[-1] - edges[0]) / (len(edges) - 1)


def _joined(arrays: list[NDArray[np.floating]], item: tuple[int, ...]) -> Float64:
    """Return arrays one after the other, also when there is none."""
    return np.concatenate([np.empty((0, *item)), *arrays])


def _cos2(edges: Float64) -> Float64:
    return np.diff(0.5 * edges + 0.25 * np.sin(2.0 * edges))


def _sin_cos(edges: Float64) -> Float64:
    return np.diff(0.5 * np.sign(edges) * np.sin(edges) ** 2)


def _abs_cos(edges: Float64) -> Float64:
    # ∫₀ˣ |cos| = 2n + (−1)ⁿ sin x, n the number of the half turn that x lies in.
    turn = np.round(edges / math.pi)
    return np.diff(2.0 * turn + np.sin(edges - turn * math.pi))


@merged
def emit_map(
    first_row,
    first_column,
    first_texel,
    row_sums,
    texel_sums,
    latitude,
    longitude,
    row_bounds,
    column_bounds,
    one,
    box_low,
    box_high,
    box_areas,
    box,
    xi_0,
    xi_1,
    xi_2,
    xi_3,
    xi_4,
):
    """Return the photon's origin on the box and direction, six floats, whether it hits the box, and its texel.

    Parameters
    ----------
    first_row … column_bounds
        The fields of `MapEmitters`, one by one: taken out of their tuple for every photon, Numba would count references
        to each of them.
    one
        Index of the map, among those for the box.
    box_low, box_high, box_areas
        The fields of `Box.stacked`.
    box
        Index of the box.
    xi_0 … xi_4
        Uniform in (0, 1): two pick the direction, one the face, two the place.
    """
    row, down = _invert(row_sums, first_row[one], first_row[one + 1], xi_0)
    columns = first_column[one + 1] - first_column[one]
    line = first_texel[one] + (row - first_row[one]) * columns
    texel, along = _invert(texel_sums, line, line + columns, xi_1)
    column = first_column[one] + texel - line

    # Uniform in the texel's solid angle: uniform in the sine of the latitude.
    b = latitude[one, 0] + (row - first_row[one]) * latitude[one, 1]
    low, high = math.sin(b), math.sin(b + latitude[one, 1])
    sin_b = low + (high - low) * down
    cos_b = math.sqrt(max(0.0, 1.0 - sin_b * sin_b))
    turns = longitude[one, 0] + (texel - line + along) * longitude[one, 1]
    sine, cosine = sine_and_cosine(turns - math.floor(turns))
    # Light flies against the direction that it comes from.
    d0, d1, d2 = -cos_b * cosine, cos_b * sine, -sin_b

    largest = math.sqrt(box_areas[box, 0] ** 2 + box_areas[box, 1] ** 2 + box_areas[box, 2] ** 2)
    bound = 0.0
    for axis in range(3):
        bound += box_areas[box, axis] * row_bounds[row, axis] * column_bounds[column, axis]
    t = xi_2 * min(bound, largest)
    ox, oy, oz, enters = enter_box(box_low, box_high, box_areas, box, d0, d1, d2, t, xi_3, xi_4)
    return ox, oy, oz, d0, d1, d2, enters, texel


@merged
def _invert(sums, first, end, x):
    """Return the first index in first … end − 1 whose sum exceeds x, and where in its step x lies, 0 to 1."""
    index = first_above(sums, first, end - 1, x)
    below = sums[index - 1] if index > first else 0.0
    step = sums[index] - below
    return index, min(max((x - below) / step, 0.0), 1.0) if step > 0.0 else 0.5
