# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs and their two runners, with work that needs neither Blender nor time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

import pytest

from ivg_addon.blender import jobs
from ivg_addon.core.errors import Cancelled, SceneError
from ivg_addon.core.progress import Progress, part

PATIENCE = 5.0
"""Seconds after which something that must happen at once has not happened."""


def counted(closed: list[str], steps: int = 3) -> jobs.Steps[str]:
    """Take some steps, and note how it ended."""
    try:
        for step in range(steps):
            yield Progress("Counting", step / steps)
        return "counted"
    except GeneratorExit:
        closed.append("closed")
        raise


def failing() -> jobs.Steps[str]:
    """Fail in the second step."""
    yield Progress("Failing", 0.0)
    raise SceneError("no light")


def run(job: jobs.Job) -> None:
    """Advance as a window would, by ticks."""
    end = time.monotonic() + PATIENCE
    while job.running:
        assert time.monotonic() < end, "the job does not end"
        job.advance(0.001)
        time.sleep(0.001)


@pytest.mark.parametrize("runner", [jobs.in_foreground, jobs.in_background])
def test_both_runners_return_what_the_steps_return(runner: jobs.Runner) -> None:
    job = jobs.Job("Test", runner(counted([])))
    run(job)
    assert (job.message, job.error) == ("counted", None)


@pytest.mark.parametrize("runner", [jobs.in_foreground, jobs.in_background])
def test_both_runners_pass_errors_on(runner: jobs.Runner) -> None:
    job = jobs.Job("Test", runner(failing()))
    run(job)
    assert isinstance(job.error, SceneError)
    assert job.message is None


def test_blocking_runner_shows_every_step_and_raises() -> None:
    shown: list[float] = []
    jobs.run_blocking(jobs.Job("Test", counted([], steps=4)), lambda progress: shown.append(progress.fraction))
    assert shown[:4] == [0.0, 0.25, 0.5, 0.75]
    with pytest.raises(SceneError, match="no light"):
        jobs.run_blocking(jobs.Job("Test", failing()), lambda progress: None)


def test_interrupt_between_steps_closes_the_work() -> None:
    def interrupt() -> None:
        if shown:
            raise KeyboardInterrupt

    shown: list[Progress] = []
    closed: list[str] = []
    with pytest.raises(KeyboardInterrupt):
        jobs.run_blocking(jobs.Job("Test", counted(closed)), shown.append, interrupt)
    assert closed == ["closed"]


def test_cancel_closes_the_work_and_says_so() -> None:
    closed: list[str] = []
    job = jobs.Job("Test", counted(closed))
    job.advance(0.0)
    job.cancel()
    assert isinstance(job.error, Cancelled)
    assert closed == ["closed"]
    job.cancel()
    job.advance(1.0)
    assert not job.running


def test_cancel_returns_at_once_and_the_next_job_waits_for_the_thread() -> None:
    """As Numba compiling would: a step that cannot be interrupted."""
    compiled = threading.Event()
    order: list[str] = []

    def compiling() -> jobs.Steps[str]:
        yield Progress("Compiling", 0.0)
        order.append("compiling")
        assert compiled.wait(PATIENCE)
        order.append("compiled")
        yield Progress("Tracing", 0.5)
        order.append("never")
        return ""

    first = jobs.Job("First", jobs.in_background(compiling()))
    wait_until(lambda: "compiling" in order, first)
    start = time.perf_counter()
    first.cancel()
    assert time.perf_counter() - start < 0.1
    assert not first.running

    def following() -> jobs.Steps[str]:
        order.append("next")
        yield Progress("Next", 0.0)
        return "done"

    second = jobs.Job("Second", jobs.in_background(following()))
    second.advance(0.01)
    assert "Waiting" in second.progress.task
    compiled.set()
    run(second)
    assert order == ["compiling", "compiled", "next"]
    assert second.message == "done"


def wait_until(happened: Callable[[], bool], job: jobs.Job) -> None:
    """Advance a job until something has happened."""
    end = time.monotonic() + PATIENCE
    while not happened():
        assert time.monotonic() < end, "it does not happen"
        job.advance(0.001)
        time.sleep(0.001)


def test_waiting_for_the_thread_does_not_use_up_a_tick() -> None:
    released = threading.Event()

    def slow() -> jobs.Steps[str]:
        yield Progress("Slow", 0.0)
        assert released.wait(PATIENCE)
        return ""

    job = jobs.Job("Slow", jobs.in_background(slow()))
    start = time.perf_counter()
    for _ in range(10):
        job.advance(1.0)
    assert time.perf_counter() - start < 1.0
    released.set()
    run(job)


def test_part_scales_progress_and_closes() -> None:
    closed: list[str] = []
    steps = part(counted(closed, steps=2), 0.5, 1.0)
    assert [next(steps).fraction, next(steps).fraction] == [0.5, 0.75]  # type: ignore[union-attr]
    steps.close()
    assert closed == ["closed"]


def test_last_error_is_told_until_it_is_forgotten() -> None:
    job = jobs.Job("Test", failing())
    jobs.start(job)
    assert jobs.current() is job
    run(job)
    assert jobs.current() is None
    assert jobs.last_error() == "no light"
    jobs.forget_error()
    assert jobs.last_error() == ""
