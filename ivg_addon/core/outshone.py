# SPDX-License-Identifier: GPL-3.0-or-later
"""Finding out which vertices have dim places behind a wall beside bright ones.

Light finds its way into most things: between an eye and its socket, under a lid, through a seam. The inside is then
lit, if dimly, and the cell of a vertex by the wall is a mean of the bright place and the dim one. A plane divides
such vertices where the wall is flat; where it is round, none does. What the dim place takes from the bright one is
then much; what the bright one lends the dim one, which nobody sees, is as much, whether the vertex counts both
places or one. So these vertices count the bright places alone, and those that know none leave the look-up.

Only where ways between bright and dim places are blocked are they two: a room is not, whose dark corners lie behind
the walls of a bright street.
"""

from __future__ import annotations

from collections.abc import Generator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from .dual_cells import Lattice
from .embree import Tracer
from .lit_volume import DIM, MANY_PHOTONS, LightKnowledge
from .partitions import Partitions
from .progress import Progress, part
from .surroundings import Int64, Surroundings

_MOSTLY_BLOCKED = 0.75
"""Of the ways between bright and dim places."""
_LEAST_WAYS = 8
"""Blocked ones, likewise."""
_STRIDES = (55, 1, 21)
_TASK = "Looking for dim places"


def outshone_steps(
    knowledge: LightKnowledge, walls: Tracer, lattice: Lattice, partitions: Partitions, seed: int, threads: int
) -> Generator[Progress, None, NDArray[np.bool_]]:
    """Return which vertices, (vertices,), count bright places alone: none that planes divide; yields as it goes.

    Parameters
    ----------
    walls
        What parts places: see `partitioning.parting`.
    seed
        Of the points that are looked at.
    threads
        0 for one per processor.
    """
    outshone = np.zeros(lattice.vertex_count, dtype=np.bool_)
    dim = with_dim_sides(knowledge)
    if not dim.any():
        return outshone
    which = walls, lattice, seed, knowledge.geometry.triangles[dim]
    around = Surroundings.of(knowledge, *which)
    bright = Surroundings.of(knowledge.of_bright_places(), *which)
    yield from part(around.light_steps(_TASK, threads), 0.0, 0.4)
    yield from part(bright.light_steps(_TASK, threads), 0.4, 0.8)
    found = yield from part(around.visit_steps(_TASK, partial(_parted, around, bright), threads), 0.8, 1.0)
    outshone[around.vertices] = np.concatenate([np.zeros(0, dtype=np.bool_), *found])
    return outshone & ~partitions.divided


def with_dim_sides(knowledge: LightKnowledge) -> NDArray[np.bool_]:
    """Tell which triangles, (nt,), have a patch with a dim side."""
    counts = knowledge.bin_counts
    beyond = counts[:, ::-1]
    dim = ((counts > 0) & (counts <= DIM * beyond) & (beyond >= MANY_PHOTONS)).any(axis=1)
    return np.asarray(np.logical_or.reduceat(dim, knowledge.bins.offset))


def _parted(around: Surroundings, bright: Surroundings, vertices: Int64) -> NDArray[np.bool_]:
    """Tell around which vertices, (n,), bright and dim places do not see each other."""
    points, lit = around.gather(vertices)
    is_bright = bright.gather(vertices)[1].reshape(-1)
    blocked, between = np.zeros(len(vertices)), np.zeros(len(vertices))
    for stride in _STRIDES:
        ways = around.look(points, lit, stride)
        mixed = is_bright[ways.ends[:, 0]] != is_bright[ways.ends[:, 1]]
        between += np.bincount(ways.owner[mixed], minlength=len(vertices))
        blocked += np.bincount(ways.owner[mixed & ways.blocked], minlength=len(vertices))
    return (blocked >= _LEAST_WAYS) & (blocked >= _MOSTLY_BLOCKED * between)
