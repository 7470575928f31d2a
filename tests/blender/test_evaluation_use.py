# SPDX-License-Identifier: GPL-3.0-or-later
"""How materials are evaluated: each content once, without a trace in the file, and whatever is wrong with them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest

from ivg_addon.blender import evaluation_cache
from ivg_addon.blender.export import export_render_steps
from ivg_addon.core.checksum import checksum
from ivg_addon.core.errors import SceneError
from ivg_addon.core.scene import (
    DIELECTRIC,
    GLOSSY,
    MATTE,
    NO_TEXTURE,
    NONE,
    SCHLICK,
    TRANSPARENT,
    SurfaceRecord,
)
from tests.blender.evaluation_scenes import (
    WITHIN,
    cycles_on_triangles_of,
    datablocks,
    evaluated_scene,
    exported,
    exported_texture,
    hills,
    node_output,
    noise,
    soft_image,
    through,
)
from tests.blender.export_scenes import Build, add_object, cube_mesh, empty_scene, new_material
from tests.blender.export_trees import BLUE, RED, Tree, diffuse, pair, said, shader, surface

NUMBER = node_output("Attribute", "Fac", attribute_name="Number")


def show(build: Build) -> bpy.types.Object:
    """Start anew, with hills of a material named "Tested"; return the first."""
    empty_scene()
    return hills(new_material("Tested", build))[0]


def numbers(shown: bpy.types.Object) -> np.ndarray:
    """Return what Cycles says of `NUMBER` on an object's triangles, (triangles, 3)."""
    return cycles_on_triangles_of(surface(shader("Emission", Color=NUMBER)), shown, "EMIT")


def test_a_metallic_mask_becomes_textured_lobes() -> None:
    shown = show(surface(shader("BsdfPrincipled", Base_Color=RED, Metallic=NUMBER, Roughness=0.3)))
    scene = evaluated_scene()
    lobes = scene.materials.lobes
    assert sorted(zip(lobes.kind.tolist(), lobes.fresnel.tolist(), strict=True)) == [
        (GLOSSY, SCHLICK),
        (GLOSSY, DIELECTRIC),
        (MATTE, NONE),
    ]
    number = numbers(shown)
    metal = int(np.flatnonzero(lobes.fresnel == SCHLICK)[0])
    np.testing.assert_allclose(exported_texture(scene, lobes.color_texture[metal], "One"), number * RED, atol=WITHIN)
    np.testing.assert_allclose(exported_texture(scene, lobes.second_texture[metal], "One"), number, atol=WITHIN)
    plain = int(np.flatnonzero(lobes.fresnel == DIELECTRIC)[0])
    np.testing.assert_allclose(
        exported_texture(scene, lobes.color_texture[plain], "One"), 0.04 * (1 - number), atol=WITHIN
    )
    np.testing.assert_allclose(lobes.roughness[[metal, plain]], 0.3)


def test_roughness_may_be_a_network() -> None:
    shown = show(surface(shader("BsdfGlossy", Color=RED, Roughness=NUMBER)))
    scene = evaluated_scene()
    lobes = scene.materials.lobes
    assert lobes.color_texture[0] == NO_TEXTURE
    np.testing.assert_allclose(lobes.color[0], RED, rtol=1e-6)
    np.testing.assert_allclose(exported_texture(scene, lobes.roughness_texture[0], "One"), numbers(shown), atol=WITHIN)


def test_alpha_lets_light_through_where_the_image_says() -> None:
    shown = show(surface(shader("BsdfPrincipled", Base_Color=RED, Specular_IOR_Level=0.0, Alpha=NUMBER)))
    scene = evaluated_scene()
    lobes = scene.materials.lobes
    assert lobes.kind.tolist() == [TRANSPARENT]
    number = numbers(shown)
    np.testing.assert_allclose(exported_texture(scene, lobes.color_texture[0], "One"), 1 - number, atol=WITHIN)
    here = scene.geometry.object == scene.objects.index("One")
    np.testing.assert_allclose(exported(scene, "albedo", here), number * RED, atol=WITHIN)


def test_colours_by_the_direction_of_view_are_known_by_direction() -> None:
    show(diffuse(through("ValToRGB", "Fac", node_output("LayerWeight", "Facing"), "Color")))
    scene = evaluated_scene()
    np.testing.assert_allclose(exported(scene, "albedo"), 1 - 2 / 3, atol=2e-3)  # ∫ (1 − μ) 2μ dμ
    view = scene.materials.lobes.view
    assert view is not None
    steps = np.linspace(0, 1, view.shape[1])[:, None]
    np.testing.assert_allclose(view[0], np.repeat((1 - steps) * 3, 3, axis=1), atol=0.02)
    assert said(scene) == []


