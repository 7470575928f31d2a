"""The kernels that emit photons."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import kernel, merged
from ..embree import MISS
from ..lights import NO_PATTERN
from ..random import STREAM_EMISSION, random4
from ..scene import NO_TEXTURE, Float32
from .area import AreaEmitters, emit_area, on_area
from .distant import Box, SunEmitters, emit_sun, emit_world
from .patterns import PatternEmitters, pick_texel
from .points import PointEmitters, emit_patterned_point, emit_point
from .triangles import TriangleEmitters, emit_triangle, texture_of_emission

_OUTWARDS = 1.0 / math.sqrt(3.0)


class Emitters(NamedTuple):
    """All emitters in a row: areas, points, suns, the world, pieces of emissive triangles.

    cumulative : (emitters,) float64
        Σ s up to and with each emitter.
    weight : (emitters before the triangles, 3) float32
        Power of each light over its largest channel. Triangles have theirs by material and texture.
    patterns
        Those of areas and points, whose weights they multiply.
    """

    cumulative: NDArray[np.float64]
    weight: Float32
    areas: AreaEmitters
    points: PointEmitters
    suns: SunEmitters
    triangles: TriangleEmitters
    box: Box
    patterns: PatternEmitters


@kernel
def emit_photons(seed, first_photon, emitters, origins, directions, weights, dark):
    """Fill in n photons; parameters as in `Emission.emit`."""
    first_point = len(emitters.areas.center)
    first_sun = first_point + len(emitters.points.radius)
    world = first_sun + len(emitters.suns.direction)
    center, edge_u, edge_v, direction, elliptic, slat_range = emitters.areas
    vertices, triangles, uvs, pieces, emission, texture, pool = emitters.triangles
    of_triangle, sides, of_material, divisions, index, bound = pieces
    weight = emitters.weight
    area_pattern, point_pattern, first_texel, columns, rows, texel_sums, texel_color = emitters.patterns
    for i in range(len(origins)):
        photon = first_photon + i
        coarse, fine, xi_0, xi_1 = random4(seed, photon, STREAM_EMISSION)
        emitter = pick(emitters.cumulative, coarse, fine)
        distance = 0.0
        exists = True
        texel = -1
        red = green = blue = 0.0
        if first_point <= emitter < first_sun:
            light = emitter - first_point
            pattern = point_pattern[light]
            if pattern == NO_PATTERN:
                ox, oy, oz, dx, dy, dz, distance, exists = emit_point(emitters.points, light, seed, photon, xi_0, xi_1)
            else:
                xi, _, _, _ = random4(seed, photon, STREAM_EMISSION + 1)
                texel = pick_texel(first_texel, texel_sums, pattern, xi)
                row, column = divmod(texel - first_texel[pattern], columns[pattern])
                ox, oy, oz, dx, dy, dz, distance = emit_patterned_point(
                    emitters.points, light, row, rows[pattern], column, columns[pattern], seed, photon, xi_0, xi_1
                )
        else:
            xi_2, xi_3, xi_4, xi_5 = random4(seed, photon, STREAM_EMISSION + 1)
            if emitter < first_point:
                pattern = area_pattern[emitter]
                if pattern == NO_PATTERN:
                    u, v = on_area(elliptic[emitter], xi_0, xi_1)
                else:
                    texel = pick_texel(first_texel, texel_sums, pattern, xi_5)
                    row, column = divmod(texel - first_texel[pattern], columns[pattern])
                    u = (column + xi_0) / columns[pattern] - 0.5
                    v = (row + xi_1) / rows[pattern] - 0.5
                    exists = not elliptic[emitter] or u * u + v * v < 0.25
                ox, oy, oz, dx, dy, dz = emit_area(
                    center, edge_u, edge_v, direction, slat_range, emitter, u, v, xi_2, xi_3, xi_4
                )
            elif emitter < world:
                light = emitter - first_sun
                ox, oy, oz, dx, dy, dz, exists = emit_sun(
                    emitters.suns, light, emitters.box, xi_0, xi_1, xi_2, xi_3, xi_4
                )
            elif emitter == world:
                ox, oy, oz, dx, dy, dz = emit_world(emitters.box, xi_0, xi_1, xi_2, xi_3, xi_4)
            else:
                piece = emitter - world - 1
                ox, oy, oz, dx, dy, dz, u, v = emit_triangle(
                    vertices, triangles, of_triangle, sides, divisions, index, piece, xi_0, xi_1, xi_2, xi_3, xi_4
                )
                material = of_material[piece]
                share = 1.0 / bound[piece]
                red, green, blue = emission[material, 0], emission[material, 1], emission[material, 2]
                if texture[material] != NO_TEXTURE:
                    r, g, b = texture_of_emission(uvs, pool, texture[material], of_triangle[piece], u, v)
                    red, green, blue = red * r, green * g, blue * b
                # At most 1 but for rounding.
                red, green, blue = min(1.0, share * red), min(1.0, share * green), min(1.0, share * blue)
        if not exists:
            # Out of sight: from the box's far corner away from everything.
            ox, oy, oz = emitters.box.high[0], emitters.box.high[1], emitters.box.high[2]
            dx = dy = dz = _OUTWARDS
            distance = 0.0
        dark[i] = distance
        _store(origins, i, ox, oy, oz)
        _store(directions, i, dx, dy, dz)
        if exists and emitter <= world:
            red, green, blue = weight[emitter, 0], weight[emitter, 1], weight[emitter, 2]
            if texel >= 0:
                red, green, blue = (
                    red * texel_color[texel, 0],
                    green * texel_color[texel, 1],
                    blue * texel_color[texel, 2],
                )
        _store(weights, i, red, green, blue)


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
def pick(cumulative, coarse, fine):
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
