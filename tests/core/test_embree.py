# SPDX-License-Identifier: GPL-3.0-or-later
"""Ray casting: hits are where they should be, in the indices of the whole geometry."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from ivg_addon.core.embree import MISS, Tracer
from ivg_addon.core.scene import Geometry

from .rooms import Part, ball, box, quad, scene

Float32 = NDArray[np.float32]


def rays(count: int, seed: int = 0) -> tuple[Float32, Float32]:
    """Return rays from around the origin in all directions, not of length one."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(count, 3)) * rng.uniform(0.5, 2, (count, 1))
    return rng.uniform(-0.2, 0.2, (count, 3)).astype(np.float32), directions.astype(np.float32)


def room() -> Geometry:
    return scene([ball(3.0, rounds=2, inward=True), box((1, -0.5, -0.5), (1.5, 0.5, 0.5))]).geometry


def test_barycentric_coordinates_and_distance_name_the_same_point() -> None:
    geometry = room()
    origins, directions = rays(10_000)
    hits = Tracer(geometry).intersect(origins, directions)
    assert (hits.triangle != MISS).all()
    assert set(geometry.object[hits.triangle]) == {0, 1}
    p, q, r = geometry.vertices[geometry.triangles[hits.triangle]].astype(np.float64).transpose(1, 0, 2)
    u, v = hits.u.astype(np.float64)[:, None], hits.v.astype(np.float64)[:, None]
    on_triangle = (1 - u - v) * p + u * q + v * r
    on_ray = origins + hits.distance[:, None].astype(np.float64) * directions
    np.testing.assert_allclose(on_triangle, on_ray, atol=1e-5)
    assert ((u >= 0) & (v >= 0) & (u + v <= 1 + 1e-6)).all()


def test_the_nearest_surface_is_hit() -> None:
    tracer = Tracer(scene([quad((-1, -1, z), (2, 0, 0), (0, 2, 0)) for z in (3, 1, 2)]).geometry)
    hits = tracer.intersect(np.zeros((1, 3), dtype=np.float32), np.array([[0.1, 0.2, 1]], dtype=np.float32))
    assert hits.triangle[0] // 2 == 1
    assert hits.distance[0] == 1.0


def test_misses() -> None:
    tracer = Tracer(scene([quad((-1, -1, 1), (2, 0, 0), (0, 2, 0))]).geometry)
    origins, directions = np.zeros((2, 3), dtype=np.float32), np.array([[0, 0, -1], [5, 0, 1]], dtype=np.float32)
    hits = tracer.intersect(origins, directions)
    assert (hits.triangle == MISS).all()
    assert (hits.distance > 1e36).all()


def test_hits_are_counted_in_the_whole_geometry() -> None:
    """Of three walls the first is left out: rays pass through it, and the others keep their indices."""
    geometry = scene([quad((-1, -1, z), (2, 0, 0), (0, 2, 0)) for z in (1, 2, 3)]).geometry
    origins, directions = np.zeros((1, 3), dtype=np.float32), np.array([[0.1, 0.2, 1]], dtype=np.float32)
    for keep, wall in (([1, 1, 1], 0), ([0, 1, 1], 1), ([0, 0, 1], 2)):
        hits = Tracer(geometry, np.repeat(keep, 2).astype(bool)).intersect(origins, directions)
        assert hits.triangle.dtype == np.int32
        assert hits.triangle[0] // 2 == wall
    missed = Tracer(geometry, np.zeros(6, dtype=bool)).intersect(origins, directions)
    assert missed.triangle[0] == MISS
    assert missed.distance[0] > 1e36


def test_no_rays_and_no_triangles() -> None:
    none = np.empty((0, 3), dtype=np.float32)
    assert len(Tracer(room()).intersect(none, none).triangle) == 0
    nothing = scene([Part(np.empty((0, 3)), np.empty((0, 3), dtype=np.int32))]).geometry
    assert (Tracer(nothing).intersect(*rays(3)).triangle == MISS).all()


def test_threads_trace_at_the_same_time() -> None:
    tracer = Tracer(room())
    origins, directions = rays(40_000)
    whole = tracer.intersect(origins, directions)
    with ThreadPoolExecutor(4) as pool:
        parts = list(pool.map(lambda i: tracer.intersect(origins[i::4].copy(), directions[i::4].copy()), range(4)))
    for i, part in enumerate(parts):
        np.testing.assert_array_equal(part.triangle, whole.triangle[i::4])
        np.testing.assert_array_equal(part.distance, whole.distance[i::4])


def test_no_ray_leaves_a_closed_room() -> None:
    """Edges are watertight: Embree's robust mode."""
    tracer = Tracer(scene([ball(1.0, rounds=3, inward=True)]).geometry)
    corners = scene([ball(1.0, rounds=3)]).geometry.vertices
    origins, _ = rays(len(corners))
    assert (tracer.intersect(origins, corners - origins).triangle != MISS).all()
    assert (tracer.intersect(*rays(200_000)).triangle != MISS).all()
