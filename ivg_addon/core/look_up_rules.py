# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers of the look-up that kernels and nodes share; apart, so that nodes are written without Numba."""

FULLY_COUNTED = 0.05
"""Lit share of a cell from which on its vertex counts in full; below, in proportion: slivers tell little, noisily."""

LEAST_DIVIDED = 1e-4
"""Of the weight of all vertices around a point, that those which walls divide must have for walls to be looked at."""

LEAST_SPOKEN = 0.1
"""Of the weight of lit vertices around a point, that those which speak for it must have."""

WITHIN = 1e-6
"""How far from its faces a position surely lies in a voxel, in floating point: beside walls look-ups stay in theirs."""
