# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures shaded from grids whose light is known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ivg_addon.core.camera import Camera, PixelFilter, Projection
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.errors import SettingsError
from ivg_addon.core.grid import BakeRecord, IrradianceVectorGrid
from ivg_addon.core.picture import LookUp, Picture, shade_steps
from ivg_addon.core.scene import Scene, Texture
from ivg_addon.core.settings import BakeSettings, Directional

from . import rooms
from .steps import drain

AXES = np.concatenate([[axis, -axis] for axis in np.eye(3)])
LOW, HIGH = (-2.0, -2.0, -2.0), (2.0, 2.0, 2.0)
RADIANCE = np.array([0.5, 1.0, 2.0])
RHO = np.array([0.2, 0.4, 0.8])


def grid(vectors: np.ndarray) -> IrradianceVectorGrid:
    """Return a grid with the same vectors (6, 3 channels, 3) at every vertex."""
    lattice = Lattice(LOW, HIGH, (2, 2, 2))
    settings = BakeSettings(LOW, HIGH, (2, 2, 2))
    return IrradianceVectorGrid(
        vectors=np.broadcast_to(vectors, (*lattice.shape, 6, 3, 3)).astype(np.float32),
        validity=np.ones(lattice.shape, dtype=np.float32),
        lit_weights=lattice.whole_cell_weights(),
        plane_start=np.zeros(lattice.vertex_count + 1, dtype=np.int32),
        planes=np.empty((0, 5), dtype=np.float32),
        lattice=lattice,
        record=BakeRecord("Test", "", settings, "2026-01-01T00:00:00+00:00", "", (0.0, 0.0, 0.0)),
    )


def uniform_light(radiance: np.ndarray = RADIANCE) -> IrradianceVectorGrid:
    """Return the grid of the same radiance from everywhere: I_δ = π L δ, E = π L."""
    return grid(np.pi * radiance[None, :, None] * AXES[:, None, :])


def distant_light(omega: np.ndarray) -> IrradianceVectorGrid:
    """Return the grid of a distant light along ω: I_δ = Φ ω where δ·ω > 0.

    The report's interpolation returns that as Φ max(0, ω·n).
    """
    lit = (AXES @ omega > 0)[:, None, None]
    return grid(np.where(lit, RADIANCE[None, :, None] * omega, 0.0))


def camera(**changes: object) -> Camera:
    """Return a camera at the origin that looks along −z, 90° wide."""
    values = {
        "name": "Camera",
        "matrix": np.eye(4),
        "projection": Projection.PERSPECTIVE,
        "frame": (-1.0, 1.0, -1.0, 1.0),
        "clip_start": 0.01,
        "clip_end": 100.0,
        "width": 8,
        "height": 8,
        "filter": PixelFilter.BOX,
        "filter_width": 1.0,
    }
    return Camera(**{**values, **changes})


def wall(depth: float, left: float = -9.0, visible: bool = True) -> rooms.Part:
    """Return a wall from `left` to the far right, turned towards the camera."""
    return rooms.quad((left, -9.0, -depth), (9.0 - left, 0.0, 0.0), (0.0, 18.0, 0.0), visible=visible)


def shade(scene: Scene, view: Camera | None = None, **options: object) -> Picture:
    return drain(shade_steps(scene, uniform_light(), view or camera(), 16, **options))


@pytest.mark.parametrize("inward", [True, False])
def test_in_a_uniform_field_everything_shows_albedo_times_radiance(inward: bool) -> None:
    """Whichever way faces are turned."""
    picture = shade(rooms.scene([rooms.box(LOW, HIGH, inward=inward)], albedo=[RHO]))
    np.testing.assert_allclose(picture.light, np.broadcast_to(RHO * RADIANCE, (8, 8, 3)), rtol=1e-5)
    np.testing.assert_allclose(picture.indirect, np.broadcast_to(RADIANCE, (8, 8, 3)), rtol=1e-5)
    np.testing.assert_allclose(picture.color, np.broadcast_to(RHO, (8, 8, 3)), rtol=1e-5)
    np.testing.assert_array_equal(picture.coverage, 1.0)


def test_pixels_at_an_edge_are_partly_covered() -> None:
    """An edge through the middle of the fifth column of pixels; the sequence of samples is even to 1/16."""
    picture = shade(rooms.scene([wall(1.0, left=0.125)], albedo=[RHO]))
    np.testing.assert_array_equal(picture.coverage[:, :4], 0.0)
    np.testing.assert_array_equal(picture.coverage[:, 5:], 1.0)
    np.testing.assert_allclose(picture.coverage[:, 4], 0.5, atol=1 / 16)
    np.testing.assert_allclose(picture.light, picture.coverage[..., None] * RHO * RADIANCE, rtol=1e-5)
    np.testing.assert_array_equal(picture.indirect[:, :4], 0.0)


