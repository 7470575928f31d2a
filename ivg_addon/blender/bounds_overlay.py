# SPDX-License-Identifier: GPL-3.0-or-later
"""The grid's box, drawn in the viewports: its edges, and faint ticks where the voxels meet them."""

from __future__ import annotations

import functools
import itertools
from typing import Any

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from numpy.typing import NDArray

from .bounds import Box, Resolution
from .bounds_preview import preview
from .viewport_overlay import ViewportOverlay

Float32 = NDArray[np.float32]

COLOR = (1.0, 0.62, 0.15)
EDGE_ALPHA = 0.9
TICK_ALPHA = 0.35
EDGE_WIDTH = 1.5
TICK_WIDTH = 1.0
TICK_LENGTH = 0.5
"""In voxels."""


def edge_lines(box: Box) -> Float32:
    """Return the box's twelve edges as pairs of points, (24, 3)."""
    low, high = np.array(box.low), np.array(box.high)
    lines = []
    for axis in range(3):
        others = [other for other in range(3) if other != axis]
        for sides in itertools.product((0, 1), repeat=2):
            start = low.copy()
            start[others] = np.where(sides, high[others], low[others])
            end = start.copy()
            end[axis] = high[axis]
            lines += [start, end]
    return np.array(lines, dtype=np.float32)


def tick_lines(box: Box, resolution: Resolution) -> Float32:
    """Return ticks on the edges, one at every grid vertex, along the two adjoining faces.

    Pairs of points, (n, 3).
    """
    low, high = np.array(box.low), np.array(box.high)
    voxel = (high - low) / resolution
    lines = []
    for axis in range(3):
        places = low[axis] + voxel[axis] * np.arange(1, resolution[axis])
        others = [other for other in range(3) if other != axis]
        for sides in itertools.product((0, 1), repeat=2):
            corner = low.copy()
            corner[others] = np.where(sides, high[others], low[others])
            for other, side in zip(others, sides, strict=True):
                starts = np.tile(corner, (len(places), 1))
                starts[:, axis] = places
                ends = starts.copy()
                ends[:, other] += TICK_LENGTH * voxel[other] * (-1 if side else 1)
                lines.append(np.stack([starts, ends], axis=1).reshape(-1, 3))
    return np.concatenate(lines).astype(np.float32)


@functools.lru_cache(maxsize=4)
def _batches(box: Box, resolution: Resolution | None) -> list[tuple[Any, Any, float, float]]:
    """Return (shader, batch, opacity, width) of everything that is drawn."""
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    edges = batch_for_shader(shader, "LINES", {"pos": edge_lines(box)})
    drawn = [(shader, edges, EDGE_ALPHA, EDGE_WIDTH)]
    if resolution is not None and max(resolution) > 1:
        ticks = batch_for_shader(shader, "LINES", {"pos": tick_lines(box, resolution)})
        drawn.append((shader, ticks, TICK_ALPHA, TICK_WIDTH))
    return drawn


def draw_box(
    box: Box, resolution: Resolution | None, color: tuple[float, float, float], pixel_size: float = 1.0
) -> None:
    """Draw a grid's box in the viewport that is being drawn."""
    viewport = gpu.state.viewport_get()
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL")
    try:
        for shader, batch, alpha, width in _batches(box, resolution):
            shader.bind()
            shader.uniform_float("viewportSize", viewport[2:])
            shader.uniform_float("lineWidth", width * pixel_size)
            shader.uniform_float("color", (*color, alpha))
            batch.draw(shader)
    finally:
        gpu.state.depth_test_set("NONE")
        gpu.state.blend_set("NONE")


def _draw() -> None:
    """Draw the box of the scene that the viewport shows."""
    context = bpy.context
    if not (context.scene.ivg.show_bounds and context.space_data.overlay.show_overlays):
        return
    found = preview(context)
    if found.box is not None:
        draw_box(found.box, found.resolution, COLOR, context.preferences.system.pixel_size)


_overlay = ViewportOverlay(_draw)


def register() -> None:
    """Draw in every viewport."""
    _overlay.register()


def unregister() -> None:
    """Draw no more."""
    _overlay.unregister()
    _batches.cache_clear()
