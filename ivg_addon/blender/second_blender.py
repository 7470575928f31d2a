# SPDX-License-Identifier: GPL-3.0-or-later
"""A second Blender without a window, in which Cycles is asked while the first one's window stays alive.

Cycles answers only when it is done, and until then the Blender that asked it waits: seconds for a world, or for a
comparison's picture. So a job that runs in the window writes the datablocks that a question is about to a file, and a
process of the same program reads them, runs the same function on them, and sends back what that returns. Esc kills the
process. Should Cycles crash, it does so there.

The file holds what saving and opening the scene would keep. Where that is not everything (`_lost`), or a second Blender
does not start, the question is answered in this Blender.
"""

from __future__ import annotations

import itertools
import json
import os
import pickle
import queue
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Concatenate

import bpy
import numpy as np

from ..core.errors import SceneError
from ..core.progress import Progress
from .asking import Arguments, Find, Result, here
from .jobs import PatientSteps, Steps, in_background
from .second_blender_main import ANSWER, FAILURE, PROGRESS, READY, WORKING_SPACE, Question

_PROGRAM = Path(__file__).with_name("second_blender_main.py")
_PACKAGE = __package__.rpartition(".")[0]
_NICENESS = 10
"""The window's Blender comes first where both want the same processors."""
_WINDOWS_FLAGS = getattr(subprocess, "CREATE_NO_WINDOW", 0) | getattr(subprocess, "BELOW_NORMAL_PRIORITY_CLASS", 0)
_LAST_WORDS = 300
"""Characters that are quoted of what a process said that ended by itself."""


class _NotStarted(Exception):
    """The second Blender has ended before it could read a question."""


class SecondBlender:
    """A second Blender: started with the first question, ended by `end`."""

    def __init__(self) -> None:
        self._process: _Process | None = None
        self._can_start = True
        self._numbers = itertools.count()

    def ask(
        self,
        answer: Callable[Concatenate[Find, Arguments], Steps[Result]],
        find: Find,
        *arguments: Arguments.args,
        **named: Arguments.kwargs,
    ) -> PatientSteps[Result]:
        """Answer a question: an `Asker`.

        Raises
        ------
        SceneError
            The second Blender ended before it had answered.
        """
        process = None if _lost(find()) else self._started()
        if process is None:
            return (yield from here(answer, find, *arguments, **named))
        try:
            path = process.folder / f"{next(self._numbers)}"
            # Before anything can change: what is asked is what the caller has seen.
            holder = _write_datablocks(path.with_suffix(".blend"), find())
            changed = _write_changed_images(path)
            yield from in_background(_pickled(path, Question(answer, arguments, named, holder, changed)))
            process.say(path.name)
            yield from process.listen()
            return (yield from in_background(_unpickled(path)))
        except _NotStarted:
            self.end()
            self._can_start = False
        except BaseException:
            self.end()
            raise
        return (yield from here(answer, find, *arguments, **named))

    def end(self) -> None:
        """End the process if there is one, whatever it does; returns at once."""
        if self._process is not None:
            self._process.end()
            self._process = None

    def _started(self) -> _Process | None:
        """Return the process, started if need be; None where no program can be started."""
        if self._process is None and self._can_start:
            try:
                self._process = _Process()
            except OSError:
                self._can_start = False
        return self._process


class _Process:
    """The process, and the folder in which questions and answers lie."""

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="ivg-"))
        self._messages: queue.SimpleQueue[tuple[str, Any] | None] = queue.SimpleQueue()
        self._ready = False
        try:
            with self._log.open("wb") as log:
                self._program = subprocess.Popen(
                    _command(),
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=log,
                    # Blender's own temporary files too go with the folder.
                    env=os.environ | dict.fromkeys(("TMPDIR", "TEMP", "TMP"), str(self.folder)),
                    creationflags=_WINDOWS_FLAGS,
                )
        except OSError:
            shutil.rmtree(self.folder, ignore_errors=True)
            raise
        if hasattr(os, "setpriority"):
            os.setpriority(os.PRIO_PROCESS, self._program.pid, _NICENESS)
        threading.Thread(target=self._receive, name="ivg-second-blender", daemon=True).start()
        self.say(json.dumps(_greeting(self.folder)))

    @property
    def _log(self) -> Path:
        return self.folder / "log"

    def say(self, line: str) -> None:
        """Send a line."""
        assert self._program.stdin is not None
        try:
            self._program.stdin.write(line.encode() + b"\n")
            self._program.stdin.flush()
        except OSError:
            pass  # it has ended: `listen` says so

    def listen(self) -> PatientSteps[None]:
        """Wait for the answer to the question that was sent."""
        while True:
            try:
                message = self._messages.get_nowait()
            except queue.Empty:
                yield None
                continue
            if message is None and not self._ready:
                raise _NotStarted
            if message is None:
                words = self._log.read_text(errors="replace").split("\n") if self._log.exists() else []
                last = next((line.strip() for line in reversed(words) if line.strip()), "it said nothing")
                raise SceneError(f"the Blender that asks Cycles ended by itself ({last[:_LAST_WORDS]}): try again")
            kind, content = message
            if kind == READY:
                self._ready = True
            elif kind == PROGRESS:
                yield Progress(*content)
            elif kind == FAILURE:
                raise RuntimeError(f"in the Blender that asks Cycles:\n{content}")
            elif kind == ANSWER:
                return

    def end(self) -> None:
        """Kill it; a thread waits until it is gone, and removes the folder then."""
        self._program.kill()
        threading.Thread(target=self._clear, name="ivg-second-blender-end").start()

    def _receive(self) -> None:
        """Hand on what it says, and None once it has ended."""
        assert self._program.stdout is not None
        for line in self._program.stdout:
            kind, _, content = line.decode(errors="replace").partition(" ")
            if kind in {READY, PROGRESS, ANSWER, FAILURE}:
                self._messages.put((kind, json.loads(content)))
        self._messages.put(None)

    def _clear(self) -> None:
        self._program.wait()
        for stream in (self._program.stdin, self._program.stdout):
            if stream is not None:
                stream.close()
        shutil.rmtree(self.folder, ignore_errors=True)


