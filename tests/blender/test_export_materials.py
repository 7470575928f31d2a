# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials: what of their closures is taken over exactly, what is not, and that it is said."""

from __future__ import annotations

import bpy
import numpy as np
import pytest

from ivg_addon.core.principled import Layers, diffuse_share, oren_nayar_share
from ivg_addon.core.scene import DIELECTRIC, GLASS, GLOSSY, MATTE, NONE, SCHLICK, TRANSPARENT
from tests.blender.evaluation_scenes import node_output, through
from tests.blender.export_scenes import (
    add_object,
    bake_diffuse_colour,
    cube_mesh,
    empty_scene,
    new_material,
    quads_with_uvs,
    viewport_scene,
)
from tests.blender.export_trees import (
    BLUE,
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
    values,
)

BRIGHT = "reflects more light than it receives: scaled down, or light would grow at each bounce"
NOT_NUMBERS = "has values that are not numbers: taken as 0"


def test_no_material_is_cycles_default() -> None:
    """Cycles' default is a Principled BSDF, whose Color pass is as one of a material that was just made."""
    empty_scene()
    bare, fresh = add_object("Bare", cube_mesh()), add_object("Fresh", cube_mesh(), location=(3, 0, 0))
    fresh.data.materials.append(bpy.data.materials.new("Fresh"))
    scene = viewport_scene()
    assert scene.materials.names == ("(none)", "Fresh")
    np.testing.assert_allclose(scene.materials.albedo[0], 0.8 * 0.93881, atol=1e-4)
    np.testing.assert_allclose(scene.materials.albedo[0], scene.materials.albedo[1], rtol=1e-6)
    np.testing.assert_allclose(bake_diffuse_colour(bare), bake_diffuse_colour(fresh), rtol=1e-6)


def test_empty_slot_is_the_default_too() -> None:
    empty_scene()
    mesh = cube_mesh()
    mesh.materials.append(None)
    mesh.materials.append(new_material("Red", diffuse(RED)))
    mesh.polygons[3].material_index = 1
    add_object("Cube", mesh)
    scene = viewport_scene()
    assert scene.materials.names == ("(none)", "Red")
    np.testing.assert_array_equal(scene.geometry.material, [0] * 6 + [1] * 2 + [0] * 4)


def test_diffuse() -> None:
    expect(diffuse(RED), RED)


def test_rough_diffuse_is_a_lobe_of_its_own() -> None:
    scene = export(surface(shader("BsdfDiffuse", Color=RED, Roughness=0.6)))
    np.testing.assert_allclose(values(scene)[0], RED * oren_nayar_share(np.array(RED), 0.6), rtol=1e-6)
    lobes = scene.materials.lobes
    assert (lobes.kind.tolist(), lobes.roughness.tolist()) == ([MATTE], [pytest.approx(0.6)])
    np.testing.assert_allclose(lobes.color, [RED], rtol=1e-6)
    np.testing.assert_allclose(lobes.second, [RED], rtol=1e-6)
    assert not said(scene)


def test_what_shines_by_facing_shines_towards_those_directions() -> None:
    shining, matt = shader("Emission"), shader("BsdfDiffuse", Roughness=0.0)
    scene = export(surface(pair("MixShader", shining, matt, node_output("LayerWeight", "Facing"))))
    assert said(scene) == []
    np.testing.assert_allclose(values(scene)[1], 2 / 3, rtol=1e-6)  # ∫ (1 − (1 − μ)) 2μ dμ
    view = scene.materials.emission_view
    assert view is not None
    steps = np.linspace(0, 1, view.shape[1])[2:-1, None]  # ends lie beyond the cosines of quadrature
    np.testing.assert_allclose(view[0, 2:-1], np.repeat(1.5 * steps, 3, axis=1), atol=0.01)
    assert scene.materials.lobes.kind.tolist() == [MATTE]


def test_emission() -> None:
    expect(surface(shader("Emission", Color=RED, Strength=3.0)), 0, np.multiply(3, RED))


def test_principled_without_specular_is_exact() -> None:
    build = surface(shader("BsdfPrincipled", Base_Color=RED, Specular_IOR_Level=0.0))
    expect(build, RED)


def test_principled_reflects_what_its_layers_leave() -> None:
    build = surface(
        shader(
            "BsdfPrincipled",
            Base_Color=RED,
            Metallic=0.25,
            Roughness=0.3,
            IOR=1.7,
            Transmission_Weight=0.2,
            Coat_Weight=0.5,
            Emission_Color=BLUE,
            Emission_Strength=2.0,
            Alpha=0.9,
        )
    )
    scene = export(build)
    layers = Layers(metallic=0.25, transmission=0.2, ior=1.7, roughness=0.3, coat=0.5)
    albedo, emission = values(scene)
    np.testing.assert_allclose(albedo, 0.9 * diffuse_share(layers) * RED, rtol=1e-6)
    np.testing.assert_allclose(emission / emission[2], np.divide(BLUE, BLUE[2]), rtol=1e-6)
    assert 0.9 * 2 * 0.9 * BLUE[2] < emission[2] < 0.9 * 2 * BLUE[2], "the coat takes some of it"
    assert said(scene) == []
    kinds = set(zip(scene.materials.lobes.kind.tolist(), scene.materials.lobes.fresnel.tolist(), strict=True))
    assert kinds == {(TRANSPARENT, NONE), (GLOSSY, DIELECTRIC), (MATTE, NONE), (GLOSSY, SCHLICK), (GLASS, DIELECTRIC)}


