# SPDX-License-Identifier: GPL-3.0-or-later
"""Checking whether the scene's grid still is that of the scene, and whether its datablocks are intact."""

from __future__ import annotations

import bpy

from ..core.errors import GridFileError
from . import staleness, storage
from .asking import Asker, here
from .grid_image import scene_grid
from .jobs import Job, PatientSteps, Runner
from .scenes import find_scene


def check_job(context: bpy.types.Context, run: Runner, ask: Asker = here) -> Job:
    """Return the check of the context's scene; what it finds is then `staleness.freshness`.

    `run` drains the part that never touches Blender, `ask` says where Cycles is asked.

    Raises
    ------
    GridFileError
        The scene has no grid in the .blend, or one whose datablocks were changed.
    """
    image = scene_grid(context.scene)
    storage.load_grid(image)
    return Job(f"Checking '{image.name}'", _check_steps(context, run, ask))


def _check_steps(context: bpy.types.Context, run: Runner, ask: Asker) -> PatientSteps[str]:
    """Export the scene, compare its checksum with the grid's, and return the outcome in one line."""
    from .export import export_render_steps

    name, identity = context.scene.name, context.scene.session_uid
    scene = yield from export_render_steps(context.scene, context.view_layer, ask, run)
    kept_in = find_scene(name, identity, "checked")
    staleness.saw(kept_in, scene.fingerprint(), staleness.edits(kept_in))
    found = staleness.freshness(kept_in)
    if found is None:
        raise GridFileError(f"the grid of scene '{name}' was removed while it was checked: bake it, or choose another")
    return f"{kept_in.ivg.grid.name}: {found.value}"
