"""Volumes of convex bodies, exactly: the closed form that lit volumes are compared with."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64 = NDArray[np.float64]


def clipped_volume(low: ArrayLike, high: ArrayLike, normals: ArrayLike, offsets: ArrayLike) -> float:
    """Return the volume of a box inside half-spaces n·x ≤ d; normals (m, 3), offsets (m,).

    The box's faces are clipped one half-space after the other (Sutherland & Hodgman), what is cut open is closed by a
    face, and the divergence theorem adds up the volume.
    """
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
    corners = np.asarray(low) + corners * np.subtract(high, low)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [corners[list(quad)] for quad in quads]
    for n, d in zip(np.asarray(normals, dtype=np.float64), np.asarray(offsets, dtype=np.float64), strict=True):
        faces = _clip(faces, n, float(d))
    return sum(_cone(face) for face in faces)


def _clip(faces: list[Float64], n: Float64, d: float) -> list[Float64]:
    """Return the faces of a body's part on the inner side of a plane."""
    kept, rim = [], []
    for face in faces:
        height = face @ n - d
        points = []
        for a, b, p, q in zip(height, np.roll(height, -1), face, np.roll(face, -1, axis=0), strict=True):
            if a <= 0:
                points.append(p)
            if (a < 0) != (b < 0) and a != b:
                points.append(p + a / (a - b) * (q - p))
                rim.append(points[-1])
        if len(points) >= 3:
            kept.append(np.array(points))
    if len(rim) >= 3:
        cap = np.array(rim)
        x = np.cross(n, np.eye(3)[np.abs(n).argmin()])
        around = cap - cap.mean(axis=0)
        kept.append(cap[np.argsort(np.arctan2(around @ np.cross(n, x), around @ x))])
    return kept


def _cone(face: Float64) -> float:
    """Return the signed volume of the cone from the origin to a face, outward counter-clockwise."""
    p = face[0]
    return float(sum(p @ np.cross(q, r) for q, r in itertools.pairwise(face))) / 6.0
