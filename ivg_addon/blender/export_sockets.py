# SPDX-License-Identifier: GPL-3.0-or-later
"""What the sockets of a material's shaders hold: constants, or leaves that are evaluated later.

A leaf is a socket that a network of nodes is linked to. What networks compute is Cycles' business; here only those
nodes are looked at whose value does not depend on the surface, or depends on the ray, which a network cannot be asked
for later.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass

import numpy as np

from ..core.bumps import BENT, MIRRORED, OWN
from ..core.closures import VIEWS, Directed, Leaf, Normal, Value
from ..core.principled import dielectric_curve, facing_curve, mean_reflectance
from .export_colours import LUMINANCE, RAY_THAT_SHADES, Notes
from .export_images import ImageUse
from .export_needs import DIFFERS_BY_PATH, Needs, is_undefined, network_needs, upstream
from .export_nodes import Input, Output, follow
from .export_normals import bends, from_behind, normal_needs, tilting, turns_with_objects

DISPLACEMENT = "Displacement"
"""The material output's socket by which a surface's own normal is bent."""


@dataclass(frozen=True)
class LeafSource:
    """Where a leaf comes from.

    Parameters
    ----------
    groups
        Names of the group nodes around the shader, outermost first.
    node, socket
        The shader's name, and the identifier of its input.
    colour
        A colour, or a normal; else a number.
    normal
        A normal. Of a material's output it is that to which displacement bends the surface's own.
    side
        0 seen from the front, 1 from behind.
    image
        Where it is nothing but an image on a UV map.
    fallback
        The socket's own value.
    name
        What notices call it.
    cosine
        Of the direction of view in which it is seen; None for all, where it does not depend on it, or its mean does.
    """

    groups: tuple[str, ...]
    node: str
    socket: str
    colour: bool
    side: int
    image: ImageUse | None
    fallback: tuple[float, ...]
    name: str
    normal: bool = False
    cosine: float | None = None


class SocketReader:
    """Reads the sockets of one material, seen from one side.

    Parameters
    ----------
    notes
        Where to say what is simplified.
    side
        0 seen from the front, 1 from behind.
    leaves
        Those that are known already, by what they show; more are added.
    ray
        What Light Path nodes tell; 0 where it says nothing.
    settled
        Outputs of Light Path nodes of which all is known.
    """

    def __init__(
        self,
        notes: Notes,
        side: int,
        leaves: dict[object, LeafSource],
        needs: Needs,
        ray: Mapping[str, float] = RAY_THAT_SHADES,
        settled: Collection[str] = (),
    ) -> None:
        self.notes = notes
        self._side = side
        self._leaves = leaves
        self._needs = needs
        self._ray = ray
        self._settled = settled

    def colour(self, entry: Input, name: str = "", directed: bool = False) -> Value:
        """Return a colour socket's value; `directed` if it may depend on the direction of view."""
        return self._value(entry, name or entry.socket.name, True, directed)

    def number(self, entry: Input, name: str = "", directed: bool = False) -> Value:
        """Return a number socket's value; `directed` if it may depend on the direction of view."""
        return self._value(entry, name or entry.socket.name, False, directed)

    def _value(self, entry: Input, name: str, colour: bool, directed: bool) -> Value:
        end, output = follow(entry)
        if output is None:
            return _constant(end.socket.default_value if hasattr(end.socket, "default_value") else 0.0, colour)
        node = output.node
        match node.type:
            case "RGB" | "VALUE":
                return _constant(output.socket.default_value, colour)
            case "LIGHT_PATH":
                self._note_path(output, name)
                return _constant(self._ray.get(output.socket.name, 0.0), colour)
            case "NEW_GEOMETRY" if output.socket.name == "Backfacing":
                self._needs.sided = True
                return _constant(float(self._side), colour)
            case "FRESNEL" | "LAYER_WEIGHT" if not directed:
                self.notes.add("simplified", f"{name}: {output.label} node replaced by its mean over directions")
                return _constant(mean_over_directions(output), colour)
        own = getattr(end.socket, "default_value", 0.0)
        if is_undefined(node):
            self.notes.add("warning", f"{name}: node '{node.name}' is of an unknown type: ignored, as in Cycles")
            return _constant(own, colour)
        if directed and network_needs(entry).averaged:
            for each in upstream(entry):
                self._note_ignored(each, ("Blend", "IOR", "Normal"))
            return Directed(tuple(self._leaf(end, output, name, colour, own, cosine) for cosine in VIEWS))
        return self._leaf(end, output, name, colour, own)

    def _leaf(
        self, entry: Input, output: Output, name: str, colour: bool, own: object, cosine: float | None = None
    ) -> Leaf:
        needs = network_needs(entry)
        if cosine is not None:
            needs.averaged.clear()
        side = self._side if needs.sided else 0
        groups = tuple(str(group.name) for group in output.groups)
        key = (groups, str(output.node.name), str(output.socket.identifier), colour, side, cosine)
        if key not in self._leaves:
            image = plain_image(output) if colour else None
            if image is not None and image.image is not None:
                needs.missing.clear()  # who reads that image says so
            self._note(needs, name)
            self._needs.update(needs)
            around = tuple(str(group.name) for group in entry.groups)
            self._leaves[key] = LeafSource(
                groups=around,
                node=str(entry.socket.node.name),
                socket=str(entry.socket.identifier),
                colour=colour,
                side=side,
                image=image,
                fallback=_constant(own, colour),
                name=name,
                cosine=cosine,
            )
        return Leaf(list(self._leaves).index(key))

    def normal(self, entry: Input) -> Normal | None:
        """Return the normal that is linked to a socket, None where it is the surface's own."""
        found = tilting(entry)
        if found is None:
            return None
        end, output = found
        if is_undefined(output.node):
            self.notes.add("warning", f"Normal: node '{output.node.name}' is of an unknown type: ignored, as in Cycles")
            return None
        if turns_with_objects(entry):
            self.notes.add("simplified", "Normal: a map in object space is read as if objects were not turned")
        return Normal(self._normal_leaf(end, output), from_behind(entry, output))

    def bent_normal(self, displacement: Input) -> Normal | None:
        """Return the normal to which a material's displacement bends its surface, None without any."""
        _, output = follow(displacement)
        if output is None or is_undefined(output.node) or not bends(displacement):
            return None
        return Normal(self._normal_leaf(displacement, output), OWN | MIRRORED | BENT)

    def _normal_leaf(self, entry: Input, output: Output) -> Leaf:
        groups = tuple(str(group.name) for group in output.groups)
        # What a displacement is linked to is no normal, but may be shown as one elsewhere.
        bent = entry.socket.identifier == DISPLACEMENT
        key = ("normal", bent, groups, str(output.node.name), str(output.socket.identifier))
        if key not in self._leaves:
            needs = normal_needs(entry)
            self._note(needs, "Normal")
            self._needs.update(needs)
            self._leaves[key] = LeafSource(
                groups=tuple(str(group.name) for group in entry.groups),
                node=str(entry.socket.node.name),
                socket=str(entry.socket.identifier),
                colour=True,
                side=0,
                image=None,
                fallback=(0.0, 0.0, 1.0),
                name="Normal",
                normal=True,
            )
        return Leaf(list(self._leaves).index(key))

    def _note_path(self, output: Output, name: str) -> None:
        """Say so where light paths differ in what they would see."""
        path = str(output.socket.name)
        if path in DIFFERS_BY_PATH:
            self._needs.paths.add(path)
        if path in DIFFERS_BY_PATH and path not in self._settled:
            self.notes.add("simplified", f"{name}: {path} of Light Path taken as of diffuse light")

    def _note(self, needs: Needs, name: str) -> None:
        for unknown in sorted(needs.unknown):
            self.notes.add("simplified", f"{name}: depends on {unknown}, which the bake does not know")
        for path in sorted(needs.paths):
            self.notes.add("simplified", f"{name}: {path} of Light Path taken as of diffuse light")
        for label in sorted(needs.averaged):
            self.notes.add("simplified", f"{name}: {label} node replaced by its mean over directions")
        for image in sorted(needs.missing):
            what = "an Image Texture node has no image" if image == "(none)" else f"image '{image}' cannot be read"
            self.notes.add("warning", f"{name}: {what}: magenta, as in Cycles")
        for node in sorted(needs.undefined):
            self.notes.add("warning", f"{name}: node '{node}' is of an unknown type: ignored, as in Cycles")

    def view_factor(self, output: Output) -> tuple[str, Value] | None:
        """Return shape and value of the `closures.Factor` that an output is by the direction of view, None if none."""
        self._note_ignored(output, ("Blend", "Normal"))
        if output.node.type == "LAYER_WEIGHT" and output.socket.name == "Facing":
            return "FACING", (_plain(output, "Blend"),)
        ior = self._fresnel_ior(output)
        return None if ior is None else ("FRESNEL", ior)

    def _note_ignored(self, output: Output, names: tuple[str, ...]) -> None:
        """Say which inputs of a Fresnel or Layer Weight node are not read where networks are linked to them."""
        if output.node.type in ("FRESNEL", "LAYER_WEIGHT"):
            for socket in output.node.inputs:
                source = follow(Input(socket, output.groups))[1] if socket.identifier in names else None
                if source is not None and source.node.type != "VALUE" and tilting(Input(socket, output.groups)):
                    what = f"{output.label} node: what is linked to its {socket.name} is ignored"
                    self.notes.add("simplified", what)

    def _fresnel_ior(self, output: Output) -> Value | None:
        """Return the index of refraction of the dielectric whose reflectance an output is, None if it is none."""
        if output.node.type == "FRESNEL":
            ior = self.number(output.input("IOR"))
        elif output.node.type == "LAYER_WEIGHT" and output.socket.name == "Fresnel":
            ior = (1.0 / (1.0 - min(max(_plain(output, "Blend"), 0.0), 1.0 - 1e-5)),)
        else:
            return None
        if not isinstance(ior, tuple):
            return ior
        self._needs.sided = True
        return ior if self._side == 0 else (1.0 / max(ior[0], 1e-5),)


