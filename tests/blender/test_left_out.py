# SPDX-License-Identifier: GPL-3.0-or-later
"""What is left out of the bake is not exported, not in the box and not in Cycles' truth; toggling it is a change."""

from __future__ import annotations

import importlib
from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np
import pytest

from .export_scenes import add_object, cube_mesh
from .stored_grids import module


@pytest.fixture
def scene(extension: str) -> Iterator[Any]:
    """Return a scene of a room, a cube with a child in it, a lamp, and a second lamp."""
    bpy.ops.wm.read_homefile(use_empty=True)
    room = add_object("Room", cube_mesh("Room", 4.0))
    add_object("Cube", cube_mesh(), location=(1.0, 1.0, 10.0))
    for name, watts in (("Lamp", 10.0), ("Torch", 5.0)):
        light = bpy.data.lights.new(name, "POINT")
        light.energy = watts
        add_object(name, light, location=(2.0, 2.0, 2.0))
    add_object("Pairs", None, location=(-9.0, 0.0, 0.0), instance_type="COLLECTION")
    bpy.data.objects["Pairs"].instance_collection = bpy.data.collections.new("Pair")
    bpy.data.objects["Pairs"].instance_collection.objects.link(room)
    yield bpy.context.scene
    bpy.ops.wm.read_homefile(use_empty=True)


def test_left_out_objects_are_not_baked_and_named(extension: str, scene: Any) -> None:
    """Surfaces, lights and what an object instances; the scene without them is the same to the bit."""
    finish = importlib.import_module(f"{extension}.ivg_addon.core.progress").finish
    steps = module(extension, "export").export_render_steps
    names = ("Cube", "Torch", "Pairs")
    for name in names:
        bpy.data.objects[name].ivg.leave_out = True
    found = finish(steps(scene, bpy.context.view_layer))
    said = {notice.subject for notice in found.notices if "Leave Out" in notice.message}
    assert said >= {f"object '{name}'" for name in ("Cube", "Torch")}
    assert found.objects == ("Room",)
    assert list(found.lights.point.names) == ["Lamp"]
    box = module(extension, "bounds").scene_box(bpy.context.evaluated_depsgraph_get())
    np.testing.assert_allclose([box.low, box.high], [(0.0,) * 3, (4.0,) * 3])
    with module(extension, "cycles_stage").cycles_stage(
        scene, bpy.context.view_layer, samples=1, bounces=1, seed=0
    ) as (stage, _):
        assert {thing.name for thing in stage.objects if thing.hide_render} == set(names)
    assert not any(thing.hide_render for thing in scene.objects)
    for name in names:
        bpy.data.objects.remove(bpy.data.objects[name])
    assert finish(steps(scene, bpy.context.view_layer)).fingerprint() == found.fingerprint()


def test_leaving_out_is_a_change_and_moving_what_is_left_out_is_none(extension: str, scene: Any) -> None:
    staleness, cube = module(extension, "staleness"), bpy.data.objects["Cube"]
    bpy.context.view_layer.update()
    staleness.saw(scene, "00", staleness.edits(scene))
    cube.ivg.leave_out = True
    assert scene.ivg.changed_since
    bpy.context.view_layer.update()
    staleness.saw(scene, "00", staleness.edits(scene))
    cube.location.x += 1.0
    bpy.context.view_layer.update()
    assert not scene.ivg.changed_since
