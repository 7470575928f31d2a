# SPDX-License-Identifier: GPL-3.0-or-later
"""The atlas: every triangle finds its own texels, wherever it is hit."""

from __future__ import annotations

import numpy as np
import pytest

from ivg_addon.core.atlas import LARGEST_BLOCK, WIDTH, Atlas, lay_out
from ivg_addon.core.scene import Texture
from ivg_addon.core.textures import pack_textures
from tests.core.test_textures import sample_many

SIZES = np.random.default_rng(4).choice([1, 1, 1, 2, 3, 5, 8, 40], size=2000)


def owners_image(atlas: Atlas) -> np.ndarray:
    """Return an image in which each triangle's texels hold its number."""
    texels, owners = atlas.texels()
    return atlas.image(texels, np.repeat(owners[:, None].astype(np.float64), 3, axis=1))


def test_texels_belong_to_one_triangle_each() -> None:
    atlas = lay_out(SIZES)
    texels, owners = atlas.texels()
    assert len(np.unique(texels)) == len(texels)
    assert texels.max() < atlas.width * atlas.height
    np.testing.assert_array_equal(np.bincount(owners), SIZES * (SIZES + 1) // 2)


def test_little_is_wasted() -> None:
    atlas = lay_out(SIZES)
    assert atlas.width * atlas.height < 1.3 * (SIZES.astype(np.int64) ** 2).sum()


@pytest.mark.parametrize("where", ["inside", "edges"])
def test_look_ups_find_the_triangle(where: str) -> None:
    """Points on the edges are the hard ones: single precision takes them across."""
    atlas = lay_out(SIZES)
    rng = np.random.default_rng(5)
    weights = rng.dirichlet((1, 1, 1), size=(50, len(SIZES)))
    if where == "edges":
        weights[np.arange(50)[:, None], np.arange(len(SIZES)), rng.integers(0, 3, (50, len(SIZES)))] = 0.0
        weights /= weights.sum(axis=2, keepdims=True)
    corners = atlas.looked_up()
    uv = np.einsum("knc,ncx->knx", weights.astype(np.float32), corners).astype(np.float32)
    pool = pack_textures([Texture("Owners", owners_image(atlas), interpolate=False, extension="EXTEND")])
    found = sample_many(pool, 0, uv.reshape(-1, 2))[:, 0].reshape(50, -1)
    np.testing.assert_array_equal(found, np.broadcast_to(np.arange(len(SIZES)), found.shape))


def test_drawn_triangles_cover_the_centres_of_their_texels_and_of_no_others() -> None:
    atlas = lay_out(SIZES)
    corners = atlas.drawn().astype(np.float64) * (atlas.width, atlas.height)
    texels, owners = atlas.texels()
    row, column = np.divmod(texels, atlas.width)
    offset = np.stack([column + 0.5, row + 0.5], axis=1) - corners[owners, 0]
    leg = corners[owners, 1, 0] - corners[owners, 0, 0]
    assert (offset > 0.4).all()
    assert (offset.sum(axis=1) < leg + 0.005).all()
    beyond = SIZES + 1  # the sum of the centres' offsets in the next row of texels
    assert (corners[:, 1, 0] - corners[:, 0, 0] < beyond - 0.4).all()


def test_sizes_are_bounded() -> None:
    atlas = lay_out(np.array([1, 10**6]))
    assert atlas.size.tolist() == [1, LARGEST_BLOCK]
    assert atlas.width <= WIDTH
    assert lay_out(np.ones(1, dtype=np.int32)).image(np.array([0]), np.ones((1, 3))).shape == (1, 1, 3)
