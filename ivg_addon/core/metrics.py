# SPDX-License-Identifier: GPL-3.0-or-later
"""How far an estimate is from the truth, in two numbers, and how well the truth itself is known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import SettingsError

Float64 = NDArray[np.float64]


@dataclass(frozen=True)
class Agreement:
    """How an estimate e compares with a reference r, over all values of all channels.

    Parameters
    ----------
    relative_rmse
        √mean((e − r)²) / mean(r).
    energy_ratio
        mean(e) / mean(r).
    noise
        √mean(s²) / mean(r), s the standard error of each reference value: the relative RMSE that
        an estimate without any error would get.
    count
        Number of values, channels counted apart.
    rmse_error
        Standard error of `relative_rmse`: other places would have given another number.
    """

    relative_rmse: float
    energy_ratio: float
    noise: float
    count: int
    rmse_error: float

    @property
    def own_rmse(self) -> float:
        """Return the relative RMSE without the reference's noise: √(relative_rmse² − noise²), at least 0.

        Noise is independent of the estimate, so the squares add up.
        """
        return math.sqrt(max(0.0, self.relative_rmse**2 - self.noise**2))

    @property
    def own_rmse_error(self) -> float:
        """Return the standard error of `own_rmse`; infinite where noise is all there is."""
        return self.rmse_error * self.relative_rmse / self.own_rmse if self.own_rmse > 0.0 else math.inf


def compare(estimate: ArrayLike, reference: ArrayLike, reference_error: ArrayLike = 0.0) -> Agreement:
    """Compare two arrays of the same shape.

    Parameters
    ----------
    estimate, reference : (places, …)
        Irradiance, radiance: any quantity with a positive mean.
    reference_error : broadcastable to (…)
        Standard error of each reference value.

    Raises
    ------
    SettingsError
        Shapes that differ, nothing to compare, values that are not finite, a reference without light.
    """
    e, r = np.asarray(estimate, dtype=np.float64), np.asarray(reference, dtype=np.float64)
    s = np.broadcast_to(np.asarray(reference_error, dtype=np.float64), r.shape)
    if e.shape != r.shape or e.size == 0:
        raise SettingsError(f"cannot compare shapes {e.shape} and {r.shape}: they must agree and not be empty")
    if not (np.isfinite(e).all() and np.isfinite(r).all() and np.isfinite(s).all()):
        raise SettingsError("cannot compare values that are not finite numbers")
    mean = float(r.mean())
    if mean <= 0.0:
        raise SettingsError("there is no indirect light in the reference: nothing to compare with")
    squares = ((e - r) ** 2).reshape(len(e), -1).mean(axis=1)
    rmse = math.sqrt(float(squares.mean()))
    scatter = float(squares.std(ddof=1)) / math.sqrt(len(squares)) if len(squares) > 1 else math.inf
    return Agreement(
        relative_rmse=rmse / mean,
        energy_ratio=float(e.mean()) / mean,
        noise=math.sqrt(float(np.mean(s**2))) / mean,
        count=e.size,
        rmse_error=scatter / (2.0 * rmse) / mean if rmse > 0.0 else 0.0,
    )


def mean_and_error(batches: Sequence[ArrayLike]) -> tuple[Float64, Float64]:
    """Return the mean (…) of independent estimates, and its standard error (…); two batches or more."""
    samples = np.asarray(batches, dtype=np.float64)
    if len(samples) < 2:
        raise SettingsError("a standard error needs two batches or more")
    return samples.mean(axis=0), samples.std(axis=0, ddof=1) / math.sqrt(len(samples))
