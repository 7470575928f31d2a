# SPDX-License-Identifier: GPL-3.0-or-later
"""Look-ups as the linear maps that they are: which vertices a place reads, and with what weights.

    E(p, n) = Σ_i w_i Σ_m c_m(n) x_im

over vertices i and their twelve moments m (moments.py): trilinear, by least squares, with the default normal bias.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .compiled import kernel
from .grid import DEFAULT_NORMAL_BIAS, IrradianceVectorGrid
from .look_up import is_divided, leave_to_speakers, stencil, step_back, weigh
from .look_up_rules import WITHIN
from .moments import NAMES
from .vectors import unit

Float64 = NDArray[np.float64]

MOMENTS = len(NAMES)
_CHUNK = 1 << 14
"""Places, or vertices, that a thread takes at a time."""


@dataclass(frozen=True)
class Readings:
    """What look-ups at n places read of V vertices, and who reads a vertex.

    Parameters
    ----------
    vertices : (n, 8) int32, weights : (n, 8) float32
        The weights of a place add up to 1, or are all 0 where no vertex is lit.
    coefficients : (n, k) float32
        c, of the moments or of coordinates that stand for them.
    first : (V + 1,) int64, readers : (8 n,) int32
        Entries of `vertices`, taken as one row, that name a vertex v: `readers[first[v]:first[v + 1]]`.
    """

    vertices: NDArray[np.int32]
    weights: NDArray[np.float32]
    coefficients: NDArray[np.float32]
    first: NDArray[np.int64]
    readers: NDArray[np.int32]

    @classmethod
    def of(cls, grid: IrradianceVectorGrid, points: Float64, normals: Float64, basis: Float64) -> Readings:
        """Return those of a grid's default look-ups at points with unit normals, (n, 3) each.

        Parameters
        ----------
        basis : (12, k)
            What the k coordinates mean in moments.
        """
        vertices = np.zeros((len(points), 8), dtype=np.int32)
        weights = np.zeros((len(points), 8), dtype=np.float32)
        parts, lattice = grid.partitions, grid.lattice
        read(
            *(points, normals, grid.validity.reshape(-1), parts.start, parts.planes),
            *(grid.bounds_min, lattice.voxel_size, np.asarray(lattice.shape, dtype=np.int64)),
            *(DEFAULT_NORMAL_BIAS, vertices, weights),
        )
        coefficients = (moment_coefficients(normals) @ basis).astype(np.float32)
        return cls(vertices, weights, coefficients, *_readers(vertices, lattice.vertex_count))

    def compact(self) -> tuple[Readings, NDArray[np.int64]]:
        """Return readings of those vertices alone that are read, and which these are."""
        read_at_all = np.zeros(len(self.first) - 1, dtype=np.bool_)
        read_at_all[self.vertices[self.weights > 0.0]] = True
        which = np.flatnonzero(read_at_all)
        # Entries without weight may name any vertex.
        place = np.zeros(len(read_at_all), dtype=np.int32)
        place[which] = np.arange(len(which))
        vertices = place[self.vertices]
        first, readers = _readers(vertices, len(which))
        return Readings(vertices, self.weights, self.coefficients, first, readers), which

    def irradiance(self, x: Float64) -> Float64:
        """Return E (n, 3 channels) of coordinates x (V, k, 3)."""
        out = np.empty((len(self.vertices), 3))
        _in_chunks(lambda part: gather(self.vertices, self.weights, self.coefficients, x, *part, out), len(out))
        return out

    def transposed(self, e: Float64) -> Float64:
        """Return what the transposed map makes of e (n, 3): (V, k, 3)."""
        out = np.zeros((len(self.first) - 1, self.coefficients.shape[1], 3))
        arrays = self.first, self.readers, self.weights.reshape(-1), self.coefficients
        _in_chunks(lambda part: scatter(*arrays, e, *part, out), len(out))
        return out


def _readers(vertices: NDArray[np.int32], count: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Return `first` and `readers` of so many vertices."""
    first = np.concatenate([[0], np.cumsum(np.bincount(vertices.reshape(-1), minlength=count))]).astype(np.int64)
    return first, np.argsort(vertices.reshape(-1), kind="stable").astype(np.int32)


