# SPDX-License-Identifier: GPL-3.0-or-later
"""Long work without a frozen window: one kind of job, driven by one of two runners.

A job is a generator of `Progress`. Where there is no window, `run_blocking` drains it. Where there
is one, a modal operator calls `Job.advance` from a timer, a few milliseconds at a time; what needs
no Blender then runs `in_background`, on a thread that never touches bpy. There is one job at a
time. Cancelling only *asks*: the job is over at once, and a thread that is busy (Numba compiling,
say) ends by itself; the next one waits for it.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable, Generator
from typing import Protocol, TypeVar

from ..core.errors import Cancelled
from ..core.progress import Progress

Result = TypeVar("Result")
Steps = Generator[Progress, None, Result]
"""Work that does something between any two progresses."""
PatientSteps = Generator[Progress | None, None, Result]
"""Work that may also yield None: nothing to do but to come back later."""


class Runner(Protocol):
    """How the part of a job that never touches Blender is drained: by which thread."""

    def __call__(self, steps: Steps[Result]) -> PatientSteps[Result]:
        """Drain `steps`; what they return or raise, this returns or raises."""


class Job:
    """One long computation, and what is known of it.

    Parameters
    ----------
    label
        What is being done, for people: "Baking 'Scene'".
    steps
        The work. Closed when it ends, fails or is cancelled.
    holds_data
        Whether it refers to Blender's data between steps: undo, which replaces them, cancels it.
    """

    def __init__(self, label: str, steps: PatientSteps[str], holds_data: bool = False) -> None:
        self.label = label
        self.holds_data = holds_data
        self.progress = Progress("Starting", 0.0)
        self.message: str | None = None
        """What was done, once it is done."""
        self.error: Exception | None = None
        self._steps = steps

    @property
    def running(self) -> bool:
        """Tell whether there is more to do."""
        return self.message is None and self.error is None

    def advance(self, seconds: float) -> None:
        """Work for about `seconds`, or less when there is only waiting to do."""
        deadline = time.perf_counter() + seconds
        while self.running:
            try:
                progress = next(self._steps)
            except StopIteration as end:
                self.message = end.value
            except Exception as error:
                self.error = error
            else:
                self.progress = progress or self.progress
                if progress is None or time.perf_counter() >= deadline:
                    return

    def cancel(self) -> None:
        """Stop, if it is running; nothing of what it did remains. Returns at once."""
        if self.running:
            self.error = Cancelled(f"{self.label}: cancelled, nothing was changed")
            self._steps.close()


SWITCH_SECONDS = 0.0005
"""How long a thread that compiles may keep Python to itself. Drawing the window enters Python a
hundred times, and each time would wait for Python's own 5 ms."""


class _Drain(threading.Thread):
    """A thread that drains a generator, and closes it when it is asked to stop."""

    def __init__(self, steps: Steps[Result]) -> None:
        super().__init__(name="ivg-background", daemon=True)
        self.stop = threading.Event()
        self.progress: Progress | None = None
        self.result: Result | None = None
        self.error: BaseException | None = None
        self._steps = steps

    def run(self) -> None:
        """Step until the end, a failure or a stop."""
        interval = sys.getswitchinterval()
        sys.setswitchinterval(SWITCH_SECONDS)
        try:
            while not self.stop.is_set():
                self.progress = next(self._steps)
        except StopIteration as end:
            self.result = end.value
        except BaseException as error:
            self.error = error
        finally:
            self._steps.close()
            sys.setswitchinterval(interval)


_last_drain: _Drain | None = None


def in_background(steps: Steps[Result]) -> PatientSteps[Result]:
    """Drain `steps` on a thread; what it returns or raises, this returns or raises.

    A thread of a cancelled job that is still busy is waited for first: two would share the
    processors and twice the memory.
    """
    global _last_drain
    while _last_drain is not None and _last_drain.is_alive():
        yield Progress("Waiting for the cancelled job to stop", 0.0)
        yield None
    drain = _last_drain = _Drain(steps)
    drain.start()
    shown = None
    try:
        while drain.is_alive():
            if drain.progress is not shown:
                shown = drain.progress
                yield shown
            yield None
    finally:
        drain.stop.set()
    if drain.error is not None:
        raise drain.error
    return drain.result  # type: ignore[return-value]


def in_foreground(steps: Steps[Result]) -> PatientSteps[Result]:
    """Drain `steps` where they are; the counterpart of `in_background` for the blocking runner."""
    return (yield from steps)


def run_blocking(job: Job, show: Callable[[Progress], None], check: Callable[[], None] = lambda: None) -> None:
    """Drain a job, showing every progress; raises what the job raises.

    `check` may raise between two steps, to cancel the job.
    """
    try:
        while job.running:
            check()
            job.advance(0.0)
            show(job.progress)
    finally:
        job.cancel()
    if job.error is not None:
        raise job.error


_current: Job | None = None


def current() -> Job | None:
    """Return the job that runs in the window now, if any."""
    return _current if _current is not None and _current.running else None


def start(job: Job) -> None:
    """Make a job the current one; the caller has seen that there was none."""
    global _current
    _current = job


def last_error() -> str:
    """Return why the last job of this session failed; empty if it did not, or was cancelled."""
    if _current is None or _current.error is None or isinstance(_current.error, Cancelled):
        return ""
    return str(_current.error)


def forget_error() -> None:
    """Let the last job's failure be history."""
    global _current
    if current() is None:
        _current = None


def cancel_current() -> None:
    """Cancel the job that runs in the window, if any."""
    if _current is not None:
        _current.cancel()
