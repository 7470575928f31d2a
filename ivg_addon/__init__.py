# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance Vector Grid: indirect light, precomputed into a 3D grid.

`ivg_addon.core` computes (numpy, Embree, Numba; no Blender), `ivg_addon.blender` reads and writes
Blender. Imports point downward only: operators → blender → core.
"""
