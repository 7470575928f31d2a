# SPDX-License-Identifier: GPL-3.0-or-later
"""The two numbers of every comparison, and the noise that is taken out of them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ivg_addon.core.errors import SettingsError
from ivg_addon.core.metrics import Agreement, compare, mean_and_error

from .z_tests import assert_means


def test_numbers_worked_out_by_hand() -> None:
    found = compare([[1.0, 2.0], [3.0, 6.0]], [[2.0, 2.0], [2.0, 2.0]], [[1.0, 1.0], [1.0, 3.0]])
    rmse = math.sqrt((1 + 0 + 1 + 16) / 4)
    # Mean squares of the two places are 0.5 and 8.5: their mean's standard error is 4.
    assert found == Agreement(
        relative_rmse=rmse / 2, energy_ratio=1.5, noise=math.sqrt(3.0) / 2, count=4, rmse_error=4 / (2 * rmse) / 2
    )


def test_noise_is_taken_out_in_squares_and_never_below_zero() -> None:
    found = Agreement(0.05, 1.0, 0.04, 1, 0.003)
    assert found.own_rmse == pytest.approx(0.03)
    assert found.own_rmse_error == pytest.approx(0.005)
    assert Agreement(0.03, 1.0, 0.04, 1, 0.003).own_rmse == 0.0


def test_an_estimate_without_error_is_left_with_the_noise_alone() -> None:
    """In the mean over many noisy references, relative_rmse² − noise² is 0; false alarms as in `z_tests`."""
    rng = np.random.default_rng(1)
    truth = rng.uniform(1.0, 2.0, size=200)
    left = []
    for _ in range(400):
        mean, error = mean_and_error(truth + 0.3 * rng.normal(size=(8, 200)))
        found = compare(truth, mean, error)
        left.append([found.relative_rmse**2 - found.noise**2])
    assert_means(left, 0.0)


def test_the_rmse_scatters_by_its_error() -> None:
    """Over many sets of places; its square is compared, which is free of bias; false alarms as in `z_tests`."""
    rng = np.random.default_rng(2)
    truth = np.ones((500, 3))
    found = [compare(truth + 0.2 * rng.normal(size=(500, 1)), truth) for _ in range(2000)]
    squares = np.array([one.relative_rmse**2 for one in found])
    errors = np.array([2 * one.relative_rmse * one.rmse_error for one in found])
    assert_means(((squares - 0.04) ** 2 - errors**2)[:, None], 0.0)


def test_mean_and_error() -> None:
    mean, error = mean_and_error([[1.0, 5.0], [3.0, 5.0]])
    np.testing.assert_array_equal(mean, [2.0, 5.0])
    np.testing.assert_allclose(error, [1.0, 0.0])


@pytest.mark.parametrize(
    ("estimate", "reference", "message"),
    [
        ([1.0], [1.0, 2.0], "shapes"),
        ([], [], "empty"),
        ([math.nan], [1.0], "finite"),
        ([1.0], [math.inf], "finite"),
        ([1.0], [0.0], "no indirect light"),
    ],
)
def test_what_cannot_be_compared_is_refused(estimate: list[float], reference: list[float], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        compare(estimate, reference)


def test_one_batch_has_no_error() -> None:
    with pytest.raises(SettingsError, match="two batches"):
        mean_and_error([[1.0]])
