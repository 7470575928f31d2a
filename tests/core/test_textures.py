# SPDX-License-Identifier: GPL-3.0-or-later
"""Texture look-up against a plain reading of its definition."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ivg_addon.core.compiled import kernel
from ivg_addon.core.scene import NO_TEXTURE, Texture
from ivg_addon.core.textures import decode_srgb, pack_textures, sample_texture, surface_albedo

EXTENSIONS = ("REPEAT", "EXTEND", "CLIP", "MIRROR")


@kernel
def sample_many(pool, texture, uv):
    out = np.empty((len(uv), 3))
    for i in range(len(uv)):
        out[i, 0], out[i, 1], out[i, 2] = sample_texture(pool, texture, uv[i, 0], uv[i, 1])
    return out


@kernel
def albedo_many(materials, uv, albedo, texture, pool):
    out = np.empty((len(uv), 3))
    for i in range(len(uv)):
        out[i, 0], out[i, 1], out[i, 2] = surface_albedo(materials[i], uv[i, 0], uv[i, 1], albedo, texture, pool)
    return out


def texel(texture: Texture, column: int, row: int) -> np.ndarray:
    """Look up a texel by walking over copies of the image, one texel at a time."""
    height, width = texture.pixels.shape[:2]
    if texture.extension == "CLIP" and not (0 <= column < width and 0 <= row < height):
        return np.zeros(3)
    index = []
    for position, count in ((row, height), (column, width)):
        if texture.extension == "EXTEND":
            position = sorted((0, position, count - 1))[1]
        elif texture.extension == "REPEAT":
            position -= count * math.floor(position / count)
        elif texture.extension == "MIRROR":
            copy = math.floor(position / count)
            position -= count * copy
            position = position if copy % 2 == 0 else count - 1 - position
        index.append(position)
    return texture.pixels[index[0], index[1]].astype(float)


def expected(texture: Texture, u: float, v: float) -> np.ndarray:
    height, width = texture.pixels.shape[:2]
    x, y = u * width, v * height
    if not texture.interpolate:
        colour = texel(texture, math.floor(x), math.floor(y))
    else:
        colour = np.zeros(3)
        for column in range(math.floor(x - 0.5), math.floor(x - 0.5) + 2):
            for row in range(math.floor(y - 0.5), math.floor(y - 0.5) + 2):
                near = max(0.0, 1 - abs(x - 0.5 - column)) * max(0.0, 1 - abs(y - 0.5 - row))
                colour = colour + near * texel(texture, column, row)
    if texture.encoded:
        colour = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    return colour


@given(
    seed=st.integers(0, 1 << 16),
    size=st.tuples(st.integers(1, 5), st.integers(1, 5)),
    extension=st.sampled_from(EXTENSIONS),
    interpolate=st.booleans(),
    encoded=st.booleans(),
    uv=st.lists(st.tuples(*[st.floats(-4, 4, width=32)] * 2), min_size=1, max_size=20),
)
@settings(max_examples=150, deadline=None)
def test_look_up_is_what_its_definition_says(
    seed: int,
    size: tuple[int, int],
    extension: str,
    interpolate: bool,
    encoded: bool,
    uv: list[tuple[float, float]],
) -> None:
    rng = np.random.default_rng(seed)
    other = Texture("other", rng.random((2, 3, 3), dtype=np.float32))
    texture = Texture("t", rng.random((*size, 3), dtype=np.float32), interpolate, extension, encoded)
    pool = pack_textures([other, texture, other])
    got = sample_many(pool, 1, np.array(uv))
    want = np.array([expected(texture, u, v) for u, v in uv])
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-12)


def test_texel_centres_are_half_way() -> None:
    pixels = np.arange(6, dtype=np.float32).reshape(2, 1, 3)
    pool = pack_textures([Texture("t", pixels, extension="EXTEND")])
    np.testing.assert_array_equal(sample_many(pool, 0, np.array([[0.5, 0.25], [0.5, 0.75]])), pixels[:, 0])


@pytest.mark.parametrize("extension", EXTENSIONS)
@pytest.mark.parametrize("interpolate", [False, True])
def test_no_coordinate_reads_outside(extension: str, interpolate: bool) -> None:
    pixels = np.full((3, 4, 3), 0.5, dtype=np.float32)
    pool = pack_textures([Texture("t", pixels, interpolate, extension)])
    wild = [math.nan, math.inf, -math.inf, 1e300, -1e300, 1e9, -1e9, 3e38, 0.0, 1.0]
    uv = np.array([(u, v) for u in wild for v in wild])
    got = sample_many(pool, 0, uv)
    assert np.isfinite(got).all()
    assert got.min() >= 0.0
    assert got.max() <= 0.5


def test_srgb_decoding_at_known_values() -> None:
    assert decode_srgb(0.0) == 0.0
    assert decode_srgb(1.0) == pytest.approx(1.0, abs=1e-15)
    assert decode_srgb(0.5) == pytest.approx(0.21404114048223255, abs=1e-15)
    assert decode_srgb(0.04045) == pytest.approx(0.0031308049535603713, abs=1e-15)


def test_albedo_is_the_constant_times_the_texture_and_at_most_one() -> None:
    texture = Texture("t", np.array([[[0.5, 2.0, 8.0]]], dtype=np.float32))
    albedo = np.array([[0.1, 0.2, 0.3], [0.5, 0.25, 0.5]], dtype=np.float32)
    got = albedo_many(
        np.array([0, 1]),
        np.zeros((2, 2)),
        albedo,
        np.array([NO_TEXTURE, 0], dtype=np.int32),
        pack_textures([texture]),
    )
    np.testing.assert_allclose(got, [albedo[0], [0.25, 0.5, 1.0]], rtol=1e-6)


def test_no_textures_at_all() -> None:
    albedo = np.full((1, 3), 0.7, dtype=np.float32)
    got = albedo_many(
        np.zeros(1, dtype=np.int64), np.zeros((1, 2)), albedo, np.array([NO_TEXTURE], dtype=np.int32), pack_textures([])
    )
    np.testing.assert_array_equal(got, albedo)
