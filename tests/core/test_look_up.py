# SPDX-License-Identifier: GPL-3.0-or-later
"""Interpolation in space: what it reproduces, what it leaves out, and that nothing depends on how it is asked."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from ivg_addon.core import look_up
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.errors import SettingsError
from ivg_addon.core.grid import DEFAULT_NORMAL_BIAS, IrradianceVectorGrid
from ivg_addon.core.partitions import Partitions
from ivg_addon.core.reconstruction import coefficients
from ivg_addon.core.settings import Directional, Spatial

from .grids import LATTICE, UNIFORM, grid, own_weights

Float64 = NDArray[np.float64]

LOW, HIGH = np.array(LATTICE.bounds_min), np.array(LATTICE.bounds_max)
FLOAT32 = 2.0**-23
"""Rounding of the stored numbers; sums of 64 of them, each of order one, lose a few bits more."""

fractions = st.tuples(*[st.floats(0, 1)] * 3).map(np.array)
anywhere = st.tuples(*[st.floats(-1e6, 1e6)] * 3).map(np.array)
normals = st.tuples(*[st.floats(-1, 1)] * 3).map(np.array).filter(lambda v: np.linalg.norm(v) > 1e-3)
spatials = st.sampled_from(list(Spatial))
directionals = st.sampled_from(list(Directional))


def random_vectors(seed: int = 0, shape: tuple[int, ...] = LATTICE.shape) -> Float64:
    return np.random.default_rng(seed).normal(size=(*shape, 6, 3, 3))


WIDE = Lattice(LATTICE.bounds_min, LATTICE.bounds_max, (12, 11, 13))


@pytest.mark.parametrize("spatial", Spatial)
@given(fraction=fractions, normal=normals, directional=directionals, seed=st.integers(0, 10))
def test_linear_fields_are_exact_between_vertices(
    spatial: Spatial, fraction: Float64, normal: Float64, directional: Directional, seed: int
) -> None:
    """All 54 numbers linear in space, as are their means over cells but for those that the bounds halve.

    These spoil three vertices inwards. The B-spline reaches one voxel further, and its second differences one more.
    """
    rng = np.random.default_rng(seed)
    offset, slope = rng.normal(size=(6, 3, 3)), rng.normal(size=(3, 6, 3, 3))

    def field(positions: Float64) -> Float64:
        return np.asarray(offset + np.tensordot(positions, slope, axes=1))

    margin = WIDE.voxel_size * (5.0 if spatial is Spatial.TRICUBIC else 3.0)
    point = (LOW + margin) + fraction * (HIGH - LOW - 2 * margin)
    n = normal / np.linalg.norm(normal)
    linear = grid(field(WIDE.vertex_positions()), lattice=WIDE)
    e = linear.irradiance([point], [normal], spatial, directional)[0]
    expected = np.einsum("dj,dcj->c", coefficients(n, directional), field(point))
    largest = np.abs(linear.vectors).max()
    np.testing.assert_allclose(e, np.maximum(expected, 0.0), atol=64 * FLOAT32 * largest)


@pytest.mark.parametrize("spatial", Spatial)
@given(point=anywhere, normal=normals)
def test_outside_of_the_box_it_clamps(spatial: Spatial, point: Float64, normal: Float64) -> None:
    random = grid(random_vectors())
    clamped = np.clip(point, LOW, HIGH)
    a, b = (random.irradiance([p], [normal], spatial) for p in (point, clamped))
    np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("spatial", Spatial)
@given(fraction=fractions, normal=normals, directional=directionals, bias=st.floats(-1, 1), seed=st.integers(0, 20))
def test_unlit_vertices_are_left_out(
    spatial: Spatial, fraction: Float64, normal: Float64, directional: Directional, bias: float, seed: int
) -> None:
    """A uniform field stays one whatever stands at vertices without light, and however much of the others is cut."""
    rng = np.random.default_rng(seed)
    validity = rng.random(LATTICE.shape) * (rng.random(LATTICE.shape) < 0.6)
    vectors = np.where((validity > 0)[..., None, None, None], UNIFORM, 1e30 * random_vectors(seed))
    point = LOW + fraction * (HIGH - LOW)
    n = normal / np.linalg.norm(normal)
    e = grid(vectors, validity).irradiance([point], [normal], spatial, directional, bias)[0]
    uniform = math.pi * (1 if directional is Directional.LEAST_SQUARES else (np.abs(n) ** 3).sum())
    # Zero is right only where no vertex around the point is lit.
    assert e == pytest.approx([uniform] * 3, rel=1e-4) or (e == 0).all()
    if spatial is Spatial.TRICUBIC:
        assert (e > 0).all() or (_nearest(validity, point) == 0).all()


def test_a_vertex_with_a_sliver_of_light_counts_by_its_share() -> None:
    """Between a lit vertex and one of which a fortieth is lit, half of a twentieth: weights 1 and ½."""
    lattice = Lattice((0, 0, 0), (1, 1, 1), (1, 1, 1))
    dark = lattice.vertex_positions()[..., 0] == 0
    vectors = np.where(dark[..., None, None, None], 0.0, UNIFORM)
    found = grid(vectors, np.where(dark, 1.0, 0.025), lattice, own_weights(lattice)).irradiance(
        [(0.5, 0.5, 0.5)], [(0.0, 0.0, 1.0)], normal_bias=0.0
    )
    np.testing.assert_allclose(found, math.pi / 3.0, rtol=1e-5)


def _nearest(validity: Float64, point: Float64) -> Float64:
    """Return the validity of the eight vertices around a point."""
    cell = np.clip(((point - LOW) / LATTICE.voxel_size).astype(int), 0, np.array(LATTICE.resolution) - 1)
    return validity[tuple(slice(i, i + 2) for i in cell)]


def test_without_any_light_it_is_dark() -> None:
    dark = grid(random_vectors(), validity=0.0)
    for spatial in Spatial:
        assert not dark.irradiance(LATTICE.vertex_positions().reshape(-1, 3), _up(LATTICE.vertex_count), spatial).any()


def _up(count: int) -> Float64:
    return np.tile([0.0, 0.0, 1.0], (count, 1))


@given(seed=st.integers(0, 100), spatial=spatials, directional=directionals)
def test_irradiance_is_never_negative(seed: int, spatial: Spatial, directional: Directional) -> None:
    rng = np.random.default_rng(seed)
    points, directions = rng.uniform(-2, 5, (50, 3)), rng.normal(size=(50, 3))
    e = grid(random_vectors(seed)).irradiance(points, directions, spatial, directional)
    assert (e >= 0).all()
    assert (e == 0).any(), "the field is not one that undershoots"


@given(scale=st.floats(-300, 300), spatial=spatials, normal=normals)
def test_normals_may_have_any_length(scale: float, spatial: Spatial, normal: Float64) -> None:
    random = grid(random_vectors())
    point = [(LOW + HIGH) / 2 + 0.1]
    expected = random.irradiance(point, [normal], spatial)
    np.testing.assert_allclose(
        random.irradiance(point, [10.0**scale * normal], spatial), expected, rtol=1e-4, atol=1e-5
    )


@pytest.mark.parametrize("spatial", Spatial)
def test_single_and_double_precision_ask_the_same(spatial: Spatial) -> None:
    rng = np.random.default_rng(3)
    points, directions = rng.uniform(-1, 4, (1000, 3)).astype(np.float32), rng.normal(size=(1000, 3)).astype(np.float32)
    random = grid(random_vectors(), np.random.default_rng(1).random(LATTICE.shape))
    single = random.irradiance(points, directions, spatial)
    assert single.dtype == np.float32
    np.testing.assert_array_equal(random.irradiance(points.astype(np.float64), directions.tolist(), spatial), single)
    np.testing.assert_array_equal(random.irradiance(np.asfortranarray(points), directions, spatial), single)


def test_any_number_of_threads_gives_the_same_bits(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    points, directions = rng.uniform(-1, 4, (1001, 3)), rng.normal(size=(1001, 3))
    random = grid(random_vectors(), rng.random(LATTICE.shape))
    whole = random.irradiance(points, directions)
    for chunk in (1, 7, 500, 1001):
        monkeypatch.setattr(look_up, "CHUNK", chunk)
        np.testing.assert_array_equal(random.irradiance(points, directions), whole)


def test_a_grid_of_one_voxel() -> None:
    lattice = Lattice((0, 0, 0), (1, 1, 1), (1, 1, 1))
    single = grid(UNIFORM, lattice=lattice)
    points = np.random.default_rng(0).random((20, 3))
    for spatial in Spatial:
        np.testing.assert_allclose(single.irradiance(points, _up(20), spatial), math.pi, rtol=1e-5)


def test_no_points_are_no_irradiance() -> None:
    assert grid(UNIFORM).irradiance(np.empty((0, 3)), np.empty((0, 3))).shape == (0, 3)


# --- Near surfaces ----------------------------------------------------------------------------------------------------


@given(fraction=fractions, normal=normals, bias=st.floats(-2, 2), spatial=spatials)
def test_the_bias_moves_look_ups_off_surfaces(
    fraction: Float64, normal: Float64, bias: float, spatial: Spatial
) -> None:
    """Where all cells are cut by half, a look-up with bias b is one without, half of b voxels along the normal."""
    cut = grid(random_vectors(), 0.5)
    point = LOW + fraction * (HIGH - LOW)
    moved = point + 0.5 * bias * LATTICE.voxel_size * normal / np.linalg.norm(normal)
    biased = cut.irradiance([point], [normal], spatial, normal_bias=bias)
    np.testing.assert_allclose(
        biased, cut.irradiance([moved], [normal], spatial, normal_bias=0.0), rtol=1e-4, atol=1e-4
    )


@given(fraction=fractions, normal=normals, bias=st.floats(-2, 2), spatial=spatials)
def test_in_the_open_there_is_no_bias(fraction: Float64, normal: Float64, bias: float, spatial: Spatial) -> None:
    lit = grid(random_vectors())
    ask = ([LOW + fraction * (HIGH - LOW)], [normal], spatial, Directional.LEAST_SQUARES)
    np.testing.assert_array_equal(lit.irradiance(*ask, bias), lit.irradiance(*ask, 0.0))


# --- Bad input --------------------------------------------------------------------------------------------------------

ONE = [(0.0, 0.0, 0.0)]


def test_bumps_change_whence_light_is_received_and_not_where() -> None:
    """Vertices of uniform fields, each as bright as it likes: a lit normal changes nothing, a surface's the place."""
    rng = np.random.default_rng(2)
    validity = np.clip(rng.uniform(-0.2, 1.2, LATTICE.shape), 0.0, 1.0)
    baked = grid(UNIFORM * rng.uniform(1.0, 2.0, LATTICE.shape)[..., None, None, None], validity, LATTICE)
    points = rng.uniform(LOW, HIGH, (200, 3))
    facing, bumps = rng.normal(size=(2, 200, 3))
    values = baked.interpolated(Spatial.TRILINEAR), baked.validity, baked.partitions, baked.lattice
    way = Spatial.TRILINEAR, Directional.LEAST_SQUARES, DEFAULT_NORMAL_BIAS
    plain, bumped = (look_up.irradiance(*values, points, n, *way, facing=facing) for n in (facing, bumps))
    np.testing.assert_allclose(bumped, plain, rtol=64 * FLOAT32)
    assert np.abs(look_up.irradiance(*values, points, bumps, *way) - plain).max() > 0.1
    np.testing.assert_array_equal(plain, baked.irradiance(points, facing))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((0, 0, 0), (0, 0, 1)), r"points \(3,\) and normals \(3,\) must both have the shape \(n, 3\)"),
        (([(0, 0)], [(0, 1)]), r"shape \(n, 3\)"),
        ((ONE, [(0, 0, 1), (0, 0, 1)]), r"points \(1, 3\) and normals \(2, 3\)"),
        (([(math.nan, 0, 0)], [(0, 0, 1)]), "must be finite numbers"),
        (([(0, math.inf, 0)], [(0, 0, 1)]), "must be finite numbers"),
        ((ONE, [(0, 0, math.nan)]), "must be finite numbers"),
        ((ONE, [(0, 0, 0)]), "normals must not have length zero"),
        ((ONE, [(0, 0, 1)], "NEAREST"), "NEAREST.*use TRILINEAR or TRICUBIC"),
        ((ONE, [(0, 0, 1)], "TRILINEAR", "SH"), "SH.*LEAST_SQUARES or REPORT"),
        ((ONE, [(0, 0, 1)], "TRILINEAR", "REPORT", math.nan), "normal bias nan"),
        (([("a", "b", "c")], [(0, 0, 1)]), "must be numbers"),
        (([(0, 0, 0), (0, 0)], [(0, 0, 1)]), "must be numbers"),
    ],
)
def test_bad_input_is_one_clear_error(arguments: tuple[Any, ...], message: str) -> None:
    with pytest.raises(SettingsError, match=message) as caught:
        grid(UNIFORM).irradiance(*arguments)
    assert "\n" not in str(caught.value)


