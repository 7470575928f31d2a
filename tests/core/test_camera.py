# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras send each sample of a pixel where Cycles would; `tests/blender/test_compare.py` asks Cycles itself."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ivg_addon.core.camera import Camera, PixelFilter, Projection, filter_offsets
from ivg_addon.core.camera_rays import camera_rays
from ivg_addon.core.errors import SettingsError

from . import rooms

TURN = rooms.rotation((1, 2, 3), 0.7)
PLACE = np.array([3.0, -1.0, 2.0])


def camera(projection: Projection = Projection.PERSPECTIVE, **changes: object) -> Camera:
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = TURN, PLACE
    values = {
        "name": "Camera",
        "matrix": matrix,
        "projection": projection,
        "frame": (-0.5, 0.7, -0.2, 0.4),
        "clip_start": 0.25,
        "clip_end": 8.0,
        "width": 6,
        "height": 3,
        "filter": PixelFilter.BOX,
        "filter_width": 1e-6,
    }
    return Camera(**{**values, **changes})


def at_centres() -> np.ndarray:
    """Return x and y in the frame of each pixel's centre, (18, 2), from the bottom left, row after row."""
    x, y = np.meshgrid(-0.5 + 1.2 * (np.arange(6) + 0.5) / 6, -0.2 + 0.6 * (np.arange(3) + 0.5) / 3)
    return np.stack([x.ravel(), y.ravel()], axis=1)


def test_perspective_rays_leave_the_near_plane_through_the_frame() -> None:
    origins, directions = camera_rays(camera(), 0, 18, samples=1)
    local = np.column_stack([at_centres(), -np.ones(18)])
    np.testing.assert_allclose(directions @ TURN, local, atol=2e-6)
    np.testing.assert_allclose((origins - PLACE) @ TURN, 0.25 * local, atol=2e-6)


def test_orthographic_rays_are_parallel() -> None:
    origins, directions = camera_rays(camera(Projection.ORTHOGRAPHIC), 0, 18, samples=1)
    np.testing.assert_allclose(directions @ TURN, np.tile([0.0, 0.0, -1.0], (18, 1)), atol=1e-6)
    np.testing.assert_allclose((origins - PLACE) @ TURN, np.column_stack([at_centres(), np.full(18, -0.25)]), atol=2e-6)


def test_a_distance_along_a_ray_is_a_depth() -> None:
    assert camera().reach == 7.75


@pytest.mark.parametrize("width", [0.5, 1.5, 3.0])
@pytest.mark.parametrize("kind", list(PixelFilter))
def test_offsets_invert_the_filters_distribution(kind: PixelFilter, width: float) -> None:
    x = filter_offsets(kind, width)
    np.testing.assert_allclose(distribution(kind, x, width), np.linspace(0.0, 1.0, len(x)), atol=2e-6)


def distribution(kind: PixelFilter, x: np.ndarray, width: float) -> np.ndarray:
    """Return a filter's distribution function in closed form."""
    if kind is PixelFilter.BOX:
        return x / width + 0.5
    if kind is PixelFilter.GAUSSIAN:
        erf = np.vectorize(math.erf)
        scaled = np.sqrt(8.0) * x / width
        return 0.5 + 0.5 * erf(scaled) / erf(np.sqrt(8.0) * 1.5)
    t = np.pi * x / width
    integral = 0.35875 * t + 0.48829 * np.sin(t) + 0.07064 * np.sin(2 * t) + 0.01168 / 3 * np.sin(3 * t)
    return 0.5 + integral / (2 * np.pi * 0.35875)


def test_samples_follow_the_filter() -> None:
    """The mean over a low-discrepancy sequence is within its discrepancy, below 1/√n, of the filter's own."""
    wide = camera(filter=PixelFilter.BLACKMAN_HARRIS, filter_width=1.5)
    samples = 4096
    _, directions = camera_rays(wide, 7 * samples, samples, samples)
    across = (directions @ TURN)[:, :2]
    pixels = (across - [-0.5, -0.2]) / [0.2, 0.2] - [1.5, 1.5]  # pixel 7 is the second of the second row
    assert np.abs(pixels).max() <= 1.5
    np.testing.assert_allclose(pixels.mean(axis=0), 0.0, atol=1.5 / 64)
    variance = np.interp(np.linspace(0, 1, 100_001), np.linspace(0, 1, 1025), wide.offsets).var()
    np.testing.assert_allclose(pixels.var(axis=0), variance, atol=1.5**2 / 64)


def test_rays_do_not_depend_on_how_they_are_batched() -> None:
    whole = camera_rays(camera(filter_width=1.5), 0, 18 * 4, samples=4, seed=5)
    part = camera_rays(camera(filter_width=1.5), 30, 11, samples=4, seed=5)
    for all_rays, some in zip(whole, part, strict=True):
        np.testing.assert_array_equal(all_rays[30:41], some)


@pytest.mark.parametrize(
    "wrong", [{"width": 0}, {"frame": (1.0, 1.0, 0.0, 1.0)}, {"clip_start": 9.0}, {"clip_start": -1.0}]
)
def test_cameras_that_see_nothing_are_refused_by_name(wrong: dict[str, object]) -> None:
    with pytest.raises(SettingsError, match="camera 'Camera'"):
        camera(**wrong)
