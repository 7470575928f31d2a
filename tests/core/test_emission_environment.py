# SPDX-License-Identifier: GPL-3.0-or-later
"""Environment maps: what enters the box around the scene from every direction."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ivg_addon.core.emission import prepare_emission
from ivg_addon.core.emission.environment import map_powers
from ivg_addon.core.environment import EnvironmentMap, bright_spots, cleaned, without_spots
from ivg_addon.core.errors import SceneError
from ivg_addon.core.lights import Lights

from .emission_checks import array, assert_distribution, assert_flux, assert_total, mesh, photons, scene, through

LOW, HIGH = (-1.0, -0.5, 0.0), (1.0, 0.5, 0.4)
CENTER, HALF = (0.0, 0.0, 0.2), (0.9, 0.45, 0.18)
AREAS = [4 * HALF[1] * HALF[2], 4 * HALF[2] * HALF[0], 4 * HALF[0] * HALF[1]]
AXES = [(axis, sign) for axis in range(3) for sign in (1.0, -1.0)]
COLOR = np.array([0.2, 0.5, 1.0])


def sides(axis: int) -> tuple[float, float]:
    return HALF[(axis + 1) % 3], HALF[(axis + 2) % 3]


def constant(h: int, w: int) -> EnvironmentMap:
    return EnvironmentMap(np.broadcast_to(COLOR, (h, w, 3)).astype(np.float32))


def uneven(h: int = 8, w: int = 12, seed: int = 3) -> EnvironmentMap:
    """Return a map whose texels differ by a factor of a thousand, a few of them black."""
    rng = np.random.default_rng(seed)
    strength = 10.0 ** rng.uniform(-3, 0, (h, w, 1)) * (rng.random((h, w, 1)) > 0.1)
    return EnvironmentMap((strength * rng.uniform(0.1, 1.0, (h, w, 3))).astype(np.float32))


def lit(*maps: EnvironmentMap) -> Lights:
    return Lights(world=array(0, 0, 0), environment=maps)


def directions(one: EnvironmentMap, fine: int) -> tuple[np.ndarray, np.ndarray]:
    """Return directions that light comes from, (h, fine, w, fine, 3), and the solid angle of each, sr."""
    h, w = one.radiance.shape[:2]
    rows, columns = one.row_edges, one.column_edges
    inside = (np.arange(fine) + 0.5) / fine
    b = rows[:-1, None] + np.diff(rows)[:, None] * inside
    l = columns[:-1, None] + np.diff(columns)[:, None] * inside  # noqa: E741 (longitude)
    b, l = b[:, :, None, None], l[None, None]  # noqa: E741
    step = np.diff(rows)[0] * np.diff(columns)[0] / fine**2
    omega = np.broadcast_to(step * np.cos(b), (h, fine, w, fine))
    return np.stack(np.broadcast_arrays(np.cos(b) * np.cos(l), -np.cos(b) * np.sin(l), np.sin(b)), axis=-1), omega


def irradiance(one: EnvironmentMap, axis: int, sign: float) -> np.ndarray:
    """Return what light that flies in direction `sign` along an axis brings, (3,) W/m², by quadrature."""
    d, omega = directions(one, 32)
    facing = np.maximum(-sign * d[..., axis], 0.0) * omega
    return np.einsum("hawb,hwc->c", facing, one.radiance.astype(np.float64))


@pytest.mark.parametrize("shape", [(1, 1), (3, 5), (64, 128)])
def test_map_of_one_colour_is_a_world_of_that_colour(shape: tuple[int, int]) -> None:
    one = constant(*shape)
    light = photons(scene(lit(one)), LOW, HIGH)
    box = light.emission.emitters.box
    np.testing.assert_allclose(light.emission.power, math.pi * COLOR * 2 * box.areas.sum(), rtol=1e-6)
    assert_total(light)
    for axis, sign in AXES:
        assert_flux(light, through(light, CENTER, axis, sides(axis), sign), math.pi * COLOR * AREAS[axis])


def test_map_lights_every_side_with_what_faces_it() -> None:
    one = uneven()
    light = photons(scene(lit(one)), LOW, HIGH)
    for axis, sign in AXES:
        hits = through(light, CENTER, axis, sides(axis), sign)
        assert_flux(light, hits, irradiance(one, axis, sign) * AREAS[axis])


@pytest.mark.parametrize("row, column, axis, sign", [(1, 2, 0, -1.0), (1, 3, 1, 1.0), (0, 1, 2, 1.0), (2, 1, 2, -1.0)])
def test_texels_lie_where_blenders_panoramas_have_them(row: int, column: int, axis: int, sign: float) -> None:
    """Of 3 rows, below, around and above, and 4 columns from −x over +y, +x, −y to −x again: light flies from there."""
    radiance = np.zeros((3, 4, 3), dtype=np.float32)
    radiance[row, column] = 1.0
    light = photons(scene(lit(EnvironmentMap(radiance))), n=4096)
    d = light.directions[light.flux[:, 0] > 0.0].mean(axis=0)
    if axis == 2:
        assert d[2] * sign > 0.6
    else:  # the middle of columns 2 and 3 lies half a right angle from the axes
        assert d[0] < 0 if column == 2 else d[0] > 0
        assert d[1] > 0


def test_directions_fill_texels_by_light_and_the_area_that_the_box_shows() -> None:
    one = uneven(6, 8)
    light = photons(scene(lit(one)), LOW, HIGH)
    flown = light.flux.max(axis=1) > 0.0
    d = -light.directions[flown]
    fine = 4  # bins in each texel: they show whether directions are uniform inside
    areas = light.emission.emitters.box.areas
    where, omega = directions(one, 64)
    shown = (np.abs(where) @ areas * omega).reshape(6, fine, 16, 8, fine, 16).sum(axis=(2, 5))
    probability = (shown * one.radiance.max(axis=-1)[:, None, :, None]).reshape(6 * fine, 8 * fine)
    b, l = np.arcsin(np.clip(d[:, 2], -1, 1)), np.arctan2(-d[:, 1], d[:, 0])  # noqa: E741
    counts = np.histogram2d(
        b, l, [np.linspace(-math.pi / 2, math.pi / 2, 6 * fine + 1), np.linspace(-math.pi, math.pi, 8 * fine + 1)]
    )[0]
    probability /= probability.sum()
    enough = probability > 20 / flown.sum()
    assert counts[probability == 0].sum() == 0
    assert_distribution(
        np.r_[counts[enough], counts[~enough].sum()],
        np.r_[probability[enough], probability[~enough].sum()],
    )


def test_small_map_is_a_sun() -> None:
    """A disc of half a degree in a map of its own: flux along its direction, L Ω, through what faces it."""
    center, half = np.radians([100.0, 30.0]), math.radians(0.3)
    size = 48
    edges = np.linspace(-half, half, size + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    disc = np.hypot(middle[:, None], middle[None, :] * math.cos(center[1])) < math.radians(0.25)
    patch = EnvironmentMap(
        (disc[:, :, None] * 1e6 * COLOR).astype(np.float32),
        longitude=(center[0] - half, center[0] + half),
        latitude=(center[1] - half, center[1] + half),
    )
    light = photons(scene(lit(constant(2, 4), patch)), LOW, HIGH)
    sun = 1e6 * COLOR * float((disc.sum(axis=1) * patch.solid_angles()).sum())
    d = np.array(
        [math.cos(center[1]) * math.cos(center[0]), -math.cos(center[1]) * math.sin(center[0]), math.sin(center[1])]
    )
    for axis, sign in AXES:
        from_sun = max(0.0, -sign * d[axis]) * sun
        hits = through(light, CENTER, axis, sides(axis), sign)
        # The disc's own spread in the cosine is within 1e-4 of its middle's.
        assert_flux(light, hits, (from_sun + math.pi * COLOR) * AREAS[axis])
    flown = light.flux[:, 0] > 0
    in_disc = light.directions[flown] @ -d > math.cos(math.radians(0.26))
    sky, of_sun = map_powers((constant(2, 4), patch), light.emission.emitters.box)[:, 0]
    share = of_sun / (sky + of_sun)
    assert abs(in_disc.mean() - share) < 5 * math.sqrt(share * (1 - share) / flown.sum())


def test_power_is_the_integral_over_texels() -> None:
    one = uneven(5, 7)
    box = photons(scene(lit(one)), LOW, HIGH, n=8).emission.emitters.box
    where, omega = directions(one, 64)
    truth = np.einsum("hawb,hwc->c", np.abs(where) @ box.areas * omega, one.radiance.astype(np.float64))
    np.testing.assert_allclose(map_powers((one,), box)[0], truth, rtol=1e-4)


def test_weights_are_at_most_one() -> None:
    """Those that miss the box have none; all others fill their largest channel."""
    light = photons(scene(lit(constant(1, 1), constant(3, 5))), LOW, HIGH)
    largest = (light.flux * len(light.flux) / light.emission.flux_scale).max(axis=1)
    np.testing.assert_allclose(largest[largest > 0.0], 1.0, rtol=1e-6)
    share = light.emission.power.max() / light.emission.flux_scale
    assert abs((largest > 0.0).mean() - share) < 5 * math.sqrt(share * (1 - share) / len(largest))


def test_black_map_emits_nothing() -> None:
    black = EnvironmentMap(np.zeros((4, 8, 3), dtype=np.float32))
    assert not lit(black).world_shines
    assert lit(black, constant(1, 1)).world_shines
    with pytest.raises(SceneError, match="has no light"):
        prepare_emission(scene(lit(black)), array(*LOW), array(*HIGH))
    square = mesh([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [(0, 1, 2), (0, 2, 3)], [0, 0])
    light = photons(scene(lit(black), square, [(1, 1, 1)]), n=1 << 14)
    assert (np.abs(light.origins[:, 2]) < 1e-5).all()


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0])
def test_values_that_are_no_light_are_cleaned_or_refused(value: float) -> None:
    radiance = np.ones((2, 4, 3), dtype=np.float32)
    radiance[1, 2, 0] = value
    result = cleaned(radiance)
    assert (result.not_numbers, result.negative) == ((0, 1) if value == -1.0 else (1, 0))
    np.testing.assert_array_equal(result.radiance[1, 2], [0, 1, 1] if value == -1.0 else [0, 0, 0])
    np.testing.assert_array_equal(np.delete(result.radiance.reshape(-1, 3), 6, axis=0), 1.0)
    with pytest.raises(SceneError, match="the world has"):
        photons(scene(lit(EnvironmentMap(radiance))), n=8)


def test_bright_spots_are_found_and_taken_out() -> None:
    radiance = np.ones((64, 128, 3), dtype=np.float32)
    radiance[40:42, 10:12] = 1e4
    radiance[20, 127] = 1e5
    radiance[50:60, 60:90] = 5.0  # bright, but resolved
    whole = EnvironmentMap(radiance)
    spots = bright_spots(whole)
    assert {(spot.rows, spot.columns) for spot in spots} == {((38, 44), (8, 14)), ((18, 23), (125, 128))}
    left = without_spots(whole, spots).radiance
    assert left.max() == 5.0
    assert (left == 0.0).all(axis=-1).sum() == 6 * 6 + 5 * 3
    assert bright_spots(constant(16, 32)) == []
    assert bright_spots(EnvironmentMap(np.zeros((4, 8, 3), np.float32))) == []
