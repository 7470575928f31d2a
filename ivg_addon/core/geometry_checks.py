# SPDX-License-Identifier: GPL-3.0-or-later
"""Which triangles can be lit: finite, and with an area."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .scene import Float32, Int32

Float64 = NDArray[np.float64]

SMALLEST_AREA = 1e-18
"""Square metres, a square nanometre: below it, products of edges vanish in float32."""


def triangle_normals(vertices: Float32, triangles: Int32) -> tuple[Float64, Float64]:
    """Return the geometric normals (n, 3) and areas (n,) in float64.

    Normals are unit and on the front side (counter-clockwise); zero where there is no area, not
    numbers where a vertex is not finite.

    Parameters
    ----------
    vertices : (nv, 3) float32
    triangles : (n, 3) int32
    """
    corners = vertices[triangles].astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore"):
        edges = corners[:, 1:] - corners[:, :1]
        normals = np.asarray(np.cross(edges[:, 0], edges[:, 1]), dtype=np.float64)
        doubled: Float64 = np.linalg.norm(normals, axis=1)
        normals /= np.where(doubled == 0.0, 1.0, doubled)[:, None]
    return normals, 0.5 * doubled


def sound_triangles(areas: Float64) -> NDArray[np.bool_]:
    """Tell which triangles to keep, (n,) bool, given their areas from `triangle_normals`."""
    return np.isfinite(areas) & (areas >= SMALLEST_AREA)
