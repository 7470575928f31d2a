# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials that are more than constants and images, evaluated by Cycles.

What a material's sockets hold is made to shine, on a mesh on which every triangle has texels of its own, and Cycles
bakes that. The mesh stands alone on a stage, which lives within one step of the work. What was evaluated is kept by
its content, so that an unchanged material is not evaluated twice.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from itertools import chain, zip_longest
from pathlib import Path

import bpy
import numpy as np

from ..core.errors import SceneError
from ..core.evaluation_plan import Plan, atlas_uvs, make_plan, renamed, scene_size
from ..core.instancing import Instances
from ..core.progress import Progress, part
from ..core.report import Notice
from .asking import Asker, Find, here
from .cycles_stage import bake_into_images, removed
from .evaluation_cache import Float32, cache_folder, content_key, keep, recall, tree_content
from .evaluation_mesh import StageArrays, Surroundings, make_mesh, stage_arrays
from .evaluation_normals import Texels, texel_normals
from .evaluation_tree import StageMaterial
from .export_materials import Evaluated, Unevaluated
from .export_sockets import DISPLACEMENT
from .jobs import PatientSteps, Runner, Steps, in_foreground

_BATCH_TEXELS = 1 << 20
"""Texels that one step bakes, about."""
_SAMPLES_IN_ALL = 1 << 21
"""Samples that one step takes, about; each texel's are spread over its area."""
_FEWEST_SAMPLES, _MOST_SAMPLES = 4, 16
_VERSION = "2"
"""Changes when the same content is evaluated otherwise."""


@dataclass(frozen=True)
class Evaluation:
    """What was evaluated.

    Parameters
    ----------
    materials
        By index.
    instances
        Those that were handed in, reading the atlases' coordinates.
    evaluated, recalled
        How many materials Cycles was asked for, and how many it had been asked for before.
    seconds
        What it took.
    """

    materials: dict[int, Evaluated]
    instances: list[Instances]
    evaluated: int
    recalled: int
    seconds: float
    notices: tuple[Notice, ...]


@dataclass(frozen=True)
class _Conditions:
    """What counts of the scene: between steps it may move in memory."""

    frame: int
    subframe: float
    threads_mode: str
    threads: int


@dataclass(frozen=True)
class _Work:
    """One material that is to be evaluated."""

    pending: Unevaluated
    plan: Plan
    arrays: StageArrays
    key: str


def evaluation_steps(
    scene: bpy.types.Scene,
    pending: Sequence[Unevaluated],
    around: Surroundings,
    ask: Asker = here,
    run: Runner = in_foreground,
) -> PatientSteps[Evaluation]:
    """Evaluate materials, some of them a step; the file is as it was whenever this yields, ends or fails.

    Parameters
    ----------
    scene
        Whose frame counts; not evaluated.
    around
        `meshes` are given the coordinates of the atlases.
    ask
        Where Cycles is asked.
    run
        How the part that never touches Blender is drained.

    Raises
    ------
    SceneError
        A render is running, or Cycles cannot bake.
    """
    start = time.perf_counter()
    render = scene.render
    conditions = _Conditions(scene.frame_current, scene.frame_subframe, render.threads_mode, render.threads)
    folder = cache_folder()
    asked: list[tuple[Unevaluated, list[bytes]]] = []
    notices: list[Notice] = []
    for number, entry in enumerate(pending):
        yield Progress("Preparing materials", 0.1 * number / len(pending))
        material = _find(entry.identity)
        if material is None:
            notices.append(Notice("warning", f"material '{entry.name}'", "was removed while it was read: black"))
        else:
            asked.append((entry, list(_content(material, entry, conditions))))
    prepared = yield from part(run(_prepare(asked, around, folder)), 0.1, 0.2)
    found = dict(prepared.recalled)
    batches = list(_batches(prepared.missing))
    for number, batch in enumerate(batches):
        task = f"Evaluating materials with Cycles ({number + 1} of {len(batches)})"
        low, high = (0.2 + 0.8 * share / len(batches) for share in (number, number + 1))
        baked = yield from part(ask(_bake, partial(_originals, batch), task, batch, conditions), low, high)
        found |= {work.pending.row: values for work, values in zip(batch, baked, strict=True)}
        yield from part(run(_keep(task, batch, baked, folder)), high, high)
    materials, instances = yield from part(run(_gather(prepared.plans, found, around)), 1.0, 1.0)
    return Evaluation(
        materials,
        instances,
        len(prepared.missing),
        len(prepared.recalled),
        time.perf_counter() - start,
        (*notices, *prepared.notices),
    )


