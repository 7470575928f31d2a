# SPDX-License-Identifier: GPL-3.0-or-later
"""Lights leave Blender with Cycles' numbers, and light the grid as Cycles would."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from benchmarks.light_cases import CASES  # noqa: E402
from benchmarks.lights import FALSE_ALARM, QUICK, prove  # noqa: E402
from ivg_addon.blender.export_lights import export_lights  # noqa: E402
from ivg_addon.blender.light_linking import LinkingReader  # noqa: E402
from ivg_addon.core.light_rules import LightRules  # noqa: E402
from ivg_addon.core.lights import NO_LIMIT, Lights  # noqa: E402
from ivg_addon.core.report import Notice  # noqa: E402

PI = math.pi
TURNED = (0.3, -0.2, 0.5)


@pytest.fixture(autouse=True)
def _empty_session() -> Iterator[None]:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    yield
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def add_light(kind: str, name: str = "Key", **settings: object) -> bpy.types.Object:
    """Add a light of 10 W (or W/m²) at (1, 2, 3)."""
    data = bpy.data.lights.new(name, kind)
    data.energy = 10.0
    for key, value in settings.items():
        setattr(data, key, value)
    item = bpy.data.objects.new(name, data)
    item.location = (1.0, 2.0, 3.0)
    bpy.context.scene.collection.objects.link(item)
    return item


def exported() -> tuple[Lights, tuple[Notice, ...]]:
    return export_lights(bpy.context.evaluated_depsgraph_get())


def one_notice() -> str:
    """Return the only notice's text."""
    (notice,) = exported()[1]
    return str(notice)


def nodes_of(light: bpy.types.Object) -> bpy.types.NodeTree:
    """Return the node tree of a light, switched on; it holds an Emission and an output node."""
    if light.data.node_tree is None:
        light.data.use_nodes = True
    return light.data.node_tree


def test_area_light_has_cycles_radiance_and_the_objects_axes() -> None:
    item = add_light("AREA", shape="RECTANGLE", size=0.5, size_y=2.0, spread=1.0, color=(1.0, 0.5, 0.0))
    item.rotation_euler, item.scale = TURNED, (2.0, 1.5, -1.0)
    (lights, notices) = exported()
    matrix = np.array(item.matrix_world)
    assert notices == ()
    assert lights.names == ("Key",)
    np.testing.assert_allclose(lights.area.center, [(1, 2, 3)])
    np.testing.assert_allclose(lights.area.edge_u, [0.5 * matrix[:3, 0]], rtol=1e-6)
    np.testing.assert_allclose(lights.area.edge_v, [2.0 * matrix[:3, 1]], rtol=1e-6)
    # The scale is negative along z: the light shines along its own +z.
    np.testing.assert_allclose(lights.area.direction, [-matrix[:3, 2]], atol=1e-6)
    np.testing.assert_allclose(lights.area.half_spread, [0.5], rtol=1e-6)
    np.testing.assert_allclose(lights.area.radiance, [np.array([10, 5, 0]) / (PI * 1.0 * 3.0)], rtol=1e-6)
    assert not lights.area.elliptic.any()


@pytest.mark.parametrize(
    ("shape", "area"), [("SQUARE", 0.25), ("RECTANGLE", 1.0), ("DISK", 0.0625 * PI), ("ELLIPSE", 0.25 * PI)]
)
@pytest.mark.parametrize("normalize", [True, False])
def test_area_shapes(shape: str, area: float, normalize: bool) -> None:
    add_light("AREA", shape=shape, size=0.5, size_y=2.0, normalize=normalize)
    area_lights = exported()[0].area
    assert area_lights.elliptic[0] == (shape in {"DISK", "ELLIPSE"})
    np.testing.assert_allclose(area_lights.radiance[0], 10 / PI / (area if normalize else 1.0), rtol=1e-6)


@pytest.mark.parametrize("radius", [0.0, 0.3])
@pytest.mark.parametrize("normalize", [True, False])
def test_point_has_cycles_intensity(radius: float, normalize: bool) -> None:
    item = add_light("POINT", shadow_soft_size=radius, use_soft_falloff=False, normalize=normalize)
    item.scale = (3.0, 3.0, 3.0)
    point = exported()[0].point
    flat = 10 / PI if radius == 0.0 else 10 * radius**2
    np.testing.assert_allclose(point.intensity[0], 10 / (4 * PI) if normalize else flat, rtol=1e-6)
    np.testing.assert_allclose([point.radius[0], point.cos_half_angle[0]], [radius, -1.0], rtol=1e-6)
    np.testing.assert_array_equal(point.position, [(1, 2, 3)])
    assert not point.soft_falloff[0]


