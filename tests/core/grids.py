# SPDX-License-Identifier: GPL-3.0-or-later
"""Grids made by hand: of a function of position, lit where they are told."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.grid import BakeRecord, IrradianceVectorGrid
from ivg_addon.core.partitions import Partitions
from ivg_addon.core.settings import BakeSettings

Float64 = NDArray[np.float64]

LATTICE = Lattice((-1.0, 2.0, 0.5), (1.5, 3.0, 4.0), (5, 4, 7))
AXES = np.array([(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)], dtype=np.float64)
UNIFORM = np.broadcast_to(np.pi * AXES[:, None, :], (6, 3, 3))
"""Six vectors of a uniform field of radiance 1, in three channels: E = π for every normal."""


def record(lattice: Lattice = LATTICE, scene: str = "Test") -> BakeRecord:
    return BakeRecord(
        scene=scene,
        checksum="00",
        settings=BakeSettings(lattice.bounds_min, lattice.bounds_max, lattice.resolution),
        created="2026-01-01T00:00:00+00:00",
        version="0",
        emitted=(1.0, 2.0, 3.0),
    )


def own_weights(lattice: Lattice = LATTICE) -> NDArray[np.float16]:
    """Return lit weights of cells that are lit at their vertices alone: means are interpolated as they stand."""
    weights = np.zeros((*lattice.shape, 3, 3, 3), dtype=np.float16)
    weights[..., 1, 1, 1] = 1
    return weights


def grid(
    vectors: NDArray[np.generic],
    validity: object = None,
    lattice: Lattice = LATTICE,
    lit_weights: NDArray[np.float16] | None = None,
    partitions: Partitions | None = None,
) -> IrradianceVectorGrid:
    """Return a grid of vectors (…, 6, 3, 3) at the vertices; lit all over unless `validity` and `lit_weights` tell."""
    sides = Partitions.none(lattice.vertex_count) if partitions is None else partitions
    lit = np.ones(lattice.shape) if validity is None else validity
    return IrradianceVectorGrid(
        vectors=np.ascontiguousarray(np.broadcast_to(vectors, (*lattice.shape, 6, 3, 3)), dtype=np.float32),
        validity=np.ascontiguousarray(np.broadcast_to(np.asarray(lit), lattice.shape), dtype=np.float32),
        lit_weights=lattice.whole_cell_weights() if lit_weights is None else lit_weights,
        plane_start=sides.start,
        planes=sides.planes,
        lattice=lattice,
        record=record(lattice),
    )


def spread(scalar: Float64) -> NDArray[np.float32]:
    """Return vectors all of whose 54 numbers are the vertices' scalar."""
    return np.broadcast_to(scalar[..., None, None, None], (*scalar.shape, 6, 3, 3)).astype(np.float32)


def matrix(validity: NDArray[np.float32], weights: NDArray[np.float16]) -> Float64:
    """Return A, (vertices, vertices), one entry after the other; unlit vertices keep what they have."""
    shape = validity.shape
    a = np.zeros((validity.size, validity.size))
    for row, vertex in enumerate(np.ndindex(shape)):
        for offset in np.ndindex(3, 3, 3):
            other = tuple(i + o - 1 for i, o in zip(vertex, offset, strict=True))
            if all(0 <= i < n for i, n in zip(other, shape, strict=True)) and validity[other] > 0:
                a[row, np.ravel_multi_index(other, shape)] = weights[vertex][offset]
        if validity[vertex] == 0:
            a[row] = np.arange(validity.size) == row
    return np.asarray(a / a.sum(axis=1, keepdims=True))
