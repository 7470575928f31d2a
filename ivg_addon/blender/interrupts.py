# SPDX-License-Identifier: GPL-3.0-or-later
"""Ctrl-C on the command line.

Python would raise `KeyboardInterrupt` wherever it is: while Blender starts that ends in a crash,
and inside Blender's callbacks it is printed and forgotten. So it is only noted, and raised between
two steps; but where a step takes long and is not Blender's, it is raised at once.
"""

from __future__ import annotations

import signal
from types import FrameType, TracebackType

from .jobs import PatientSteps, Result, Steps


class Interrupts:
    """A context manager in which Ctrl-C is noted; outside, it does what it did before."""

    def __init__(self) -> None:
        self._asked = False
        self._at_once = False

    def __enter__(self) -> Interrupts:
        """Take Ctrl-C over."""
        self._previous = signal.signal(signal.SIGINT, self._note)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Give Ctrl-C back; a handler of the Blender program itself, which Python cannot set, ends it."""
        signal.signal(signal.SIGINT, self._previous or signal.SIG_DFL)

    def check(self) -> None:
        """Raise `KeyboardInterrupt` if Ctrl-C was pressed."""
        if self._asked:
            raise KeyboardInterrupt

    def run(self, steps: Steps[Result]) -> PatientSteps[Result]:
        """Drain steps that do not touch Blender: a job's runner. Ctrl-C is raised at once."""
        self.check()
        self._at_once = True
        try:
            return (yield from steps)
        finally:
            self._at_once = False

    def _note(self, number: int, frame: FrameType | None) -> None:
        """Note that Ctrl-C was pressed."""
        self._asked = True
        if self._at_once:
            raise KeyboardInterrupt
