# SPDX-License-Identifier: GPL-3.0-or-later
"""What the second Blender does: read questions, answer them, until nobody is there to ask.

Run as a program it is told on its first line of input where this package is; every further line names a question in the
folder. It ends with its input, so it never outlives the Blender that started it.
"""

from __future__ import annotations

import importlib
import json
import os
import pickle
import queue
import re
import shutil
import sys
import threading
import traceback
import types
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

import bpy
import numpy as np

READY, PROGRESS, ANSWER, FAILURE = "ivg-ready", "ivg-progress", "ivg-answer", "ivg-failure"
"""How the lines begin that are sent back; JSON follows."""
WORKING_SPACE = "Linear Rec.709"
"""What the second Blender's colours are in."""
_SAMPLE = re.compile(r"(?:Rendered (\d+)/(\d+) Tiles, )?Sample (\d+)/(\d+)")


@dataclass(frozen=True)
class Question:
    """What is asked.

    Parameters
    ----------
    answer
        A function of a module of this package: of the datablocks, as `asking.Find`, of `arguments` and of `named`.
    holder
        The mesh in the file whose custom properties "0", "1", … are the datablocks.
    changed
        Images whose pixels lie beside the file, one file each in this order; their width, height, and whether they are
        floats.
    """

    answer: Callable[..., Any]
    arguments: tuple[Any, ...]
    named: dict[str, Any]
    holder: str
    changed: dict[str, tuple[int, int, bool]]


def main() -> None:
    """Answer questions until the input ends."""
    # What Blender prints goes with the errors: the output is ours alone.
    output = os.fdopen(os.dup(1), "w", buffering=1, encoding="utf-8")
    os.dup2(2, 1)
    with os.fdopen(os.dup(0), encoding="utf-8") as asker:
        greeting = json.loads(asker.readline())
        names: queue.SimpleQueue[str] = queue.SimpleQueue()
        threading.Thread(target=_listen, args=(asker, names, greeting["folder"]), daemon=True).start()
        _find_code(greeting)
        _send(output, READY, None)
        while True:
            path = Path(greeting["folder"], names.get())
            try:
                answered = _answer(path, greeting, output)
            except Exception:
                _send(output, FAILURE, traceback.format_exc())
            else:
                with path.with_suffix(".answer").open("wb") as file:
                    pickle.dump(answered, file, pickle.HIGHEST_PROTOCOL)
                _send(output, ANSWER, None)


def _listen(asker: TextIO, names: queue.SimpleQueue[str], folder: str) -> None:
    """Hand on the names of questions; when the input ends, clear up and end the process, whatever it does."""
    for line in asker:
        names.put(line.strip())
    shutil.rmtree(folder, ignore_errors=True)
    os._exit(0)


def _find_code(greeting: dict[str, Any]) -> None:
    """Make this package importable under the name that it has in the other Blender, so that pickles agree."""
    sys.path += [folder for folder in greeting["path"] if folder not in sys.path]
    parents = greeting["package"].split(".")[:-1]
    for count in range(1, len(parents) + 1):
        name = ".".join(parents[:count])
        if count == len(parents) or name not in sys.modules:
            sys.modules[name] = types.ModuleType(name)
            sys.modules[name].__path__ = []
    if parents:
        sys.modules[name].__path__ = [str(Path(greeting["code"]).parent)]
    else:
        sys.path.insert(0, str(Path(greeting["code"]).parent))


def _answer(path: Path, greeting: dict[str, Any], output: TextIO) -> Any:
    """Return the answer to a question, or the error of ours that it ends with."""
    errors = importlib.import_module(greeting["package"] + ".core.errors")
    progress = importlib.import_module(greeting["package"] + ".core.progress")
    with path.with_suffix(".question").open("rb") as file:
        # Under its own name, not as part of this program: see `_find_code`.
        question = pickle.load(file)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.data.scenes[0].name = "Nothing"  # so that what is read keeps its name
    # Objects have settings that are honoured here too.
    importlib.import_module(greeting["package"] + ".blender.properties").ensure_registered()
    _set_preferences(greeting)
    datablocks = _read(path, question)
    steps = question.answer(lambda: datablocks, *question.arguments, **question.named)
    try:
        with _samples_shown(output, progress.Progress("Asking Cycles", 0.0)) as show:
            while True:
                show(next(steps))
    except StopIteration as end:
        return end.value
    except errors.IvgError as error:
        return error


def _set_preferences(greeting: dict[str, Any]) -> None:
    """Set what of the preferences Cycles depends on."""
    preferences = bpy.context.preferences
    preferences.filepaths.use_scripts_auto_execute = greeting["scripts"]
    if greeting["compute"] != "NONE":
        devices = preferences.addons["cycles"].preferences
        devices.compute_device_type = greeting["compute"]
        devices.refresh_devices()
        for device in devices.devices:
            device.use = device.id in greeting["devices"]


def _read(path: Path, question: Question) -> list[bpy.types.ID]:
    """Read the datablocks of a question."""
    with bpy.data.libraries.load(str(path.with_suffix(".blend"))) as (_, wanted):
        wanted.meshes = [question.holder]
    (holder,) = wanted.meshes
    for number, (name, (width, height, is_float)) in enumerate(question.changed.items()):
        image = bpy.data.images[name]
        if image.packed_file is not None:
            image.unpack(method="REMOVE")
        image.source = "GENERATED"
        image.generated_width, image.generated_height, image.use_generated_float = width, height, is_float
        image.pixels.foreach_set(np.load(path.with_suffix(f".{number}.npy")))
    return [holder[str(index)] for index in range(len(holder.keys()))]


@contextmanager
def _samples_shown(output: TextIO, start: Any) -> Iterator[Callable[[Any], None]]:
    """Hand out what sends a progress; until the next one, samples of renders count as parts of the way there."""
    current, reached = start, 0.0

    def show(progress: Any) -> None:
        nonlocal current, reached
        current, reached = progress, progress.fraction
        _send(output, PROGRESS, [progress.task, progress.fraction, progress.seconds_left])

    def sampled(statistics: str, *_: object) -> None:
        nonlocal reached
        found = _SAMPLE.search(statistics)
        if found is not None and current.until is not None:
            tile, tiles, sample, samples = (
                int(number or default) for number, default in zip(found.groups(), "0111", strict=True)
            )
            share = (tile + sample / max(samples, 1)) / max(tiles, 1)
            reached = max(reached, current.fraction + share * (current.until - current.fraction))
            _send(output, PROGRESS, [current.task, reached, current.seconds_left])

    bpy.app.handlers.render_stats.append(sampled)
    try:
        yield show
    finally:
        bpy.app.handlers.render_stats.remove(sampled)


def _send(output: TextIO, kind: str, content: Any) -> None:
    output.write(f"{kind} {json.dumps(content)}\n")


if __name__ == "__main__":
    main()
