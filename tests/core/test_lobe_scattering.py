# SPDX-License-Identifier: GPL-3.0-or-later
"""A photon meets a surface with lobes: which it follows, what it carries on, which side of the surface decides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core.lobe_scattering import MOST_PASSAGES
from ivg_addon.core.scattering import ABSORBED, CUT, ESCAPED
from ivg_addon.core.scene import GLASS, GLOSSY, REFRACTION, SCHLICK, TRANSLUCENT, TRANSPARENT, Scene, Texture
from ivg_addon.core.surface_bins import BACK, FRONT
from ivg_addon.core.tally import WEIGHT_LIMIT

from .lobe_scenes import Outcome, arriving, lobe, meet, plate, surface, uniform_field, with_lobes
from .rooms import scene
from .z_tests import assert_counts, assert_means

Float64 = NDArray[np.float64]

COSINE = 0.6
RHO, MIRRORED = np.array([0.3, 0.1, 0.0]), np.array([0.1, 0.3, 0.05])
PASSED, SPREAD = np.array([0.2, 0.0, 0.4]), np.array([0.05, 0.3, 0.2])


def mixed() -> Scene:
    """Return a surface with four ways on, which a photon's direction tells apart."""
    return surface(lobe(GLOSSY, MIRRORED), lobe(TRANSPARENT, PASSED), lobe(TRANSLUCENT, SPREAD), albedo=RHO)


def sorted_light(outcome: Outcome, n: int) -> Float64:
    """Return what went each of the four ways, per photon: mirrored, straight on, diffusely back, diffusely through."""
    arrival = arriving(COSINE, 1)[0]
    mirrored = outcome.directions @ (arrival * (1, 1, -1)) > 1 - 1e-7
    straight = outcome.directions @ arrival > 1 - 1e-7
    up = outcome.directions[:, 2] > 0
    ways = (mirrored, straight, up & ~mirrored, ~up & ~straight)
    return np.stack([outcome.weights[way].sum(axis=0) for way in ways]) / n


# --- One of several ---------------------------------------------------------------------------------------------------


def test_every_lobe_gets_its_share() -> None:
    n, weight = 1 << 12, np.array([0.5, 1.0, 0.8])
    outcomes = [meet(mixed(), arriving(COSINE, n), seed, weight) for seed in range(32)]
    assert_means([sorted_light(each, n) for each in outcomes], weight * [MIRRORED, PASSED, RHO, SPREAD])
    assert_means([each.energy[ABSORBED] for each in outcomes], weight * (1 - MIRRORED - PASSED - RHO - SPREAD))
    # Nothing else is in the books, and weights stay of order one.
    assert not any(each.energy[[ESCAPED, CUT]].any() for each in outcomes)
    assert max(each.weights.max() for each in outcomes) < 2.0


def test_only_what_passes_has_not_bounced() -> None:
    outcome = meet(mixed(), arriving(COSINE, 1000), flight=3, bounced=2)
    straight = outcome.directions @ arriving(COSINE, 1)[0] > 1 - 1e-7
    assert straight.any()
    np.testing.assert_array_equal(outcome.bounces, np.where(straight, 2, 3))


def test_translucency_is_a_cosine_on_the_other_side() -> None:
    outcome = meet(surface(lobe(TRANSLUCENT)), arriving(COSINE, 1 << 16))
    assert len(outcome.photons) == 1 << 16
    assert_counts(np.histogram(outcome.directions[:, 2], bins=-np.sqrt(np.linspace(1, 0, 17)))[0], 1 / 16)
    assert (outcome.origins[:, 2] < 0).all()


def test_the_same_photon_goes_the_same_way() -> None:
    """The numbers that it draws are its own, and the lobes of another material change nothing."""
    few = meet(mixed(), arriving(COSINE, 100))
    many = meet(mixed(), arriving(COSINE, 1000))
    order = np.argsort(many.photons)[: len(few.photons)]
    np.testing.assert_array_equal(np.sort(few.photons), many.photons[order])
    np.testing.assert_array_equal(few.directions[np.argsort(few.photons)], many.directions[order])


