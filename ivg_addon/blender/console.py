# SPDX-License-Identifier: GPL-3.0-or-later
"""Progress on a console: one line that is rewritten, or a line now and then in a log."""

from __future__ import annotations

import time
from types import TracebackType
from typing import TextIO

from ..core.progress import Progress
from .summary import duration

_REWRITE_SECONDS = 0.1
_LOG_SECONDS = 10.0
_ERASE_TO_END = "\x1b[K"


class Console:
    """Shows progress on a stream; a context manager that leaves a clean line behind."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream
        self._rewrites = stream.isatty()
        self._next_time = 0.0
        self._task = ""

    def __enter__(self) -> Console:
        """Return itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Take the rewritten line away."""
        if self._rewrites and self._task:
            self._stream.write(f"\r{_ERASE_TO_END}")
            self._stream.flush()

    def show(self, progress: Progress) -> None:
        """Show a moment of the work, unless the last one was shown just before."""
        now = time.monotonic()
        task = progress.task.partition(" (")[0]
        if now < self._next_time and (self._rewrites or task == self._task):
            return
        self._next_time = now + (_REWRITE_SECONDS if self._rewrites else _LOG_SECONDS)
        self._task = task
        line = f"{progress.fraction:4.0%}  {progress.task}"
        if progress.seconds_left:
            line += f", {duration(progress.seconds_left)} left"
        self._stream.write(f"\r{line}{_ERASE_TO_END}" if self._rewrites else f"{line}\n")
        self._stream.flush()