def test_spot_keeps_its_cone_and_its_uneven_axes() -> None:
    item = add_light("SPOT", spot_size=1.2, spot_blend=0.3, use_soft_falloff=True, shadow_soft_size=0.2)
    item.rotation_euler, item.scale = TURNED, (1.0, 2.0, 0.5)
    spot = exported()[0].point
    np.testing.assert_allclose(spot.cos_half_angle, [math.cos(0.6)], rtol=1e-6)
    np.testing.assert_allclose(spot.blend, [0.3], rtol=1e-6)
    np.testing.assert_allclose(spot.axes[0], np.array(item.matrix_world)[:3, :3], rtol=1e-6)
    assert spot.soft_falloff[0]


def test_sun_has_its_irradiance_facing_the_disc() -> None:
    item = add_light("SUN", angle=0.4)
    item.rotation_euler = TURNED
    sun = exported()[0].sun
    np.testing.assert_allclose(sun.direction, [-np.array(item.matrix_world)[:3, 2]], rtol=1e-6)
    np.testing.assert_allclose(sun.half_angle, [0.2], rtol=1e-6)
    np.testing.assert_allclose(sun.irradiance[0], 10.0)
    item.data.normalize = False
    np.testing.assert_allclose(exported()[0].sun.irradiance[0], 10 * PI * math.sin(0.2) ** 2, rtol=1e-6)
    item.data.angle = 0.0
    np.testing.assert_allclose(exported()[0].sun.irradiance[0], 10.0)


def test_exposure_and_temperature_multiply() -> None:
    item = add_light("SUN", angle=0.0, color=(0.5, 1.0, 1.0), exposure=-2.0, use_temperature=True, temperature=3000.0)
    expected = 2.5 * np.array([0.5, 1.0, 1.0]) * np.array(item.data.temperature_color)
    np.testing.assert_allclose(exported()[0].sun.irradiance[0], expected, rtol=1e-6)


def test_instances_of_lights_are_lights() -> None:
    item = add_light("POINT")
    collection = bpy.data.collections.new("Lamps")
    collection.objects.link(item)
    bpy.context.scene.collection.objects.unlink(item)
    for x in (0.0, 5.0):
        empty = bpy.data.objects.new("Instancer", None)
        empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", collection, (x, 0.0, 0.0)
        bpy.context.scene.collection.objects.link(empty)
    positions = exported()[0].point.position
    np.testing.assert_allclose(positions[np.argsort(positions[:, 0])], [(1, 2, 3), (6, 2, 3)])
    empty.visible_diffuse = False
    assert len(exported()[0].names) == 1


def test_what_does_not_render_is_left_out_silently() -> None:
    add_light("POINT", "Hidden").hide_render = True
    add_light("AREA", "Portal").data.cycles.is_portal = True
    assert exported()[0].names == ()
    assert exported()[1] == ()


def test_light_that_diffuse_surfaces_do_not_see_is_named() -> None:
    add_light("POINT", "Unseen").visible_diffuse = False
    assert exported()[0].names == ()
    assert one_notice().startswith("left out: light 'Unseen': lights no diffuse surface")


def test_constant_nodes_multiply_the_strength() -> None:
    item = add_light("SUN", angle=0.0)
    tree = nodes_of(item)
    emission = tree.get_output_node("CYCLES").inputs["Surface"].links[0].from_node
    emission.inputs["Color"].default_value = (1.0, 0.5, 0.25, 1.0)
    value, reroute = tree.nodes.new("ShaderNodeValue"), tree.nodes.new("NodeReroute")
    value.outputs[0].default_value = 3.0
    tree.links.new(value.outputs[0], reroute.inputs[0])
    tree.links.new(reroute.outputs[0], emission.inputs["Strength"])
    lights, notices = exported()
    np.testing.assert_allclose(lights.sun.irradiance[0], [30.0, 15.0, 7.5])
    assert notices == ()


