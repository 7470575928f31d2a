# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawing in every 3D viewport, over what is there."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import bpy


class ViewportOverlay:
    """A function that every viewport calls when it is drawn, while registered; without a window there is none."""

    def __init__(self, draw: Callable[[], None]) -> None:
        self._draw = draw
        self._handle: Any = None

    def register(self) -> None:
        """Draw from now on."""
        if not bpy.app.background:
            self._handle = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_VIEW")

    def unregister(self) -> None:
        """Draw no more."""
        if self._handle is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self._handle, "WINDOW")
            self._handle = None
