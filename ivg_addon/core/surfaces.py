# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's surfaces as kernels see them: arrays in a row, and what is asked of them at a hit."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .compiled import inlined, kernel, merged
from .lobes import LobeTable
from .scene import Float32, Int32, Scene
from .surface_bins import SurfaceBins
from .textures import TexturePool, pack_textures

_FLAT = 1e-5
"""Corner normals that differ less from the geometric normal are it, but for rounding."""


class Surfaces(NamedTuple):
    """The scene's surfaces; fields as in `scene.Geometry` and `scene.Materials`, and some more.

    planes : (nt, 4) float32
        Unit geometric normal, and the longest edge at the first corner in metres.
    smooth : (nt,) bool
        False for triangles whose shading normal is the geometric one everywhere.
    reflects : (nt,) bool
        False for triangles that absorb all: diffuse rays do not see them.
    special : (nt,) bool
        True for those, and for triangles whose materials have lobes on either side.
    back : (m,) int32
        The material that describes a material's back side; itself where both sides are alike.
    bin_divisions : (nt, 3) int32, bin_offset : (nt,) int64
        See `surface_bins.SurfaceBins`.
    """

    vertices: Float32
    triangles: Int32
    planes: Float32
    smooth: NDArray[np.bool_]
    corner_normals: Float32
    uvs: Float32
    material: Int32
    reflects: NDArray[np.bool_]
    special: NDArray[np.bool_]
    back: Int32
    albedo: Float32
    texture: Int32
    lobes: LobeTable
    pool: TexturePool
    bin_divisions: Int32
    bin_offset: NDArray[np.int64]

    @classmethod
    def of(cls, scene: Scene, bins: SurfaceBins) -> Surfaces:
        """Gather a scene's surfaces."""
        geometry, materials = scene.geometry, scene.materials
        back = np.arange(len(materials.names), dtype=np.int32) if materials.back is None else materials.back
        planes = np.empty((geometry.triangle_count, 4), dtype=np.float32)
        smooth = np.empty(geometry.triangle_count, dtype=np.bool_)
        measure_triangles(geometry.vertices, geometry.triangles, geometry.corner_normals, planes, smooth)
        lobes = LobeTable.of(materials, back)
        reflects = scene.diffuse_visible[geometry.object]
        return cls(
            vertices=geometry.vertices,
            triangles=geometry.triangles,
            planes=planes,
            smooth=smooth,
            corner_normals=geometry.corner_normals,
            uvs=geometry.uvs,
            material=geometry.material,
            reflects=reflects,
            special=~reflects | lobes.scatters[geometry.material],
            back=back,
            albedo=materials.albedo,
            texture=materials.texture,
            lobes=lobes,
            pool=pack_textures(scene.textures),
            bin_divisions=bins.divisions,
            bin_offset=bins.offset,
        )


@inlined
def corner(vertices, triangles, triangle, index):
    """Return a triangle's corner as three float64."""
    vertex = triangles[triangle, index]
    return float(vertices[vertex, 0]), float(vertices[vertex, 1]), float(vertices[vertex, 2])


@inlined
def place_at(p, q, r, u, v):
    """Return the place (1 − u − v) p + u q + v r, three floats."""
    w = 1.0 - u - v
    return w * p[0] + u * q[0] + v * r[0], w * p[1] + u * q[1] + v * r[1], w * p[2] + u * q[2] + v * r[2]


@inlined
def unit_normal(p, q, r):
    """Return the unit normal (p, q, r counter-clockwise) and the triangle's longest edge at p."""
    ax, ay, az = q[0] - p[0], q[1] - p[1], q[2] - p[2]
    bx, by, bz = r[0] - p[0], r[1] - p[1], r[2] - p[2]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    extent = math.sqrt(max(ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz))
    if length == 0.0:
        return 0.0, 0.0, 1.0, extent
    return nx / length, ny / length, nz / length, extent


@kernel
def measure_triangles(vertices, triangles, corner_normals, planes, smooth):
    """Fill planes (nt, 4) float32 and smooth (nt,) bool; see `Surfaces`."""
    for triangle in range(len(triangles)):
        p = corner(vertices, triangles, triangle, 0)
        q = corner(vertices, triangles, triangle, 1)
        r = corner(vertices, triangles, triangle, 2)
        x, y, z, extent = unit_normal(p, q, r)
        planes[triangle, 0] = np.float32(x)
        planes[triangle, 1] = np.float32(y)
        planes[triangle, 2] = np.float32(z)
        planes[triangle, 3] = np.float32(extent)
        smooth[triangle] = False
        for c in range(3):
            along = corner_normals[triangle, c, 0] * x + corner_normals[triangle, c, 1] * y
            along += corner_normals[triangle, c, 2] * z
            if along < 1.0 - _FLAT:
                smooth[triangle] = True


@merged
def shading_normal(corner_normals, triangle, u, v):
    """Return the interpolated unit normal on the front side at barycentric coordinates u, v."""
    w = 1.0 - u - v
    x = w * corner_normals[triangle, 0, 0] + u * corner_normals[triangle, 1, 0] + v * corner_normals[triangle, 2, 0]
    y = w * corner_normals[triangle, 0, 1] + u * corner_normals[triangle, 1, 1] + v * corner_normals[triangle, 2, 1]
    z = w * corner_normals[triangle, 0, 2] + u * corner_normals[triangle, 1, 2] + v * corner_normals[triangle, 2, 2]
    length = math.sqrt(x * x + y * y + z * z)
    if length == 0.0:
        return 0.0, 0.0, 0.0
    return x / length, y / length, z / length


@merged
def texture_coordinates(uvs, triangle, u, v):
    """Return the texture coordinates at barycentric coordinates u, v."""
    w = 1.0 - u - v
    return (
        w * uvs[triangle, 0, 0] + u * uvs[triangle, 1, 0] + v * uvs[triangle, 2, 0],
        w * uvs[triangle, 0, 1] + u * uvs[triangle, 1, 1] + v * uvs[triangle, 2, 1],
    )
