# SPDX-License-Identifier: GPL-3.0-or-later
"""The round ends of hair that Cycles draws as linear curves: domes on the ends of prisms.

Cycles ends such a strand with half a sphere at either end: from all directions it shows π r² more than 2 r l sin θ. A
dome here has up to three bands of flat faces over the end of a prism, and is as high as it must be for an area of
2π r². The prism with two domes is convex and closed, so that over all directions it shows a quarter of its surface
(Cauchy), just as much as the strand with round ends. The two domes alone deviate with the direction by up to 7 % with 9
sides, 17 % with 5 and 43 % with 3.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .scene import Float32, Int32

Float64 = NDArray[np.float64]

_BANDS = {3: 1, 5: 2, 9: 3}
"""Bands of a dome over a prism of so many sides."""


def end_triangles(sides: int) -> int:
    """Return how many triangles the two ends of a strand take."""
    return 2 * sides * (2 * _BANDS[sides] - 1)


def end_domes(
    first_ring: NDArray[np.int64], rings: Float64, vertices: Float32, sides: int
) -> tuple[Float32, Int32, NDArray[np.int64]]:
    """Return domes on the first and the last cross-section of all strands, unless it is a point.

    Parameters
    ----------
    first_ring, rings, vertices, sides
        As in `strands.place_prisms`, which has filled `vertices`.

    Returns
    -------
    (m, 3) float32
        More vertices, to follow `vertices`.
    (n, 3) int32
        Triangles of all vertices, the front outside.
    (m,) int64
        The strand of each of the former.
    """
    count, bands = len(first_ring) - 1, _BANDS[sides]
    ends = np.concatenate([first_ring[:-1], first_ring[1:] - 1])
    strand, last = np.tile(np.arange(count), 2), np.repeat([False, True], count)
    thick = rings[ends, 3] > 0.0
    ends, strand, last = ends[thick], strand[thick], last[thick]

    center, radius = rings[ends, None, :3], rings[ends, 3]
    spokes = vertices.reshape(-1, sides, 3)[ends] - center
    along = np.cross(spokes[:, 0], spokes[:, 1])
    # Of a radius that rounding swallows nothing is left of the dome either.
    length = np.maximum(np.linalg.norm(along, axis=1), np.finfo(np.float64).tiny)
    along *= (np.where(last, 1.0, -1.0) * radius / length)[:, None]
    height = dome_height(sides, bands)
    angles = 0.5 * math.pi * np.arange(1, bands) / bands
    layers = [center + math.cos(a) * spokes + height * math.sin(a) * along[:, None] for a in angles]
    made = np.concatenate([*layers, center + height * along[:, None]], axis=1)

    per_end = made.shape[1]
    start = len(vertices) + per_end * np.arange(len(ends))[:, None]
    here = np.arange(sides)
    layer_starts = [sides * ends[:, None], *(start + sides * layer for layer in range(bands))]
    triangles = []
    for low, high in pairwise(layer_starts[:-1]):
        a, b, c, d = low + here, low + (here + 1) % sides, high + (here + 1) % sides, high + here
        triangles += [np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)]
    low, apex = layer_starts[-2:]
    tips = np.broadcast_to(apex, (len(ends), sides))
    triangles.append(np.stack([low + here, low + (here + 1) % sides, tips], axis=-1))
    corners = np.concatenate(triangles, axis=1)
    corners = np.where(last[:, None, None], corners, corners[:, :, ::-1])
    return made.reshape(-1, 3).astype(np.float32), corners.reshape(-1, 3).astype(np.int32), np.repeat(strand, per_end)


@lru_cache
def dome_height(sides: int, bands: int) -> float:
    """Return how high a dome of area 2π is over a regular polygon with the perimeter 2π, by bisection."""
    low, high = 0.0, 4.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _dome_area(sides, bands, middle) < 2.0 * math.pi else (low, middle)
    return high


def _dome_area(sides: int, bands: int, height: float) -> float:
    """Return the area of a dome: bands of trapezia, whose parallel sides are those of polygons one above the other."""
    inradius = math.pi / (sides * math.tan(math.pi / sides))
    angles = [0.5 * math.pi * band / bands for band in range(bands + 1)]
    area = 0.0
    for a, b in pairwise(angles):
        slant = math.hypot(inradius * (math.cos(a) - math.cos(b)), height * (math.sin(b) - math.sin(a)))
        area += math.pi * (math.cos(a) + math.cos(b)) * slant
    return area
