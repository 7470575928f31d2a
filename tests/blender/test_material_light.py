# SPDX-License-Identifier: GPL-3.0-or-later
"""A grid's light in materials: it goes in comes out without a trace, and follows its grid."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
import pytest

from ivg_addon.core import IrradianceVectorGrid

from . import material_trees as trees
from .export_scenes import add_object
from .stored_grids import module, random_grid, store

ROOT = Path(__file__).resolve().parents[2]
AWKWARD = (trees.diffuse, trees.mixed, trees.grouped, trees.two_outputs, trees.glass)


@pytest.fixture
def scene(extension: str, tmp_path: Path) -> Iterator[bpy.types.Scene]:
    """Return a scene with a grid, and an object with no material."""
    bpy.ops.wm.read_homefile(use_empty=True)
    store(extension, "Room", random_grid(), tmp_path)
    bpy.ops.mesh.primitive_cube_add(size=0.1)
    yield bpy.context.scene
    bpy.ops.wm.read_homefile(use_empty=True)


def give(*materials: bpy.types.Material) -> None:
    """Give materials to the object."""
    for material in materials:
        bpy.context.object.data.materials.append(material)


def warnings_of(call: Callable[[], Any], capfd: pytest.CaptureFixture[str]) -> list[str]:
    """Return what an operator reports as warnings."""
    capfd.readouterr()
    call()
    return [line for line in capfd.readouterr().out.splitlines() if line.startswith("Warning: ")]


# --- In and out -------------------------------------------------------------------------------------------------------


def test_the_light_goes_in_and_comes_out_without_a_trace(scene: bpy.types.Scene) -> None:
    give(*(make() for make in AWKWARD))
    before = trees.everything()
    for _ in range(2):
        bpy.ops.ivg.materials_add()
        lit = trees.everything()
        assert {name for name in before["materials"] if lit["materials"][name] != before["materials"][name]} == {
            *("Diffuse", "Mixed", "Grouped", "Two Outputs")
        }
        bpy.ops.ivg.materials_add()
        assert trees.everything() == lit, "adding twice is adding once"
        bpy.ops.ivg.materials_remove()
        assert trees.everything() == before
    assert not bpy.ops.ivg.materials_remove.poll()


def test_what_was_edited_meanwhile_stays(scene: bpy.types.Scene) -> None:
    material = trees.mixed()
    give(material)
    bpy.ops.ivg.materials_add()
    tree = material.node_tree
    output, mix = tree.nodes["Material Output"], tree.nodes["Mix Shader"]
    tree.nodes["Diffuse BSDF"].inputs["Color"].default_value = (1.0, 0.0, 0.0, 1.0)
    tree.nodes["Principled BSDF"].name = "Renamed"
    over = tree.nodes.new("ShaderNodeAddShader")
    tree.links.new(mix.outputs[0], over.inputs[0])
    tree.links.new(mix.inputs[2].links[0].from_socket, over.inputs[1])
    tree.links.new(over.outputs[0], output.inputs["Surface"])
    material.cycles.emission_sampling = "BACK"
    bpy.ops.ivg.materials_remove()
    assert over.inputs[1].links[0].from_node.name == mix.inputs[2].links[0].from_node.name == "Renamed"
    assert mix.inputs[1].links[0].from_node.type == "REROUTE"
    assert output.inputs["Surface"].links[0].from_node == over
    assert not [node for node in tree.nodes if node.type == "GROUP"]
    assert tuple(tree.nodes["Diffuse BSDF"].inputs["Color"].default_value) == (1.0, 0.0, 0.0, 1.0)
    assert material.cycles.emission_sampling == "BACK"


def test_light_of_an_older_version_stays_until_it_is_added_again(scene: bpy.types.Scene) -> None:
    first, second = trees.diffuse(), trees.mixed()
    give(first, second)
    bpy.ops.ivg.materials_add()
    old = bpy.data.node_groups["IVG Diffuse Light"]
    old["ivg_light_group"]["version"] -= 1
    nodes, users = [node.name for node in old.nodes], old.users
    second.use_fake_user = True
    bpy.context.object.data.materials.pop(index=1)
    bpy.ops.ivg.materials_add()
    assert ([node.name for node in old.nodes], old.users) == (nodes, users - 1)
    bpy.context.object.data.materials.append(second)
    bpy.ops.ivg.materials_add()
    (left,) = (group for group in bpy.data.node_groups if group.name.startswith("IVG Diffuse Light"))
    assert left.users == users


def test_materials_interpolate_as_the_scene_does(extension: str, scene: bpy.types.Scene) -> None:
    """The image's pixels are made anew where they are for another interpolation; the panel says so before."""
    scene_light = module(extension, "scene_light")
    give(trees.diffuse())
    bpy.ops.ivg.materials_add()
    image = scene.ivg.grid
    before = np.array(image.pixels[:])
    assert (image["ivg"]["spatial"], scene_light.interpolation_message(scene)) == ("TRILINEAR", "")
    scene.ivg.spatial = "TRICUBIC"
    assert scene_light.interpolation_message(scene).endswith("trilinear, not tricubic: press Add Light to change that")
    bpy.ops.ivg.materials_add()
    assert (image["ivg"]["spatial"], scene_light.interpolation_message(scene)) == ("TRICUBIC", "")
    assert not np.array_equal(image.pixels[:], before)
    bpy.ops.ivg.restore()
    assert image["ivg"]["spatial"] == "TRICUBIC"
    scene.ivg.spatial = "TRILINEAR"
    bpy.ops.ivg.restore()
    assert np.array_equal(image.pixels[:], before)


