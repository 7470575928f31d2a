# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights that do not fall off with the square of the distance: Cycles' Light Falloff node.

Such a light shines g(t) times as bright on what is at the distance t,

    g(t) = t^k (1 + s) t² / (s + t²)          k = 0 "Quadratic", 1 "Linear", 2 "Constant"; s "Smooth"

g(1 m) = 1. Nothing in nature does that: the flux of a photon would have to grow along its flight. It does so by
chance. Let g grow up to g(T) at the end of the flight. The photon carries g(T) times its flux, but is dark until it has
flown to a distance that is below t with the probability g(t) / g(T): on average it has g(t) times its flux at t, and
exactly g(T) times at the end. What has only passed transparent surfaces goes on from where it was.

So that no weight exceeds that of emission, a light emits as many photons as if g were the largest that the scene holds.

Of a light with soft falloff, a disk turned towards each point that is lit, p sees the place on the disk that the line
of the photon passes (`points`) at the distance x + b²/x, x that of p from where the line passes the centre, at b: the
disk's place lies farther back than the line's. Nearer than b, where that would grow again, it is taken as 2 b.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .compiled import inlined, kernel, merged
from .embree import MISS, Hits
from .emission.distant import Box
from .emission.photons import Emitters, pick
from .lights import AreaLights, Lights, PointLights
from .random import STREAM_EMISSION, random4
from .scene import Float32, Int32
from .tally import clip_to_box

Float64 = NDArray[np.float64]

_STREAM = STREAM_EMISSION + 15
"""The last of the streams of emission, which no light draws from; `restricted_light` uses another of its numbers."""
_HALVINGS = 40


class Falloff(NamedTuple):
    """How the lights of a scene fall off; l area lights, points and spots, in this order.

    power : (l,) int32, smooth : (l,) float64
        k and s.
    most : (l,) float64
        g at the farthest corner of geometry and grid.
    center : (l, 3) float64
    soft : (l,) bool
        Soft falloff.
    """

    power: Int32
    smooth: Float64
    most: Float64
    center: Float64
    soft: NDArray[np.bool_]

    @classmethod
    def of(cls, lights: Lights, box: Box) -> Falloff | None:
        """Gather it; None where all lights fall off by themselves. The box is that around geometry and grid."""
        kinds: tuple[AreaLights | PointLights, ...] = (lights.area, lights.point)
        power = np.concatenate([_given(one.falloff, len(one.names)) for one in kinds]).astype(np.int32)
        smooth = np.concatenate([_given(one.smooth, len(one.names)) for one in kinds]).astype(np.float64)
        if not (power.any() or smooth.any()):
            return None
        edges = lights.area.edge_u.astype(np.float64), lights.area.edge_v.astype(np.float64)
        size = np.concatenate([0.5 * sum(np.linalg.norm(edge, axis=1) for edge in edges), lights.point.radius])
        center = np.concatenate([lights.area.center, lights.point.position]).astype(np.float64)
        farthest = np.linalg.norm(np.maximum(np.abs(center - box.low), np.abs(center - box.high)), axis=1)
        most = np.array([growth(d, k, s) for d, k, s in zip(farthest + 2.0 * size, power, smooth, strict=True)])
        soft = np.concatenate([np.zeros(len(lights.area.names), dtype=np.bool_), lights.point.soft_falloff])
        return cls(power, smooth, most, center, soft)

    def apply(
        self,
        emitters: Emitters,
        seed: int,
        flight: int,
        photons: NDArray[np.int64],
        bounces: NDArray[np.int16],
        starts: Float32,
        flights: tuple[Float32, Float32, Float32],
        hits: Hits,
        geometry: tuple[Float32, Int32],
        grid: tuple[Float64, Float64],
    ) -> Float32:
        """Let direct light begin where it does; return the weights' factor at the surface that each photon meets, (n,).

        Parameters
        ----------
        emitters, seed
            That emitted the photons (n,) int64.
        flight
            Flights that came before.
        starts : (2^k, 4) float32
            By the last bits of a photon's index: where it was emitted, and the factor that its weight has; changed in
            place.
        flights
            Origins, directions and weights, (n, 3) each; origins and weights are changed into those in the air.
        hits
            Of the flights; distances are changed.
        geometry
            Vertices and triangles.
        grid
            Corners of the box in which light counts in the air.
        """
        factor = np.ones(len(photons), dtype=np.float32)
        hit = (hits.triangle, hits.u, hits.v, hits.distance)
        fall_off(
            emitters.cumulative, self, seed, flight, photons, bounces, starts, *flights, *hit, *geometry, *grid, factor
        )
        return factor


