# SPDX-License-Identifier: GPL-3.0-or-later
"""What the shader nodes of a light or a world emit, as a constant."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from .export_colours import ColourReader
from .export_nodes import Input, Output, follow

Float64 = NDArray[np.float64]

_EMITTERS = {"EMISSION", "BACKGROUND"}


def constant_emission(tree: bpy.types.ShaderNodeTree, colours: ColourReader) -> Float64:
    """Return a tree's emission, (3,): colour times strength, through Mix and Add Shader nodes.

    What is no constant is replaced by one, and said in the notes of `colours`. A tree without a
    shader at its output emits nothing.
    """
    node = tree.get_output_node("CYCLES")
    if node is None:
        return np.zeros(3)
    output = Output(node, None)
    if "Volume" in node.inputs and follow(output.input("Volume"))[1] is not None:
        colours.notes.add("left out", "its volume")
    return _closure(output.input("Surface"), colours)


def _closure(entry: Input, colours: ColourReader) -> Float64:
    """Return what the shader at an input emits, (3,)."""
    _, output = follow(entry)
    if output is None:
        return np.zeros(3)
    kind = output.node.type
    if kind in _EMITTERS:
        strength = colours.number(output.input("Strength"))
        return strength * colours.colour(output.input("Color"))
    if kind in {"ADD_SHADER", "MIX_SHADER"}:
        first, second = output.input("Shader"), output.input("Shader_001")
        if kind == "ADD_SHADER":
            return _closure(first, colours) + _closure(second, colours)
        factor = min(max(colours.number(output.input("Fac"), "shader mix factor"), 0.0), 1.0)
        emitted = np.zeros(3)
        # A shader of weight zero may be anything: it is not looked at.
        if factor < 1.0:
            emitted += (1.0 - factor) * _closure(first, colours)
        if factor > 0.0:
            emitted += factor * _closure(second, colours)
        return emitted
    if output.socket.type != "SHADER":
        # A colour in place of a shader shines, in Cycles.
        return colours.colour(entry, "Surface")
    colours.notes.add("simplified", f"its {output.label} node emits nothing")
    return np.zeros(3)
