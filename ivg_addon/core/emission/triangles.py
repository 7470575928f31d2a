"""Photons from emissive triangles: the same radiance from both sides, as Cycles has it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import inlined
from ..scene import Float32, Int32, Scene
from ..vectors import cosine_direction, offset_distance

Float64 = NDArray[np.float64]


class TriangleEmitters(NamedTuple):
    """Emissive triangles as the kernel sees them.

    vertices, triangles, material
        As in `scene.Geometry`.
    emissive : (n,) int32
        Indices of the triangles that emit.
    weight : (m, 3) float32
        Emission of each material over its largest channel.
    """

    vertices: Float32
    triangles: Int32
    material: Int32
    emissive: Int32
    weight: Float32

    @classmethod
    def of(cls, scene: Scene) -> TriangleEmitters:
        """Find the triangles that emit light which diffuse surfaces receive."""
        geometry = scene.geometry
        emission = scene.materials.emission
        largest = emission.max(axis=1, initial=0.0)
        # As in Cycles, an object that diffuse rays do not see does not light what is diffuse.
        emits = (largest > 0.0)[geometry.material] & scene.diffuse_visible[geometry.object]
        return cls(
            vertices=geometry.vertices,
            triangles=geometry.triangles,
            material=geometry.material,
            emissive=np.flatnonzero(emits).astype(np.int32),
            weight=emission / np.where(largest > 0.0, largest, 1.0)[:, None].astype(np.float32),
        )


def triangle_powers(emitters: TriangleEmitters, emission: Float32) -> Float64:
    """Return each emissive triangle's power, (n, 3) W: 2 π L times the area.

    `emission` is `Materials.emission`. Triangles without a finite area emit nothing.
    """
    corners = emitters.vertices[emitters.triangles[emitters.emissive]].astype(np.float64)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_area = np.linalg.norm(normal, axis=1)
    twice_area[~np.isfinite(twice_area)] = 0.0
    radiance = emission[emitters.material[emitters.emissive]].astype(np.float64)
    return math.pi * radiance * twice_area[:, None]


@inlined
def emit_triangle(emitters, triangle, xi_0, xi_1, xi_2, xi_3, xi_4):
    """Return a photon's origin and direction, six floats.

    Parameters
    ----------
    emitters : TriangleEmitters
    triangle
        Index into the geometry's triangles.
    xi_0 … xi_4
        Uniform in (0, 1): two place the photon, one picks the side, two its direction.
    """
    i, j, k = (
        emitters.triangles[triangle, 0],
        emitters.triangles[triangle, 1],
        emitters.triangles[triangle, 2],
    )
    ax, ay, az = (
        float(emitters.vertices[i, 0]),
        float(emitters.vertices[i, 1]),
        float(emitters.vertices[i, 2]),
    )
    ux, uy, uz = (
        emitters.vertices[j, 0] - ax,
        emitters.vertices[j, 1] - ay,
        emitters.vertices[j, 2] - az,
    )
    vx, vy, vz = (
        emitters.vertices[k, 0] - ax,
        emitters.vertices[k, 1] - ay,
        emitters.vertices[k, 2] - az,
    )
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    side = 1.0 / length if xi_2 < 0.5 else -1.0 / length
    nx, ny, nz = side * nx, side * ny, side * nz

    # Uniform over the triangle: p = a + √ξ₀ (1 − ξ₁) u + √ξ₀ ξ₁ v.
    root = math.sqrt(xi_0)
    s, t = root * (1.0 - xi_1), root * xi_1
    px = ax + s * ux + t * vx
    py = ay + s * uy + t * vy
    pz = az + s * uz + t * vz
    extent = math.sqrt(max(ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz))
    away = offset_distance(px, py, pz, extent)
    dx, dy, dz = cosine_direction(nx, ny, nz, xi_3, xi_4)
    return px + away * nx, py + away * ny, pz + away * nz, dx, dy, dz
