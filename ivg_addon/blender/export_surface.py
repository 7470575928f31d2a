# SPDX-License-Identifier: GPL-3.0-or-later
"""A material's shader tree as a sum of weighted closures."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace

import bpy

from ..core.closures import Closure, Directed, Factor, Normal, Value
from .export_colours import RAY_THAT_SHADES, Notes
from .export_needs import Needs, is_undefined
from .export_nodes import Input, Output, follow
from .export_sockets import LeafSource, SocketReader

_PRINCIPLED = {
    "Base Color": True,
    "Metallic": False,
    "Roughness": False,
    "IOR": False,
    "Alpha": False,
    "Diffuse Roughness": False,
    "Specular IOR Level": False,
    "Specular Tint": True,
    "Transmission Weight": False,
    "Coat Weight": False,
    "Coat Roughness": False,
    "Coat IOR": False,
    "Coat Tint": True,
    "Sheen Weight": False,
    "Sheen Roughness": False,
    "Sheen Tint": True,
    "Emission Color": True,
    "Emission Strength": False,
}
"""Inputs of a Principled BSDF that carry energy, and whether they are colours."""
_BASE = "Base Color"
_SEEN = {"Color", "Strength", _BASE, "Emission Color", "Emission Strength"}
"""Inputs that may depend on the direction of view; of others that do the mean is taken."""
_FACETS = {"Anisotropy": "anisotropy", "Anisotropic": "anisotropy", "Thin Film Thickness": "thin film"}
"""Inputs that change facets otherwise than it is taken into account, and what that is called."""


@dataclass(frozen=True)
class SurfaceTree:
    """A material as read.

    Parameters
    ----------
    front
        Its closures.
    back
        Those seen from behind, None where they are the same.
    leaves
        What is evaluated later, by the index that `closures.Leaf` gives.
    needs
        What the leaves read of the surface.
    """

    front: tuple[Closure, ...] = ()
    back: tuple[Closure, ...] | None = None
    leaves: tuple[LeafSource, ...] = ()
    needs: Needs = field(default_factory=Needs)


def read_surface(
    material: bpy.types.Material,
    notes: Notes,
    ray: Mapping[str, float] = RAY_THAT_SHADES,
    settled: Collection[str] = (),
) -> SurfaceTree:
    """Return the surface of a material's node tree as a ray sees it; see `SocketReader`."""
    leaves: dict[object, LeafSource] = {}
    needs = Needs()
    front = _SurfaceReader(SocketReader(notes, 0, leaves, needs, ray, settled), notes).read(material)
    back = None
    if needs.sided:
        back = _SurfaceReader(SocketReader(notes, 1, leaves, needs, ray, settled), notes).read(material)
    return SurfaceTree(front, back, tuple(leaves.values()), needs)


