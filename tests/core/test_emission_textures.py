# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles that emit by a texture, or otherwise to the front than to the back."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ivg_addon.core.emission.pieces import MOST_PIECES, place_in_triangle
from ivg_addon.core.emission.triangles import TriangleEmitters
from ivg_addon.core.errors import SceneError
from ivg_addon.core.scene import NO_TEXTURE, Scene, Texture
from ivg_addon.core.textures import pack_textures, sample_texture

from .emission_checks import PHOTONS, Photons, mesh, photons, scene
from .z_tests import assert_counts, assert_means

BATCHES = 16
CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
UVS = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=np.float32)
QUADS = np.array([(0, 1, 2), (0, 2, 3)])
EMISSION = np.array((2.0, 1.0, 0.5))


def screen(pixels: np.ndarray, emission: object = EMISSION, back: object = None, **texture: object) -> Scene:
    """Return a unit square at z = 0 that shows an image; its back emits the constant `back`, or the same."""
    square = dataclasses.replace(mesh(CORNERS, QUADS, [0, 0]), uvs=UVS[QUADS])
    plain = scene(geometry=square, emission=[emission, emission if back is None else back])
    materials = dataclasses.replace(
        plain.materials,
        emission_texture=np.array([0, NO_TEXTURE], dtype=np.int32),
        back=np.array([0 if back is None else 1, 1], dtype=np.int32),
    )
    image = Texture("Screen", np.asarray(pixels, dtype=np.float32), **texture)
    return dataclasses.replace(plain, materials=materials, textures=(image,))


def flux_per_cell(light: Photons, columns: int, rows: int) -> np.ndarray:
    """Return the watts that leave each cell of the unit square, (batches, rows, columns, 3)."""
    x, y = (np.clip((light.origins[:, i] * n).astype(int), 0, n - 1) for i, n in ((0, columns), (1, rows)))
    batch = np.arange(len(x)) * BATCHES // len(x)
    flux = np.zeros((BATCHES, rows, columns, 3))
    np.add.at(flux, (batch, y, x), BATCHES * light.flux)
    return flux


def noise(width: int, height: int, decades: float) -> np.ndarray:
    return 10.0 ** np.random.default_rng(5).uniform(-decades, 0.0, (height, width, 3))


@pytest.mark.parametrize("decades", [1.0, 8.0])
def test_each_texel_emits_its_own_radiance(decades: float) -> None:
    pixels = noise(6, 5, decades)
    light = photons(screen(pixels, interpolate=False))
    truth = 2 * np.pi * pixels * EMISSION / 30
    # Texels too dim for photons would be no test of the normal distribution.
    bright = pixels.max(axis=2) > 0.01
    assert_means(flux_per_cell(light, 6, 5)[:, bright], truth[bright])
    assert (light.flux <= light.emission.flux_scale / PHOTONS * (1 + 1e-6)).all()


def test_a_dim_texel_beside_a_bright_one_emits_what_it_should() -> None:
    """Eight orders of magnitude: pieces that both texels share have the bright one's bound, yet follow the texture."""
    pixels = np.ones((1, 2, 3)) * [[[1e-8], [1.0]]]
    light = photons(screen(pixels, interpolate=False))
    assert_means(flux_per_cell(light, 2, 1), np.pi * pixels * EMISSION)


@pytest.mark.parametrize("encoded", [False, True])
def test_interpolated_texture_emits_what_is_looked_up(encoded: bool) -> None:
    of = screen(noise(5, 4, 1.0), encoded=encoded, extension="EXTEND")
    pool = pack_textures(of.textures)
    middle = (np.arange(600) + 0.5) / 600
    looked_up = np.array([[sample_texture(pool, 0, u, v) for u in middle] for v in middle])
    truth = 2 * np.pi * EMISSION * looked_up.reshape(10, 60, 10, 60, 3).mean(axis=(1, 3)) / 100
    assert_means(flux_per_cell(photons(of), 10, 10), truth)


def test_power_is_that_of_the_texels() -> None:
    pixels = noise(32, 16, 2.0)
    emission = photons(screen(pixels, interpolate=False), n=1).emission
    # By one look-up per piece: pieces that two texels share make it an estimate.
    np.testing.assert_allclose(emission.power, 2 * np.pi * pixels.mean(axis=(0, 1)) * EMISSION, rtol=0.1)


def test_sides_emit_each_its_own_radiance() -> None:
    pixels = noise(4, 4, 1.0)
    light = photons(screen(pixels, back=(0.25, 0.5, 0.125), interpolate=False))
    up = light.directions[:, 2] > 0.0
    np.testing.assert_array_equal(light.origins[:, 2] > 0.0, up)
    for side, truth in ((up, pixels * EMISSION), (~up, np.broadcast_to((0.25, 0.5, 0.125), (4, 4, 3)))):
        of_side = dataclasses.replace(light, flux=light.flux * side[:, None])
        assert_means(flux_per_cell(of_side, 4, 4), np.pi * truth / 16)


