# SPDX-License-Identifier: GPL-3.0-or-later
"""Camera rays: where each sample of each pixel looks, as Cycles would send it."""

from __future__ import annotations

import numpy as np

from .camera import Camera, Projection
from .compiled import kernel
from .random import STREAM_CAMERA, random4
from .scene import Float32

# The generalised golden ratio in two dimensions: 1/g, 1/g² with g³ = g + 1 make an additive sequence of low discrepancy
# (Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences").
_G = 1.324717957244746
_R2 = (1.0 / _G, 1.0 / _G**2)


@kernel
def spread_rays(first, samples, seed, offsets, width, height, perspective, frame, matrix, near, origins, directions):
    """Fill origins and directions (n, 3) float32 with n samples from number `first` on.

    Number q is sample q mod `samples` of pixel q div `samples`; pixels count from the bottom left, row after row. The
    samples of a pixel are a low-discrepancy sequence with a random shift of its own.
    """
    last = len(offsets) - 1
    for row in range(len(origins)):
        pixel, sample = (first + row) // samples, (first + row) % samples
        shift_x, shift_y, _, _ = random4(seed, pixel, STREAM_CAMERA)
        a = (shift_x + sample * _R2[0]) % 1.0 * last
        b = (shift_y + sample * _R2[1]) % 1.0 * last
        i, j = min(int(a), last - 1), min(int(b), last - 1)
        x = pixel % width + 0.5 + offsets[i] + (a - i) * (offsets[i + 1] - offsets[i])
        y = pixel // width + 0.5 + offsets[j] + (b - j) * (offsets[j + 1] - offsets[j])
        x = frame[0] + (frame[1] - frame[0]) * x / width
        y = frame[2] + (frame[3] - frame[2]) * y / height
        for axis in range(3):
            across = x * matrix[axis, 0] + y * matrix[axis, 1]
            if perspective:
                # Of length 1 along the view, so that distances are depths.
                along = across - matrix[axis, 2]
                origins[row, axis] = np.float32(matrix[axis, 3] + near * along)
                directions[row, axis] = np.float32(along)
            else:
                origins[row, axis] = np.float32(matrix[axis, 3] + across - near * matrix[axis, 2])
                directions[row, axis] = np.float32(-matrix[axis, 2])


def camera_rays(camera: Camera, first: int, count: int, samples: int, seed: int = 0) -> tuple[Float32, Float32]:
    """Return the rays of some of a picture's samples, from the near clipping plane on.

    Parameters
    ----------
    first, count
        Which: number q is sample q mod `samples` of pixel q div `samples`, pixels counted from the bottom left.
    samples
        Per pixel.
    seed
        Of the samples' places within the pixels.

    Returns
    -------
    origins, directions : (count, 3) float32
        A direction's component along the view is 1: distances are depths behind the near clipping plane.
    """
    origins = np.empty((count, 3), dtype=np.float32)
    directions = np.empty((count, 3), dtype=np.float32)
    spread_rays(
        first,
        samples,
        seed,
        camera.offsets,
        camera.width,
        camera.height,
        camera.projection is Projection.PERSPECTIVE,
        np.asarray(camera.frame, dtype=np.float64),
        camera.matrix,
        camera.clip_start,
        origins,
        directions,
    )
    return origins, directions
