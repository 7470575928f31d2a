# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader trees for the tests of the export, and what a material built of one is exported as."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np

from ivg_addon.core.scene import Scene
from tests.blender.export_scenes import Build, add_object, empty_scene, new_material, quads_with_uvs, viewport_scene

Node = bpy.types.Node
Tree = bpy.types.NodeTree
Maker = Callable[[Tree], bpy.types.NodeSocket]

RED = (0.8, 0.1, 0.05)
BLUE = (0.1, 0.2, 0.7)


def shader(kind: str, **inputs: object) -> Maker:
    """Return a maker of a shader node; inputs are named with underscores, colours without alpha."""

    def make(tree: Tree) -> bpy.types.NodeSocket:
        node = tree.nodes.new(f"ShaderNode{kind}")
        for name, value in inputs.items():
            socket = node.inputs[name.replace("_", " ")]
            if callable(value):
                tree.links.new(value(tree), socket)
            else:
                socket.default_value = (*value, 1.0) if isinstance(value, tuple) else value
        return node.outputs[0]

    return make


def diffuse(colour: tuple[float, ...] | Maker) -> Build:
    return surface(shader("BsdfDiffuse", Color=colour, Roughness=0.0))


def pair(kind: str, first: Maker, second: Maker, factor: float | Maker | None = None) -> Maker:
    def make(tree: Tree) -> bpy.types.NodeSocket:
        node = tree.nodes.new(f"ShaderNode{kind}")
        shaders = [socket for socket in node.inputs if socket.type == "SHADER"]
        tree.links.new(first(tree), shaders[0])
        tree.links.new(second(tree), shaders[1])
        if callable(factor):
            tree.links.new(factor(tree), node.inputs[0])
        elif factor is not None:
            node.inputs[0].default_value = factor
        return node.outputs[0]

    return make


def surface(make: Maker) -> Build:
    def build(tree: Tree, output: Node) -> None:
        tree.links.new(make(tree), output.inputs["Surface"])

    return build


def export(build: Build) -> Scene:
    """Export one object with a material named "Tested"."""
    empty_scene()
    mesh = quads_with_uvs(np.zeros((1, 2)))
    mesh.materials.append(new_material("Tested", build))
    add_object("Quads", mesh)
    return viewport_scene()


def values(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    index = scene.materials.names.index("Tested")
    return scene.materials.albedo[index], scene.materials.emission[index]


def said(scene: Scene) -> list[str]:
    return [f"{notice.kind}: {notice.message}" for notice in scene.notices if notice.subject == "material 'Tested'"]


def expect(build: Build, albedo: object, emission: object = 0.0, notices: list[str] | None = None) -> None:
    scene = export(build)
    got = values(scene)
    np.testing.assert_allclose(got[0], np.broadcast_to(albedo, 3), rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(got[1], np.broadcast_to(emission, 3), rtol=1e-6, atol=1e-7)
    assert said(scene) == (notices or [])
