# SPDX-License-Identifier: GPL-3.0-or-later
"""The irradiance vector grid: the result of a bake, and how it is looked up."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .dual_cells import Lattice
from .errors import SettingsError
from .partitions import Partitions
from .settings import BakeSettings, Directional, Spatial, Vec3

DEFAULT_NORMAL_BIAS = 0.375
"""In voxels; measured in docs/method.md, "Cells cut by geometry"."""


@dataclass(frozen=True)
class BakeRecord:
    """How a grid came to be.

    Parameters
    ----------
    scene
        The Blender scene's name.
    checksum
        Of everything that was baked: geometry, materials, textures, lights (hexadecimal).
    settings
        The settings of the bake.
    created
        Time of the bake, UTC, ISO 8601.
    version
        Version of the program that wrote it.
    emitted
        Power of all lights, W, (3,) linear RGB.
    """

    scene: str
    checksum: str
    settings: BakeSettings
    created: str
    version: str
    emitted: Vec3


def grid_bytes(resolution: tuple[int, int, int]) -> int:
    """Return the memory of a grid: at each vertex 6 vectors of 3 channels, a validity, and 27 weights."""
    return math.prod(n + 1 for n in resolution) * ((54 + 1) * 4 + 27 * 2)


class _InterpolatedVectors(dict[Spatial, NDArray[np.float32]]):
    """What look-ups interpolate, by the interpolation."""

    def __init__(self, grid: IrradianceVectorGrid) -> None:
        super().__init__()
        self._arrays = grid.vectors, grid.validity, grid.lit_weights
        self._divided = grid.partitions.divided.reshape(grid.lattice.shape)
        self._corrections = grid.corrected, grid.corrections

    def __missing__(self, spatial: Spatial) -> NDArray[np.float32]:
        from .prefilter import deconvolved

        self[spatial] = deconvolved(*self._arrays, spatial, self._divided, self._corrections)
        return self[spatial]


@dataclass(frozen=True)
class IrradianceVectorGrid:
    """Six irradiance vectors per colour channel at every vertex of a box of voxels. [IVG §3].

    Parameters
    ----------
    vectors : (Ni+1, Nj+1, Nk+1, 6, 3 channel, 3 xyz) float32
        I_δ = ∫_{Ω_δ} L(ω) ω dω in W/m², the mean over the lit part of the dual cell; directions
        in the order +x, −x, +y, −y, +z, −z.
    validity : (Ni+1, Nj+1, Nk+1) float32
        Lit share of each dual cell; vertices with 0 are left out of the interpolation.
    lit_weights : (Ni+1, Nj+1, Nk+1, 3, 3, 3) float16
        Means over the lit part of each dual cell of the trilinear weights of the vertices around: entry (a, b, c) is
        that of the vertex (i + a − 1, j + b − 1, k + c − 1). Look-ups take back with them what averaging smoothed.
    plane_start : ((Ni+1)(Nj+1)(Nk+1) + 1,) int32
    planes : (P, 5) float32
        Which side of thin walls vertices speak for: see `Partitions`.
    lattice
        Bounds and resolution.
    record
        How the grid came to be.
    corrected : (k,) int32
    corrections : (k, 12, 3) float32
        What is added to the values that look-ups interpolate at these vertices (flat indices, rising), in moments
        (moments.py): it makes look-ups at surfaces tell what photons brought there.
    """

    vectors: NDArray[np.float32]
    validity: NDArray[np.float32]
    lit_weights: NDArray[np.float16]
    plane_start: NDArray[np.int32]
    planes: NDArray[np.float32]
    lattice: Lattice
    record: BakeRecord = field(compare=False)
    corrected: NDArray[np.int32] = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    corrections: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 12, 3), dtype=np.float32))

    def __post_init__(self) -> None:
        """Check shapes and types."""
        for name, array, per_vertex, dtype in (
            ("vectors", self.vectors, (6, 3, 3), np.float32),
            ("validity", self.validity, (), np.float32),
            ("lit_weights", self.lit_weights, (3, 3, 3), np.float16),
        ):
            shape = (*self.lattice.shape, *per_vertex)
            if array.shape != shape:
                raise SettingsError(
                    f"grid {name} have shape {array.shape}: a grid of {self.resolution} voxels needs {shape}"
                )
            if array.dtype != dtype:
                raise SettingsError(f"grid {name}: {array.dtype} instead of {np.dtype(dtype)}")
        count = len(self.corrected)
        if self.corrections.shape != (count, 12, 3) or self.corrections.dtype != np.float32:
            raise SettingsError(f"grid corrections have shape {self.corrections.shape}: {count} vertices have some")
        rising = self.corrected.dtype == np.int32 and (np.diff(self.corrected) > 0).all()
        if not rising or (count and not 0 <= self.corrected[0] <= self.corrected[-1] < self.lattice.vertex_count):
            raise SettingsError("grid corrections name vertices that are not there")
        problem = self.partitions.problem(self.lattice.vertex_count)
        if problem:
            raise SettingsError(f"grid {problem}")

    @property
    def resolution(self) -> tuple[int, int, int]:
        """Return the number of voxels (Ni, Nj, Nk)."""
        return self.lattice.resolution

    @property
    def bounds_min(self) -> NDArray[np.float64]:
        """Return the box's lower corner, (3,) metres."""
        return np.asarray(self.lattice.bounds_min, dtype=np.float64)

    @property
    def bounds_max(self) -> NDArray[np.float64]:
        """Return the box's upper corner, (3,) metres."""
        return np.asarray(self.lattice.bounds_max, dtype=np.float64)

    def irradiance(
        self,
        points: ArrayLike,
        normals: ArrayLike,
        spatial: str = Spatial.TRILINEAR,
        directional: str = Directional.LEAST_SQUARES,
        normal_bias: float = DEFAULT_NORMAL_BIAS,
        facing: ArrayLike | None = None,
    ) -> NDArray[np.float32]:
        """Return the irradiance E(p, n) = ⟨I_n(p), n⟩ that surfaces receive. [IVG eq. 1].

        Parameters
        ----------
        points : (n, 3)
            Positions, metres, world space; outside the box the look-up clamps to it.
        normals : (n, 3)
            Surface normals, of any length but zero.
        spatial
            "TRILINEAR" or "TRICUBIC".
        directional
            "LEAST_SQUARES" or "REPORT".
        normal_bias
            The look-up is moved along the normal, away from the surface, by this many voxels
            times the unlit share of the cells around the point: not at all in the open.
        facing : (n, 3), optional
            The surface's own normals, where `normals` are those of bumps on it: they tell on which side of walls a
            point is.

        Returns
        -------
        (n, 3) float32
            Irradiance of linear RGB in W/m², not negative. Zero where no vertex around the point
            is lit.

        Raises
        ------
        SettingsError
            Shapes that do not agree, coordinates that are not finite, normals of length zero, an
            interpolation that does not exist.
        """
        p, n = _checked(points, normals)
        own = None if facing is None else _checked(points, facing)[1]
        if not math.isfinite(normal_bias):
            raise SettingsError(
                f"normal bias {normal_bias}: use a number of voxels, for instance {DEFAULT_NORMAL_BIAS}"
            )
        try:
            spatial, directional = Spatial(spatial), Directional(directional)
        except ValueError as error:
            raise SettingsError(f"{error}: use TRILINEAR or TRICUBIC, and LEAST_SQUARES or REPORT") from error
        from .look_up import irradiance

        vectors = self.vectors if directional is Directional.REPORT else self._interpolated[spatial]
        stored = (vectors, self.validity, self.partitions, self.lattice)
        return irradiance(*stored, p, n, spatial, directional, normal_bias, own)

    def interpolated(self, spatial: Spatial) -> NDArray[np.float32]:
        """Return what default look-ups interpolate, of the shape of `vectors`: these without the cells' smoothing."""
        return self._interpolated[spatial]

    @cached_property
    def partitions(self) -> Partitions:
        """Which side of thin walls vertices speak for."""
        return Partitions(self.plane_start, self.planes)

    @cached_property
    def _interpolated(self) -> _InterpolatedVectors:
        """The vectors as the default look-ups interpolate them, made when first asked for."""
        return _InterpolatedVectors(self)

    def save(self, path: str | Path) -> None:
        """Write the grid to a .ivg.npz file, whole or not at all; raises `GridFileError`."""
        from .grid_file import save

        save(self, Path(path))

    @classmethod
    def load(cls, path: str | Path) -> IrradianceVectorGrid:
        """Read a grid from a .ivg.npz file; raises `GridFileError`."""
        from .grid_file import load

        return load(Path(path))


def _checked(points: ArrayLike, normals: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return points and normals as arrays of the same shape, (n, 3); raises `SettingsError`."""
    try:
        p = np.ascontiguousarray(points, dtype=np.float64)
        n = np.ascontiguousarray(normals, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise SettingsError(f"points and normals must be numbers in the shape (n, 3): {error}") from error
    if p.ndim != 2 or p.shape[1] != 3 or p.shape != n.shape:
        raise SettingsError(f"points {p.shape} and normals {n.shape} must both have the shape (n, 3)")
    if not (np.isfinite(p).all() and np.isfinite(n).all()):
        raise SettingsError("points and normals must be finite numbers: NaN or infinity given")
    if not n.any(axis=1).all():
        raise SettingsError("normals must not have length zero")
    return p, n
