# SPDX-License-Identifier: GPL-3.0-or-later
"""Polygon shapes as plain arrays: no Blender needed, front faces outward."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

Point = tuple[float, float, float]

UNIT_SQUARE_UV = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0))


@dataclass(frozen=True)
class Shape:
    """A polygon mesh.

    Attributes
    ----------
    vertices : ndarray, (n, 3)
        Positions in metres.
    faces : tuple of tuples of int
        Vertex indices, counter-clockwise seen from the front.
    uv : tuple of pairs of float, or None
        One pair for each corner of each face, in order.
    """

    vertices: np.ndarray
    faces: tuple[tuple[int, ...], ...]
    uv: tuple[tuple[float, float], ...] | None = None


def quad(corners: Sequence[Point]) -> Shape:
    """Return one face whose front sees its corners counter-clockwise, with the unit square as UVs."""
    return Shape(np.array(corners, dtype=np.float64), ((0, 1, 2, 3),), UNIT_SQUARE_UV)


def box(low: Point, high: Point) -> Shape:
    """Return the closed axis-aligned box between two opposite corners."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    return prism(((x0, y0), (x1, y0), (x1, y1), (x0, y1)), z0, z1)


def prism(outline: Sequence[tuple[float, float]], bottom: float, top: float) -> Shape:
    """Return the closed upright prism over a polygon of (x, y) corners, whichever way it turns."""
    ring = np.array(outline, dtype=np.float64)
    following = np.roll(ring, -1, axis=0)
    if np.sum(ring[:, 0] * following[:, 1] - ring[:, 1] * following[:, 0]) < 0.0:
        ring = ring[::-1]
    n = len(ring)
    low = np.column_stack((ring, np.full(n, bottom)))
    high = np.column_stack((ring, np.full(n, top)))
    sides = tuple((i, (i + 1) % n, n + (i + 1) % n, n + i) for i in range(n))
    caps = (tuple(reversed(range(n))), tuple(range(n, 2 * n)))
    return Shape(np.vstack((low, high)), sides + caps)


def wall_with_doorway(
    length: float, bottom: float, top: float, thickness: float, doorway: tuple[float, float, float]
) -> Shape:
    """Return a wall in the xz plane around x = 0 with an opening (left x, right x, height).

    The opening starts at the floor, z = 0; the two legs beside it go down to `bottom`, below the
    floor, so that no crack is left under them.
    """
    left, right, height = doorway
    half = 0.5 * length
    outline = np.array(
        (
            (-half, bottom),
            (left, bottom),
            (left, height),
            (right, height),
            (right, bottom),
            (half, bottom),
            (half, top),
            (-half, top),
        )
    )
    upright = prism([(x, z) for x, z in outline], -0.5 * thickness, 0.5 * thickness)
    x, z, y = upright.vertices.T
    # (x, y, z) -> (x, -z, y) is a turn about x, so the faces keep their fronts outside.
    return Shape(np.column_stack((x, -y, z)), upright.faces)


def revolve(profile: Sequence[tuple[float, float]], segments: int) -> Shape:
    """Return the closed solid of revolution about z of (radius, z) points, given from the bottom up."""
    radius, height = np.array(profile, dtype=np.float64).T
    angle = 2.0 * np.pi * np.arange(segments) / segments
    vertices = np.stack(
        (
            np.outer(radius, np.cos(angle)),
            np.outer(radius, np.sin(angle)),
            np.repeat(height[:, None], segments, axis=1),
        ),
        axis=-1,
    ).reshape(-1, 3)
    rings = len(radius)
    around = _grid_faces(rings, segments, closed_rows=False)
    caps = (
        tuple(reversed(range(segments))),
        tuple(range((rings - 1) * segments, rings * segments)),
    )
    return Shape(vertices, around + caps)


