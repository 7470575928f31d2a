# SPDX-License-Identifier: GPL-3.0-or-later
"""Means of trilinear weights over the lit parts of dual cells, against exact integrals over clipped cells."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core import lit_volume
from ivg_addon.core.bake import LEAST_LIT_SHARE
from ivg_addon.core.lit_volume import LitParts, lit_part_steps
from ivg_addon.core.prefilter import deconvolved
from ivg_addon.core.progress import finish
from ivg_addon.core.settings import Spatial

from .convex import clipped_nodes, clipped_volume
from .grids import matrix, spread
from .rooms import box, scene
from .turned_rooms import LATTICE, ROOM, SEEN, TURN, UNDIVIDED, halfspaces, knowledge
from .z_tests import FALSE_ALARM

Float64 = NDArray[np.float64]

POINTS = 1024
HALF_ROUNDING = 2.0**-11
"""Of float16, relative."""


@cache
def parts(points: int = POINTS, seed: int = 0, threads: int = 2) -> LitParts:
    return finish(
        lit_part_steps(knowledge(scene([ROOM]), [1000], [0]), LATTICE, UNDIVIDED, SEEN, points, seed, threads)
    )


@cache
def exact() -> tuple[Float64, Float64]:
    """Return means over whole dual cells of the 27 weights where it is lit, 0 elsewhere, and of their squares.

    A weight is a polynomial in each of the eight octants about the vertex.
    """
    room = halfspaces(TURN)
    means, squares = np.zeros((2, *LATTICE.shape, 3, 3, 3))
    for vertex in np.ndindex(LATTICE.shape):
        for octant in np.ndindex(2, 2, 2):
            sides = 2 * np.array(octant) - 1
            ends = LATTICE.bounds_min + LATTICE.voxel_size * np.stack([vertex, vertex + sides / 2])
            low, high = ends.min(axis=0), ends.max(axis=0)
            if (high > np.array(LATTICE.bounds_max) + 1e-9).any() or (low < np.array(LATTICE.bounds_min) - 1e-9).any():
                continue
            points, weights = clipped_nodes(low, high, *room)
            away = sides * ((points - LATTICE.bounds_min) / LATTICE.voxel_size - vertex)
            w = np.zeros((len(points), 3, 3))
            w[..., 1] = 1 - away
            w[:, range(3), 1 + sides] = away
            product = np.einsum("ni,nj,nk->nijk", *np.moveaxis(w, 1, 0))
            means[vertex] += np.tensordot(weights, product, axes=1)
            squares[vertex] += np.tensordot(weights, product**2, axes=1)
    volume = LATTICE.cell_volumes()[..., None, None, None]
    return means / volume, squares / volume


def test_the_exact_integrals_are_exact() -> None:
    """∫ x y z over the unit cube's corner below x + y + z = 1 is 1/720; the whole cube's 1/8; the volume the volume."""
    points, weights = clipped_nodes((0, 0, 0), (1, 1, 1), [(1, 1, 1)], [1])
    assert weights @ points.prod(axis=1) == pytest.approx(1 / 720)
    assert weights @ points[:, 0] ** 3 * 20 == pytest.approx(1 / 6)
    points, weights = clipped_nodes((0, 0, 0), (1, 1, 1), [(1, 0, 0)], [2])
    assert weights @ points.prod(axis=1) ** 2 == pytest.approx(1 / 27)
    _, weights = clipped_nodes((-0.2, 0, 0.3), (1.5, 1, 1.2), *halfspaces(TURN))
    assert weights.sum() == pytest.approx(clipped_volume((-0.2, 0, 0.3), (1.5, 1, 1.2), *halfspaces(TURN)))


def test_weights_of_a_turned_room_are_its_exact_integrals() -> None:
    """Points as even as these scatter less than random ones, whose standard error is therefore safe."""
    found, (means, squares) = parts(), exact()
    share = means.sum(axis=(-3, -2, -1))
    integral = found.share[..., None, None, None] * found.weights.astype(np.float64)
    error = np.sqrt((squares - means**2).clip(0) / POINTS)
    cut = (share > 1e-9) & (share < 1 - 1e-9)
    # Normal where there are a dozen points.
    usual = (cut & (share * POINTS > 12))[..., None, None, None] & (means > 1e-9)
    assert usual.sum() > 1000
    deviation = np.abs(integral - means)
    z = (deviation - HALF_ROUNDING * means).clip(0)[usual] / error[usual]
    assert usual.sum() * math.erfc(z.max() / math.sqrt(2)) >= FALSE_ALARM
    # Cells are independent: the sums over all of them are 27 sharper tests.
    total = np.where(usual, integral - means, 0).sum(axis=(0, 1, 2))
    rounding = HALF_ROUNDING * np.sqrt(np.where(usual, means**2, 0).sum(axis=(0, 1, 2)))
    total_z = np.abs(total) / np.hypot(np.sqrt(np.where(usual, error**2, 0).sum(axis=(0, 1, 2))), rounding)
    assert 27 * math.erfc(total_z.max() / math.sqrt(2)) >= FALSE_ALARM


def test_weights_sum_to_one_and_are_those_of_whole_cells_where_nothing_cuts() -> None:
    found, (means, _) = parts(), exact()
    sums = found.weights.astype(np.float64).sum(axis=(-3, -2, -1))
    np.testing.assert_allclose(sums, 1, atol=HALF_ROUNDING)
    assert (found.weights >= 0).all()
    whole = LATTICE.whole_cell_weights()
    full = means.sum(axis=(-3, -2, -1)) > 1 - 1e-9
    assert full.any()
    np.testing.assert_array_equal(found.weights[full], whole[full])
    np.testing.assert_allclose(means[full], whole[full].astype(np.float64), atol=1e-9)
    # Cut but for less than the points find; and where none is lit, nothing will ask.
    for share, least in ((1, full.sum()), (0, 0)):
        same = found.share == share
        assert same.sum() > least
        np.testing.assert_array_equal(found.weights[same], whole[same])


def test_cells_that_nothing_cuts_are_whole_even_if_their_points_disagree() -> None:
    """In a cube with one lit side of six, about one point in 25 is taken for lit."""
    sides = box((-3, -3, -3), (3, 3, 3), inward=True)
    top = np.all(np.isclose(sides.vertices[sides.triangles][:, :, 2], 3), axis=1)
    cube = scene([replace(sides, triangles=sides.triangles[part]) for part in (top, ~top)])
    found = finish(lit_part_steps(knowledge(cube, [1000, 0], [0, 1000]), LATTICE, UNDIVIDED, SEEN, POINTS, 0, 2))
    assert set(np.unique(found.share)) <= {0.0, 1.0}
    np.testing.assert_array_equal(found.weights, LATTICE.whole_cell_weights())


def test_weights_do_not_depend_on_batches_and_threads(monkeypatch: pytest.MonkeyPatch) -> None:
    first = parts(100, threads=1).weights
    for batch, threads in ((100, 3), (1000, 2), (1 << 20, 4)):
        monkeypatch.setattr(lit_volume, "_BATCH", batch)
        np.testing.assert_array_equal(parts.__wrapped__(100, threads=threads).weights, first)
    assert (parts(100, seed=1).weights != first).any()


# --- Solving with them ------------------------------------------------------------------------------------------------


def system() -> tuple[NDArray[np.float32], Float64]:
    """Return the turned room's validity and A, (vertices, vertices)."""
    found = parts()
    validity = np.where(found.share >= LEAST_LIT_SHARE, found.share, np.float32(0))
    return validity, matrix(validity, found.weights)


