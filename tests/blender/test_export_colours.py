# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of materials: constants, images on UV maps, and the best constant for all else."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
import pytest

from ivg_addon.core.scene import NO_TEXTURE
from tests.blender.export_scenes import (
    add_object,
    bake_diffuse_colour,
    cube_mesh,
    empty_scene,
    exported_albedo,
    new_material,
    quads_with_uvs,
    viewport_scene,
)
from tests.blender.export_trees import (
    RED,
    Maker,
    Node,
    Tree,
    diffuse,
    expect,
    export,
    pair,
    said,
    shader,
    surface,
)


def test_without_evaluation_a_network_is_replaced_by_the_sockets_own_value() -> None:
    """The viewport's evaluation has nothing better; a bake asks Cycles."""
    noise = shader("TexNoise")
    expect(diffuse(noise), 0.8, notices=["simplified: Color: its own value (0.8, 0.8, 0.8) taken instead of its nodes"])


def test_constants_may_come_from_nodes() -> None:
    def rgb(tree: Tree) -> bpy.types.NodeSocket:
        node = tree.nodes.new("ShaderNodeRGB")
        node.outputs[0].default_value = (*RED, 1)
        return node.outputs[0]

    def value(tree: Tree) -> bpy.types.NodeSocket:
        node = tree.nodes.new("ShaderNodeValue")
        node.outputs[0].default_value = 3.0
        return node.outputs[0]

    expect(surface(shader("Emission", Color=rgb, Strength=value)), 0, np.multiply(3, RED))


def test_a_colour_in_place_of_a_shader_shines() -> None:
    def rgb(tree: Tree) -> bpy.types.NodeSocket:
        node = tree.nodes.new("ShaderNodeRGB")
        node.outputs[0].default_value = (*RED, 1)
        return node.outputs[0]

    expect(surface(rgb), 0, RED)


def picture(name: str = "Picture") -> bpy.types.Image:
    image = bpy.data.images.new(name, 4, 4, alpha=False)
    pixels = np.random.default_rng(2).random((16, 4), dtype=np.float32)
    pixels[:, 3] = 1
    image.pixels.foreach_set(pixels.ravel())
    return image


def textured(connect: Callable[[Tree, Node], None] = lambda tree, node: None) -> Maker:
    def make(tree: Tree) -> bpy.types.NodeSocket:
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = picture()
        connect(tree, node)
        return node.outputs["Color"]

    return make


def uv_from(kind: str, output: str, **values: str) -> Callable[[Tree, Node], None]:
    def connect(tree: Tree, node: Node) -> None:
        source = tree.nodes.new(f"ShaderNode{kind}")
        for key, value in values.items():
            setattr(source, key, value)
        tree.links.new(source.outputs[output], node.inputs["Vector"])

    return connect


@pytest.mark.parametrize(
    ("connect", "uses_second"),
    [
        (lambda tree, node: None, False),
        (uv_from("TexCoord", "UV"), False),
        (uv_from("UVMap", "UV"), False),
        (uv_from("UVMap", "UV", uv_map="Second"), True),
        (uv_from("Attribute", "Vector", attribute_name="Second"), True),
    ],
)
def test_uv_maps(connect: Callable[[Tree, Node], None], uses_second: bool) -> None:
    empty_scene()
    rng = np.random.default_rng(8)
    first, second = rng.random((2, 30, 2)).astype(np.float32)
    mesh = quads_with_uvs(first, "First")
    mesh.uv_layers.new(name="Second").uv.foreach_set("vector", np.repeat(second, 4, axis=0).ravel())
    mesh.uv_layers.active = mesh.uv_layers["Second"]  # what is edited; what renders stays the first
    build = diffuse(textured(connect))
    mesh.materials.append(new_material("Tested", build))
    shown = add_object("Quads", mesh)
    scene = viewport_scene()
    np.testing.assert_array_equal(scene.geometry.uvs[::2, 0], second if uses_second else first)
    np.testing.assert_allclose(exported_albedo(scene)[::2], bake_diffuse_colour(shown)[::4], atol=2e-5)
    assert said(scene) == []


def test_each_material_reads_its_own_uv_map() -> None:
    empty_scene()
    first, second = np.random.default_rng(8).random((2, 2, 2)).astype(np.float32)
    mesh = quads_with_uvs(first, "First")
    mesh.uv_layers.new(name="Second").uv.foreach_set("vector", np.repeat(second, 4, axis=0).ravel())
    for name in ("First", "Second"):
        image = textured(uv_from("UVMap", "UV", uv_map=name))
        mesh.materials.append(new_material(name, diffuse(image)))
    mesh.polygons[1].material_index = 1
    add_object("Quads", mesh)
    np.testing.assert_array_equal(viewport_scene().geometry.uvs[::2, 0], [first[0], second[1]])


def test_object_without_the_uv_map_reads_the_corner_texel_as_in_cycles() -> None:
    empty_scene()
    mesh = cube_mesh()
    mesh.materials.append(new_material("Tested", diffuse(textured())))
    shown = add_object("Cube", mesh)
    scene = viewport_scene()
    assert "warning: object 'Cube': has no UV map: its texture's corner texel is taken" in map(str, scene.notices)
    np.testing.assert_allclose(exported_albedo(scene)[::2], bake_diffuse_colour(shown)[::4], atol=2e-5)


def test_two_images_become_their_means_without_evaluation() -> None:
    one, other = (shader("BsdfDiffuse", Color=textured(), Roughness=0.0) for _ in range(2))
    scene = export(surface(pair("MixShader", one, other, 0.5)))
    assert scene.materials.texture[0] == NO_TEXTURE
    stored = np.empty(64, dtype=np.float32)
    bpy.data.images["Picture"].pixels.foreach_get(stored)
    linear = np.where(stored <= 0.04045, stored / 12.92, ((stored + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(scene.materials.albedo[0], linear.reshape(-1, 4)[:, :3].mean(axis=0), rtol=1e-5)
    assert said(scene) == [
        "simplified: Color: mean colour of image 'Picture' taken",
        "simplified: Color: mean colour of image 'Picture.001' taken",
    ]


def test_a_constant_share_of_an_image_stays_an_image() -> None:
    empty_scene()
    mesh = quads_with_uvs(np.random.default_rng(8).random((30, 2)))
    image = shader("BsdfDiffuse", Color=textured(), Roughness=0.0)
    black = shader("BsdfDiffuse", Color=(0.0, 0.0, 0.0), Roughness=0.0)
    mesh.materials.append(new_material("Tested", surface(pair("MixShader", black, image, 0.7))))
    shown = add_object("Quads", mesh)
    scene = viewport_scene()
    np.testing.assert_allclose(exported_albedo(scene)[::2], bake_diffuse_colour(shown)[::4], atol=2e-5)
    assert said(scene) == []
