# SPDX-License-Identifier: GPL-3.0-or-later
"""From a baked grid to a picture beside Cycles' own, or to numbers at random points."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from ..core.progress import Progress
from . import outcome
from .asking import Asker, here
from .grid_image import scene_grid
from .grid_store import SUFFIX, compiled_code_folder, keep_compiled_code
from .jobs import Job, PatientSteps, Runner, Steps
from .storage import load_grid
from .summary import Row

if TYPE_CHECKING:
    from ..core.grid import IrradianceVectorGrid

DEFAULT_POINT_SAMPLES = 1024


@dataclass(frozen=True)
class CompareRequest:
    """A comparison as asked for.

    Parameters
    ----------
    grid
        The grid's file; None: the grid that the .blend keeps for the scene.
    output
        The picture to write.
    points
        Compare at so many random points of either kind instead, and write nothing.
    samples
        Cycles' paths per pixel or point; None: as the scene has it, or enough for points.
    look_up
        Settings of the look-up in place of the scene's, by name.
    """

    grid: Path | None
    output: Path
    points: int | None = None
    samples: int | None = None
    look_up: Mapping[str, Any] | None = None


def picture_of(grid: Path) -> Path:
    """Return where the picture of a grid's comparison goes unless the user says otherwise."""
    return grid.with_name(grid.name.removesuffix(SUFFIX) + ".compare.png")


def compare_job(context: bpy.types.Context, request: CompareRequest, run: Runner, ask: Asker = here) -> Job:
    """Return the comparison of the context's scene with a grid.

    `run` drains the part that never touches Blender, `ask` says where Cycles is asked. The numbers are then in
    `scene.ivg.last_compare`. Raises `GridFileError` or `SettingsError` if the picture cannot be written where it should
    go, or the .blend's grid is not as it was stored; `DependencyError` if a library is missing.
    """
    from .montage import check_picture

    if request.points is None:
        check_picture(request.output)
    grid = load_grid(scene_grid(context.scene)) if request.grid is None else request.grid
    label = f"Comparing '{context.scene.name}'"
    return Job(label, _compare_steps(context, request, grid, run, ask), holds_data=True)


def _compare_steps(
    context: bpy.types.Context, request: CompareRequest, source: IrradianceVectorGrid | Path, run: Runner, ask: Asker
) -> PatientSteps[str]:
    """Compare and return the outcome in one line."""
    scene, view_layer = context.scene, context.view_layer
    grid = yield from run(_load(source, compiled_code_folder()))
    from ..core.picture import LookUp
    from .compare import compare_steps
    from .compare_points import compare_points_steps

    chosen = {name: getattr(scene.ivg, name) for name in ("spatial", "directional", "normal_bias")}
    look_up = LookUp(**chosen | dict(request.look_up or {}))
    rows: list[Row]
    if request.points is None:
        seen = yield from compare_steps(
            scene, view_layer, grid, request.output, look_up, samples=request.samples, run=run, ask=ask
        )
        rows, notices, path = seen.rows(), seen.notices, request.output
    else:
        samples = request.samples or DEFAULT_POINT_SAMPLES
        found = yield from compare_points_steps(
            scene, view_layer, grid, request.points, look_up, samples=samples, run=run, ask=ask
        )
        rows, notices, path = found.rows(), found.notices, None
    # The outcome keeps the picture's path by itself.
    rows = [row for row in rows if row[0] != "Picture"]
    outcome.store(scene.ivg.last_compare, path, rows, notices)
    told = ("Error", "Energy", "Free", "Surfaces")
    numbers = (f"{label.lower()} {value}" for label, value in rows if label in told)
    return f"Compared with Cycles: {'; '.join(numbers)}"


def _load(source: IrradianceVectorGrid | Path, compiled_code: Path | None) -> Steps[IrradianceVectorGrid]:
    """Load a grid if it is a file, and everything that compiles; touches nothing of Blender."""
    yield Progress("Loading the grid", 0.0)
    keep_compiled_code(compiled_code)
    from ..core import IrradianceVectorGrid, doubled_faces, instancing, picture  # noqa: F401 (Numba: a second)

    return IrradianceVectorGrid.load(source) if isinstance(source, Path) else source
