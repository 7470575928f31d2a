# SPDX-License-Identifier: GPL-3.0-or-later
"""Normals as Cycles baked them on the stage, made relative to the surfaces on which they tilt."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..core.bumps import relative_normals, unit_normals
from ..core.evaluation_plan import Plan
from ..core.scene import Float32
from .evaluation_mesh import StageArrays, flat_normals
from .evaluation_tree import ATLAS

Float64 = NDArray[np.float64]
Texels = tuple[NDArray[np.int64], NDArray[np.int64]]
"""The covered texels of an atlas, and of which triangle each is."""

_SLICE = 1 << 18
"""Texels that are treated at a time."""


def texel_normals(baked: Float32, plan: Plan, covered: Texels, arrays: StageArrays, bent: bool) -> Float32:
    """Return the normals (k, 3) of an atlas's texels as `bumps` has them.

    Parameters
    ----------
    baked : (k, 3)
        In world space, at the texels' centres.
    covered
        Of `plan.atlas.texels`.
    bent
        By displacement, which is told in the object's own lengths: on the stage these are metres.
    """
    texels, owners = covered
    scale = np.ones(len(plan.atlas.size))
    if bent:
        scale = np.concatenate(
            [np.full(plan.blocks(patch), abs(np.linalg.det(patch.matrix[:3, :3])) ** (1 / 3)) for patch in plan.patches]
        )
    corners = arrays.positions[arrays.corner_vertex].reshape(-1, 3, 3)
    normals = flat_normals(arrays) if arrays.normals is None else arrays.normals
    smooth, uvs = normals.reshape(-1, 3, 3), arrays.uv_maps[ATLAS].reshape(-1, 3, 2)
    found = np.empty_like(baked)
    for start in range(0, len(texels), _SLICE):
        part = slice(start, start + _SLICE)
        owner, row, column = owners[part], texels[part] // plan.atlas.width, texels[part] % plan.atlas.width
        centre = np.stack([(column + 0.5) / plan.atlas.width, (row + 0.5) / plan.atlas.height], axis=1)
        p, edges = corners[owner].astype(np.float64), uvs[owner].astype(np.float64)
        to_uv = np.linalg.inv(edges[:, 1:] - edges[:, :1])
        share = np.einsum("ki,kij->kj", centre - edges[:, 0], to_uv)
        along = to_uv @ (p[:, 1:] - p[:, :1])
        n = smooth[owner].astype(np.float64)
        n = n[:, 0] + share[:, :1] * (n[:, 1] - n[:, 0]) + share[:, 1:] * (n[:, 2] - n[:, 0])
        n /= np.maximum(np.linalg.norm(n, axis=1, keepdims=True), 1e-30)
        tilted = relative_normals(baked[part].astype(np.float64), n, along[:, 0], along[:, 1])
        tilted[:, :2] *= scale[owner][:, None]
        found[part] = unit_normals(tilted)
    return found
