# SPDX-License-Identifier: GPL-3.0-or-later
"""The limits of a bake's settings: each error names the setting and what would be right."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ivg_addon.core.errors import IvgError, SettingsError
from ivg_addon.core.settings import LARGEST_SEED, MOST_BOUNCES, MOST_PHOTONS, MOST_THREADS, BakeSettings, Estimator

BOX: dict[str, Any] = {"bounds_min": (0.0, 0.0, 0.0), "bounds_max": (1.0, 2.0, 3.0), "resolution": (4, 5, 6)}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"bounds_max": (1.0, 0.0, 3.0)}, r"bounds are empty along y \(0 to 0 m\): choose a box"),
        ({"bounds_min": (0.0, 0.0, 4.0)}, r"bounds are empty along z \(4 to 3 m\)"),
        ({"bounds_min": (float("nan"), 0.0, 0.0)}, "bounds are empty along x"),
        ({"bounds_max": (float("inf"), 1.0, 1.0)}, "bounds are empty along x"),
        ({"bounds_min": (-float("inf"), 0.0, 0.0)}, "bounds are empty along x"),
        ({"resolution": (4, 0, 6)}, r"resolution \(4, 0, 6\) has no voxels along an axis: use 1 or more"),
        ({"resolution": (-1, 5, 6)}, "has no voxels"),
        ({"photons": 0}, "0 photons carry no light: use 1"),
        ({"photons": MOST_PHOTONS + 1}, "2,147,483,648 photons are too many to count: use 2,147,483,647"),
        ({"bounces": 0}, "0 bounces leave no indirect light"),
        ({"bounces": MOST_BOUNCES + 1}, "1025 bounces: use 1024"),
        ({"seed": -1}, "seed -1: use 0 to"),
        ({"seed": 2**64}, "seed 18446744073709551616: use 0 to"),
        ({"threads": -1}, "-1 threads: use 0 for all processors"),
        ({"threads": MOST_THREADS + 1}, "1025 threads"),
        ({"lit_points": -1}, "-1 lit-volume points: use 0"),
        ({"estimator": "SHOT"}, "estimator 'SHOT' does not exist: use REPORT, CROSSING, TRACK_LENGTH"),
    ],
)
def test_each_limit(change: dict[str, Any], message: str) -> None:
    with pytest.raises(SettingsError, match=message) as caught:
        BakeSettings(**{**BOX, **change})
    assert "\n" not in str(caught.value)


def test_the_limits_themselves_are_allowed() -> None:
    BakeSettings(**BOX, photons=1, bounces=1, seed=0, threads=0, lit_points=0)
    BakeSettings(**BOX, photons=MOST_PHOTONS, bounces=MOST_BOUNCES, seed=LARGEST_SEED, threads=MOST_THREADS)


@pytest.mark.parametrize("name", ["REPORT", "CROSSING", "TRACK_LENGTH"])
def test_an_estimator_may_be_named(name: str) -> None:
    assert BakeSettings(**BOX, estimator=name).estimator is Estimator(name)  # type: ignore[arg-type]


numbers = st.integers(-(2**70), 2**70)


@given(
    st.tuples(*[st.floats()] * 3), st.tuples(*[st.floats()] * 3), st.tuples(numbers, numbers, numbers), numbers, numbers
)
def test_anything_else_is_refused_by_name(
    low: tuple[float, ...], high: tuple[float, ...], resolution: tuple[int, ...], photons: int, seed: int
) -> None:
    try:
        settings = BakeSettings(low, high, resolution, photons=photons, seed=seed)  # type: ignore[arg-type]
    except IvgError as error:
        assert isinstance(error, SettingsError)
    else:
        assert all(a < b for a, b in zip(settings.bounds_min, settings.bounds_max, strict=True))
        assert min(settings.resolution) >= 1
