# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of the look-up that kernels and nodes share; apart, so that nodes are written without Numba."""

BEHIND = 0.02
"""What remains of the weight of a vertex right behind a surface, so that weights never vanish."""

LEAST_SPOKEN = 0.1
"""Of the weight of lit vertices around a point, that those which speak for it must have."""

WITHIN = 1e-6
"""How far from its faces a position surely lies in a voxel, in floating point: beside walls look-ups stay in theirs."""
