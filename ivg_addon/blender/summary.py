# SPDX-License-Identifier: GPL-3.0-or-later
"""What a bake did, in words: the same lines for the panel, the console and the command line."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime
from typing import TYPE_CHECKING

import numpy as np

from ..core.false_color import luminance
from ..core.grid import grid_bytes
from ..core.report import Notice

if TYPE_CHECKING:
    from ..core.aim import Aim
    from ..core.bake import BakeResult, BakeStatistics
    from ..core.grid import BakeRecord, IrradianceVectorGrid
    from ..core.scene import SurfaceRecord

Row = tuple[str, str]
"""A label and a value."""


def count(number: float) -> str:
    """Return a count for people: ``8.0 million``, ``1.5 billion``, ``20,000``."""
    for size, word in ((1e9, "billion"), (1e6, "million")):
        if number >= size:
            return f"{number / size:.1f} {word}"
    return f"{number:,.0f}"


def duration(seconds: float) -> str:
    """Return a time span for people: ``0.8 s``, ``42 s``, ``3 min 20 s``, ``2 h 5 min``."""
    if seconds < 9.95:
        return f"{seconds:.1f} s"
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


def memory(size: float) -> str:
    """Return a size in bytes for people: ``2.0 MiB``."""
    if size < 1 << 20:
        return f"{size / (1 << 10):.1f} KiB"
    if size < 1 << 30:
        return f"{size / (1 << 20):.1f} MiB"
    return f"{size / (1 << 30):.1f} GiB"


def voxels(resolution: Iterable[int]) -> str:
    """Return ``20 × 22 × 20``."""
    return " × ".join(str(number) for number in resolution)


def box(low: Iterable[float], high: Iterable[float]) -> str:
    """Return two corners in metres: ``(0, 0, 0) to (2, 2, 2) m``."""
    corners = (", ".join(f"{value:.4g}" for value in corner) for corner in (low, high))
    return "({}) to ({}) m".format(*corners)


def created(record: BakeRecord) -> str:
    """Return when, in local time, and by which version a grid was baked."""
    when = datetime.fromisoformat(record.created).astimezone()
    return f"{when:%Y-%m-%d %H:%M}, version {record.version}"


def grid_rows(grid: IrradianceVectorGrid) -> list[Row]:
    """Return what a grid is: its voxels, its box, and what it was baked with."""
    record = grid.record
    settings = record.settings
    return [
        ("Baked", created(record)),
        ("Scene", record.scene),
        ("Grid", f"{voxels(grid.resolution)} voxels, {memory(grid_bytes(grid.resolution))}"),
        ("Box", box(grid.bounds_min, grid.bounds_max)),
        ("Lit", f"{np.mean(grid.validity > 0):.1%} of the vertices"),
        (
            "Settings",
            f"{count(settings.photons)} photons, {settings.bounces} bounces, "
            f"{settings.estimator.replace('_', ' ').lower()}, seed {settings.seed}"
            + (", direct light included" if settings.include_direct else ""),
        ),
    ]


def bake_rows(result: BakeResult, surfaces: SurfaceRecord, seconds: float, peak_bytes: int) -> list[Row]:
    """Return what a bake did: the grid, materials, the photons, where the light went, time and memory.

    Parameters
    ----------
    surfaces
        Where the materials came from.
    seconds
        Wall-clock time of all of it, the export included.
    peak_bytes
        The most memory that the whole program has held.
    """
    done = result.statistics
    return [
        *grid_rows(result.grid),
        ("Materials", _where_from(surfaces)),
        *([("World", _what_it_took(surfaces.world_seconds))] if surfaces.world_seconds is not None else []),
        (
            "Photons",
            f"{count(done.photons_per_second)} a second, {done.rays / max(done.photons, 1):.2f} flights each",
        ),
        ("Light", _where_it_went(done)),
        *([("Sky", _what_was_of_use(done.aim))] if done.aim is not None else []),
        (
            "Time",
            f"{duration(seconds)} on {done.threads} thread{'s' if done.threads > 1 else ''}: "
            f"photons {duration(done.photon_seconds)}, lit volume {duration(done.lit_seconds)}",
        ),
        ("Memory", f"{memory(done.grid_bytes)} for the grid, {memory(peak_bytes)} at most for all of Blender"),
    ]


def _where_from(surfaces: SurfaceRecord) -> str:
    """Return how many materials were read, how many evaluated, and what that took."""
    parts = [f"{surfaces.direct} read directly"]
    if surfaces.evaluated:
        parts.append(f"{surfaces.evaluated} evaluated by Cycles in {duration(surfaces.seconds)}")
    if surfaces.recalled:
        parts.append(f"{surfaces.recalled} evaluated before")
    return ", ".join(parts)


def _what_it_took(seconds: float) -> str:
    """Return what evaluating the world took."""
    return f"evaluated by Cycles in {duration(seconds)}" if seconds > 0.0 else "evaluated by Cycles before"


def _where_it_went(statistics: BakeStatistics) -> str:
    """Return the lights' power and where it went, weighted by luminance."""
    ends = {
        "absorbed": luminance(statistics.absorbed),
        "escaped": luminance(statistics.escaped),
        "cut after the last bounce": luminance(statistics.cut),
    }
    total = sum(ends.values()) or 1.0
    shares = (f"{watts / total:.1%} {end}" for end, watts in ends.items())
    return f"{luminance(statistics.emitted):.4g} W emitted: {', '.join(shares)}"


def _what_was_of_use(aim: Aim) -> str:
    """Return how many photons of suns, world and environment reached the grid."""
    text = f"{aim.useful:.1%} of the photons of sun and sky reach the grid"
    return text if aim.gain == 1.0 else f"{text}, {aim.useful_without:.2%} would without aim"


def table(rows: Iterable[Row], notices: Iterable[Notice] = ()) -> str:
    """Return rows and notices as lines of text."""
    lines = [f"{label + ':':<11}{value}" for label, value in rows]
    return "\n".join([*lines, *(str(notice) for notice in notices)])