def _given(values: NDArray[np.generic] | None, count: int) -> NDArray[np.generic]:
    return np.zeros(count) if values is None else values


@inlined
def growth(distance, power, smooth):
    """Return g; see the module's equation."""
    grown = 1.0
    for _ in range(power):
        grown *= distance
    if smooth > 0.0:
        squared = distance * distance
        grown *= (1.0 + smooth) * squared / (smooth + squared)
    return grown


@inlined
def _distance_of(grown, power, smooth, most):
    """Return the distance at which g is this, within (0, most)."""
    low, high = 0.0, most
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        if growth(middle, power, smooth) < grown:
            low = middle
        else:
            high = middle
    return high


@inlined
def _seen_distance(along, b):
    """Return the distance of a light's place from what is that far along a line which passes its centre at b."""
    return along + b * b / along if along > b else 2.0 * b


@inlined
def _along_of(seen, b, b2):
    """Return how far along the line what sees its light at this distance is: the inverse of `_seen_distance`."""
    return 0.5 * (seen + math.sqrt(max(0.0, seen * seen - 4.0 * b2))) if seen > 2.0 * b else 0.0


@inlined
def _inverse(component):
    """Return the metres that a flight goes while it goes one along an axis."""
    return 1.0 / float(component) if component != 0.0 else math.inf


@merged
def _distance_to(vertices, triangles, triangle, u, v, start):
    """Return the distance between a point and a place on a triangle."""
    squared = 0.0
    for axis in range(3):
        place = (1.0 - u - v) * vertices[triangles[triangle, 0], axis]
        place += u * vertices[triangles[triangle, 1], axis]
        place += v * vertices[triangles[triangle, 2], axis]
        squared += (place - start[axis]) ** 2
    return math.sqrt(squared)


@kernel
def fall_off(
    cumulative,
    falloff,
    seed,
    flight,
    photons,
    bounces,
    starts,
    origins,
    directions,
    weights,
    hit_triangle,
    hit_u,
    hit_v,
    hit_distance,
    vertices,
    triangles,
    low,
    high,
    factor,
):
    """Do what `Falloff.apply` says; parameters as there."""
    power, smooth, most, center, soft = falloff
    top = (high[0] - low[0], high[1] - low[1], high[2] - low[2])
    for i in range(len(photons)):
        if bounces[i] != 0:
            continue
        coarse, fine, _, _ = random4(seed, photons[i], STREAM_EMISSION)
        light = pick(cumulative, coarse, fine)
        if light >= len(power) or (power[light] == 0 and smooth[light] == 0.0):
            continue
        k, s = power[light], smooth[light]
        start = starts[photons[i] & (len(starts) - 1)]
        b2 = 0.0
        flown2 = 0.0
        for axis in range(3):
            flown2 += (float(origins[i, axis]) - start[axis]) ** 2
            if soft[light]:
                b2 += (start[axis] - center[light, axis]) ** 2
        flown, b = math.sqrt(flown2), math.sqrt(b2)

        # Up to the surface, and up to where the flight leaves the grid: light counts in the air no farther.
        end = flown + float(hit_distance[i])
        surface = 0.0
        if hit_triangle[i] != MISS:
            surface = _distance_to(vertices, triangles, hit_triangle[i], float(hit_u[i]), float(hit_v[i]), start)
        x = (float(origins[i, 0]) - low[0], float(origins[i, 1]) - low[1], float(origins[i, 2]) - low[2])
        inverse = _inverse(directions[i, 0]), _inverse(directions[i, 1]), _inverse(directions[i, 2])
        enters, leaves = clip_to_box(x, inverse, 0.0, float(hit_distance[i]), top, -1)
        at_surface = growth(_seen_distance(surface, b), k, s) / most[light]
        in_air = at_surface
        if enters < leaves:
            end = flown + leaves
            grown = growth(_seen_distance(end, b), k, s)
            in_air = grown / most[light]
            xi = random4(seed, photons[i] + (flight << 48), _STREAM)[1]
            seen = _distance_of(xi * grown, k, s, _seen_distance(end, b))
            begin = _along_of(seen, b, b2)
            if begin > flown:
                step = min(begin - flown, float(hit_distance[i]))
                for axis in range(3):
                    origins[i, axis] += np.float32(step * directions[i, axis])
                hit_distance[i] -= np.float32(step)
        before = start[3]
        for channel in range(3):
            weights[i, channel] *= np.float32(in_air / before)
        start[3] = np.float32(at_surface)
        factor[i] = np.float32(at_surface / in_air) if in_air > 0.0 else np.float32(1.0)
