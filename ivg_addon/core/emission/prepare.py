# SPDX-License-Identifier: GPL-3.0-or-later
"""From a scene's emitters to photons.

A photon picks the emitter e with probability s_e / Σ s, s_e the largest channel of its power, and
carries the flux w_e Σ s / N of N photons, w_e = power / s_e: the largest channel of its weight
is 1, whatever the emitter, or −1 of a lamp that takes light away. What emits in a way that has no
closed form is sampled with failures whose chance is known: s_e is the larger by that, and a photon
that failed has weight 0. Textured triangles have no power in closed form either: their s_e is that
of a bound, of which photons carry the share that the texture has where they start. A guide
(`guide.py`) makes s_e larger and weights smaller.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError
from ..falloff import Falloff
from ..lights import Lights
from ..scene import Float32, Scene
from .area import AreaEmitters, area_powers
from .distant import Box, SunEmitters, mean_shadows, sun_fluxes
from .environment import MapEmitters, map_powers, map_strengths
from .guide import NUMBERS, Guide, Leaves
from .patterns import PatternEmitters, apply_patterns
from .photons import Emitters, draw_photons, emit_photons, find_standards
from .points import ATTEMPTS, PointEmitters, acceptance, point_powers
from .triangles import TriangleEmitters, triangle_strengths

Float64 = NDArray[np.float64]


@dataclass(frozen=True)
class Draws:
    """What n photons are made of; see `photons.draw_photons`.

    Parameters
    ----------
    guided : (n,) int32
        Index among `Emission.guided`; −1 for other emitters.
    leaf : (n,) int64
        Of all leaves of the guide.
    numbers : (n, 5) float64
    """

    guided: NDArray[np.int32]
    leaf: NDArray[np.int64]
    numbers: Float64


@dataclass(frozen=True)
class Emission:
    """All emitters of a scene, ready to emit; made by `prepare_emission`.

    Parameters
    ----------
    power : (3,) float64
        W, all emitters together. Of suns and the world counts what enters a box around geometry
        and grid.
    flux_scale
        A photon's flux is its weight times `flux_scale` over the number of photons, W.
    emitters
        Arrays of the kernel.
    strengths : (emitters,) float64
        s of each emitter, W, without a guide.
    is_aimed
        Whether there is a guide.
    falloff
        Of lights that fall off otherwise than with the square of the distance; None where there are none.
    """

    power: Float64
    flux_scale: float
    emitters: Emitters
    strengths: Float64
    is_aimed: bool = False
    falloff: Falloff | None = None

    @property
    def flies_dark(self) -> bool:
        """Whether some photons carry light only from a distance on; see `leave_darkness`."""
        points = self.emitters.points
        return bool((points.soft_falloff & (points.radius > 0.0)).any())

    @property
    def guided(self) -> slice:
        """Return which emitters can be aimed: the surroundings, for one box after the other."""
        first = len(self.emitters.areas.center) + len(self.emitters.points.radius)
        return slice(first, first + len(self.emitters.guide.first_leaf) - 1)

    @property
    def boxes(self) -> int:
        """Return how many boxes the surroundings are emitted for, the outermost first."""
        return len(self.emitters.boxes.low)

    def aimed(self, leaves: Sequence[Leaves], rest: float) -> Emission:
        """Return the same light, aimed.

        Parameters
        ----------
        leaves
            Of each emitter in `guided`.
        rest
            How many times more photons all other emitters get, at least 1.
        """
        more = np.full(len(self.strengths), rest)
        more[self.guided] = [one.more for one in leaves]
        cumulative = np.cumsum(self.strengths * more)
        emitters = self.emitters._replace(cumulative=cumulative, guide=Guide.of(list(leaves), rest))
        return replace(self, flux_scale=float(cumulative[-1]), emitters=emitters, is_aimed=True)

    def draws(self, seed: int, first_photon: int, n: int) -> Draws:
        """Return what photons first_photon … first_photon + n − 1 are made of. Frees the GIL."""
        drawn = Draws(np.empty(n, np.int32), np.zeros(n, np.int64), np.zeros((n, NUMBERS)))
        draw_photons(seed, first_photon, self.emitters, drawn.guided, drawn.leaf, drawn.numbers)
        return drawn

    def standards(self, seed: int, first_photon: int, n: int) -> Float32:
        """Return the factor that the guide gives the weights of n photons, (n,): 1 without a guide. Frees the GIL."""
        standards = np.empty(n, dtype=np.float32)
        find_standards(seed, first_photon, self.emitters, standards)
        return standards

    def emit(
        self,
        seed: int,
        first_photon: int,
        origins: Float32,
        directions: Float32,
        weights: Float32,
        dark: Float32,
    ) -> None:
        """Fill in photons first_photon … first_photon + n − 1. Frees the GIL.

        Parameters
        ----------
        seed
            Key of the random numbers.
        first_photon
            Index of the first photon; a photon depends on seed and index alone.
        origins, directions, weights : (n, 3) float32
            Filled in: metres, unit vectors along the flight, and the share of `flux_scale` per
            channel, at most 1.
        dark : (n,) float32
            Filled in: metres of flight before the photon carries light; see `leave_darkness`.
        """
        emit_photons(seed, first_photon, self.emitters, origins, directions, weights, dark)


def prepare_emission(scene: Scene, bounds_min: ArrayLike, bounds_max: ArrayLike) -> Emission:
    """Gather a scene's emitters.

    Parameters
    ----------
    scene
    bounds_min, bounds_max : (3,)
        The grid's box, metres: suns and the world light it and the geometry.

    Raises
    ------
    SceneError
        If nothing emits, or a light's power is not a number.
    """
    lights = scene.lights
    boxes = _boxes(scene, bounds_min, bounds_max)
    box = boxes[0]
    areas = AreaEmitters.of(lights.area)
    points = PointEmitters.of(lights.point)
    suns = SunEmitters.of(lights.sun, boxes)
    triangles = TriangleEmitters.of(scene)
    maps = lights.environment

    powers, sampled = _powers(lights, points)
    sun_flux = sun_fluxes(lights.sun)
    powers.append(sun_flux * mean_shadows(lights.sun, box)[:, None])
    world = np.pi * lights.world.astype(np.float64) * 2.0 * box.areas.sum()
    colors = np.concatenate([*powers, world[None]])
    apply_patterns(lights, powers, sampled)
    falloff = Falloff.of(lights, box)
    if falloff is not None:
        for some, most in zip(sampled, np.split(falloff.most, [len(sampled[0])]), strict=True):
            some *= most[:, None]
    in_maps = map_powers(maps, box)
    _check_powers(lights, np.concatenate(powers), [world, *in_maps])
    mesh_strengths, mesh_power = triangle_strengths(triangles)

    shadows = zip(suns.largest_shadow, boxes, strict=True)
    surroundings = [_strengths(sun_flux, shadow, lights, one) for shadow, one in shadows]
    strengths = np.concatenate([*(np.abs(s).max(axis=1) for s in sampled), *surroundings, mesh_strengths])
    cumulative = np.cumsum(strengths)
    if not cumulative[-1] > 0.0:
        raise SceneError(
            f"scene '{scene.name}' has no light: add a light, a material that emits, or a world colour other than black"
        )
    light_powers = np.concatenate([*powers, world[None]])
    largest = np.abs(colors).max(axis=1, keepdims=True)
    return Emission(
        power=light_powers.sum(axis=0) + in_maps.sum(axis=0) + mesh_power,
        flux_scale=float(cumulative[-1]),
        emitters=Emitters(
            cumulative=cumulative,
            weight=(colors / np.where(largest > 0.0, largest, 1.0)).astype(np.float32),
            areas=areas,
            points=points,
            suns=suns,
            maps=MapEmitters.of(maps, boxes),
            triangles=triangles,
            box=box,
            boxes=Box.stacked(boxes),
            guide=Guide.of([Leaves.whole()] * (len(boxes) * (len(suns.direction) + 1 + len(maps)))),
            patterns=PatternEmitters.of(lights),
        ),
        strengths=strengths,
        falloff=falloff,
    )


def _boxes(scene: Scene, bounds_min: ArrayLike, bounds_max: ArrayLike) -> tuple[Box, ...]:
    """Return a box around geometry and grid, and where the grid is much smaller others from there to its own box."""
    low, high = np.asarray(bounds_min, np.float64), np.asarray(bounds_max, np.float64)
    grid = Box.around(low, high)
    if scene.geometry.triangle_count:
        scene_low, scene_high = scene.geometry.bounds()
        low, high = np.minimum(low, scene_low), np.maximum(high, scene_high)
    return Box.nested(Box.around(low, high), grid)


def _powers(lights: Lights, points: PointEmitters) -> tuple[list[Float64], list[Float64]]:
    """Return the powers of area lights and of points, (n, 3) W each, and the same with photons that fail."""
    accepted = acceptance(points)
    powers = [area_powers(lights.area), point_powers(lights.point, points, accepted)]
    return powers, [powers[0].copy(), powers[1] / (1.0 - (1.0 - accepted) ** ATTEMPTS)[:, None]]


def _strengths(sun_flux: Float64, largest_shadow: Float64, lights: Lights, box: Box) -> Float64:
    """Return what suns, the world and maps send into a box, (sources,) W, photons that miss it included."""
    suns = np.abs(sun_flux * largest_shadow[:, None]).max(axis=1)
    world = np.pi * float(lights.world.max()) * 2.0 * box.areas.sum()
    return np.concatenate([suns, [world], map_strengths(lights.environment, box)])


def _check_powers(lights: Lights, powers: Float64, surroundings: Sequence[Float64]) -> None:
    """Raise `SceneError` that names the first light whose power is not a number; only lamps may take light away."""
    names = (*lights.names, *(None for _ in surroundings))
    for name, power in zip(names, (*powers, *surroundings), strict=True):
        if not (np.isfinite(power) & ((power >= 0.0) | (name is not None))).all():
            subject = "the world" if name is None else f"light '{name}'"
            raise SceneError(f"{subject} has power {power} W: use finite values{', not negative' * (name is None)}")
    if any((one.radiance < 0.0).any() for one in lights.environment):
        raise SceneError("the world has negative radiance: use positive values")