def test_textures_colour_and_roughen() -> None:
    texture = Texture("Half", np.full((1, 1, 3), (0.5, 0.25, 1.0), dtype=np.float32))
    of = replace(surface(lobe(TRANSPARENT, (0.8, 0.8, 0.4), color_texture=0)), textures=(texture,))
    n = 1 << 12
    made = [meet(of, arriving(COSINE, n), seed).weights.sum(axis=0) / n for seed in range(16)]
    assert_means(made, [0.4, 0.2, 0.4])
    rough = replace(surface(lobe(GLOSSY, roughness=0.8, roughness_texture=0)), textures=(texture,))
    np.testing.assert_array_equal(
        meet(rough, arriving(COSINE, 100)).directions,
        meet(surface(lobe(GLOSSY, roughness=0.4)), arriving(COSINE, 100)).directions,
    )


# --- Where it ends ----------------------------------------------------------------------------------------------------


def test_bounces_and_passages_have_limits_of_their_own() -> None:
    n = 1 << 12
    last = [meet(mixed(), arriving(COSINE, n), seed, flight=4, bounced=4, most=4) for seed in range(16)]
    assert_means([each.weights.sum(axis=0) / n for each in last], PASSED)
    assert_means([each.energy[CUT] for each in last], RHO + MIRRORED + SPREAD)
    passed = [meet(mixed(), arriving(COSINE, n), seed, flight=MOST_PASSAGES + 1, bounced=1) for seed in range(16)]
    assert_means([each.weights.sum(axis=0) / n for each in passed], RHO + MIRRORED + SPREAD)
    assert_means([each.energy[CUT] for each in passed], PASSED)
    one_more = meet(surface(lobe(TRANSPARENT)), arriving(COSINE, n), flight=MOST_PASSAGES, bounced=1)
    assert len(one_more.photons) == n


def test_in_the_dark_light_passes_and_does_nothing_else() -> None:
    n = 1 << 12
    made = [meet(mixed(), arriving(COSINE, n), seed, dark=0.5) for seed in range(16)]
    assert_means([each.weights.sum(axis=0) / n for each in made], PASSED)
    np.testing.assert_allclose([each.energy[ESCAPED] for each in made], np.tile(1 - PASSED, (16, 1)), atol=1e-6)
    assert not any(each.energy[[ABSORBED, CUT]].any() or each.counts.any() for each in made)


def test_what_diffuse_rays_do_not_see_only_lets_light_pass() -> None:
    n = 1 << 12
    of = with_lobes(scene([plate(visible=False)], ((0.5, 0.5, 0.5),)), lobe(GLOSSY, 0.2), lobe(TRANSPARENT, PASSED))
    made = [meet(of, arriving(COSINE, n), seed) for seed in range(16)]
    assert_means([each.weights.sum(axis=0) / n for each in made], PASSED)
    np.testing.assert_allclose([each.energy[ABSORBED] for each in made], np.tile(1 - PASSED, (16, 1)), atol=1e-6)


@pytest.mark.parametrize("kind", [GLASS, REFRACTION, TRANSLUCENT, TRANSPARENT, GLOSSY])
def test_light_that_gets_through_is_counted_on_both_sides(kind: int) -> None:
    outcome = meet(surface(lobe(kind, 0.0 if kind == GLASS else 1.0)), arriving(COSINE, 1000))
    assert outcome.counts[FRONT] == 1.0
    through = (outcome.directions[:, 2] < 0).sum() / 1000
    assert outcome.counts[BACK] == through
    assert (through > 0.9) == (kind != GLOSSY)


# --- Sides ------------------------------------------------------------------------------------------------------------


def sides(arrival: float, n: int = 1 << 12) -> tuple[Float64, Float64]:
    """Return what surfaces reflect and let through, (batches, 3): the front white and closed, the back clear glass."""
    of = with_lobes(
        scene([plate()], ((0.5, 0.5, 0.5), (0, 0, 0))), lobe(TRANSPARENT, (0.9, 0.6, 0.3), material=1), back=[1, 1]
    )
    back, through = [], []
    for seed in range(16):
        outcome = meet(of, arriving(arrival, n), seed)
        up = outcome.directions[:, 2] * arrival > 0
        back.append(outcome.weights[up].sum(axis=0) / n)
        through.append(outcome.weights[~up].sum(axis=0) / n)
    return np.stack(back), np.stack(through)


