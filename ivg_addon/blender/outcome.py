# SPDX-License-Identifier: GPL-3.0-or-later
"""What the last bake and the last comparison did, kept in the .blend on `scene.ivg`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import bpy

from ..core.errors import GridFileError
from ..core.report import Notice
from .grid_store import absolute
from .summary import Row, table


def store(outcome: Any, path: Path | None, rows: Iterable[Row], notices: Iterable[Notice]) -> None:
    """Replace what is kept.

    Parameters
    ----------
    outcome
        `scene.ivg.last_bake` or `scene.ivg.last_compare`.
    path
        The file that was written, if any.
    """
    forget(outcome)
    if path is not None:
        outcome.filepath = near(path, Path(bpy.data.filepath))
    for label, value in rows:
        row = outcome.rows.add()
        row.name = label
        row.value = value
    for notice in notices:
        line = outcome.notices.add()
        line.name = str(notice)
        line.kind = notice.kind
        line.subject = notice.subject
        line.message = notice.message


def forget(outcome: Any) -> None:
    """Keep nothing; the file stays where it is."""
    outcome.filepath = ""
    outcome.rows.clear()
    outcome.notices.clear()
    outcome.active_notice = 0


def text(outcome: Any) -> str:
    """Return what is kept as lines of text."""
    rows = [(row.name, row.value) for row in outcome.rows]
    if outcome.filepath:
        rows.insert(0, ("File", str(absolute(outcome.filepath))))
    return table(rows, (Notice(line.kind, line.subject, line.message) for line in outcome.notices))


def grid_file(scene: bpy.types.Scene) -> Path:
    """Return where the last bake's grid is; raises `GridFileError` if there was none."""
    filepath = scene.ivg.last_bake.filepath
    if not filepath:
        raise GridFileError(f"scene '{scene.name}' has no grid yet: bake it first")
    return absolute(filepath)


def near(path: Path, blend: Path) -> str:
    """Return a path as a .blend keeps it: relative to it ("//…") if in its folder or below.

    Then they can move together. `blend` is empty for a .blend that was never saved.
    """
    folder = blend.parent
    if blend.name and path.is_relative_to(folder):
        return f"//{path.relative_to(folder).as_posix()}"
    return str(path)
