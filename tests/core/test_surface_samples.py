# SPDX-License-Identifier: GPL-3.0-or-later
"""The irradiance that landed photons tell: right where it is told, and not told where it could not be."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.embree import Tracer
from ivg_addon.core.lit_volume import LightKnowledge
from ivg_addon.core.progress import finish
from ivg_addon.core.scene import GLASS, Scene
from ivg_addon.core.surface_bins import BACK, FRONT, SurfaceBins
from ivg_addon.core.surface_patches import Patches
from ivg_addon.core.surface_samples import REACH, SurfaceSamples, surface_sample_steps
from ivg_addon.core.surfaces import Surfaces

from .lobe_scenes import lobe, with_lobes
from .rooms import ball, box, quad, rotation, scene

Float64 = NDArray[np.float64]

LATTICE = Lattice((-2.0, -2.0, -0.5), (2.0, 2.0, 1.5), (4, 4, 2))
"""Voxels of a metre."""
LIGHT = np.array([3.0, 2.0, 1.0])
"""W/m², wherever light falls."""
PHOTONS = 400
"""On a patch of an eighth of a voxel that is lit as a whole."""
Share = Callable[[Float64, Float64], NDArray[np.bool_]]


def lit_share(of: Scene, bins: SurfaceBins, where: Share, side: int) -> Float64:
    """Return how much of each patch light falls on, by 900 places in its triangle's part of it."""
    count, patch = np.zeros((2, bins.count)), 0
    s, t = ((x.reshape(-1) + 0.5) / 30 for x in np.mgrid[0:30, 0:30])
    for corners, (c, m, n) in zip(of.geometry.vertices[of.geometry.triangles], bins.divisions, strict=True):
        p, q, r = np.roll(corners, -c, axis=0).astype(np.float64)
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0]).astype(np.float64)
        normal *= (1 - 2 * side) / max(float(np.linalg.norm(normal)), 1e-300)
        for a, b in np.ndindex(m, n):
            u, v = (a + s) / m, (b + t) / n
            inside = u + v <= 1
            places = p + u[inside, None] * (q - p) + v[inside, None] * (r - p)
            count[:, patch] = inside.sum(), where(places, np.broadcast_to(normal, places.shape)).sum()
            patch += 1
    return np.asarray(count[1] / np.maximum(count[0], 1))


def samples(of: Scene, front: Share, back: Share | None = None, seed: int | None = None) -> SurfaceSamples:
    """Return the samples of light that falls where it is told; with a seed, of a photon a patch by chance."""
    bins = SurfaceBins.of(of.geometry, 0.125)
    area = Patches.of(of.geometry, bins).area.astype(np.float64)
    shares = np.zeros((bins.count, 2))
    shares[:, FRONT] = lit_share(of, bins, front, FRONT)
    if back is not None:
        shares[:, BACK] = lit_share(of, bins, back, BACK)
    expected = area[:, None] * shares * 64 * (PHOTONS if seed is None else 1)
    counts = np.rint(expected) if seed is None else np.random.default_rng(seed).poisson(expected)
    flux = expected if seed is None else counts
    received = (flux[..., None] / (64 * (PHOTONS if seed is None else 1)) * LIGHT).astype(np.float32)
    knowledge = LightKnowledge(of.geometry, Tracer(of.geometry), bins, counts.astype(np.int32), world_shines=False)

    def light(points: Float64, normals: Float64) -> Float64:
        return np.broadcast_to(LIGHT, points.shape)

    return finish(surface_sample_steps(knowledge, Surfaces.of(of, bins), received, 1.0, LATTICE, light, 2))


def everywhere(places: Float64, normals: Float64) -> NDArray[np.bool_]:
    return np.ones(len(places), dtype=np.bool_)


def floor(material: int = 0) -> object:
    return quad((-2, -2, 0), (4, 0, 0), (0, 4, 0), material)


def test_flux_over_area_is_irradiance() -> None:
    found = samples(scene([floor()]), everywhere)  # type: ignore[list-item]
    np.testing.assert_allclose(found.irradiance, np.broadcast_to(LIGHT, found.irradiance.shape), rtol=1e-5)
    np.testing.assert_allclose(found.area.sum(), 16.0, rtol=1e-5)
    np.testing.assert_array_equal(found.normals, np.broadcast_to([0, 0, 1.0], found.normals.shape))


def test_places_that_something_stands_on_are_left_out() -> None:
    """A turned block sunk into the floor: no sample is darker for what it covers, and few are left out beside it."""
    turn = rotation((0, 0, 1), 0.4)
    block = box((-0.7, -0.5, -0.3), (0.6, 0.8, 0.9), turn=turn)

    def lit(places: Float64, normals: Float64) -> NDArray[np.bool_]:
        x, y, z = ((places + 1e-6 * normals) @ turn).T
        covered = (np.abs(x + 0.05) < 0.65) & (np.abs(y - 0.15) < 0.65) & (z < 0.9)
        return ~covered & (places[:, 2] > -1e-6)

    found = samples(scene([floor(), block]), lit)  # type: ignore[list-item]
    off = np.abs(found.irradiance / LIGHT - 1.0).max(axis=1) > 1e-3
    assert found.area[off].sum() < 1e-4, "slivers too small to expect a photon"
    on_floor = found.normals[:, 2] > 0.9
    bare = 16.0 - 1.3 * 1.3
    assert 0.9 * bare < found.area[on_floor & (found.points[:, 2] < 0.1)].sum() <= bare