def torus_knot(p: int, q: int, *, radius: float, swing: float, tube: float, steps: int, sides: int) -> Shape:
    """Return a tube of quads along the (p, q) torus knot, standing upright with its axis along y.

    `radius` and `swing` are the torus' two radii, `tube` the tube's own, all in metres.
    """

    def curve(t: np.ndarray) -> np.ndarray:
        ring = radius + swing * np.cos(q * t)
        return np.column_stack((ring * np.cos(p * t), swing * np.sin(q * t), ring * np.sin(p * t)))

    t = 2.0 * np.pi * np.arange(steps) / steps
    centre = curve(t)
    step = 1e-4
    tangent = curve(t + step) - curve(t - step)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    # The offset from the torus' central circle is never along the curve and closes on itself,
    # which a frame carried along the curve would not.
    core = np.column_stack((np.cos(p * t), np.zeros(steps), np.sin(p * t))) * radius
    first = centre - core
    first -= tangent * np.sum(first * tangent, axis=1, keepdims=True)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(tangent, first)
    angle = 2.0 * np.pi * np.arange(sides) / sides
    across = np.cos(angle)[None, :, None] * first[:, None] + np.sin(angle)[None, :, None] * second[:, None]
    vertices = (centre[:, None] + tube * across).reshape(-1, 3)
    return Shape(vertices, _grid_faces(steps, sides, closed_rows=True))


def ball(cells: int, radius: float) -> Shape:
    """Return a sphere of quads with no poles: a cube of cells x cells faces a side, blown up."""
    index: dict[tuple[int, int, int], int] = {}
    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, cells):
            for i in range(cells):
                for j in range(cells):
                    loop = ((i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1))
                    face = []
                    for a, b in loop if side else reversed(loop):
                        key = [0, 0, 0]
                        key[axis], key[u], key[v] = side, a, b
                        face.append(index.setdefault((key[0], key[1], key[2]), len(index)))
                    faces.append(tuple(face))
    cube = np.array(list(index), dtype=np.float64) * (2.0 / cells) - 1.0
    # The tangent spreads the cells more evenly over the sphere than the cube's own spacing.
    vertices = np.tan(cube * (np.pi / 4.0))
    vertices *= radius / np.linalg.norm(vertices, axis=1, keepdims=True)
    return Shape(vertices, tuple(faces))


def twisted_star(points: int, *, radius: float, depth: float, height: float, turn: float, rings: int) -> Shape:
    """Return a closed column whose star-shaped section turns by `turn` radians on the way up."""
    sides = 6 * points
    angle = 2.0 * np.pi * np.arange(sides) / sides
    share = np.linspace(0.0, 1.0, rings)
    belly = 0.62 + 0.38 * np.sin(np.pi * (0.12 + 0.95 * share)) ** 2
    section = 1.0 + depth * np.cos(points * angle)
    r = radius * belly[:, None] * section[None]
    turned = angle[None] + turn * share[:, None]
    z = np.repeat(height * share[:, None], sides, axis=1)
    vertices = np.stack((r * np.cos(turned), r * np.sin(turned), z), axis=-1).reshape(-1, 3)
    caps = (tuple(reversed(range(sides))), tuple(range((rings - 1) * sides, rings * sides)))
    return Shape(vertices, _grid_faces(rings, sides, closed_rows=False) + caps)


def merged(*parts: Shape) -> Shape:
    """Return one shape of several, side by side in one mesh; UVs are dropped."""
    first = np.cumsum([0] + [len(part.vertices) for part in parts])
    faces = tuple(
        tuple(int(start) + i for i in face)
        for part, start in zip(parts, first[:-1], strict=True)
        for face in part.faces
    )
    return Shape(np.vstack([part.vertices for part in parts]), faces)


def with_plan_uv(shape: Shape, tile: float) -> Shape:
    """Return the shape with UVs projected along z, `tile` metres for one repetition of an image."""
    corners = [i for face in shape.faces for i in face]
    uv = shape.vertices[corners, :2] / tile
    return Shape(shape.vertices, shape.faces, tuple((float(u), float(v)) for u, v in uv))


def _grid_faces(rows: int, columns: int, *, closed_rows: bool) -> tuple[tuple[int, ...], ...]:
    """Return the quads between rows of vertices, each row a ring, the last joined to the first if asked."""
    faces = []
    for row in range(rows if closed_rows else rows - 1):
        above = (row + 1) % rows
        for column in range(columns):
            beside = (column + 1) % columns
            faces.append(
                (
                    row * columns + column,
                    row * columns + beside,
                    above * columns + beside,
                    above * columns + column,
                )
            )
    return tuple(faces)
