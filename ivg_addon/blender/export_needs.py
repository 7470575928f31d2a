# SPDX-License-Identifier: GPL-3.0-or-later
"""What a network of shader nodes reads of the surface that it lies on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import bpy

from .export_nodes import Input, Output, follow

READS_GENERATED = {
    "TEX_NOISE",
    "TEX_VORONOI",
    "TEX_WAVE",
    "TEX_MAGIC",
    "TEX_GRADIENT",
    "TEX_CHECKER",
    "TEX_BRICK",
    "TEX_GABOR",
    "TEX_SKY",
}
"""Textures that read generated coordinates where nothing is linked to their Vector, as Cycles has it."""

DIFFERS_BY_PATH = {
    "Is Shadow Ray",
    "Is Volume Scatter Ray",
    "Ray Length",
    "Ray Depth",
    "Diffuse Depth",
    "Glossy Depth",
    "Transparent Depth",
    "Transmission Depth",
    "Portal Depth",
}
"""Outputs of Light Path nodes that are not the same for all light that was diffusely reflected."""
_TURNS = {"NORMAL_MAP", "BUMP", "BEVEL", "TANGENT", "VECT_TRANSFORM", "NORMAL"}
_UNKNOWABLE = {
    "CAMERA": "the camera",
    "PARTICLE_INFO": "particles",
    "HAIR_INFO": "hair",
    "POINT_INFO": "points",
    "AMBIENT_OCCLUSION": "ambient occlusion",
    "SCRIPT": "a script",
}
_VIEW_OUTPUTS = {"Camera", "Window", "Reflection"}


@dataclass
class Needs:
    """What networks read.

    Parameters
    ----------
    attributes
        Names of attributes of the mesh: colour attributes, UV maps and others.
    default_uv, default_colour
        The UV map and the colour attribute that are active for rendering.
    generated, local, normals
        Generated coordinates; coordinates and normals in the object's own space.
    shading_normals
        Normals as they are smoothed.
    properties
        Names of properties of the object, read by Attribute nodes.
    instanced
        Names of attributes of instances.
    placed
        They depend on where the object is, or which one it is: not all instances of a mesh look alike.
    sided
        They tell the front from the back.
    animated
        They depend on the frame: movies and image sequences.
    unknown
        What they read that no bake knows, for people.
    averaged
        Kinds of nodes whose value depends on the direction of light.
    paths
        Outputs of Light Path nodes that are not the same for all light.
    missing
        Names of images that cannot be read, "(none)" for nodes without one.
    undefined
        Nodes of types that this Blender does not know.
    """

    attributes: set[str] = field(default_factory=set)
    default_uv: bool = False
    default_colour: bool = False
    generated: bool = False
    local: bool = False
    normals: bool = False
    shading_normals: bool = False
    properties: set[str] = field(default_factory=set)
    instanced: set[str] = field(default_factory=set)
    placed: bool = False
    sided: bool = False
    animated: bool = False
    unknown: set[str] = field(default_factory=set)
    averaged: set[str] = field(default_factory=set)
    paths: set[str] = field(default_factory=set)
    missing: set[str] = field(default_factory=set)
    undefined: set[str] = field(default_factory=set)

    def add(self, output: Output) -> None:
        """Note what one node's output reads."""
        node, name = output.node, "" if output.socket is None else output.socket.name
        match node.type:
            case "TEX_COORD":
                self._coordinates(node, name)
            case "UVMAP":
                self.add_uv(str(node.uv_map))
            case "VERTEX_COLOR":
                self._colour(str(node.layer_name))
            case "ATTRIBUTE":
                self._attribute(node)
            case "NEW_GEOMETRY":
                self._geometry(name)
            case "OBJECT_INFO":
                self.placed = True
            case "TEX_IMAGE" if not node.inputs["Vector"].is_linked:
                self.default_uv = True
            case "TEX_ENVIRONMENT" if not node.inputs["Vector"].is_linked:
                self.placed = True
            case kind if kind in READS_GENERATED and not _linked(node, "Vector"):
                self.generated = True
            case kind if kind in _TURNS:
                self.placed = self.shading_normals = True
                self.add_uv(str(getattr(node, "uv_map", "")))
            case "LIGHT_PATH" if name in DIFFERS_BY_PATH:
                self.paths.add(name)
            case "FRESNEL" | "LAYER_WEIGHT":
                self.averaged.add(output.label)
            case kind if kind in _UNKNOWABLE:
                self.unknown.add(_UNKNOWABLE[kind])
            case _ if is_undefined(node):
                self.undefined.add(str(node.name))
        if node.type in ("TEX_IMAGE", "TEX_ENVIRONMENT"):
            self._image(node.image)

    def _image(self, image: bpy.types.Image | None) -> None:
        if image is None:
            self.missing.add("(none)")
        elif image.source in ("MOVIE", "SEQUENCE"):
            self.animated = True
        elif is_missing(image):
            self.missing.add(str(image.name))

    def _coordinates(self, node: bpy.types.Node, name: str) -> None:
        match name:
            case "Generated":
                self.generated = True
            case "UV":
                self.default_uv = True
            case "Object" if node.object is None:
                self.local = True
            case "Object":
                self.placed = True
            case "Normal":
                self.normals = self.shading_normals = True
            case view if view in _VIEW_OUTPUTS:
                self.unknown.add("the direction of view")

    def _geometry(self, name: str) -> None:
        if name == "Backfacing":
            self.sided = True
        elif name == "Incoming":
            self.unknown.add("the direction of view")
        elif name in ("Position", "Normal", "True Normal", "Tangent"):
            self.placed = self.shading_normals = True

    def _attribute(self, node: bpy.types.Node) -> None:
        name = str(node.attribute_name)
        if node.attribute_type == "GEOMETRY":
            self.attributes.add(name)
        elif node.attribute_type == "OBJECT":
            self.properties.add(name)
            self.placed = True
        elif node.attribute_type == "INSTANCER":
            self.instanced.add(name)
            self.placed = True
        else:
            self.unknown.add(f"attribute '{name}' of {node.attribute_type.lower().replace('_', ' ')}s")

    def add_uv(self, name: str) -> None:
        """Note that a UV map is read, "" the one that is active for rendering."""
        if name:
            self.attributes.add(name)
        else:
            self.default_uv = True

    def _colour(self, name: str) -> None:
        if name:
            self.attributes.add(name)
        else:
            self.default_colour = True

    def update(self, other: Needs) -> None:
        """Add what others read."""
        for name, value in vars(other).items():
            setattr(self, name, getattr(self, name) | value)


