# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of the scene, lit by the grid alone: what Cycles' diffuse indirect light is held against."""

from __future__ import annotations

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
from .embree import MISS, Tracer
from .errors import SettingsError
from .grid import DEFAULT_NORMAL_BIAS, IrradianceVectorGrid
from .progress import Progress
from .scene import NO_TEXTURE, Float32, Scene
from .settings import Directional, Spatial
from .surface_bins import SurfaceBins
from .surfaces import Surfaces, corner, place_at, shading_normal, texture_coordinates
from .textures import surface_albedo

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
        Diffuse reflectance ρ, mean over the pixel; zero where nothing is seen.
    coverage : (height, width) float32
        Share of the pixel in which a surface is seen.
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

    At the first surface on a camera ray the reflected indirect light is ρ E(p, n)/π, n the shading normal on the side
    that faces the camera.

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
    surfaces = Surfaces.of(scene, SurfaceBins.of(scene.geometry, np.inf))
    _irradiance(grid, np.zeros((1, 3)), np.eye(1, 3), look_up)  # what a grid prepares once, before there are threads
    pixels = camera.width * camera.height
    per_batch = max(1, _BATCH // samples)
    sums = np.zeros((pixels, 7), dtype=np.float32)

    def shade(pixel: int) -> None:
        count = min(per_batch, pixels - pixel)
        origins, directions = camera_rays(camera, pixel * samples, count * samples, samples, seed)
        hits = tracer.intersect(origins, directions)
        triangle = np.where(hits.distance <= camera.reach, hits.triangle, MISS)
        seen = np.flatnonzero(triangle != MISS)
        points, normals, albedo = np.empty((len(seen), 3)), np.empty((len(seen), 3)), np.empty((len(seen), 3))
        meet(seen, directions, triangle, hits.u, hits.v, surfaces, points, normals, albedo)
        light = _irradiance(grid, points, normals, look_up) * albedo / np.pi if len(seen) else albedo
        add_up(seen, samples, light, albedo, sums[pixel : pixel + count])

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
    grid: IrradianceVectorGrid, points: NDArray[np.float64], normals: NDArray[np.float64], how: LookUp
) -> NDArray[np.float32]:
    return grid.irradiance(points, normals, how.spatial, how.directional, how.normal_bias)


def _picture(means: Float32, camera: Camera) -> Picture:
    """Divide (pixels, 7) into light, colour and coverage."""
    image = means.reshape(camera.height, camera.width, 7)
    return Picture(
        light=np.ascontiguousarray(image[..., 0:3]),
        color=np.ascontiguousarray(image[..., 3:6]),
        coverage=np.ascontiguousarray(image[..., 6]),
    )


@kernel
def meet(seen, directions, triangle, hit_u, hit_v, surfaces, points, normals, albedo):
    """Fill points, normals and albedo (seen, 3) float64 with what the rays `seen` (indices) meet.

    Normals are shading normals, turned to the side that the ray comes from.
    """
    vertices, triangles = surfaces.vertices, surfaces.triangles
    for row in range(len(seen)):
        ray = seen[row]
        t, u, v = triangle[ray], hit_u[ray], hit_v[ray]
        p = corner(vertices, triangles, t, 0)
        q = corner(vertices, triangles, t, 1)
        r = corner(vertices, triangles, t, 2)
        x, y, z = surfaces.planes[t, 0], surfaces.planes[t, 1], surfaces.planes[t, 2]
        away = directions[ray, 0] * x + directions[ray, 1] * y + directions[ray, 2] * z > 0.0
        if surfaces.smooth[t]:
            sx, sy, sz = shading_normal(surfaces.corner_normals, t, u, v)
            if sx != 0.0 or sy != 0.0 or sz != 0.0:
                x, y, z = sx, sy, sz
        side = -1.0 if away else 1.0
        normals[row, 0], normals[row, 1], normals[row, 2] = side * x, side * y, side * z
        points[row, 0], points[row, 1], points[row, 2] = place_at(p, q, r, u, v)
        # The textures' arrays are touched only where there is one: Numba counts references to them.
        m = surfaces.back[surfaces.material[t]] if away else surfaces.material[t]
        rho = (float(surfaces.albedo[m, 0]), float(surfaces.albedo[m, 1]), float(surfaces.albedo[m, 2]))
        if surfaces.texture[m] != NO_TEXTURE:
            a, b = texture_coordinates(surfaces.uvs, t, u, v)
            rho = surface_albedo(m, a, b, surfaces.albedo, surfaces.texture, surfaces.pool)
        albedo[row, 0], albedo[row, 1], albedo[row, 2] = rho


@kernel
def add_up(seen, samples, light, albedo, sums):
    """Add light, albedo and one to the pixels, sums (pixels, 7) float32, of the rays `seen` (indices)."""
    for row in range(len(seen)):
        pixel = seen[row] // samples
        for c in range(3):
            sums[pixel, c] += light[row, c]
            sums[pixel, 3 + c] += albedo[row, c]
        sums[pixel, 6] += 1.0
