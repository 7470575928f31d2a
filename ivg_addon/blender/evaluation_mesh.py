# SPDX-License-Identifier: GPL-3.0-or-later
"""The mesh that Cycles evaluates materials on: in world space, with an atlas of its own, and all that they read."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.evaluation_plan import Patch, Plan
from ..core.instancing import Instances, MeshData, normal_transform
from ..core.scene import Float32
from .evaluation_data import ObjectLook, SurfaceData
from .evaluation_tree import (
    ATLAS,
    COLOUR,
    DEFAULT_COLOUR,
    DEFAULT_UV,
    GENERATED,
    INDEX,
    INSTANCED,
    LOCAL,
    LOCAL_NORMAL,
    LOCATION,
    PROPERTY,
    RANDOM,
)
from .export_needs import Needs


@dataclass(frozen=True)
class Surroundings:
    """All that was read of geometry; indices as in `core.instancing`."""

    meshes: Sequence[MeshData]
    instances: Sequence[Instances]
    data: dict[int, SurfaceData]
    looks: Sequence[Sequence[ObjectLook]]


@dataclass(frozen=True)
class StageArrays:
    """A mesh of separate triangles with shared vertices; corners follow each other.

    Parameters
    ----------
    positions : (nv, 3) float32
    corner_vertex : (3n,) int32
    normals : (3n, 3) float32, or None
    values
        Attributes (3n, 4) float32 by name.
    uv_maps
        Texture coordinates (3n, 2) float32 by name; first the atlas.
    """

    positions: Float32
    corner_vertex: NDArray[np.int32]
    normals: Float32 | None
    values: dict[str, Float32]
    uv_maps: dict[str, Float32]

    def content(self) -> Iterator[bytes]:
        """Return all of it, for a hash."""
        for name, array in (*self.values.items(), *self.uv_maps.items()):
            yield name.encode()
            yield np.ascontiguousarray(array).tobytes()
        yield self.positions.tobytes()
        yield self.corner_vertex.tobytes()
        if self.normals is not None:
            yield np.ascontiguousarray(self.normals).tobytes()


def stage_arrays(plan: Plan, needs: Needs, around: Surroundings) -> StageArrays:
    """Return the mesh on which one material is evaluated."""
    parts = [_patch_arrays(patch, plan.shared, needs, around) for patch in plan.patches]
    firsts = np.cumsum([0, *(len(part.positions) for part in parts)])
    normals = [part.normals for part in parts if part.normals is not None]
    names = dict.fromkeys(name for part in parts for name in part.values)
    uv_names = dict.fromkeys(name for part in parts for name in part.uv_maps)
    drawn, start = plan.atlas.drawn(), 0
    for patch in plan.patches:
        stop = start + plan.blocks(patch)
        if _mirrored(patch.matrix):
            drawn[start:stop] = drawn[start:stop, [0, 2, 1]]
        start = stop
    return StageArrays(
        positions=np.concatenate([part.positions for part in parts]),
        corner_vertex=np.concatenate(
            [part.corner_vertex + first for part, first in zip(parts, firsts[:-1], strict=True)]
        ).astype(np.int32),
        normals=np.concatenate(normals) if normals else None,
        values={name: np.concatenate([_of(part, part.values, name, 4) for part in parts]) for name in names},
        uv_maps={
            ATLAS: drawn.reshape(-1, 2),
            **{name: np.concatenate([_of(part, part.uv_maps, name, 2) for part in parts]) for name in uv_names},
        },
    )


def _of(part: StageArrays, arrays: dict[str, Float32], name: str, width: int) -> Float32:
    """Return an attribute of a part; zero where it has none, as in Cycles."""
    if name in arrays:
        return arrays[name]
    return np.zeros((len(part.corner_vertex), width), dtype=np.float32)


def _patch_arrays(patch: Patch, shared: int, needs: Needs, around: Surroundings) -> StageArrays:
    """Return one patch's triangles, one of so many that share texels."""
    mesh = around.meshes[patch.mesh]
    data = around.data.get(patch.mesh, SurfaceData())
    matrix = patch.matrix.astype(np.float64)
    corners = mesh.triangle_corners[patch.triangles[::shared]]
    corners = (corners[:, [0, 2, 1]] if _mirrored(matrix) else corners).reshape(-1)
    used, vertex = np.unique(mesh.corner_vertex[corners], return_inverse=True)
    local = mesh.positions[used]
    values: dict[str, Float32] = {name: array[corners] for name, array in data.attributes.items()}
    uv_maps = {name: values.pop(name)[:, :2] for name in sorted(data.uv_names & needs.attributes)}
    values = {name: array for name, array in values.items() if name in needs.attributes}
    if needs.default_uv and data.uv is not None:
        uv_maps[DEFAULT_UV] = data.uv[corners][:, :2]
    if needs.default_colour and data.colour is not None:
        values[DEFAULT_COLOUR] = data.colour[corners]
    if needs.generated:
        generated = _in_its_box(mesh.positions) if data.generated is None else data.generated
        values[GENERATED] = _widened(generated[mesh.corner_vertex[corners]])
    if needs.local:
        values[LOCAL] = _widened(local[vertex])
    if needs.placed:
        look = around.looks[patch.instances[0]][patch.place or 0]
        values |= _placed(matrix, look, len(corners))
    normals = None
    if needs.shading_normals:
        own = _normals(mesh, corners, local[vertex])
        normals = own @ normal_transform(matrix).T.astype(np.float32)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        normals /= np.where(length > 0.0, length, 1.0)
        if needs.normals:
            values[LOCAL_NORMAL] = _widened(own)
    world = local.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
    return StageArrays(world.astype(np.float32), vertex.reshape(-1).astype(np.int32), normals, values, uv_maps)


