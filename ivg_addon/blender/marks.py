# SPDX-License-Identifier: GPL-3.0-or-later
"""Marks on datablocks that this program made: what they are for, and in which version of their layout."""

from __future__ import annotations

import bpy

KEY = "ivg"
"""The custom property that has all that such a datablock tells of itself."""


def bears(block: bpy.types.ID, kind: str) -> bool:
    """Tell whether a datablock is marked as one of a kind, a format's name, of whatever version."""
    stored = block.get(KEY)
    return hasattr(stored, "get") and stored.get("format") == kind
