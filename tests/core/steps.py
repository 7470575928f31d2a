# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work, done at once."""

from __future__ import annotations

from collections.abc import Generator
from typing import TypeVar

Result = TypeVar("Result")


def drain(steps: Generator[object, None, Result]) -> Result:
    """Take all steps and return what they return."""
    while True:
        try:
            next(steps)
        except StopIteration as end:
            return end.value
