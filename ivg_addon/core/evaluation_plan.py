# SPDX-License-Identifier: GPL-3.0-or-later
"""Which triangles of which instances a material is evaluated on, and on how many texels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .atlas import LARGEST_BLOCK, Atlas, lay_out
from .instancing import Instances, MeshData
from .scene import Float32, Int32

Float64 = NDArray[np.float64]

ACROSS_OBJECT = 256
"""Texels along the longest side of an object, at most."""
ACROSS_SCENE = 512
"""Texels along the longest side of the scene, at most: detail finer than that is not worth it."""
MOST_TEXELS = 1 << 22
"""Of one material's atlas; triangles beyond share texels."""
_IN_ALL, _FEWEST = 1 << 23, 1 << 16
"""Texels of all materials' atlases, about, and those of a material however many there are."""
MOST_PLACED = 1 << 20
"""Triangles of a material that looks different on each instance; beyond, all instances look like the first."""


@dataclass(frozen=True)
class Patch:
    """Triangles of a mesh that have one material, wherever they look alike.

    Parameters
    ----------
    mesh
        Index into the meshes.
    instances
        Indices into the instances.
    place
        Which place of the only ones of `instances`; None: all places of all of them.
    matrix : (4, 4)
        Where the material is evaluated: there, or in the first of all places.
    triangles : (n,) int64
        Of the mesh.
    """

    mesh: int
    instances: tuple[int, ...]
    place: int | None
    matrix: Float32 | Float64
    triangles: NDArray[np.int64]


