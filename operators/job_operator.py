# SPDX-License-Identifier: GPL-3.0-or-later
"""What the operators that take long have in common: the two runners of a job."""

from __future__ import annotations

import sys
import time
import traceback

import bpy

from ..ivg_addon.blender import jobs
from ..ivg_addon.blender.asking import Asker, here
from ..ivg_addon.blender.console import Console
from ..ivg_addon.blender.second_blender import SecondBlender
from ..ivg_addon.blender.summary import duration
from ..ivg_addon.core.errors import Cancelled, IvgError
from ..ivg_addon.core.progress import Progress
from .needs import poll_editable

TICK_SECONDS = 0.05
SLICE_SECONDS = 0.02
"""How long the window waits for a tick's work."""
REDRAW_SECONDS = 0.25
"""Drawing costs time that the photons, or the next event, could have."""


class JobOperator(bpy.types.Operator):
    """An operator whose work is a job: blocking when executed, modal when invoked."""

    def make_job(self, context: bpy.types.Context, run: jobs.Runner, ask: Asker) -> jobs.Job:
        """Return the job; `run` is for the part that never touches Blender, `ask` for what Cycles is asked."""
        raise NotImplementedError

    def show_result(self, context: bpy.types.Context) -> None:
        """Show what the job made, where there is a window; nothing, unless an operator does more."""

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        """One job at a time, and only in a scene that can keep the result."""
        job = jobs.current()
        if job is not None:
            cls.poll_message_set(f"{job.label} is running: wait for it or cancel it")
            return False
        return poll_editable(cls, context)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Do the job while Blender waits, with the progress on the console."""
        manager = context.window_manager
        manager.progress_begin(0.0, 1.0)
        try:
            job = self.make_job(context, jobs.in_foreground, here)
            with Console(sys.stderr) as console:

                def show(progress: Progress) -> None:
                    console.show(progress)
                    manager.progress_update(progress.fraction)

                jobs.run_blocking(job, show)
        except IvgError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        finally:
            manager.progress_end()
        self.report({"INFO"}, str(job.message))
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Start the job in the window and go on by a timer."""
        if bpy.app.background or context.window is None:
            return self.execute(context)
        self._second = SecondBlender()
        try:
            self._job = self.make_job(context, jobs.in_background, self._second.ask)
        except IvgError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        jobs.start(self._job)
        manager = context.window_manager
        self._timer = manager.event_timer_add(TICK_SECONDS, window=context.window)
        manager.modal_handler_add(self)
        self._next_redraw = 0.0
        _show(self._job)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Go on at a timer's tick, stop at Esc, and leave other events to Blender."""
        job = self._job
        if event.type == "ESC" and event.value == "PRESS":
            job.cancel()
        elif event.type == "TIMER":
            job.advance(SLICE_SECONDS)
        if not job.running:
            return self._finish(context, job)
        if time.monotonic() >= self._next_redraw:
            self._next_redraw = time.monotonic() + REDRAW_SECONDS
            _show(job)
        return {"PASS_THROUGH"}

    def cancel(self, context: bpy.types.Context) -> None:
        """Stop, because Blender ends this operator: another file, a closed window."""
        self._job.cancel()
        self._leave(context)

    def _finish(self, context: bpy.types.Context, job: jobs.Job) -> set[str]:
        """Report how the job ended."""
        self._leave(context)
        error = job.error
        if error is None:
            self.show_result(context)
            self.report({"INFO"}, str(job.message))
            return {"FINISHED"}
        if isinstance(error, Cancelled):
            self.report({"WARNING"}, str(error))
        elif isinstance(error, IvgError):
            self.report({"ERROR"}, str(error))
        else:
            traceback.print_exception(error)
            self.report({"ERROR"}, f"{job.label} failed, see the console: {error!r}")
        return {"CANCELLED"}

    def _leave(self, context: bpy.types.Context) -> None:
        """Leave the window as it was."""
        self._second.end()
        context.window_manager.event_timer_remove(self._timer)
        _show(None)


def _show(job: jobs.Job | None) -> None:
    """Show a job in the status bar and the panels, or that there is none."""
    text = None
    if job is not None:
        progress = job.progress
        left = progress.seconds_left
        text = f"{job.label}: {progress.task}, {progress.fraction:.0%}" + (
            "" if left is None else f", {duration(left)} left"
        )
        text += "    Esc: cancel"
    for workspace in bpy.data.workspaces:
        workspace.status_text_set(text)
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()
