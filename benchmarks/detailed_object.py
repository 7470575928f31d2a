# SPDX-License-Identifier: GPL-3.0-or-later
"""One wrinkled ball at any number of triangles."""

from __future__ import annotations

import bpy
import numpy as np

CENTRE, RADIUS = (2.0, 2.6, 2.6), 0.9
"""In `sample_blend/cornell.blend`: in the air over the short block."""


def detailed_mesh(around: int, along: int) -> bpy.types.Mesh:
    """Return a ball with bumps and wrinkles, of 2 · around · along triangles, all samples of the same shape."""
    phi = 2.0 * np.pi * np.arange(around) / around
    theta = np.pi * (np.arange(along + 1) + 1e-3) / (along + 2e-3)
    p, t = np.meshgrid(phi, theta)
    bumps = 0.10 * np.sin(5.0 * p + 2.0 * np.cos(3.0 * t)) * np.sin(t) ** 2
    wrinkles = 0.02 * np.sin(23.0 * t + 3.0 * np.sin(4.0 * p)) + 0.008 * np.sin(61.0 * p) * np.sin(t) ** 2
    r = RADIUS * (1.0 + bumps + wrinkles)
    points = np.stack([r * np.sin(t) * np.cos(p), r * np.sin(t) * np.sin(p), r * np.cos(t)], axis=-1)
    points = points.reshape(-1, 3) + CENTRE
    j, i = (index.reshape(-1) for index in np.mgrid[0:along, 0:around])
    here, right = j * around + i, j * around + (i + 1) % around
    low, low_right = here + around, right + around
    corners = np.stack([here, low, low_right, here, low_right, right], axis=-1).reshape(-1)
    mesh = bpy.data.meshes.new("Detailed")
    mesh.vertices.add(len(points))
    mesh.vertices.foreach_set("co", points.astype(np.float32).reshape(-1))
    mesh.loops.add(len(corners))
    mesh.loops.foreach_set("vertex_index", corners.astype(np.int32))
    mesh.polygons.add(len(corners) // 3)
    mesh.polygons.foreach_set("loop_start", np.arange(0, len(corners), 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    mesh.shade_smooth()
    mesh.materials.append(bpy.data.materials["White"])
    return mesh
