# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes and where they stand, made into one list of triangles in world space.

Embree's Python binding has no instances, so each instance's triangles are written out. What
Blender hands over is kept as it comes (values per face corner, each mesh once) and expanded slice
by slice, so that little more than the result is ever held.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .errors import MemoryLimitError
from .memory import require
from .placing import measure_areas, place_normals, sound_triangles
from .progress import Progress
from .scene import Float32, Geometry, Int32

Float64 = NDArray[np.float64]

SLICE = 1 << 17
"""Triangles or vertices that are treated at a time."""

_BYTES_PER_TRIANGLE = 12 + 36 + 24 + 4 + 4
_BYTES_PER_VERTEX = 12
_BYTES_IN_A_BAKE = 200
"""What a bake makes of a triangle besides: Embree's structure, patches and what kernels read."""
_NO_NORMALS = np.zeros((0, 3), dtype=np.float32)


@dataclass(frozen=True)
class MeshData:
    """A mesh in its own space, as Blender stores it.

    Parameters
    ----------
    positions : (nv, 3) float32
    corner_vertex : (nc,) int32
        Vertex of each face corner.
    triangle_corners : (nt, 3) int32
        Face corners of each triangle, counter-clockwise seen from the front.
    corner_normals : (nc, 3) float32, or None
        Shading normals; None where the whole mesh is shaded flat.
    slot : (nt,) int32, or None
        Material slot of each triangle; None means the first.
    uv_maps
        Texture coordinates (nc, 2) float32 by the name of their map; only those that are needed.
    triangle_uvs
        Texture coordinates (nt, 3, 2) float32 that triangles do not share, by the name of their map.
    ribbons
        Only fronts meet light: see `ribbons`.
    """

    positions: Float32
    corner_vertex: Int32
    triangle_corners: Int32
    corner_normals: Float32 | None = None
    slot: Int32 | None = None
    uv_maps: dict[str, Float32] = field(default_factory=dict)
    triangle_uvs: dict[str, Float32] = field(default_factory=dict)
    ribbons: bool = False


@dataclass(frozen=True)
class Instances:
    """A mesh that stands in k places, with the same materials in all.

    Parameters
    ----------
    mesh
        Index into the meshes.
    objects : (k,) int32
        Indices into `scene.Scene.objects`.
    matrices : (k, 4, 4) float32 or float64
        From the mesh's space to world space.
    materials
        For each slot, an index into `scene.Materials`, or `LIGHT_PASSES`.
    uv_map
        For each slot, the name of the UV map that its material reads, or None.
    """

    mesh: int
    objects: Int32
    matrices: Float32 | Float64
    materials: tuple[int, ...]
    uv_map: tuple[str | None, ...]


_MIRRORED = [0, 2, 1]
"""The order of a triangle's corners under a mirroring transform."""
LIGHT_PASSES = -1
"""In place of a material: light passes through these faces, so they are left out."""


@dataclass(frozen=True)
class Flattened:
    """The result.

    Parameters
    ----------
    geometry
        All triangles that can be lit.
    dropped
        Triangles without area, or with coordinates that are not finite, by object index.
    unique_triangles
        Triangles before they were repeated for instances.
    ribbons : (k,) int64
        Triangles of meshes that are ribbons.
    """

    geometry: Geometry
    dropped: dict[int, int]
    unique_triangles: int
    ribbons: NDArray[np.int64]


class _Store:
    """Arrays of the final size, filled from the front."""

    def __init__(self, vertices: int, triangles: int) -> None:
        require(
            vertices * _BYTES_PER_VERTEX + triangles * (_BYTES_PER_TRIANGLE + _BYTES_IN_A_BAKE),
            f"the scene's geometry ({triangles:,} triangles with all instances)",
            "hide instances in renders, or lower their subdivision",
        )
        if max(vertices, triangles) > np.iinfo(np.int32).max:
            raise MemoryLimitError(
                f"the scene has {triangles:,} triangles with all instances, more than 32-bit indices "
                "can count: hide instances in renders, or lower their subdivision"
            )
        self.vertices = np.empty((vertices, 3), dtype=np.float32)
        self.triangles = np.empty((triangles, 3), dtype=np.int32)
        self.corner_normals = np.empty((triangles, 3, 3), dtype=np.float32)
        self.uvs = np.zeros((triangles, 3, 2), dtype=np.float32)
        self.material = np.empty(triangles, dtype=np.int32)
        self.object = np.empty(triangles, dtype=np.int32)
        self.vertex_count = 0
        self.count = 0
        self.ribbons = [np.zeros(0, dtype=np.int64)]

    def geometry(self) -> Geometry:
        n = self.count
        return Geometry(
            vertices=self.vertices,
            triangles=self.triangles[:n],
            corner_normals=self.corner_normals[:n],
            uvs=self.uvs[:n],
            material=self.material[:n],
            object=self.object[:n],
        )


