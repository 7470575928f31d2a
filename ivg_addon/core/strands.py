# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair as tubes made of triangles.

Cycles renders a strand as a ribbon that faces each ray, or as a tube: both show any ray the same outline but for the
ends, and a ribbon's normals are those of the tube. So both are taken as tubes. Those of curves are open; those of
linear curves have round ends (`strand_ends`), and the inside of what stands for a ribbon stops nothing (`ribbons`).

A tube is a prism with regular cross-sections whose perimeter is that of the circle, 2π r, shaded flat. The width of a
convex figure, averaged over all directions, is its perimeter over π (Cauchy), and each strand's prism is rolled by a
random angle, which makes its sides' normals uniform around the strand. So hair blocks and scatters on average exactly
what round Lambertian hair does (smooth normals would lose energy at sides that face away). The width of a single prism
deviates with the direction by at most 1.1 % of the diameter with 9 sides, 3.4 % with 5 and 9.4 % with 3 (an even number
of sides would be worse).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .compiled import kernel, merged
from .instancing import MeshData
from .scene import Float32, Int32
from .strand_ends import end_domes, end_triangles
from .thinning import FINE_TRIANGLES, MOST_TRIANGLES, kept_of

Float64 = NDArray[np.float64]

_SIDES = (3, 5, 9)
_MOST_PIECES = 8
_TURN = math.radians(15.0)
"""A smooth strand is divided so that its pieces turn by about this much."""
_BULGE = 1.0 / 128.0
"""And so that their radius is that of the spline but for this share."""
_STEEPEST_MITER = 0.5
"""Cosine of half the sharpest turn at which prisms are mitred in full."""


@dataclass(frozen=True)
class Strands:
    """Strands as sequences of keys.

    Parameters
    ----------
    offsets : (n + 1,) int32
        Index of each strand's first key, and the number of keys.
    positions : (m, 3) float32
    radii : (m,) float32
    smooth
        Catmull-Rom splines through the keys; False for straight pieces between them.
    round_ends
        They end in half a sphere.
    uvs : (n, 2) float32, optional
        Texture coordinates of each strand's root, by the name of their map.
    """

    offsets: Int32
    positions: Float32
    radii: Float32
    smooth: bool
    uvs: dict[str, Float32]
    round_ends: bool = False

    def __len__(self) -> int:
        """Return the number of strands."""
        return len(self.offsets) - 1

    def chosen(self, strands: NDArray[np.int64], widened: float = 1.0) -> Strands:
        """Return some of them, with their radii multiplied."""
        counts = np.diff(self.offsets)[strands]
        offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
        keys = np.repeat(self.offsets[strands] - offsets[:-1], counts) + np.arange(offsets[-1])
        return Strands(
            offsets,
            self.positions[keys],
            self.radii[keys] * np.float32(widened),
            self.smooth,
            {name: values[strands] for name, values in self.uvs.items()},
            self.round_ends,
        )


@dataclass(frozen=True)
class Tubes:
    """Strands made into triangles.

    Parameters
    ----------
    mesh
        The tubes; texture coordinates are the roots'.
    shown, strands
        Strands in the mesh, and strands that there are; fewer where some were left out and the others made wider, so
        that all together keep their area.
    """

    mesh: MeshData
    shown: int
    strands: int

    @property
    def thinned(self) -> bool:
        """Tell whether some were left out."""
        return self.shown < self.strands