def test_gaps_are_left_out() -> None:
    """Above the floor, nearer than a quarter of a voxel, lies a sheet: neither tells what is between them."""
    sheet = quad((-1, -1, 0.8 * REACH), (2, 0, 0), (0, 2, 0))
    found = samples(scene([floor(), sheet]), everywhere, everywhere)  # type: ignore[list-item]
    under = (np.abs(found.points[:, :2]) < 0.9).all(axis=1)
    assert not (under & (found.normals[:, 2] > 0) & (found.points[:, 2] < 0.1)).any()
    assert not (under & (found.normals[:, 2] < 0) & (found.points[:, 2] > 0.1)).any()
    assert (under & (found.normals[:, 2] > 0) & (found.points[:, 2] > 0.1)).any()
    higher = quad((-1, -1, 1.2 * REACH), (2, 0, 0), (0, 2, 0))
    found = samples(scene([floor(), higher]), everywhere, everywhere)  # type: ignore[list-item]
    under = (np.abs(found.points[:, :2]) < 0.9).all(axis=1)
    assert (under & (found.normals[:, 2] > 0) & (found.points[:, 2] < 0.1)).any()


def test_the_dark_side_of_what_is_lit_tells_nothing() -> None:
    found = samples(scene([ball(0.7, rounds=3, smooth=False)]), everywhere)
    assert len(found.area) > 100
    assert (np.einsum("nk,nk->n", found.points, found.normals) > 0).all()


@pytest.mark.parametrize("visible", [True, False])
def test_only_sides_that_shade_something_are_asked(visible: bool) -> None:
    """Not mirrors and glass, nor what diffuse rays do not see."""
    matte = scene([floor()], ((0.5,) * 3,))  # type: ignore[list-item]
    assert len(samples(matte, everywhere).area)
    black = scene([floor()], ((0.0,) * 3,))  # type: ignore[list-item]
    assert not len(samples(with_lobes(black, lobe(GLASS)), everywhere).area)
    hidden = scene([quad((-2, -2, 0), (4, 0, 0), (0, 4, 0), visible=visible)])
    assert bool(len(samples(hidden, everywhere).area)) == visible


def test_sparse_photons_leave_no_bias() -> None:
    """A photon a patch: those without any are as dark as others are too bright. Four standard errors."""
    of = scene([box((-2, -2, -0.5), (2, 2, 1.5), inward=True)])
    area = 2 * 16 + 4 * 8
    for seed in range(3):
        found = samples(of, everywhere, seed=seed)
        np.testing.assert_allclose(found.area.sum(), area, rtol=0.02)
        mean = (found.area[:, None] * found.irradiance).sum(axis=0) / found.area.sum()
        np.testing.assert_allclose(mean, LIGHT, rtol=4 / np.sqrt(64 * area))


def test_triangles_without_area_tell_nothing() -> None:
    """Points, lines, and slivers whose area single precision takes for none, among others."""
    thin = [quad((0, 0, 0.5), (width, 0, 0), (0, 1, 0)) for width in (0.0, 1e-30, 1e-12)]
    found = samples(scene([floor(), *thin]), everywhere)  # type: ignore[list-item]
    assert all(np.isfinite(values).all() for values in vars(found).values())
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=1), 1.0, rtol=1e-6)
    np.testing.assert_allclose(found.area.sum(), 16.0, rtol=1e-5)


def test_sparse_photons_on_both_sides_leave_no_bias() -> None:
    """A sheet in a room: neither side is taken for dark where chance left it without a photon. Four standard errors."""
    sheet = quad((-1, -1, 0.5), (2, 0, 0), (0, 2, 0))
    of = scene([box((-2, -2, -0.5), (2, 2, 1.5), inward=True), sheet])
    for seed in range(3):
        found = samples(of, everywhere, lambda places, _: np.abs(places[:, 2] - 0.5) < 1e-6, seed=seed)
        on_sheet = np.abs(found.points[:, 2] - 0.5) < 1e-6
        on_sheet &= (np.abs(found.points[:, :2]) < 1.0).all(axis=1)
        area = found.area[on_sheet]
        np.testing.assert_allclose(area.sum(), 8.0, rtol=0.02)
        mean = (area[:, None] * found.irradiance[on_sheet]).sum(axis=0) / area.sum()
        np.testing.assert_allclose(mean, LIGHT, rtol=4 / np.sqrt(64 * 8))


def test_beyond_the_box_nothing_is_asked() -> None:
    far = quad((-50, -50, 0), (100, 0, 0), (0, 100, 0))
    found = samples(scene([far]), everywhere)
    assert (np.abs(found.points) <= 2.0).all()
    assert not len(samples(scene([quad((5, 5, 0), (1, 0, 0), (0, 1, 0))]), everywhere).area)