def flatten_steps(meshes: list[MeshData], instances: list[Instances]) -> Generator[Progress, None, Flattened]:
    """Write out all instances' triangles, in world space.

    An instance with a mirroring transform has its winding turned, so that the front of the mesh
    stays the front, as in Cycles. Triangles that cannot be lit are left out and counted.

    Raises
    ------
    MemoryLimitError
        When the result does not fit.
    """
    triangles = sum(len(group.objects) * len(meshes[group.mesh].triangle_corners) for group in instances)
    store = _Store(sum(len(group.objects) * len(meshes[group.mesh].positions) for group in instances), triangles)
    dropped: dict[int, int] = {}
    done = 0
    for batch in _batches(meshes, instances):
        first_vertex = _place_vertices(batch, store)
        for part in _slices(len(batch.mesh.triangle_corners)):
            lost = _place_triangles(batch, part, first_vertex, store)
            for index in np.flatnonzero(lost):
                name = int(batch.objects[index])
                dropped[name] = dropped.get(name, 0) + int(lost[index])
            done += len(batch.objects) * (part.stop - part.start)
            yield Progress("Placing geometry", done / triangles)
    used = {group.mesh for group in instances}
    unique = sum(len(meshes[i].triangle_corners) for i in used)
    return Flattened(store.geometry(), dropped, unique, np.concatenate(store.ribbons))


@dataclass(frozen=True)
class _Batch:
    """Instances of one mesh with the same materials, few enough to be treated at a time."""

    mesh: MeshData
    matrices: Float64
    objects: Int32
    materials: Int32
    uv_map: tuple[str | None, ...]