def moment_coefficients(normals: Float64) -> Float64:
    """Return c (n, 12) of unit normals (n, 3): E = ½ (F·n + Σ_kj W_kj(n) D_kj); see `reconstruction.py`."""
    angles = np.arcsin(np.clip(normals, -1.0, 1.0))
    products = normals[:, :, None] * normals[:, None, :]
    turned = angles[:, :, None] * normals[:, None, :]
    w = 0.5 * products + (turned - turned.swapaxes(1, 2)) / (math.pi - 2.0)
    axes = np.arange(3)
    w[:, axes, axes] = normals**2
    return np.asarray(0.5 * np.concatenate([normals, w.reshape(-1, 9)], axis=1))


def _in_chunks(work: Callable[[tuple[int, int]], None], count: int) -> None:
    """Let threads work on ranges of places or vertices: none writes where another does."""
    parts = [(at, min(at + _CHUNK, count)) for at in range(0, count, _CHUNK)]
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(work, parts))


@kernel
def read(points, normals, validity, start, planes, low, voxel, counts, bias, vertices, weights):
    """Fill vertices and weights, (n, 8) each: the steps of trilinear look-ups (`look_up.py`)."""
    base, w, g, here = np.empty(3, dtype=np.int64), np.empty((3, 4)), np.empty(3), np.empty(3)
    at, share = np.empty(8, dtype=np.int64), np.empty(8)
    for q in range(len(points)):
        n = unit(normals[q, 0], normals[q, 1], normals[q, 2])
        for axis in range(3):
            g[axis] = min(max((points[q, axis] - low[axis]) / voxel[axis], 0.0), counts[axis] - 1.0)
        stencil(g, counts, 2, base, w)
        unlit = weigh(validity, counts, 2, base, w, at, share)
        divided = len(planes) > 0 and is_divided(start, at, share, 8)
        if divided and step_back(start, planes, g, n, counts, at, share, 8):
            stencil(g, counts, 2, base, w)
            unlit = weigh(validity, counts, 2, base, w, at, share)
        here[:] = g
        for axis in range(3):
            low_end, high_end = 0.0, counts[axis] - 1.0
            if divided:
                low_end, high_end = base[axis] + WITHIN, base[axis] + 1.0 - WITHIN
            g[axis] = min(max(here[axis] + bias * unlit * n[axis], low_end), high_end)
        stencil(g, counts, 2, base, w)
        weigh(validity, counts, 2, base, w, at, share)
        if divided:
            leave_to_speakers(start, planes, here, n, at, share, 8)
        total = max(share.sum(), 1e-300)
        for entry in range(8):
            vertices[q, entry] = at[entry]
            weights[q, entry] = share[entry] / total


@kernel
def gather(vertices, weights, coefficients, x, start, stop, out):
    """Fill out[start:stop], (n, 3), with the readings of coordinates x (V, k, 3)."""
    for q in range(start, stop):
        r, g, b = 0.0, 0.0, 0.0
        for i in range(8):
            w, v = weights[q, i], vertices[q, i]
            if w > 0.0:
                for m in range(coefficients.shape[1]):
                    c = w * coefficients[q, m]
                    r += c * x[v, m, 0]
                    g += c * x[v, m, 1]
                    b += c * x[v, m, 2]
        out[q, 0], out[q, 1], out[q, 2] = r, g, b


@kernel
def scatter(first, readers, weights, coefficients, e, start, stop, out):
    """Fill out[start:stop], (V, k, 3), with the sums over their readers of what these are given, e (n, 3)."""
    for v in range(start, stop):
        for at in range(first[v], first[v + 1]):
            entry = readers[at]
            w, q = weights[entry], entry >> 3
            if w > 0.0:
                for m in range(coefficients.shape[1]):
                    c = w * coefficients[q, m]
                    for channel in range(3):
                        out[v, m, channel] += c * e[q, channel]