def test_what_is_linked_to_the_direction_of_view_is_named() -> None:
    weight = through("LayerWeight", "Blend", NUMBER, "Facing")
    show(diffuse(through("ValToRGB", "Fac", weight, "Color")))
    assert said(evaluated_scene()) == ["simplified: Layer Weight node: what is linked to its Blend is ignored"]


def test_other_numbers_by_the_direction_of_view_are_averaged_and_named() -> None:
    facing = through("Math", 0, node_output("LayerWeight", "Facing"), operation="ADD")
    show(surface(shader("BsdfGlossy", Roughness=facing)))
    scene = evaluated_scene()
    np.testing.assert_allclose(scene.materials.lobes.roughness, 0.5 + 1 / 3, atol=1e-5)
    assert said(scene) == ["simplified: Roughness: Layer Weight node replaced by its mean over directions"]


@pytest.mark.parametrize("way", ["mix", "network"])
def test_the_back_may_be_another_material(way: str) -> None:
    backfacing = node_output("NewGeometry", "Backfacing")
    if way == "mix":
        red, blue = (shader("BsdfDiffuse", Color=colour, Roughness=0.0) for colour in (RED, BLUE))
        build = surface(pair("MixShader", red, blue, backfacing))
    else:

        def colour(tree: Tree) -> bpy.types.NodeSocket:
            node = tree.nodes.new("ShaderNodeMixRGB")
            node.inputs["Color1"].default_value, node.inputs["Color2"].default_value = (*RED, 1), (*BLUE, 1)
            tree.links.new(backfacing(tree), node.inputs["Fac"])
            return node.outputs[0]

        build = diffuse(colour)
    show(build)
    scene = evaluated_scene()
    materials = scene.materials
    assert materials.back is not None
    back = int(materials.back[0])
    assert back != 0
    np.testing.assert_allclose(materials.albedo[[0, back]], [RED, BLUE], atol=1e-5)
    assert set(scene.geometry.material.tolist()) == {0}


def test_without_backfacing_there_is_one_side() -> None:
    show(diffuse(noise()))
    materials = evaluated_scene().materials
    assert materials.back is not None
    assert materials.back.tolist() == [0]


def test_unchanged_materials_are_not_evaluated_twice() -> None:
    show(diffuse(noise()))
    first = evaluated_scene()
    again = evaluated_scene()
    assert (first.surfaces.evaluated, again.surfaces.evaluated, again.surfaces.recalled) == (1, 0, 1)
    np.testing.assert_array_equal(first.textures[0].pixels, again.textures[0].pixels)
    np.testing.assert_array_equal(first.geometry.uvs, again.geometry.uvs)
    evaluation_cache.forget()
    later = evaluated_scene()
    assert later.surfaces.recalled == 1, "another session finds it in the user's folder"
    np.testing.assert_array_equal(first.textures[0].pixels, later.textures[0].pixels)


def change_a_value(tested: bpy.types.Material) -> None:
    node = next(node for node in tested.node_tree.nodes if node.type == "TEX_NOISE")
    node.inputs["Scale"].default_value += 1.0


def change_a_setting(tested: bpy.types.Material) -> None:
    next(node for node in tested.node_tree.nodes if node.type == "TEX_NOISE").normalize = False


def change_the_shape(tested: bpy.types.Material) -> None:
    mesh = bpy.data.objects["One"].data
    mesh.vertices[0].co.z += 0.5
    mesh.update()


def change_an_attribute(tested: bpy.types.Material) -> None:
    bpy.data.objects["One"].data.uv_layers["First"].uv[0].vector = (0.9, 0.9)


@pytest.mark.parametrize("change", [change_a_value, change_a_setting, change_the_shape, change_an_attribute])
def test_what_changed_is_evaluated_again(change: Callable[[bpy.types.Material], None]) -> None:
    show(diffuse(noise("UV")))
    evaluated_scene()
    change(bpy.data.materials["Tested"])
    assert evaluated_scene().surfaces.evaluated == 1


def test_pixels_of_an_image_and_groups_count() -> None:
    show(diffuse(soft_image(node_output("TexCoord", "Generated"))))
    evaluated_scene()
    image = bpy.data.images["Soft"]
    image.pixels[0] = 0.123
    assert evaluated_scene().surfaces.evaluated == 1


def test_a_damaged_file_in_the_cache_is_made_anew(kept_materials: Path) -> None:
    show(diffuse(noise()))
    evaluated_scene()
    evaluation_cache.forget()
    (path,) = kept_materials.glob("*.npz")
    path.write_bytes(path.read_bytes()[:100])
    assert evaluated_scene().surfaces.evaluated == 1