def test_another_grid_takes_the_place_of_the_first(extension: str, scene: bpy.types.Scene, tmp_path: Path) -> None:
    give(trees.diffuse())
    bpy.ops.ivg.materials_add()
    groups = len(bpy.data.node_groups)
    other = store(extension, "Other", random_grid(1), tmp_path)
    bpy.ops.ivg.materials_add()
    assert len(bpy.data.node_groups) == groups
    light = module(extension, "material_light")
    assert [light.grid_of(material) for material in light.lit_materials()] == [other]


def test_a_group_keeps_its_light_while_another_material_uses_it(scene: bpy.types.Scene) -> None:
    first = trees.grouped()
    second = first.copy()
    give(first)
    add_object("Other", bpy.data.meshes.new("Other")).data.materials.append(second)
    before = trees.everything()
    bpy.ops.ivg.materials_add()
    lit = trees.everything()
    for other in bpy.data.objects:
        other.select_set(other.name == "Other")
    bpy.ops.ivg.materials_add(objects="SELECTED")
    assert trees.everything() == lit, "the group has the light once"
    bpy.ops.ivg.materials_remove(objects="SELECTED")
    assert any(node.type == "GROUP" for node in bpy.data.node_groups["Inner"].nodes)
    bpy.ops.ivg.materials_remove()
    assert trees.everything() == before


def test_objects_without_material_get_one_for_as_long(scene: bpy.types.Scene) -> None:
    bare, slots = bpy.context.object, add_object("Slots", bpy.data.meshes.new("Slots"))
    slots.data.materials.append(None)
    slots.material_slots[0].link = "OBJECT"
    bpy.ops.ivg.materials_add()
    given = bare.data.materials[0]
    assert slots.material_slots[0].material == given
    colour = given.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value
    assert tuple(colour)[:3] == pytest.approx((0.8,) * 3)
    bpy.ops.ivg.materials_remove()
    assert (len(bare.data.materials), list(bare.data.keys())) == (0, [])
    assert (slots.material_slots[0].material, slots.material_slots[0].link) == (None, "OBJECT")
    assert not bpy.data.materials


def test_undo_and_redo(scene: bpy.types.Scene) -> None:
    give(trees.mixed())
    before = trees.everything()
    bpy.ops.ed.undo_push(message="Before")
    bpy.ops.ivg.materials_add()
    bpy.ops.ed.undo_push(message="Added")
    lit = trees.everything()
    bpy.ops.ed.undo()
    assert trees.everything() == before
    bpy.ops.ed.redo()
    assert trees.everything() == lit
    bpy.ops.ivg.materials_remove()
    assert trees.everything() == before


# --- With the grid ----------------------------------------------------------------------------------------------------


def test_the_light_is_no_part_of_a_bake_and_follows_it(extension: str, scene: bpy.types.Scene, tmp_path: Path) -> None:
    bpy.ops.mesh.primitive_cube_add(size=4.0)
    give(trees.mixed(), trees.grouped())
    bpy.ops.object.light_add(type="POINT")
    scene.ivg.filepath = str(tmp_path / "a.ivg.npz")
    bake = {"photons": 2_000, "resolution": (2, 2, 2)}
    bpy.context.view_layer.update()
    bpy.ops.ivg.bake(**bake)
    first = IrradianceVectorGrid.load(tmp_path / "a.ivg.npz")
    rows = {row.name: row.value for row in scene.ivg.last_bake.rows}["Materials"]
    staleness = module(extension, "staleness")
    bpy.ops.ivg.materials_add()
    bpy.context.view_layer.update()
    assert staleness.freshness(scene) is staleness.Freshness.FRESH
    bpy.ops.ivg.bake(resolution=(2, 2, 3), photons=2_000)
    again = IrradianceVectorGrid.load(tmp_path / "a.ivg.npz")
    assert again.record.checksum == first.record.checksum
    assert rows.split(",")[0] in {row.name: row.value for row in scene.ivg.last_bake.rows}["Materials"]
    bpy.context.view_layer.update()
    assert staleness.freshness(scene) is staleness.Freshness.FRESH
    group = module(extension, "irradiance_nodes").find(scene.ivg.grid)
    assert list(group["ivg"]["layout"]["resolution"]) == [2, 2, 3], "the new grid is looked up without a further click"


