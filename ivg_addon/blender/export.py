# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender scene, as the arrays that a bake reads.

First all that is needed is read from Blender, on its main thread; then numpy makes triangles in
world space of it. Closing the generators at any step leaves nothing behind in Blender.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import TypeVar

import bpy
import numpy as np

from ..core.doubled_faces import blackened, doubled_triangles
from ..core.errors import Cancelled, SceneError
from ..core.instancing import Flattened, Instances, MeshData, flatten_steps
from ..core.light_rules import LightRules
from ..core.lights import Lights
from ..core.memory import human
from ..core.progress import Progress, part
from ..core.report import Notice, merge
from ..core.ribbons import as_ribbons
from ..core.scene import Int32, Scene, SurfaceRecord
from .asking import Asker, here
from .evaluation import Evaluation, evaluation_steps
from .evaluation_data import ObjectLook, SurfaceData
from .evaluation_mesh import Surroundings
from .export_depsgraph import with_render_depsgraph
from .export_geometry import GeometryReader
from .export_lights import export_lights
from .export_materials import MaterialTable
from .jobs import PatientSteps, Runner, Steps, in_foreground
from .left_out import LeftOut
from .light_linking import LinkingReader
from .light_nodes import NodeLight, light_node_steps
from .scenes import find_scene
from .world_map import WorldLight, world_steps

Result = TypeVar("Result")

_WORLD, _READING, _PLACING = 0.2, 0.4, 0.7
"""Shares of the whole after which the world is evaluated, the scene read, and its materials are evaluated."""
_MANY_COPIES = 4
"""From so many times the unique triangles on, a notice says that instances cost memory."""
_WORKING_SPACE = "Linear Rec.709"
_WORLDS_SHADOW = "blocks the world's light as its shadow rays say: of a uniform world, Cycles asks diffuse rays"


def export_scene(depsgraph: bpy.types.Depsgraph) -> Scene:
    """Return what a depsgraph shows, all at once; see `export_steps`."""
    return _drain(export_steps(depsgraph))


def export_steps(depsgraph: bpy.types.Depsgraph) -> Steps[Scene]:
    """Return what an evaluated depsgraph shows, in small steps.

    It must not be evaluated anew before the generator is done: between steps, nothing in Blender
    may change. Where that cannot be promised, or where the viewport's depsgraph is all there is,
    use `export_render_steps`.

    Raises
    ------
    SceneError
        When there is nothing that light could meet.
    MemoryLimitError
        When the geometry with all instances does not fit.
    """
    reading = yield from _read_steps(depsgraph, False)
    return (yield from _build_steps(reading, depsgraph.scene.name, None))


def export_render_steps(
    scene: bpy.types.Scene,
    view_layer: bpy.types.ViewLayer,
    ask: Asker = here,
    run: Runner = in_foreground,
    *,
    to_camera: bool = False,
) -> PatientSteps[Scene]:
    """Return what a render of a view layer would show, in steps.

    The first steps ask Cycles about lights, and a world, whose nodes are no constants. The next evaluates the scene and
    reads all of it, for nothing may change in between; Esc stops it. Then Cycles is asked for materials that are
    more than constants and images. The last steps no longer need Blender.

    Parameters
    ----------
    ask
        Where Cycles is asked.
    run
        How the part that never touches Blender is drained.
    to_camera
        With materials as camera rays see them; else as photons do. See `MaterialTable`.

    Raises
    ------
    Cancelled
        When the user asked to stop while the scene was read.
    SceneError
        When there is nothing that light could meet, or a render is running.
    MemoryLimitError
        When the geometry with all instances does not fit.
    """
    name, identity, layer_name = scene.name, scene.session_uid, view_layer.name
    node_lights = yield from light_node_steps(scene, view_layer, ask)
    scene = find_scene(name, identity, "read")
    world = yield from part(world_steps(scene, scene.view_layers[layer_name], ask), 0.0, _WORLD)
    yield Progress("Evaluating the scene", _WORLD)
    scene = find_scene(name, identity, "read")
    view_layer = scene.view_layers[layer_name]
    evaluate = hasattr(scene, "cycles")
    reading = with_render_depsgraph(
        scene,
        view_layer,
        lambda depsgraph, stop: _drain(_read_steps(depsgraph, evaluate, node_lights, world, to_camera), stop),
    )
    yield Progress("Preparing materials", _READING)
    pending = tuple(reading.materials.unevaluated.values())
    evaluation = None
    if pending:
        around = Surroundings(reading.meshes, reading.instances, reading.data, reading.looks)
        steps = evaluation_steps(find_scene(name, identity, "read"), pending, around, ask, run)
        evaluation = yield from part(steps, _READING, _PLACING)
    return (yield from run(_build_steps(reading, name, evaluation)))


