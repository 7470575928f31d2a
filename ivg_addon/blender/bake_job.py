# SPDX-License-Identifier: GPL-3.0-or-later
"""From a Blender scene to its grid file: export, bake, write, remember.

The scene is read on the main thread; baking and writing go where the runner says. The new file
takes the place of the old one at the very end, together with the summary, so a bake that fails or
is cancelled changes nothing.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import bpy

from ..core.errors import GridFileError, SceneError
from ..core.progress import Progress, part
from ..core.report import headline
from . import outcome
from .asking import Asker, here
from .bake_request import BakeRequest, Overrides, read_request
from .grid_store import compiled_code_folder, keep_compiled_code
from .jobs import Job, PatientSteps, Runner, Steps
from .summary import bake_rows, count, duration, voxels

if TYPE_CHECKING:
    from ..core.bake import BakeResult
    from ..core.scene import Scene
    from ..core.settings import BakeSettings

EXPORT_SHARE = 0.05
"""Of a bake's progress; the rest is the photons'."""


def bake_job(context: bpy.types.Context, overrides: Overrides, run: Runner, ask: Asker = here) -> Job:
    """Return the bake of the context's scene; raises what can be known before it starts.

    Parameters
    ----------
    overrides
        What to use in place of the scene's settings, by name.
    run
        How the part that never touches Blender is drained.
    ask
        Where Cycles is asked.

    Raises
    ------
    GridFileError
        The grid cannot be written where it should go.
    SettingsError
        A setting is out of range, or the object that bounds the grid is missing.
    """
    from ..core.grid_file import check_writable

    request = read_request(context, overrides)
    check_writable(request.output)
    return Job(f"Baking '{context.scene.name}'", _bake_steps(context, request, run, ask))


def _bake_steps(context: bpy.types.Context, request: BakeRequest, run: Runner, ask: Asker) -> PatientSteps[str]:
    """Bake and return what was done, in one line."""
    start = time.perf_counter()
    name, identity, layer = context.scene.name, context.scene.session_uid, context.view_layer.name
    yield from run(_load(compiled_code_folder()))
    from ..core.memory import peak
    from .export import export_render_steps

    # One step of the export reads Blender's data, others ask Cycles for materials. Between any two the user may change
    # them: all is found again each time.
    reading = _find_scene(name, identity)
    exporting = export_render_steps(reading, reading.view_layers[layer], ask, run)
    scene = yield from part(exporting, 0.0, EXPORT_SHARE)
    settings = request.settings_for(scene)
    with _beside(request.output) as fresh:
        baking = _bake_and_write(scene, settings, fresh)
        result = yield from part(run(baking), EXPORT_SHARE, 1.0)
        kept_in = _find_scene(name, identity)
        _replace(fresh, request.output)
    seconds = time.perf_counter() - start
    rows = bake_rows(result, scene.surfaces, seconds, peak())
    outcome.store(kept_in.ivg.last_bake, request.output, rows, result.notices)
    outcome.forget(kept_in.ivg.last_compare)
    noted = headline(result.notices)
    return (
        f"Baked {voxels(settings.resolution)} voxels from {count(settings.photons)} photons "
        f"in {duration(seconds)}" + (f"; {noted}" if noted else "")
    )


def _load(compiled_code: Path | None) -> Steps[None]:
    """Import what compiles: it takes a second. Touches nothing of Blender."""
    yield Progress("Loading Numba and Embree", 0.0)
    keep_compiled_code(compiled_code)
    from ..core import bake, doubled_faces, instancing  # noqa: F401


def _bake_and_write(scene: Scene, settings: BakeSettings, path: Path) -> Steps[BakeResult]:
    """Bake and write the grid to `path`; touches nothing of Blender, so any thread will do."""
    from ..core.bake import bake_steps

    result = yield from bake_steps(scene, settings)
    yield Progress("Writing the grid", 1.0)
    result.grid.save(path)
    try:
        yield Progress("Writing the grid", 1.0)
    except GeneratorExit:
        path.unlink()  # cancelled while the file was written
        raise
    return result


@contextmanager
def _beside(output: Path) -> Iterator[Path]:
    """Give a path beside `output` for the new file; what is left there at the end is removed."""
    fresh = output.with_name(f".{output.name}.{os.getpid()}.new")
    try:
        yield fresh
    finally:
        fresh.unlink(missing_ok=True)


def _replace(fresh: Path, output: Path) -> None:
    """Put the new file in the old one's place; raises `GridFileError`."""
    try:
        fresh.replace(output)
    except OSError as error:
        raise GridFileError(
            f"cannot replace {output} ({error.strerror}): close what uses it, or choose another "
            "file; the previous grid is unchanged"
        ) from error


def _find_scene(name: str, identity: int) -> bpy.types.Scene:
    """Return the scene that was baked, which undo may have moved in memory."""
    for scene in bpy.data.scenes:
        if scene.session_uid == identity:
            return scene
    raise SceneError(f"scene '{name}' was removed while it was baked: nothing was saved")
