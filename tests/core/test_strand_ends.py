# SPDX-License-Identifier: GPL-3.0-or-later
"""Round ends of strands against the closed forms of capsules."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from ivg_addon.core.strand_ends import end_triangles
from ivg_addon.core.strands import strand_tubes

from .test_strands import area, area_vectors, needles

RADIUS, LENGTH = 0.01, 1.0


@pytest.mark.parametrize(("count", "sides"), [(1, 9), (5_000, 5), (14_000, 3)])
def test_a_strand_with_round_ends_is_a_closed_capsule(count: int, sides: int) -> None:
    """Closed, convex and of the area 2π r l + 4π r²: on average it shows π r l / 2 + π r² (Cauchy)."""
    mesh = strand_tubes(replace(needles(count, apart=0.0), round_ends=True)).mesh
    assert len(mesh.triangle_corners) == count * (2 * sides + end_triangles(sides))
    assert area(mesh) == pytest.approx(count * (2 * math.pi * RADIUS * LENGTH + 4 * math.pi * RADIUS**2), rel=1e-3)
    edges = mesh.triangle_corners[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    there, back = (
        np.unique(pairs @ [1, 1 << 32]) for pairs in (edges.astype(np.int64), edges[:, ::-1].astype(np.int64))
    )
    assert len(there) == len(edges), "each edge once in either direction"
    np.testing.assert_array_equal(there, back)
    corners = mesh.positions[mesh.triangle_corners].astype(float)
    outward = corners.mean(axis=1) - (0, 0, LENGTH / 2)
    assert np.einsum("ij,ij->i", area_vectors(mesh), outward).min() > 0


@pytest.mark.parametrize("degrees", [0.0, 20.0, 70.0, 90.0])
def test_round_ends_show_as_much_as_spheres(degrees: float) -> None:
    """2 r l sin θ + π r², with 9 sides: 1.1 % of the former and 7 % of the latter may be missing."""
    angle = math.radians(degrees)
    mesh = strand_tubes(replace(needles(1), round_ends=True)).mesh
    shown = np.abs(area_vectors(mesh) @ (math.sin(angle), 0.0, math.cos(angle))).sum() / 2
    side, ends = 2 * RADIUS * LENGTH * math.sin(angle), math.pi * RADIUS**2
    assert shown == pytest.approx(side + ends, abs=0.011 * side + 0.07 * ends)


def test_a_pointed_end_has_no_dome() -> None:
    strands = replace(needles(2), round_ends=True)
    strands.radii[1] = 0
    strands.uvs["UV"] = np.array([(0, 1), (2, 3)], dtype=np.float32)
    mesh = strand_tubes(strands).mesh
    assert len(mesh.triangle_corners) == 9 + 2 * 9 + 3 * end_triangles(9) // 2
    strand = np.round(mesh.positions[:, 0]).astype(int)
    np.testing.assert_array_equal(mesh.uv_maps["UV"], strands.uvs["UV"][strand])
