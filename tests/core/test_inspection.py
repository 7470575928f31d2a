# SPDX-License-Identifier: GPL-3.0-or-later
"""Spheres, arrows and slices show what the grid holds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ivg_addon.core import inspection
from ivg_addon.core.inspection import Vectors
from ivg_addon.core.inspection_slice import Quantity, Slice, sample_slice, slice_surface
from ivg_addon.core.moments import vectors as of_moments
from ivg_addon.core.settings import Spatial
from ivg_addon.core.spheres import icosphere

from .grids import LATTICE, UNIFORM, Float64, grid, own_weights

EPS = float(np.finfo(np.float32).eps)
POSITIONS = LATTICE.vertex_positions()


def random_vectors(seed: int = 0) -> Float64:
    """Return six vectors of every vertex whose opposite pairs have the same sum, as those of light have."""
    return of_moments(np.random.default_rng(seed).normal(size=(*LATTICE.shape, 12, 3)))


def signed_volume(surface: inspection.Surface) -> float:
    corners = surface.positions.astype(np.float64)[surface.faces]
    return float(np.linalg.det(corners).sum() / 6.0)


def test_spheres_have_the_colours_that_look_ups_find_at_their_vertices() -> None:
    baked = grid(random_vectors())
    vertices = inspection.choose_vertices(baked, 2, 1000)
    surface = inspection.spheres(baked, vertices, 0.5)
    directions, _ = icosphere(3)
    values = surface.values.reshape(len(vertices.index), len(directions), 3)
    for vertex in (0, 5, len(vertices.index) - 1):
        at = np.broadcast_to(POSITIONS.reshape(-1, 3)[vertices.index[vertex]], directions.shape)
        # Eighteen products of numbers below ten, in another order.
        np.testing.assert_allclose(values[vertex], baked.irradiance(at, directions), atol=18 * 10 * EPS)
    assert (values > 0.0).any()


def test_spheres_are_round_and_as_large_as_told() -> None:
    baked = grid(random_vectors())
    vertices = inspection.choose_vertices(baked, 2, 1000)
    surface = inspection.spheres(baked, vertices, 0.5)
    centres = vertices.positions.repeat(len(surface.positions) // len(vertices.positions), axis=0)
    radius = np.linalg.norm(surface.positions - centres, axis=1)
    np.testing.assert_allclose(radius, 0.25 * 2 * LATTICE.voxel_size.min(), rtol=1e-5)
    # Of 1,280 triangles, with the vertices on the sphere: a little less than the ball, and turned outwards.
    ball = 4.0 / 3.0 * math.pi * radius.mean(dtype=np.float64) ** 3 * len(vertices.index)
    assert 0.98 * ball < signed_volume(surface) < ball


@pytest.mark.parametrize(("which", "direction"), [(Vectors.FLUX, None), (Vectors.NY, 3)])
def test_arrows_are_the_vectors(which: Vectors, direction: int | None) -> None:
    six = random_vectors()
    baked = grid(six, lit_weights=own_weights())
    vertices = inspection.choose_vertices(baked, 1, 1000)
    surface = inspection.arrows(baked, vertices, which, 0.8)
    shape, _ = inspection.unit_arrow()
    arrows = surface.positions.reshape(-1, len(shape), 3)
    tip, tail = (int(np.argmin(np.linalg.norm(shape - end, axis=1))) for end in ((0, 0, 1), (0, 0, 0)))
    rgb = (six[..., 4, :, :] + six[..., 5, :, :] if direction is None else six[..., direction, :, :]).reshape(-1, 3, 3)
    pointing = np.einsum("ncx,c->nx", rgb, (0.2126, 0.7152, 0.0722))
    np.testing.assert_allclose(arrows[:, tail], POSITIONS.reshape(-1, 3), atol=4 * EPS * 4.0)
    spacing = LATTICE.voxel_size.min()
    expected = pointing * 0.8 * spacing / np.percentile(np.linalg.norm(pointing, axis=1), 95)
    np.testing.assert_allclose(arrows[:, tip] - arrows[:, tail], expected, atol=16 * EPS * 4.0)
    np.testing.assert_allclose(surface.values.reshape(-1, len(shape), 3)[:, 0], np.linalg.norm(rgb, axis=2), rtol=1e-5)


def test_arrows_are_closed_and_turned_outwards() -> None:
    shape, triangles = inspection.unit_arrow()
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    assert {tuple(edge) for edge in edges} == {tuple(edge[::-1]) for edge in edges}
    assert len({tuple(edge) for edge in edges}) == len(edges)
    assert signed_volume(inspection.Surface(shape, triangles, shape)) > 0.0


def test_nothing_points_anywhere_in_the_dark() -> None:
    baked = grid(np.zeros((6, 3, 3)))
    assert not len(inspection.arrows(baked, inspection.choose_vertices(baked, 1, 1000), Vectors.FLUX, 1.0).faces)
    assert inspection.gain(inspection.mean_irradiance(baked), 1.0) == 2.0


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_slices_are_what_the_field_is_there(axis: int) -> None:
    """Light of radiance a + b·x: E = π (a + b·x) for every normal, which trilinear interpolation keeps."""
    slope = np.array([0.2, 0.5, 0.1])
    baked = grid(UNIFORM * (3.0 + POSITIONS @ slope)[..., None, None, None], lit_weights=own_weights())
    for quantity in (Quantity.MEAN, Quantity.PX, Quantity.NZ):
        cut = sample_slice(baked, axis, 0.3, quantity, Spatial.TRILINEAR)
        low, high = LATTICE.bounds_min[axis], LATTICE.bounds_max[axis]
        np.testing.assert_allclose(cut.points[..., axis], low + 0.3 * (high - low), rtol=1e-12)
        expected = np.repeat(np.pi * (3.0 + cut.points @ slope)[..., None], 3, axis=-1)
        np.testing.assert_allclose(cut.values, expected, rtol=64 * EPS)
        assert cut.known.all()


def test_slices_show_look_ups_and_lit_shares() -> None:
    validity = np.clip((POSITIONS[..., 0] + 0.5) / 2.0, 0.0, 1.0)
    baked = grid(random_vectors(), validity)
    cut = sample_slice(baked, 2, 0.5, Quantity.NY, Spatial.TRICUBIC)
    rows = cut.points.reshape(-1, 3)
    normals = np.broadcast_to((0.0, -1.0, 0.0), rows.shape)
    found = baked.irradiance(rows, normals, "TRICUBIC", normal_bias=0.0)
    np.testing.assert_array_equal(cut.values.reshape(-1, 3), found)
    share = sample_slice(baked, 2, 0.5, Quantity.LIT, Spatial.TRICUBIC).values
    x = np.linspace(-1.0, 1.5, 6)
    expected = np.interp(cut.points[..., 0], x, np.clip((x + 0.5) / 2.0, 0.0, 1.0))
    np.testing.assert_allclose(share, np.repeat(expected[..., None], 3, axis=-1), atol=1e-6)


def test_slices_leave_out_where_no_vertex_is_lit() -> None:
    """Vertices up to x = −0.5 are unlit: of four samples a voxel, the first that is known is 0.125 m on."""
    baked = grid(random_vectors(), np.where(POSITIONS[..., 0] < -0.4, 0.0, 1.0))
    cut = sample_slice(baked, 1, 0.5, Quantity.MEAN, Spatial.TRILINEAR)
    np.testing.assert_array_equal(cut.known, cut.points[..., 0] > -0.5 + 1e-9)
    surface = slice_surface(cut)
    assert surface.positions[:, 0].min() == pytest.approx(-0.375)
    corners = surface.positions.astype(np.float64)[surface.faces]
    sides = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]), axis=1)
    assert sides.sum() == pytest.approx(1.875 * 3.5)


def test_a_slice_of_which_nothing_is_known_has_no_faces() -> None:
    points = np.zeros((3, 2, 3))
    assert not len(slice_surface(Slice(points, np.zeros((3, 2, 3), np.float32), np.zeros((3, 2), np.bool_))).faces)


@pytest.mark.parametrize(("every", "most"), [(1, 1000), (2, 1000), (1, 40), (3, 10), (1, 1)])
def test_as_many_vertices_as_may_be(every: int, most: int) -> None:
    step = inspection.stride(LATTICE.shape, every, most)
    counts = [math.prod(len(range(0, n, s)) for n in LATTICE.shape) for s in (step, step - 1 or 1)]
    assert counts[0] <= most
    assert step == every or counts[1] > most
    baked = grid(random_vectors(), np.random.default_rng(1).uniform(-0.5, 1.0, LATTICE.shape).clip(0.0))
    vertices = inspection.choose_vertices(baked, every, most)
    assert (len(vertices.index), vertices.stride) == (len(vertices.validity), step)
    np.testing.assert_allclose(vertices.positions, POSITIONS.reshape(-1, 3)[vertices.index], rtol=4 * EPS)
    np.testing.assert_array_equal(vertices.validity, baked.validity.reshape(-1)[vertices.index])
    np.testing.assert_array_equal(vertices.lit.index, vertices.index[vertices.validity > 0.0])


def test_the_mean_of_what_is_lit_is_a_medium_grey() -> None:
    lit = POSITIONS[..., 2] > 2.0
    baked = grid(UNIFORM * np.where(lit, 3.0, 1000.0)[..., None, None, None], lit)
    mean = inspection.mean_irradiance(baked)
    assert mean == pytest.approx(3.0 * math.pi)
    assert inspection.gain(mean, 0.0) * mean == pytest.approx(inspection.MIDDLE)
    assert inspection.gain(mean, 1.0) == pytest.approx(2.0 * inspection.gain(mean, 0.0))
