# SPDX-License-Identifier: GPL-3.0-or-later
"""What is in a scene only to show its grid: no part of the scene for bakes, comparisons and checks.

Such an object, and its mesh, material and collection, bears a mark, so it is known wherever the user puts it.
"""

from __future__ import annotations

import bpy

from .marks import KEY, bears

FORMAT = "irradiance-vector-grid-inspection"
VERSION = 1


def mark(block: bpy.types.ID, **told: str) -> None:
    """Mark a datablock as one that only shows a grid, with more to tell about it."""
    block[KEY] = {"format": FORMAT, "version": VERSION, **told}


def is_inspection(block: bpy.types.ID) -> bool:
    """Tell whether a datablock, evaluated or not, only shows a grid."""
    return bears(block, FORMAT)


def told_of(block: bpy.types.ID, name: str) -> str:
    """Return what a marked datablock was given to tell; empty if nothing."""
    return str(block[KEY].get(name, ""))


def inspection_objects(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Return the objects of a scene that only show a grid."""
    return [shown for shown in scene.objects if is_inspection(shown)]