@dataclass(frozen=True)
class _Reading:
    """All that was read from Blender; none of it refers to Blender's data."""

    meshes: list[MeshData]
    instances: list[Instances]
    objects: tuple[str, ...]
    diffuse_visible: tuple[bool, ...]
    data: dict[int, SurfaceData]
    looks: list[list[ObjectLook]]
    materials: MaterialTable
    lights: Lights
    light_rules: LightRules | None
    world_seconds: float | None
    notices: tuple[Notice, ...]


def _read_steps(
    depsgraph: bpy.types.Depsgraph,
    evaluate: bool,
    node_lights: Mapping[str, NodeLight] | None = None,
    world: WorldLight | None = None,
    to_camera: bool = False,
) -> Steps[_Reading]:
    """Read everything from an evaluated depsgraph, one object instance per step."""
    view_layer = depsgraph.view_layer_eval
    materials = MaterialTable(depsgraph.scene_eval, view_layer.material_override, evaluate, to_camera)
    geometry = GeometryReader(materials, depsgraph)
    left_out = LeftOut()
    count = max(1, len(depsgraph.object_instances))
    for index, instance in enumerate(depsgraph.object_instances):
        if not left_out.has(instance):
            geometry.add(instance)
        yield Progress("Reading the scene", _WORLD + (_READING - _WORLD) * index / count)
    linking = LinkingReader()
    lights, light_notices = export_lights(depsgraph, linking, node_lights, world, left_out)
    light_rules = linking.rules(geometry.objects, geometry.shadow_visible, depsgraph)
    return _Reading(
        meshes=geometry.meshes,
        instances=geometry.instances,
        objects=tuple(geometry.objects),
        diffuse_visible=tuple(geometry.diffuse_visible),
        data=geometry.data,
        looks=geometry.looks,
        materials=materials,
        lights=lights,
        light_rules=light_rules,
        world_seconds=None if world is None else world.seconds,
        notices=merge(
            (
                *_colour_notices(),
                *left_out.notices(),
                *geometry.notices,
                *light_notices,
                *linking.notices,
                *(_world_notices(geometry) if lights.world.any() else ()),
            )
        ),
    )