@dataclass(frozen=True)
class _Prepared:
    """What is known before Cycles is asked: plans and values by the materials' indices."""

    plans: dict[int, Plan]
    recalled: dict[int, list[Float32]]
    missing: list[_Work]
    notices: list[Notice]


def _prepare(asked: Sequence[tuple[Unevaluated, list[bytes]]], around: Surroundings, folder: Path) -> Steps[_Prepared]:
    """Plan the evaluation of materials, each with its content, and recall what is known. Touches nothing of Blender."""
    prepared = _Prepared({}, {}, [], [])
    size = scene_size(around.meshes, around.instances)
    for number, (entry, content) in enumerate(asked):
        yield Progress("Preparing materials", number / len(asked))
        plan = make_plan(entry.row, entry.tree.needs.placed, around.meshes, around.instances, size, len(asked))
        if plan is None:
            continue
        prepared.plans[entry.row] = plan
        if plan.unplaced:
            notice = Notice(
                "simplified", f"material '{entry.name}'", "looks the same on all instances: there are too many"
            )
            prepared.notices.append(notice)
        arrays = stage_arrays(plan, entry.tree.needs, around)
        key = content_key(chain(content, arrays.content()))
        kept = recall(key, folder)
        if kept is not None:
            prepared.recalled[entry.row] = kept
        else:
            prepared.missing.append(_Work(entry, plan, arrays, key))
    return prepared


def _keep(task: str, batch: Sequence[_Work], baked: Sequence[list[Float32]], folder: Path) -> Steps[None]:
    """Keep what was evaluated. Touches nothing of Blender."""
    for work, values in zip(batch, baked, strict=True):
        yield Progress(task, 0.0)
        keep(work.key, values, folder)


def _gather(
    plans: dict[int, Plan], found: dict[int, list[Float32]], around: Surroundings
) -> Steps[tuple[dict[int, Evaluated], list[Instances]]]:
    """Make meshes and instances read the atlases. Touches nothing of Blender."""
    names: dict[tuple[int, int | None, int], str] = {}
    materials: dict[int, Evaluated] = {}
    for row, values in found.items():
        yield Progress("Placing materials", len(materials) / len(found))
        plan = plans[row]
        for number, (patch, uvs) in enumerate(zip(plan.patches, atlas_uvs(plan, around.meshes), strict=True)):
            name = f"atlas {row} {number}"
            around.meshes[patch.mesh].triangle_uvs[name] = uvs
            names |= {(index, patch.place, row): name for index in patch.instances}
        texels, _ = plan.atlas.texels()
        materials[row] = Evaluated(plan.atlas, texels, [array.astype(np.float64) for array in values])
    return materials, renamed(around.instances, names)


def _find(identity: int) -> bpy.types.Material | None:
    return next((material for material in bpy.data.materials if material.session_uid == identity), None)


def _content(material: bpy.types.Material, entry: Unevaluated, conditions: _Conditions) -> Iterator[bytes]:
    """Return all on which a material's values depend, but for the mesh."""
    leaves = [
        (leaf.groups, leaf.node, leaf.socket, leaf.colour, leaf.normal, leaf.side, leaf.cosine)
        for leaf in entry.tree.leaves
    ]
    yield f"{_VERSION} {bpy.app.version} {leaves} {material.pass_index} {material.displacement_method}".encode()
    tree = material.node_tree
    if entry.tree.needs.animated or tree.animation_data is not None:
        yield f"frame {conditions.frame} {conditions.subframe}".encode()
    yield from tree_content(tree)


def _batches(missing: Sequence[_Work]) -> Iterator[list[_Work]]:
    """Group materials so that each group is a step's work."""
    batch: list[_Work] = []
    texels = 0
    for work in missing:
        size = work.plan.atlas.width * work.plan.atlas.height
        if batch and texels + size > _BATCH_TEXELS:
            yield batch
            batch, texels = [], 0
        batch.append(work)
        texels += size
    if batch:
        yield batch


def _originals(batch: Sequence[_Work]) -> list[bpy.types.Material]:
    """Return the materials of a batch, which undo may have moved in memory."""
    found = []
    for work in batch:
        original = _find(work.pending.identity)
        if original is None:
            raise SceneError(f"material '{work.pending.name}' was removed while it was evaluated: bake again")
        found.append(original)
    return found


