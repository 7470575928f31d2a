"""Grids made by hand: of a function of position, lit where they are told."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.grid import BakeRecord, IrradianceVectorGrid
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


def grid(vectors: NDArray[np.generic], validity: object = None, lattice: Lattice = LATTICE) -> IrradianceVectorGrid:
    """Return a grid of vectors (…, 6, 3, 3) at the vertices; lit all over unless `validity` tells."""
    lit = np.ones(lattice.shape) if validity is None else validity
    return IrradianceVectorGrid(
        vectors=np.ascontiguousarray(np.broadcast_to(vectors, (*lattice.shape, 6, 3, 3)), dtype=np.float32),
        validity=np.ascontiguousarray(np.broadcast_to(np.asarray(lit), lattice.shape), dtype=np.float32),
        lattice=lattice,
        record=record(lattice),
    )
