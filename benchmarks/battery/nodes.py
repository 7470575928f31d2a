# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader trees in one expression: `node("BsdfDiffuse", Color=node("TexNoise", Scale=3.0))`."""

from __future__ import annotations

from collections.abc import Callable

import bpy

Tree = bpy.types.NodeTree
Maker = Callable[[Tree], bpy.types.NodeSocket]
"""Adds nodes to a tree and returns the socket that they end in."""
Colour = tuple[float, float, float]
Value = float | Colour | Maker


def node(kind: str, output: str | int = 0, settings: dict[str, object] | None = None, **inputs: Value) -> Maker:
    """Return a maker of a shader node, without "ShaderNode".

    Parameters
    ----------
    output
        Which of its outputs: number or identifier.
    settings
        Properties of the node.
    inputs
        By identifier, spaces as underscores: a value, or what makes the socket that is linked. Colours and vectors
        are of three numbers.
    """

    def make(tree: Tree) -> bpy.types.NodeSocket:
        made = tree.nodes.new(f"ShaderNode{kind}")
        for name, value in (settings or {}).items():
            setattr(made, name, value)
        for name, value in inputs.items():
            (socket,) = (s for s in made.inputs if s.identifier in {name, name.replace("_", " ")})
            if callable(value):
                tree.links.new(value(tree), socket)
            else:
                socket.default_value = (*value, 1.0) if socket.type == "RGBA" else value
        return next(s for i, s in enumerate(made.outputs) if output in {i, s.identifier})

    return make


def mix(factor: Value, first: Maker, second: Maker) -> Maker:
    """Return a Mix Shader: `second` at factor one."""
    return node("MixShader", Fac=factor, Shader=first, Shader_001=second)


def add(first: Maker, second: Maker) -> Maker:
    """Return an Add Shader."""
    return node("AddShader", Shader=first, Shader_001=second)


def ramp(factor: Maker, *stops: tuple[float, Colour]) -> Maker:
    """Return a Colour Ramp of two stops."""

    def make(tree: Tree) -> bpy.types.NodeSocket:
        made = tree.nodes.new("ShaderNodeValToRGB")
        for element, (position, colour) in zip(made.color_ramp.elements, stops, strict=True):
            element.position, element.color = position, (*colour, 1.0)
        tree.links.new(factor(tree), made.inputs["Fac"])
        return made.outputs["Color"]

    return make


def diffuse(colour: Colour | Maker, roughness: float = 0.0) -> Maker:
    """Return a Diffuse BSDF."""
    return node("BsdfDiffuse", Color=colour, Roughness=roughness)


def emission(colour: Colour | Maker, strength: Value = 1.0) -> Maker:
    """Return an Emission shader."""
    return node("Emission", Color=colour, Strength=strength)


def material(name: str, surface: Maker) -> bpy.types.Material:
    """Return a material of one surface."""
    made = bpy.data.materials.new(name)
    _end(made.node_tree, surface, "ShaderNodeOutputMaterial")
    return made


def set_world(name: str, surface: Maker) -> bpy.types.World:
    """Give the scene a world."""
    made = bpy.data.worlds.new(name)
    # Cycles' own choice takes it seconds; how fine its map of the world is only changes its noise.
    made.cycles.sampling_method, made.cycles.sample_map_resolution = "MANUAL", 256
    _end(made.node_tree, surface, "ShaderNodeOutputWorld")
    bpy.context.scene.world = made
    return made


def set_light_nodes(light: bpy.types.Light, surface: Maker) -> None:
    """Give a light a node tree."""
    if not light.bl_rna.properties["use_nodes"].is_deprecated:
        light.use_nodes = True
    _end(light.node_tree, surface, "ShaderNodeOutputLight")


def _end(tree: Tree, surface: Maker, kind: str) -> None:
    tree.nodes.clear()
    tree.links.new(surface(tree), tree.nodes.new(kind).inputs["Surface"])
