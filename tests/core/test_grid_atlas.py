# SPDX-License-Identifier: GPL-3.0-or-later
"""The image of a grid: a look-up that reads nothing but its texels gives what the grid gives."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core.errors import SettingsError
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.grid_atlas import BORDER, LARGEST_SIDE, LIT, PLANES, AtlasLayout, atlas, layout
from ivg_addon.core.look_up_rules import FULLY_COUNTED
from ivg_addon.core.partitions import Partitions
from ivg_addon.core.reconstruction import coefficients
from ivg_addon.core.settings import Directional, Spatial

from .grids import LATTICE, grid

Float64 = NDArray[np.float64]


def random_grid() -> IrradianceVectorGrid:
    """Return a grid of random vectors, some vertices unlit, others in part."""
    rng = np.random.default_rng(3)
    validity = np.clip(rng.uniform(-0.3, 1.5, LATTICE.shape), 0.0, 1.0)
    validity[::2, 1] *= 0.05
    return grid(rng.normal(size=(*LATTICE.shape, 6, 3, 3)), validity)


def texels(pixels: NDArray[np.float32], where: AtlasLayout, plane: int) -> Float64:
    """Return a plane's texels at all vertices, (Ni+1, Nj+1, Nk+1, 3)."""
    i, j, k = np.indices(tuple(n + 1 for n in where.resolution))
    column, row = where.texel(i, j, k, plane)
    return pixels[row, column].astype(np.float64)


def test_vertices_give_their_irradiance_for_any_normal() -> None:
    """E = ½ (F·n + Σ W_kj D_kj) of the texels is the look-up at a vertex, where nothing is interpolated."""
    lit = grid(np.random.default_rng(4).normal(size=(*LATTICE.shape, 6, 3, 3)))
    where, pixels = layout(lit.resolution), atlas(lit)
    n = np.array([0.48, -0.6, 0.64])
    c = coefficients(n, Directional.LEAST_SQUARES)
    # c_{±k,j} = ½ (n_j/3 ± W_kj)
    w = c[0::2] - c[1::2]
    e = 0.5 * sum(n[j] * texels(pixels, where, j) for j in range(3))
    e += 0.5 * sum(w[k, j] * texels(pixels, where, 3 + 3 * k + j) for k in range(3) for j in range(3))
    points = LATTICE.vertex_positions().reshape(-1, 3)
    expected = lit.irradiance(points, np.broadcast_to(n, points.shape)).reshape(e.shape)
    # Sums of some twenty numbers of order one, in float32 by the look-up and here in float64.
    np.testing.assert_allclose(np.maximum(e, 0.0), expected, atol=64 * np.finfo(np.float32).eps)


def test_planes_hold_what_trilinear_interpolation_needs() -> None:
    baked = random_grid()
    where, pixels = layout(baked.resolution), atlas(baked)
    counts = np.minimum(baked.validity / FULLY_COUNTED, 1.0)
    values = baked._interpolated[Spatial.TRILINEAR].astype(np.float64)
    for k in range(3):
        for j in range(3):
            difference = (values[..., 2 * k, :, j] - values[..., 2 * k + 1, :, j]) * counts[..., None]
            np.testing.assert_array_equal(
                texels(pixels, where, PLANES.index(f"D_{'xyz'[k]}{'xyz'[j]}")), difference.astype(np.float32)
            )
    lit = texels(pixels, where, LIT)
    np.testing.assert_array_equal(lit[..., 0], baked.validity)
    np.testing.assert_array_equal(lit[..., 1], counts)


def test_walls_stand_in_planes_of_their_own() -> None:
    """N, D and s of each come back from (1 + s) N and (1 + s) D; the last repeats, and who has none speaks for all."""
    rng = np.random.default_rng(5)
    count = np.arange(LATTICE.vertex_count) % 4
    start = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
    normal = rng.normal(size=(start[-1], 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    planes = np.column_stack([normal, rng.uniform(-9, 9, start[-1]), rng.uniform(0, 1, start[-1])]).astype(np.float32)
    baked = grid(rng.normal(size=(*LATTICE.shape, 6, 3, 3)), partitions=Partitions(start, planes))
    where, pixels = layout(baked.resolution, 3), atlas(baked)
    assert pixels.shape[1::-1] == where.size
    walls = np.stack([texels(pixels, where, len(PLANES) + number).reshape(-1, 3) for number in range(4)], axis=1)
    size = np.linalg.norm(walls[:, :3], axis=2)
    for vertex, own in enumerate(count):
        assert texels(pixels, where, LIT).reshape(-1, 3)[vertex, 2] == (own > 0)
        for number in range(3):
            if own == 0:
                assert (size[vertex, number], walls[vertex, 3, number]) == (0.0, -1.0)
                continue
            n, d, s = np.split(planes[start[vertex] + min(number, own - 1)].astype(np.float64), [3, 4])
            # Products of single precision.
            length = size[vertex, number]
            np.testing.assert_allclose(walls[vertex, number] / length, n, atol=1e-6)
            np.testing.assert_allclose(walls[vertex, 3, number] / length, d, atol=1e-5)
            np.testing.assert_allclose(length - 1.0, s, atol=1e-6)


def test_the_border_repeats_the_edge() -> None:
    """What bilinear filtering, or a B-spline's outer weights, reach beyond a plane is its own edge."""
    baked = random_grid()
    where, pixels = layout(baked.resolution), atlas(baked)
    width, height = where.tile
    for k in range(LATTICE.shape[2]):
        for plane in range(len(PLANES)):
            column, row = where.texel(np.array(-BORDER), np.array(-BORDER), np.array(k), plane)
            tile = pixels[int(row) : int(row) + height, int(column) : int(column) + width]
            np.testing.assert_array_equal(tile, np.pad(tile[1:-1, 1:-1], ((1, 1), (1, 1), (0, 0)), mode="edge"))


@pytest.mark.parametrize(
    ("resolution", "walls"),
    [((1, 1, 1), 0), ((5, 4, 7), 3), ((20, 22, 20), 1), ((128, 128, 128), 0), ((1023, 1, 1023), 0)],
)
def test_no_two_numbers_share_a_texel(resolution: tuple[int, int, int], walls: int) -> None:
    where = layout(resolution, walls)
    width, height = where.size
    assert max(width, height) <= LARGEST_SIDE
    i, j, k = (axis.reshape(-1) for axis in np.indices(tuple(n + 1 for n in resolution)))
    seen = np.zeros((height, width), dtype=bool)
    for plane in range(where.planes):
        column, row = where.texel(i, j, k, plane)
        assert not seen[row, column].any()
        seen[row, column] = True
    assert seen.sum() == where.planes * len(i)


def test_what_no_graphics_card_takes_is_refused() -> None:
    with pytest.raises(SettingsError, match=r"1024 × 1024 × 1024 voxels does not fit into an image of 16,384"):
        layout((1024, 1024, 1024))
