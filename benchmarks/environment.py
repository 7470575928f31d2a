# SPDX-License-Identifier: GPL-3.0-or-later
"""What importance sampling and aim are worth: `python -m benchmarks.environment [--photons N] [--bakes N]`.

Prints, for a place under a sky with a sun and for rooms lit through a small window, the variance of the grid's
irradiance (over its mean squared; all cells and axes together) at equal photons, with

* uniform: directions and places uniform over what the box around the scene shows, radiance as weight;
* importance: directions in proportion to the light that they bring;
* aimed: and those that the pilot found to be of use more often (the pilot's photons are counted in).

About three minutes on two cores.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ivg_addon.core.aim import Aim, aim_steps
from ivg_addon.core.bake import prepare_course
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.emission import Emission
from ivg_addon.core.environment import EnvironmentMap, bright_spots, without_spots
from ivg_addon.core.lights import Lights
from ivg_addon.core.photon_walk import Course, walk_steps
from ivg_addon.core.progress import finish
from ivg_addon.core.scene import Float32, Scene
from ivg_addon.core.settings import BakeSettings
from tests.core.rooms import Part, box, quad, scene, sky

Float64 = NDArray[np.float64]
Radiance = Callable[[Float64], Float64]
"""From directions (…, 3) that light comes from to radiance (…, 3)."""

SUN = np.array([0.75, 0.3, 0.59]) / np.linalg.norm([0.75, 0.3, 0.59])
HALF_DISC = math.radians(0.27)


def sunny(w: Float64) -> Float64:
    """Return the radiance of a sky that is darker above, with a sun disc that is four fifths of the light."""
    height = np.clip(w[..., 2], 0.0, 1.0)[..., None]
    sky_light = np.where(w[..., 2:] > 0.0, np.array([0.5, 0.7, 1.0]) * (1.5 - height), 0.1)
    disc = np.linalg.norm(np.cross(w, SUN), axis=-1, keepdims=True) < math.sin(HALF_DISC)
    sun = np.array([1.0, 0.9, 0.7]) * 8.0 / (2.0 * math.pi * (1.0 - math.cos(HALF_DISC)))
    return sky_light + sun * (disc & (w @ SUN > 0.0)[..., None])


def rendered(radiance: Radiance, one: EnvironmentMap, samples: int) -> EnvironmentMap:
    """Return a map with the means of samples² directions in each texel."""
    fine = (np.arange(samples) + 0.5) / samples
    b, turned = (
        (edges[:-1, None] + np.diff(edges)[:, None] * fine).ravel() for edges in (one.row_edges, one.column_edges)
    )
    b, turned = b[:, None], turned[None, :]
    w = np.stack(np.broadcast_arrays(np.cos(b) * np.cos(turned), -np.cos(b) * np.sin(turned), np.sin(b)), axis=-1)
    h, columns = one.radiance.shape[:2]
    return replace(
        one, radiance=radiance(w).reshape(h, samples, columns, samples, 3).mean(axis=(1, 3)).astype(np.float32)
    )


def maps_of(radiance: Radiance) -> tuple[EnvironmentMap, ...]:
    """Return a sky as the export makes one."""
    whole = rendered(radiance, EnvironmentMap(np.zeros((512, 1024, 3), np.float32)), 3)
    spots = bright_spots(whole)
    patches = []
    for spot in spots:
        (bottom, top), (left, right) = spot.rows, spot.columns
        patches.append(
            EnvironmentMap(
                np.zeros((128, 128, 3), np.float32),
                (float(whole.column_edges[left]), float(whole.column_edges[right])),
                (float(whole.row_edges[bottom]), float(whole.row_edges[top])),
            )
        )
    return (without_spots(whole, spots), *(rendered(radiance, patch, 4) for patch in patches))


class UniformEmission:
    """Photons of the surroundings without importance sampling: those of a world of radiance one, weighted."""

    flies_dark, is_aimed = False, True

    def __init__(self, of_one: Emission, radiance: Radiance) -> None:
        self._of_one, self._radiance = of_one, radiance
        self._largest = float(radiance(np.concatenate([SUN[None], [[1.0, 0.0, 1e-3]]])).max())
        self.flux_scale = of_one.flux_scale * self._largest

    def emit(
        self, seed: int, first: int, origins: Float32, directions: Float32, weights: Float32, dark: Float32
    ) -> None:
        """Fill in photons, as `Emission.emit`."""
        self._of_one.emit(seed, first, origins, directions, weights, dark)
        weights *= self._radiance(-directions.astype(np.float64)).astype(np.float32) / np.float32(self._largest)

    def standards(self, seed: int, first: int, n: int) -> Float32:
        """Return the largest channel of the weights: else roulette would take nearly all photons at once."""
        origins, directions, weights = (np.empty((n, 3), dtype=np.float32) for _ in range(3))
        self.emit(seed, first, origins, directions, weights, np.empty(n, dtype=np.float32))
        return np.maximum(weights.max(axis=1), np.float32(1e-30))


def house(window: float) -> list[Part]:
    """Return a room of 4 × 4 × 3 m, its walls 0.2 m thick, with a square window to the east."""
    t, low, high = 0.2, 0.5 * window, 0.5 * window
    y0, y1, z0, z1 = 2.0 - low, 2.0 + high, 1.5 - low, 1.5 + high
    walls = [
        *(((-t, -t, -t), (4 + t, 4 + t, 0)), ((-t, -t, 3), (4 + t, 4 + t, 3 + t)), ((-t, -t, 0), (0, 4 + t, 3))),
        *(((0, -t, 0), (4 + t, 0, 3)), ((0, 4, 0), (4 + t, 4 + t, 3))),
        *(((4, 0, 0), (4 + t, y0, 3)), ((4, y1, 0), (4 + t, 4, 3))),
        *(((4, y0, 0), (4 + t, y1, z0)), ((4, y0, z1), (4 + t, y1, 3))),
    ]
    return [box(*corners) for corners in walls]


@dataclass(frozen=True)
class Place:
    """What is lit, by which sky, and where the grid is."""

    name: str
    parts: list[Part]
    radiance: Radiance | None
    bounds_min: tuple[float, float, float] = (0.0, 0.0, 0.0)
    bounds_max: tuple[float, float, float] = (4.0, 4.0, 3.0)

    def scene(self) -> Scene:
        """Return its arrays."""
        lights = sky() if self.radiance is None else Lights(np.zeros(3, np.float32), environment=maps_of(self.radiance))
        return scene(self.parts, albedo=((0.6, 0.6, 0.6),), lights=lights)


def _ground(half: float) -> Part:
    return quad((2 - half, 2 - half, -0.2), (2 * half, 0, 0), (0, 2 * half, 0))


PLACES = (
    Place("open place, sky with a sun", [_ground(6.0), box((1, 1, -0.2), (2, 2, 1.5))], sunny),
    Place("room, small window, even sky", house(0.8), None),
    Place("room, small window, sky with a sun", house(0.8), sunny),
    Place("the same on 40 m of ground", [*house(0.8), _ground(20.0)], sunny),
)


def scatter_of(course: Course, settings: BakeSettings, bakes: int) -> tuple[float, float]:
    """Return the variance over the mean squared, and the mean irradiance towards the axes."""
    lattice = Lattice(settings.bounds_min, settings.bounds_max, settings.resolution)
    axis = np.arange(6)
    towards = []
    for seed in range(bakes):
        walk = finish(walk_steps(course, lattice, replace(settings, seed=seed)))
        vectors = walk.tally.vectors(course.emission.flux_scale / settings.photons)
        towards.append(np.abs(vectors[..., axis, :, axis // 2]))
    irradiance = np.array(towards)
    mean = irradiance.mean(axis=0)
    return float(irradiance.var(axis=0, ddof=1).sum() / (mean**2).sum()), float(mean.mean())


def main() -> int:
    """Print the table; return the exit status."""
    parser = argparse.ArgumentParser(description="Variance of the light of the surroundings at equal photons.")
    parser.add_argument("--photons", type=int, default=1_000_000, help="of each bake (default a million)")
    parser.add_argument("--bakes", type=int, default=8, help="independent bakes of each (default 8)")
    arguments = parser.parse_args()
    print(f"{arguments.bakes} × {arguments.photons:,} photons\n")
    print(f"{'':36}{'variance':>10}{'gain':>9}{'of use':>9}   mean irradiance")
    for place in PLACES:
        _compare(place, arguments.photons, arguments.bakes)
    return 0


def _compare(place: Place, photons: int, bakes: int) -> None:
    settings = BakeSettings(place.bounds_min, place.bounds_max, (8, 8, 6), photons=photons)
    lattice = Lattice(settings.bounds_min, settings.bounds_max, settings.resolution)
    of = place.scene()
    course = prepare_course(of, lattice, photons)
    aimed, aim = finish(aim_steps(course, lattice, settings))
    assert isinstance(aim, Aim)
    rows: list[tuple[str, Course, float, float]] = []
    if place.radiance is not None:
        of_one = prepare_course(replace(of, lights=sky()), lattice, photons).emission
        uniform = replace(course, emission=UniformEmission(of_one, place.radiance))  # type: ignore[arg-type]
        rows.append(("uniform", uniform, math.nan, 1.0))
    rows.append(("importance", course, aim.useful_without, 1.0))
    # As if the pilot's photons had been the bake's.
    rows.append(("aimed", aimed, aim.useful, 1.0 + aim.photons / photons))
    first = None
    print(place.name)
    for name, one, useful, cost in rows:
        variance, mean = scatter_of(one, settings, bakes)
        variance *= cost
        first = first or variance
        share = "" if math.isnan(useful) else f"{useful:.1%}"
        print(f"    {name:32}{variance:10.3g}{first / variance:9.1f}{share:>9}   {mean:.4g}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
