# SPDX-License-Identifier: GPL-3.0-or-later
"""Random places at which to ask how well a grid knows the light: in free space and on surfaces.

A place counts if light reaches it. What light reaches is found as the bake finds it (`lit_volume.py`): a few photons
fly, and a point is lit if random rays from it meet sides of surfaces on which photons landed, or escape to a world
that shines. So no scene has to be closed, or built with its faces turned one way, to tell inside from outside. Here
many rays vote: within a block on a floor, one that meets a patch of the floor which is only partly under the block
tells the wrong thing.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .bake import light_knowledge, prepare_course
from .compiled import kernel
from .dual_cells import Lattice
from .errors import SceneError
from .lit_volume import LIT, PERHAPS_LIT, UNLIT, LightKnowledge, spread_directions
from .photon_walk import walk_steps
from .progress import Progress
from .scene import Float32, Scene
from .settings import BakeSettings, Vec3
from .surfaces import corner

Float64 = NDArray[np.float64]

CLEARANCE = 1e-3
"""How far from surfaces points stay, as a share of the box's diagonal."""
LIFT = 1e-4
"""How far above its surface a surface point lies, as a share of the box's diagonal."""

_SCOUTS = 1 << 19
"""Photons that find out which sides of the surfaces are lit."""
_PATCHES = (16, 16, 16)
"""Voxels of a grid whose patches of surface (`surface_bins.py`) are told apart."""
_RAYS = 32
"""Random rays that vote on whether a point is lit."""
_MOST_UNLIT = 0.05
"""Votes that a lit point may have against it, as a share of those for it."""
_ATTEMPTS = 100
"""Batches of candidates after which there is taken to be no place left."""


@dataclass(frozen=True)
class Places:
    """Points and directions.

    Parameters
    ----------
    points : (n, 3) float64
        Metres.
    normals : (n, 3) float64
        Unit vectors: uniform over the sphere in free space, else the surface's own on the side where the point lies.
    """

    points: Float64
    normals: Float64


@dataclass(frozen=True)
class LitBox:
    """A scene, a box in it, and knowledge of where light is; made by `find_light_steps`."""

    scene: Scene
    bounds_min: Vec3
    bounds_max: Vec3
    knowledge: LightKnowledge

    @property
    def diagonal(self) -> float:
        """Length of the box's diagonal, metres."""
        return float(np.linalg.norm(np.subtract(self.bounds_max, self.bounds_min)))


def find_light_steps(
    scene: Scene, bounds_min: Vec3, bounds_max: Vec3, seed: int = 0
) -> Generator[Progress, None, LitBox]:
    """Find out where light is in a box of a scene; yields as it goes, returns a `LitBox`.

    Raises
    ------
    SceneError
        No geometry, no light.
    """
    course = prepare_course(scene, Lattice(bounds_min, bounds_max, _PATCHES), _SCOUTS)
    settings = BakeSettings(bounds_min, bounds_max, (1, 1, 1), photons=_SCOUTS, seed=seed)
    walk = yield from walk_steps(course, Lattice(bounds_min, bounds_max, (1, 1, 1)), settings)
    return LitBox(scene, bounds_min, bounds_max, light_knowledge(scene, course, walk.bin_counts))


def free_space_points(light: LitBox, count: int, seed: int = 0) -> Places:
    """Return `count` points spread uniformly over the lit part of the box, with normals uniform over the sphere.

    They keep `CLEARANCE` from every surface.

    Raises
    ------
    SceneError
        There is hardly any such place.
    """
    clearance = CLEARANCE * light.diagonal
    rng = np.random.default_rng((seed, 0))

    def candidates(number: int) -> Places:
        points = rng.uniform(light.bounds_min, light.bounds_max, (number, 3))
        directions = rng.normal(size=(number, 3))
        return Places(points, directions / np.linalg.norm(directions, axis=1, keepdims=True))

    return _gather(light, count, seed, candidates, lambda places: (places.points, clearance))


def surface_points(light: LitBox, count: int, seed: int = 0) -> Places:
    """Return `count` points spread by area over the lit sides of the surfaces within the box.

    They lie `LIFT` above the triangle, and the normal is the triangle's own: with an interpolated one, E(p, n) would
    count light from below the surface, which shades nothing. Places are left out where another surface reaches into a
    ball that touches this one (but for a tenth) and is `CLEARANCE` in radius: edges and corners of rooms, gaps. What
    bulges or lies in the same plane does not.

    Raises
    ------
    SceneError
        There is hardly any such place.
    """
    clearance, lift = CLEARANCE * light.diagonal, LIFT * light.diagonal
    geometry = light.scene.geometry
    corners = geometry.vertices[geometry.triangles].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    double_area = np.linalg.norm(across, axis=1)
    reached = _reached(corners, light) & light.scene.diffuse_visible[geometry.object]
    share = np.cumsum(np.where(reached, double_area, 0.0))
    if share[-1] == 0.0:
        raise SceneError("no surface within the grid's box: move its bounds")
    rng = np.random.default_rng((seed, 1))

    def candidates(number: int) -> Places:
        triangle = np.searchsorted(share, rng.uniform(0.0, share[-1], number), side="right")
        triangle = np.minimum(triangle, len(share) - 1)
        # Uniform in the triangle: Osada et al., "Shape Distributions", ACM TOG 2002, eq. 1.
        root, v = np.sqrt(rng.uniform(size=(number, 1))), rng.uniform(size=(number, 1))
        p, q, r = corners[triangle, 0], corners[triangle, 1], corners[triangle, 2]
        on_surface = (1.0 - root) * p + root * (1.0 - v) * q + root * v * r
        side = rng.choice((-1.0, 1.0), size=(number, 1))
        normals = side * across[triangle] / double_area[triangle, None]
        return Places(on_surface + lift * normals, normals)

    def ball(places: Places) -> tuple[Float64, float]:
        return places.points + (clearance - lift) * places.normals, 0.9 * clearance

    return _gather(light, count, seed, candidates, ball)


