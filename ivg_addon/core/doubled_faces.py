# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces that lie exactly in others: walls modelled twice, objects duplicated in place.

In Cycles each shades the other: a ray that starts at one meets the other at no distance. In a plane across an axis,
where the coordinates of the start are exact, that happens always, and such walls are black; elsewhere rounding decides,
and about half of the light is lost (measured: 0, and 0.50 to 0.55). The first is done here likewise; the second is
an accident, named but not followed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .compiled import inlined, kernel, merged
from .scene import LETTING_THROUGH, NO_TEXTURE, Float32, Geometry, Materials

BLACK_NAME = "(doubled faces)"

MOST_IN_PLANE = 512
"""Triangles of one plane that are all held against each other."""
_CLOSE, _HALF, _THIRD = 0.02, 0.49, 1.0 / 3.0
PLACES = np.array(
    [
        (_CLOSE, _CLOSE),
        (1 - 2 * _CLOSE, _CLOSE),
        (_CLOSE, 1 - 2 * _CLOSE),
        (_HALF, _HALF),
        (_HALF, 1 - 2 * _HALF),
        (1 - 2 * _HALF, _HALF),
        (_THIRD, _THIRD),
    ]
)
"""Barycentric coordinates at which a triangle is looked at: by its corners, its edges and in its middle."""


def doubled_triangles(
    geometry: Geometry, materials: Materials, candidates: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the triangles that lie in others: those in planes across an axis, and others.

    Across an axis they are found however the two faces are cut into triangles, if they cover each other wherever it is
    looked at; in planes of more than `MOST_IN_PLANE` triangles, and at an angle, if they have the same corners.

    Parameters
    ----------
    candidates : (objects,) bool
        Which objects count.

    What emits, or lets light through, is left alone.
    """
    opaque: NDArray[np.bool_] = np.asarray(~materials.emission.any(axis=1))
    passing = materials.lobes.material[np.isin(materials.lobes.kind, LETTING_THROUGH)]
    opaque[passing] = False
    if materials.back is not None:
        opaque &= opaque[materials.back]
    rows = np.flatnonzero(opaque[geometry.material] & candidates[geometry.object])
    # Adding zero turns −0 into 0.
    vertices = geometry.vertices + np.float32(0)
    corners = vertices[geometry.triangles[rows]]
    level = (corners == corners[:, :1]).all(axis=1)
    doubled = _with_the_same_corners(vertices, geometry, rows)
    for axis in range(3):
        flat = np.flatnonzero(level[:, axis])
        doubled[flat] |= _covered(np.delete(corners[flat], axis, axis=2), corners[flat, 0, axis])
    across = level.any(axis=1)
    return rows[doubled & across], rows[doubled & ~across]


def _with_the_same_corners(vertices: Float32, geometry: Geometry, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Tell which of some triangles have the corners of another of them, in any order, (n,) bool."""
    keys = np.empty(len(rows), dtype=np.uint64)
    hash_triangles(vertices.view(np.uint32), geometry.triangles, rows, keys)
    order = np.argsort(keys, kind="stable")
    same = keys[order][1:] == keys[order][:-1]
    doubled = np.zeros(len(rows), dtype=np.bool_)
    doubled[order[1:][same]] = True
    doubled[order[:-1][same]] = True
    return doubled


def _covered(corners: Float32, heights: Float32) -> NDArray[np.bool_]:
    """Tell which triangles of the same height cover each other; corners (n, 3, 2) in the plane, heights (n,).

    The underside of what stands on a floor is covered by it, but does not cover it: neither counts.
    """
    covered = np.zeros(len(heights), dtype=np.bool_)
    order = np.argsort(heights, kind="stable")
    for members in np.split(order, np.flatnonzero(np.diff(heights[order])) + 1):
        if len(members) > MOST_IN_PLANE:
            continue
        before = len(members) + 1
        while 1 < len(members) < before:
            before = len(members)
            inside = np.empty(len(members), dtype=np.bool_)
            find_covered(corners[members].astype(np.float64), PLACES, inside)
            members = members[inside]
        covered[members] = len(members) > 1
    return covered


def blackened(geometry: Geometry, materials: Materials, triangles: NDArray[np.int64]) -> tuple[Geometry, Materials]:
    """Return a scene's surfaces with some triangles black."""
    material = geometry.material.copy()
    count = len(materials.names)
    material[triangles] = count
    more = np.array([count], dtype=np.int32)
    none = np.array([NO_TEXTURE], dtype=np.int32)
    black = np.zeros((1, 3), dtype=np.float32)
    emission_texture, view, back = materials.emission_texture, materials.emission_view, materials.back
    return replace(geometry, material=material), replace(
        materials,
        names=(*materials.names, BLACK_NAME),
        albedo=np.concatenate([materials.albedo, black]),
        texture=np.concatenate([materials.texture, none]),
        emission=np.concatenate([materials.emission, black]),
        emission_texture=None if emission_texture is None else np.concatenate([emission_texture, none]),
        emission_view=None if view is None else np.concatenate([view, np.ones_like(view[:1])]),
        back=None if back is None else np.concatenate([back, more]),
    )


@kernel
def find_covered(corners, places, covered):
    """Fill covered (n,) bool: whether at each of the places (p, 2) of a triangle, (n, 3, 2), there is another one."""
    for triangle in range(len(corners)):
        a, b, c = corners[triangle]
        covered[triangle] = True
        for place in range(len(places)):
            u, v = places[place]
            x = (1.0 - u - v) * a[0] + u * b[0] + v * c[0]
            y = (1.0 - u - v) * a[1] + u * b[1] + v * c[1]
            found = False
            for other in range(len(corners)):
                found = found or (other != triangle and _holds(corners[other], x, y))
            if not found:
                covered[triangle] = False
                break


@merged
def _holds(corners, x, y):
    """Tell whether a triangle (3, 2) has a point in it or on an edge, whichever way it is wound."""
    left = right = False
    for i in range(3):
        j = (i + 1) % 3
        across = (corners[j, 0] - corners[i, 0]) * (y - corners[i, 1])
        across -= (corners[j, 1] - corners[i, 1]) * (x - corners[i, 0])
        left = left or across < 0.0
        right = right or across > 0.0
    return not (left and right)


@kernel
def hash_triangles(bits, triangles, rows, keys):
    """Fill keys (n,) uint64 with numbers that do not depend on the order of a triangle's corners.

    Parameters
    ----------
    bits : (nv, 3) uint32
        The vertices' coordinates.
    triangles : (nt, 3) int32, rows : (n,) int64
        Of these triangles.
    """
    for row in range(len(rows)):
        total = np.uint64(0)
        for corner in range(3):
            vertex = triangles[rows[row], corner]
            low = np.uint64(bits[vertex, 0]) | (np.uint64(bits[vertex, 1]) << np.uint64(32))
            total += _mixed(_mixed(low) ^ np.uint64(bits[vertex, 2]))
        keys[row] = total


@inlined
def _mixed(x):
    """Return the bits of a 64-bit number stirred (SplitMix64; Steele, Lea & Flood, OOPSLA 2014)."""
    x += np.uint64(0x9E3779B97F4A7C15)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))