def test_default_principled_has_a_diffuse_and_a_glossy_lobe() -> None:
    scene = export(surface(shader("BsdfPrincipled", Base_Color=(0.5, 0.5, 0.5))))
    np.testing.assert_allclose(values(scene)[0], 0.46938, atol=5e-5)
    assert said(scene) == []
    lobes = scene.materials.lobes
    assert lobes.kind.tolist() == [MATTE, GLOSSY]
    assert lobes.fresnel.tolist() == [NONE, DIELECTRIC]
    np.testing.assert_allclose(lobes.color[1], [0.04] * 3, rtol=1e-6)
    np.testing.assert_allclose(lobes.second[1], 1.0)
    np.testing.assert_allclose(lobes.roughness[1], 0.5)
    np.testing.assert_allclose(lobes.ior[1], 1.5)


def test_without_reflective_caustics_the_diffuse_lobe_is_whole() -> None:
    empty_scene().cycles.caustics_reflective = False
    mesh = quads_with_uvs(np.zeros((1, 2)))
    mesh.materials.append(new_material("Tested", surface(shader("BsdfPrincipled", Base_Color=RED))))
    add_object("Quads", mesh)
    np.testing.assert_allclose(values(viewport_scene())[0], RED, rtol=1e-6)


def test_sums_with_constant_factors_are_exact() -> None:
    red, blue = (shader("BsdfDiffuse", Color=colour, Roughness=0.0) for colour in (RED, BLUE))
    light = shader("Emission", Color=BLUE, Strength=2.0)
    mixed = pair("MixShader", red, pair("MixShader", blue, light, 0.5), 0.25)
    expect(surface(mixed), 0.75 * np.array(RED) + 0.125 * np.array(BLUE), 0.25 * np.array(BLUE))
    expect(surface(pair("AddShader", red, light)), RED, 2 * np.array(BLUE))


def test_unread_branch_of_a_mix_is_not_complained_about() -> None:
    build = surface(pair("MixShader", shader("BsdfGlossy"), shader("BsdfDiffuse", Color=RED, Roughness=0.0), 1.0))
    expect(build, RED)


def test_hair_reflects_nothing_and_is_named() -> None:
    expect(surface(shader("BsdfHair")), 0, notices=["simplified: without Hair BSDF"])


def test_mix_by_camera_ray_takes_what_light_sees() -> None:
    def is_camera(tree: Tree) -> bpy.types.NodeSocket:
        return tree.nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"]

    seen_by_light = shader("BsdfDiffuse", Color=RED, Roughness=0.0)
    expect(surface(pair("MixShader", seen_by_light, shader("Emission"), is_camera)), RED)


def test_light_passes_through_faces_that_do_nothing() -> None:
    empty_scene()
    mesh = cube_mesh()
    mesh.materials.append(None)
    mesh.materials.append(new_material("Tested", surface(shader("BsdfTransparent"))))
    mesh.polygons[0].material_index = 1
    add_object("Cube", mesh)
    scene = viewport_scene()
    assert scene.geometry.triangle_count == 10
    assert said(scene) == []


def test_volume_domain_does_not_block_light() -> None:
    def fog(tree: Tree, output: Node) -> None:
        tree.links.new(tree.nodes.new("ShaderNodeVolumeScatter").outputs[0], output.inputs["Volume"])

    empty_scene()
    add_object("Wall", cube_mesh())
    domain = cube_mesh("Domain", size=9.0)
    domain.materials.append(new_material("Tested", fog))
    add_object("Domain", domain)
    scene = viewport_scene()
    assert scene.objects == ("Wall",)
    assert said(scene) == ["simplified: without volume"]


def test_what_tilts_no_normal_is_read_directly() -> None:
    def build(tree: Tree, output: Node) -> None:
        bump = shader("Bump", Normal=node_output("NormalMap", "Normal"))
        surface(shader("BsdfDiffuse", Color=RED, Roughness=0.0, Normal=bump))(tree, output)
        tree.links.new(tree.nodes.new("ShaderNodeDisplacement").outputs[0], output.inputs["Displacement"])

    expect(build, RED)


def test_a_normal_map_in_object_space_is_named() -> None:
    tilted = through("NormalMap", "Color", node_output("RGB", "Color"), "Normal", space="OBJECT")
    scene = export(surface(shader("BsdfDiffuse", Color=RED, Roughness=0.0, Normal=tilted)))
    assert "simplified: Normal: a map in object space is read as if objects were not turned" in said(scene)


