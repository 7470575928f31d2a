# SPDX-License-Identifier: GPL-3.0-or-later
"""A second Blender gives the answers that this one gives, to the bit, and nothing is left of it."""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from benchmarks.world_cases import gradient, picture, sky, world  # noqa: E402
from ivg_addon.blender import evaluation_cache, light_nodes, second_blender, world_map  # noqa: E402
from ivg_addon.blender.asking import here  # noqa: E402
from ivg_addon.blender.cycles_render import render_steps  # noqa: E402
from ivg_addon.blender.export import export_render_steps  # noqa: E402
from ivg_addon.blender.ground_truth import irradiance_steps  # noqa: E402
from ivg_addon.blender.light_nodes import light_node_steps  # noqa: E402
from ivg_addon.blender.second_blender import SecondBlender  # noqa: E402
from ivg_addon.blender.world_map import world_steps  # noqa: E402
from ivg_addon.core.errors import SceneError  # noqa: E402
from ivg_addon.core.progress import Progress  # noqa: E402
from tests.blender import questions  # noqa: E402

from ..core.steps import drain  # noqa: E402
from .cycles_scenes import lit_room, snapshot  # noqa: E402
from .evaluation_scenes import hills, noise, soft_image  # noqa: E402
from .export_scenes import empty_scene, new_material  # noqa: E402
from .export_trees import diffuse  # noqa: E402
from .test_light_nodes import lamp  # noqa: E402

MOST_SECONDS = 0.5
"""From Esc to idle."""


@pytest.fixture(autouse=True)
def _empty_session(monkeypatch: pytest.MonkeyPatch, kept_materials: Path) -> Iterator[None]:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    monkeypatch.setattr(world_map, "_WIDTH", 512)
    _forget(kept_materials)
    yield
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    _forget(kept_materials)


@pytest.fixture(scope="module")
def second() -> Iterator[SecondBlender]:
    """Return one process for all questions."""
    blender = SecondBlender()
    yield blender
    blender.end()


def _forget(kept_materials: Path) -> None:
    for path in kept_materials.iterdir():
        path.unlink()
    world_map._known.clear()
    light_nodes._known.clear()
    evaluation_cache.forget()


def assert_same(one: Any, other: Any) -> None:
    """Compare all arrays that two results hold, to the bit; what a clock says may differ."""
    assert type(one) is type(other)
    if isinstance(one, np.ndarray):
        np.testing.assert_array_equal(one, other)
    elif is_dataclass(one):
        for field in fields(one):
            if "seconds" not in field.name and field.name != "surfaces":
                assert_same(getattr(one, field.name), getattr(other, field.name))
    elif isinstance(one, list | tuple):
        assert len(one) == len(other)
        for first, second in zip(one, other, strict=True):
            assert_same(first, second)
    elif isinstance(one, dict):
        assert one.keys() == other.keys()
        for key in one:
            assert_same(one[key], other[key])
    else:
        assert one == other


def assert_asks(answer: Any, second: SecondBlender, kept_materials: Path) -> None:
    """Ask here and there: `answer` takes an asker."""
    before = snapshot(bpy.context.scene)
    found = drain(answer(here))
    _forget(kept_materials)
    there = []

    def ask(*arguments: Any) -> Any:
        there.append(arguments)
        return second.ask(*arguments)

    asked = answer(ask)
    while True:
        try:
            progress = next(asked)
        except StopIteration as end:
            assert_same(found, end.value)
            break
        if progress is None:
            time.sleep(0.01)
        else:
            assert snapshot(bpy.context.scene) == before
    assert there
    assert snapshot(bpy.context.scene) == before


@pytest.mark.parametrize("make", [sky("SINGLE_SCATTERING", disc=True, size=0.1), picture, gradient])
def test_worlds(make: Any, second: SecondBlender, kept_materials: Path) -> None:
    world(make)()
    assert_asks(lambda ask: world_steps(bpy.context.scene, bpy.context.view_layer, ask), second, kept_materials)