def test_the_cache_is_bounded(monkeypatch: pytest.MonkeyPatch, kept_materials: Path) -> None:
    monkeypatch.setattr(evaluation_cache, "_MEMORY_BYTES", 3000)
    monkeypatch.setattr(evaluation_cache, "_DISK_BYTES", 10_000)
    for index in range(20):
        evaluation_cache.keep(f"key{index}", [np.zeros(250, dtype=np.float32)], kept_materials)
    assert sum(array.nbytes for kept in evaluation_cache._memory.values() for array in kept) <= 3000
    assert sum(path.stat().st_size for path in kept_materials.iterdir()) <= 10_000
    assert evaluation_cache.recall("key19", kept_materials) is not None
    assert evaluation_cache.recall("key0", kept_materials) is None


def test_nothing_of_it_stays_in_the_file() -> None:
    shown = show(surface(shader("BsdfPrincipled", Base_Color=noise(), Metallic=NUMBER)))
    bpy.context.view_layer.objects.active = shown
    shown.select_set(True)
    bpy.data.objects["Two"].select_set(False)
    before = datablocks()
    bpy.ops.object.mode_set(mode="EDIT")
    evaluated_scene()
    assert datablocks() == before
    assert shown.mode == "EDIT"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert bpy.context.view_layer.objects.active == shown
    assert [shown.select_get(), bpy.data.objects["Two"].select_get()] == [True, False]
    assert bpy.context.scene.name == "Scene"


def test_cancelling_at_any_step_leaves_nothing() -> None:
    show(surface(shader("BsdfPrincipled", Base_Color=noise(), Metallic=NUMBER)))
    before = datablocks()
    tasks: list[str] = []
    number = 0
    while True:
        evaluation_cache.forget()
        steps = export_render_steps(bpy.context.scene, bpy.context.view_layer)
        ended = False
        for _ in range(number + 1):
            try:
                tasks.append(next(steps).task)
            except StopIteration:
                ended = True
        steps.close()
        assert datablocks() == before
        if ended:
            break
        number += 1
    assert any(task.startswith("Evaluating materials with Cycles") for task in tasks)


def circle(tree: Tree) -> bpy.types.NodeSocket:
    first, second = (tree.nodes.new("ShaderNodeMixRGB") for _ in range(2))
    tree.links.new(first.outputs[0], second.inputs["Color1"])
    tree.links.new(second.outputs[0], first.inputs["Color1"])
    return first.outputs[0]


def test_a_circle_of_nodes_ends() -> None:
    shown = show(diffuse(circle))
    scene = evaluated_scene()
    here = scene.geometry.object == scene.objects.index("One")
    truth = cycles_on_triangles_of(diffuse(circle), shown, "DIFFUSE")
    np.testing.assert_allclose(exported(scene, "albedo", here), truth, atol=WITHIN)


def test_values_of_networks_that_are_no_colours() -> None:
    negative = through("Math", 0, NUMBER, operation="SUBTRACT")  # half of it is below 0.5
    show(diffuse(negative))
    scene = evaluated_scene()
    assert exported(scene, "albedo").min() == 0.0
    assert said(scene) == ["warning: has negative values: taken as 0"]


def test_networks_that_reflect_too_much() -> None:
    show(diffuse(through("Math", 0, NUMBER, operation="ADD")))  # 0.5 to 1.5
    scene = evaluated_scene()
    assert exported(scene, "albedo").max() <= 1.0
    assert len(said(scene)) == 1
    assert "reflects more light than it receives" in said(scene)[0]


def test_a_missing_image_is_magenta_and_said_once(tmp_path: Path) -> None:
    def lost(tree: Tree) -> bpy.types.NodeSocket:
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = bpy.data.images.new("Lost", 8, 8)
        node.image.source = "FILE"
        node.image.filepath = str(tmp_path / "lost.png")
        tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"], node.inputs["Vector"])
        return node.outputs["Color"]

    show(diffuse(lost))
    scene = evaluated_scene()
    np.testing.assert_allclose(exported(scene, "albedo"), [[1, 0, 1]] * scene.geometry.triangle_count, atol=1e-6)
    assert said(scene) == ["warning: Color: image 'Lost' cannot be read: magenta, as in Cycles"]


def test_many_materials_on_one_mesh_and_an_empty_mesh() -> None:
    empty_scene()
    mesh = cube_mesh()
    for index in range(6):
        mesh.materials.append(new_material(f"Face {index}", diffuse(noise("Object", scale=1.0 + index))))
        mesh.polygons[index].material_index = index
    add_object("Cube", mesh)
    add_object("Nothing", bpy.data.meshes.new("Nothing"))
    bpy.data.meshes["Nothing"].materials.append(bpy.data.materials["Face 0"])
    scene = evaluated_scene()
    assert scene.surfaces.evaluated == 6
    assert len(scene.textures) == 6