def network_needs(entry: Input) -> Needs:
    """Return what the network reads that an input shows."""
    needs = Needs()
    for output in upstream(entry):
        needs.add(output)
    return needs


def upstream(entry: Input) -> Iterator[Output]:
    """Go through all outputs that an input depends on, each once."""
    seen = set()
    waiting = [entry]
    while waiting:
        _, output = follow(waiting.pop())
        if output is None:
            continue
        groups = tuple(group.as_pointer() for group in output.groups)
        key = (output.node.as_pointer(), output.socket.identifier, groups)
        if key not in seen:
            seen.add(key)
            yield output
            waiting += [Input(socket, output.groups) for socket in output.node.inputs if socket.is_linked]


def is_undefined(node: bpy.types.Node) -> bool:
    """Tell whether this Blender does not know a node's type."""
    return bool(node.bl_idname == "NodeUndefined" or node.type in ("", "CUSTOM"))


def is_missing(image: bpy.types.Image) -> bool:
    """Tell whether an image's file is not there."""
    if image.source != "FILE" or image.packed_file is not None or image.is_dirty:
        return False
    return not Path(bpy.path.abspath(image.filepath, library=image.library)).is_file()


def _linked(node: bpy.types.Node, name: str) -> bool:
    return name in node.inputs and bool(node.inputs[name].is_linked)