def seen_at(output: Output, cosine: float | None) -> float:
    """Return what a Fresnel or Layer Weight node's output is in a direction of view; None is their mean."""
    if cosine is None:
        return mean_over_directions(output)
    if output.node.type == "LAYER_WEIGHT" and output.socket.name == "Facing":
        return float(facing_curve(_plain(output, "Blend"), np.array([cosine]))[0])
    if output.node.type == "FRESNEL":
        ior = max(_plain(output, "IOR"), 1e-5)
    else:
        ior = 1.0 / (1.0 - min(max(_plain(output, "Blend"), 0.0), 1.0 - 1e-5))
    return float(dielectric_curve(ior, np.array([cosine]))[0])


def mean_over_directions(output: Output) -> float:
    """Return what a Fresnel or Layer Weight node's output is for light from all sides: ∫₀¹ … 2μ dμ."""
    if output.node.type == "FRESNEL":
        return mean_reflectance(max(_plain(output, "IOR"), 1e-5))
    blend = min(max(_plain(output, "Blend"), 0.0), 1.0 - 1e-5)
    if output.socket.name == "Fresnel":
        return mean_reflectance(1.0 / (1.0 - blend))
    exponent = 2.0 * blend if blend < 0.5 else 0.5 / (1.0 - blend)
    return 1.0 - 2.0 / (exponent + 2.0)


