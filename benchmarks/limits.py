# SPDX-License-Identifier: GPL-3.0-or-later
"""How near any grid of a size could come: `python -m benchmarks.limits [--points N] [--fine N] [--voxels N] [SCENE …]`.

Look-ups are linear in the vertices' vectors. So the vectors that suit them best can be found, given the truth at many
places: by least squares, over points and normals at random in lit free space. The truth is a much finer grid's there;
how near both come is measured with Cycles at other points, as `benchmarks.accuracy` does. What is left of the error
with the best vectors is what trilinear look-ups on so many vertices cannot say; what they gain over the baked ones is
what another bake could gain at most.

Medians are over draws of 1,000 of the points: few points decide the mean square. Six minutes on two cores.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ivg_addon.core.bake import bake
from ivg_addon.core.compiled import kernel
from ivg_addon.core.grid import DEFAULT_NORMAL_BIAS, IrradianceVectorGrid
from ivg_addon.core.look_up import is_divided, leave_to_speakers, stencil, step_back, weigh
from ivg_addon.core.look_up_rules import WITHIN
from ivg_addon.core.metrics import compare
from ivg_addon.core.progress import finish
from ivg_addon.core.reconstruction import LEAST_SQUARES, directional_coefficients
from ivg_addon.core.sample_points import LitBox, Places, find_light_steps, free_space_points, surface_points
from ivg_addon.core.settings import BakeSettings, Spatial
from ivg_addon.core.vectors import unit

from .accuracy import AT_POINTS, bounds, open_scene, truth_at

Float64 = NDArray[np.float64]

_DRAWN, _DRAWS = 1000, 1000
_STEPS = 25
"""Of conjugate gradients; the error at points that were not fitted has settled by then."""
_RIDGE = 0.3
"""Points that the baked vectors count for, each: vertices that hardly a point asks keep theirs."""


@dataclass(frozen=True)
class Readings:
    """What look-ups at n places read: E = Σ_i w_i Σ_m c_m x_im over vertices i and the 18 components m of x.

    Parameters
    ----------
    vertices : (n, 8) int64, weights : (n, 8), coefficients : (n, 18)
    """

    vertices: NDArray[np.int64]
    weights: Float64
    coefficients: Float64

    @classmethod
    def of(cls, grid: IrradianceVectorGrid, places: Places) -> Readings:
        """Return those of a grid's trilinear least-squares look-ups."""
        n = len(places.points)
        readings = cls(np.zeros((n, 8), dtype=np.int64), np.zeros((n, 8)), np.zeros((n, 18)))
        parts, lattice = grid.partitions, grid.lattice
        read(
            *(places.points, places.normals, grid.validity.reshape(-1), parts.start, parts.planes),
            *(grid.bounds_min, lattice.voxel_size, np.asarray(lattice.shape, dtype=np.int64)),
            *(DEFAULT_NORMAL_BIAS, readings.vertices, readings.weights, readings.coefficients),
        )
        return readings

    def irradiance(self, x: Float64) -> Float64:
        """Return E (n,) of vectors x (vertices, 18)."""
        out = np.empty(len(self.weights))
        gather(self.vertices, self.weights, self.coefficients, x, out)
        return out

    def transposed(self, e: Float64, vertices: int) -> Float64:
        """Return what the transposed map makes of e (n,): (vertices, 18)."""
        out = np.zeros((vertices, 18))
        scatter(self.vertices, self.weights, self.coefficients, e, out)
        return out


@kernel
def read(points, normals, validity, start, planes, low, voxel, counts, bias, vertices, weights, coefficients):
    """Fill the arrays of `Readings`: the steps of trilinear look-ups (`look_up.py`)."""
    base, w, g, here = np.empty(3, dtype=np.int64), np.empty((3, 4)), np.empty(3), np.empty(3)
    c = np.empty((6, 3))
    for q in range(len(points)):
        n = unit(normals[q, 0], normals[q, 1], normals[q, 2])
        at, share = vertices[q], weights[q]
        for axis in range(3):
            g[axis] = min(max((points[q, axis] - low[axis]) / voxel[axis], 0.0), counts[axis] - 1.0)
        stencil(g, counts, 2, base, w)
        unlit = weigh(validity, counts, 2, base, w, at, share)
        divided = len(planes) > 0 and is_divided(start, at, share, 8)
        if divided and step_back(start, planes, g, n, counts, at, share, 8):
            stencil(g, counts, 2, base, w)
            unlit = weigh(validity, counts, 2, base, w, at, share)
        here[:] = g
        for axis in range(3):
            ends = (base[axis] + WITHIN, base[axis] + 1.0 - WITHIN) if divided else (0.0, counts[axis] - 1.0)
            g[axis] = min(max(here[axis] + bias * unlit * n[axis], ends[0]), ends[1])
        stencil(g, counts, 2, base, w)
        weigh(validity, counts, 2, base, w, at, share)
        if divided:
            leave_to_speakers(start, planes, here, n, at, share, 8)
        share /= max(share.sum(), 1e-300)
        directional_coefficients(LEAST_SQUARES, n, c)
        coefficients[q] = c.reshape(18)


@kernel
def gather(vertices, weights, coefficients, x, out):
    """Fill out (n,) with the readings of vectors x."""
    for q in range(len(out)):
        e = 0.0
        for i in range(8):
            for m in range(18):
                e += weights[q, i] * coefficients[q, m] * x[vertices[q, i], m]
        out[q] = e