def test_without_cycles_something_simple_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    show(diffuse(noise()))
    bpy.ops.preferences.addon_disable(module="cycles")
    try:
        scene = evaluated_scene()
    finally:
        bpy.ops.preferences.addon_enable(module="cycles")
    assert said(scene) == ["simplified: Color: its own value (0.8, 0.8, 0.8) taken instead of its nodes"]


def test_the_frame_is_the_scenes() -> None:
    def driven(tree: Tree) -> bpy.types.NodeSocket:
        node = tree.nodes.new("ShaderNodeValue")
        driver = node.outputs[0].driver_add("default_value").driver
        driver.expression = "frame / 100"
        return joined(tree, node)

    def joined(tree: Tree, node: bpy.types.Node) -> bpy.types.NodeSocket:
        product = tree.nodes.new("ShaderNodeMath")
        product.operation = "MULTIPLY"
        tree.links.new(node.outputs[0], product.inputs[0])
        tree.links.new(NUMBER(tree), product.inputs[1])
        return product.outputs[0]

    shown = show(diffuse(driven))
    for frame in (40, 80):
        bpy.context.scene.frame_set(frame)
        scene = evaluated_scene()
        assert scene.surfaces.evaluated == 1
        here = scene.geometry.object == scene.objects.index("One")
        np.testing.assert_allclose(exported(scene, "albedo", here), frame / 100 * numbers(shown), atol=WITHIN)


@pytest.mark.parametrize(("output", "named"), [("Is Camera Ray", False), ("Is Shadow Ray", True), ("Ray Depth", True)])
def test_light_paths_that_differ_are_named(output: str, named: bool) -> None:
    path = node_output("LightPath", output)
    one, other = shader("BsdfDiffuse", Color=RED, Roughness=0.0), shader("BsdfDiffuse", Color=BLUE, Roughness=0.0)
    message = f"shader mix factor: {output} of Light Path taken as of diffuse light"
    show(surface(pair("MixShader", one, other, path)))
    assert said(evaluated_scene()) == ([f"simplified: {message}"] if named else [])
    show(surface(pair("MixShader", one, other, through("Math", 0, path, operation="MULTIPLY"))))
    assert said(evaluated_scene()) == ([f"simplified: {message}"] if named else [])


def test_what_is_clear_to_shadow_rays_casts_no_shadow() -> None:
    path = node_output("LightPath", "Is Shadow Ray")
    clear, red = shader("BsdfTransparent"), shader("BsdfDiffuse", Color=RED, Roughness=0.0)
    shown = show(surface(pair("MixShader", red, clear, path)))
    shown.data.materials.append(new_material("Other", surface(red)))
    shown.data.polygons[0].material_index = 1
    scene = evaluated_scene()
    assert said(scene) == []
    assert scene.light_rules is not None
    casts = scene.light_rules.blocks[scene.geometry.object] != 0
    names = [scene.materials.names[material] for material in scene.geometry.material[casts]]
    assert set(names) == {"Other"}
    assert 0 < casts.sum() < len(casts)
    np.testing.assert_allclose(scene.materials.albedo[scene.geometry.material], [RED] * len(casts), rtol=1e-6)
    # Half of a shadow is none that this can do.
    show(surface(pair("MixShader", red, shader("BsdfTransparent", Color=BLUE), path)))
    assert len(said(evaluated_scene())) == 1


def test_hair_and_points_are_evaluated_too() -> None:
    empty_scene()
    curves = bpy.data.hair_curves.new("Hair")
    curves.add_curves([4] * 20)
    rng = np.random.default_rng(3)
    roots = np.repeat(rng.random((20, 1, 3)), 4, axis=1)
    roots[:, :, 2] += np.arange(4) / 3
    curves.attributes["position"].data.foreach_set("vector", roots.astype(np.float32).ravel())
    curves.materials.append(new_material("Tested", diffuse(noise("Object"))))
    add_object("Hair", curves)
    scene = evaluated_scene()
    assert scene.surfaces.evaluated == 1
    values = exported(scene, "albedo")
    assert np.ptp(values[:, 0]) > 0.05
    assert values.min() > 0.0


def test_a_material_that_is_removed_meanwhile_is_named() -> None:
    show(diffuse(noise()))
    steps = export_render_steps(bpy.context.scene, bpy.context.view_layer)
    with pytest.raises(SceneError, match="material 'Tested' was removed"):
        for step in steps:
            if step.task.startswith("Evaluating materials"):
                bpy.data.materials.remove(bpy.data.materials["Tested"])


def test_a_grid_fits_its_scene_whether_materials_were_evaluated_or_recalled() -> None:
    show(diffuse(noise()))
    first, again = evaluated_scene(), evaluated_scene()
    assert first.surfaces != again.surfaces
    light = [replace(scene, notices=(), surfaces=SurfaceRecord()) for scene in (first, again)]
    assert checksum(light[0]) == checksum(light[1])