@pytest.mark.parametrize("packed", [False, True])
def test_a_world_with_a_painted_image(packed: bool, second: SecondBlender, kept_materials: Path) -> None:
    """Its pixels are in memory alone: neither a file of its own nor the .blend has them."""
    world(picture)()
    texture = next(node for node in bpy.context.scene.world.node_tree.nodes if node.type == "TEX_ENVIRONMENT")
    image = bpy.data.images.new("Painted", 32, 16, float_buffer=True)
    if packed:
        image.pixels.foreach_set(np.full(4 * 32 * 16, 0.25, dtype=np.float32))
        image.pack()
    texture.image = image
    image.pixels.foreach_set(np.random.default_rng(1).random(4 * 32 * 16, dtype=np.float32))
    assert image.is_dirty
    assert_asks(lambda ask: world_steps(bpy.context.scene, bpy.context.view_layer, ask), second, kept_materials)
    assert not list(bpy.data.libraries)


def test_a_linked_world(second: SecondBlender, kept_materials: Path, tmp_path: Path) -> None:
    world(gradient)()
    bpy.data.libraries.write(str(tmp_path / "worlds.blend"), {bpy.context.scene.world})
    bpy.data.worlds.remove(bpy.context.scene.world)
    with bpy.data.libraries.load(str(tmp_path / "worlds.blend"), link=True) as (_, wanted):
        wanted.worlds = ["World"]
    (bpy.context.scene.world,) = wanted.worlds
    assert bpy.context.scene.world.library is not None
    assert_asks(lambda ask: world_steps(bpy.context.scene, bpy.context.view_layer, ask), second, kept_materials)


def test_materials(second: SecondBlender, kept_materials: Path) -> None:
    empty_scene()
    hills(new_material("Noise", diffuse(noise("Object"))))
    hills(new_material("Image", diffuse(soft_image())))
    assert_asks(lambda ask: export_render_steps(bpy.context.scene, bpy.context.view_layer, ask), second, kept_materials)


def test_lights(second: SecondBlender, kept_materials: Path) -> None:
    lamp("AREA", "ShaderNodeTexNoise", "Color", into="Color")
    assert_asks(lambda ask: light_node_steps(bpy.context.scene, bpy.context.view_layer, ask), second, kept_materials)


def test_a_comparison(second: SecondBlender, kept_materials: Path) -> None:
    scene = lit_room()
    layer = bpy.context.view_layer
    assert_asks(lambda ask: render_steps(scene, layer, samples=8, ask=ask), second, kept_materials)
    points, normals = [[1.0, 0.5, 1.0], [1.5, 0.5, 0.2]], [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]
    assert_asks(lambda ask: irradiance_steps(scene, points, normals, samples=32, ask=ask), second, kept_materials)


def test_a_mesh_that_is_edited(second: SecondBlender, kept_materials: Path) -> None:
    """What was changed in edit mode is seen, as a render here sees it."""
    scene = lit_room()
    bpy.context.view_layer.objects.active = bpy.data.objects["Block"]
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.resize(value=(0.5, 0.5, 2.0))
    assert_asks(lambda ask: render_steps(scene, bpy.context.view_layer, samples=4, ask=ask), second, kept_materials)
    bpy.ops.object.mode_set(mode="OBJECT")


def _begun(second: SecondBlender, question: Any, *arguments: Any) -> Any:
    """Ask until the answer has begun; return the steps."""
    steps = second.ask(question, lambda: [], *arguments)
    while True:
        progress = next(steps)
        if progress is not None and progress.task in {"Waiting", "Failing"}:
            return steps
        time.sleep(0.01)


def _gone(second: SecondBlender) -> bool:
    """End it and wait until its thread has cleared up; tell whether process and folder are gone."""
    process = second._process
    assert process is not None
    second.end()
    for thread in threading.enumerate():
        if thread.name == "ivg-second-blender-end":
            thread.join(30.0)
    return process._program.poll() is not None and not process.folder.exists()