def strand_tubes(strands: Strands, most: int = MOST_TRIANGLES) -> Tubes:
    """Return tubes of about `most` triangles or fewer.

    Strands with fewer than two keys, or with keys that are not finite or of negative radius, are left out.
    """
    strands = strands.chosen(_sound(strands))
    count = len(strands)
    pieces = _pieces(strands)
    if _triangles(strands, pieces, _SIDES[0]) > most:
        pieces = np.ones_like(pieces)
        kept = kept_of(count, most * count // max(1, _triangles(strands, pieces, _SIDES[0])))
        if len(kept) < count:
            strands = strands.chosen(kept, widened=count / len(kept))
            pieces = np.ones(len(strands.positions) - len(strands), dtype=np.int32)
    sides = max(n for n in _SIDES if n == _SIDES[0] or _triangles(strands, pieces, n) <= FINE_TRIANGLES)
    return Tubes(_tubes(strands, pieces, sides), len(strands), count)


def _triangles(strands: Strands, pieces: Int32, sides: int) -> int:
    """Return how many triangles tubes of so many sides take."""
    ends = len(strands) * end_triangles(sides) if strands.round_ends else 0
    return 2 * sides * int(pieces.sum()) + ends


def _sound(strands: Strands) -> NDArray[np.int64]:
    """Return which strands have two keys or more, and all keys finite."""
    with np.errstate(invalid="ignore"):
        sound = np.isfinite(strands.positions).all(axis=1) & (strands.radii >= 0.0) & np.isfinite(strands.radii)
    bad = np.concatenate([[0], np.cumsum(~sound)])
    several = np.diff(strands.offsets) >= 2
    return np.flatnonzero(several & (bad[strands.offsets[1:]] == bad[strands.offsets[:-1]]))


def _pieces(strands: Strands) -> Int32:
    """Return into how many straight pieces to divide each segment between keys, (segments,)."""
    inside = np.ones(max(0, len(strands.positions) - 1), dtype=np.bool_)
    inside[strands.offsets[1:-1] - 1] = False
    if not strands.smooth:
        return np.ones(np.count_nonzero(inside), dtype=np.int32)
    steps = np.diff(strands.positions.astype(np.float64), axis=0)
    length = np.linalg.norm(steps, axis=1)
    steps /= np.where(length > 0.0, length, 1.0)[:, None]
    # The turn at each key that has a segment of its strand on either side.
    turn = np.zeros(len(strands.positions))
    both = inside[1:] & inside[:-1]
    turn[1:-1][both] = np.arccos(np.clip(np.einsum("ij,ij->i", steps[1:], steps[:-1])[both], -1.0, 1.0))
    largest = np.maximum(turn[1:], turn[:-1])[inside]
    # A piece that is an nth as long bulges by an n²th as much.
    pieces = np.maximum(largest / _TURN, np.sqrt(_bulges(strands, np.flatnonzero(inside)) / _BULGE))
    return np.asarray(np.clip(np.ceil(pieces), 1, _MOST_PIECES), dtype=np.int32)


def _bulges(strands: Strands, first: NDArray[np.int64]) -> Float64:
    """Return by how much strands are thicker or thinner between two keys than a cone, over their radius there.

    Halfway a Catmull-Rom spline through a, b, c, d is at (9 (b + c) − a − d) / 16. Hair with closed tips is 6 % thicker
    in its last two segments than cones.

    Parameters
    ----------
    first : (segments,) int64
        The key b of each segment.
    """
    strand = np.searchsorted(strands.offsets, first, side="right") - 1
    before = np.maximum(first - 1, strands.offsets[strand])
    after = np.minimum(first + 2, strands.offsets[strand + 1] - 1)
    keys = np.concatenate([strands.positions, strands.radii[:, None]], axis=1).astype(np.float64)
    b, c = keys[first], keys[first + 1]
    middle = (9.0 * (b + c) - keys[before] - keys[after]) / 16.0
    chord = (c - b)[:, :3]
    length2 = np.einsum("ij,ij->i", chord, chord)
    passed = np.einsum("ij,ij->i", (middle - b)[:, :3], chord)
    along = np.divide(passed, length2, out=np.full(len(first), 0.5), where=length2 > 0.0)
    bulge = np.abs(middle[:, 3] - b[:, 3] - along * (c - b)[:, 3])
    radius = np.maximum(b[:, 3], c[:, 3])
    return np.asarray(np.divide(bulge, radius, out=np.zeros(len(first)), where=radius > 0.0))


def _tubes(strands: Strands, pieces: Int32, sides: int) -> MeshData:
    """Make the tubes."""
    count = len(strands)
    first_segment = np.concatenate([[0], np.cumsum(np.diff(strands.offsets) - 1)])
    first_ring = np.concatenate([[0], np.cumsum(pieces)])[first_segment] + np.arange(count + 1)
    rings = np.empty((first_ring[-1], 4))
    place_rings(strands.offsets, strands.positions, strands.radii, strands.smooth, pieces, rings)
    vertices = np.empty((len(rings) * sides, 3), dtype=np.float32)
    rolls = np.random.default_rng(0).uniform(0.0, 2.0 * math.pi, count)
    place_prisms(first_ring, rings, rolls, sides, vertices)

    begins = np.ones(len(rings), dtype=np.bool_)
    begins[first_ring[1:] - 1] = False
    ring = np.flatnonzero(begins)
    base = (sides * ring)[:, None].astype(np.int32)
    here = np.arange(sides, dtype=np.int32)
    a, b = base + here, base + (here + 1) % sides
    # Where the radius vanishes, one of the two triangles of each side does.
    thick = rings[:, 3] > 0.0
    near = np.stack([a, b, b + sides], axis=-1)[thick[ring]]
    far = np.stack([a, b + sides, a + sides], axis=-1)[thick[ring + 1]]
    strand_of_vertex = np.repeat(np.arange(count), np.diff(first_ring) * sides)
    triangles = [near.reshape(-1, 3), far.reshape(-1, 3)]
    if strands.round_ends:
        more, domes, owners = end_domes(first_ring, rings, vertices, sides)
        vertices = np.concatenate([vertices, more])
        triangles.append(domes)
        strand_of_vertex = np.concatenate([strand_of_vertex, owners])
    return MeshData(
        positions=vertices,
        corner_vertex=np.arange(len(vertices), dtype=np.int32),
        triangle_corners=np.concatenate(triangles),
        uv_maps={name: values[strand_of_vertex] for name, values in strands.uvs.items()},
    )


@kernel
def place_rings(offsets, positions, radii, smooth, pieces, rings):
    """Fill the centre and radius of each cross-section, (rings, 4) float64.

    Parameters
    ----------
    offsets : (n + 1,) int32, positions : (m, 3) float32, radii : (m,) float32, smooth
        As in `Strands`.
    pieces : (m − n,) int32
        Straight pieces of each segment between keys.
    """
    row = 0
    segment = 0
    for strand in range(len(offsets) - 1):
        first, last = offsets[strand], offsets[strand + 1] - 1
        for key in range(first, last):
            steps = pieces[segment]
            segment += 1
            for step in range(steps + 1 if key == last - 1 else steps):
                _on_strand(positions, radii, smooth, first, last, key, step / steps, rings, row)
                row += 1


@kernel
def place_prisms(first_ring, rings, rolls, sides, vertices):
    """Fill the vertices of all tubes: prisms along the pieces, mitred where these meet.

    Parameters
    ----------
    first_ring : (n + 1,) int64
        Index of each strand's first cross-section, and their number.
    rings : (rings, 4) float64
        From `place_rings`.
    rolls : (n,) float64
        Angle by which each strand's tube is rolled.
    sides
        Of a cross-section.
    vertices : (rings · sides, 3) float32
        Changed in place.
    """
    # Perimeter 2π r of a regular polygon: circumradius π r / (sides · sin(π / sides)).
    stretch = math.pi / (sides * math.sin(math.pi / sides))
    before = np.empty(3)
    after = np.empty(3)
    miter = np.empty(3)
    across = np.empty(3)
    for strand in range(len(first_ring) - 1):
        first, last = first_ring[strand], first_ring[strand + 1] - 1
        after[0], after[1], after[2] = 0.0, 0.0, 1.0
        for ring in range(first, last + 1):
            for axis in range(3):
                before[axis] = after[axis]
                miter[axis] = rings[min(ring + 1, last), axis] - rings[min(ring, last - 1), axis]
            if _normalize(miter):
                for axis in range(3):
                    after[axis] = miter[axis]
            if ring == first:
                for axis in range(3):
                    before[axis] = after[axis]
                _across(after, rolls[strand], across)
            else:
                _turn_along(across, before)
            for axis in range(3):
                miter[axis] = before[axis] + after[axis]
            if not _normalize(miter):
                for axis in range(3):
                    miter[axis] = before[axis]
            _place_polygon(rings, ring, before, miter, across, stretch * rings[ring, 3], sides, vertices)


@merged
def _place_polygon(rings, ring, before, miter, across, r, sides, vertices):
    """Fill in a cross-section's corners: those of a polygon of circumradius r around the piece before, moved along it.

    They lie in the plane that halves the angle with the next piece; `miter` is its normal, and `across` leads from the
    axis to the first of them.
    """
    slope = before[0] * miter[0] + before[1] * miter[1] + before[2] * miter[2]
    slope = max(slope, _STEEPEST_MITER)
    ux, uy, uz = across[0], across[1], across[2]
    vx = before[1] * uz - before[2] * uy
    vy = before[2] * ux - before[0] * uz
    vz = before[0] * uy - before[1] * ux
    for side in range(sides):
        angle = 2.0 * math.pi * side / sides
        c, s = math.cos(angle), math.sin(angle)
        nx, ny, nz = c * ux + s * vx, c * uy + s * vy, c * uz + s * vz
        along = nx * miter[0] + ny * miter[1] + nz * miter[2]
        slide = r * along / slope
        row = ring * sides + side
        vertices[row, 0] = np.float32(rings[ring, 0] + r * nx - slide * before[0])
        vertices[row, 1] = np.float32(rings[ring, 1] + r * ny - slide * before[1])
        vertices[row, 2] = np.float32(rings[ring, 2] + r * nz - slide * before[2])


@merged
def _on_strand(positions, radii, smooth, first, last, key, t, rings, row):
    """Fill in the position and radius at t of the way from a key to the next.

    A Catmull-Rom spline's weights are (−t + 2t² − t³, 2 − 5t² + 3t³, t + 4t² − 3t³, −t² + t³) / 2 (Catmull & Rom, "A
    Class of Local Interpolating Splines", 1974); a strand's end keys are their own neighbours.
    """
    before, after = max(key - 1, first), min(key + 2, last)
    w0, w1, w2, w3 = 0.0, 1.0 - t, t, 0.0
    if smooth:
        w0, w1 = 0.5 * (-t + 2 * t**2 - t**3), 0.5 * (2 - 5 * t**2 + 3 * t**3)
        w2, w3 = 0.5 * (t + 4 * t**2 - 3 * t**3), 0.5 * (-(t**2) + t**3)
    for axis in range(3):
        a, b = np.float64(positions[before, axis]), np.float64(positions[key, axis])
        c, d = np.float64(positions[key + 1, axis]), np.float64(positions[after, axis])
        rings[row, axis] = w0 * a + w1 * b + w2 * c + w3 * d
    radius = w0 * radii[before] + w1 * radii[key] + w2 * radii[key + 1] + w3 * radii[after]
    rings[row, 3] = max(0.0, radius)


@merged
def _across(tangent, roll, across):
    """Fill in a unit vector across the tangent, turned around it by `roll`."""
    x, y, z = tangent[0], tangent[1], tangent[2]
    across[0], across[1], across[2] = 0.0, 0.0, 0.0
    if abs(x) <= abs(y) and abs(x) <= abs(z):
        across[0] = 1.0
    elif abs(y) <= abs(z):
        across[1] = 1.0
    else:
        across[2] = 1.0
    _turn_along(across, tangent)
    c, s = math.cos(roll), math.sin(roll)
    ux, uy, uz = across[0], across[1], across[2]
    across[0] = c * ux + s * (y * uz - z * uy)
    across[1] = c * uy + s * (z * ux - x * uz)
    across[2] = c * uz + s * (x * uy - y * ux)


@merged
def _turn_along(across, tangent):
    """Make `across` perpendicular to the tangent again, with as little turning as possible."""
    along = across[0] * tangent[0] + across[1] * tangent[1] + across[2] * tangent[2]
    for axis in range(3):
        across[axis] -= along * tangent[axis]
    if not _normalize(across):
        # The strand turned back on itself: any direction across it will do.
        if abs(tangent[0]) < 0.5:
            across[0], across[1], across[2] = 0.0, -tangent[2], tangent[1]
        else:
            across[0], across[1], across[2] = -tangent[1], tangent[0], 0.0
        _normalize(across)


@merged
def _normalize(vector):
    """Give a vector (3,) the length 1; return False where it has none."""
    length = math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])
    if not length > 1e-12:
        return False
    for axis in range(3):
        vector[axis] /= length
    return True