def _mirrored(matrix: NDArray[Any]) -> bool:
    return bool(np.linalg.det(matrix[:3, :3]) < 0.0)


def _normals(mesh: MeshData, corners: NDArray[np.integer], positions: Float32) -> Float32:
    """Return unit shading normals in the mesh's own space, at corners (3n, 3)."""
    if mesh.corner_normals is not None:
        return mesh.corner_normals[corners]
    p = positions.reshape(-1, 3, 3)
    flat = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    length = np.linalg.norm(flat, axis=1, keepdims=True)
    return np.repeat(flat / np.where(length > 0.0, length, 1.0), 3, axis=0).astype(np.float32)


def _in_its_box(positions: Float32) -> Float32:
    """Return positions as shares of the box around them: generated coordinates of what is no mesh in Blender."""
    low, size = positions.min(axis=0), np.ptp(positions, axis=0)
    return ((positions - low) / np.where(size > 0.0, size, 1.0)).astype(np.float32)


def _widened(values: Float32) -> Float32:
    return np.concatenate([values, np.ones((len(values), 1), dtype=np.float32)], axis=1)


def _placed(matrix: NDArray[np.float64], look: ObjectLook, count: int) -> dict[str, Float32]:
    """Return what is the same all over an instance."""
    x, y, z = matrix[:3, 3]
    values = {
        LOCATION: (x, y, z, 1.0),
        COLOUR: look.colour,
        INDEX: (look.index,) * 3 + (1.0,),
        RANDOM: (look.random,) * 3 + (1.0,),
        **{PROPERTY + name: value for name, value in look.properties.items()},
        **{INSTANCED + name: value for name, value in look.instanced.items()},
    }
    return {name: np.tile(np.array(value, dtype=np.float32), (count, 1)) for name, value in values.items()}


def make_mesh(parts: Sequence[StageArrays]) -> bpy.types.Mesh:
    """Return a mesh of several materials' triangles, each part with the material slot of its number."""
    corners = sum(len(part.corner_vertex) for part in parts)
    firsts = np.cumsum([0, *(len(part.positions) for part in parts)])
    mesh = bpy.data.meshes.new("Stage")
    mesh.vertices.add(int(firsts[-1]))
    mesh.vertices.foreach_set("co", np.concatenate([part.positions for part in parts]).reshape(-1))
    mesh.loops.add(corners)
    mesh.loops.foreach_set(
        "vertex_index",
        np.concatenate(
            [part.corner_vertex + np.int32(first) for part, first in zip(parts, firsts[:-1], strict=True)]
        ).astype(np.int32),
    )
    mesh.polygons.add(corners // 3)
    mesh.polygons.foreach_set("loop_start", np.arange(0, corners, 3, dtype=np.int32))
    slots = np.repeat(np.arange(len(parts), dtype=np.int32), [len(part.corner_vertex) // 3 for part in parts])
    mesh.polygons.foreach_set("material_index", slots)
    uv_names = dict.fromkeys(name for part in parts for name in part.uv_maps)
    for name in uv_names:
        values = np.concatenate([_of(part, part.uv_maps, name, 2) for part in parts])
        mesh.uv_layers.new(name=name).uv.foreach_set("vector", np.ascontiguousarray(values).reshape(-1))
    mesh.uv_layers.active = mesh.uv_layers[ATLAS]
    # What the materials take for the UV map that is active for rendering.
    mesh.uv_layers[DEFAULT_UV if DEFAULT_UV in uv_names else ATLAS].active_render = True
    for name in dict.fromkeys(name for part in parts for name in part.values):
        if name in mesh.attributes:
            continue  # a UV map in one part, another attribute in the other
        values = np.concatenate([_of(part, part.values, name, 4) for part in parts])
        mesh.attributes.new(name, "FLOAT_COLOR", "CORNER").data.foreach_set("color", values.reshape(-1))
    mesh.update()
    if any(part.normals is not None for part in parts):
        attribute = mesh.attributes.new("custom_normal", "FLOAT_VECTOR", "CORNER")
        attribute.data.foreach_set("vector", np.concatenate([_part_normals(part) for part in parts]).reshape(-1))
        mesh.polygons.foreach_set("use_smooth", np.ones(corners // 3, dtype=np.bool_))
    return mesh


def _part_normals(part: StageArrays) -> Float32:
    """Return a part's normals, flat ones where no material reads them."""
    return flat_normals(part) if part.normals is None else np.ascontiguousarray(part.normals, dtype=np.float32)


def flat_normals(part: StageArrays) -> Float32:
    """Return the unit normals of a part's triangles, at corners (3n, 3)."""
    p = part.positions[part.corner_vertex].reshape(-1, 3, 3)
    flat = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])
    length = np.linalg.norm(flat, axis=1, keepdims=True)
    return np.repeat(flat / np.where(length > 0.0, length, 1.0), 3, axis=0).astype(np.float32)
