# SPDX-License-Identifier: GPL-3.0-or-later
"""How many triangles hair and points may cost, and which of them are kept where that is too much."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

MOST_TRIANGLES = 1 << 22
"""Of one object's hair or points: beyond, some are left out and the others made larger."""
FINE_TRIANGLES = 1 << 19
"""Up to so many, shapes are as round as they are made at all."""


def kept_of(count: int, most: int) -> NDArray[np.int64]:
    """Return which of `count` things to keep if there may be `most`: all, or some at even distances, (kept,) int64."""
    kept = max(1, min(count, most))
    return np.arange(min(kept, count), dtype=np.int64) * count // kept
