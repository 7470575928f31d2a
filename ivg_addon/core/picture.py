# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of the scene, lit by the grid alone: what Cycles' diffuse indirect light is held against."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Generator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .camera import Camera
from .camera_rays import camera_rays
from .compiled import kernel
from .embree import Tracer
from .errors import SettingsError
from .grid import DEFAULT_NORMAL_BIAS, IrradianceVectorGrid
from .progress import Progress
from .scene import Float32, Scene
from .seen_surfaces import DiffuseView
from .settings import Directional, Spatial
from .surface_bins import SurfaceBins
from .surfaces import Surfaces

Float64 = NDArray[np.float64]

_BATCH = 1 << 15
"""Rays that are shaded together; a look-up of so many points uses no further threads."""


@dataclass(frozen=True)
class LookUp:
    """How the grid is looked up; see `IrradianceVectorGrid.irradiance`."""

    spatial: Spatial = Spatial.TRILINEAR
    directional: Directional = Directional.LEAST_SQUARES
    normal_bias: float = DEFAULT_NORMAL_BIAS


@dataclass(frozen=True)
class Picture:
    """Diffusely reflected indirect light; arrays start with the row at the bottom.

    Parameters
    ----------
    light : (height, width, 3) float32
        Radiance ρ E/π that reaches the camera, W/(m² sr), mean over the pixel.
    color : (height, width, 3) float32
        Diffuse reflectance ρ towards the camera, mean over the pixel; zero where nothing is seen.
    coverage : (height, width) float32
        Share of the pixel in which there is a surface, a transparent one or another.
    """

    light: Float32
    color: Float32
    coverage: Float32

    @property
    def indirect(self) -> Float32:
        """Return light without colour, (height, width, 3): Cycles' Diffuse Indirect pass."""
        return np.divide(self.light, self.color, out=np.zeros_like(self.light), where=self.color > 0)


def shade_steps(
    scene: Scene,
    grid: IrradianceVectorGrid,
    camera: Camera,
    samples: int,
    look_up: LookUp | None = None,
    *,
    seed: int = 0,
    threads: int = 0,
    visible: NDArray[np.bool_] | None = None,
) -> Generator[Progress, None, Picture]:
    """Shade what a camera sees by the grid; yields as it goes, returns a `Picture`.

    At a surface on a camera ray the reflected indirect light is Σ ρ E(p, n)/π over its diffuse lobes, as
    `seen_surfaces` tells. Rays pass up to 8 transparent surfaces.

    Parameters
    ----------
    samples
        Rays per pixel.
    threads
        0 means one per processor.
    visible : (objects,) bool, optional
        Which of `Scene.objects` camera rays see; all by default.

    Raises
    ------
    SettingsError
        Fewer than one sample.
    """
    if samples < 1:
        raise SettingsError(f"{samples} samples per pixel show nothing: use 1 or more")
    look_up = look_up or LookUp()
    keep = None if visible is None else visible[scene.geometry.object]
    tracer = Tracer(scene.geometry, keep)
    view = DiffuseView(Surfaces.of(scene, SurfaceBins.of(scene.geometry, np.inf)))
    _irradiance(grid, np.zeros((1, 3)), np.eye(1, 3), look_up)  # what a grid prepares once, before there are threads
    pixels = camera.width * camera.height
    per_batch = max(1, _BATCH // samples)
    sums = np.zeros((pixels, 7), dtype=np.float32)

    def shade(pixel: int) -> None:
        count = min(per_batch, pixels - pixel)
        of = sums[pixel : pixel + count]
        rays = camera_rays(camera, pixel * samples, count * samples, samples, seed)
        for passed, seen in enumerate(view.along(tracer, *rays, camera.reach)):
            if passed == 0:
                of[:, 6] = np.bincount(seen.met // samples, minlength=count)
            facing = seen.facing if view.has_bumps else None
            light = _irradiance(grid, seen.points, seen.normals, look_up, facing)
            add_up(seen.ray, samples, light, seen.reflectance, of)

    starts = range(0, pixels, per_batch)
    with ThreadPoolExecutor(threads or os.cpu_count(), thread_name_prefix="ivg-picture") as pool:
        futures = [pool.submit(shade, pixel) for pixel in starts]
        try:
            futures[0].result()  # compiles, once after installing: that says nothing of how long the others take
            start = time.perf_counter()
            for done, future in enumerate(futures):
                future.result()
                left = (time.perf_counter() - start) * (len(starts) - done) / done if done else None
                yield Progress("Shading from the grid", (done + 1) / len(starts), left)
        finally:
            for future in futures:
                future.cancel()
    return _picture(sums / np.float32(samples), camera)


def _irradiance(
    grid: IrradianceVectorGrid, points: Float64, normals: Float64, how: LookUp, facing: Float64 | None = None
) -> Float32:
    return grid.irradiance(points, normals, how.spatial, how.directional, how.normal_bias, facing)


def _picture(means: Float32, camera: Camera) -> Picture:
    """Divide (pixels, 7) into light, colour and coverage."""
    image = means.reshape(camera.height, camera.width, 7)
    return Picture(
        light=np.ascontiguousarray(image[..., 0:3]),
        color=np.ascontiguousarray(image[..., 3:6]),
        coverage=np.ascontiguousarray(image[..., 6]),
    )


@kernel
def add_up(ray, samples, irradiance, reflectance, sums):
    """Add ρ E/π and ρ to the pixels, sums (pixels, 7) float32, of the rays `ray` (indices)."""
    for row in range(len(ray)):
        pixel = ray[row] // samples
        for c in range(3):
            sums[pixel, c] += np.float32(irradiance[row, c] * reflectance[row, c] / math.pi)
            sums[pixel, 3 + c] += np.float32(reflectance[row, c])
