# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of numbers, and maps of differences."""

from __future__ import annotations

import numpy as np
import pytest

from ivg_addon.core.false_color import (
    difference_colors,
    light_colors,
    linear,
    local_mean,
    luminance,
    round_scale,
)


def test_the_sign_shows_as_a_hue_and_the_size_as_brightness() -> None:
    dark, slightly_dark, none, slightly_bright, bright = difference_colors([-1.0, -0.5, 0.0, 0.5, 1.0])
    assert slightly_dark[2] > slightly_dark[0] and slightly_bright[0] > slightly_bright[2]
    assert dark.sum() > slightly_dark.sum() > none.sum() < slightly_bright.sum() < bright.sum()
    np.testing.assert_array_equal(difference_colors([-9.0, 9.0]), [dark, bright])


@pytest.mark.parametrize(("width", "scale"), [(0.0, 0.01), (0.011, 0.02), (0.05, 0.05), (0.3, 0.5), (0.7, 1.0)])
def test_scales_are_round(width: float, scale: float) -> None:
    assert round_scale([-width, width]) == pytest.approx(scale)


def test_luminance_of_white_is_one() -> None:
    assert luminance([1.0, 1.0, 1.0]) == pytest.approx(1.0)


def test_local_means() -> None:
    rng = np.random.default_rng(0)
    values = rng.normal(size=(12, 17))
    ones = np.ones_like(values)
    np.testing.assert_allclose(local_mean(values, ones, 1), values)
    np.testing.assert_allclose(local_mean(ones, rng.uniform(size=values.shape), 5), ones)
    one = np.zeros_like(values)
    one[6, 8] = 1.0
    hat = np.outer([1, 2, 3, 2, 1], [1, 2, 3, 2, 1])
    np.testing.assert_allclose(local_mean(one, ones, 3)[4:9, 6:11], hat / 81, atol=1e-12)


def test_local_means_do_not_reach_over_what_is_masked() -> None:
    values = np.where(np.arange(20) < 10, 1.0, 1000.0) * np.ones((20, 1))
    mask = (np.arange(20) < 10) * np.ones((20, 1))
    np.testing.assert_allclose(local_mean(values, mask, 5)[:, :10], 1.0)
    np.testing.assert_array_equal(local_mean(values, mask, 5)[:, 16:], 0.0)


def test_more_light_is_lighter() -> None:
    light = luminance(linear(light_colors(np.linspace(0.0, 1.0, 101))))
    assert (np.diff(light) > 0.0).all()
    assert light[0] < 0.001
    np.testing.assert_array_equal(light_colors([-1.0, 2.0]), light_colors([0.0, 1.0]))


def test_display_colours_are_decoded_as_the_standard_says() -> None:
    np.testing.assert_allclose(linear([0.0, 0.04045, 0.5, 1.0]), [0.0, 0.0031308, 0.214041, 1.0], rtol=1e-5)