@pytest.mark.parametrize("front", [True, False])
def test_one_side_may_be_dark(front: bool) -> None:
    materials = [EMISSION, (0, 0, 0)]
    plain = scene(geometry=mesh(CORNERS, QUADS, [0, 0] if front else [1, 1]), emission=materials)
    one = dataclasses.replace(plain.materials, back=np.array([1, 0], dtype=np.int32))
    light = photons(dataclasses.replace(plain, materials=one), n=1 << 14)
    assert (light.directions[:, 2] * (1 if front else -1) > 0.0).all()
    np.testing.assert_allclose(light.emission.power, np.pi * np.array(EMISSION), rtol=1e-6)
    np.testing.assert_allclose(light.flux.sum(axis=0), np.pi * np.array(EMISSION), rtol=1e-5)


def test_pieces_tile_their_triangle() -> None:
    """Points uniform in pieces, pieces uniform in the triangle: points uniform in the triangle."""
    rng = np.random.default_rng(8)
    for divisions in (1, 2, 8):
        counts = np.zeros((12, 12))
        for _ in range(20_000):
            root, split = np.sqrt(rng.random()), rng.random()
            index = int(rng.integers(divisions**2))
            t, u, v = place_in_triangle(divisions, index, root * (1 - split), root * split)
            assert min(t, u, v) >= -1e-12
            assert abs(t + u + v - 1) < 1e-12
            # Of the triangle the share with 1 − t below r is r²; v/(1 − t) is uniform.
            counts[int(12 * min((1 - t) ** 2, 0.999999)), int(12 * min(v / (1 - t), 0.999999))] += 1
        assert_counts(counts, 1 / 144)


@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND", "CLIP", "MIRROR"])
@pytest.mark.parametrize("interpolate", [False, True])
@pytest.mark.parametrize("scale", [0.3, 5.0, 1e12])
def test_no_look_up_exceeds_its_bound(extension: str, interpolate: bool, scale: float) -> None:
    """Wherever the coordinates lie: the weights of photons are at most one before they are limited to it."""
    rng = np.random.default_rng(4)
    of = screen(noise(13, 7, 2.0), extension=extension, interpolate=interpolate, encoded=interpolate)
    uvs = (scale * rng.normal(size=(2, 3, 2))).astype(np.float32)
    of = dataclasses.replace(of, geometry=dataclasses.replace(of.geometry, uvs=uvs))
    emitters = TriangleEmitters.of(of)
    pieces, pool = emitters.pieces, pack_textures(of.textures)
    tested = 0
    for piece in rng.integers(len(pieces.triangle), size=2000):
        corner = np.eye(3)[rng.integers(3)] if rng.random() < 0.3 else rng.dirichlet((1, 1, 1))
        place = place_in_triangle(pieces.divisions[piece], pieces.part[piece], *corner[1:])
        u, v = np.array(place) @ uvs[pieces.triangle[piece]].astype(np.float64)
        radiance = np.array(sample_texture(pool, 0, u, v)) * EMISSION
        assert radiance.max() <= pieces.bound[piece] * (1 + 1e-6)
        tested += radiance.max() > 0.5 * pieces.bound[piece]
    # Bounds that are far too large would waste photons.
    assert tested > 100 or scale > 100


def test_a_large_screen_is_cut_about_texel_by_texel() -> None:
    light = photons(screen(noise(1024, 1024, 0.3), interpolate=False), n=1 << 16)
    pieces = TriangleEmitters.of(screen(noise(1024, 1024, 0.3), interpolate=False)).pieces
    assert len(pieces.triangle) == 2 * 4**10 <= MOST_PIECES
    brightest = light.flux.max(axis=1) / (light.emission.flux_scale / len(light.flux))
    assert brightest.mean() > 0.6


def test_dark_texels_take_no_place() -> None:
    pixels = np.zeros((64, 64, 3))
    pixels[10, 20] = 1.0
    assert len(TriangleEmitters.of(screen(pixels, interpolate=False)).pieces.triangle) < 50


@pytest.mark.parametrize("value", [np.nan, np.inf, -1.0])
def test_emission_that_is_no_number_names_the_material(value: float) -> None:
    with pytest.raises(SceneError, match="material 'Material 0' emits"):
        photons(screen(np.ones((1, 1, 3)), emission=(value, 1.0, 1.0)))
    with pytest.raises(SceneError, match="material 'Material 0' emits by the texture 'Screen'"):
        photons(screen(np.full((1, 1, 3), value)))
