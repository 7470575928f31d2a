# SPDX-License-Identifier: GPL-3.0-or-later
"""Integrals over convex bodies, exactly: the closed forms that lit volumes and weights are compared with."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64 = NDArray[np.float64]


def clipped_volume(low: ArrayLike, high: ArrayLike, normals: ArrayLike, offsets: ArrayLike) -> float:
    """Return the volume of a box inside half-spaces n·x ≤ d; normals (m, 3), offsets (m,).

    The divergence theorem adds up the volume.
    """
    return sum(_cone(face) for face in _clipped_faces(low, high, normals, offsets))


def clipped_nodes(low: ArrayLike, high: ArrayLike, normals: ArrayLike, offsets: ArrayLike) -> tuple[Float64, Float64]:
    """Return points (n, 3) and weights (n,) whose sums are integrals of polynomials up to degree 7 over the same body.

    The body is the sum of its faces' cones from the origin, some of which count negatively: the points may lie outside.
    In a tetrahedron (0, p, q, r) they are a (p + b (q − p) + b c (r − q)), with the Jacobian a² b det(p, q, r).
    """
    x, w = np.polynomial.legendre.leggauss(5)
    a, b, c = (grid.ravel() for grid in np.meshgrid(*[(1 + x) / 2] * 3, indexing="ij"))
    weight = np.einsum("i,j,k->ijk", w, w, w).ravel() / 8 * a**2 * b
    points, weights = [np.empty((0, 3))], [np.empty(0)]
    for face in _clipped_faces(low, high, normals, offsets):
        p = face[0]
        for q, r in itertools.pairwise(face[1:]):
            points.append(a[:, None] * (p + b[:, None] * (q - p) + (b * c)[:, None] * (r - q)))
            weights.append(weight * (p @ np.cross(q, r)))
    return np.concatenate(points), np.concatenate(weights)


def _clipped_faces(low: ArrayLike, high: ArrayLike, normals: ArrayLike, offsets: ArrayLike) -> list[Float64]:
    """Return the faces of a box's part inside half-spaces, outward counter-clockwise.

    The box's faces are clipped one half-space after the other (Sutherland & Hodgman), and what is cut open is closed
    by a face.
    """
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
    corners = np.asarray(low) + corners * np.subtract(high, low)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [corners[list(quad)] for quad in quads]
    for n, d in zip(np.asarray(normals, dtype=np.float64), np.asarray(offsets, dtype=np.float64), strict=True):
        faces = _clip(faces, n, float(d))
    return faces


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
