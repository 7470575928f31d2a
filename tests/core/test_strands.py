# SPDX-License-Identifier: GPL-3.0-or-later
"""Hair made of triangles against the closed forms of cylinders and tori."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ivg_addon.core.instancing import MeshData
from ivg_addon.core.strands import Strands, strand_tubes


def strands_of(*lines: np.ndarray, radius: float = 0.01, smooth: bool = True) -> Strands:
    offsets = np.concatenate([[0], np.cumsum([len(line) for line in lines])]).astype(np.int32)
    positions = np.concatenate(lines).astype(np.float32)
    return Strands(offsets, positions, np.full(len(positions), radius, dtype=np.float32), smooth, {})


def area_vectors(mesh: MeshData) -> np.ndarray:
    corners = mesh.positions[mesh.triangle_corners].astype(float)
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2


def area(mesh: MeshData) -> float:
    return float(np.linalg.norm(area_vectors(mesh), axis=1).sum())


def needles(count: int, apart: float = 1.0) -> Strands:
    """Return straight vertical strands of length 1, side by side."""
    line = np.array([(0, 0, 0), (0, 0, 1)], dtype=float)
    return strands_of(*[line + np.array([apart * i, 0, 0]) for i in range(count)])


@pytest.mark.parametrize(("count", "sides"), [(1, 9), (40_000, 5), (60_000, 3)])
def test_a_tube_has_the_surface_of_a_cylinder(count: int, sides: int) -> None:
    tubes = strand_tubes(needles(count, apart=0.0))
    assert len(tubes.mesh.triangle_corners) == 2 * sides * count
    assert area(tubes.mesh) == pytest.approx(count * 2 * math.pi * 0.01, rel=1e-3)


def test_outside_is_the_front() -> None:
    mesh = strand_tubes(needles(3)).mesh
    centres = mesh.positions[mesh.triangle_corners].astype(float).mean(axis=1)
    outward = centres - (np.round(centres[:, :1]) * (1, 0, 0) + centres[:, 2:] * (0, 0, 1))
    assert np.einsum("ij,ij->i", area_vectors(mesh), outward).min() > 0


def test_random_rolls_make_projected_areas_exact_in_every_direction() -> None:
    """Seen from any side a strand covers 2 r times its length: |z| < 4 of 60,000 prisms, one in 16,000 fails."""
    count = 60_000
    mesh = strand_tubes(needles(count, apart=0.0)).mesh
    for direction in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.6, 0.8, 0.0)):
        near_and_far = np.abs(area_vectors(mesh) @ direction) / 2
        # Triangles come as all near ones, then all far ones, each strand by strand.
        width = near_and_far.reshape(2, count, 3).sum(axis=(0, 2)) / 0.02
        z = (width.mean() - 1) / (width.std() / math.sqrt(count))
        assert abs(z) < 4


def test_a_bent_tube_has_the_surface_of_a_torus() -> None:
    """Prisms that are mitred have, on average over their sides, the length of their axis: a polygon in the circle."""
    turn = np.linspace(0, 1.5 * math.pi, 25)
    arc = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    want = 2 * math.pi * 0.01 * 1.5 * math.pi
    # A chord of 11.25° is shorter than its arc by 0.16 %.
    assert area(strand_tubes(strands_of(arc, smooth=False)).mesh) == pytest.approx(want * 0.9984, rel=1e-3)


def test_smooth_strands_pass_through_their_keys_and_round_their_corners() -> None:
    keys = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1)], dtype=float)
    smooth = strand_tubes(strands_of(keys, radius=1e-4)).mesh
    straight = strand_tubes(strands_of(keys, radius=1e-4, smooth=False)).mesh
    assert len(smooth.triangle_corners) > 3 * len(straight.triangle_corners)
    for mesh in (smooth, straight):
        distance = np.linalg.norm(mesh.positions[:, None] - keys, axis=2).min(axis=0)
        assert distance.max() < 3e-4
    # Halfway between the two inner keys Catmull and Rom's spline is at (9 (p₁ + p₂) − p₀ − p₃) / 16.
    middle = (9 * (keys[1] + keys[2]) - keys[0] - keys[3]) / 16
    assert np.linalg.norm(smooth.positions - middle, axis=1).min() < 3e-4
    assert np.linalg.norm(straight.positions - middle, axis=1).min() > 0.05


def test_a_pointed_tip_has_no_triangles_without_area() -> None:
    strands = needles(1)
    strands.radii[-1] = 0
    mesh = strand_tubes(strands).mesh
    assert np.linalg.norm(area_vectors(mesh), axis=1).min() > 0
    # A cone, nearly: half of the cylinder.
    assert area(mesh) == pytest.approx(math.pi * 0.01, rel=1e-3)


def test_a_closed_tip_is_as_thick_as_the_spline_of_its_radius() -> None:
    """Of radii r, r, …, r, 0 the last two segments show 1 + 1/24 and 131/240 times 2 r l from the side: ∫ 2 r(t) dz(t).

    Cones would show 1 and 1/2; pieces may miss 1/128 of each. What tapers evenly is a cone, at its end too: there keys
    move as the radius does.
    """
    line = np.array([(0, 0, z) for z in range(6)], dtype=float)
    strands = strands_of(line)
    strands.radii[-1] = 0
    shown = np.abs(area_vectors(strand_tubes(strands).mesh) @ (1.0, 0.0, 0.0)).sum() / 2
    width = np.abs(area_vectors(strand_tubes(strands_of(line)).mesh) @ (1.0, 0.0, 0.0)).sum() / 2 / 5
    assert shown / width == pytest.approx(4 + 1 / 24 + 131 / 240, abs=2 / 128)
    strands.radii[:] = np.linspace(0.01, 0, 6)
    assert len(strand_tubes(strands).mesh.triangle_corners) == 9 * (2 * 5 - 1)


def test_strands_that_turn_back_or_stand_still() -> None:
    lines = [
        np.array([(0, 0, 0), (0, 0, 1), (0, 0, 0)], dtype=float),
        np.array([(3, 0, 0), (3, 0, 0), (3, 0, 1)], dtype=float),
        np.array([(6, 0, 0), (6, 0, 0)], dtype=float),
    ]
    for smooth in (True, False):
        mesh = strand_tubes(strands_of(*lines, smooth=smooth)).mesh
        assert np.isfinite(mesh.positions).all()
        assert np.abs(mesh.positions - np.round(mesh.positions / 3) * 3).max() < 1.2


def test_what_is_not_a_strand_is_left_out() -> None:
    good = np.array([(0, 0, 0), (0, 0, 1)], dtype=float)
    bad = good.copy()
    bad[1, 2] = np.nan
    strands = strands_of(good[:1], bad, good, good[:0], good)
    tubes = strand_tubes(strands)
    assert (tubes.shown, tubes.strands) == (2, 2)
    strands.radii[-1] = -1
    assert strand_tubes(strands).strands == 1
    assert len(strand_tubes(strands_of(good[:1])).mesh.triangle_corners) == 0


def test_roots_keep_their_texture_coordinates() -> None:
    strands = needles(5)
    strands.uvs["UV"] = np.arange(10, dtype=np.float32).reshape(5, 2)
    mesh = strand_tubes(strands).mesh
    strand = np.round(mesh.positions[:, 0]).astype(int)
    np.testing.assert_array_equal(mesh.uv_maps["UV"], strands.uvs["UV"][strand])


def test_too_many_are_thinned_and_keep_their_area() -> None:
    tubes = strand_tubes(needles(700), most=600)
    assert tubes.thinned
    assert (tubes.shown, tubes.strands) == (100, 700)
    assert area(tubes.mesh) == pytest.approx(700 * 2 * math.pi * 0.01, rel=2e-2)
    assert len(np.unique(np.round(tubes.mesh.positions[:, 0]))) == 100, "evenly over all"
