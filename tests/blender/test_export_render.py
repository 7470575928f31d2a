# SPDX-License-Identifier: GPL-3.0-or-later
"""Export as a render sees the scene, not as the viewport shows it; and without a trace."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import bpy
import numpy as np
import pytest

from ivg_addon.blender import export
from ivg_addon.blender.export import export_render_steps
from ivg_addon.blender.export_depsgraph import with_render_depsgraph
from ivg_addon.core.errors import Cancelled, IvgError, SceneError
from ivg_addon.core.scene import Scene
from tests.blender.export_scenes import add_object, cube_mesh, empty_scene, viewport_scene


def render_scene() -> Scene:
    steps = export_render_steps(bpy.context.scene, bpy.context.view_layer)
    fractions = []
    try:
        while True:
            fractions.append(next(steps).fraction)
    except StopIteration as end:
        assert fractions == sorted(fractions)
        return end.value


def in_collection(name: str, content: str) -> bpy.types.Collection:
    collection = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(bpy.data.objects.new(content, cube_mesh()))
    return collection


def test_subdivision_has_its_render_level() -> None:
    empty_scene()
    modifier = add_object("Cube", cube_mesh()).modifiers.new("Subdivision", "SUBSURF")
    modifier.levels, modifier.render_levels = 1, 3
    assert viewport_scene().geometry.triangle_count == 6 * 4 * 2
    assert render_scene().geometry.triangle_count == 6 * 4**3 * 2


def test_modifiers_have_their_render_switch() -> None:
    empty_scene()
    cube = add_object("Cube", cube_mesh())
    for count, in_viewport, in_render in ((3, False, True), (5, True, False)):
        modifier = cube.modifiers.new("Array", "ARRAY")
        modifier.count = count
        modifier.show_viewport, modifier.show_render = in_viewport, in_render
    assert viewport_scene().geometry.triangle_count == 5 * 12
    assert render_scene().geometry.triangle_count == 3 * 12


def test_geometry_nodes_know_that_this_is_no_viewport() -> None:
    empty_scene()
    group = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    begin, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    switch = group.nodes.new("GeometryNodeSwitch")
    switch.input_type = "GEOMETRY"
    group.links.new(group.nodes.new("GeometryNodeIsViewport").outputs[0], switch.inputs["Switch"])
    group.links.new(begin.outputs[0], switch.inputs["True"])
    group.links.new(group.nodes.new("GeometryNodeMeshIcoSphere").outputs["Mesh"], switch.inputs["False"])
    group.links.new(switch.outputs["Output"], end.inputs[0])
    add_object("Cube", cube_mesh()).modifiers.new("Nodes", "NODES").node_group = group
    assert viewport_scene().geometry.triangle_count == 12
    assert render_scene().geometry.triangle_count == 20


def test_visibility_is_that_of_renders() -> None:
    empty_scene()
    add_object("Plain", cube_mesh())
    add_object("Hidden in viewport", cube_mesh(), hide_viewport=True)
    add_object("Hidden in render", cube_mesh(), hide_render=True)
    add_object("Holdout", cube_mesh(), is_holdout=True)
    eye = add_object("Hidden by eye", cube_mesh())
    bpy.context.view_layer.update()
    eye.hide_set(True)
    in_collection("A", "In collection hidden in viewport").hide_viewport = True
    in_collection("B", "In collection hidden in render").hide_render = True
    in_collection("C", "In excluded collection")
    in_collection("D", "In collection for indirect light only")
    layers = bpy.context.view_layer.layer_collection.children
    layers["C"].exclude = True
    layers["D"].indirect_only = True
    assert set(render_scene().objects) == {
        "Plain",
        "Hidden in viewport",
        "Holdout",
        "Hidden by eye",
        "In collection hidden in viewport",
        "In collection for indirect light only",
    }


def test_the_view_layer_that_is_named() -> None:
    scene = empty_scene()
    in_collection("First", "One")
    in_collection("Second", "Two")
    other = scene.view_layers.new("Other")
    other.use = False
    for layer, excluded in ((scene.view_layers[0], "Second"), (other, "First")):
        layer.layer_collection.children[excluded].exclude = True
    for layer, names in ((scene.view_layers[0], ("One",)), (other, ("Two",))):
        steps = export_render_steps(scene, layer)
        with pytest.raises(StopIteration) as end:
            while True:
                next(steps)
        assert end.value.value.objects == names
    assert not other.use


def test_only_one_view_layer_is_evaluated() -> None:
    scene = empty_scene()
    for name in ("B", "C"):
        scene.view_layers.new(name)
    for layer in scene.view_layers:
        evaluated: list[str] = []

        def note(depsgraph: bpy.types.Depsgraph, stop: Callable[[], bool], names: list[str] = evaluated) -> None:
            names.append(depsgraph.view_layer.name)

        with_render_depsgraph(scene, layer, note)
        assert evaluated == [layer.name]


def test_instancer_hidden_in_renders() -> None:
    empty_scene()
    host = add_object("Host", cube_mesh(size=8.0), instance_type="VERTS")
    host.show_instancer_for_render = False
    add_object("Child", cube_mesh(), parent=host)
    scene = render_scene()
    assert scene.objects == ("Child",)
    assert scene.geometry.triangle_count == 8 * 12


def test_adaptive_subdivision_is_named() -> None:
    empty_scene()
    cube = add_object("Cube", cube_mesh())
    modifier = cube.modifiers.new("Subdivision", "SUBSURF")
    modifier.render_levels, modifier.use_adaptive_subdivision = 2, True
    scene = render_scene()
    assert scene.geometry.triangle_count == 6 * 4**2 * 2
    assert "simplified: object 'Cube': adaptive subdivision replaced by 2 uniform levels" in map(str, scene.notices)


def state() -> dict[str, object]:
    """Return what an export might disturb."""
    scene = bpy.context.scene
    render = scene.render
    collections = ("scenes", "objects", "meshes", "images", "materials", "collections", "worlds", "node_groups")
    return {
        "engine": render.engine,
        "size": (render.resolution_x, render.resolution_y, render.resolution_percentage),
        "layers": [(layer.name, layer.use) for layer in scene.view_layers],
        "scene": bpy.context.window.scene.name if bpy.context.window else scene.name,
        "frame": scene.frame_current,
        "engines": [engine.__name__ for engine in bpy.types.RenderEngine.__subclasses__() if engine.is_registered],
        **{name: sorted(item.name for item in getattr(bpy.data, name)) for name in collections},
        "users": sorted((item.name, item.users) for item in bpy.data.objects),
    }


def test_no_trace_is_left() -> None:
    scene = empty_scene()
    add_object("Cube", cube_mesh())
    add_object("Camera", bpy.data.cameras.new("Camera"))
    scene.world = bpy.data.worlds.new("World")
    scene.frame_set(7)
    before = state()
    exported = render_scene()
    assert exported.name == scene.name
    assert state() == before


def test_the_last_render_is_kept(tmp_path: Path) -> None:
    scene = empty_scene()
    scene.world = bpy.data.worlds.new("World")
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.25, 0.5, 0.75, 1)
    scene.camera = add_object("Camera", bpy.data.cameras.new("Camera"))
    scene.render.resolution_x = scene.render.resolution_y = 8
    scene.view_settings.view_transform = "Raw"
    add_object("Cube", cube_mesh(), location=(0, 0, 50))
    bpy.ops.render.render()

    def saved(name: str) -> bytes:
        bpy.data.images["Render Result"].save_render(str(tmp_path / name), scene=scene)
        return Path(tmp_path, name).read_bytes()

    first = saved("before.png")
    render_scene()
    assert saved("after.png") == first


@pytest.mark.parametrize("taken", [0, 1, 2])
def test_it_may_be_left_at_any_step(taken: int) -> None:
    empty_scene()
    add_object("Cube", cube_mesh())
    before = state()
    steps = export_render_steps(bpy.context.scene, bpy.context.view_layer)
    for _ in range(taken):
        next(steps)
    steps.close()
    assert state() == before


def test_errors_come_through_and_leave_no_trace() -> None:
    empty_scene()
    before = state()

    def fail(depsgraph: bpy.types.Depsgraph, stop: Callable[[], bool]) -> None:
        raise IvgError("on purpose")

    with pytest.raises(IvgError, match="on purpose"):
        with_render_depsgraph(bpy.context.scene, bpy.context.view_layer, fail)
    assert state() == before
    with pytest.raises(SceneError, match="no mesh, curve, surface, text, hair or point cloud"):
        render_scene()
    assert state() == before


def test_a_request_to_stop_is_heard(monkeypatch: pytest.MonkeyPatch) -> None:
    empty_scene()
    add_object("Cube", cube_mesh())
    before = state()

    def impatient(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, read: Callable[..., object]) -> object:
        def stop_at_once(depsgraph: bpy.types.Depsgraph, stop: Callable[[], bool]) -> object:
            assert stop() is False
            return read(depsgraph, lambda: True)

        return with_render_depsgraph(scene, view_layer, stop_at_once)

    monkeypatch.setattr(export, "with_render_depsgraph", impatient)
    with pytest.raises(Cancelled):
        render_scene()
    assert state() == before


def test_a_scene_with_physics_survives() -> None:
    scene = empty_scene()
    floor = add_object("Floor", cube_mesh(size=5.0), location=(0, 0, -6))
    falling = add_object("Falling", cube_mesh())
    bpy.ops.rigidbody.world_add()
    bpy.context.view_layer.update()
    for body, kind in ((floor, "PASSIVE"), (falling, "ACTIVE")):
        with bpy.context.temp_override(object=body, selected_objects=[body], selected_editable_objects=[body]):
            bpy.ops.rigidbody.object_add(type=kind)
    for frame in range(1, 6):
        scene.frame_set(frame)
        before = state()
        render_scene()
        assert state() == before
    fallen = viewport_scene()
    height = fallen.geometry.vertices[fallen.geometry.triangles[fallen.geometry.object == 1]][..., 2].max()
    assert height < 1.0
    rendered = render_scene()
    np.testing.assert_allclose(rendered.geometry.vertices, fallen.geometry.vertices, atol=1e-5)
