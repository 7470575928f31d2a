# SPDX-License-Identifier: GPL-3.0-or-later
"""What the tests of emission share: scenes made of arrays, photons, and the two statistical tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ivg_addon.core.emission import Emission, prepare_emission
from ivg_addon.core.lights import Lights
from ivg_addon.core.scene import Geometry, Materials, Scene

Float64 = NDArray[np.float64]

PHOTONS = 1 << 18
LARGEST_Z = 5.0
"""Both tests below are one statistic that is normal if the code is right: a false alarm comes in at most
6 of 10 million runs with a new seed."""


def array(*rows: object) -> NDArray[np.float32]:
    """Return float32 rows."""
    return np.array(rows, dtype=np.float32)


def scene(lights: Lights | None = None, geometry: Geometry | None = None, emission: object = ()) -> Scene:
    """Return a scene; `emission` (m, 3) are the radiances of its materials."""
    radiance = np.array(emission, dtype=np.float32).reshape(-1, 3)
    count = len(radiance)
    materials = Materials(
        names=tuple(f"Material {i}" for i in range(count)),
        albedo=np.zeros((count, 3), dtype=np.float32),
        texture=np.full(count, -1, dtype=np.int32),
        emission=radiance,
    )
    geometry = mesh([], [], []) if geometry is None else geometry
    objects = int(geometry.object.max(initial=-1)) + 1
    return Scene(
        name="Test",
        geometry=geometry,
        materials=materials,
        textures=(),
        lights=Lights.none() if lights is None else lights,
        objects=tuple(f"Object {i}" for i in range(objects)),
        diffuse_visible=np.ones(objects, dtype=np.bool_),
    )


def mesh(vertices: object, triangles: object, materials: object) -> Geometry:
    """Return a geometry of one object; what emission does not read is zero."""
    indices = np.array(triangles, dtype=np.int32).reshape(-1, 3)
    count = len(indices)
    return Geometry(
        vertices=np.array(vertices, dtype=np.float32).reshape(-1, 3),
        triangles=indices,
        corner_normals=np.zeros((count, 3, 3), dtype=np.float32),
        uvs=np.zeros((count, 3, 2), dtype=np.float32),
        material=np.array(materials, dtype=np.int32),
        object=np.zeros(count, dtype=np.int32),
    )


@dataclass(frozen=True)
class Photons:
    """Photons of one emission: (n, 3) origins, directions and fluxes in W, (n,) dark distances."""

    emission: Emission
    origins: Float64
    directions: Float64
    flux: Float64
    dark: Float64


def photons(
    of: Scene, low: object = (-2, -2, -2), high: object = (2, 2, 2), n: int = PHOTONS, seed: int = 1
) -> Photons:
    """Emit n photons; their `flux` sums up to the power."""
    emission = prepare_emission(of, array(*low), array(*high))
    origins, directions, weights = (np.empty((n, 3), dtype=np.float32) for _ in range(3))
    dark = np.empty(n, dtype=np.float32)
    emission.emit(seed, 0, origins, directions, weights, dark)
    return Photons(
        emission=emission,
        origins=origins.astype(np.float64),
        directions=directions.astype(np.float64),
        flux=weights.astype(np.float64) * (emission.flux_scale / n),
        dark=dark.astype(np.float64),
    )


def assert_distribution(observed: Float64, probability: Float64) -> None:
    """Pearson's chi-square test of counts against bin probabilities, which must sum up to one.

    χ² with k degrees of freedom becomes normal by Wilson & Hilferty, PNAS 17, 1931, which is close in the tail
    too for a dozen bins or more.
    """
    expected = observed.sum() * probability.ravel()
    np.testing.assert_allclose(probability.sum(), 1.0, rtol=1e-6)
    assert expected.min() > 10.0
    chi2 = float(((observed.ravel() - expected) ** 2 / expected).sum())
    k = len(expected) - 1
    z = ((chi2 / k) ** (1 / 3) - (1 - 2 / (9 * k))) / np.sqrt(2 / (9 * k))
    assert z < LARGEST_Z, f"chi-square {chi2:.0f} of {k} degrees of freedom"


def assert_flux(light: Photons, hits: NDArray[np.bool_], truth: object) -> None:
    """z-test per channel of the watts that the photons with `hits` (n,) bring."""
    received = light.flux * hits[:, None]
    total = received.sum(axis=0)
    expected = np.broadcast_to(np.asarray(truth, dtype=np.float64), 3)
    # Where too little is expected for a single photon, the standard error is that of a Poisson count.
    variance = np.maximum(len(hits) * received.var(axis=0), 0.0 if total.any() else expected * light.flux.max(axis=0))
    error = np.sqrt(np.maximum(variance, 1e-60))
    z = (total - expected) / error
    assert np.abs(z).max() < LARGEST_Z, f"{total} W, not {truth} W, standard error {error} W"


def assert_total(light: Photons) -> None:
    """z-test of all photons together against the power of all emitters."""
    assert_flux(light, np.ones(len(light.flux), dtype=np.bool_), light.emission.power)


def through(light: Photons, center: object, axis: int, half: tuple[float, float], sign: float) -> NDArray[np.bool_]:
    """Tell which photons cross a rectangle across `axis` in direction `sign`, carrying light.

    `half` are half of its sides along the other two axes, in cyclic order after `axis`.
    """
    center_ = np.asarray(center, dtype=np.float64)
    d = light.directions[:, axis]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (center_[axis] - light.origins[:, axis]) / d
        hit = light.origins + t[:, None] * light.directions - center_
        u, v = hit[:, (axis + 1) % 3], hit[:, (axis + 2) % 3]
        crosses: NDArray[np.bool_] = (t > light.dark) & (np.abs(u) < half[0]) & (np.abs(v) < half[1]) & (d * sign > 0.0)
    return crosses


def histogram(*samples: tuple[Float64, Float64]) -> Float64:
    """Return counts per bin of several quantities at once, each given with its bins' edges."""
    values = np.stack([value for value, _ in samples], axis=1)
    return np.histogramdd(values, bins=[edges for _, edges in samples])[0]


def azimuth(x: Float64, y: Float64) -> Float64:
    """Return the angle of (x, y) in turns, 0 to 1."""
    return np.arctan2(y, x) / (2 * np.pi) % 1.0
