# SPDX-License-Identifier: GPL-3.0-or-later
"""Grids fitted to their surfaces, against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core.bake import bake
from ivg_addon.core.compressed import compress
from ivg_addon.core.errors import SettingsError
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.metrics import Agreement, compare
from ivg_addon.core.moments import moments, vectors
from ivg_addon.core.readings import MOMENTS
from ivg_addon.core.scene import Scene
from ivg_addon.core.settings import BakeSettings, Directional, Spatial
from ivg_addon.core.surface_fit import even_basis

from .grids import LATTICE, UNIFORM, grid
from .rooms import box, lamp, quad, rotation, scene

Float64 = NDArray[np.float64]

LAMP = np.array([0.9, 1.3, 1.6])
TURN = rotation((1, 2, 3), 0.5)
SETTINGS = BakeSettings((0, 0, 0), (2, 3, 2.5), (4, 6, 5), photons=400_000, include_direct=True, seed=1)


def black_room(turn: Float64 = np.eye(3)) -> Scene:  # noqa: B008
    """Return a room that reflects nothing, with a lamp of a watt in each channel."""
    of = scene([box((0, 0, 0), (2, 3, 2.5), inward=True, turn=turn)], ((0.0,) * 3,), lights=lamp(turn @ LAMP))
    # What reflects nothing at all is not asked.
    return replace(of, materials=replace(of.materials, albedo=np.full((1, 3), 1e-6, dtype=np.float32)))


def settings(of: Scene) -> BakeSettings:
    low, high = (tuple(map(float, corner)) for corner in of.geometry.bounds())
    return replace(SETTINGS, bounds_min=low, bounds_max=high)


def on_walls(turn: Float64, count: int = 4000) -> tuple[Float64, Float64, Float64]:
    """Return points a fiftieth of the room off its edges, inward normals, and E = cos θ/(4π r²)."""
    rng = np.random.default_rng(3)
    size = np.array([2.0, 3.0, 2.5])
    points, normals = rng.uniform(0.02, 0.98, (count, 3)) * size, np.zeros((count, 3))
    axis, far = rng.integers(0, 3, count), rng.integers(0, 2, count)
    rows = np.arange(count)
    points[rows, axis], normals[rows, axis] = far * size[axis], 1.0 - 2.0 * far
    way = LAMP - points
    truth = np.einsum("nk,nk->n", way, normals) / (4 * np.pi * np.linalg.norm(way, axis=1) ** 3)
    return points @ turn.T, normals @ turn.T, truth


def without(baked: IrradianceVectorGrid) -> IrradianceVectorGrid:
    """Return a grid without its corrections."""
    return replace(baked, corrected=baked.corrected[:0], corrections=baked.corrections[:0])


def against(baked: IrradianceVectorGrid, points: Float64, normals: Float64, truth: Float64) -> Agreement:
    return compare(baked.irradiance(points, normals)[:, 0], truth)


@pytest.mark.parametrize("turn", [np.eye(3), TURN])
def test_walls_near_a_lamp_are_lit_as_they_should_be(turn: Float64) -> None:
    """Direct light of a lamp less than a voxel off no wall: coarse voxels and six vectors cannot say how it falls off.

    The fit takes away more than half of the error that is there without it, and what is lost or made up of the energy.
    """
    of = black_room(turn)
    baked = bake(of, settings(of)).grid
    places = on_walls(turn)
    fitted, plain = against(baked, *places), against(without(baked), *places)
    assert fitted.relative_rmse < 0.5 * plain.relative_rmse
    assert abs(fitted.energy_ratio - 1.0) < 0.01


def test_a_uniform_field_stays_uniform() -> None:
    """A closed room that shines everywhere: no more than the noise of what landed is added."""
    room = box((0, 0, 0), (2, 3, 2.5), inward=True, turn=TURN)
    of = scene([room], ((0.5,) * 3,), ((1.0,) * 3,))
    baked = bake(of, replace(settings(of), include_direct=False, bounces=30)).grid
    points, normals, _ = on_walls(TURN)
    fitted = compare(baked.irradiance(points, normals)[:, 0], np.full(len(points), np.pi))
    # A thousand photons land on a voxel's face, and tell 3 % apart.
    assert fitted.relative_rmse < 0.03
    assert abs(fitted.energy_ratio - 1.0) < 0.005


def test_vectors_stay_means_over_cells() -> None:
    """Corrections are apart: stored vectors, validity and what the report's look-up reads are not touched."""
    of = black_room(TURN)
    baked = bake(of, settings(of)).grid
    points, normals, _ = on_walls(TURN, 100)
    assert len(baked.corrected)
    report = [g.irradiance(points, normals, directional=Directional.REPORT) for g in (baked, without(baked))]
    np.testing.assert_array_equal(*report)
    fitted, plain = (g.irradiance(points, normals) for g in (baked, without(baked)))
    assert (fitted != plain).any()