def test_arrays_of_a_wrong_shape_or_type_make_no_grid() -> None:
    vectors = np.zeros((*LATTICE.shape, 6, 3, 3), dtype=np.float32)
    validity = np.ones(LATTICE.shape, dtype=np.float32)
    record = grid(UNIFORM).record
    weights = LATTICE.whole_cell_weights()
    none = Partitions.none(LATTICE.vertex_count)
    undivided = none.start, none.planes
    with pytest.raises(SettingsError, match=r"grid vectors have shape .* needs \(6, 5, 8, 6, 3, 3\)"):
        IrradianceVectorGrid(vectors[:-1], validity, weights, *undivided, LATTICE, record)
    with pytest.raises(SettingsError, match=r"grid validity have shape .* needs \(6, 5, 8\)"):
        IrradianceVectorGrid(vectors, validity[..., None], weights, *undivided, LATTICE, record)
    with pytest.raises(SettingsError, match=r"grid lit_weights have shape .* needs \(6, 5, 8, 3, 3, 3\)"):
        IrradianceVectorGrid(vectors, validity, weights.reshape(*LATTICE.shape, 27), *undivided, LATTICE, record)
    with pytest.raises(SettingsError, match="grid vectors: float64 instead of float32"):
        IrradianceVectorGrid(vectors.astype(np.float64), validity, weights, *undivided, LATTICE, record)  # type: ignore[arg-type]
    with pytest.raises(SettingsError, match="grid validity: int64 instead of float32"):
        IrradianceVectorGrid(vectors, validity.astype(np.int64), weights, *undivided, LATTICE, record)  # type: ignore[arg-type]
    with pytest.raises(SettingsError, match="grid lit_weights: float32 instead of float16"):
        IrradianceVectorGrid(vectors, validity, weights.astype(np.float32), *undivided, LATTICE, record)  # type: ignore[arg-type]
    four = np.full(len(none.start), 4, dtype=np.int32)
    four[0] = 0
    for start, planes, message in [
        (none.start[:-1], none.planes, "plane_start: int32"),
        (none.start.astype(np.int64), none.planes, "plane_start: int64"),
        (none.start + np.int32(1), none.planes, "does not give each vertex 0 to 3 planes"),
        (four, np.zeros((4, 5), dtype=np.float32), "does not give each vertex 0 to 3 planes"),
        (none.start[::-1] - np.arange(len(none.start), dtype=np.int32), none.planes, "0 to 3 planes"),
        (none.start, np.zeros((1, 5), dtype=np.float32), r"planes: float32 \(1, 5\)"),
    ]:
        with pytest.raises(SettingsError, match=message):
            IrradianceVectorGrid(vectors, validity, weights, start, planes, LATTICE, record)
