# SPDX-License-Identifier: GPL-3.0-or-later
"""What this package adds to Blender, and takes away again without a trace."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack

import bpy

from . import (
    bounds_overlay,
    bounds_preview,
    grid_panel,
    grid_volume,
    inspection_overlay,
    inspection_panel,
    jobs,
    materials_panel,
    modifier_panel,
    object_panel,
    panels,
    properties,
    staleness,
)

_PANELS = (grid_panel, materials_panel, inspection_panel, modifier_panel, panels, object_panel)
_undo = ExitStack()
"""What `unregister` does, the last first."""


def register() -> None:
    """Add properties, panels, handlers and the command line; all of them or none."""
    with ExitStack() as done:
        properties.register()
        done.callback(properties.unregister)
        # Panels stand in the order in which they are registered.
        for cls in (panels.IVG_PT_main, *(each for part in _PANELS for each in part.CLASSES)):
            bpy.utils.register_class(cls)
            done.callback(bpy.utils.unregister_class, cls)
        bpy.types.TOPBAR_MT_render.append(panels.draw_menu)
        done.callback(bpy.types.TOPBAR_MT_render.remove, panels.draw_menu)
        bounds_preview.register()
        done.callback(bounds_preview.unregister)
        bounds_overlay.register()
        done.callback(bounds_overlay.unregister)
        inspection_overlay.register()
        done.callback(inspection_overlay.unregister)
        for name, handler in _HANDLERS.items():
            handlers = getattr(bpy.app.handlers, name)
            handlers.append(handler)
            done.callback(handlers.remove, handler)
        handle = bpy.utils.register_cli_command("ivg", _command_line)
        done.callback(bpy.utils.unregister_cli_command, handle)
        _undo.push(done.pop_all())


def unregister() -> None:
    """Take everything away that `register` added, also when a part of that fails."""
    _undo.close()


def stop_jobs() -> None:
    """Cancel what runs: Blender closes, or the extension is disabled."""
    jobs.cancel_current()


def _command_line(arguments: Sequence[str]) -> int:
    """Run `blender --command ivg …`."""
    from .command_line import main

    return main(arguments, "blender --command ivg")


@bpy.app.handlers.persistent
def _before_load(*_: object) -> None:
    """Another file comes: nothing that is under way belongs to it."""
    jobs.cancel_current()
    jobs.forget_error()
    inspection_overlay.forget()


@bpy.app.handlers.persistent
def _before_undo(*_: object) -> None:
    """Undo replaces all data in memory."""
    job = jobs.current()
    if job is not None and job.holds_data:
        job.cancel()


_HANDLERS = {
    "load_pre": _before_load,
    "undo_pre": _before_undo,
    "redo_pre": _before_undo,
    "depsgraph_update_post": staleness.watch,
    "save_post": grid_volume.remove_superseded,
}
