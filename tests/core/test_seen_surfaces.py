# SPDX-License-Identifier: GPL-3.0-or-later
"""What cameras see of lobes, in light that is known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial.legendre import leggauss

from ivg_addon.core.bumps import MIXED, OWN
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.matte import rough_albedo, rough_diffuse
from ivg_addon.core.picture import LookUp, Picture, shade_steps
from ivg_addon.core.principled import oren_nayar_share
from ivg_addon.core.scene import GLOSSY, MATTE, SHEEN, TRANSLUCENT, TRANSPARENT, VIEW_STEPS, Lobes
from ivg_addon.core.settings import Directional

from . import rooms
from .lobe_scenes import lobe, with_lobes
from .steps import drain
from .test_picture import RADIANCE, RHO, camera, distant_light, uniform_light, wall

LINEAR = 1.5 * np.linspace(0.0, 1.0, VIEW_STEPS)[:, None]
"""A view that grows with the cosine μ."""


def pixel_cosines(size: int = 8) -> np.ndarray:
    """Return μ (size, size, 1) at the middle of the pixels of a view 90° wide, to a wall across it."""
    x = (np.arange(size) + 0.5) / size * 2 - 1
    return 1.0 / np.sqrt(1.0 + x[:, None] ** 2 + x[None, :] ** 2)[..., None]


def look_at(
    *lobes: Lobes, light: IrradianceVectorGrid | None = None, albedo: np.ndarray | float = 0.0, samples: int = 1
) -> Picture:
    """Return the picture of a wall with lobes; its texture coordinates are x and y.

    Each pixel's one ray goes through its middle, or nearly.
    """
    flat = rooms.scene([wall(1.0)], albedo=[np.broadcast_to(albedo, 3)])
    along = flat.geometry.vertices[flat.geometry.triangles][..., :2].astype(np.float32)
    of = with_lobes(replace(flat, geometry=replace(flat.geometry, uvs=along)), *lobes)
    how = LookUp(directional=Directional.REPORT) if light is not None else None
    return drain(shade_steps(of, light or uniform_light(), camera(filter_width=1e-6), samples, how))


def test_all_diffuse_lobes_add_up() -> None:
    """A Principled surface with sheen, say; what mirrors is not diffuse."""
    picture = look_at(lobe(MATTE, 0.5 * RHO), lobe(SHEEN, 0.25 * RHO, roughness=0.5), lobe(GLOSSY, 0.9))
    np.testing.assert_allclose(picture.color, np.broadcast_to(0.75 * RHO, (8, 8, 3)), rtol=1e-5)
    np.testing.assert_allclose(picture.light, np.broadcast_to(0.75 * RHO * RADIANCE, (8, 8, 3)), rtol=1e-5)


def test_matte_lobes_are_all_of_a_materials_diffuse_reflection() -> None:
    picture = look_at(lobe(MATTE, RHO), albedo=0.9)
    np.testing.assert_allclose(picture.color, np.broadcast_to(RHO, (8, 8, 3)), rtol=1e-5)


@pytest.mark.parametrize("kind", [MATTE, SHEEN, TRANSLUCENT])
def test_layers_are_seen_by_the_angle_of_view(kind: int) -> None:
    picture = look_at(lobe(kind, RHO, view=LINEAR, roughness=0.5 if kind == SHEEN else 0.0))
    np.testing.assert_allclose(picture.color, 1.5 * pixel_cosines() * RHO, rtol=1e-3)


def test_a_rough_surface_is_seen_by_the_angle_of_view() -> None:
    picture = look_at(lobe(MATTE, 0.8 * RHO, RHO, roughness=0.7))
    cosines = pixel_cosines()[..., 0]
    for c in range(3):
        expected = [[0.8 * RHO[c] * rough_albedo(mu, 0.7, RHO[c]) for mu in row] for row in cosines]
        np.testing.assert_allclose(picture.color[..., c], expected, rtol=1e-4)


@pytest.mark.parametrize("cos_out", [0.05, 0.4, 1.0])
@pytest.mark.parametrize("rho", [0.0, 0.5, 1.0])
def test_rough_albedo_is_the_integral_of_the_lobe(cos_out: float, rho: float) -> None:
    """∫ f cos di by quadrature: Gauss–Legendre in the cosine, the midpoint rule in the azimuth."""
    nodes, weights = leggauss(160)
    mu, azimuth = 0.5 * (nodes + 1.0), 2.0 * np.pi * (np.arange(720) + 0.5) / 720
    total = 0.0
    for cos_in, weight in zip(mu, 0.5 * weights, strict=True):
        sines = np.sqrt((1.0 - cos_in**2) * (1.0 - cos_out**2))
        values = [rough_diffuse(cos_in, cos_out, cos_in * cos_out + sines * np.cos(phi), 0.7, rho) for phi in azimuth]
        total += weight * 2.0 * cos_in * float(np.mean(values))
    assert rough_albedo(cos_out, 0.7, rho) == pytest.approx(total, rel=1e-5)


def test_rough_albedo_is_right_in_the_mean() -> None:
    nodes, weights = leggauss(64)
    mu = 0.5 * (nodes + 1.0)
    mean = sum(w * m * rough_albedo(m, 1.0, 0.6) for w, m in zip(weights, mu, strict=True))
    assert mean == pytest.approx(float(oren_nayar_share(np.array([[0.6]]), np.array([[1.0]]))[0, 0]), rel=1e-6)


def test_translucent_lobes_show_the_light_of_the_other_side() -> None:
    behind = distant_light(np.array([0.0, 0.0, -1.0]))
    through = look_at(lobe(TRANSLUCENT, RHO), light=behind)
    np.testing.assert_allclose(through.light, np.broadcast_to(RHO * RADIANCE / np.pi, (8, 8, 3)), rtol=1e-5)
    assert not look_at(lobe(MATTE, RHO), light=behind).light.any()


def test_lobes_are_lit_by_their_own_normals() -> None:
    """Relative normals are in the axes of the texture coordinates."""
    tilted = np.array([0.6, 0.0, 0.8])
    omega = np.array([2.0, 1.0, 2.0]) / 3.0
    lit = look_at(lobe(MATTE, RHO, bump=OWN, normal=tilted), light=distant_light(omega))
    np.testing.assert_allclose(
        lit.light, np.broadcast_to(RHO * RADIANCE / np.pi * (tilted @ omega), (8, 8, 3)), rtol=1e-4
    )
    mixed = look_at(lobe(MATTE, RHO, bump=OWN | MIXED, normal=tilted, view=LINEAR))
    np.testing.assert_allclose(mixed.color, 1.5 * pixel_cosines() * RHO, rtol=1e-3)


def test_rays_go_on_through_what_is_transparent() -> None:
    """Of three walls the first two let half and a quarter through, and reflect some themselves."""
    parts = [replace(wall(depth), material=index) for index, depth in enumerate((1.0, 1.5, 1.8))]
    of = rooms.scene(parts, albedo=[0.3 * RHO, 0.2 * RHO, RHO])
    of = with_lobes(of, lobe(TRANSPARENT, 0.5), lobe(TRANSPARENT, 0.25, material=1))
    picture = drain(shade_steps(of, uniform_light(), camera(), 4))
    expected = (0.3 + 0.5 * (0.2 + 0.25)) * RHO
    np.testing.assert_allclose(picture.color, np.broadcast_to(expected, (8, 8, 3)), rtol=1e-5)
    np.testing.assert_allclose(picture.light, np.broadcast_to(expected * RADIANCE, (8, 8, 3)), rtol=1e-5)
    np.testing.assert_array_equal(picture.coverage, 1.0)
    near = drain(shade_steps(of, uniform_light(), camera(clip_end=1.6), 4))
    np.testing.assert_allclose(near.color, np.broadcast_to((0.3 + 0.5 * 0.2) * RHO, (8, 8, 3)), rtol=1e-5)


def test_rays_pass_as_many_surfaces_as_in_cycles() -> None:
    """Eight; a ninth ends them."""
    depths = 0.2 + 0.2 * np.arange(9)
    parts = [replace(wall(float(depth)), material=1) for depth in depths]
    for count, seen in ((8, 1.0), (9, 0.0)):
        of = rooms.scene([wall(2.0), *parts[:count]], albedo=[RHO, np.zeros(3)])
        picture = drain(shade_steps(with_lobes(of, lobe(TRANSPARENT, 1.0, material=1)), uniform_light(), camera(), 1))
        np.testing.assert_allclose(picture.color, np.broadcast_to(seen * RHO, (8, 8, 3)), rtol=1e-5)
