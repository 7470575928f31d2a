# SPDX-License-Identifier: GPL-3.0-or-later
"""Lobes that have normals of their own: how much light they send on, and where to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from ivg_addon.core.bumps import BENT, MIRRORED, OWN, placed_normal, relative_normals, unit_normals, valid_normal
from ivg_addon.core.scene import GLOSSY, MATTE, TRANSLUCENT, Scene

from .lobe_scenes import Outcome, arriving, lobe, meet, surface, uniform_field
from .z_tests import assert_means

Float64 = NDArray[np.float64]

TILT = 0.35
NORMAL = np.array([np.sin(TILT), 0.0, np.cos(TILT)])
UP = np.array([0.0, 0.0, 1.0])
RHO = np.array([0.5, 0.3, 0.2])


def bumped(kind: int, bump: int = OWN, normal: ArrayLike = NORMAL, **values: float) -> Scene:
    """Return a plate of one lobe whose normal is tilted towards x, the direction in which u grows."""
    made = surface(lobe(kind, RHO, RHO, bump=bump, normal=normal, **values))
    uvs = np.array([[(0, 0), (1, 0), (0, 1)]], dtype=np.float32)
    return replace(made, geometry=replace(made.geometry, uvs=uvs))


def softened(light: Float64, normal: Float64 = NORMAL) -> Float64:
    """Return what a softened terminator leaves of light from directions (n, 3) above the plate."""
    squared = np.minimum(1.0, (normal[0] ** 2 + normal[1] ** 2) / normal[2] ** 2 / 8)
    tangent = 1.0 / light[:, 2] ** 2 - 1.0
    return np.where(light @ normal > 0.0, 2.0 / (1.0 + np.sqrt(1.0 + squared * tangent)), 0.0)


def sent(outcome: Outcome, n: int) -> Float64:
    """Return what is sent on, per photon."""
    return np.asarray(outcome.weights.sum(axis=0) / n)


# --- Diffuse reflection -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("bump", "azimuth"), [(OWN, 0.7), (OWN, 2.5), (BENT | OWN, 2.5)])
def test_a_tilted_diffuse_surface_reflects_what_its_normal_sees(bump: int, azimuth: float) -> None:
    n, scene = 1 << 12, bumped(MATTE, bump)
    arrival = arriving(0.5, n, azimuth)
    light = -arrival[:1]
    factor = (light @ NORMAL)[0] / light[0, 2] * (1.0 if bump & BENT else softened(light)[0])
    assert factor > 0.3
    assert_means([sent(meet(scene, arrival, seed), n) for seed in range(32)], RHO * factor)


def test_a_tilted_diffuse_surface_in_even_light() -> None:
    # ∫ max(0, i·n) di over the hemisphere around g is π (1 + cos δ)/2; there is no light from below.
    n, scene = 1 << 13, bumped(MATTE, OWN | BENT)
    outcomes = [meet(scene, uniform_field(n, 100 + seed), seed) for seed in range(32)]
    assert_means([sent(each, n) for each in outcomes], RHO * (1 + np.cos(TILT)) / 2)


def test_what_is_behind_a_bump_gets_no_light() -> None:
    steep = np.array([np.sin(1.2), 0.0, np.cos(1.2)])
    assert not len(meet(bumped(MATTE, OWN, steep), arriving(0.2, 1000, np.pi)).weights)


@pytest.mark.parametrize(("bump", "towards"), [(OWN | BENT, -1.0), (OWN | BENT | MIRRORED, 1.0)])
def test_from_behind_a_map_tilts_to_the_other_side_and_a_bump_to_the_same(bump: int, towards: float) -> None:
    n = 1 << 12
    arrival = arriving(-0.5, n, 0.7)
    seen = NORMAL * (towards, 0.0, -1.0)
    factor = (-arrival[0] @ seen) / 0.5
    assert_means([sent(meet(bumped(MATTE, bump), arrival, seed), n) for seed in range(32)], RHO * factor)


def test_a_tilted_translucent_surface_lets_through_what_its_normal_sees() -> None:
    n = 1 << 12
    arrival = arriving(0.5, n)
    outcomes = [meet(bumped(TRANSLUCENT, OWN | BENT), arrival, seed) for seed in range(32)]
    assert all((each.directions[:, 2] < 0.0).all() for each in outcomes)
    assert_means([sent(each, n) for each in outcomes], RHO * (-arrival[0] @ NORMAL) / 0.5)


# --- Glossy reflection ------------------------------------------------------------------------------------------------


def test_a_tilted_mirror_reflects_around_its_normal() -> None:
    arrival = arriving(0.8, 100, 0.7)
    outcome = meet(bumped(GLOSSY), arrival)
    i = -arrival[0]
    o = 2 * (i @ NORMAL) * NORMAL - i
    assert len(outcome.directions) > 50
    np.testing.assert_allclose(outcome.directions, np.tile(o, (len(outcome.directions), 1)), atol=1e-6)


def seen_by_paths(n: int, seed: int, alpha: float) -> tuple[Float64, Float64]:
    """Return directions of view (n, 3) with a cosine, and what one path from each finds of even light above the plate.

    As Cycles samples: facets that the viewer sees, around the normal as it is turned for that view.
    """
    rng = np.random.default_rng([seed, 1])
    view = -uniform_field(n, seed)
    turned = np.array([valid_normal(*UP, *each, *NORMAL) for each in view])
    u, v = rng.random((2, n))
    axis = np.where(np.abs(turned[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    t = np.cross(turned, axis)
    t /= np.linalg.norm(t, axis=1, keepdims=True)
    b = np.cross(turned, t)
    x, y, z = (np.einsum("ij,ij->i", view, each) for each in (t, b, turned))
    # Facets that direction (x, y, z) sees, by a point on a spherical cap (Dupuy & Benyoub 2023).
    stretched = np.stack([alpha * x, alpha * y, z], axis=1)
    stretched /= np.linalg.norm(stretched, axis=1, keepdims=True)
    height = (1 - v) * (1 + stretched[:, 2]) - stretched[:, 2]
    radius = np.sqrt(np.maximum(0, 1 - height**2))
    cap = np.stack([radius * np.cos(2 * np.pi * u), radius * np.sin(2 * np.pi * u), height], axis=1) + stretched
    facet = cap * (alpha, alpha, 1)
    facet /= np.linalg.norm(facet, axis=1, keepdims=True)
    local = np.stack([x, y, z], axis=1)
    image = 2 * np.einsum("ij,ij->i", local, facet)[:, None] * facet - local
    light = image[:, :1] * t + image[:, 1:2] * b + image[:, 2:] * turned

    def hidden(cosine: Float64) -> Float64:
        return np.asarray(0.5 * (np.sqrt(1 + alpha**2 * (1 / cosine**2 - 1)) - 1))

    there = (light[:, 2] > 0) & (image[:, 2] > 0) & (z > 0)
    over, under = hidden(np.where(there, z, 1.0)), hidden(np.where(there, image[:, 2], 1.0))
    return view, np.where(there, (1 + over) / (1 + over + under), 0.0)


@pytest.mark.parametrize("roughness", [0.35, 0.7])
def test_photons_see_a_tilted_glossy_surface_as_paths_do(roughness: float) -> None:
    """In even light; towards sectors that the tilt tells apart, and rims, where Cycles turns the normal."""
    n, scene = 1 << 14, bumped(GLOSSY, roughness=roughness)

    def sectors(directions: Float64, weights: Float64) -> Float64:
        quarter = ((np.arctan2(directions[:, 1], directions[:, 0]) + np.pi) / (np.pi / 2)).astype(int) % 4
        return np.bincount(4 * (directions[:, 2] * 3.999).astype(int) + quarter, weights, minlength=16) / n

    differences = []
    for seed in range(24):
        outcome = meet(scene, uniform_field(n, 1000 + seed), seed)
        by_photons = sectors(outcome.directions, outcome.weights[:, 0] / RHO[0])
        differences.append(by_photons - sectors(*seen_by_paths(n, 2000 + seed, roughness**2)))
    assert_means(differences, 0.0)


def test_a_turned_normal_shows_what_is_just_above_the_surface() -> None:
    view = -uniform_field(500, 3)
    turned = np.array([valid_normal(*UP, *each, *NORMAL) for each in view])
    image = 2 * np.einsum("ij,ij->i", view, turned)[:, None] * turned - view
    plain = 2 * (view @ NORMAL)[:, None] * NORMAL - view
    least = np.minimum(0.9 * view[:, 2], 0.01)
    kept = plain[:, 2] >= least
    assert 300 < kept.sum() < 490
    np.testing.assert_array_equal(turned[kept], np.tile(NORMAL, (kept.sum(), 1)))
    np.testing.assert_allclose(image[~kept, 2], least[~kept], atol=1e-7)
    np.testing.assert_allclose(np.linalg.norm(turned, axis=1), 1.0, atol=1e-12)


# --- Relative to the surface ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("mirrored", [False, True])
def test_a_normal_comes_back_where_an_instance_stands(mirrored: bool) -> None:
    rng = np.random.default_rng(5)
    corners, uvs = rng.normal(size=(3, 3)), rng.random((3, 2))
    flat = np.cross(corners[1] - corners[0], corners[2] - corners[0])
    smooth = flat / np.linalg.norm(flat) + 0.3 * rng.normal(size=3)
    smooth /= np.linalg.norm(smooth)
    normal = smooth + 0.5 * rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    along = np.linalg.solve(uvs[1:] - uvs[0], corners[1:] - corners[0])
    (relative,) = relative_normals(normal[None], smooth[None], along[:1], along[1:])

    turn = 2.5 * np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn)) * (-1.0 if mirrored else 1.0)
    placed, order = corners @ turn.T, [0, 2, 1] if mirrored else [0, 1, 2]
    found = placed_normal(*relative, *(turn @ smooth / 2.5), *map(tuple, placed[order]), *uvs[order].ravel())
    np.testing.assert_allclose(found, turn @ normal / 2.5, atol=1e-12)


def test_no_normal_is_the_surfaces_own() -> None:
    np.testing.assert_array_equal(unit_normals(np.array([[0.0, 0, 0], [np.nan, 0, 1], [0, 0, 3]])), np.tile(UP, (3, 1)))
