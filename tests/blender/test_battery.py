# SPDX-License-Identifier: GPL-3.0-or-later
"""A handful of the battery's cases, with little effort, and that wrong light does not pass."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import pytest

bpy = pytest.importorskip("bpy")

from benchmarks.battery.outcome import CASE_FALSE_ALARM, CASES, QUICK, run  # noqa: E402
from benchmarks.battery.stage import TESTED, Case, card, plain, room  # noqa: E402

PASSING = (
    "light: area disk",
    "light: spot with blend",
    "mesh light: strengths over 10⁶",
    "world: one colour",
    "surface: Diffuse",
    "texture: image, mirror",
    "object: instances of instances",
    "visible: not to diffuse rays",
    "setting: film exposure and view transform",
)


@pytest.fixture(autouse=True)
def _empty_session() -> Iterator[None]:
    yield
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def case_of(name: str) -> Case:
    (found,) = (case for case in CASES if case.name == name)
    return found


def test_there_are_many_cases_of_different_names() -> None:
    assert len({case.name for case in CASES}) == len(CASES) >= 50


@pytest.mark.parametrize("name", PASSING)
def test_what_cycles_lights_the_bake_lights(name: str) -> None:
    """Irradiance of 245 dual cells towards six axes; the false-alarm rate is `CASE_FALSE_ALARM` for either light."""
    outcome = run(case_of(name), QUICK)
    assert outcome.status == "pass", outcome


def test_a_tenth_too_much_light_fails_either_way() -> None:
    outcome = run(case_of("surface: Diffuse"), QUICK, factor=1.1)
    assert outcome.status == "FAIL"
    assert all(verdict.p < CASE_FALSE_ALARM for verdict in outcome.verdicts.values())


def test_a_failure_is_named_only_if_the_bake_names_what_is_tested() -> None:
    wrong = run(case_of("surface: Diffuse"), QUICK, factor=1.1)
    assert (wrong.status, wrong.notices) == ("FAIL", ())
    assert replace(wrong, notices=("left out: object 'Tested': not baked",)).status == "named"


def test_an_object_in_the_cells_is_no_case() -> None:
    def build() -> None:
        room()
        card(plain(TESTED), location=(0.0, 0.0, 0.8))

    outcome = run(Case("in the way", build), QUICK)
    assert "'Tested' may cut cells" in outcome.error
    assert outcome.status == "FAIL"
