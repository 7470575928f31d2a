# SPDX-License-Identifier: GPL-3.0-or-later
"""Every light datablock of a scene and its world, as plain arrays.

The quantities are those that Cycles' light kernels end up with, so that nothing here depends on
how Blender spells a light's strength. Emissive triangles are not listed: they follow from the
geometry and `Materials.emission`.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .environment import EnvironmentMap

Float32 = NDArray[np.float32]
Bool = NDArray[np.bool_]


Int32 = NDArray[np.int32]

NO_LIMIT = 1 << 20
"""Bounces of light that never ends."""
NO_PATTERN = -1


def _rows(*shape: int) -> Float32:
    return np.zeros(shape, dtype=np.float32)


def _flags() -> Bool:
    return np.zeros(0, dtype=np.bool_)


@dataclass(frozen=True)
class Pattern:
    """Factors that multiply the light of a lamp that does not shine evenly: an IES profile, a slide, a lit sign.

    Of an area light texels lie on the light, columns along `edge_u` and rows along `edge_v`. Of a point or spot they
    are directions: rows in equal steps of the angle to the axis −z, from 0 to the cone's, and columns in equal steps
    of the azimuth from x to y.

    Parameters
    ----------
    factor : (rows, columns, 3) float32
        Not negative.
    """

    factor: Float32


@dataclass(frozen=True)
class AreaLights:
    """Rectangles and ellipses that shine to one side.

    Parameters
    ----------
    names : tuple of n str
    center : (n, 3) float32
    edge_u, edge_v : (n, 3) float32
        The rectangle's sides, or the ellipse's diameters, in world space, metres.
    direction : (n, 3) float32
        Unit normal of the side that shines.
    elliptic : (n,) bool
    half_spread : (n,) float32
        Half of the angle that light stays within, radians; π/2 is Lambert's cosine law, 0 a
        parallel beam.
    radiance : (n, 3) float32
        W/(m² sr), what the light has at full spread. A smaller spread gathers the same power.
    falloff : (n,) int32, smooth : (n,) float32, optional
        k and s of `falloff`; 0 is the square of the distance. The light's strength is that at 1 m.
    pattern : (n,) int32, optional
        Index into `Lights.patterns`, or `NO_PATTERN`; none has one where this is not given.
    """

    names: tuple[str, ...] = ()
    center: Float32 = field(default_factory=lambda: _rows(0, 3))
    edge_u: Float32 = field(default_factory=lambda: _rows(0, 3))
    edge_v: Float32 = field(default_factory=lambda: _rows(0, 3))
    direction: Float32 = field(default_factory=lambda: _rows(0, 3))
    elliptic: Bool = field(default_factory=_flags)
    half_spread: Float32 = field(default_factory=lambda: _rows(0))
    radiance: Float32 = field(default_factory=lambda: _rows(0, 3))
    pattern: Int32 | None = None
    falloff: Int32 | None = None
    smooth: Float32 | None = None


@dataclass(frozen=True)
class PointLights:
    """Points, spheres and spots. A light without a cone is a spot that shines everywhere.

    Parameters
    ----------
    names : tuple of n str
    position : (n, 3) float32
    radius : (n,) float32
        Metres; 0 is an exact point.
    soft_falloff : (n,) bool
        Whether each point that is lit sees a disk of that radius turned towards it, instead of a
        sphere. Of no meaning without a radius.
    intensity : (n, 3) float32
        W/sr in the middle of the cone. With a radius r the radiance is intensity / (π r²).
    cos_half_angle : (n,) float32
        Cosine of half of the cone's angle in the light's own space; −1 shines everywhere.
    blend : (n,) float32
        Share of the cone, counted in the cosine from its edge, over which light fades: 0 to 1.
    axes : (n, 3, 3) float32
        Columns are the light's own x, y and z axes in world space, with their lengths; the cone
        opens along −z. Unequal lengths make the cone elliptic.
    falloff : (n,) int32, smooth : (n,) float32, optional
        k and s of `falloff`; 0 is the square of the distance. The light's strength is that at 1 m.
    pattern : (n,) int32, optional
        Index into `Lights.patterns`, or `NO_PATTERN`; none has one where this is not given. A pattern holds the
        cone's fading too: `blend` is then 0, and `axes` are orthonormal. That of a sphere without a cone belongs to
        the places of its surface, and each shines by Lambert's law.
    """

    names: tuple[str, ...] = ()
    position: Float32 = field(default_factory=lambda: _rows(0, 3))
    radius: Float32 = field(default_factory=lambda: _rows(0))
    soft_falloff: Bool = field(default_factory=_flags)
    intensity: Float32 = field(default_factory=lambda: _rows(0, 3))
    cos_half_angle: Float32 = field(default_factory=lambda: _rows(0))
    blend: Float32 = field(default_factory=lambda: _rows(0))
    axes: Float32 = field(default_factory=lambda: _rows(0, 3, 3))
    pattern: Int32 | None = None
    falloff: Int32 | None = None
    smooth: Float32 | None = None


@dataclass(frozen=True)
class SunLights:
    """Lights at infinity: discs in the sky of uniform radiance.

    Parameters
    ----------
    names : tuple of n str
    direction : (n, 3) float32
        Unit vector that the middle of the light travels along.
    half_angle : (n,) float32
        Half of the angle that the disc spans, radians; 0 is exactly parallel light.
    irradiance : (n, 3) float32
        W/m² on a surface that faces the whole disc.
    """

    names: tuple[str, ...] = ()
    direction: Float32 = field(default_factory=lambda: _rows(0, 3))
    half_angle: Float32 = field(default_factory=lambda: _rows(0))
    irradiance: Float32 = field(default_factory=lambda: _rows(0, 3))


@dataclass(frozen=True)
class Lights:
    """Everything that shines but emissive triangles.

    Parameters
    ----------
    world : (3,) float32
        Radiance of the surroundings, the same from every direction, W/(m² sr).
    environment
        Radiance of the surroundings, added to `world`, where it differs from direction to direction.
    patterns
        Of area lights, points and spots; no two of different cones share one.
    group : (lights,) int32, optional
        Which of the groups of `light_rules.LightRules` each of `names` belongs to; without it all are free.
    max_bounces : (lights,) int32, optional
        Most surfaces that each light's photons meet and then still count; without it there is no limit.
    """

    world: Float32
    area: AreaLights = field(default_factory=AreaLights)
    point: PointLights = field(default_factory=PointLights)
    sun: SunLights = field(default_factory=SunLights)
    environment: tuple[EnvironmentMap, ...] = ()
    patterns: tuple[Pattern, ...] = ()
    group: Int32 | None = None
    max_bounces: Int32 | None = None

    @classmethod
    def none(cls) -> Lights:
        """Return lights that emit nothing: no datablock, and a black world."""
        return cls(world=_rows(3))

    @property
    def names(self) -> tuple[str, ...]:
        """Return the names of all light datablocks: areas, points and spots, suns."""
        return self.area.names + self.point.names + self.sun.names

    @property
    def world_shines(self) -> bool:
        """Tell whether what looks past all geometry finds light, suns aside."""
        return bool((self.world > 0.0).any()) or any(one.shines() for one in self.environment)
