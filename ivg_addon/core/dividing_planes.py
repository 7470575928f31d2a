# SPDX-License-Identifier: GPL-3.0-or-later
"""Planes that part what does not see each other, from straight ways between points around a vertex."""

from __future__ import annotations

from .cell_points import vertex_indices
from .compiled import inlined, kernel
from .partitions import MOST_PLANES
from .sides import side_distance
from .vectors import largest_of

_NEAR = 0.1
"""Voxels up to which a vertex is taken to lie in a wall: so that all of a layer in its plane speak for the same side,
it is then that which lies up, north or east."""
_MOSTLY_LIT = 0.5
"""Of the points of a vertex's dual cell on the side that it lies on; with fewer lit ones it may lie in a solid."""
_LEAST_SHARE = 2.0
"""Of the other side's weight in the interpolation from a vertex that may lie in a solid, that its own must have."""
_PRICE, _HIGHER_PRICE = 0.5, 1.0
"""Of a free way through a plane, in blocked ones. A surface's plane divides where a third of them are blocked: a sheet
covers half of its plane around a vertex at its border. The mean of several planes, which is no surface's, and further
planes of the same vertex do so where half are.
"""
_LEAST_WAYS = 8
"""Blocked ones, likewise: few may be chance."""
_MOST_CANDIDATES = 48
_SAME_WAY = 0.7
"""Cosine between normals up to which a surface is the one that a plane stands for."""

LEAST_SLACK, MOST_SLACK = 1e-3, 0.25
"""Limits of a plane's slack, voxels."""


