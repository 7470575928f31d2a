"""From means over dual cells to the numbers that are interpolated.

A vertex holds the mean of the light over its dual cell, and interpolation blends means: both
smooth. For a field f along one axis with voxel size h, the mean over a cell is f + h²/24 f″; linear
interpolation adds h²/12 f″ on average, the cubic B-spline h²/6 f″. The second difference δ² of
neighbouring vertices is h² f″, so subtracting (1/24 + 1/12) δ² or (1/24 + 1/6) δ² per axis takes the
error back, to second order. It leaves linear fields, and so uniform ones, unchanged.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .settings import Spatial

SECOND_DIFFERENCE_SHARE = {
    Spatial.TRILINEAR: 1.0 / 24.0 + 1.0 / 12.0,
    Spatial.TRICUBIC: 1.0 / 24.0 + 1.0 / 6.0,
}

LEAST_VALIDITY = 0.5
"""Means over less than half a cell lie off their vertices: no second difference is taken there."""


def sharpened(vectors: NDArray[np.float32], validity: NDArray[np.float32], spatial: Spatial) -> NDArray[np.float32]:
    """Return vectors minus a share of their second differences along each axis.

    Parameters
    ----------
    vectors : (Ni+1, Nj+1, Nk+1, 6, 3, 3) float32
    validity : (Ni+1, Nj+1, Nk+1) float32
        Lit shares; an axis is left alone where the vertex or a neighbour is mostly unlit.
    spatial
        The interpolation that follows.
    """
    result = vectors.copy()
    share = np.float32(SECOND_DIFFERENCE_SHARE[spatial])
    known = validity >= LEAST_VALIDITY
    for axis in range(3):
        middle = _shifted(axis, 1, -1)
        before, after = _shifted(axis, 0, -2), _shifted(axis, 2, None)
        usable = known[middle] & known[before] & known[after]
        second = vectors[before] + vectors[after] - 2.0 * vectors[middle]
        second *= usable[..., None, None, None]
        result[middle] -= share * second
    return result


def _shifted(axis: int, start: int, stop: int | None) -> tuple[slice, ...]:
    """Return an index that takes start:stop along one of the three grid axes."""
    return tuple(slice(start, stop) if k == axis else slice(None) for k in range(3))