def test_any_number_of_threads_gives_the_same_bits() -> None:
    of = black_room(TURN)
    one, three = (bake(of, replace(settings(of), threads=threads, photons=100_000)).grid for threads in (1, 3))
    np.testing.assert_array_equal(one.corrected, three.corrected)
    np.testing.assert_array_equal(one.corrections, three.corrections)


def test_a_box_without_surfaces_has_no_corrections() -> None:
    of = black_room()
    inner = replace(SETTINGS, bounds_min=(0.8, 1.0, 0.8), bounds_max=(1.2, 1.5, 1.2), resolution=(2, 2, 2))
    baked = bake(of, inner).grid
    assert not len(baked.corrected)
    assert baked.vectors.any()


def test_coordinates_tell_the_mean_square_irradiance() -> None:
    """⟨(½ n_x)²⟩ = 1/12, ⟨(½ n_x²)²⟩ = 1/20, ⟨½ n_x² · ½ n_y²⟩ = 1/60; quadrature leaves a part in ten thousand."""
    coordinates = np.linalg.inv(even_basis())
    f_x, d_xx, d_yy = coordinates[:, 0], coordinates[:, 3], coordinates[:, 7]
    np.testing.assert_allclose([f_x @ f_x, d_xx @ d_xx, d_yy @ d_yy], [1 / 12, 1 / 20, 1 / 20], rtol=1e-3)
    np.testing.assert_allclose([f_x @ d_xx, d_xx @ d_yy], [0.0, 1 / 60], atol=1e-4)


def test_corrections_are_added_to_what_is_interpolated() -> None:
    """For both interpolations, and in half floats, which hold what is interpolated."""
    rng = np.random.default_rng(6)
    plain = grid(UNIFORM)
    added = np.zeros((LATTICE.vertex_count, MOMENTS, 3))
    some = np.sort(rng.choice(LATTICE.vertex_count, 20, replace=False)).astype(np.int32)
    added[some] = rng.normal(size=(20, MOMENTS, 3))
    corrected = replace(plain, corrected=some, corrections=added[some].astype(np.float32))
    difference = corrected.interpolated(Spatial.TRILINEAR) - plain.interpolated(Spatial.TRILINEAR)
    np.testing.assert_allclose(difference.reshape(-1, 6, 3, 3), vectors(added), atol=1e-5)
    np.testing.assert_allclose(moments(difference).reshape(-1, MOMENTS, 3), added, atol=1e-5)
    cubic = corrected.interpolated(Spatial.TRICUBIC) - plain.interpolated(Spatial.TRICUBIC)
    assert np.abs(cubic).sum() > 0.5 * np.abs(difference).sum()
    points = rng.uniform(LATTICE.bounds_min, LATTICE.bounds_max, (50, 3))
    normals = rng.normal(size=(50, 3))
    expanded = compress(corrected).expand()
    np.testing.assert_allclose(
        expanded.irradiance(points, normals), corrected.irradiance(points, normals), rtol=5e-3, atol=5e-3
    )


@pytest.mark.parametrize("corrected", [[3, 3], [5, 2], [-1, 2], [0, 10_000]])
def test_corrections_of_vertices_that_are_not_there_are_refused(corrected: list[int]) -> None:
    values = np.zeros((2, MOMENTS, 3), dtype=np.float32)
    with pytest.raises(SettingsError, match="vertices that are not there"):
        replace(grid(UNIFORM), corrected=np.array(corrected, dtype=np.int32), corrections=values)
    with pytest.raises(SettingsError, match="2 vertices have some"):
        replace(grid(UNIFORM), corrected=np.array([1, 2], dtype=np.int32), corrections=values[:1])


def test_a_sheet_lit_on_one_side_is_fitted_there_only() -> None:
    """Below a black shelf under the lamp it stays dark."""
    shelf = quad((0.3, 0.5, 0.77), (1.2, 0, 0), (0, 1.8, 0))
    room = box((0, 0, 0), (2, 3, 2.5), inward=True)
    of = scene([room, shelf], ((1e-6,) * 3,), lights=lamp(LAMP))
    baked = bake(of, SETTINGS).grid
    rng = np.random.default_rng(8)
    points = rng.uniform((0.5, 0.8, 0.77), (1.3, 2.1, 0.77), (500, 3))
    way = LAMP - points
    up = np.broadcast_to([0, 0, 1.0], points.shape)
    above = baked.irradiance(points + 1e-4 * up, up)[:, 0]
    truth = way[:, 2] / (4 * np.pi * np.linalg.norm(way, axis=1) ** 3)
    plain = without(baked).irradiance(points + 1e-4 * up, up)[:, 0]
    assert compare(above, truth).relative_rmse < 0.5 * compare(plain, truth).relative_rmse
    below = baked.irradiance(points - 1e-4 * up, -up)[:, 0]
    assert below.mean() < 0.02 * above.mean()
