# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertices by a wall behind which it is dim."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ivg_addon.core.bake import bake
from ivg_addon.core.lit_volume import DIM
from ivg_addon.core.outshone import outshone_steps
from ivg_addon.core.partitions import Partitions
from ivg_addon.core.progress import finish
from ivg_addon.core.scene import Scene
from ivg_addon.core.settings import BakeSettings

from .rooms import Part, ball, quad, scene, sky
from .turned_rooms import LATTICE, UNDIVIDED, knowledge

BRIGHT = 1_000_000
BEHIND = int(0.5 * DIM * BRIGHT)


def outshone(of: Scene, front: list[int], back: list[int], partitions: Partitions = UNDIVIDED) -> NDArray[np.bool_]:
    """Return which vertices are, in the grid's shape."""
    known = knowledge(of, front, back)
    found = finish(outshone_steps(known, known.tracer, LATTICE, partitions, 0, 2))
    return found.reshape(LATTICE.shape)


def shell() -> Part:
    """Return a sphere of radius 0.8 m."""
    return ball(0.8, rounds=3, smooth=False)


def test_vertices_by_a_shell_that_is_dim_inside() -> None:
    """Those whose voxels reach through it, and no others."""
    found = outshone(scene([shell()]), [BRIGHT], [BEHIND])
    off = np.abs(np.linalg.norm(LATTICE.vertex_positions(), axis=-1) - 0.8)
    voxel = LATTICE.voxel_size
    assert found[off < 0.3 * voxel.min()].all()
    assert not found[off > np.linalg.norm(voxel)].any()
    assert found.any()


def test_nothing_is_outshone_by_little_or_next_to_the_dark() -> None:
    shells = scene([shell()])
    assert not outshone(shells, [BRIGHT], [2 * BEHIND + 1]).any()
    assert not outshone(shells, [BRIGHT], [0]).any()


def test_planes_have_their_say_first() -> None:
    plane = np.tile(np.array([1.0, 0.0, 0.0, -9.0, 0.0], dtype=np.float32), (LATTICE.vertex_count, 1))
    everywhere = Partitions(np.arange(LATTICE.vertex_count + 1, dtype=np.int32), plane)
    assert not outshone(scene([shell()]), [BRIGHT], [BEHIND], everywhere).any()


def test_light_flows_around_a_leaf() -> None:
    """Its dim side and its bright one are no two places; those of a roof are."""
    leaf, roof = (scene([quad((-half, -half, 0.1), (2 * half, 0, 0), (0, 2 * half, 0))]) for half in (0.1, 3.0))
    assert not outshone(leaf, [BRIGHT], [BEHIND]).any()
    assert outshone(roof, [BRIGHT], [BEHIND]).any()


def test_a_hollow_ball_with_a_hole_under_an_even_sky() -> None:
    """A convex body sees nothing but sky: E = π on all of it, though there is light inside.

    Leaving dim places out costs DIM of the light at most; counted, they cost a quarter of it here.
    """
    hollow = ball(0.8, rounds=4, smooth=False)
    center = hollow.vertices.reshape(-1, 3, 3).mean(axis=1)
    hole = center[:, 2] > 0.985 * center[:, 2].max()
    open_ball = scene([replace(hollow, triangles=hollow.triangles[~hole])], lights=sky())
    settings = BakeSettings((-1.1,) * 3, (1.1,) * 3, (8, 8, 8), photons=4_000_000, include_direct=True)
    n = center / np.linalg.norm(center, axis=1, keepdims=True)
    n = n[np.abs(n[:, 2]) < 0.9]
    found = bake(open_ball, settings).grid.irradiance(0.8 * n, n)
    assert abs(found.mean() / np.pi - 1.0) < DIM
