# SPDX-License-Identifier: GPL-3.0-or-later
"""The statistical tests that the tests share, each with its false-alarm rate.

A statistic is computed from independent batches, so that its standard error is measured and not assumed. Many
statistics are tested at once by their largest deviation: the rate below is that of the whole test (Bonferroni, which
holds for statistics that depend on each other too).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Float64 = NDArray[np.float64]

FALSE_ALARM = 1e-7
"""Chance that a test of right code fails with a new seed."""


def largest_z(batches: ArrayLike, truth: ArrayLike) -> float:
    """Return the largest deviation of the batches' means from the truth, as a z of the normal distribution.

    Student's t becomes z by Wallace, "Bounds on Normal Approximations to Student's and the Chi-Square Distributions",
    1959.

    Parameters
    ----------
    batches : (batches, …)
        Independent estimates of the same numbers.
    truth : broadcastable to (…)
    """
    samples = np.asarray(batches, dtype=np.float64)
    freedom = len(samples) - 1
    error = samples.std(axis=0, ddof=1) / math.sqrt(len(samples))
    deviation = np.abs(samples.mean(axis=0) - truth)
    # Where nothing scatters (a sum that is zero term by term), only the truth itself will do.
    t = np.where(deviation == 0.0, 0.0, deviation / np.maximum(error, 1e-300))
    z = np.sqrt(freedom * np.log1p(t * t / freedom)) * (8 * freedom + 1) / (8 * freedom + 3)
    return float(z.max())


def assert_means(batches: ArrayLike, truth: ArrayLike) -> None:
    """Two-sided test that independent estimates (batches, …) have the expectation `truth` (…)."""
    samples = np.asarray(batches, dtype=np.float64)
    tests = samples[0].size
    z = largest_z(samples, truth)
    p = tests * math.erfc(z / math.sqrt(2.0))
    assert p >= FALSE_ALARM, f"largest of {tests} deviations: {z:.1f} standard errors; means {samples.mean(axis=0)}"


def assert_counts(observed: ArrayLike, probability: ArrayLike) -> None:
    """Pearson's chi-square test of counts against their bins' probabilities, which sum up to one.

    χ² with k degrees of freedom becomes normal by Wilson & Hilferty, PNAS 17, 1931.
    """
    counts = np.asarray(observed, dtype=np.float64).ravel()
    expected = counts.sum() * np.broadcast_to(probability, np.shape(observed)).ravel()
    np.testing.assert_allclose(expected.sum(), counts.sum(), rtol=1e-9)
    assert expected.min() > 10.0, "too few counts for a chi-square test"
    k = len(counts) - 1
    chi2 = float(((counts - expected) ** 2 / expected).sum())
    z = ((chi2 / k) ** (1 / 3) - (1 - 2 / (9 * k))) / math.sqrt(2 / (9 * k))
    # Two-sided: counts that are too even are wrong, too.
    assert math.erfc(abs(z) / math.sqrt(2.0)) >= FALSE_ALARM, f"chi-square {chi2:.0f} of {k} degrees of freedom"
