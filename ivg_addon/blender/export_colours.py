# SPDX-License-Identifier: GPL-3.0-or-later
"""What a colour or number socket of a shader amounts to, without running the shader.

Constants and image textures on UVs are taken as they are. For all else the best constant that can
be had cheaply is taken (an image's mean, a checker's two colours in equal parts), and said.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.report import Kind, Notice
from .export_images import ImageTable, ImageUse
from .export_nodes import Input, Output, follow

Float64 = NDArray[np.float64]

LUMINANCE: Float64 = np.array([0.2126, 0.7152, 0.0722])
"""Weights that make a colour a number, Rec. 709."""

_COLOUR_ADJUSTMENTS = {"HUE_SAT", "GAMMA", "BRIGHTCONTRAST", "CURVE_RGB"}
_RAY_THAT_SHADES = {
    "Is Camera Ray": 0.0,
    "Is Shadow Ray": 0.0,
    "Is Diffuse Ray": 1.0,
    "Is Glossy Ray": 0.0,
    "Is Singular Ray": 0.0,
    "Is Reflection Ray": 1.0,
    "Is Transmission Ray": 0.0,
}
"""Light Path outputs for the rays that carry diffuse light from surface to surface."""


@dataclass(frozen=True)
class Paint:
    """A colour (3,), or that many times an image."""

    colour: Float64
    image: ImageUse | None = None

    def scaled(self, factor: Float64 | float) -> Paint:
        """Return it multiplied by a number or a colour."""
        return Paint(self.colour * factor, self.image)


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
    """Reads the sockets of one material."""

    images: ImageTable
    notes: Notes

    def paint(self, entry: Input, name: str = "") -> Paint:
        """Return a colour socket's value, as an image where it is one.

        Parameters
        ----------
        name
            What notices call the socket; by default its own name.
        """
        name = name or entry.socket.name
        entry, output = follow(entry)
        if output is None:
            return Paint(_as_colour(entry.socket.default_value))
        match output.node.type:
            case "RGB" | "VALUE":
                return Paint(_as_colour(output.socket.default_value))
            case "TEX_IMAGE" if output.socket.name == "Color":
                return self._image(output, name)
            case "TEX_CHECKER" if output.socket.name == "Color":
                first, second = (self.mean(self.paint(output.input(key), name)) for key in ("Color1", "Color2"))
                return self._instead(0.5 * (first + second), output, name)
            case "VALTORGB" if output.socket.name == "Color":
                ramp = output.node.color_ramp
                stops = [ramp.evaluate(position)[:3] for position in np.linspace(0.0, 1.0, 65)]
                return self._instead(np.mean(stops, axis=0), output, name)
            case "MIX" | "MIX_RGB":
                return self._mix(output, name)
            case kind if kind in _COLOUR_ADJUSTMENTS:
                self.notes.add("simplified", f"{name}: {output.label} node ignored")
                return self.paint(output.input("Color"), name)
        return self._instead(_as_colour(entry.socket.default_value), output, name)

    def colour(self, entry: Input, name: str = "") -> Float64:
        """Return a colour socket's value (3,) as a constant."""
        paint = self.paint(entry, name)
        if paint.image is not None:
            self.notes.add(
                "simplified", f"{name or entry.socket.name}: mean colour of image '{paint.image.name}' taken"
            )
        return self.mean(paint)

    def number(self, entry: Input, name: str = "") -> float:
        """Return a number socket's value as a constant."""
        name = name or entry.socket.name
        entry, output = follow(entry)
        if output is None:
            return _as_number(entry.socket.default_value)
        if output.node.type in ("RGB", "VALUE"):
            return _as_number(output.socket.default_value)
        if output.node.type == "LIGHT_PATH" and output.socket.name in _RAY_THAT_SHADES:
            return _RAY_THAT_SHADES[output.socket.name]
        if output.socket.type == "RGBA":
            return float(self.colour(entry, name) @ LUMINANCE)
        value = _as_number(entry.socket.default_value)
        self.notes.add("simplified", f"{name}: {value:.3g} taken instead of {output.label} node")
        return value

    def mean(self, paint: Paint) -> Float64:
        """Return the colour that a paint has on average."""
        if paint.image is None:
            return paint.colour
        return paint.colour * self.images.mean(paint.image)

    def _instead(self, colour: Float64, output: Output, name: str) -> Paint:
        """Take a constant in place of a node, and say so."""
        rgb = ", ".join(f"{value:.2f}" for value in colour)
        self.notes.add("simplified", f"{name}: constant ({rgb}) taken instead of {output.label} node")
        return Paint(np.asarray(colour, dtype=np.float64))

    def _image(self, output: Output, name: str) -> Paint:
        """Return an Image Texture node's image where it lies on UVs, else its mean colour."""
        node = output.node
        uv_map = self._uv_map(output.input("Vector"), name)
        if node.interpolation not in ("Linear", "Closest"):
            self.notes.add("simplified", f"{name}: {node.interpolation.lower()} interpolation taken as linear")
        use = ImageUse(
            image=node.image,
            interpolate=node.interpolation != "Closest",
            extension=str(node.extension),
            uv_map=uv_map or "",
        )
        if node.image is None:
            self.notes.add("warning", f"{name}: its Image Texture node has no image: magenta")
        paint = Paint(np.ones(3), use)
        if uv_map is None or node.projection != "FLAT":
            self.notes.add("simplified", f"{name}: mean colour taken, image '{use.name}' does not lie on a UV map")
            return Paint(self.mean(paint))
        return paint

    def _uv_map(self, vector: Input, name: str) -> str | None:
        """Return the UV map that a Vector socket reads ("" for the active one), None if it is none."""
        while True:
            vector, output = follow(vector)
            if output is None:
                # An unlinked Vector reads UVs; one of a node before it is a constant.
                return "" if vector.socket.node.type == "TEX_IMAGE" else None
            match output.node.type, output.socket.name:
                case "UVMAP", _:
                    return str(output.node.uv_map)
                case "TEX_COORD", "UV":
                    return ""
                case "ATTRIBUTE", "Vector" if output.node.attribute_type == "GEOMETRY":
                    return str(output.node.attribute_name) or None
                case "MAPPING", _:
                    self.notes.add("simplified", f"{name}: {output.label} node ignored")
                    vector = output.input("Vector")
                case _:
                    return None

    def _mix(self, output: Output, name: str) -> Paint:
        """Return a Mix node's colour: exact for constants, and for one image times a constant."""
        node = output.node
        if node.type == "MIX" and node.data_type != "RGBA":
            return self._instead(np.full(3, 0.5), output, name)
        keys = ("Factor_Float", "A_Color", "B_Color") if node.type == "MIX" else ("Fac", "Color1", "Color2")
        factor = min(max(self.number(output.input(keys[0]), f"{name}, mix factor"), 0.0), 1.0)
        first, second = (self.paint(output.input(key), name) for key in keys[1:])
        if factor == 0.0:
            return first
        match node.blend_type:
            case "MIX" if factor == 1.0:
                return second
            case "MIX" if first.image is None and second.image is None:
                return Paint((1.0 - factor) * first.colour + factor * second.colour)
            case "MIX":
                return self._instead((1.0 - factor) * self.mean(first) + factor * self.mean(second), output, name)
            case "MULTIPLY" if second.image is None:
                return first.scaled(1.0 - factor + factor * second.colour)
            case "MULTIPLY" if first.image is None and factor == 1.0:
                return second.scaled(first.colour)
        self.notes.add("simplified", f"{name}: {node.blend_type.lower()} blending ignored, first colour taken")
        return first


def _as_colour(value: object) -> Float64:
    """Return a socket's default value as a colour (3,)."""
    if isinstance(value, int | float):
        return np.full(3, float(value))
    return np.array(list(value)[:3], dtype=np.float64)  # type: ignore[call-overload]


def _as_number(value: object) -> float:
    """Return a socket's default value as a number."""
    return float(value) if isinstance(value, int | float) else float(_as_colour(value) @ LUMINANCE)
