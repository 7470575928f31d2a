# SPDX-License-Identifier: GPL-3.0-or-later
"""The kernels that emit photons."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import kernel, merged
from ..embree import MISS
from ..lights import NO_PATTERN
from ..matte import view_factor
from ..random import STREAM_EMISSION, random4
from ..scene import NO_TEXTURE, Float32
from .area import AreaEmitters, emit_area, on_area
from .distant import Box, SunEmitters, emit_sun, emit_world, through_nested
from .environment import MapEmitters, emit_map
from .guide import Guide, pick_leaf, within_leaf
from .patterns import PatternEmitters, pick_texel
from .points import PointEmitters, emit_patterned_point, emit_point
from .search import first_above
from .triangles import TriangleEmitters, emit_triangle, texture_of_emission

_OUTWARDS = 1.0 / math.sqrt(3.0)


class Emitters(NamedTuple):
    """All emitters in a row: areas, points, the surroundings, pieces of emissive triangles.

    The surroundings are suns, the world and environment maps: all of them through each of the boxes but past the next,
    for one box after the other.

    cumulative : (emitters,) float64
        Σ s up to and with each emitter, s as `guide` makes it.
    weight : (emitters before the maps, 3) float32
        Power of each light over its largest channel. Maps have theirs by texel, triangles by material and texture.
    box
        Around the scene and the grid.
    boxes
        That box, and where it pays (`distant.py`) smaller ones down to the grid's: arrays (boxes, 3).
    guide
        Of the surroundings.
    patterns
        Those of areas and points, whose weights they multiply.
    """

    cumulative: NDArray[np.float64]
    weight: Float32
    areas: AreaEmitters
    points: PointEmitters
    suns: SunEmitters
    maps: MapEmitters
    triangles: TriangleEmitters
    box: Box
    boxes: Box
    guide: Guide
    patterns: PatternEmitters


@kernel
def emit_photons(seed, first_photon, emitters, origins, directions, weights, dark):
    """Fill in n photons; parameters as in `Emission.emit`."""
    first_point = len(emitters.areas.center)
    first_sun = first_point + len(emitters.points.radius)
    world = first_sun + len(emitters.suns.direction)
    first_triangle = first_sun + len(emitters.guide.first_leaf) - 1
    boxes = len(emitters.boxes.low)
    sources = (first_triangle - first_sun) // boxes
    map_count = sources - (world - first_sun) - 1
    center, edge_u, edge_v, direction, elliptic, slat_range = emitters.areas
    box_low, box_high, box_areas = emitters.boxes
    out_x, out_y, out_z = emitters.box.high[0], emitters.box.high[1], emitters.box.high[2]
    first_leaf, leaf_sums, leaf_low, leaf_size, leaf_weight, rest = emitters.guide
    map_row, map_column, map_texel, map_row_sums, map_sums, color, latitude, longitude, row_bounds, column_bounds = (
        emitters.maps
    )
    vertices, triangles, uvs, pieces, emission, texture, pool, views = emitters.triangles
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
        row = emitter
        part = rest[0]
        box = 0
        red = green = blue = 0.0
        if first_point <= emitter < first_sun:
            light = emitter - first_point
            pattern = point_pattern[light]
            if pattern == NO_PATTERN:
                ox, oy, oz, dx, dy, dz, distance, exists = emit_point(emitters.points, light, seed, photon, xi_0, xi_1)
            else:
                xi, _, _, _ = random4(seed, photon, STREAM_EMISSION + 1)
                texel, line, column = pick_texel(first_texel, columns, texel_sums, pattern, xi)
                ox, oy, oz, dx, dy, dz, distance = emit_patterned_point(
                    emitters.points, light, line, rows[pattern], column, columns[pattern], seed, photon, xi_0, xi_1
                )
        else:
            xi_2, xi_3, xi_4, xi_5 = random4(seed, photon, STREAM_EMISSION + 1)
            if first_sun <= emitter < first_triangle:
                leaf = pick_leaf(first_leaf, leaf_sums, emitter - first_sun, xi_5)
                part = leaf_weight[leaf]
                xi_0, xi_1, xi_2, xi_3, xi_4 = within_leaf(leaf_low, leaf_size, leaf, xi_0, xi_1, xi_2, xi_3, xi_4)
                box = (emitter - first_sun) // sources
                row = emitter - box * sources
            if emitter < first_point:
                pattern = area_pattern[emitter]
                if pattern == NO_PATTERN:
                    u, v = on_area(elliptic[emitter], xi_0, xi_1)
                else:
                    texel, line, column = pick_texel(first_texel, columns, texel_sums, pattern, xi_5)
                    u = (column + xi_0) / columns[pattern] - 0.5
                    v = (line + xi_1) / rows[pattern] - 0.5
                    exists = not elliptic[emitter] or u * u + v * v < 0.25
                ox, oy, oz, dx, dy, dz = emit_area(
                    center, edge_u, edge_v, direction, slat_range, emitter, u, v, xi_2, xi_3, xi_4
                )
            elif row < world:
                light = row - first_sun
                ox, oy, oz, dx, dy, dz, exists = emit_sun(
                    emitters.suns, light, box_low, box_high, box_areas, box, xi_0, xi_1, xi_2, xi_3, xi_4
                )
            elif row == world:
                ox, oy, oz, dx, dy, dz = emit_world(box_low, box_high, box_areas, box, xi_0, xi_1, xi_2, xi_3, xi_4)
            elif emitter < first_triangle:
                ox, oy, oz, dx, dy, dz, exists, texel = emit_map(
                    map_row,
                    map_column,
                    map_texel,
                    map_row_sums,
                    map_sums,
                    latitude,
                    longitude,
                    row_bounds,
                    column_bounds,
                    row - world - 1 + box * map_count,
                    box_low,
                    box_high,
                    box_areas,
                    box,
                    xi_0,
                    xi_1,
                    xi_2,
                    xi_3,
                    xi_4,
                )
                texel %= len(color)
                red, green, blue = color[texel, 0], color[texel, 1], color[texel, 2]
            else:
                piece = emitter - first_triangle
                ox, oy, oz, dx, dy, dz, u, v = emit_triangle(
                    vertices, triangles, of_triangle, sides, divisions, index, piece, xi_0, xi_1, xi_2, xi_3, xi_4
                )
                material = of_material[piece]
                share = 1.0 / bound[piece]
                red, green, blue = emission[material, 0], emission[material, 1], emission[material, 2]
                if texture[material] != NO_TEXTURE:
                    r, g, b = texture_of_emission(uvs, pool, texture[material], of_triangle[piece], u, v)
                    red, green, blue = red * r, green * g, blue * b
                if len(views):
                    # The cosine with which `cosine_direction` draws.
                    r, g, b = view_factor(views, material, math.sqrt(1.0 - xi_3))
                    red, green, blue = red * r, green * g, blue * b
                # At most 1 but for rounding.
                red, green, blue = min(1.0, share * red), min(1.0, share * green), min(1.0, share * blue)
            if boxes > 1 and exists and first_sun <= emitter < first_triangle:
                ox, oy, oz, exists = through_nested(box_low, box_high, box, ox, oy, oz, dx, dy, dz)
        if not exists:
            # Out of sight: from the box's far corner away from everything.
            ox, oy, oz = out_x, out_y, out_z
            part = 0.0
            dx = dy = dz = _OUTWARDS
            distance = 0.0
        dark[i] = distance
        _store(origins, i, ox, oy, oz)
        _store(directions, i, dx, dy, dz)
        if row <= world:
            red, green, blue = weight[row, 0], weight[row, 1], weight[row, 2]
            if texel >= 0:
                r, g, b = texel_color[texel, 0], texel_color[texel, 1], texel_color[texel, 2]
                red, green, blue = red * r, green * g, blue * b
        _store(weights, i, part * red, part * green, part * blue)


@kernel
def draw_photons(seed, first_photon, emitters, guided, leaf, numbers):
    """Fill in what `emit_photons` draws for n photons, so that it can be learnt where they are of use.

    Parameters
    ----------
    guided : (n,) int32
        Index of the guided emitter; −1 for all others.
    leaf : (n,) int64
        Of all leaves of the guide.
    numbers : (n, 5) float64
        The five numbers that say where the photon flies.
    """
    first_sun = len(emitters.areas.center) + len(emitters.points.radius)
    first_triangle = first_sun + len(emitters.guide.first_leaf) - 1
    first_leaf, leaf_sums, leaf_low, leaf_size, _, _ = emitters.guide
    cumulative = emitters.cumulative
    for i in range(len(guided)):
        coarse, fine, xi_0, xi_1 = random4(seed, first_photon + i, STREAM_EMISSION)
        emitter = pick(cumulative, coarse, fine)
        guided[i] = -1
        if not first_sun <= emitter < first_triangle:
            continue
        xi_2, xi_3, xi_4, xi_5 = random4(seed, first_photon + i, STREAM_EMISSION + 1)
        guided[i] = emitter - first_sun
        leaf[i] = pick_leaf(first_leaf, leaf_sums, emitter - first_sun, xi_5)
        drawn = within_leaf(leaf_low, leaf_size, leaf[i], xi_0, xi_1, xi_2, xi_3, xi_4)
        for number in range(5):
            numbers[i, number] = drawn[number]


@kernel
def find_standards(seed, first_photon, emitters, standards):
    """Fill in the factor that the guide gives the weights of n photons, (n,) float32."""
    first_sun = len(emitters.areas.center) + len(emitters.points.radius)
    first_triangle = first_sun + len(emitters.guide.first_leaf) - 1
    first_leaf, leaf_sums, _, _, leaf_weight, rest = emitters.guide
    cumulative = emitters.cumulative
    for i in range(len(standards)):
        coarse, fine, _, _ = random4(seed, first_photon + i, STREAM_EMISSION)
        emitter = pick(cumulative, coarse, fine)
        standards[i] = rest[0]
        if first_sun <= emitter < first_triangle:
            _, _, _, xi_5 = random4(seed, first_photon + i, STREAM_EMISSION + 1)
            standards[i] = leaf_weight[pick_leaf(first_leaf, leaf_sums, emitter - first_sun, xi_5)]


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
    return first_above(cumulative, 0, len(cumulative) - 1, x)


@merged
def _store(rows, row, x, y, z):
    """Write one float32 row."""
    rows[row, 0] = x
    rows[row, 1] = y
    rows[row, 2] = z