def _plain(output: Output, name: str) -> float:
    """Return a number of a node; its own where a network is linked to it."""
    end, linked = follow(output.input(name))
    if linked is not None and linked.node.type == "VALUE":
        return float(linked.socket.default_value)
    return float(_constant(getattr(end.socket, "default_value", 0.0), colour=False)[0])


def plain_image(output: Output) -> ImageUse | None:
    """Return how an image is used, if an output is nothing but an image on a UV map."""
    node = output.node
    if node.type != "TEX_IMAGE" or output.socket.name != "Color" or node.projection != "FLAT":
        return None
    if node.interpolation not in ("Linear", "Closest"):
        return None
    uv_map = _uv_map(output.input("Vector"))
    if uv_map is None:
        return None
    return ImageUse(node.image, node.interpolation != "Closest", str(node.extension), uv_map)


def _uv_map(vector: Input) -> str | None:
    """Return the UV map that an Image Texture's Vector reads ("" for the active one), None if it is none."""
    end, output = follow(vector)
    if output is None:
        # An unlinked Vector reads UVs; one of a group around is a constant.
        return "" if end.socket.node.type == "TEX_IMAGE" else None
    match output.node.type, output.socket.name:
        case "UVMAP", _:
            return None if output.node.from_instancer else str(output.node.uv_map)
        case "TEX_COORD", "UV":
            return None if output.node.from_instancer else ""
        case "ATTRIBUTE", "Vector" if output.node.attribute_type == "GEOMETRY":
            return str(output.node.attribute_name) or None
    return None


def _constant(value: object, colour: bool) -> tuple[float, ...]:
    """Return a socket's own value as a colour, or as a number."""
    if isinstance(value, int | float):
        return (float(value),) * (3 if colour else 1)
    rgb = np.array(list(value)[:3], dtype=np.float64)  # type: ignore[call-overload]
    return tuple(float(x) for x in rgb) if colour else (float(rgb @ LUMINANCE),)