def test_no_output_node() -> None:
    def build(tree: Tree, output: Node) -> None:
        tree.nodes.remove(output)

    expect(build, 0, notices=["warning: has no material output: black"])


def test_impossible_reflectance_is_scaled_and_named() -> None:
    scene = export(diffuse((1.5, 0.5, 0.25)))
    np.testing.assert_allclose(values(scene)[0], (1, 0.5, 0.25))
    assert said(scene) == [f"warning: {BRIGHT}"]


def test_lobes_that_reflect_too_much_together_are_scaled_together() -> None:
    one = shader("BsdfDiffuse", Color=(0.9, 0.9, 0.3), Roughness=0.0)
    other = shader("BsdfTranslucent", Color=(0.9, 0.3, 0.3))
    scene = export(surface(pair("AddShader", one, other)))
    np.testing.assert_allclose(values(scene)[0], (0.5, 0.75, 0.3), rtol=1e-6)
    np.testing.assert_allclose(scene.materials.lobes.color[0], (0.5, 0.25, 0.3), rtol=1e-6)
    assert said(scene) == [f"warning: {BRIGHT}"]


def test_an_albedo_of_one_is_no_reason_for_a_word() -> None:
    expect(diffuse((1.0, 1.0, 1.0)), 1)
    assert said(export(surface(shader("BsdfPrincipled", Base_Color=(1.0, 1.0, 1.0))))) == []
    assert said(export(surface(shader("BsdfGlass", Color=(1.0, 1.0, 1.0))))) == []


def test_values_that_are_not_numbers_are_none() -> None:
    nan = float("nan")
    expect(diffuse((nan, 0.5, 0.5)), (0, 0.5, 0.5), notices=[f"warning: {NOT_NUMBERS}"])
    expect(surface(shader("Emission", Strength=nan)), 0, notices=[f"warning: {NOT_NUMBERS}"])
    expect(surface(shader("Emission", Strength=-1.0)), 0, notices=["warning: has negative values: taken as 0"])


def test_material_override_of_the_view_layer() -> None:
    empty_scene()
    add_object("Cube", cube_mesh())
    red = new_material("Red", diffuse(RED))
    bpy.context.view_layer.material_override = red
    np.testing.assert_allclose(viewport_scene().materials.albedo, [RED])


def test_object_linked_slots_differ_between_objects_that_share_a_mesh() -> None:
    empty_scene()
    mesh = cube_mesh()
    mesh.materials.append(new_material("Red", diffuse(RED)))
    add_object("One", mesh)
    two = add_object("Two", mesh, location=(3, 0, 0))
    two.material_slots[0].link = "OBJECT"
    two.material_slots[0].material = new_material("Blue", diffuse(BLUE))
    scene = viewport_scene()
    for name, colour in (("One", RED), ("Two", BLUE)):
        here = scene.geometry.object == scene.objects.index(name)
        np.testing.assert_allclose(scene.materials.albedo[scene.geometry.material[here]], [colour] * 12)


def in_group(content: Maker, *, to: str, value: tuple[float, ...] | None = None) -> Maker:
    """Return a maker of a group around a shader; its one input leads, over a reroute, to the shader's input `to`.

    The node of the group is made with `value` for that input.
    """

    def make(tree: Tree) -> bpy.types.NodeSocket:
        group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
        group.interface.new_socket("Unused", in_out="INPUT", socket_type="NodeSocketColor")
        group.interface.new_socket("Paint", in_out="INPUT", socket_type="NodeSocketColor")
        group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
        begin, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
        made = content(group)
        reroute = group.nodes.new("NodeReroute")
        group.links.new(begin.outputs["Paint"], reroute.inputs[0])
        group.links.new(reroute.outputs[0], made.node.inputs[to])
        group.links.new(made, end.inputs[0])
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = group
        if value is not None:
            node.inputs["Paint"].default_value = (*value, 1)
        return node.outputs[0]

    return make


def test_groups_and_reroutes_are_looked_through() -> None:
    paint = shader("BsdfDiffuse", Roughness=0.0)
    expect(surface(in_group(paint, to="Color", value=RED)), RED)


def test_groups_in_groups_are_looked_through() -> None:
    inner = in_group(shader("BsdfDiffuse", Roughness=0.0), to="Color", value=BLUE)
    expect(surface(in_group(inner, to="Paint", value=RED)), RED)


def test_empty_group_is_black() -> None:
    def make(tree: Tree) -> bpy.types.NodeSocket:
        node = tree.nodes.new("ShaderNodeGroup")
        node.node_tree = bpy.data.node_groups.new("Group", "ShaderNodeTree")
        node.node_tree.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
        return node.outputs[0]

    expect(surface(make), 0)


def test_muted_nodes_are_bypassed() -> None:
    def build(tree: Tree, output: Node) -> None:
        mix = pair("MixShader", shader("BsdfDiffuse", Color=RED, Roughness=0.0), shader("BsdfGlossy"), 0.5)(tree)
        mix.node.mute = True
        tree.links.new(mix, output.inputs["Surface"])

    expect(build, RED)
