# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials with lobes, and photons that meet one of them."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ivg_addon.core.landings import Landings
from ivg_addon.core.lobe_scattering import scatter_at_lobes
from ivg_addon.core.scattering import ENERGY_STEPS, scatter
from ivg_addon.core.scene import NO_TEXTURE, NONE, VIEW_STEPS, Lobes, Scene
from ivg_addon.core.surface_bins import SurfaceBins
from ivg_addon.core.surfaces import Surfaces

from .rooms import Part, scene

Float64 = NDArray[np.float64]


def lobe(
    kind: int,
    color: ArrayLike = 1.0,
    second: ArrayLike = 1.0,
    *,
    material: int = 0,
    roughness: float = 0.0,
    ior: float = 1.5,
    fresnel: int = NONE,
    multiscatter: bool = False,
    weight: ArrayLike = 1.0,
    color_texture: int = NO_TEXTURE,
    roughness_texture: int = NO_TEXTURE,
    view: ArrayLike = 1.0,
    edge: ArrayLike = 0.0,
    bump: int = 0,
    normal: ArrayLike = (0.0, 0.0, 1.0),
) -> Lobes:
    """Return one lobe; `view` broadcasts to (VIEW_STEPS, 3)."""

    def row(value: ArrayLike, dtype: type = np.float32) -> NDArray[np.generic]:
        return np.array([value], dtype=dtype)

    def colour(value: ArrayLike) -> NDArray[np.float32]:
        return np.broadcast_to(np.asarray(value, dtype=np.float32), (1, 3)).copy()

    return Lobes(
        material=row(material, np.int32),
        kind=row(kind, np.int32),
        color=colour(color),
        color_texture=row(color_texture, np.int32),
        second=colour(second),
        second_texture=row(NO_TEXTURE, np.int32),
        roughness=row(roughness),
        roughness_texture=row(roughness_texture, np.int32),
        ior=row(ior),
        fresnel=row(fresnel, np.int32),
        multiscatter=row(multiscatter, np.bool_),
        weight=colour(weight),
        edge=colour(edge),
        bump=row(bump, np.int32),
        normal=colour(normal),
        normal_texture=row(NO_TEXTURE, np.int32),
        view=np.broadcast_to(np.asarray(view, dtype=np.float32), (1, VIEW_STEPS, 3)).copy(),
    )


def with_lobes(of: Scene, *lobes: Lobes, back: ArrayLike | None = None) -> Scene:
    """Return a scene with lobes, one each and in the order of their materials, and back sides."""
    columns = {f.name: np.concatenate([getattr(each, f.name) for each in lobes]) for f in fields(Lobes)}
    sides = None if back is None else np.array(back, dtype=np.int32)
    return replace(of, materials=replace(of.materials, lobes=Lobes(**columns), back=sides))


def plate(shading: ArrayLike = (0, 0, 1), visible: bool = True) -> Part:
    """Return a large triangle in the plane z = 0, its front up, with one shading normal all over."""
    corners = np.array([(-10.0, -10, 0), (20, -10, 0), (-10, 20, 0)])
    normals = np.broadcast_to(np.asarray(shading, dtype=np.float64), (1, 3, 3))
    return Part(corners, np.array([[0, 1, 2]]), corner_normals=normals, visible=visible)


@dataclass(frozen=True)
class Outcome:
    """What became of n photons; energies (3, 3) and counts (2 sides) per photon."""

    photons: NDArray[np.int64]
    origins: Float64
    directions: Float64
    weights: Float64
    bounces: NDArray[np.int16]
    energy: Float64
    counts: Float64


def meet(
    of: Scene,
    arrival: Float64,
    seed: int = 0,
    weight: ArrayLike = 1.0,
    *,
    flight: int = 0,
    bounced: int = 0,
    most: int = 12,
    dark: float = 0.0,
) -> Outcome:
    """Let photons fly along `arrival` (n, 3) to points of the scene's first triangle."""
    n = len(arrival)
    u, v = np.random.default_rng(seed).uniform(0.2, 0.4, (2, n)).astype(np.float32)
    bins = SurfaceBins.of(of.geometry, np.inf)
    photons, triangle = np.arange(n, dtype=np.int64), np.zeros(n, dtype=np.int32)
    weights = np.broadcast_to(np.asarray(weight, dtype=np.float32), (n, 3)).copy()
    flights = (photons, np.zeros((n, 3), dtype=np.float32), np.array(arrival, dtype=np.float32), weights)
    state = (np.full(n, bounced, dtype=np.int16), np.full(n, dark, dtype=np.float32), np.ones(1, dtype=np.float32))
    landings, energy = Landings(bins), np.zeros((3, 3), dtype=np.int64)
    landed, brought = np.empty(2 * n, dtype=np.int64), np.empty((2 * n, 3), dtype=np.float32)
    sums = (1, landed, brought, energy, np.empty((n, 2), dtype=np.int32))
    rest = (triangle, u, v, seed, flight, most, Surfaces.of(of, bins), *sums)
    alive, arrivals = scatter_at_lobes(*flights, *state, *rest, *scatter(*flights, *state, *rest))
    landings.receive(landed[:arrivals], brought[:arrivals])
    p, o, d, w = (each[:alive] for each in flights)
    o, d, w = (each.astype(np.float64) for each in (o, d, w))
    return Outcome(p, o, d, w, state[0][:alive], energy / (ENERGY_STEPS * n), landings.counts.sum(axis=0) / n)


def surface(*lobes: Lobes, albedo: ArrayLike = (0.0, 0.0, 0.0), shading: ArrayLike = (0, 0, 1)) -> Scene:
    """Return `plate` with a material."""
    return with_lobes(scene([plate(shading)], (albedo,)), *lobes)


def arriving(cosine: float, n: int, azimuth: float = 0.7) -> Float64:
    """Return n photons' direction towards the front at this cosine (negative: towards the back)."""
    sine = np.sqrt(1 - cosine**2)
    return np.tile([-sine * np.cos(azimuth), -sine * np.sin(azimuth), -cosine], (n, 1))


def uniform_field(n: int, seed: int) -> Float64:
    """Return directions of photons that a uniform field sends to the front."""
    rng = np.random.default_rng(seed)
    sine, angle = np.sqrt(rng.random(n)), 2 * np.pi * rng.random(n)
    return np.stack([sine * np.cos(angle), sine * np.sin(angle), -np.sqrt(1 - sine**2)], axis=1)