def _command() -> list[str]:
    """Return what starts this program once more; where Blender is a module, Python with it."""
    if not bpy.app.binary_path:
        return [sys.executable, "-P", str(_PROGRAM)]
    options = ["--background", "--factory-startup", "--offline-mode", "-noaudio", "--python-exit-code", "1"]
    return [bpy.app.binary_path, *options, "--python", str(_PROGRAM)]


def _greeting(folder: Path) -> dict[str, Any]:
    """Return what it needs to know: where our code is, and what of the preferences Cycles depends on."""
    preferences = bpy.context.preferences
    cycles = preferences.addons.get("cycles")
    devices = cycles.preferences if cycles is not None else None
    return {
        "folder": str(folder),
        "package": _PACKAGE,
        "code": str(Path(__file__).parents[1]),
        "path": sys.path,
        # Drivers that Blender has refused here are refused there.
        "scripts": not bpy.app.autoexec_fail,
        "compute": devices.compute_device_type if devices else "NONE",
        "devices": [device.id for device in devices.devices if device.use] if devices else [],
    }


def _lost(datablocks: Sequence[bpy.types.ID]) -> bool:
    """Tell whether a file would not keep all that the answer depends on."""
    if bpy.data.colorspace.working_space != WORKING_SPACE:
        return True
    if not any(isinstance(one, bpy.types.Scene) for one in datablocks):
        return False
    return any(scene.rigidbody_world is not None for scene in bpy.data.scenes) or any(
        node.bl_idname == "GeometryNodeSimulationInput" for group in bpy.data.node_groups for node in group.nodes
    )


def _write_datablocks(path: Path, datablocks: Sequence[bpy.types.ID]) -> str:
    """Write datablocks and all that they use to a file; return the name of the one that refers to them."""
    for shown in bpy.data.objects:
        if shown.mode == "EDIT":
            shown.update_from_editmode()
    holder = bpy.data.meshes.new("IVG question")
    try:
        # What is linked from another file is written only as a link that something refers to.
        for index, one in enumerate(datablocks):
            holder[str(index)] = one
        bpy.data.libraries.write(str(path), {holder}, path_remap="ABSOLUTE")
        return str(holder.name)
    finally:
        bpy.data.meshes.remove(holder)


def _write_changed_images(path: Path) -> dict[str, tuple[int, int, bool]]:
    """Write the pixels that Cycles would take from memory and that the file does not have.

    Returns
    -------
    dict
        Names of the images, with their width, their height and whether they hold floats.
    """
    names = [image.name for image in bpy.data.images if _is_changed(image)]
    found: dict[str, tuple[int, int, bool]] = {}
    if names:
        with bpy.data.libraries.load(str(path.with_suffix(".blend"))) as (written, _):
            names = [name for name in names if name in written.images]
    for name in names:
        image = bpy.data.images[name]
        width, height = image.size
        pixels = np.empty(4 * width * height, dtype=np.float32)
        image.pixels.foreach_get(pixels)
        np.save(path.with_suffix(f".{len(found)}.npy"), pixels)
        found[name] = (width, height, image.is_float)
    return found


def _is_changed(image: bpy.types.Image) -> bool:
    """Tell whether an image has pixels in memory alone that Cycles reads; of a file of its own it reads the file."""
    in_blend = image.source == "GENERATED" or image.packed_file is not None
    return bool(image.library is None and image.is_dirty and image.has_data and in_blend)


def _pickled(path: Path, question: Question) -> Steps[None]:
    """Write a question; touches nothing of Blender."""
    yield Progress("Starting a second Blender for Cycles", 0.0)
    with path.with_suffix(".question").open("wb") as file:
        pickle.dump(question, file, pickle.HIGHEST_PROTOCOL)


def _unpickled(path: Path) -> Steps[Any]:
    """Read an answer and return it, or raise it; touches nothing of Blender."""
    yield Progress("Receiving the answer of Cycles", 1.0)
    with path.with_suffix(".answer").open("rb") as file:
        answer = pickle.load(file)
    for leftover in path.parent.glob(f"{path.name}.*"):
        leftover.unlink()
    if isinstance(answer, BaseException):
        raise answer
    return answer
