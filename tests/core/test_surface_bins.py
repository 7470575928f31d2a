# SPDX-License-Identifier: GPL-3.0-or-later
"""Patches of surface: every point of every triangle has one, of about the size that was asked for."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from ivg_addon.core import surface_bins
from ivg_addon.core.compiled import kernel
from ivg_addon.core.scene import Geometry
from ivg_addon.core.surface_bins import SurfaceBins, patch_of

from .rooms import Part, scene

Float64 = NDArray[np.float64]

coordinates = st.floats(-10, 10, width=32)
triangles = st.lists(st.tuples(*[coordinates] * 9), min_size=1, max_size=5)
shares = st.floats(0, 1)


@kernel
def fill_patches(triangle, u, v, divisions, offset, out):
    for row in range(len(u)):
        out[row] = patch_of(triangle, u[row], v[row], divisions, offset)


def geometry(corners: object) -> Geometry:
    vertices = np.array(corners, dtype=np.float32).reshape(-1, 3)
    return scene([Part(vertices, np.arange(len(vertices)).reshape(-1, 3))]).geometry


def patches(bins: SurfaceBins, triangle: int, u: Float64, v: Float64) -> NDArray[np.int64]:
    out = np.empty(len(u), dtype=np.int64)
    fill_patches(triangle, u, v, bins.divisions, bins.offset, out)
    return out


@given(triangles, st.floats(0.3, 5), st.lists(st.tuples(shares, shares), min_size=2, max_size=30))
def test_points_of_a_patch_are_close_and_of_one_triangle(
    corners: list[tuple[float, ...]], size: float, places: list[tuple[float, float]]
) -> None:
    mesh = geometry(corners)
    bins = SurfaceBins.of(mesh, size)
    u, v = np.array(places).T
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    ends = [*bins.offset[1:], bins.count]
    for triangle, (first, end) in enumerate(zip(bins.offset, ends, strict=True)):
        index = patches(bins, triangle, u, v)
        assert (index >= first).all()
        assert (index < end).all()
        p, q, r = mesh.vertices[mesh.triangles[triangle]].astype(np.float64)
        points = p + u[:, None] * (q - p) + v[:, None] * (r - p)
        for patch in np.unique(index):
            here = points[index == patch]
            extent = np.linalg.norm(here[:, None] - here, axis=-1).max()
            # Two edges of a patch, one after the other.
            assert extent <= 2 * size * (1 + 1e-9)
    assert bins.empty_counts().shape == (bins.count, 2)


@pytest.mark.parametrize("corner", [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.5, 0.5)])
def test_corners_and_edges_belong_to_a_patch(corner: tuple[float, float]) -> None:
    bins = SurfaceBins.of(geometry([(0, 0, 0), (3, 0, 0), (0, 3, 0)]), 1.0)
    assert bins.count == 9
    u, v = corner
    index, just_inside = patches(bins, 0, np.array([u, 0.999 * u]), np.array([v, 0.999 * v]))
    assert 0 <= index < 9
    assert index == just_inside


@pytest.mark.parametrize("turn", [0, 1, 2])
def test_strips_are_cut_along_their_length(turn: int) -> None:
    """Half a strip of 100 m by 1 cm has as many patches of 1 cm as it is long, whatever corner is first."""
    corners = np.roll([(0, 0, 0), (100, 0, 0), (100, 0.01, 0)], turn, axis=0)
    assert 9_900 <= SurfaceBins.of(geometry(corners), 0.01001).count <= 10_000


@pytest.mark.parametrize("size", [1e-30, 1e-3, 1e30])
def test_huge_and_tiny_triangles(size: float) -> None:
    """Coordinates up to the largest that are stored; a triangle without area is one patch."""
    huge = geometry([(-3e38, 0, 0), (3e38, 0, 0), (0, 3e38, 0), (1, 1, 1), (1, 1, 1), (1, 1, 1)])
    bins = SurfaceBins.of(huge, size)
    assert bins.divisions[0, 1:].prod() <= 1 << 18
    assert list(bins.divisions[1, 1:]) == [1, 1]


def test_patches_are_never_too_many(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(surface_bins, "_MOST_PATCHES", 1000)
    large = [(0, 0, 0), (60, 0, 0), (0, 60, 0)]
    few = SurfaceBins.of(geometry(large), 10.0)
    assert few.count == 36
    assert 250 <= SurfaceBins.of(geometry(large), 1.0).count <= 1000
    many = SurfaceBins.of(geometry(large * 2000), 1.0)
    assert many.count == 2000
