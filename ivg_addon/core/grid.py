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
from .prefilter import sharpened
from .settings import BakeSettings, Directional, Spatial, Vec3

DEFAULT_NORMAL_BIAS = 0.25
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


class _SharpenedVectors(dict[Spatial, NDArray[np.float32]]):
    """Vectors by the interpolation that they are sharpened for."""

    def __init__(self, vectors: NDArray[np.float32], validity: NDArray[np.float32]) -> None:
        super().__init__()
        self._vectors, self._validity = vectors, validity

    def __missing__(self, spatial: Spatial) -> NDArray[np.float32]:
        self[spatial] = sharpened(self._vectors, self._validity, spatial)
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
    lattice
        Bounds and resolution.
    record
        How the grid came to be.
    """

    vectors: NDArray[np.float32]
    validity: NDArray[np.float32]
    lattice: Lattice
    record: BakeRecord = field(compare=False)

    def __post_init__(self) -> None:
        """Check shapes and types."""
        if self.vectors.shape != (*self.lattice.shape, 6, 3, 3):
            raise SettingsError(
                f"grid vectors have shape {self.vectors.shape}: "
                f"a grid of {self.resolution} voxels needs {(*self.lattice.shape, 6, 3, 3)}"
            )
        if self.validity.shape != self.lattice.shape:
            raise SettingsError(
                f"grid validity has shape {self.validity.shape}: "
                f"a grid of {self.resolution} voxels needs {self.lattice.shape}"
            )
        for name, array in (("vectors", self.vectors), ("validity", self.validity)):
            if array.dtype != np.float32:
                raise SettingsError(f"grid {name}: {array.dtype} instead of float32")

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
        if not math.isfinite(normal_bias):
            raise SettingsError(
                f"normal bias {normal_bias}: use a number of voxels, for instance {DEFAULT_NORMAL_BIAS}"
            )
        try:
            spatial, directional = Spatial(spatial), Directional(directional)
        except ValueError as error:
            raise SettingsError(f"{error}: use TRILINEAR or TRICUBIC, and LEAST_SQUARES or REPORT") from error
        from .look_up import irradiance

        vectors = self.vectors if directional is Directional.REPORT else self._sharpened[spatial]
        return irradiance(vectors, self.validity, self.lattice, p, n, spatial, directional, normal_bias)

    @cached_property
    def _sharpened(self) -> _SharpenedVectors:
        """The vectors as the default look-ups interpolate them, made when first asked for."""
        return _SharpenedVectors(self.vectors, self.validity)

    def save(self, path: str | Path) -> None:
        """Write the grid to a .ivg.npz file, whole or not at all; raises `GridFileError`."""
        from .grid_file import save

        save(self, Path(path))

    @classmethod
    def load(cls, path: str | Path) -> IrradianceVectorGrid:
        """Read a grid from a .ivg.npz file; raises `GridFileError`."""
        from .grid_file import load

        return load(Path(path))