def test_mix_and_add_of_emissions_are_sums() -> None:
    item = add_light("SUN", angle=0.0)
    tree = nodes_of(item)
    mix, add = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeAddShader")
    red, green, blue = (tree.nodes.new("ShaderNodeEmission") for _ in range(3))
    for index, node in enumerate((red, green, blue)):
        node.inputs["Color"].default_value = np.eye(4)[index]
    mix.inputs[0].default_value = 0.25
    tree.links.new(red.outputs[0], mix.inputs[1])
    tree.links.new(green.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], add.inputs[0])
    tree.links.new(blue.outputs[0], add.inputs[1])
    tree.links.new(add.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    np.testing.assert_allclose(exported()[0].sun.irradiance[0], [7.5, 2.5, 10.0])


def test_other_nodes_are_replaced_and_named() -> None:
    item = add_light("POINT")
    tree = nodes_of(item)
    emission = tree.get_output_node("CYCLES").inputs["Surface"].links[0].from_node
    emission.inputs["Strength"].default_value = 2.0
    tree.links.new(tree.nodes.new("ShaderNodeTexIES").outputs[0], emission.inputs["Strength"])
    lights, _ = exported()
    np.testing.assert_allclose(lights.point.intensity[0], 20 / (4 * PI), rtol=1e-6)
    assert one_notice() == "simplified: light 'Key': Strength: 2 taken instead of IES Texture node"


def test_light_without_a_shader_is_left_out() -> None:
    nodes_of(add_light("POINT")).links.clear()
    assert one_notice() == "left out: light 'Key': emits nothing: its colour, power or nodes are zero"


@pytest.mark.parametrize(
    ("kind", "settings", "scale", "message"),
    [
        ("POINT", {"energy": 0.0}, 1, "left out: light 'Key': emits nothing"),
        ("POINT", {"color": (0, 0, 0)}, 1, "left out: light 'Key': emits nothing"),
        ("POINT", {"energy": math.nan}, 1, "left out: light 'Key': its colour or power is not a number"),
        ("POINT", {"energy": math.inf}, 1, "left out: light 'Key': its colour or power is not a number"),
        ("AREA", {"energy": 1e38, "size": 1e-9}, 1, "left out: light 'Key': is brighter than single precision"),
        ("AREA", {"size": 0.0}, 1, "left out: light 'Key': has no area"),
        ("AREA", {"shape": "RECTANGLE", "size_y": 0.0}, 1, "left out: light 'Key': has no area"),
        ("SPOT", {}, 0, "left out: light 'Key': is scaled to nothing"),
        ("SUN", {}, 0, "left out: light 'Key': is scaled to nothing"),
    ],
)
def test_lights_that_emit_nothing_are_named(kind: str, settings: dict[str, object], scale: float, message: str) -> None:
    add_light(kind, **settings).scale[2] = scale
    assert one_notice().startswith(message)
    assert exported()[0].names == ()


def test_light_may_be_taken_away() -> None:
    tree = nodes_of(add_light("SUN", angle=0.0))
    output = tree.get_output_node("CYCLES").inputs["Surface"]
    emission, add = output.links[0].from_node, tree.nodes.new("ShaderNodeAddShader")
    taking = tree.nodes.new("ShaderNodeEmission")
    taking.inputs["Color"].default_value = (0.5, 2.0, 0.0, 1.0)
    taking.inputs["Strength"].default_value = -1.0
    for shader, socket in zip((emission, taking), add.inputs, strict=True):
        tree.links.new(shader.outputs[0], socket)
    tree.links.new(add.outputs[0], output)
    np.testing.assert_allclose(exported()[0].sun.irradiance[0], [5.0, -10.0, 10.0])
    assert not exported()[1]


def test_differences_to_cycles_are_named() -> None:
    item = add_light("AREA")
    parent = bpy.data.objects.new("Parent", None)
    parent.scale = (1.0, 3.0, 1.0)
    bpy.context.scene.collection.objects.link(parent)
    item.parent, item.rotation_euler = parent, TURNED
    lights, notices = exported()
    assert lights.names == ("Key",)
    (notice,) = notices
    assert str(notice).startswith("simplified: light 'Key': its transform is sheared")


def test_limits_of_bounces_go_with_their_lights() -> None:
    add_light("SUN")
    add_light("POINT", shadow_soft_size=0.0).data.cycles.max_bounces = 3
    lights, notices = exported()
    assert notices == ()
    np.testing.assert_array_equal(lights.max_bounces, [3, NO_LIMIT])


def collection_of(**members: str) -> bpy.types.Collection:
    """Return a collection of objects, made if need be, by their names and whether they are included or excluded."""
    made = bpy.data.collections.new("Chosen")
    for name in members:
        made.objects.link(bpy.data.objects.get(name) or bpy.data.objects.new(name, None))
    for state, choice in zip(made.collection_objects, members.values(), strict=True):
        state.light_linking.link_state = choice
    return made


def rules_of(*objects: str) -> tuple[Lights, LightRules | None]:
    linking = LinkingReader()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    lights, notices = export_lights(depsgraph, linking)
    assert notices == linking.notices == ()
    return lights, linking.rules(objects, [True] * len(objects), depsgraph)


def bits(masks: np.ndarray, group: int) -> list[bool]:
    return [bool(int(mask) >> group & 1) for mask in masks]


def test_lights_without_links_have_no_rules() -> None:
    add_light("POINT")
    add_light("POINT", "Linked to nothing").light_linking.receiver_collection = collection_of()
    lights, rules = rules_of("A")
    assert rules is None
    assert not lights.group.any()


def test_linked_lights_have_the_rules_of_cycles() -> None:
    """Chosen is what is included, or all if nothing is, without what is excluded; children count as a whole."""
    add_light("POINT", "Free")
    include = add_light("SUN", "Include")
    include.light_linking.receiver_collection = collection_of(A="INCLUDE", B="EXCLUDE")
    exclude = add_light("AREA", "Exclude")
    exclude.light_linking.blocker_collection = outer = collection_of(A="EXCLUDE")
    outer.children.link(collection_of(B="INCLUDE"))
    outer.collection_children[0].light_linking.link_state = "EXCLUDE"
    add_light("POINT", "Shadowless", use_shadow=False)
    lights, rules = rules_of("A", "B", "C")
    by_name = dict(zip(lights.names, lights.group.tolist(), strict=True))
    assert by_name["Free"] == 0
    assert bits(rules.receives, 0) == bits(rules.blocks, 0) == [True] * 3
    assert bits(rules.receives, by_name["Include"]) == [True, False, False]
    assert bits(rules.blocks, by_name["Include"]) == [True, True, True]
    assert bits(rules.receives, by_name["Exclude"]) == [True, True, True]
    assert bits(rules.blocks, by_name["Exclude"]) == [False, False, True]
    assert bits(rules.blocks, by_name["Shadowless"]) == [False, False, False]
    assert [bool(rules.lights_others[by_name[name]]) for name in ("Include", "Exclude", "Shadowless")] == [
        False,
        True,
        True,
    ]


def test_lights_that_are_linked_alike_share_a_group() -> None:
    chosen = collection_of(A="INCLUDE")
    for index in range(1000):
        add_light("POINT", f"Lamp {index}").light_linking.receiver_collection = chosen
    lights, rules = rules_of("A", "B")
    assert set(lights.group.tolist()) == {1}
    assert len(rules.lights_others) == 2


def test_more_ways_of_linking_than_cycles_has_are_named() -> None:
    for index in range(65):
        chosen = collection_of(**{f"Object {index}": "INCLUDE"})
        add_light("POINT", f"Lamp {index}").light_linking.receiver_collection = chosen
    linking = LinkingReader()
    lights, _ = export_lights(bpy.context.evaluated_depsgraph_get(), linking)
    assert lights.group.max() == 63
    assert len(linking.notices) == 2
    assert "Cycles knows 63 ways of light linking" in str(linking.notices[0])


def new_world() -> tuple[bpy.types.World, bpy.types.Node]:
    """Make the scene's world; return it and its Background node."""
    world = bpy.data.worlds.new("Sky")
    bpy.context.scene.world = world
    return world, world.node_tree.get_output_node("CYCLES").inputs["Surface"].links[0].from_node


def test_world_is_colour_times_strength() -> None:
    np.testing.assert_array_equal(exported()[0].world, [0, 0, 0])
    world, background = new_world()
    background.inputs["Color"].default_value = (0.5, 0.25, 0.125, 1.0)
    background.inputs["Strength"].default_value = 4.0
    np.testing.assert_allclose(exported()[0].world, [2.0, 1.0, 0.5])
    world.cycles_visibility.diffuse = False
    lights, notices = exported()
    np.testing.assert_array_equal(lights.world, [0, 0, 0])
    assert notices == ()
    world.cycles_visibility.diffuse = True
    bpy.context.view_layer.use_sky = False
    np.testing.assert_array_equal(exported()[0].world, [0, 0, 0])


def test_world_that_is_not_uniform_is_left_out_by_name() -> None:
    world, background = new_world()
    texture = world.node_tree.nodes.new("ShaderNodeTexEnvironment")
    world.node_tree.links.new(texture.outputs["Color"], background.inputs["Color"])
    np.testing.assert_array_equal(exported()[0].world, [0, 0, 0])
    assert one_notice().startswith("left out: world 'Sky': lights nothing")
    assert "Environment Texture" in one_notice()


def test_volume_of_a_world_is_left_out_by_name() -> None:
    world, _ = new_world()
    tree = world.node_tree
    scatter = tree.nodes.new("ShaderNodeVolumeScatter")
    tree.links.new(scatter.outputs["Volume"], tree.get_output_node("CYCLES").inputs["Volume"])
    assert one_notice() == "left out: world 'Sky': its volume"
    assert exported()[0].world.any()


@pytest.mark.parametrize("case", CASES, ids=[case.name for case in CASES])
def test_shines_as_in_cycles(case) -> None:
    """Irradiance of 245 dual cells towards six axes; false alarms as stated in `benchmarks.lights`."""
    verdict = prove(case, QUICK)
    assert verdict.p >= FALSE_ALARM, verdict


def test_a_light_of_three_per_cent_too_much_power_fails() -> None:
    (case,) = (case for case in CASES if case.name == "sun, 5°")
    assert prove(case, QUICK, factor=1.03).p < FALSE_ALARM
