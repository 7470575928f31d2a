# SPDX-License-Identifier: GPL-3.0-or-later
"""Photons from emissive triangles: from one side or both, constant or textured; see `pieces`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import inlined, kernel, merged
from ..errors import SceneError
from ..scene import NO_TEXTURE, VIEW_STEPS, Float32, Int32, Scene
from ..surfaces import corner, texture_coordinates, unit_normal
from ..textures import TexturePool, pack_textures, sample_texture
from ..vectors import cosine_direction, offset_distance
from .pieces import BACK_SIDE, BOTH_SIDES, Pieces, cut_into_pieces, emission_textures, place_in_triangle

Float64 = NDArray[np.float64]


class TriangleEmitters(NamedTuple):
    """Emissive triangles as the kernel sees them.

    vertices, triangles, uvs
        As in `scene.Geometry`.
    pieces
        What photons start on.
    emission : (m, 3) float32
        As in `scene.Materials`.
    texture : (m,) int32
        Index into `pool` of each material's emission texture, or `NO_TEXTURE`.
    pool : TexturePool
        The textures of emission alone.
    views : (m or 0, VIEW_STEPS, 3) float32
        `scene.Materials.emission_view`; empty where all shine alike in all directions.
    """

    vertices: Float32
    triangles: Int32
    uvs: Float32
    pieces: Pieces
    emission: Float32
    texture: Int32
    pool: TexturePool
    views: Float32

    @classmethod
    def of(cls, scene: Scene) -> TriangleEmitters:
        """Find the triangles that emit light which diffuse surfaces receive.

        Raises
        ------
        SceneError
            If a material's emission is not a number.
        """
        geometry, materials = scene.geometry, scene.materials
        texture = emission_textures(materials)
        _check_emission(scene, texture)
        emits = materials.emission.max(axis=1, initial=0.0) > 0.0
        if materials.back is not None:
            emits |= emits[materials.back]
        # As in Cycles, an object that diffuse rays do not see does not light what is diffuse.
        shines = np.flatnonzero(emits[geometry.material] & scene.diffuse_visible[geometry.object])
        used = np.unique(texture[texture != NO_TEXTURE])
        renumbered = np.full(len(scene.textures) + 1, NO_TEXTURE, dtype=np.int32)
        renumbered[used] = np.arange(len(used))
        return cls(
            vertices=geometry.vertices,
            triangles=geometry.triangles,
            uvs=geometry.uvs,
            pieces=cut_into_pieces(geometry, materials, scene.textures, shines.astype(np.int32)),
            emission=materials.emission,
            # The last row, which NO_TEXTURE names, stays NO_TEXTURE.
            texture=renumbered[texture],
            pool=pack_textures([scene.textures[index] for index in used]),
            views=np.zeros((0, VIEW_STEPS, 3), dtype=np.float32)
            if materials.emission_view is None
            else materials.emission_view,
        )


def _check_emission(scene: Scene, texture: Int32) -> None:
    """Raise `SceneError` that names the first material whose emission is not a number, or negative."""
    for name, radiance, index in zip(scene.materials.names, scene.materials.emission, texture, strict=True):
        if not (np.isfinite(radiance) & (radiance >= 0.0)).all():
            raise SceneError(f"material '{name}' emits {radiance} W/(m² sr): use finite, positive values")
        if index != NO_TEXTURE and radiance.any():
            pixels = scene.textures[index].pixels
            if not (np.isfinite(pixels) & (pixels >= 0.0)).all():
                raise SceneError(
                    f"material '{name}' emits by the texture '{scene.textures[index].name}', which has texels that "
                    "are negative or not numbers"
                )


def triangle_strengths(emitters: TriangleEmitters) -> tuple[Float64, Float64]:
    """Return what photons stand for, and the power of all triangles.

    Returns
    -------
    (n,) float64
        Of each piece, W: π times its bound, its area, and the number of its sides.
    (3,) float64
        W; of textured triangles by one look-up in the middle of each piece. Photons follow the texture itself,
        whatever this sum is.
    """
    strengths = np.empty(len(emitters.pieces.triangle), dtype=np.float64)
    power = np.zeros(3, dtype=np.float64)
    measure_pieces(emitters, strengths, power)
    return strengths, power


@kernel
def measure_pieces(emitters, strengths, power):
    """Fill strengths (n,) and add to power (3,); see `triangle_strengths`."""
    vertices, triangles, pieces = emitters.vertices, emitters.triangles, emitters.pieces
    for piece in range(len(strengths)):
        triangle = pieces.triangle[piece]
        a = corner(vertices, triangles, triangle, 0)
        b = corner(vertices, triangles, triangle, 1)
        c = corner(vertices, triangles, triangle, 2)
        px, py, pz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        qx, qy, qz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        x, y, z = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
        per_radiance = 0.5 * math.pi * math.sqrt(x * x + y * y + z * z) / pieces.divisions[piece] ** 2
        if pieces.side[piece] == BOTH_SIDES:
            per_radiance *= 2.0
        if not per_radiance < math.inf:
            per_radiance = 0.0
        strengths[piece] = per_radiance * pieces.bound[piece]
        _, t, u = place_in_triangle(pieces.divisions[piece], pieces.part[piece], 1 / 3, 1 / 3)
        material = pieces.material[piece]
        red = green = blue = 1.0
        if emitters.texture[material] != NO_TEXTURE:
            red, green, blue = texture_of_emission(
                emitters.uvs, emitters.pool, emitters.texture[material], triangle, t, u
            )
        power[0] += per_radiance * emitters.emission[material, 0] * red
        power[1] += per_radiance * emitters.emission[material, 1] * green
        power[2] += per_radiance * emitters.emission[material, 2] * blue


@merged
def emit_triangle(vertices, triangles, of_triangle, sides, divisions, index, piece, xi_0, xi_1, xi_2, xi_3, xi_4):
    """Return a photon's origin, direction and barycentric coordinates u, v: eight floats.

    Parameters
    ----------
    vertices … index
        Fields of `TriangleEmitters` and its pieces, taken out before the loop: out of their tuple Numba would count
        references to each of its arrays for every photon.
    piece
        Index into the pieces.
    xi_0 … xi_4
        Uniform in (0, 1): two place the photon, one picks the side, two its direction.
    """
    triangle, side = of_triangle[piece], sides[piece]
    a = corner(vertices, triangles, triangle, 0)
    b = corner(vertices, triangles, triangle, 1)
    c = corner(vertices, triangles, triangle, 2)
    nx, ny, nz, extent = unit_normal(a, b, c)
    if side == BACK_SIDE or (side == BOTH_SIDES and xi_2 < 0.5):
        nx, ny, nz = -nx, -ny, -nz

    # Uniform over the piece: p = (1 − √ξ₀) a + √ξ₀ (1 − ξ₁) b + √ξ₀ ξ₁ c.
    root = math.sqrt(xi_0)
    t, u, v = place_in_triangle(divisions[piece], index[piece], root * (1.0 - xi_1), root * xi_1)
    px = t * a[0] + u * b[0] + v * c[0]
    py = t * a[1] + u * b[1] + v * c[1]
    pz = t * a[2] + u * b[2] + v * c[2]
    away = offset_distance(px, py, pz, extent)
    dx, dy, dz = cosine_direction(nx, ny, nz, xi_3, xi_4)
    return px + away * nx, py + away * ny, pz + away * nz, dx, dy, dz, u, v


@inlined
def texture_of_emission(uvs, pool, texture, triangle, u, v):
    """Return what a texture multiplies emission by at barycentric coordinates u, v, three float64."""
    s, t = texture_coordinates(uvs, triangle, u, v)
    return sample_texture(pool, texture, s, t)