@dataclass(frozen=True)
class Plan:
    """The evaluation of one material.

    Parameters
    ----------
    patches
        In the order of the atlas's blocks.
    shared
        So many triangles of a patch that follow each other share a block.
    atlas
        Blocks of all patches' triangles: `blocks` of each.
    unplaced
        Instances look alike although the material would tell them apart.
    """

    patches: tuple[Patch, ...]
    shared: int
    atlas: Atlas
    unplaced: bool

    def blocks(self, patch: Patch) -> int:
        """Return how many blocks a patch has."""
        return -(-len(patch.triangles) // self.shared)


def make_plan(
    row: int,
    placed: bool,
    meshes: Sequence[MeshData],
    instances: Sequence[Instances],
    scene_size: float,
    materials: int = 1,
) -> Plan | None:
    """Return the plan for the material of an index, None where no triangle has it.

    Parameters
    ----------
    placed
        It looks different on each instance.
    scene_size
        The longest side of the scene, metres.
    materials
        How many materials share the memory there is.
    """
    patches = _patches(row, placed, meshes, instances)
    unplaced = placed and sum(len(patch.triangles) for patch in patches) > MOST_PLACED
    if unplaced:
        patches = _patches(row, False, meshes, instances)
    if not patches:
        return None
    count = sum(len(patch.triangles) for patch in patches)
    shared = -(-count // MOST_TEXELS)
    edges = [_edges(patch, meshes)[::shared] for patch in patches]
    finest = scene_size / ACROSS_SCENE
    objects = _sizes(patches, meshes)
    texels = [max(size / ACROSS_OBJECT, finest, 1e-30) for size in objects]
    finer = np.concatenate([edge / texel for edge, texel in zip(edges, texels, strict=True)])
    finer = np.nan_to_num(finer, nan=0.0, posinf=1.0)
    sizes = _block_sizes(finer)
    most = min(MOST_TEXELS, max(_FEWEST, _IN_ALL // materials))
    while int((sizes.astype(np.int64) ** 2).sum()) > most and sizes.max() > 1:
        finer = finer / 1.25
        sizes = _block_sizes(finer)
    return Plan(tuple(patches), shared, lay_out(sizes), unplaced)


def _block_sizes(finer: Float64) -> Int32:
    return np.asarray(np.clip(np.ceil(finer), 1, LARGEST_BLOCK), dtype=np.int32)


def _patches(row: int, placed: bool, meshes: Sequence[MeshData], instances: Sequence[Instances]) -> list[Patch]:
    groups: dict[tuple[object, ...], list[int]] = {}
    for index, group in enumerate(instances):
        if row in group.materials and len(group.matrices):
            slots = tuple(slot for slot, material in enumerate(group.materials) if material == row)
            key = (group.mesh, slots, len(group.materials), index if placed else -1)
            groups.setdefault(key, []).append(index)
    patches = []
    for members in groups.values():
        first = instances[members[0]]
        triangles = triangles_of(meshes[first.mesh], first, row)
        if len(triangles) and placed:
            patches += [
                Patch(first.mesh, tuple(members), place, matrix, triangles)
                for place, matrix in enumerate(first.matrices)
            ]
        elif len(triangles):
            patches.append(Patch(first.mesh, tuple(members), None, first.matrices[0], triangles))
    return patches


def triangles_of(mesh: MeshData, instance: Instances, row: int) -> NDArray[np.int64]:
    """Return which triangles of an instance have a material."""
    count = len(mesh.triangle_corners)
    slot = np.zeros(count, dtype=np.int32) if mesh.slot is None else mesh.slot
    slot = np.clip(slot, 0, len(instance.materials) - 1)
    return np.flatnonzero(np.array(instance.materials)[slot] == row)


def _placed_corners(patch: Patch, meshes: Sequence[MeshData]) -> Float64:
    """Return the corners (n, 3, 3) of a patch's triangles, turned and scaled as they are placed."""
    mesh = meshes[patch.mesh]
    corners = mesh.positions[mesh.corner_vertex[mesh.triangle_corners[patch.triangles]]].astype(np.float64)
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(corners @ patch.matrix[:3, :3].T.astype(np.float64))


def _edges(patch: Patch, meshes: Sequence[MeshData]) -> Float64:
    """Return the second longest edge of each triangle: of a right-angled one the longer leg, of a sliver its length."""
    corners = _placed_corners(patch, meshes)
    with np.errstate(invalid="ignore", over="ignore"):
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return np.asarray(np.sort(edges, axis=1)[:, 1])


def _sizes(patches: Sequence[Patch], meshes: Sequence[MeshData]) -> list[float]:
    """Return the longest side of each patch's object, metres."""
    sizes = []
    for patch in patches:
        positions = meshes[patch.mesh].positions
        with np.errstate(invalid="ignore", over="ignore"):
            placed = positions @ patch.matrix[:3, :3].T.astype(np.float32)
        placed = placed[np.isfinite(placed).all(axis=1)]
        sizes.append(float(np.ptp(placed, axis=0).max()) if len(placed) else 0.0)
    return sizes


def atlas_uvs(plan: Plan, meshes: Sequence[MeshData]) -> list[Float32]:
    """Return for each patch texture coordinates (nt, 3, 2) of all triangles of its mesh, zero for those of others."""
    looked_up = plan.atlas.looked_up()
    result, start = [], 0
    for patch in plan.patches:
        uvs = np.zeros((len(meshes[patch.mesh].triangle_corners), 3, 2), dtype=np.float32)
        uvs[patch.triangles] = looked_up[start + np.arange(len(patch.triangles)) // plan.shared]
        result.append(uvs)
        start += plan.blocks(patch)
    return result


def scene_size(meshes: Sequence[MeshData], instances: Sequence[Instances]) -> float:
    """Return about the longest side of all instances together, metres: each counts by the box of its mesh."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    boxes: dict[int, Float64] = {}
    for instance in instances:
        if instance.mesh not in boxes:
            positions = meshes[instance.mesh].positions
            positions = positions[np.isfinite(positions).all(axis=1)]
            ends = [positions.min(axis=0), positions.max(axis=0)] if len(positions) else [np.zeros(3)] * 2
            boxes[instance.mesh] = np.array(
                [[ends[x][0], ends[y][1], ends[z][2]] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=np.float64
            )
        turned = np.einsum("kij,cj->kci", instance.matrices[:, :3, :3], boxes[instance.mesh])
        corners = (turned + instance.matrices[:, None, :3, 3]).reshape(-1, 3)
        low, high = np.minimum(low, corners.min(axis=0)), np.maximum(high, corners.max(axis=0))
    size = float((high - low).max()) if len(instances) else 0.0
    return size if np.isfinite(size) else 0.0


def renamed(instances: Sequence[Instances], names: Mapping[tuple[int, int | None, int], str]) -> list[Instances]:
    """Return instances whose slots read the texture coordinates of these names.

    Parameters
    ----------
    names
        By index, place (None for all places) and material. Where places differ, each becomes an instance of its own.
    """
    apart = {index for index, place, _ in names if place is not None}
    changed = []
    for index, group in enumerate(instances):
        places: Sequence[int | None] = range(len(group.matrices)) if index in apart else [None]
        for place in places:
            here = slice(None) if place is None else slice(place, place + 1)
            uv_map = tuple(
                names.get((index, None, material), names.get((index, place, material), name))
                for material, name in zip(group.materials, group.uv_map, strict=True)
            )
            changed.append(replace(group, objects=group.objects[here], matrices=group.matrices[here], uv_map=uv_map))
    return changed
