# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials take their light from the modifier IVG Light where all that shows them has it, else from the grid."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import bpy
import pytest

from . import material_trees as trees
from .export_scenes import add_object, cube_mesh
from .stored_grids import module, random_grid, store
from .test_light_modifier import instancing_tree
from .test_material_light import AWKWARD, warnings_of


@pytest.fixture
def scene(extension: str, tmp_path: Path) -> Iterator[bpy.types.Scene]:
    """Return a scene with a grid, and two cubes without materials, of which the first has the modifier."""
    bpy.ops.wm.read_homefile(use_empty=True)
    store(extension, "Room", random_grid(), tmp_path)
    for name in ("Stone", "Wall"):
        add_object(name, cube_mesh(size=0.1)).location = (0.2, 2.5, 2.0)
    bpy.context.view_layer.update()
    light_up("Stone")
    yield bpy.context.scene
    bpy.ops.wm.read_homefile(use_empty=True)


def light_up(*names: str) -> None:
    """Put the modifier on objects, and leave them selected."""
    for each in bpy.data.objects:
        each.select_set(each.name in names)
    bpy.ops.ivg.modifier_add()


def give(name: str, *materials: bpy.types.Material) -> None:
    """Give materials to an object."""
    for material in materials:
        bpy.data.objects[name].data.materials.append(material)


def sources(tree: bpy.types.NodeTree) -> set[str]:
    """Return what lights a tree: attributes, and groups that look up."""
    lights = [node for node in tree.nodes if node.type == "GROUP" and "In the Open" in node.inputs]
    nodes = [node.inputs["In the Open"].links[0].from_node for node in lights]
    return {node.attribute_name if node.type == "ATTRIBUTE" else node.node_tree.name for node in nodes}


STORED, LOOKED_UP = {"ivg_irradiance"}, {"IVG Irradiance"}


def test_it_goes_in_and_over_and_out_without_a_trace(
    extension: str, scene: bpy.types.Scene, capfd: pytest.CaptureFixture[str]
) -> None:
    """Bumps are left to the look-up; a scene so lit is no other than before for bakes, and needs no image."""
    staleness = module(extension, "staleness")
    materials = [make() for make in AWKWARD]
    give("Stone", *materials)
    give("Wall", trees.diffuse())
    bpy.context.view_layer.update()
    staleness.saw(scene, "of the scene as it is", staleness.edits(scene))
    before = trees.everything()
    bpy.ops.ivg.materials_add(objects="SELECTED", light_from="MODIFIER")
    stored = trees.everything()
    assert [sources(material.node_tree) for material in materials[:2]] == [STORED, STORED]
    assert sources(bpy.data.node_groups["Inner"]) == STORED
    assert "IVG Irradiance" not in bpy.data.node_groups
    bpy.ops.ivg.materials_add()
    looked_up = trees.everything()
    assert sources(materials[1].node_tree) == LOOKED_UP
    scene.ivg.light_from = "MODIFIER"
    (line,) = warnings_of(bpy.ops.ivg.materials_add, capfd)
    assert "'Diffuse.001'" in line
    assert sources(materials[0].node_tree) == STORED
    assert sources(bpy.data.materials["Diffuse.001"].node_tree) == LOOKED_UP
    bpy.ops.ivg.materials_add(light_from="GRID")
    assert trees.everything() == looked_up
    bpy.ops.ivg.materials_remove()
    assert trees.everything() == before
    bpy.ops.ivg.materials_add(objects="SELECTED")
    assert trees.everything() == stored, "it is what was asked for last in the panel"
    bpy.context.view_layer.update()
    assert not scene.ivg.changed_since


def test_shared_with_what_has_no_modifier_it_is_looked_up(
    extension: str, scene: bpy.types.Scene, capfd: pytest.CaptureFixture[str]
) -> None:
    shared = trees.diffuse()
    give("Stone", shared)
    give("Wall", shared)

    def told() -> list[str]:
        return warnings_of(lambda: bpy.ops.ivg.materials_add(light_from="MODIFIER"), capfd)

    (line,) = told()
    assert "'Diffuse' looks the grid up: 'Wall' shows it without IVG Light" in line
    assert sources(shared.node_tree) == LOOKED_UP
    light_up("Wall")
    assert not told()
    assert sources(shared.node_tree) == STORED
    modifier = bpy.data.objects["Wall"].modifiers[0]
    modifier.show_render = False
    assert "'Wall'" in told()[0]
    modifier.show_render = True
    assert not told()
    module(extension, "light_modifier")._set(modifier, "Attribute", "another")
    assert "'Wall'" in told()[0]
    bpy.data.objects.remove(bpy.data.objects["Wall"])
    # What nodes show, hidden itself, has the light only where they have the modifier.
    points = add_object("Points", bpy.data.meshes.new("Points"))
    points.data.from_pydata([(0.2, 2.5, 2.0)], [], [])
    points.modifiers.new("Scatter", "NODES").node_group = instancing_tree(add_object("Seed", cube_mesh(size=0.1)))
    give("Seed", shared)
    give("Points", shared)
    bpy.data.objects["Seed"].hide_render = True
    assert "'Seed'" in told()[0]
    light_up("Points")
    assert not told()
    assert sources(shared.node_tree) == STORED


def test_a_group_in_a_material_that_looks_up_looks_up_for_all(scene: bpy.types.Scene) -> None:
    first = trees.grouped()
    second = first.copy()
    give("Stone", first)
    give("Wall", second)
    bpy.ops.ivg.materials_add(objects="SELECTED", light_from="MODIFIER")
    assert sources(bpy.data.node_groups["Inner"]) == STORED
    bpy.ops.ivg.materials_add()
    bpy.ops.ivg.materials_add(objects="SELECTED", light_from="MODIFIER")
    assert sources(bpy.data.node_groups["Inner"]) == LOOKED_UP


def test_without_the_modifier_it_is_looked_up_again(
    extension: str, scene: bpy.types.Scene, capfd: pytest.CaptureFixture[str]
) -> None:
    """Taken off by the button at once; deleted by hand, the panel tells."""
    stored_light, light = module(extension, "stored_light"), module(extension, "material_light")
    material, stone = trees.diffuse(), bpy.data.objects["Stone"]
    give("Stone", material)
    bpy.ops.ivg.materials_add(objects="SELECTED", light_from="MODIFIER")
    stone.modifiers.clear()
    (told,) = stored_light.problems([stone], light.takes_stored)
    assert "'Stone'" in told
    light_up("Stone")
    assert not list(stored_light.problems([stone], light.takes_stored))
    (line,) = warnings_of(bpy.ops.ivg.modifier_remove, capfd)
    assert "'Diffuse'" in line
    assert sources(material.node_tree) == LOOKED_UP
    assert not light.takes_stored(material)


def test_objects_without_material_have_it_too(scene: bpy.types.Scene) -> None:
    bpy.ops.ivg.materials_add(objects="SELECTED", light_from="MODIFIER")
    assert sources(bpy.data.objects["Stone"].data.materials[0].node_tree) == STORED
    bpy.ops.ivg.materials_add(light_from="MODIFIER")
    assert sources(bpy.data.objects["Stone"].data.materials[0].node_tree) == LOOKED_UP
    bpy.ops.ivg.materials_remove()
    assert not bpy.data.materials
