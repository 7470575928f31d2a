# SPDX-License-Identifier: GPL-3.0-or-later
"""Where Cycles is asked: in this Blender, or in a second one so that this one's window does not wait.

A question is a function of datablocks and of arguments that can be pickled. It answers in steps, and the file is as it
was whenever it yields, ends or fails. So it gives the same answer in any Blender that has the datablocks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Concatenate, ParamSpec, Protocol, TypeVar

import bpy

from .jobs import PatientSteps, Steps

Result = TypeVar("Result")
Arguments = ParamSpec("Arguments")

Find = Callable[[], Sequence[bpy.types.ID]]
"""Returns the datablocks that a question is about: between two steps undo may move them in memory."""


class Asker(Protocol):
    """How a question is answered."""

    def __call__(
        self,
        answer: Callable[Concatenate[Find, Arguments], Steps[Result]],
        find: Find,
        *arguments: Arguments.args,
        **named: Arguments.kwargs,
    ) -> PatientSteps[Result]:
        """Drain `answer(find, …)`; what it returns or raises, this returns or raises."""


def here(
    answer: Callable[Concatenate[Find, Arguments], Steps[Result]],
    find: Find,
    *arguments: Arguments.args,
    **named: Arguments.kwargs,
) -> PatientSteps[Result]:
    """Ask Cycles in this Blender, which waits meanwhile: the asker for where there is no window."""
    return (yield from answer(find, *arguments, **named))
