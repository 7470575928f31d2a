# SPDX-License-Identifier: GPL-3.0-or-later
"""Walks through scenes of glass, mirrors and panes: what is direct light, where it ends, what counts as lit."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core import photon_walk
from ivg_addon.core.bake import bake, prepare_course
from ivg_addon.core.bumps import MIRRORED, OWN
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.lights import Lights, PointLights
from ivg_addon.core.lobe_scattering import MOST_PASSAGES
from ivg_addon.core.photon_walk import Walk, walk_steps
from ivg_addon.core.progress import finish
from ivg_addon.core.scene import GLASS, GLOSSY, TRANSLUCENT, TRANSPARENT, Lobes, Scene
from ivg_addon.core.settings import BakeSettings

from .grids import AXES
from .lobe_scenes import lobe, with_lobes
from .rooms import Part, ball, beam, box, lamp, quad, rotation, scene
from .z_tests import assert_means

Float64 = NDArray[np.float64]

SETTINGS = BakeSettings((0, 0, 0), (2, 2, 2), (4, 4, 4), photons=20_000, bounces=4, seed=3)
BLACK = (0.0, 0.0, 0.0)
DOWN = beam((1, 1, 1.9), (0, 0.5, 0), (0.5, 0, 0))


def walk(of: Scene, settings: BakeSettings = SETTINGS) -> Walk:
    lattice = Lattice(settings.bounds_min, settings.bounds_max, settings.resolution)
    return finish(walk_steps(prepare_course(of, lattice, settings.photons), lattice, settings))


def pane(height: float, material: int = 1, visible: bool = True) -> Part:
    return quad((0, 0, height), (2, 0, 0), (0, 2, 0), material, visible)


def lit_from_above(*parts: Part, lobes: tuple[Lobes, ...], floor: Any = BLACK) -> Scene:
    """Return a beam down onto parts and a floor; materials 1, 2 and 3 are nothing but their lobes."""
    ground = quad((0, 0, 0), (2, 0, 0), (0, 2, 0))
    return with_lobes(scene([ground, *parts], (floor, *[BLACK] * 3), lights=DOWN), *lobes)


def mixed_room() -> Scene:
    """Return a room with everything in it, bumps too, lit by a lamp in a box that lets light pass."""
    parts = [
        box((0, 0, 0), (2, 2, 2), inward=True),
        ball(0.3, rounds=2, material=1),
        box((1.2, 1.2, 0.2), (1.7, 1.8, 0.9), 2, turn=rotation((1, 2, 3), 0.2)),
        pane(1.2, 3),
        quad((0.2, 0.2, 1.0), (0.5, 0, 0), (0, 0.5, 0.3), 4),
    ]
    parts[1] = replace(parts[1], vertices=np.add(parts[1].vertices, (0.7, 0.7, 0.6)))
    of = scene(parts, ((0.6, 0.5, 0.2), *[BLACK] * 3, (0.3, 0.3, 0.3)), lights=lamp((1, 1, 1.6)))
    uvs = np.tile(np.array([(0, 0), (1, 0), (0, 1)], dtype=np.float32), (of.geometry.triangle_count, 1, 1))
    bumps: dict[str, Any] = {"bump": OWN | MIRRORED, "normal": (0.3, 0.0, 0.95)}
    return with_lobes(
        replace(of, geometry=replace(of.geometry, uvs=uvs)),
        lobe(GLOSSY, 0.2, material=0, roughness=0.4, multiscatter=True),
        lobe(GLOSSY, 0.1, material=0, roughness=0.5, **bumps),
        lobe(GLASS, material=1, roughness=0.2, **bumps),
        lobe(GLASS, 0.9, 0.8, material=2),
        lobe(TRANSPARENT, 0.7, material=3),
        lobe(TRANSLUCENT, 0.4, material=4),
        lobe(TRANSPARENT, 0.2, material=4),
    )


# --- The same bits, and the books -------------------------------------------------------------------------------------


def test_threads_and_batches_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    of = mixed_room()
    whole = walk(of, replace(SETTINGS, threads=1))
    assert whole.tally.sums.any()
    for batch, threads in ((999, 1), (4096, 3)):
        monkeypatch.setattr(photon_walk, "BATCH", batch)
        other = walk(of, replace(SETTINGS, threads=threads))
        np.testing.assert_array_equal(other.tally.sums, whole.tally.sums)
        np.testing.assert_array_equal(other.bin_counts, whole.bin_counts)
        np.testing.assert_array_equal(other.absorbed, whole.absorbed)


def test_a_closed_room_keeps_its_books() -> None:
    made = [walk(mixed_room(), replace(SETTINGS, seed=seed, photons=4096)) for seed in range(24)]
    assert_means([each.escaped + each.absorbed + each.cut for each in made], 1.0)
    assert max(each.escaped.max() for each in made) < 1e-3
    assert min(each.cut.max() for each in made) > 0


def test_a_lamp_may_take_light_away() -> None:
    """One that takes half of what another at the same place gives: photons of both signs add up to the other half."""
    given, taken = lamp((1, 1, 1.6)), lamp((1, 1, 1.6), (-0.5, -0.25, -0.5))
    half = lamp((1, 1, 1.6), (0.5, 0.75, 0.5))
    both = replace(
        given,
        point=PointLights(
            names=("Lamp", "Taking"),
            **{
                each.name: np.concatenate([getattr(given.point, each.name), getattr(taken.point, each.name)])
                for each in fields(PointLights)
                if each.name not in ("names", "pattern", "falloff", "smooth")
            },
        ),
    )

    def absorbed(lights: Lights, seed: int) -> Float64:
        """Return what surfaces absorb, and what is left after the last bounce, in watts."""
        of = replace(mixed_room(), lights=lights)
        lattice = Lattice(SETTINGS.bounds_min, SETTINGS.bounds_max, SETTINGS.resolution)
        course = prepare_course(of, lattice, 4096)
        made = finish(walk_steps(course, lattice, replace(SETTINGS, seed=seed, photons=4096)))
        return np.array([made.absorbed, made.cut]) * course.emission.flux_scale

    assert_means([absorbed(both, seed).sum(axis=0) for seed in range(24)], (0.5, 0.75, 0.5))
    assert_means([absorbed(both, seed) - absorbed(half, 100 + seed) for seed in range(24)], 0.0)


# --- Furnaces ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("solid", ["glass", "rough glass", "pane of glass", "mirror", "transparent", "translucent"])
def test_what_takes_no_light_leaves_a_uniform_field_uniform(solid: str) -> None:
    """Walls that emit L and reflect half of the light, a third of that from rough facets: 2 L everywhere.

    In the solid too, if light gets into all directions there; in smooth glass, some are left out by total reflection.
    Light that is left after the last bounce is less than 10⁻⁴ of all.
    """
    inside = {
        "glass": (box((0.6, 0.5, 0.6), (1.4, 1.5, 1.4), 1), lobe(GLASS, material=1)),
        "rough glass": (
            box((0.6, 0.5, 0.6), (1.4, 1.5, 1.4), 1),
            lobe(GLASS, material=1, roughness=0.7, multiscatter=True),
        ),
        "pane of glass": (pane(0.9), lobe(GLASS, material=1)),
        "mirror": (pane(0.9), lobe(GLOSSY, material=1, roughness=0.6, multiscatter=True)),
        "transparent": (box((0.6, 0.5, 0.6), (1.4, 1.5, 1.4), 1), lobe(TRANSPARENT, material=1)),
        "translucent": (pane(0.9), lobe(TRANSLUCENT, material=1)),
    }
    part, its_lobe = inside[solid]
    of = scene([box((0, 0, 0), (2, 2, 2), inward=True), part], ((1 / 3,) * 3, BLACK), ((1, 1, 1), BLACK))
    of = with_lobes(of, lobe(GLOSSY, 1 / 6, roughness=0.8, multiscatter=True, weight=1 / 6), its_lobe)
    settings = replace(SETTINGS, photons=1 << 14, bounces=40, include_direct=True, lit_points=0, resolution=(2, 2, 2))
    made = [bake(of, replace(settings, seed=seed)).grid.vectors for seed in range(24)]
    tested = np.ones((3, 3, 3), dtype=bool)
    tested[1, 1, 1] = solid != "glass"
    assert_means([each[tested] for each in made], 2 * np.pi * AXES[:, None, :])


# --- Direct light -----------------------------------------------------------------------------------------------------


def test_light_through_a_pane_is_still_direct() -> None:
    """A black floor: all that is tallied is what has bounced."""
    transparent = lit_from_above(pane(1.0), lobes=(lobe(TRANSPARENT, material=1),))
    assert not walk(transparent).tally.sums.any()
    glass = lit_from_above(pane(1.0), lobes=(lobe(GLASS, material=1),))
    assert walk(glass).tally.sums.any()


def test_light_through_panes_is_what_they_let_pass() -> None:
    color = np.array([0.9, 0.5, 0.2])
    of = lit_from_above(pane(0.5), pane(1.0), lobes=(lobe(TRANSPARENT, color, material=1),))
    made = [walk(of, replace(SETTINGS, seed=seed, include_direct=True)) for seed in range(16)]
    assert_means([1 - each.absorbed for each in made], 0.0)
    below, above = [], []
    for each in made:
        vectors = each.tally.vectors(1.0 / SETTINGS.photons)
        # Away from the edges of the beam and the panes: towards +z, in the middle column.
        below.append(vectors[2, 2, 0, 4, :, 2])
        above.append(vectors[2, 2, 3, 4, :, 2])
    assert_means(np.stack(above)[:, 0:1] * color**2 - np.stack(below), 0.0)


def test_indirect_light_is_tallied_behind_a_pane_too() -> None:
    """A white floor under a clear pane is lit as without it."""
    clear = lit_from_above(pane(1.0), lobes=(lobe(TRANSPARENT, material=1),), floor=(0.5, 0.5, 0.5))
    vectors = [
        walk(clear, replace(SETTINGS, seed=seed)).tally.vectors(1.0 / SETTINGS.photons)[..., 0, 2] for seed in range(16)
    ]
    ground = scene([quad((0, 0, 0), (2, 0, 0), (0, 2, 0))], ((0.5, 0.5, 0.5),), lights=DOWN)
    bare = [
        walk(ground, replace(SETTINGS, seed=seed)).tally.vectors(1.0 / SETTINGS.photons)[..., 0, 2]
        for seed in range(100, 116)
    ]
    assert_means(np.stack(vectors) - np.stack(bare), 0.0)


def test_a_photon_passes_so_many_panes() -> None:
    for panes in (MOST_PASSAGES, MOST_PASSAGES + 1):
        of = lit_from_above(*[pane(0.1 + 0.15 * i) for i in range(panes)], lobes=(lobe(TRANSPARENT, material=1),))
        result = walk(of)
        arrives = panes == MOST_PASSAGES
        np.testing.assert_allclose(result.absorbed, 1.0 if arrives else 0.0, atol=1e-6)
        np.testing.assert_allclose(result.cut, 0.0 if arrives else 1.0, atol=1e-6)


def test_an_object_that_diffuse_rays_do_not_see_shades_behind_a_pane() -> None:
    """Direct light, which has passed a pane, is stopped by it; reflected light is not."""
    screen = quad((0, 0, 0.5), (2, 0, 0), (0, 2, 0), visible=False)
    of = lit_from_above(pane(1.0), screen, lobes=(lobe(TRANSPARENT, material=1),), floor=(1, 1, 1))
    result = walk(of)
    assert not result.tally.sums.any()
    np.testing.assert_allclose(result.absorbed, 1.0, atol=1e-6)
    # Glass makes it a reflection: the screen is gone, and the floor lit.
    glass = walk(lit_from_above(pane(1.0), screen, lobes=(lobe(GLASS, material=1),), floor=(1, 1, 1)))
    assert glass.escaped.min() > 0.5


def test_soft_falloff_goes_on_behind_a_pane() -> None:
    """A clear box around a lamp, closer to it than it begins to shine to some photons, changes nothing."""
    light = lamp((1, 1, 1))
    light = replace(
        light,
        point=replace(light.point, radius=np.array([0.5], dtype=np.float32), soft_falloff=np.array([True])),
    )
    parts = [box((0, 0, 0), (2, 2, 2), inward=True), box((0.7, 0.7, 0.7), (1.3, 1.3, 1.3), 1)]
    settings = replace(SETTINGS, include_direct=True)
    bare, boxed = [], []
    for seed in range(16):
        of = with_lobes(scene(parts, ((0.5,) * 3, BLACK), lights=light), lobe(TRANSPARENT, material=1))
        result = walk(of, replace(settings, seed=seed))
        boxed.append(result.tally.vectors(1.0 / SETTINGS.photons)[..., 0, :])
        result = walk(scene(parts[:1], ((0.5,) * 3,), lights=light), replace(settings, seed=100 + seed))
        bare.append(result.tally.vectors(1.0 / SETTINGS.photons)[..., 0, :])
    assert_means(np.stack(boxed) - np.stack(bare), 0.0)


# --- What counts as lit -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [GLASS, TRANSPARENT, TRANSLUCENT])
def test_a_room_behind_a_pane_is_lit(kind: int) -> None:
    """Its light enters through a pane that is its whole ceiling."""
    parts = [box((0, 0, 0), (2, 2, 2), inward=True), pane(1.0)]
    of = scene(parts, ((0.5,) * 3, BLACK), lights=lamp((1, 1, 1.5)))
    settings = replace(SETTINGS, photons=100_000)
    lit = bake(with_lobes(of, lobe(kind, material=1)), settings).grid.validity
    if kind == TRANSLUCENT:  # what it scatters differs from side to side: vertices at its height speak for one
        np.testing.assert_array_equal(lit[:, :, [0, 1, 3, 4]], 1.0)
        assert (lit[:, :, 2] > 0).all()
    else:
        np.testing.assert_array_equal(lit, 1.0)
    dark = bake(with_lobes(of, lobe(GLOSSY, material=1)), settings).grid.validity
    # Patches on both sides of the pane's edges, where it meets the walls, leak a little.
    assert dark[:, :, :2].max() < 0.05
    np.testing.assert_array_equal(dark[:, :, 3:], 1.0)


@pytest.mark.parametrize("roughness", [0.0, 0.5])
def test_a_ball_of_glass_is_lit_inside(roughness: float) -> None:
    sphere = ball(0.8, rounds=3, material=1)
    parts = [box((0, 0, 0), (2, 2, 2), inward=True), replace(sphere, vertices=sphere.vertices + 1.0)]
    of = scene(parts, ((0.5,) * 3, BLACK), lights=lamp((0.2, 0.2, 1.8)))
    settings = replace(SETTINGS, photons=100_000)
    lit = bake(with_lobes(of, lobe(GLASS, material=1, roughness=roughness)), settings).grid
    np.testing.assert_array_equal(lit.validity, 1.0)
    assert lit.vectors[2, 2, 2].any()
    mirror = bake(with_lobes(of, lobe(GLOSSY, material=1, roughness=roughness)), settings).grid
    assert mirror.validity[2, 2, 2] == 0.0