@pytest.mark.parametrize(("start", "end", "seen"), [(0.01, 100.0, 1.0), (0.01, 0.99, 0.0), (1.01, 100.0, 0.0)])
def test_surfaces_beyond_the_clipping_planes_are_not_seen(start: float, end: float, seen: float) -> None:
    picture = shade(rooms.scene([wall(1.0)]), camera(clip_start=start, clip_end=end))
    np.testing.assert_array_equal(picture.coverage, seen)


def test_what_the_camera_does_not_see_hides_nothing() -> None:
    scene = rooms.scene([wall(1.0), replace(wall(1.5), material=1)], albedo=[RHO, 0.5 * RHO])
    front = shade(scene)
    behind = shade(scene, visible=np.array([False, True]))
    np.testing.assert_allclose(front.color, np.broadcast_to(RHO, (8, 8, 3)), rtol=1e-5)
    np.testing.assert_allclose(behind.color, np.broadcast_to(0.5 * RHO, (8, 8, 3)), rtol=1e-5)


def test_shading_normals_are_interpolated() -> None:
    """On an octahedron with the normals of its sphere, a point p has the normal p/|p|."""
    omega = np.array([1.0, 2.0, 2.0]) / 3.0
    distant = distant_light(omega)
    view = camera(projection=Projection.ORTHOGRAPHIC, frame=(0.0, 1.0, 0.0, 1.0), filter_width=1e-6)
    view.matrix[2, 3] = 3.0
    ball = rooms.scene([rooms.ball(rounds=0)], albedo=[(1.0, 1.0, 1.0)])
    how = LookUp(directional=Directional.REPORT)
    picture = drain(shade_steps(ball, distant, view, 1, how))
    y, x = np.mgrid[0:8, 0:8] / 8 + 1 / 16
    inside = x + y < 0.99
    point = np.stack([x, y, 1.0 - x - y], axis=-1)
    cosine = point @ omega / np.linalg.norm(point, axis=-1)
    expected = cosine[..., None] * RADIANCE / np.pi
    np.testing.assert_allclose(picture.light[inside], expected[inside], rtol=1e-4)
    flat = rooms.scene([rooms.ball(rounds=0, smooth=False)], albedo=[(1.0, 1.0, 1.0)])
    even = drain(shade_steps(flat, distant, view, 1, how)).light[inside]
    np.testing.assert_allclose(
        even, np.broadcast_to(omega.sum() / np.sqrt(3) * RADIANCE / np.pi, even.shape), rtol=1e-4
    )


def test_textures_colour_the_light() -> None:
    scene = rooms.scene([wall(1.0)], albedo=[RHO])
    pixels = np.array([[[0.5, 1.0, 0.25]]], dtype=np.float32)
    textured = replace(
        scene,
        textures=(Texture("Paper", pixels),),
        materials=replace(scene.materials, texture=np.zeros(1, dtype=np.int32)),
    )
    picture = shade(textured)
    np.testing.assert_allclose(picture.light, np.broadcast_to(RHO * pixels * RADIANCE, (8, 8, 3)), rtol=1e-5)


@pytest.mark.parametrize(("part", "color"), [(wall(1.0), RHO), (rooms.box(LOW, HIGH), (0.5, 0.25, 0.125))])
def test_each_side_shows_its_own_colour(part: rooms.Part, color: np.ndarray) -> None:
    """The camera sees the wall's front, and a box from inside."""
    scene = rooms.scene([part], albedo=[RHO, (0.5, 0.25, 0.125)])
    two = replace(scene, materials=replace(scene.materials, back=np.array([1, 1], dtype=np.int32)))
    np.testing.assert_allclose(shade(two).color, np.broadcast_to(color, (8, 8, 3)), rtol=1e-5)


def test_the_number_of_threads_changes_no_bit() -> None:
    scene = rooms.scene([rooms.ball(rounds=2), rooms.box(LOW, HIGH, inward=True)], albedo=[RHO])
    view = camera(width=64, height=64, filter=PixelFilter.BLACKMAN_HARRIS, filter_width=1.5)
    one, two = shade(scene, view, threads=1), shade(scene, view, threads=2)
    np.testing.assert_array_equal(one.light, two.light)


def test_no_samples_are_refused() -> None:
    with pytest.raises(SettingsError, match="0 samples"):
        drain(shade_steps(rooms.scene([wall(1.0)]), uniform_light(), camera(), 0))


def test_it_can_be_stopped_between_steps() -> None:
    steps = shade_steps(rooms.scene([wall(1.0)]), uniform_light(), camera(width=128, height=128), 16)
    assert next(steps).fraction < 1.0
    steps.close()