class _SurfaceReader:
    """Reads one material's closures, seen from one side."""

    def __init__(self, sockets: SocketReader, notes: Notes) -> None:
        self._sockets = sockets
        self._notes = notes
        self._omitted: dict[str, None] = {}
        self._path: list[object] = []
        self._bent: Normal | None = None

    def read(self, material: bpy.types.Material) -> tuple[Closure, ...]:
        """Return the closures of a material's tree."""
        node = material.node_tree.get_output_node("CYCLES")
        if node is None:
            self._notes.add("warning", "has no material output: black")
            return ()
        surface_input, volume, displacement = (
            Input(node.inputs[name]) for name in ("Surface", "Volume", "Displacement")
        )
        displaced = material.displacement_method != "BUMP"
        self._bent = None if displaced else self._sockets.bent_normal(displacement)
        closures = self._closures(surface_input, ())
        if follow(volume)[1] is not None:
            self._omitted["volume"] = None
            if follow(surface_input)[1] is None:
                closures = (Closure("TRANSPARENT", {"Color": (1.0, 1.0, 1.0)}),)
        if displaced and follow(displacement)[1] is not None:
            self._omitted["displacement"] = None
        if self._omitted:
            self._notes.add("simplified", f"without {', '.join(self._omitted)}")
        return closures

    def _closures(self, entry: Input, weight: tuple[Factor, ...]) -> tuple[Closure, ...]:
        _, output = follow(entry)
        if output is None:
            return ()
        if output.socket.type != "SHADER":
            # A colour in place of a shader shines, in Cycles.
            colour = self._sockets.colour(entry, "Surface")
            return (Closure("EMISSION", {"Color": colour, "Strength": (1.0,)}, weight),)
        reader = _READERS.get(output.node.type)
        if reader is None:
            if is_undefined(output.node):
                self._notes.add("warning", f"node '{output.node.name}' is of an unknown type: black, as in Cycles")
            else:
                self._omitted[output.label] = None
            return ()
        place = (output.node, output.groups)
        if place in self._path:
            self._notes.add("warning", f"node '{output.node.name}' is linked in a circle: ignored there")
            return ()
        self._path.append(place)
        try:
            return reader(self, output, weight)
        finally:
            self._path.pop()

    def _sum(self, output: Output, weight: tuple[Factor, ...]) -> tuple[Closure, ...]:
        return self._closures(output.input("Shader"), weight) + self._closures(output.input("Shader_001"), weight)

    def _mix(self, output: Output, weight: tuple[Factor, ...]) -> tuple[Closure, ...]:
        entry = output.input("Fac")
        _, source = follow(entry)
        seen = None if source is None else self._sockets.view_factor(source)
        shape, value = seen or ("CONSTANT", self._sockets.number(entry, "shader mix factor", directed=True))
        varies = seen is not None
        closures: tuple[Closure, ...] = ()
        # A shader of weight zero may be anything: it is not looked at.
        if varies or not isinstance(value, tuple) or value[0] < 1.0:
            closures += self._closures(output.input("Shader"), (*weight, Factor(value, True, shape)))
        if varies or not isinstance(value, tuple) or value[0] > 0.0:
            closures += self._closures(output.input("Shader_001"), (*weight, Factor(value, False, shape)))
        return closures

    def _inputs(self, output: Output, colours: tuple[str, ...], numbers: tuple[str, ...] = ()) -> dict[str, Value]:
        """Return inputs by their names."""
        return {
            **{name: self._sockets.colour(output.input(name), directed=name in _SEEN) for name in colours},
            **{name: self._sockets.number(output.input(name), directed=name in _SEEN) for name in numbers},
        }

    def _emission(self, output: Output, weight: tuple[Factor, ...]) -> tuple[Closure, ...]:
        return (Closure("EMISSION", self._inputs(output, ("Color",), ("Strength",)), weight),)

    def _diffuse(self, output: Output, weight: tuple[Factor, ...]) -> tuple[Closure, ...]:
        inputs = self._inputs(output, ("Color",), ("Roughness",))
        return (Closure("DIFFUSE", inputs, weight, normal=self._normal(output)),)

    def _as_diffuse(self, output: Output, weight: tuple[Factor, ...]) -> tuple[Closure, ...]:
        if output.node.type == "BSDF_TOON" and output.node.component != "DIFFUSE":
            self._omitted[output.label] = None
            return ()
        words = {"BSDF_TOON": "toon shading", "SUBSURFACE_SCATTERING": "subsurface scattering"}
        self._omitted[f"{words[output.node.type]} (taken as diffuse)"] = None
        inputs = {**self._inputs(output, ("Color",)), "Roughness": (0.0,)}
        return (Closure("DIFFUSE", inputs, weight, normal=self._normal(output)),)

    def _glossy(self, output: Output, weight: tuple[Factor, ...]) -> tuple[Closure, ...]:
        inputs = self._inputs(output, ("Color",), ("Roughness",))
        if output.node.distribution not in ("GGX", "MULTI_GGX"):
            self._omitted[f"its {output.node.distribution.replace('_', ' ').title()} distribution (GGX taken)"] = None
        return (self._faceted("GLOSSY", output, inputs, weight),)

    def _metallic(self, output: Output, weight: tuple[Factor, ...]) -> tuple[Closure, ...]:
        numbers = self._inputs(output, (), ("Roughness",))
        if output.node.fresnel_type == "F82":
            edge = self._inputs(output, ("Edge Tint",))
            inputs = {"Color": self._sockets.colour(output.input(_BASE)), **edge, **numbers}
        else:
            inputs = {**numbers, **self._inputs(output, ("IOR", "Extinction"))}
        return (self._faceted("METALLIC", output, inputs, weight),)

    def _glass(self, output: Output, weight: tuple[Factor, ...]) -> tuple[Closure, ...]:
        inputs = self._inputs(output, ("Color",), ("Roughness", "IOR"))
        return (self._faceted("GLASS", output, inputs, weight),)

    def _refraction(self, output: Output, weight: tuple[Factor, ...]) -> tuple[Closure, ...]:
        inputs = self._inputs(output, ("Color",), ("Roughness", "IOR"))
        return (Closure("REFRACTION", inputs, weight, normal=self._normal(output)),)

    def _translucent(self, output: Output, weight: tuple[Factor, ...]) -> tuple[Closure, ...]:
        return (Closure("TRANSLUCENT", self._inputs(output, ("Color",)), weight, normal=self._normal(output)),)

    def _sheen(self, output: Output, weight: tuple[Factor, ...]) -> tuple[Closure, ...]:
        if output.node.distribution != "MICROFIBER":
            self._omitted["its Ashikhmin distribution (microfibers taken)"] = None
        inputs = self._inputs(output, ("Color",), ("Roughness",))
        return (Closure("SHEEN", inputs, weight, normal=self._normal(output)),)

    def _transparent(self, output: Output, weight: tuple[Factor, ...]) -> tuple[Closure, ...]:
        return (Closure("TRANSPARENT", self._inputs(output, ("Color",)), weight),)

    def _holdout(self, output: Output, weight: tuple[Factor, ...]) -> tuple[Closure, ...]:
        return ()

    def _principled(self, output: Output, weight: tuple[Factor, ...]) -> tuple[Closure, ...]:
        read = {True: self._sockets.colour, False: self._sockets.number}
        inputs = {
            name: read[colour](output.input(name), directed=name in _SEEN) for name, colour in _PRINCIPLED.items()
        }
        if isinstance(inputs[_BASE], Directed) and (inputs["Metallic"], inputs["Transmission Weight"]) != ((0.0,),) * 2:
            self._omitted["the direction of view in the colour of its metal or glass (its mean taken)"] = None
        end, linked = follow(output.input("Subsurface Weight"))
        if linked is not None or end.socket.default_value > 0.0:
            self._omitted["subsurface scattering (taken as diffuse)"] = None
        if "Thin Wall" in output.node.inputs:  # from Blender 5.2 on
            inputs["Thin Wall"] = self._sockets.number(output.input("Thin Wall"))
        coat_normal = None if inputs["Coat Weight"] == (0.0,) else self._normal(output, "Coat Normal")
        return (replace(self._faceted("PRINCIPLED", output, inputs, weight), coat_normal=coat_normal),)

    def _faceted(self, kind: str, output: Output, inputs: dict[str, Value], weight: tuple[Factor, ...]) -> Closure:
        """Return the closure of a node that has facets."""
        self._note_facets(output)
        return Closure(kind, inputs, weight, output.node.distribution == "MULTI_GGX", self._normal(output))

    def _normal(self, output: Output, name: str = "Normal") -> Normal | None:
        """Return the normal that a node's socket tells, None where it is the surface's own."""
        return self._sockets.normal(output.input(name)) or self._bent

    def _note_facets(self, output: Output) -> None:
        """Say which properties of a lobe's facets are not taken into account."""
        names = [socket.identifier for socket in output.node.inputs]
        for name, words in _FACETS.items():
            if name in names:
                end, linked = follow(output.input(name))
                if linked is not None or end.socket.default_value != 0.0:
                    self._omitted[words] = None


_READERS: dict[str, Callable[[_SurfaceReader, Output, tuple[Factor, ...]], tuple[Closure, ...]]] = {
    "ADD_SHADER": _SurfaceReader._sum,
    "MIX_SHADER": _SurfaceReader._mix,
    "EMISSION": _SurfaceReader._emission,
    "BSDF_DIFFUSE": _SurfaceReader._diffuse,
    "BSDF_PRINCIPLED": _SurfaceReader._principled,
    "SUBSURFACE_SCATTERING": _SurfaceReader._as_diffuse,
    "BSDF_TOON": _SurfaceReader._as_diffuse,
    "BSDF_GLOSSY": _SurfaceReader._glossy,
    "BSDF_ANISOTROPIC": _SurfaceReader._glossy,
    "BSDF_METALLIC": _SurfaceReader._metallic,
    "BSDF_GLASS": _SurfaceReader._glass,
    "BSDF_REFRACTION": _SurfaceReader._refraction,
    "BSDF_TRANSLUCENT": _SurfaceReader._translucent,
    "BSDF_TRANSPARENT": _SurfaceReader._transparent,
    "BSDF_SHEEN": _SurfaceReader._sheen,
    "HOLDOUT": _SurfaceReader._holdout,
}
