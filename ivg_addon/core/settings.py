# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of a bake, with their limits checked in one place."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from .errors import SettingsError

Vec3 = tuple[float, float, float]

MOST_PHOTONS = 2**31 - 1
"""Photons that land on a patch of surface are counted in 32 bits."""
MOST_BOUNCES = 1024
MOST_THREADS = 1024
LARGEST_SEED = 2**63 - 1


class Estimator(StrEnum):
    """How a photon's flight becomes irradiance vectors (docs/method.md, "Three estimators")."""

    REPORT = "REPORT"
    CROSSING = "CROSSING"
    TRACK_LENGTH = "TRACK_LENGTH"


class Directional(StrEnum):
    """How six vectors become the irradiance of any normal."""

    REPORT = "REPORT"
    LEAST_SQUARES = "LEAST_SQUARES"


class Spatial(StrEnum):
    """How the vertices around a point are weighted."""

    TRILINEAR = "TRILINEAR"
    TRICUBIC = "TRICUBIC"


@dataclass(frozen=True)
class BakeSettings:
    """What to bake.

    Parameters
    ----------
    bounds_min, bounds_max
        Corners of the grid's box, metres, world space.
    resolution
        Voxels along x, y and z; the grid has one vertex more along each axis.
    photons
        Photons emitted.
    bounces
        Most diffuse bounces of a photon; Cycles' `diffuse_bounces` of the same number gives the
        same light.
    seed
        The same seed gives the same bits for any number of threads.
    estimator
        See `Estimator`.
    include_direct
        Deposit photons from the light on, not only after their first bounce.
    threads
        Worker threads; 0 means one per processor.
    lit_points
        Random points per dual cell that geometry cuts, for its lit volume; 0 normalises by the
        whole cell, as the report does.
    """

    bounds_min: Vec3
    bounds_max: Vec3
    resolution: tuple[int, int, int]
    photons: int = 8_000_000
    bounces: int = 12
    seed: int = 0
    estimator: Estimator = Estimator.TRACK_LENGTH
    include_direct: bool = False
    threads: int = 0
    lit_points: int = 512

    def __post_init__(self) -> None:
        """Check every limit; raises `SettingsError` that names the setting."""
        for axis, low, high in zip("xyz", self.bounds_min, self.bounds_max, strict=True):
            if not (low < high and math.isfinite(low) and math.isfinite(high)):
                raise SettingsError(
                    f"grid bounds are empty along {axis} ({low:g} to {high:g} m): "
                    "choose a box with volume, or bounds from the scene"
                )
        if min(self.resolution) < 1:
            raise SettingsError(f"grid resolution {self.resolution} has no voxels along an axis: use 1 or more")
        if self.photons < 1:
            raise SettingsError(f"{self.photons} photons carry no light: use 1 or more")
        if self.photons > MOST_PHOTONS:
            raise SettingsError(f"{self.photons:,} photons are too many to count: use {MOST_PHOTONS:,} or fewer")
        if self.bounces < 1:
            raise SettingsError(f"{self.bounces} bounces leave no indirect light to store: use 1 or more")
        if self.bounces > MOST_BOUNCES:
            raise SettingsError(f"{self.bounces} bounces: use {MOST_BOUNCES} or fewer")
        if not 0 <= self.seed <= LARGEST_SEED:
            raise SettingsError(f"seed {self.seed}: use 0 to {LARGEST_SEED}")
        if not 0 <= self.threads <= MOST_THREADS:
            raise SettingsError(f"{self.threads} threads: use 0 for all processors, or up to {MOST_THREADS}")
        if self.lit_points < 0:
            raise SettingsError(f"{self.lit_points} lit-volume points: use 0 or more")
        if self.estimator not in list(Estimator):
            raise SettingsError(f"estimator '{self.estimator}' does not exist: use {', '.join(Estimator)}")
        # A plain string would do for a comparison, but not for `is`.
        object.__setattr__(self, "estimator", Estimator(self.estimator))