@kernel
def scatter(vertices, weights, coefficients, e, out):
    """Add to out (vertices, 18) what `gather` reads of it, times e (n,)."""
    for q in range(len(e)):
        for i in range(8):
            for m in range(18):
                out[vertices[q, i], m] += weights[q, i] * e[q] * coefficients[q, m]


def best_vectors(grid: IrradianceVectorGrid, places: Places, truth: Float64) -> Float64:
    """Return the vectors, (vertices, 18 components, 3 channels), whose look-ups are nearest to the truth (n, 3).

    Conjugate gradients for the normal equations, from the baked ones.
    """
    readings = Readings.of(grid, places)
    baked = baked_vectors(grid)
    found = np.empty_like(baked)
    for channel in range(3):
        start = np.ascontiguousarray(baked[..., channel])
        change = np.zeros_like(start)
        residual = readings.transposed(truth[:, channel] - readings.irradiance(start), len(start))
        direction, norm = residual.copy(), float((residual**2).sum())
        for _ in range(_STEPS):
            image = readings.transposed(readings.irradiance(direction), len(start)) + _RIDGE * direction
            step = norm / float((direction * image).sum())
            change += step * direction
            residual -= step * image
            before, norm = norm, float((residual**2).sum())
            direction = residual + norm / before * direction
        found[..., channel] = start + change
    return found


def require_same(grid: IrradianceVectorGrid, places: Places) -> None:
    """Raise `AssertionError` unless readings are what look-ups read; rounding may take a few to another voxel."""
    vectors, readings = baked_vectors(grid), Readings.of(grid, places)
    found = np.stack([readings.irradiance(np.ascontiguousarray(vectors[..., c])) for c in range(3)], axis=1)
    expected = grid.irradiance(places.points, places.normals)
    off = np.abs(np.maximum(found, 0.0) - expected).max(axis=1) > 1e-4 * expected.mean()
    assert off.mean() < 1e-3, "look-ups have changed: so must this"


def baked_vectors(grid: IrradianceVectorGrid) -> Float64:
    """Return what a grid's look-ups interpolate, (vertices, 18 components, 3 channels)."""
    vectors = grid.interpolated(Spatial.TRILINEAR).reshape(-1, 6, 3, 3)
    return vectors.transpose(0, 1, 3, 2).reshape(-1, 18, 3).astype(np.float64)


def main() -> int:
    """Fit, compare and print a table; return the exit status."""
    parser = argparse.ArgumentParser(description="Tell how near any grid of a size could come to Cycles.")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=f"of {', '.join(AT_POINTS)}; default all")
    parser.add_argument("--points", type=int, default=12_000, help="points of either kind (default 12000)")
    parser.add_argument("--samples", type=int, default=1024, help="Cycles' paths per point (default 1024)")
    parser.add_argument("--fitted", type=int, default=1_000_000, help="points that are fitted (default 1000000)")
    parser.add_argument("--voxels", type=int, default=20, help="of the grid, along each side (default 20)")
    parser.add_argument("--fine", type=int, default=80, help="of the finer grid, along each side (default 80)")
    parser.add_argument("--photons", type=int, default=8_000_000, help="of the grid (default 8 million)")
    parser.add_argument("--fine-photons", type=int, default=64_000_000, help="(default 64 million)")
    parser.add_argument("--seed", type=int, default=0, help="other photons, points and paths (default 0)")
    arguments = parser.parse_args()
    print(f"{'':40} free: RMSE, its median      surfaces", flush=True)
    for name in arguments.scenes or AT_POINTS:
        fit_scene(name, arguments)
    return 0


def fit_scene(name: str, arguments: argparse.Namespace) -> None:
    """Bake both grids of a scene, fit, and print what each comes to."""
    scene = open_scene(name)
    box = bounds(scene)
    light: LitBox = finish(find_light_steps(scene, *box, arguments.seed))
    kinds = [make(light, arguments.points, arguments.seed) for make in (free_space_points, surface_points)]
    truths = [truth_at(places, arguments) for places in kinds]
    settings = BakeSettings(*box, (arguments.voxels,) * 3, photons=arguments.photons, seed=arguments.seed)
    grid = bake(scene, settings).grid
    settings = replace(settings, resolution=(arguments.fine,) * 3, photons=arguments.fine_photons)
    fine = bake(scene, settings).grid
    fitted = free_space_points(light, arguments.fitted, arguments.seed + 1)
    require_same(grid, fitted)
    best = best_vectors(grid, fitted, fine.irradiance(fitted.points, fitted.normals).astype(np.float64))
    for label, vectors in (("as baked", baked_vectors(grid)), ("the best vectors", best), ("the finer grid", None)):
        words = []
        for places, truth in zip(kinds, truths, strict=True):
            if vectors is None:
                found = fine.irradiance(places.points, places.normals).astype(np.float64)
            else:
                readings = Readings.of(grid, places)
                channels = [readings.irradiance(np.ascontiguousarray(vectors[..., c])) for c in range(3)]
                found = np.maximum(0.0, np.stack(channels, axis=1))
            whole = compare(found, truth.irradiance, truth.error)
            rng = np.random.default_rng(0)
            draws = [rng.choice(len(found), min(_DRAWN, len(found)), replace=False) for _ in range(_DRAWS)]
            median = np.median([compare(found[i], truth.irradiance[i], truth.error[i]).own_rmse for i in draws])
            words.append(f"{whole.own_rmse:.3f} ± {whole.own_rmse_error:.3f}, {median:.3f}")
        print(f"{f'{name}: {label}':40} {words[0]}        {words[1]}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