def test_the_iteration_converges_in_a_turned_room() -> None:
    """(I − A)ⁿ falls to zero: all its eigenvalues are smaller than 1, though rows sum up to more in magnitude."""
    validity, a = system()
    remainder = (np.eye(len(a)) - a)[validity.reshape(-1) > 0][:, validity.reshape(-1) > 0]
    assert np.abs(np.linalg.eigvals(remainder)).max() < 1
    assert np.abs(remainder).sum(axis=1).max() > 1


@pytest.mark.parametrize("slope", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 2, -3)])
def test_linear_fields_in_a_turned_room_come_back(slope: tuple[float, ...]) -> None:
    """Their exact means are theirs at the lit parts' centroids; values are wanted at the vertices.

    The means of the interpolant come closer to them with each step, on average and at worst. Not at every vertex: where
    they agreed by chance, the neighbours' corrections disturb them.
    """
    validity, a = system()
    means, _ = exact()
    offsets = (np.array(list(np.ndindex(3, 3, 3))) - 1) * LATTICE.voxel_size
    share = means.sum(axis=(-3, -2, -1))
    field = LATTICE.vertex_positions() @ np.array(slope)
    away = means.reshape(*LATTICE.shape, 27) @ offsets / np.maximum(share, 1e-300)[..., None] @ np.array(slope)
    known = validity > 0
    m = np.where(known, field + away, 0)
    solved = deconvolved(spread(m), validity, parts().weights, Spatial.TRILINEAR)[..., 0, 0, 0]
    once = m + (m - (a @ m.reshape(-1)).reshape(m.shape))
    misses = [np.abs(m - (a @ v.reshape(-1)).reshape(m.shape))[known] for v in (m, once, solved)]
    errors = [np.abs(v - field)[known] for v in (m, once, solved)]
    for before, after in [*itertools.pairwise(misses), *itertools.pairwise(errors)]:
        assert np.square(after).mean() < np.square(before).mean()
    for before, after in itertools.pairwise(misses):
        assert after.max() < before.max()
