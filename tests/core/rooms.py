# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes made by hand: boxes, spheres and quads, each an object of its own, and lights whose photons are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ivg_addon.core.lights import AreaLights, Lights, PointLights
from ivg_addon.core.scene import NO_TEXTURE, Geometry, Materials, Scene

Float64 = NDArray[np.float64]


@dataclass(frozen=True)
class Part:
    """An object.

    Parameters
    ----------
    vertices : (nv, 3)
    triangles : (nt, 3) int
        Counter-clockwise seen from the front.
    material
        Index into the scene's materials.
    corner_normals : (nt, 3, 3), optional
        Shading normals; flat shading without them.
    visible
        Whether diffuse rays see it.
    """

    vertices: NDArray[np.floating]
    triangles: NDArray[np.integer]
    material: int = 0
    corner_normals: Float64 | None = None
    visible: bool = True


def quad(corner: ArrayLike, edge_u: ArrayLike, edge_v: ArrayLike, material: int = 0, visible: bool = True) -> Part:
    """Return a parallelogram whose front is on the side of edge_u × edge_v."""
    c, u, v = (np.asarray(x, dtype=np.float64) for x in (corner, edge_u, edge_v))
    return Part(np.stack([c, c + u, c + u + v, c + v]), np.array([[0, 1, 2], [0, 2, 3]]), material, visible=visible)


def box(
    low: ArrayLike, high: ArrayLike, material: int = 0, inward: bool = False, turn: Float64 | None = None, **rest: bool
) -> Part:
    """Return a box, its front outside or `inward`; `turn` (3, 3) rotates it about the origin."""
    corners = np.array([(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))])
    vertices = np.asarray(low) + corners * np.subtract(high, low)
    if turn is not None:
        vertices = vertices @ turn.T
    return Part(vertices, triangles[:, ::-1] if inward else triangles, material, **rest)


def ball(radius: float = 1.0, rounds: int = 1, material: int = 0, smooth: bool = True, inward: bool = False) -> Part:
    """Return an octahedron whose faces were divided into four, `rounds` times, on a sphere about the origin."""
    points = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], dtype=np.float64)
    faces = [(a, b, c) for a in (0, 1) for b in (2, 3) for c in (4, 5)]
    corners = np.array([points[list(face)] for face in faces])
    for _ in range(rounds):
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        ab, bc, ca = ((p + q) / np.linalg.norm(p + q, axis=1)[:, None] for p, q in ((a, b), (b, c), (c, a)))
        corners = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca))])
    outward = np.einsum(
        "ij,ij->i", np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), corners[:, 0]
    )
    turned = (outward > 0) == inward
    corners[turned] = corners[turned, ::-1]
    normals = (-corners if inward else corners) if smooth else None
    return Part(radius * corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), material, normals)


def rotation(axis: ArrayLike, angle: float) -> Float64:
    """Return a rotation matrix (Rodrigues' formula); `angle` in radians."""
    x, y, z = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k)


def scene(
    parts: Sequence[Part],
    albedo: ArrayLike = ((0.5, 0.5, 0.5),),
    emission: ArrayLike | None = None,
    lights: Lights | None = None,
) -> Scene:
    """Return a scene of parts; `albedo` and `emission` are (materials, 3)."""
    firsts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    counts = [len(part.triangles) for part in parts]
    vertices = np.concatenate([np.reshape(part.vertices, (-1, 3)) for part in parts]).astype(np.float32)
    triangles = np.concatenate([part.triangles + first for part, first in zip(parts, firsts, strict=False)])
    reflectance = np.array(albedo, dtype=np.float32).reshape(-1, 3)
    radiance = np.zeros_like(reflectance) if emission is None else np.array(emission, dtype=np.float32).reshape(-1, 3)
    return Scene(
        name="Test",
        geometry=Geometry(
            vertices=vertices,
            triangles=triangles.astype(np.int32),
            corner_normals=np.concatenate([_corner_normals(part) for part in parts]).astype(np.float32),
            uvs=np.zeros((len(triangles), 3, 2), dtype=np.float32),
            material=np.repeat([part.material for part in parts], counts).astype(np.int32),
            object=np.repeat(np.arange(len(parts)), counts).astype(np.int32),
        ),
        materials=Materials(
            names=tuple(f"Material {i}" for i in range(len(reflectance))),
            albedo=reflectance,
            texture=np.full(len(reflectance), NO_TEXTURE, dtype=np.int32),
            emission=radiance,
        ),
        textures=(),
        lights=Lights.none() if lights is None else lights,
        objects=tuple(f"Object {i}" for i in range(len(parts))),
        diffuse_visible=np.array([part.visible for part in parts], dtype=np.bool_),
    )


def _corner_normals(part: Part) -> Float64:
    """Return the part's shading normals, (nt, 3, 3)."""
    if part.corner_normals is not None:
        return part.corner_normals
    p = np.asarray(part.vertices, dtype=np.float32)[part.triangles].astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore"):
        normals = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    return np.repeat(normals[:, None], 3, axis=1)


def lamp(position: ArrayLike, power: ArrayLike = (1.0, 1.0, 1.0)) -> Lights:
    """Return a point light of so many watts, without radius."""
    return Lights(
        world=np.zeros(3, dtype=np.float32),
        point=PointLights(
            names=("Lamp",),
            position=np.array([position], dtype=np.float32),
            radius=np.zeros(1, dtype=np.float32),
            soft_falloff=np.zeros(1, dtype=np.bool_),
            intensity=np.array([power], dtype=np.float32) / np.float32(4 * np.pi),
            cos_half_angle=np.full(1, -1, dtype=np.float32),
            blend=np.zeros(1, dtype=np.float32),
            axes=np.eye(3, dtype=np.float32)[None],
        ),
    )


def beam(center: ArrayLike, edge_u: ArrayLike, edge_v: ArrayLike) -> Lights:
    """Return a rectangle that shines, with radiance 1/π, one parallel beam along edge_u × edge_v."""
    u, v = np.asarray(edge_u, dtype=np.float64), np.asarray(edge_v, dtype=np.float64)
    direction = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    return Lights(
        world=np.zeros(3, dtype=np.float32),
        area=AreaLights(
            names=("Beam",),
            center=np.array([center], dtype=np.float32),
            edge_u=np.array([u], dtype=np.float32),
            edge_v=np.array([v], dtype=np.float32),
            direction=np.array([direction], dtype=np.float32),
            elliptic=np.zeros(1, dtype=np.bool_),
            half_spread=np.zeros(1, dtype=np.float32),
            radiance=np.full((1, 3), 1 / np.pi, dtype=np.float32),
        ),
    )


def sky(radiance: ArrayLike = (1.0, 1.0, 1.0)) -> Lights:
    """Return a world of uniform radiance."""
    return Lights(world=np.array(radiance, dtype=np.float32))
