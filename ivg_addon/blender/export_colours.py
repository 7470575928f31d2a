# SPDX-License-Identifier: GPL-3.0-or-later
"""What sockets hold that must be constant: those of lights, and of a world of one colour.

Anything else is replaced by the socket's own value, and said.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.report import Kind, Notice
from .export_images import ImageTable, ImageUse
from .export_nodes import Input, follow

Float64 = NDArray[np.float64]

LUMINANCE: Float64 = np.array([0.2126, 0.7152, 0.0722])
"""Weights that make a colour a number, Rec. 709."""

RAY_THAT_SHADES = {
    "Is Camera Ray": 0.0,
    "Is Shadow Ray": 0.0,
    "Is Diffuse Ray": 1.0,
    "Is Glossy Ray": 0.0,
    "Is Singular Ray": 0.0,
    "Is Reflection Ray": 1.0,
    "Is Transmission Ray": 0.0,
}
"""Light Path outputs for the rays that carry diffuse light from surface to surface."""
SHADOW_RAY = {"Is Shadow Ray": 1.0}
"""Those for the rays by which a surface asks for the light of lamps."""


class Notes:
    """What is to be said about one datablock."""

    def __init__(self, subject: str) -> None:
        self._subject = subject
        self._notices: dict[Notice, None] = {}

    def add(self, kind: Kind, message: str) -> None:
        """Note something; a repetition counts once."""
        self._notices[Notice(kind, self._subject, message)] = None

    @property
    def notices(self) -> tuple[Notice, ...]:
        """Return all notes, in the order in which they first came."""
        return tuple(self._notices)


@dataclass
class ColourReader:
    """Reads the sockets of one light or world."""

    images: ImageTable
    notes: Notes

    def colour(self, entry: Input, name: str = "") -> Float64:
        """Return a colour socket's value (3,).

        Parameters
        ----------
        name
            What notices call the socket; by default its own name.
        """
        name = name or entry.socket.name
        end, output = follow(entry)
        if output is None:
            return _as_colour(end.socket.default_value)
        if output.node.type in ("RGB", "VALUE"):
            return _as_colour(output.socket.default_value)
        if output.node.type == "TEX_IMAGE" and output.socket.name == "Color":
            use = ImageUse(output.node.image, True, "REPEAT", "")
            self.notes.add("simplified", f"{name}: mean colour of image '{use.name}' taken")
            return self.images.mean(use)
        colour = _as_colour(end.socket.default_value)
        rgb = ", ".join(f"{value:.2f}" for value in colour)
        self.notes.add("simplified", f"{name}: constant ({rgb}) taken instead of {output.label} node")
        return colour

    def number(self, entry: Input, name: str = "") -> float:
        """Return a number socket's value."""
        name = name or entry.socket.name
        end, output = follow(entry)
        if output is None:
            return _as_number(end.socket.default_value)
        if output.node.type in ("RGB", "VALUE"):
            return _as_number(output.socket.default_value)
        if output.node.type == "LIGHT_PATH" and output.socket.name in RAY_THAT_SHADES:
            return RAY_THAT_SHADES[output.socket.name]
        if output.socket.type == "RGBA":
            return float(self.colour(entry, name) @ LUMINANCE)
        value = _as_number(end.socket.default_value)
        self.notes.add("simplified", f"{name}: {value:.3g} taken instead of {output.label} node")
        return value


def _as_colour(value: object) -> Float64:
    """Return a socket's default value as a colour (3,)."""
    if isinstance(value, int | float):
        return np.full(3, float(value))
    return np.array(list(value)[:3], dtype=np.float64)  # type: ignore[call-overload]


def _as_number(value: object) -> float:
    """Return a socket's default value as a number."""
    return float(value) if isinstance(value, int | float) else float(_as_colour(value) @ LUMINANCE)
