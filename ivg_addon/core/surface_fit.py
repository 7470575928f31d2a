# SPDX-License-Identifier: GPL-3.0-or-later
"""What is added to the interpolated values so that look-ups at surfaces tell what photons brought there.

Look-ups are linear, E = C x, in the values x of the vertices. These come from means over cells (prefilter.py), which
say little about where in a cell the light is, and from six vectors, exact for radiance of low degree only. At
surfaces the irradiance e is known besides: flux over area, free of both errors. So x is changed by the δ that minimises

    Σ_s A_s/h² (e_s − C_s (x + δ))² + RIDGE Σ_v |δ_v|²/τ_v²

over samples s of the area A_s (surface_samples.py), h² the mean face of a voxel. |δ|² is the mean square, over all
normals, of the irradiance that δ adds: between all changes that suit the surfaces, the one that changes least what
things in the air receive. τ_v² = 1 + `TRUST` (1 − validity): means of cells that geometry cuts tell less. The normal
equations are solved by conjugate gradients (Hestenes & Stiefel, 1952), from δ = 0.
"""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray

from .grid import IrradianceVectorGrid
from .lit_volume import LightKnowledge
from .moments import moments
from .progress import Progress, part
from .readings import MOMENTS, Readings, moment_coefficients
from .scene import Float32
from .settings import Spatial
from .surface_samples import TASK, SurfaceSamples, surface_sample_steps
from .surfaces import Surfaces

Float64 = NDArray[np.float64]

RIDGE = 1.0
TRUST = 18.0
STEPS = 30
"""Of conjugate gradients, at most."""
_SETTLED = 1e-3
"""Of the first residual's norm."""
_NORMALS = 4096


def fit_steps(
    grid: IrradianceVectorGrid,
    knowledge: LightKnowledge,
    surfaces: Surfaces,
    received: Float32,
    flux_scale: float,
    threads: int,
) -> Generator[Progress, None, tuple[NDArray[np.int32], NDArray[np.float32]]]:
    """Fit a grid to the light that its surfaces received; yields as it goes.

    Parameters
    ----------
    received : (patches, 2, 3) float32
        The grid's light that arrived at each side of each patch, in units of `flux_scale` watts.
    threads
        0 for one per processor.

    Returns
    -------
    vertices : (k,) int32
        That are corrected.
    corrections : (k, 12, 3) float32
        δ, in moments.
    """
    asked = knowledge.of_bright_places(), surfaces, received, flux_scale, grid.lattice, grid.irradiance
    samples = yield from part(surface_sample_steps(*asked, threads), 0.0, 0.3)
    basis = even_basis()
    readings, vertices = Readings.of(grid, samples.points, samples.normals, basis).compact()
    change = np.zeros((len(vertices), MOMENTS, 3))
    for step, current in enumerate(_solve(grid, readings, vertices, samples, basis)):
        change = current
        yield Progress(TASK, 0.4 + 0.6 * step / STEPS)
    yield Progress(TASK, 1.0)
    largest = float(np.finfo(np.float32).max)
    corrections = np.clip(np.einsum("mk,vkc->vmc", basis, change), -largest, largest).astype(np.float32)
    changed = corrections.any(axis=(1, 2))
    return vertices[changed].astype(np.int32), corrections[changed]


def even_basis() -> Float64:
    """Return coordinates of the twelve moments, (12, 12), whose squares add up to the mean square irradiance."""
    # A spiral over the sphere (Vogel 1979): even, and without a random number.
    turn = np.arange(_NORMALS) + 0.5
    z, angle = 1.0 - 2.0 * turn / _NORMALS, np.pi * (1.0 + np.sqrt(5.0)) * turn
    sine = np.sqrt(1.0 - z * z)
    c = moment_coefficients(np.stack([sine * np.cos(angle), sine * np.sin(angle), z], axis=1))
    squares, axes = np.linalg.eigh(c.T @ c / _NORMALS)
    return np.asarray(axes / np.sqrt(squares))


def _solve(
    grid: IrradianceVectorGrid, readings: Readings, vertices: NDArray[np.int64], samples: SurfaceSamples, basis: Float64
) -> Generator[Float64, None, None]:
    """Yield δ of the vertices, (k, 12, 3) in even coordinates, after each step; the three channels by themselves."""
    weight = (samples.area / np.prod(grid.lattice.voxel_size) ** (2.0 / 3.0))[:, None]
    validity = grid.validity.reshape(-1)[vertices].astype(np.float64)
    ridge = (RIDGE / (1.0 + TRUST * (1.0 - validity)))[:, None, None]
    values = moments(grid.interpolated(Spatial.TRILINEAR).reshape(-1, 6, 3, 3)[vertices])
    coordinates = np.einsum("km,vmc->vkc", np.linalg.inv(basis), values)
    missing = samples.irradiance - readings.irradiance(coordinates)
    change = np.zeros((len(ridge), MOMENTS, 3))
    residual = readings.transposed(weight * missing)
    direction, norm = residual.copy(), (residual**2).sum(axis=(0, 1))
    settled = _SETTLED**2 * norm
    for _ in range(STEPS):
        if (norm <= settled).all():
            return
        image = readings.transposed(weight * readings.irradiance(direction)) + ridge * direction
        along = (direction * image).sum(axis=(0, 1))
        step = np.where(norm > settled, norm / np.where(along > 0.0, along, 1.0), 0.0)
        change += step * direction
        residual -= step * image
        before, norm = norm, (residual**2).sum(axis=(0, 1))
        direction = residual + np.where(before > 0.0, norm / np.where(before > 0.0, before, 1.0), 0.0) * direction
        yield change
