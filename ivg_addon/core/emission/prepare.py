"""From a scene's emitters to photons.

A photon picks the emitter e with probability s_e / Σ s, s_e the largest channel of its power, and
carries the flux w_e Σ s / N of N photons, w_e = power / s_e: the largest channel of its weight
is 1, whatever the emitter. What emits in a way that has no closed form is sampled with failures
whose chance is known: s_e is the larger by that, and a photon that failed has weight 0. Textured
triangles have no power in closed form either: their s_e is that of a bound, of which photons carry
the share that the texture has where they start.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import SceneError
from ..lights import Lights
from ..scene import Float32, Scene
from .area import AreaEmitters, area_powers
from .distant import Box, SunEmitters, mean_shadows, sun_fluxes
from .patterns import PatternEmitters, apply_patterns
from .photons import Emitters, emit_photons
from .points import ATTEMPTS, PointEmitters, acceptance, point_powers
from .triangles import TriangleEmitters, triangle_strengths

Float64 = NDArray[np.float64]


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
    """

    power: Float64
    flux_scale: float
    emitters: Emitters

    @property
    def flies_dark(self) -> bool:
        """Whether some photons carry light only from a distance on; see `leave_darkness`."""
        points = self.emitters.points
        return bool((points.soft_falloff & (points.radius > 0.0)).any())

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
    box = _box(scene, bounds_min, bounds_max)
    areas = AreaEmitters.of(lights.area)
    points = PointEmitters.of(lights.point)
    suns = SunEmitters.of(lights.sun, box)
    triangles = TriangleEmitters.of(scene)

    accepted = acceptance(points)
    sun_flux = sun_fluxes(lights.sun)
    world = np.pi * lights.world.astype(np.float64) * 2.0 * box.areas.sum()
    powers = [
        area_powers(lights.area),
        point_powers(lights.point, points, accepted),
        sun_flux * mean_shadows(lights.sun, box)[:, None],
    ]
    # What is emitted, failures included.
    sampled = [
        powers[0].copy(),
        powers[1] / (1.0 - (1.0 - accepted) ** ATTEMPTS)[:, None],
        sun_flux * suns.largest_shadow[:, None],
    ]
    colors = np.concatenate([*powers, world[None]])
    apply_patterns(lights, powers, sampled)
    _check_powers(lights, np.concatenate(powers), world)
    mesh_strengths, mesh_power = triangle_strengths(triangles)

    cumulative = np.cumsum(np.concatenate([*(s.max(axis=1) for s in sampled), [world.max()], mesh_strengths]))
    if not cumulative[-1] > 0.0:
        raise SceneError(
            f"scene '{scene.name}' has no light: add a light, a material that emits, or a world colour other than black"
        )
    light_powers = np.concatenate([*powers, world[None]])
    largest = colors.max(axis=1, keepdims=True)
    return Emission(
        power=light_powers.sum(axis=0) + mesh_power,
        flux_scale=float(cumulative[-1]),
        emitters=Emitters(
            cumulative=cumulative,
            weight=(colors / np.where(largest > 0.0, largest, 1.0)).astype(np.float32),
            areas=areas,
            points=points,
            suns=suns,
            triangles=triangles,
            box=box,
            patterns=PatternEmitters.of(lights),
        ),
    )


def _box(scene: Scene, bounds_min: ArrayLike, bounds_max: ArrayLike) -> Box:
    """Return a box around geometry and grid."""
    low, high = np.asarray(bounds_min, np.float64), np.asarray(bounds_max, np.float64)
    if scene.geometry.triangle_count:
        scene_low, scene_high = scene.geometry.bounds()
        low, high = np.minimum(low, scene_low), np.maximum(high, scene_high)
    return Box.around(low, high)


def _check_powers(lights: Lights, powers: Float64, world: Float64) -> None:
    """Raise `SceneError` that names the first light whose power is not a number, or negative."""
    for name, power in zip((*lights.names, None), (*powers, world), strict=True):
        if not (np.isfinite(power) & (power >= 0.0)).all():
            subject = "the world" if name is None else f"light '{name}'"
            raise SceneError(f"{subject} has power {power} W: use finite, positive values")
