# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the normals of a material's shaders come from: bump and normal maps, or nothing that tilts them."""

from __future__ import annotations

from ..core.bumps import MIRRORED, OWN
from .export_needs import Needs, upstream
from .export_nodes import Input, Output, follow

_FLAT = (0.5, 0.5, 1.0)
"""The colour that a Normal Map node takes for the surface's own normal."""


def tilting(entry: Input) -> tuple[Input, Output] | None:
    """Return what tilts the normal that an input reads, as `follow` does; None where it is the surface's own."""
    while True:
        end, output = follow(entry)
        if output is None:
            return None
        match output.node.type, output.socket.name:
            case "NEW_GEOMETRY", "Normal":
                return None
            case "NORMAL_MAP", _ if _is_flat(output):
                return None
            case "BUMP", _ if follow(output.input("Height"))[1] is None:
                entry = output.input("Normal")
            case _:
                return end, output


def bends(displacement: Input) -> bool:
    """Tell whether a material's displacement has any slope."""
    _, output = follow(displacement)
    if output is None:
        return False
    return output.node.type != "DISPLACEMENT" or follow(output.input("Height"))[1] is not None


def _is_flat(output: Output) -> bool:
    end, linked = follow(output.input("Color"))
    if linked is not None or not hasattr(end.socket, "default_value"):
        return False
    own = tuple(end.socket.default_value)[:3]
    return output.node.space == "TANGENT" and all(abs(a - b) < 1e-6 for a, b in zip(own, _FLAT, strict=True))


def from_behind(entry: Input, output: Output) -> int:
    """Return how a normal is tilted as it is seen from behind: flags of `bumps`.

    Bump nodes tilt towards the same side; normal maps, and bumps on top of them, are taken to tilt to the other one.
    """
    bump = output.node.type == "BUMP" and not _maps(entry)
    return OWN | MIRRORED if bump else OWN


def turns_with_objects(entry: Input) -> bool:
    """Tell whether a normal is told by a map in object space."""
    return any(output.node.space in ("OBJECT", "BLENDER_OBJECT") for output in _maps(entry))


def _maps(entry: Input) -> list[Output]:
    return [output for output in upstream(entry) if output.node.type == "NORMAL_MAP"]


def normal_needs(entry: Input) -> Needs:
    """Return what a normal reads; as it is kept relative to the surface, to tilt it is not to depend on the place."""
    needs = Needs(shading_normals=True)
    for output in upstream(entry):
        if output.node.type == "NORMAL_MAP" and output.node.space == "TANGENT":
            needs.add_uv(str(output.node.uv_map))
        elif output.node.type != "BUMP":
            needs.add(output)
    return needs