def _bake(find: Find, task: str, batch: Sequence[_Work], conditions: _Conditions) -> Steps[list[list[Float32]]]:
    """Return the values of each material's leaves, (k, 3) or (k, 1)."""
    yield Progress(task, 0.0)
    if any(bpy.app.is_job_running(job) for job in ("RENDER", "OBJECT_BAKE")):
        raise SceneError("a render is running: wait until it is done, or cancel it")
    values: list[list[Float32]] = [
        [np.empty((0, 1), dtype=np.float32)] * len(work.pending.tree.leaves) for work in batch
    ]
    with ExitStack() as stack:
        stage = stack.enter_context(removed(bpy.data.scenes, lambda: bpy.data.scenes.new("Stage")))
        _set_up(stage, conditions, sum(work.plan.atlas.width * work.plan.atlas.height for work in batch))
        mesh = stack.enter_context(removed(bpy.data.meshes, lambda: make_mesh([work.arrays for work in batch])))
        shown = stack.enter_context(removed(bpy.data.objects, lambda: bpy.data.objects.new("Stage", mesh)))
        stage.collection.objects.link(shown)
        materials = []
        for original, work in zip(find(), batch, strict=True):
            size = (work.plan.atlas.width, work.plan.atlas.height)
            materials.append(StageMaterial(stack, original, work.pending.tree.leaves, size))
            mesh.materials.append(materials[-1].material)
        covered = [work.plan.atlas.texels() for work in batch]
        for normals in (False, True):
            if normals:
                # As they are at the texels' centres: the mean of many would be less bumpy than each.
                stage.cycles.samples = 1
            passes = [material.normal_passes if normals else material.passes for material in materials]
            for turn in zip_longest(*passes, fillvalue=()):
                for material, showing in zip(materials, turn, strict=True):
                    material.show(showing)
                _bake_emission(stage, shown)
                for material, showing, work, texels, leaves in zip(
                    materials, turn, batch, covered, values, strict=True
                ):
                    if showing:
                        _take(material, showing, work, texels, leaves)
    return values


def _take(material: StageMaterial, showing: Sequence[int], work: _Work, texels: Texels, leaves: list[Float32]) -> None:
    """Fill in the values of the leaves that were baked; `texels` are those of the atlas."""
    sources = work.pending.tree.leaves
    baked = _pixels(material.image)[texels[0]]
    for channel, index in enumerate(showing):
        if sources[index].normal:
            bent = sources[index].socket == DISPLACEMENT
            leaves[index] = texel_normals(2.0 * baked - 1.0, work.plan, texels, work.arrays, bent)
        elif sources[index].colour:
            leaves[index] = baked
        else:
            leaves[index] = np.ascontiguousarray(baked[:, channel : channel + 1])


def _set_up(stage: bpy.types.Scene, conditions: _Conditions, texels: int) -> None:
    """Make a new scene bake as we need it, at the moment of another one."""
    # Assigned, not by frame_set: that would call other add-ons' handlers.
    stage.frame_current, stage.frame_subframe = conditions.frame, conditions.subframe
    stage.render.engine = "CYCLES"
    stage.cycles.samples = max(_FEWEST_SAMPLES, min(_MOST_SAMPLES, _SAMPLES_IN_ALL // texels))
    stage.cycles.use_denoising = stage.cycles.use_adaptive_sampling = False
    stage.cycles.sample_clamp_direct = 0.0
    stage.cycles.use_light_tree = False
    stage.render.threads_mode, stage.render.threads = conditions.threads_mode, conditions.threads


def _bake_emission(stage: bpy.types.Scene, shown: bpy.types.Object) -> None:
    layer = stage.view_layers[0]
    with (
        bpy.context.temp_override(
            scene=stage, view_layer=layer, active_object=shown, object=shown, selected_objects=[shown]
        ),
        bake_into_images() as bake,
    ):
        try:
            bake(type="EMIT")
        except RuntimeError as error:
            raise SceneError(f"Cycles cannot evaluate materials: {error}") from error


def _pixels(image: bpy.types.Image) -> Float32:
    """Return an image's texels, (n, 3)."""
    pixels = np.empty((image.size[0] * image.size[1], 4), dtype=np.float32)
    image.pixels.foreach_get(pixels.reshape(-1))
    return np.ascontiguousarray(pixels[:, :3])