def _build_steps(reading: _Reading, name: str, evaluation: Evaluation | None) -> Steps[Scene]:
    """Make the scene of what was read and evaluated. Touches no Blender data."""
    yield Progress("Placing geometry", _PLACING)
    instances = reading.instances if evaluation is None else evaluation.instances
    flattened = yield from part(flatten_steps(reading.meshes, instances), _PLACING, 1.0)
    if not flattened.geometry.triangle_count:
        bad = sum(flattened.dropped.values())
        raise SceneError(
            f"scene '{name}' has no mesh, curve, surface, text, hair or point cloud that light could meet: "
            + (f"all {bad:,} triangles are without area or not finite" if bad else "add one, or show it in renders")
        )
    yield Progress("Placing materials", 1.0)
    materials, textures, notices = reading.materials.finish({} if evaluation is None else evaluation.materials)
    if evaluation is not None:
        notices = (*notices, *evaluation.notices)
    diffuse_visible = np.array(reading.diffuse_visible, dtype=np.bool_)
    geometry = flattened.geometry
    if len(flattened.ribbons):
        geometry, materials = as_ribbons(geometry, materials, flattened.ribbons)
    across, others = doubled_triangles(geometry, materials, diffuse_visible)
    if len(across):
        geometry, materials = blackened(geometry, materials, across)
    doubles = (
        *_doubled_notices(reading.objects, geometry.object[across], "black, as in Cycles"),
        *_doubled_notices(reading.objects, geometry.object[others], "in Cycles they lose about half of their light"),
    )
    return Scene(
        name=name,
        geometry=geometry,
        materials=materials,
        textures=textures,
        lights=reading.lights,
        objects=reading.objects,
        diffuse_visible=diffuse_visible,
        light_rules=reading.light_rules,
        notices=merge((*reading.notices, *notices, *_geometry_notices(reading, flattened), *doubles)),
        surfaces=_record(reading, evaluation),
    )


def _record(reading: _Reading, evaluation: Evaluation | None) -> SurfaceRecord:
    """Return where materials and world came from."""
    record = SurfaceRecord(reading.materials.read_directly, world_seconds=reading.world_seconds)
    if evaluation is None:
        return record
    evaluated, recalled = evaluation.evaluated, evaluation.recalled
    return replace(record, evaluated=evaluated, recalled=recalled, seconds=evaluation.seconds)


def _geometry_notices(reading: _Reading, flattened: Flattened) -> Iterator[Notice]:
    """Say which triangles cannot be lit, and what instances cost."""
    for index, count in flattened.dropped.items():
        triangles = "1 triangle" if count == 1 else f"{count:,} triangles"
        yield Notice(
            "warning",
            f"object '{reading.objects[index]}'",
            f"{triangles} without area or with coordinates that are not numbers left out",
        )
    total = flattened.geometry.triangle_count
    if total > _MANY_COPIES * flattened.unique_triangles:
        geometry = flattened.geometry
        size = sum(getattr(geometry, array.name).nbytes for array in fields(geometry))
        yield Notice(
            "simplified",
            "instances",
            f"written out one by one: {flattened.unique_triangles:,} triangles became {total:,}, "
            f"{human(size)} of memory",
        )


def _world_notices(geometry: GeometryReader) -> Iterator[Notice]:
    """Say which objects block the light of a uniform world in Cycles and not here, or the other way round."""
    for name, diffuse, shadow in zip(geometry.objects, geometry.diffuse_visible, geometry.shadow_visible, strict=True):
        if diffuse != shadow:
            yield Notice("simplified", f"object '{name}'", _WORLDS_SHADOW)


def _doubled_notices(objects: Sequence[str], owners: Int32, fate: str) -> Iterator[Notice]:
    """Say whose triangles lie exactly in others, and what becomes of them."""
    for index, count in zip(*np.unique(owners, return_counts=True), strict=True):
        triangles = "1 triangle lies" if count == 1 else f"{count:,} triangles lie"
        message = f"{triangles} exactly in others, {fate}: merge by distance, or delete the duplicate"
        yield Notice("warning", f"object '{objects[index]}'", message)


def _colour_notices() -> Iterator[Notice]:
    """Say so where colours are not what the whole bake takes them for."""
    space = bpy.data.colorspace.working_space
    if space != _WORKING_SPACE:
        yield Notice("simplified", "colours", f"working space '{space}' taken as '{_WORKING_SPACE}'")


def _drain(steps: Steps[Result], stop: Callable[[], bool] = lambda: False) -> Result:
    """Take all steps and return what they return; raises `Cancelled` as soon as `stop` says so."""
    try:
        while not stop():
            next(steps)
    except StopIteration as end:
        result: Result = end.value
        return result
    steps.close()
    raise Cancelled("export stopped, nothing was changed")
