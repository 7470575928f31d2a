# SPDX-License-Identifier: GPL-3.0-or-later
"""From a Blender scene to its grid: export, bake, write, store in the .blend, remember.

The scene is read on the main thread; baking and writing go where the runner says. The new files
take the place of the old ones at the very end, together with datablocks and summary, so a bake
that fails or is cancelled changes nothing.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import bpy

from ..core import vdb_grid
from ..core.errors import GridFileError, SettingsError
from ..core.progress import Progress, part
from ..core.report import Notice, headline
from ..core.settings import Spatial
from . import grid_image, outcome, staleness, storage
from .asking import Asker, here
from .bake_request import BakeRequest, Overrides, read_request
from .grid_store import compiled_code_folder, keep_compiled_code
from .grid_volume import volume_path
from .jobs import Job, PatientSteps, Runner, Steps
from .scene_light import stays_old
from .scenes import find_scene
from .summary import bake_rows, count, duration, voxels

if TYPE_CHECKING:
    from ..core.bake import BakeResult
    from ..core.grid import IrradianceVectorGrid
    from ..core.scene import Scene
    from ..core.settings import BakeSettings

EXPORT_SHARE = 0.05
"""Of a bake's progress; the rest is the photons'."""


def bake_job(
    context: bpy.types.Context, overrides: Overrides, run: Runner, ask: Asker = here, store: bool = True
) -> Job:
    """Return the bake of the context's scene; raises what can be known before it starts.

    Parameters
    ----------
    overrides
        What to use in place of the scene's settings, by name.
    run
        How the part that never touches Blender is drained.
    ask
        Where Cycles is asked.
    store
        Whether to keep the grid in the .blend, too; False where nobody will save it.

    Raises
    ------
    GridFileError
        The grid cannot be written where it should go, or a newer version stored the one that it would replace.
    SettingsError
        A setting is out of range, or the object that bounds the grid is missing.
    """
    from ..core.whole_file import check_writable

    request = read_request(context, overrides)
    check_writable(request.output)
    return Job(f"Baking '{context.scene.name}'", _bake_steps(context, request, run, ask, store))


def _bake_steps(
    context: bpy.types.Context, request: BakeRequest, run: Runner, ask: Asker, store: bool
) -> PatientSteps[str]:
    """Bake and return what was done, in one line."""
    start = time.perf_counter()
    name, identity, layer = context.scene.name, context.scene.session_uid, context.view_layer.name
    yield from run(_load(compiled_code_folder()))
    from ..core.memory import peak
    from .export import export_render_steps

    # One step of the export reads Blender's data, others ask Cycles for materials. Between any two the user may change
    # them: all is found again each time.
    reading = find_scene(name, identity, "baked")
    exporting = export_render_steps(reading, reading.view_layers[layer], ask, run)
    scene = yield from part(exporting, 0.0, EXPORT_SHARE)
    kept_in = find_scene(name, identity, "baked")
    edits, spatial = staleness.edits(kept_in), Spatial(kept_in.ivg.spatial)
    settings = request.settings_for(scene)
    with _beside(request.output, ".new") as fresh, _beside(request.output, ".new.vdb") as fresh_volume:
        written = fresh, fresh_volume if store else None
        baking = _bake_and_write(scene, settings, spatial, *written)
        result, stored = yield from part(run(baking), EXPORT_SHARE, 1.0)
        kept_in = find_scene(name, identity, "baked")
        volume_file = volume_path(request.output)
        if isinstance(stored, grid_image.PreparedImage):
            _replace(fresh_volume, volume_file)
        _replace(fresh, request.output)
    notices = result.notices
    if isinstance(stored, Notice):
        notices = (*notices, stored)
    elif stored is not None:
        with staleness.no_change_of_light(kept_in):
            image = storage.store(kept_in, request.grid, stored, volume_file)
        notices = (*notices, *stays_old(image))
    staleness.saw(kept_in, result.grid.record.checksum, edits)
    seconds = time.perf_counter() - start
    rows = bake_rows(result, scene.surfaces, seconds, peak())
    outcome.store(kept_in.ivg.last_bake, request.output, rows, notices)
    outcome.forget(kept_in.ivg.last_compare)
    noted = headline(notices)
    return (
        f"Baked {voxels(settings.resolution)} voxels from {count(settings.photons)} photons "
        f"in {duration(seconds)}" + (f"; {noted}" if noted else "")
    )


def _load(compiled_code: Path | None) -> Steps[None]:
    """Import what compiles: it takes a second. Touches nothing of Blender."""
    yield Progress("Loading Numba and Embree", 0.0)
    keep_compiled_code(compiled_code)
    from ..core import bake, doubled_faces, instancing  # noqa: F401


def _bake_and_write(
    scene: Scene, settings: BakeSettings, spatial: Spatial, path: Path, volume_path: Path | None
) -> Steps[tuple[BakeResult, grid_image.PreparedImage | Notice | None]]:
    """Bake, write the grid and its volume, prepare its image for an interpolation; any thread will do.

    In place of an image too large for Blender there is a notice that says so; without a volume there is none.
    """
    from ..core.bake import bake_steps

    result = yield from bake_steps(scene, settings)
    yield Progress("Writing the grid", 1.0)
    stored = None
    try:
        result.grid.save(path)
        if volume_path is not None:
            stored = _prepare(result.grid, spatial)
            vdb_grid.save(result.grid, volume_path, Spatial.TRILINEAR)
        yield Progress("Writing the grid", 1.0)
    except GeneratorExit:
        # Cancelled while the files were written.
        path.unlink()
        if volume_path is not None:
            volume_path.unlink()
        raise
    return result, stored


def _prepare(grid: IrradianceVectorGrid, spatial: Spatial) -> grid_image.PreparedImage | Notice:
    """Return what the image of a grid is made of, or why there can be none."""
    try:
        return grid_image.prepare(grid, spatial)
    except SettingsError as error:
        told = f"its grid is in its file, not in the .blend: {error}"
        return Notice("left out", f"scene '{grid.record.scene}'", told)


@contextmanager
def _beside(output: Path, suffix: str) -> Iterator[Path]:
    """Give a path beside `output` for the new file; what is left there at the end is removed."""
    fresh = output.with_name(f".{output.name}.{os.getpid()}{suffix}")
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