def _batches(meshes: list[MeshData], instances: list[Instances]) -> Iterator[_Batch]:
    for group in instances:
        mesh = meshes[group.mesh]
        size = max(1, SLICE // max(len(mesh.triangle_corners), len(mesh.positions), 1))
        for start in range(0, len(group.objects), size):
            yield _Batch(
                mesh=mesh,
                matrices=group.matrices[start : start + size].astype(np.float64),
                objects=group.objects[start : start + size],
                materials=np.array(group.materials, dtype=np.int32),
                uv_map=group.uv_map,
            )


def _slices(count: int) -> Iterator[slice]:
    for start in range(0, count, SLICE):
        yield slice(start, min(start + SLICE, count))


def _place_vertices(batch: _Batch, store: _Store) -> int:
    """Write the vertices of k instances; return the index of the first.

    Those that are not finite stay so: no triangle that is kept has them.
    """
    positions, k = batch.mesh.positions, len(batch.matrices)
    first = store.vertex_count
    store.vertex_count += k * len(positions)
    placed = store.vertices[first : store.vertex_count].reshape(k, len(positions), 3)
    linear, origin = batch.matrices[:, :3, :3], batch.matrices[:, None, :3, 3]
    with np.errstate(invalid="ignore", over="ignore"):
        for part in _slices(len(positions)):
            placed[:, part] = positions[part].astype(np.float64) @ linear.transpose(0, 2, 1) + origin
    return first


def _place_triangles(batch: _Batch, part: slice, first_vertex: int, store: _Store) -> Int32:
    """Write a slice of the triangles of k instances; return how many of each could not be lit, (k,)."""
    mesh, k = batch.mesh, len(batch.matrices)
    corners = mesh.triangle_corners[part]
    mirrored = _mirrors(batch.matrices[:, :3, :3])
    corners = np.where(mirrored[:, None, None], corners[:, _MIRRORED], corners).reshape(-1, 3)
    per_instance = part.stop - part.start
    firsts = first_vertex + len(mesh.positions) * np.arange(k, dtype=np.int32)
    triangles = mesh.corner_vertex[corners] + np.repeat(firsts, per_instance)[:, None]
    areas = np.empty(len(triangles))
    measure_areas(store.vertices, triangles, areas)
    sound = sound_triangles(areas)

    slot = np.zeros(per_instance, dtype=np.int32) if mesh.slot is None else mesh.slot[part]
    slot = np.tile(np.clip(slot, 0, len(batch.materials) - 1), k)
    material = batch.materials[slot]
    kept = np.flatnonzero(sound & (material != LIGHT_PASSES))
    chosen: slice | NDArray[np.int64] = slice(None) if len(kept) == len(triangles) else kept

    into = slice(store.count, store.count + len(kept))
    store.count = into.stop
    if mesh.ribbons:
        store.ribbons.append(np.arange(into.start, into.stop))
    store.triangles[into] = triangles[chosen]
    store.material[into] = material[chosen]
    store.object[into] = np.repeat(batch.objects, per_instance)[chosen]
    place_normals(
        store.vertices,
        store.triangles[into],
        corners,
        kept,
        _NO_NORMALS if mesh.corner_normals is None else mesh.corner_normals,
        _cofactors(batch.matrices[:, :3, :3]),
        per_instance,
        store.corner_normals[into],
    )
    _place_uvs(batch, corners[chosen], slot[chosen], store.uvs[into])
    _place_triangle_uvs(batch, part, mirrored, slot[chosen], chosen, store.uvs[into])
    return np.asarray(np.count_nonzero(~sound.reshape(k, -1), axis=1), dtype=np.int32)


def _place_uvs(batch: _Batch, corners: Int32, slot: Int32, uvs: Float32) -> None:
    """Fill `uvs` (n, 3, 2), zero so far, from the map that each triangle's material reads."""
    for index, name in enumerate(batch.uv_map):
        coordinates = None if name is None else batch.mesh.uv_maps.get(name)
        if coordinates is not None:
            here = slot == index
            uvs[here] = coordinates[corners[here]]


def _place_triangle_uvs(
    batch: _Batch,
    part: slice,
    mirrored: NDArray[np.bool_],
    slot: Int32,
    chosen: slice | NDArray[np.int64],
    uvs: Float32,
) -> None:
    """Fill in texture coordinates that triangles do not share."""
    for index, name in enumerate(batch.uv_map):
        if name is not None and name in batch.mesh.triangle_uvs:
            own = batch.mesh.triangle_uvs[name][part]
            placed = np.where(mirrored[:, None, None, None], own[:, _MIRRORED], own).reshape(-1, 3, 2)[chosen]
            here = slot == index
            uvs[here] = placed[here]


def normal_transform(matrix: Float32 | Float64) -> Float64:
    """Return what turns normals when points are transformed by `matrix` (4, 4): (3, 3), of no particular scale."""
    return np.asarray(_cofactors(matrix[None, :3, :3].astype(np.float64))[0])


def _mirrors(linear: Float64) -> NDArray[np.bool_]:
    """Tell of matrices (k, 3, 3) whether their determinants are negative."""
    x, y, z = np.moveaxis(linear, 1, 0)
    return np.asarray(np.einsum("ij,ij->i", x, np.cross(y, z)) < 0.0)


def _cofactors(linear: Float64) -> Float64:
    """Return the cofactors of matrices (k, 3, 3), scaled to about one, their sign that of a rotation.

    They transform normals: det(M) M⁻ᵀ, which exists for flattening transforms too; the sign of det(M) is undone, as the
    winding is.
    """
    scale = np.abs(linear).max(axis=(1, 2), keepdims=True)
    linear = linear / np.where(scale > 0.0, scale, 1.0)
    x, y, z = np.moveaxis(linear, 1, 0)
    cofactors = np.stack([np.cross(y, z), np.cross(z, x), np.cross(x, y)], axis=1)
    return np.where(_mirrors(linear)[:, None, None], -cofactors, cofactors)