def test_a_grid_takes_its_light_along(scene: bpy.types.Scene) -> None:
    material = trees.mixed()
    give(material)
    before = trees.everything()
    bpy.ops.ivg.materials_add()
    bpy.ops.ivg.grid_remove()
    assert trees.everything() == before
    assert not bpy.ops.ivg.materials_add.poll()


def test_light_whose_grid_was_removed_by_hand_can_be_taken_out(extension: str, scene: bpy.types.Scene) -> None:
    give(trees.mixed())
    before = trees.everything()
    bpy.ops.ivg.materials_add()
    bpy.data.images.remove(scene.ivg.grid)
    light = module(extension, "material_light")
    assert [light.grid_of(material) for material in light.lit_materials()] == [None]
    bpy.ops.ivg.materials_remove()
    assert trees.everything() == before


def test_indirect_light_is_switched_off_and_back(extension: str, scene: bpy.types.Scene) -> None:
    probe = bpy.data.lightprobes.new("Probe", "VOLUME")
    probe.intensity = 0.7
    add_object("Probe", probe)
    scene.cycles.diffuse_bounces, scene.cycles.use_fast_gi = 7, True
    scene.eevee.use_fast_gi, scene.eevee.ray_tracing_options.trace_max_roughness = False, 1.0

    def settings() -> list[Any]:
        options = scene.eevee.ray_tracing_options
        cycles = [scene.cycles.diffuse_bounces, scene.cycles.glossy_bounces, scene.cycles.use_fast_gi]
        eevee = [scene.eevee.use_fast_gi, scene.eevee.fast_gi_method]
        return [*cycles, *eevee, options.trace_max_roughness, probe.intensity]

    before = settings()
    direct = module(extension, "direct_light")
    assert direct.counts_twice(scene)
    bpy.ops.ivg.direct_only()
    assert settings() == [0, before[1], False, True, "AMBIENT_OCCLUSION_ONLY", 0.5, 0.0]
    assert not direct.counts_twice(scene)
    scene.cycles.diffuse_bounces = 2
    assert direct.counts_twice(scene)
    bpy.ops.ivg.direct_only()
    bpy.ops.ivg.direct_only_end()
    assert settings() == [2, *before[1:]]
    assert not bpy.ops.ivg.direct_only_end.poll()


# --- What cannot have it ----------------------------------------------------------------------------------------------


def test_materials_that_cannot_have_it_are_named(
    scene: bpy.types.Scene, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    library = tmp_path / "library.blend"
    made = [trees.diffuse(), trees.grouped()]
    made[0].name = "Linked"
    bpy.data.libraries.write(str(library), set(made))
    bpy.data.batch_remove([*made, *bpy.data.node_groups])
    with bpy.data.libraries.load(str(library), link=True) as (_, here):
        here.materials = ["Linked"]
        here.node_groups = ["Outer"]
    overridden = here.materials[0].override_create()
    overridden.name = "Override"
    no_output, _, output = trees.tree_of("No Output")
    no_output.node_tree.nodes.remove(output)
    uses, add, output = trees.tree_of("Uses")
    group = add("Group")
    group.node_tree = here.node_groups[0]
    uses.node_tree.links.new(group.outputs[0], output.inputs[0])
    curtain, add, output = trees.tree_of("Curtain")
    curtain.node_tree.links.new(add("BsdfTranslucent").outputs[0], output.inputs[0])
    give(here.materials[0], overridden, no_output, uses, curtain)
    before = trees.everything()
    found = warnings_of(bpy.ops.ivg.materials_add, capfd)
    for name, cure in (
        ("'Linked' is linked from", "make it local"),
        ("'Override' is a library override", "make it local"),
        ("'No Output' has no output", "add a Material Output"),
        ("'Uses' node group 'Inner' is linked", "make the group local"),
        ("'Curtain' Translucent BSDF", "in EEVEE"),
    ):
        assert len([line for line in found if name in line and cure in line]) == 1, (name, found)
    assert trees.everything() == before


def test_objects_out_of_the_grid_are_named(scene: bpy.types.Scene, capfd: pytest.CaptureFixture[str]) -> None:
    low, high = (np.array(scene.ivg.grid["ivg"][name]) for name in ("bounds_min", "bounds_max"))
    bpy.context.object.location = 0.5 * (low + high)
    bpy.context.view_layer.update()
    assert not warnings_of(bpy.ops.ivg.materials_add, capfd)
    bpy.context.object.location = high
    bpy.context.view_layer.update()
    (line,) = warnings_of(bpy.ops.ivg.materials_add, capfd)
    assert "'Cube'" in line