@kernel
def find_planes(vertices, counts, points, lit, starts, ends, blocked, normals, met, planes, number):
    """Fill planes (n, MOST_PLANES, 5) and number (n,) for vertices (n,) by the ways between their points.

    Parameters
    ----------
    points : (n, m, 3), lit : (n, m) bool
        Around each vertex, in voxels.
    starts : (n + 1,) int64
        Where each vertex's ways begin.
    ends : (w, 2) int64, blocked : (w,) bool, normals, met : (w, 3)
        See `_Around._obstacles`.
    """
    places = points.reshape(-1, 3)
    for index in range(len(vertices)):
        first, last, offset = starts[index], starts[index + 1], index * points.shape[1]
        own = lit[index].copy()
        for plane in range(MOST_PLANES):
            best = 0.0
            stride = max(1, (last - first) // _MOST_CANDIDATES)
            for at in range(first, last + stride, stride):
                way = min(at, last)
                if way < last and not (blocked[way] and own[ends[way, 0] - offset] and own[ends[way, 1] - offset]):
                    continue
                normal, d = candidate(way, first, last, offset, own, ends, blocked, normals, met)
                price = _PRICE if way < last and plane == 0 else _HIGHER_PRICE
                gain = worth(first, last, offset, own, ends, blocked, places, normal, d, price)
                if gain > best:
                    best = gain
                    for axis in range(3):
                        planes[index, plane, axis] = normal[axis]
                    planes[index, plane, 3] = d
            if best == 0.0:
                break
            number[index] = plane + 1
            turn_to_own_side(vertices[index], counts, points[index], lit[index], own, planes[index, plane])
        measure_slack(first, last, ends, blocked, normals, met, places, number[index], planes[index])


@inlined
def candidate(way, first, last, offset, own, ends, blocked, normals, met):
    """Return normal and offset of the plane of what blocked a way, or after the last: the mean of all that count."""
    if way < last:
        n = (normals[way, 0], normals[way, 1], normals[way, 2])
        return n, n[0] * met[way, 0] + n[1] * met[way, 1] + n[2] * met[way, 2]
    x, y, z, nx, ny, nz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    count = 0
    for other in range(first, last):
        if blocked[other] and own[ends[other, 0] - offset] and own[ends[other, 1] - offset]:
            count += 1
            x, y, z = x + met[other, 0], y + met[other, 1], z + met[other, 2]
            ux, uy, uz = normals[other, 0], normals[other, 1], normals[other, 2]
            # Which side a way began on is chance.
            sign = 1.0 if ux * nx + uy * ny + uz * nz >= 0.0 else -1.0
            nx, ny, nz = nx + sign * ux, ny + sign * uy, nz + sign * uz
    length = (nx * nx + ny * ny + nz * nz) ** 0.5
    if length == 0.0:
        return (0.0, 0.0, 0.0), 0.0
    n = (nx / length, ny / length, nz / length)
    return n, (n[0] * x + n[1] * y + n[2] * z) / count


@inlined
def worth(first, last, offset, own, ends, blocked, places, normal, d, price):
    """Return how many ways through a plane are blocked, less the price of the free ones; 0 if it does not divide."""
    through, free = 0, 0
    for way in range(first, last):
        a, b = ends[way, 0], ends[way, 1]
        if own[a - offset] and own[b - offset]:
            ahead_a = normal[0] * places[a, 0] + normal[1] * places[a, 1] + normal[2] * places[a, 2] - d
            ahead_b = normal[0] * places[b, 0] + normal[1] * places[b, 1] + normal[2] * places[b, 2] - d
            if (ahead_a >= 0.0) != (ahead_b >= 0.0):
                if blocked[way]:
                    through += 1
                else:
                    free += 1
    if through < _LEAST_WAYS or through < price * free:
        return 0.0
    return through - price * free + 1.0


@inlined
def turn_to_own_side(vertex, counts, points, lit, own, plane):
    """Turn a plane towards the side that its vertex speaks for, and unmark the points on the other."""
    i, j, k = vertex_indices(vertex, counts)
    distance = plane[0] * i + plane[1] * j + plane[2] * k - plane[3]
    if abs(distance) < _NEAR:
        distance = plane[0] + 2.0 * plane[1] + 4.0 * plane[2]
    weight_here, weight_there = 0.0, 0.0
    in_cell, lit_in_cell = 0, 0
    for point in range(len(points)):
        x, y, z = points[point, 0] - i, points[point, 1] - j, points[point, 2] - k
        weight = max(0.0, 1.0 - abs(x)) * max(0.0, 1.0 - abs(y)) * max(0.0, 1.0 - abs(z))
        if (is_ahead(points, point, plane)) == (distance > 0.0):
            if largest_of(x, y, z) <= 0.5:
                in_cell += 1
                lit_in_cell += lit[point]
            if own[point]:
                weight_here += weight
        elif own[point]:
            weight_there += weight
    in_solid = lit_in_cell < _MOSTLY_LIT * in_cell and weight_here < _LEAST_SHARE * weight_there
    if in_solid == (distance > 0.0):
        for entry in range(4):
            plane[entry] = -plane[entry]
    for point in range(len(points)):
        if not is_ahead(points, point, plane):
            own[point] = False


@inlined
def is_ahead(points, point, plane):
    """Tell whether a point lies on a plane's positive side, or in it."""
    return plane[0] * points[point, 0] + plane[1] * points[point, 1] + plane[2] * points[point, 2] >= plane[3]


@inlined
def measure_slack(first, last, ends, blocked, normals, met, places, number, planes):
    """Fill the planes' slack: how far what blocks ways lies behind them seen from ahead, or ahead seen from behind.

    A plane answers for the ways between its own side and a point that it alone cuts off, where they meet what faces
    about the way it does.
    """
    for plane in range(number):
        planes[plane, 4] = LEAST_SLACK
    for way in range(first, last):
        if not blocked[way]:
            continue
        a_behind, a_only = planes_behind(number, planes, places, ends[way, 0])
        b_behind, b_only = planes_behind(number, planes, places, ends[way, 1])
        if a_behind + b_behind != 1:
            continue
        only = a_only if a_behind else b_only
        facing = 0.0
        for axis in range(3):
            facing += planes[only, axis] * normals[way, axis]
        if abs(facing) > _SAME_WAY:
            ahead = side_distance(planes, only, met[way, 0], met[way, 1], met[way, 2])
            planes[only, 4] = max(planes[only, 4], min(ahead if a_behind else -ahead, MOST_SLACK))


@inlined
def planes_behind(number, planes, places, point):
    """Return how many planes a point lies behind, and the last of them."""
    behind, last = 0, 0
    for plane in range(number):
        if side_distance(planes, plane, places[point, 0], places[point, 1], places[point, 2]) < 0.0:
            behind += 1
            last = plane
    return behind, last