def test_who_is_lit_through_a_surface_sees_the_side_that_light_leaves_by() -> None:
    """Cycles asks the shader of the side that the lit point sees."""
    back, through = sides(COSINE)
    assert_means(back, 0.5)
    assert_means(through, [0.9, 0.6, 0.3])
    back, through = sides(-COSINE)
    assert not back.any()
    assert not through.any()


def test_the_two_sides_may_reflect_differently() -> None:
    n = 1 << 12
    of = with_lobes(scene([plate()], ((0.2, 0.2, 0.2), (0.7, 0.7, 0.7))), lobe(GLOSSY, 0.1), back=[1, 1])
    for arrival, truth in ((COSINE, 0.3), (-COSINE, 0.7)):
        made = [meet(of, arriving(arrival, n), seed).weights.sum(axis=0) / n for seed in range(16)]
        assert_means(made, truth)


# --- Shading normals --------------------------------------------------------------------------------------------------

TILT = (np.sin(0.3), 0.0, np.cos(0.3))


def test_a_mirror_reflects_around_the_shading_normal_and_never_into_the_surface() -> None:
    arrival = uniform_field(1 << 14, 1)
    outcome = meet(surface(lobe(GLOSSY), shading=TILT), arrival)
    came = arrival[outcome.photons]
    mirrored = came - 2 * (came @ TILT)[:, None] * TILT
    np.testing.assert_allclose(outcome.directions, mirrored, atol=1e-5)
    assert (outcome.directions[:, 2] > 0).all()
    assert outcome.weights.max() <= WEIGHT_LIMIT * (1 + 1e-6)


@pytest.mark.parametrize("roughness", [0.0, 0.7])
def test_a_mirror_sends_out_what_it_is_seen_to_send(roughness: float) -> None:
    """In a uniform field seen from o: L ∫ f(o, i) |i·s| over those i that are above the surface, times |o·g| do.

    By rays from views that are uniform in cos² θ_g, as Cycles would follow them.
    """
    n, made = 1 << 13, []
    for seed in range(32):
        photons = meet(surface(lobe(GLOSSY, roughness=roughness), shading=TILT), uniform_field(n, seed), seed)
        light = np.histogram(photons.directions[:, 2] ** 2, bins=4, range=(0, 1), weights=photons.weights[:, 0])[0]
        # The view's path: a surface whose geometric normal is the shading normal, in a turned frame.
        views = uniform_field(n, 100 + seed)
        x, z = np.array([TILT[2], 0, -TILT[0]]), np.array(TILT)
        local = np.stack([views @ x, views[:, 1], views @ z], axis=1)
        seen = local[:, 2] < 0
        path = meet(surface(lobe(GLOSSY, roughness=roughness)), local[seen], 200 + seed)
        turned = path.directions @ np.stack([x, [0, 1, 0], z])
        cosine = -views[seen][path.photons, 2]
        above = turned[:, 2] > 0
        radiance = np.histogram(cosine[above] ** 2, bins=4, range=(0, 1), weights=path.weights[above, 0])[0]
        made.append((light - radiance) / n)
    # The limit of weights costs light in the first share alone, where views are within 30° of the surface.
    assert_means(np.stack(made)[:, 1:], 0.0)


def test_lobes_behind_the_shading_normal_see_no_light() -> None:
    tilted = (np.sin(1.2), 0.0, np.cos(1.2))
    arrival = np.tile([0.9, 0.0, -np.sqrt(1 - 0.81)], (100, 1))
    lobes = [lobe(kind, roughness=0.5) for kind in (GLOSSY, GLASS, REFRACTION, TRANSLUCENT)]
    outcome = meet(surface(*lobes, albedo=(1, 1, 1), shading=tilted), arrival)
    assert len(outcome.photons) == 0
    np.testing.assert_allclose(outcome.energy[ABSORBED], 1.0, atol=1e-6)


def test_schlick_is_sampled_where_its_colour_is_black() -> None:
    n = 1 << 12
    made = [
        meet(surface(lobe(GLOSSY, 0.0, 1.0, fresnel=SCHLICK)), arriving(0.2, n), k).weights.sum() / n for k in range(16)
    ]
    assert_means(made, 3 * 0.8**5)
