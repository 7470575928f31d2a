# SPDX-License-Identifier: GPL-3.0-or-later
"""Asking, in kernels, on which side of its planes a vertex hears a point; see `partitions.py`."""

from __future__ import annotations

from .compiled import merged

NO_NORMAL = (0.0, 0.0, 0.0)
"""Of a position in the air."""


@merged
def side_distance(planes, plane, x, y, z):
    """Return N·x − D of a plane, in voxels."""
    return planes[plane, 0] * x + planes[plane, 1] * y + planes[plane, 2] * z - planes[plane, 3]


@merged
def hears(planes, plane, x, n):
    """Tell whether the position x (3,) voxels on a surface with normal n (3,), or 0, lies on a plane's own side."""
    along = planes[plane, 0] * n[0] + planes[plane, 1] * n[1] + planes[plane, 2] * n[2]
    return side_distance(planes, plane, x[0], x[1], x[2]) + planes[plane, 4] * along >= 0.0


@merged
def speaks_for(start, planes, vertex, x, n):
    """Tell whether a vertex speaks for the position x (3,) voxels on a surface with normal n (3,), or 0."""
    yes = True
    for plane in range(start[vertex], start[vertex + 1]):
        yes &= hears(planes, plane, x, n)
    return yes
