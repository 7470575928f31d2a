# SPDX-License-Identifier: GPL-3.0-or-later
"""Patches make up their triangle: areas, centres, corners."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from ivg_addon.core.surface_bins import SurfaceBins
from ivg_addon.core.surface_patches import Patches, spokes

from .test_surface_bins import geometry, patches

coordinates = st.floats(-10, 10, width=32)
SINGLE = 2.0**-20
"""Relative to the ten metres of coordinates."""


@given(st.tuples(*[coordinates] * 9), st.floats(0.7, 5))
def test_patches_make_up_their_triangle(corners: tuple[float, ...], size: float) -> None:
    mesh = geometry([corners])
    bins = SurfaceBins.of(mesh, size)
    found = Patches.of(mesh, bins)
    p, q, r = mesh.vertices[mesh.triangles[0]].astype(np.float64)
    area = 0.5 * np.linalg.norm(np.cross(q - p, r - p))
    np.testing.assert_allclose(found.area.sum(), area, rtol=1e-5, atol=10 * SINGLE)
    middle = (found.area[:, None].astype(np.float64) * found.centre).sum(axis=0)
    np.testing.assert_allclose(middle, area * (p + q + r) / 3, atol=1000 * SINGLE)
    assert (found.triangle == 0).all()


@given(st.floats(0.1, 3), st.integers(0, 2))
def test_centres_lie_in_their_patch_and_corners_around_it(size: float, turn: int) -> None:
    mesh = geometry(np.roll([(0, 0, 0), (3, 0, 0), (1, 2, 0)], turn, axis=0))
    bins = SurfaceBins.of(mesh, size)
    found = Patches.of(mesh, bins)
    some = np.flatnonzero(found.area > 1e-6)
    p, q, r = mesh.vertices[mesh.triangles[0]].astype(np.float64)
    uv = np.linalg.lstsq(np.stack([q - p, r - p], axis=1), (found.centre[some] - p).T, rcond=None)[0]
    np.testing.assert_array_equal(patches(bins, 0, *uv), some)
    ends = np.empty((len(some), 3), dtype=np.float32)
    for which in range(4):
        arrays = mesh.vertices, mesh.triangles, bins.divisions, bins.offset
        spokes(*arrays, some, found.triangle[some], which, ends)
        # The farthest is the far corner of the rectangle, along both of its edges.
        assert (np.linalg.norm(ends - found.centre[some], axis=1) <= 2.0 * size + 1e-5).all()
