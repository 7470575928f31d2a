"""Photons from emissive triangles: the same radiance from both sides, as Cycles has it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import merged
from ..scene import Float32, Int32, Scene
from ..surfaces import corner, unit_normal
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
        largest = emission.max(axis=1, initial=0.0, keepdims=True)
        # As in Cycles, an object that diffuse rays do not see does not light what is diffuse.
        emits = (largest > 0.0)[geometry.material, 0] & scene.diffuse_visible[geometry.object]
        return cls(
            vertices=geometry.vertices,
            triangles=geometry.triangles,
            material=geometry.material,
            emissive=np.flatnonzero(emits).astype(np.int32),
            weight=np.divide(emission, largest, out=np.zeros_like(emission), where=largest > 0.0),
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
    power: Float64 = math.pi * radiance * twice_area[:, None]
    return power


@merged
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
    a = corner(emitters.vertices, emitters.triangles, triangle, 0)
    b = corner(emitters.vertices, emitters.triangles, triangle, 1)
    c = corner(emitters.vertices, emitters.triangles, triangle, 2)
    nx, ny, nz, extent = unit_normal(a, b, c)
    if xi_2 < 0.5:
        nx, ny, nz = -nx, -ny, -nz

    # Uniform over the triangle: p = (1 − √ξ₀) a + √ξ₀ (1 − ξ₁) b + √ξ₀ ξ₁ c.
    root = math.sqrt(xi_0)
    t, u, v = 1.0 - root, root * (1.0 - xi_1), root * xi_1
    px = t * a[0] + u * b[0] + v * c[0]
    py = t * a[1] + u * b[1] + v * c[1]
    pz = t * a[2] + u * b[2] + v * c[2]
    away = offset_distance(px, py, pz, extent)
    dx, dy, dz = cosine_direction(nx, ny, nz, xi_3, xi_4)
    return px + away * nx, py + away * ny, pz + away * nz, dx, dy, dz
