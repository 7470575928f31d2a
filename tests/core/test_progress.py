# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work as a generator."""

from __future__ import annotations

from collections.abc import Generator

import pytest

from ivg_addon.core.errors import SceneError
from ivg_addon.core.progress import Progress, finish, part


def work(steps: int) -> Generator[Progress, None, str]:
    for step in range(steps):
        yield Progress("Working", step / steps)
    return f"done in {steps}"


@pytest.mark.parametrize("steps", [0, 1, 5])
def test_finish_returns_the_result(steps: int) -> None:
    assert finish(work(steps)) == f"done in {steps}"


def test_finish_hands_on_what_goes_wrong() -> None:
    def fails() -> Generator[Progress, None, None]:
        yield Progress("Working", 0.0)
        raise SceneError("no light")

    with pytest.raises(SceneError, match="no light"):
        finish(fails())


def test_a_part_scales_how_far_it_is_and_how_far_it_comes() -> None:
    def steps() -> Generator[Progress | None, None, None]:
        yield Progress("Working", 0.5, until=1.0)
        yield None
        yield Progress("Working", 1.0)

    assert list(part(steps(), 0.2, 0.6)) == [Progress("Working", 0.4, until=0.6), None, Progress("Working", 0.6)]
