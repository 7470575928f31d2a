# SPDX-License-Identifier: GPL-3.0-or-later
"""Enabling adds what it should, disabling takes all of it away."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import bpy
import pytest

ROOT = Path(__file__).resolve().parents[2]
OPERATORS = {
    *("bake", "bounds_add", "cancel", "check", "clear", "compare", "copy_summary", "dismiss_error"),
    *("export_vdb", "grid_remove", "inspection_mesh", "restore"),
}
HANDLERS = (
    *("load_pre", "load_post", "undo_pre", "undo_post", "redo_pre", "redo_post"),
    *("depsgraph_update_post", "frame_change_post"),
)


def traces() -> dict[str, object]:
    """Return everything in Blender that an extension may leave behind."""
    return {
        "operators": sorted(name for name in dir(bpy.ops.ivg)),
        "classes": sorted(name for name in dir(bpy.types) if name.startswith(("IVG", "Ivg"))),
        "scene": hasattr(bpy.types.Scene, "ivg"),
        "menu": len(bpy.types.TOPBAR_MT_render.draw._draw_funcs),
        "handlers": {name: len(getattr(bpy.app.handlers, name)) for name in HANDLERS},
    }


@pytest.fixture
def again(extension: str) -> Iterator[None]:
    """Leave the extension enabled for the other tests."""
    yield
    if extension not in bpy.context.preferences.addons:
        bpy.ops.preferences.addon_enable(module=extension)


@pytest.mark.usefixtures("again")
def test_enable_and_disable_twice_leaves_nothing(extension: str) -> None:
    enabled = traces()
    assert OPERATORS <= set(enabled["operators"])  # type: ignore[call-overload]
    assert enabled["scene"]
    bpy.ops.preferences.addon_disable(module=extension)
    disabled = traces()
    assert (disabled["operators"], disabled["classes"], disabled["scene"]) == ([], [], False)
    bpy.ops.preferences.addon_enable(module=extension)
    assert traces() == enabled
    bpy.ops.preferences.addon_disable(module=extension)
    assert traces() == disabled


def test_every_operator_has_a_label_and_a_tooltip(extension: str) -> None:
    for name in OPERATORS:
        described = getattr(bpy.ops.ivg, name).get_rna_type()
        assert described.name
        assert described.description
        assert not described.description.endswith("."), name


def test_enabling_loads_nothing_that_may_fail_or_takes_long(tmp_path: Path) -> None:
    """The bundled libraries wait until they are needed: Blender starts no slower for this extension."""
    (tmp_path / "irradiance_vector_grid").symlink_to(ROOT, target_is_directory=True)
    code = (
        "import sys, bpy, irradiance_vector_grid as extension\n"
        "extension.register(); extension.unregister()\n"
        "print(sorted({'embreex', 'llvmlite', 'numba', 'OpenEXR', 'psutil'} & set(sys.modules)))"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True, timeout=60
    )
    assert result.stdout.splitlines()[-1] == "[]"
