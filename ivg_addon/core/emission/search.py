# SPDX-License-Identifier: GPL-3.0-or-later
"""Picking an entry of a table of cumulative sums."""

from __future__ import annotations

from ..compiled import merged


@merged
def first_above(sums, low, high, x):
    """Return the first index in low … high whose sum exceeds x, or `high` where none does: sums do not decrease."""
    while low < high:
        middle = (low + high) // 2
        if sums[middle] > x:
            high = middle
        else:
            low = middle + 1
    return low
