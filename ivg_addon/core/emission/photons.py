"""The kernels that emit photons."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import kernel, merged
from ..embree import MISS
from ..random import STREAM_EMISSION, random4
from ..scene import Float32
from .area import AreaEmitters, emit_area
from .distant import Box, SunEmitters, emit_sun, emit_world
from .points import PointEmitters, emit_point
from .triangles import TriangleEmitters, emit_triangle

_OUTWARDS = 1.0 / math.sqrt(3.0)


class Emitters(NamedTuple):
    """All emitters in a row: areas, points, suns, the world, emissive triangles.

    cumulative : (emitters,) float64
        Σ s up to and with each emitter.
    weight : (emitters before the triangles, 3) float32
        Power of each light over its largest channel. Triangles have theirs by material.
    """

    cumulative: NDArray[np.float64]
    weight: Float32
    areas: AreaEmitters
    points: PointEmitters
    suns: SunEmitters
    triangles: TriangleEmitters
    box: Box


@kernel
def emit_photons(seed, first_photon, emitters, origins, directions, weights, dark):
    """Fill in n photons; parameters as in `Emission.emit`."""
    first_point = len(emitters.areas.center)
    first_sun = first_point + len(emitters.points.radius)
    world = first_sun + len(emitters.suns.direction)
    center, edge_u, edge_v, direction, elliptic, slat_range = emitters.areas
    for i in range(len(origins)):
        photon = first_photon + i
        coarse, fine, xi_0, xi_1 = random4(seed, photon, STREAM_EMISSION)
        emitter = _pick(emitters.cumulative, coarse, fine)
        distance = 0.0
        exists = True
        row = emitter
        if first_point <= emitter < first_sun:
            light = emitter - first_point
            ox, oy, oz, dx, dy, dz, distance, exists = emit_point(emitters.points, light, seed, photon, xi_0, xi_1)
        else:
            xi_2, xi_3, xi_4, _ = random4(seed, photon, STREAM_EMISSION + 1)
            if emitter < first_point:
                ox, oy, oz, dx, dy, dz = emit_area(
                    center, edge_u, edge_v, direction, elliptic, slat_range, emitter, xi_0, xi_1, xi_2, xi_3, xi_4
                )
            elif emitter < world:
                light = emitter - first_sun
                ox, oy, oz, dx, dy, dz, exists = emit_sun(
                    emitters.suns, light, emitters.box, xi_0, xi_1, xi_2, xi_3, xi_4
                )
            elif emitter == world:
                ox, oy, oz, dx, dy, dz = emit_world(emitters.box, xi_0, xi_1, xi_2, xi_3, xi_4)
            else:
                triangle = emitters.triangles.emissive[emitter - world - 1]
                row = emitters.triangles.material[triangle]
                ox, oy, oz, dx, dy, dz = emit_triangle(emitters.triangles, triangle, xi_0, xi_1, xi_2, xi_3, xi_4)
        if not exists:
            # Out of sight: from the box's far corner away from everything.
            ox, oy, oz = emitters.box.high[0], emitters.box.high[1], emitters.box.high[2]
            dx = dy = dz = _OUTWARDS
            distance = 0.0
        dark[i] = distance
        _store(origins, i, ox, oy, oz)
        _store(directions, i, dx, dy, dz)
        for channel in range(3):
            if not exists:
                weights[i, channel] = 0.0
            elif emitter > world:
                weights[i, channel] = emitters.triangles.weight[row, channel]
            else:
                weights[i, channel] = emitters.weight[row, channel]


@kernel
def leave_darkness(origins, directions, dark, triangle, distance, material, lets_pass):
    """Begin n flights where the photons begin to carry light.

    A light with soft falloff does not light what is closer to it than a distance that differs from
    photon to photon. What a photon meets before it stops it, but is not lit by it: such a photon
    counts as one that left the scene, after a flight of no length. A surface that has transparent lobes
    may let it pass, still dark.

    Parameters
    ----------
    origins, directions : (n, 3) float32
        Flights; origins are moved.
    dark : (n,) float32
        How far they are dark; from `Emission.emit`, changed in place into what is left of it after the flight.
    triangle : (n,) int32, distance : (n,) float32
        What the flights hit, and where; changed in place.
    material : (nt,) int32
        Of triangles.
    lets_pass : (m,) bool
        See `lobes.LobeTable`.
    """
    for i in range(len(dark)):
        if dark[i] == 0.0:
            continue
        if distance[i] <= dark[i]:
            if lets_pass[material[triangle[i]]]:
                dark[i] -= distance[i]
            else:
                triangle[i] = MISS
            distance[i] = 0.0
            continue
        for axis in range(3):
            origins[i, axis] += dark[i] * directions[i, axis]
        distance[i] -= dark[i]
        dark[i] = 0.0


@merged
def _pick(cumulative, coarse, fine):
    """Return the emitter that a random number falls on.

    A table may have millions of triangles, more than 32 random bits can tell apart: `fine` adds
    the bits below those of `coarse`.
    """
    total = cumulative[-1]
    x = min((coarse + (fine - 0.5) / 4294967296.0) * total, np.nextafter(total, 0.0))
    low, high = 0, len(cumulative) - 1
    while low < high:
        middle = (low + high) // 2
        if cumulative[middle] > x:
            high = middle
        else:
            low = middle + 1
    return low


@merged
def _store(rows, row, x, y, z):
    """Write one float32 row."""
    rows[row, 0] = x
    rows[row, 1] = y
    rows[row, 2] = z
