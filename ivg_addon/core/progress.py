# SPDX-License-Identifier: GPL-3.0-or-later
"""What a long computation tells while it runs.

Long work is a generator: it yields a `Progress` after every small step, returns its result, and
is cancelled by closing it. Whoever drives it decides how to show it and when to stop.
"""

from __future__ import annotations

from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass, replace
from typing import TypeVar

Result = TypeVar("Result")
Moment = TypeVar("Moment", "Progress", "Progress | None")


@dataclass(frozen=True)
class Progress:
    """A moment of a long computation.

    Parameters
    ----------
    task
        What is being done, for people: "Tracing photons".
    fraction
        Share of the whole work that is done, 0 to 1.
    seconds_left
        Estimate for the whole work, or None while nothing is known.
    until
        Share that is done when the next progress comes, where that is known and takes long.
    """

    task: str
    fraction: float
    seconds_left: float | None = None
    until: float | None = None


def finish(steps: Generator[Moment, None, Result]) -> Result:
    """Run long work to its end, without showing anything, and return its result."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            result: Result = end.value
            return result


def part(steps: Generator[Moment, None, Result], low: float, high: float) -> Generator[Moment, None, Result]:
    """Run long work as the part from `low` to `high` of the whole; None, "nothing new", goes through as it is."""
    with closing(steps):
        while True:
            try:
                progress = next(steps)
            except StopIteration as end:
                result: Result = end.value
                return result
            if progress is not None:
                progress = replace(
                    progress,
                    fraction=low + (high - low) * progress.fraction,
                    until=None if progress.until is None else low + (high - low) * progress.until,
                )
            yield progress