def test_cancelling_ends_it_at_once() -> None:
    scene = lit_room()
    before = snapshot(scene)
    second = SecondBlender()
    steps = _begun(second, questions.wait, 600.0)
    process = second._process
    assert process is not None
    start = time.perf_counter()
    steps.close()
    assert time.perf_counter() - start < MOST_SECONDS
    assert second._process is None
    process._program.wait(30.0)
    assert snapshot(scene) == before


def test_nothing_is_left_in_the_end() -> None:
    empty_scene()
    second = SecondBlender()
    steps = _begun(second, questions.leave_a_file)
    drain(steps)
    assert _gone(second)


def test_it_ends_with_the_blender_that_asks() -> None:
    second = SecondBlender()
    steps = _begun(second, questions.wait, 600.0)
    process = second._process
    assert process is not None
    assert process._program.stdin is not None
    process._program.stdin.close()
    assert process._program.wait(30.0) == 0
    assert not process.folder.exists()
    with pytest.raises(SceneError, match="ended by itself"):
        drain(steps)


def test_an_error_of_ours_is_raised_as_it_is(second: SecondBlender) -> None:
    with pytest.raises(SceneError, match=r"^no light$"):
        drain(second.ask(questions.refuse, lambda: [], "ours"))
    drain(second.ask(questions.wait, lambda: [], 0.0))


def test_another_error_is_told_with_its_place(second: SecondBlender) -> None:
    with pytest.raises(RuntimeError, match=r"(?s)in refuse.*ValueError: not foreseen"):
        drain(second.ask(questions.refuse, lambda: [], "unforeseen"))


def test_a_crash_is_an_error_and_the_next_question_starts_anew(second: SecondBlender) -> None:
    with pytest.raises(SceneError, match=r"ended by itself \(a wild crash\): try again"):
        drain(second.ask(questions.refuse, lambda: [], "crash"))
    drain(second.ask(questions.wait, lambda: [], 0.0))


@pytest.mark.parametrize("command", [["/nowhere/blender"], [sys.executable, "-c", "raise SystemExit(1)"]])
def test_where_none_starts_the_question_is_answered_here(command: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(second_blender, "_command", lambda: command)
    second = SecondBlender()
    assert drain(second.ask(questions.process, lambda: [])) == os.getpid()
    assert drain(second.ask(questions.process, lambda: [])) == os.getpid()
    assert second._process is None


def test_what_a_file_would_not_keep_is_answered_here(second: SecondBlender) -> None:
    scene = lit_room()
    assert drain(second.ask(questions.process, lambda: [scene])) != os.getpid()
    group = bpy.data.node_groups.new("Simulation", "GeometryNodeTree")
    group.nodes.new("GeometryNodeSimulationInput")
    assert drain(second.ask(questions.process, lambda: [scene])) == os.getpid()
    assert drain(second.ask(questions.process, lambda: [bpy.data.materials[0]])) != os.getpid()
    bpy.data.node_groups.remove(group)
    bpy.ops.rigidbody.world_add()
    assert drain(second.ask(questions.process, lambda: [scene])) == os.getpid()


def test_samples_of_a_render_move_the_progress(second: SecondBlender) -> None:
    """Without them there would be two values for two renders, and the answer's."""
    scene = lit_room()
    scene.render.resolution_x, scene.render.resolution_y = 700, 600  # four tiles
    scene.cycles.samples = 4
    told = [step.fraction for step in _progresses(render_steps(scene, bpy.context.view_layer, ask=second.ask))]
    assert told == sorted(told)
    assert len(set(told)) >= 8


def _progresses(steps: Any) -> Iterator[Progress]:
    for step in steps:
        if step is not None:
            yield step
        time.sleep(0.01)
