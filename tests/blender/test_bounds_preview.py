# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel and the viewport show of the grid before it is baked."""

from __future__ import annotations

import importlib
from typing import Any

import bpy
import numpy as np
import pytest

from ivg_addon.blender.bounds import Box
from ivg_addon.blender.bounds_overlay import TICK_LENGTH, edge_lines, tick_lines

BOX = Box((0.0, 0.0, 0.0), (4.0, 2.0, 1.0))


@pytest.fixture
def preview(extension: str) -> Any:
    """Return the function that is asked, in a scene with a box of 4 × 2 × 1 metres."""
    bpy.ops.wm.read_homefile(use_empty=True)
    bpy.ops.mesh.primitive_cube_add(size=1.0, scale=(4.0, 2.0, 1.0))
    bpy.context.view_layer.update()
    return importlib.import_module(f"{extension}.ivg_addon.blender.bounds_preview").preview


def test_scene_is_shown_with_its_voxels(preview: Any) -> None:
    found = preview(bpy.context)
    np.testing.assert_allclose(found.box.size, (4.0, 2.0, 1.0), rtol=1e-6)
    assert (found.resolution, found.problem) == ((32, 16, 8), "")


def test_changes_are_followed(preview: Any) -> None:
    preview(bpy.context)
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(9.5, 0.0, 0.0))
    bpy.context.view_layer.update()
    for _ in range(1000):  # in small scenes at once, in large ones a moment later
        if np.isclose(preview(bpy.context).box.size[0], 12.0):
            return
    pytest.fail("the preview still shows the box before the change")


def test_margin_and_manual_voxels(preview: Any) -> None:
    settings = bpy.context.scene.ivg
    settings.margin = 0.5
    settings.resolution_mode = "MANUAL"
    settings.resolution = (3, 4, 5)
    found = preview(bpy.context)
    np.testing.assert_allclose(found.box.size, (5.0, 3.0, 2.0), rtol=1e-6)
    assert found.resolution == (3, 4, 5)


def test_a_missing_bounds_object_is_said(preview: Any) -> None:
    bpy.context.scene.ivg.bounds_mode = "OBJECT"
    found = preview(bpy.context)
    assert found.box is None
    assert "Choose an empty or a mesh" in found.problem


def test_a_flat_box_is_said(preview: Any) -> None:
    bpy.context.object.scale.z = 0.0
    bpy.context.view_layer.update()
    flat = [preview(bpy.context) for _ in range(1000)][-1]
    assert flat.resolution is None
    assert "no volume" in flat.problem


def test_edges_are_the_twelve_of_a_box() -> None:
    lines = edge_lines(BOX).reshape(12, 2, 3)
    vectors = np.abs(lines[:, 1] - lines[:, 0])
    np.testing.assert_allclose(vectors.sum(axis=0), (4 * 4.0, 4 * 2.0, 4 * 1.0))
    assert (np.count_nonzero(vectors, axis=1) == 1).all()
    assert len({tuple(map(tuple, line)) for line in lines}) == 12


def test_ticks_mark_every_voxel_on_every_edge() -> None:
    resolution = (4, 3, 1)
    lines = tick_lines(BOX, resolution).reshape(-1, 2, 3)
    assert len(lines) == 4 * 2 * sum(n - 1 for n in resolution)
    voxel = np.array(BOX.size) / resolution
    starts, ends = lines[:, 0], lines[:, 1]
    np.testing.assert_allclose(starts / voxel, np.round(starts / voxel), atol=1e-5)
    np.testing.assert_allclose(np.abs(ends - starts).max(axis=0), TICK_LENGTH * voxel, rtol=1e-6)
    assert (ends >= BOX.low).all()
    assert (ends <= np.array(BOX.high) + 1e-6).all()
