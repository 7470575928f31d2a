# SPDX-License-Identifier: GPL-3.0-or-later
"""Rooms that are not aligned with the grid, and what a photon walk would know about them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.embree import Tracer
from ivg_addon.core.lit_volume import LightKnowledge
from ivg_addon.core.partitions import Partitions
from ivg_addon.core.scene import Scene
from ivg_addon.core.surface_bins import BACK, FRONT, SurfaceBins

from .rooms import box, rotation

Float64 = NDArray[np.float64]

TURN = rotation((1, 2, 3), 0.7)
ROOM = box((-1, -1, -1), (1, 1, 1), inward=True, turn=TURN)
LATTICE = Lattice((-1.3, -1.23, -1.3), (1.3, 1.2, 1.25), (5, 6, 4))
UNDIVIDED = Partitions.none(LATTICE.vertex_count)
SEEN = np.zeros(LATTICE.vertex_count, dtype=np.bool_)
"""Nothing is outshone."""


def knowledge(of: Scene, front: Sequence[int], back: Sequence[int], world_shines: bool = False) -> LightKnowledge:
    """Return what a walk would know if each patch of object i had received front[i] and back[i] photons."""
    bins = SurfaceBins.of(of.geometry, 0.5)
    counts = bins.empty_counts()
    patch_object = np.repeat(of.geometry.object, bins.divisions[:, 1:].prod(axis=1))
    counts[:, FRONT], counts[:, BACK] = np.array(front)[patch_object], np.array(back)[patch_object]
    return LightKnowledge(of.geometry, Tracer(of.geometry), bins, counts, world_shines)


def halfspaces(turn: Float64, half: float = 1.0) -> tuple[Float64, Float64]:
    """Return normals (6, 3) and offsets (6,) of a turned cube about the origin."""
    return np.concatenate([turn.T, -turn.T]), np.full(6, half)
