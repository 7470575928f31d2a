# SPDX-License-Identifier: GPL-3.0-or-later
"""Networks of nodes: what the export has evaluated is what Cycles says of the material itself."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from tests.blender.evaluation_scenes import (
    WITHIN,
    check,
    cycles_on_triangles_of,
    evaluated_scene,
    exported,
    hills,
    node_output,
    noise,
    soft_image,
    through,
)
from tests.blender.export_scenes import empty_scene, new_material
from tests.blender.export_trees import BLUE, RED, Maker, Tree, diffuse, pair, shader, surface


def ramp(source: Maker) -> Maker:
    def make(tree: Tree) -> bpy.types.NodeSocket:
        node = tree.nodes.new("ShaderNodeValToRGB")
        stops = node.color_ramp.elements
        stops[0].color, stops[1].color = (*RED, 1), (*BLUE, 1)
        tree.links.new(source(tree), node.inputs["Fac"])
        return node.outputs["Color"]

    return make


def in_groups(content: Maker, depth: int) -> Maker:
    """Return a maker of a colour that is computed inside of groups in groups."""

    def make(tree: Tree) -> bpy.types.NodeSocket:
        group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
        group.interface.new_socket("Result", in_out="OUTPUT", socket_type="NodeSocketColor")
        inner = in_groups(content, depth - 1) if depth > 1 else content
        group.links.new(inner(group), group.nodes.new("NodeGroupOutput").inputs[0])
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = group
        return node.outputs[0]

    return make


NETWORKS = {
    "noise on generated": noise("Generated"),
    "noise, nothing linked": shader("TexNoise", Scale=1.5, Detail=0.0),
    "noise on object": noise("Object"),
    "noise on UV": noise("UV"),
    "noise on position": noise(node_output("NewGeometry", "Position")),
    "noise on normals": noise("Normal"),
    "noise on world normals": noise(node_output("NewGeometry", "Normal")),
    "second UV map": noise(node_output("UVMap", "UV", uv_map="Second")),
    "two UV maps": lambda tree: _both(tree, soft_image(), soft_image(node_output("UVMap", "UV", uv_map="Second"))),
    "colour attribute": node_output("VertexColor", "Color", layer_name="Painted"),
    "active colour attribute": node_output("VertexColor", "Color"),
    "alpha of an attribute": node_output("VertexColor", "Alpha", layer_name="Painted"),
    "attribute": node_output("Attribute", "Fac", attribute_name="Number"),
    "mapped image": soft_image(through("Mapping", "Vector", node_output("TexCoord", "UV"), Scale=(2, 1, 1))),
    "image on generated": soft_image(node_output("TexCoord", "Generated")),
    "box projection": soft_image(node_output("TexCoord", "Object")),
    "ramp": ramp(noise("Object")),
    "gradient": through("TexGradient", "Vector", node_output("TexCoord", "Generated"), "Color"),
    "hue and saturation": through("HueSaturation", "Color", noise("UV"), Hue=0.7),
    "in groups": in_groups(noise("Object"), 3),
    "object info": node_output("ObjectInfo", "Color"),
    "random of objects": through("ValToRGB", "Fac", node_output("ObjectInfo", "Random"), "Color"),
    "property of objects": node_output("Attribute", "Color", attribute_name="tint", attribute_type="OBJECT"),
}


def _both(tree: Tree, first: Maker, second: Maker) -> bpy.types.NodeSocket:
    node = tree.nodes.new("ShaderNodeMixRGB")
    node.inputs["Fac"].default_value = 0.5
    tree.links.new(first(tree), node.inputs["Color1"])
    tree.links.new(second(tree), node.inputs["Color2"])
    return node.outputs[0]


@pytest.mark.parametrize("name", NETWORKS)
def test_diffuse_colours_are_what_cycles_says(name: str) -> None:
    empty_scene()
    made = hills(new_material("Tested", diffuse(NETWORKS[name])))
    scene = evaluated_scene()
    assert scene.notices == ()
    assert scene.surfaces.evaluated == 1
    for shown in made:
        check(scene, shown, "albedo", "DIFFUSE")


def test_emission_is_what_cycles_says_over_orders_of_magnitude() -> None:
    def power(tree: Tree) -> bpy.types.NodeSocket:
        node = tree.nodes.new("ShaderNodeMath")
        node.operation = "POWER"
        node.inputs[0].default_value = 10.0
        tree.links.new(
            through("Math", 0, node_output("Attribute", "Fac", attribute_name="Number"))(tree), node.inputs[1]
        )
        return node.outputs[0]

    empty_scene()
    made = hills(new_material("Tested", surface(shader("Emission", Color=noise("UV"), Strength=power))))
    scene = evaluated_scene()
    for shown in made:
        check(scene, shown, "emission", "EMIT")


def test_image_on_a_uv_map_is_read_directly() -> None:
    empty_scene()
    hills(new_material("Tested", surface(shader("BsdfPrincipled", Base_Color=soft_image()))))
    scene = evaluated_scene()
    assert scene.surfaces.direct == 1
    assert scene.surfaces.evaluated == 0
    assert scene.textures[0].interpolate


def test_shaders_mixed_by_a_mask() -> None:
    red, blue = (shader("BsdfDiffuse", Color=colour, Roughness=0.0) for colour in (RED, BLUE))
    light = shader("Emission", Color=RED, Strength=2.0)
    mask = node_output("Attribute", "Fac", attribute_name="Number")
    empty_scene()
    made = hills(new_material("Tested", surface(pair("MixShader", red, pair("AddShader", blue, light), mask))))
    scene = evaluated_scene()
    for shown in made:
        check(scene, shown, "emission", "EMIT")
    here = scene.geometry.object == scene.objects.index("One")
    number = cycles_on_triangles_of(diffuse(mask), made[0], "DIFFUSE")
    truth = (1 - number) * np.array(RED) + number * np.array(BLUE)
    assert np.abs(exported(scene, "albedo", here) - truth).max() < WITHIN * truth.max()