def _reached(corners: Float64, light: LitBox) -> NDArray[np.bool_]:
    """Tell which triangles, (nt, 3 corners, 3), may lie partly in the box: by their own boxes."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    return np.asarray(((low <= light.bounds_max) & (high >= light.bounds_min)).all(axis=1))


def _gather(
    light: LitBox,
    count: int,
    seed: int,
    candidates: Callable[[int], Places],
    ball: Callable[[Places], tuple[Float64, float]],
) -> Places:
    """Return the first `count` candidates that lie in the box, lit, with no surface in the ball of each."""
    points, normals = np.empty((0, 3)), np.empty((0, 3))
    number = 2 * count
    for attempt in range(_ATTEMPTS):
        places = candidates(number)
        inside = (places.points >= light.bounds_min) & (places.points <= light.bounds_max)
        good: NDArray[np.bool_] = np.asarray(inside.all(axis=1))
        identifiers = attempt * number + np.arange(number)
        good[good] = _lit(light.knowledge, places.points[good].astype(np.float32), identifiers[good], seed)
        centres, radius = ball(places)
        good[good] = clear_of_surfaces(light.scene, centres[good], radius)
        points = np.concatenate([points, places.points[good]])
        normals = np.concatenate([normals, places.normals[good]])
        if len(points) >= count:
            return Places(points[:count], normals[:count])
    raise SceneError(
        f"found {len(points)} of {count} places that light reaches within the grid's box: move its bounds to lit space"
    )


def _lit(knowledge: LightKnowledge, points: Float32, identifiers: NDArray[np.int64], seed: int) -> NDArray[np.bool_]:
    """Tell which points (n, 3) light reaches: rays that know say so, with next to none that says no."""
    lit, unlit = np.zeros(len(points), dtype=np.int32), np.zeros(len(points), dtype=np.int32)
    directions = np.empty_like(points)
    for ray in range(_RAYS):
        spread_directions(identifiers, ray, seed, directions)
        verdict = knowledge.verdicts(points, directions)
        lit += (verdict == LIT) | (verdict == PERHAPS_LIT)
        unlit += verdict == UNLIT
    return np.asarray((lit > 0) & (unlit <= _MOST_UNLIT * lit))


def clear_of_surfaces(scene: Scene, centres: Float64, radius: float) -> NDArray[np.bool_]:
    """Tell which balls, centres (n, 3) metres, no triangle reaches into, (n,)."""
    clear = np.ones(len(centres), dtype=np.bool_)
    find_clear(scene.geometry.vertices, scene.geometry.triangles, centres, radius, clear)
    return clear


@kernel
def find_clear(vertices, triangles, centres, radius, clear):
    """Set clear (n,) to False for each ball, centres (n, 3), that a triangle reaches into."""
    for triangle in range(len(triangles)):
        p = corner(vertices, triangles, triangle, 0)
        q = corner(vertices, triangles, triangle, 1)
        r = corner(vertices, triangles, triangle, 2)
        low_x, high_x = min(p[0], q[0], r[0]) - radius, max(p[0], q[0], r[0]) + radius
        low_y, high_y = min(p[1], q[1], r[1]) - radius, max(p[1], q[1], r[1]) + radius
        low_z, high_z = min(p[2], q[2], r[2]) - radius, max(p[2], q[2], r[2]) + radius
        for ball in range(len(centres)):
            x, y, z = centres[ball, 0], centres[ball, 1], centres[ball, 2]
            if low_x <= x <= high_x and low_y <= y <= high_y and low_z <= z <= high_z:
                if clear[ball] and squared_distance(x, y, z, p, q, r) < radius * radius:
                    clear[ball] = False


@kernel
def squared_distance(x, y, z, p, q, r):
    """Return the squared distance of a point from a triangle.

    Either the point's foot lies in the triangle, or the nearest point is on one of its edges.
    """
    ux, uy, uz = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    vx, vy, vz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    wx, wy, wz = x - p[0], y - p[1], z - p[2]
    uu, uv, vv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz, vx * vx + vy * vy + vz * vz
    uw, vw = ux * wx + uy * wy + uz * wz, vx * wx + vy * wy + vz * wz
    gram = uu * vv - uv * uv
    if gram > 0.0:
        s, t = (uw * vv - vw * uv) / gram, (vw * uu - uw * uv) / gram
        if s >= 0.0 and t >= 0.0 and s + t <= 1.0:
            dx, dy, dz = wx - s * ux - t * vx, wy - s * uy - t * vy, wz - s * uz - t * vz
            return dx * dx + dy * dy + dz * dz
    nearest = np.inf
    for a, b in ((p, q), (q, r), (r, p)):
        ex, ey, ez = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        wx, wy, wz = x - a[0], y - a[1], z - a[2]
        length = ex * ex + ey * ey + ez * ez
        s = min(max((wx * ex + wy * ey + wz * ez) / length, 0.0), 1.0) if length > 0.0 else 0.0
        dx, dy, dz = wx - s * ex, wy - s * ey, wz - s * ez
        nearest = min(nearest, dx * dx + dy * dy + dz * dz)
    return nearest
