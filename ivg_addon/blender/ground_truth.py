# SPDX-License-Identifier: GPL-3.0-or-later
"""The truth about irradiance: Cycles, asked at any points and normals.

A small white quad stands at each point and faces along the normal; Cycles bakes the diffuse light that arrives at it
into a texel of its own. (Not into attributes of its corners: rays from these have no footprint, over which Bump nodes
take their differences, and would see no bumps.)
No ray but the camera's sees the quads, so they neither shade nor light anything, each other included. (The camera must
see them, or the bake returns zeros.) A white diffuse surface reflects E/π.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Literal

import bpy
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core.errors import SceneError, SettingsError
from ..core.metrics import mean_and_error
from ..core.progress import Progress, finish
from .asking import Asker, Find, here
from .cycles_stage import bake_into_images, changed, cycles_stage, removed
from .jobs import PatientSteps, Steps

Float64 = NDArray[np.float64]
Component = Literal["INDIRECT", "DIRECT", "ALL"]

BATCHES = 8
"""Independent bakes, unless told otherwise; how much they scatter is the standard error."""

_HALF_QUAD = 1e-4
"""Half of a quad's edge, as a share of the largest coordinate: enough that rounding does not turn it."""
_CORNERS = 4
_WIDTH = 4096
"""Most texels of a row."""
_FILTERS = {"INDIRECT": {"INDIRECT"}, "DIRECT": {"DIRECT"}, "ALL": {"DIRECT", "INDIRECT"}}
_UNSEEN = ("diffuse", "glossy", "transmission", "volume_scatter", "shadow")


@dataclass(frozen=True)
class Measured:
    """What Cycles found.

    Parameters
    ----------
    irradiance : (n, 3) float64
        W/m², linear RGB.
    error : (n, 3) float64
        Standard error of each value.
    """

    irradiance: Float64
    error: Float64


def cycles_irradiance(
    scene: bpy.types.Scene,
    points: ArrayLike,
    normals: ArrayLike,
    *,
    view_layer: bpy.types.ViewLayer | None = None,
    component: Component = "INDIRECT",
    samples: int = 1024,
    bounces: int = 12,
    seed: int = 0,
) -> Float64:
    """Return the irradiance (n, 3), W/m², that Cycles computes; see `irradiance_steps`."""
    steps = irradiance_steps(
        scene,
        points,
        normals,
        view_layer=view_layer,
        component=component,
        samples=samples,
        bounces=bounces,
        seed=seed,
    )
    return finish(steps).irradiance


def irradiance_steps(
    scene: bpy.types.Scene,
    points: ArrayLike,
    normals: ArrayLike,
    *,
    view_layer: bpy.types.ViewLayer | None = None,
    component: Component = "INDIRECT",
    samples: int = 1024,
    bounces: int = 12,
    seed: int = 0,
    batches: int = BATCHES,
    ask: Asker = here,
) -> PatientSteps[Measured]:
    """Measure irradiance by Cycles, one bake a step; the file is as it was whenever this yields, ends or fails.

    Parameters
    ----------
    points, normals : (n, 3)
        Metres, world space; normals of any length but zero.
    view_layer
        The active one, or the scene's first, when not given.
    component
        "INDIRECT": light after at least one bounce, what a grid holds; "DIRECT": straight from lights, emissive
        surfaces and the world; "ALL": both.
    samples
        Paths per point, in independent batches; rounded up to a multiple of their number.
    bounces
        Most bounces of light before it arrives.
    batches
        Two or more; few where the scatter over many points tells more than that over the batches of each.
    ask
        Where Cycles is asked.

    Raises
    ------
    SceneError
        Cycles is not enabled, a render is running, or Blender cannot bake.
    SettingsError
        Shapes that do not agree, nothing to measure, values that are not finite, normals of length zero.
    """
    p, n = _checked(points, normals)
    layer = (view_layer or _view_layer(scene)).name
    each = max(1, math.ceil(samples / batches))
    seeds = range(batches * seed, batches * (seed + 1))
    return (yield from ask(_bake_all, lambda: [scene], layer, p, n, component, each, bounces, seeds))


def _bake_all(
    find: Find,
    layer: str,
    points: Float64,
    normals: Float64,
    component: Component,
    samples: int,
    bounces: int,
    seeds: range,
) -> Steps[Measured]:
    """Bake, once with every seed."""
    found = []
    for number, seed in enumerate(seeds):
        yield Progress(f"Asking Cycles at {len(points):,} points", number / len(seeds))
        (scene,) = find()
        view_layer = scene.view_layers[layer]
        found.append(bake_irradiance(scene, view_layer, points, normals, component, samples, bounces, seed))
    return Measured(*mean_and_error(found))


def _checked(points: ArrayLike, normals: ArrayLike) -> tuple[Float64, Float64]:
    """Return points and unit normals, (n, 3) float64."""
    p, n = np.asarray(points, dtype=np.float64), np.asarray(normals, dtype=np.float64)
    if p.ndim != 2 or p.shape[1:] != (3,) or p.shape != n.shape or not len(p):
        raise SettingsError(f"points {p.shape} and normals {n.shape} must both have the shape (n, 3), n at least 1")
    length = np.linalg.norm(n, axis=1, keepdims=True)
    if not (np.isfinite(p).all() and np.isfinite(n).all() and length.all()):
        raise SettingsError("points and normals must be finite numbers, normals not of length zero")
    return p, n / length


def _view_layer(scene: bpy.types.Scene) -> bpy.types.ViewLayer:
    return bpy.context.view_layer if bpy.context.scene == scene else scene.view_layers[0]


def bake_irradiance(
    scene: bpy.types.Scene,
    view_layer: bpy.types.ViewLayer,
    points: Float64,
    normals: Float64,
    component: Component,
    samples: int,
    bounces: int,
    seed: int,
) -> Float64:
    """Bake once, `samples` paths at each point; return the irradiance (n, 3)."""
    with (
        cycles_stage(scene, view_layer, samples=samples, bounces=bounces, seed=seed) as (stage, layer),
        _receivers(stage, points, normals) as (receivers, picture),
        changed({(stage.render.bake, "use_multires"): False}),
        bpy.context.temp_override(
            scene=stage, view_layer=layer, active_object=receivers, object=receivers, selected_objects=[receivers]
        ),
        bake_into_images() as bake,
    ):
        try:
            bake(type="DIFFUSE", pass_filter=_FILTERS[component])
        except RuntimeError as error:
            raise SceneError(f"Cycles cannot bake '{scene.name}': {error}") from error
        colors = np.empty((picture.size[0] * picture.size[1], 4), dtype=np.float32)
        picture.pixels.foreach_get(colors.reshape(-1))
    return np.asarray(math.pi * colors[: len(points), :3].astype(np.float64))


@contextmanager
def _receivers(
    scene: bpy.types.Scene, points: Float64, normals: Float64
) -> Iterator[tuple[bpy.types.Object, bpy.types.Image]]:
    """Put quads into a scene, as one object, and yield it with the image of a texel for each."""
    data = bpy.data
    with ExitStack() as stack:
        width, height = _image_size(len(points))
        picture = stack.enter_context(
            removed(data.images, lambda: data.images.new("Receivers", width, height, float_buffer=True, is_data=True))
        )
        material = stack.enter_context(removed(data.materials, lambda: _white(picture)))
        mesh = stack.enter_context(removed(data.meshes, lambda: _quads(points, normals)))
        mesh.materials.append(material)
        made = stack.enter_context(removed(data.objects, lambda: data.objects.new("Receivers", mesh)))
        for ray in _UNSEEN:
            setattr(made, f"visible_{ray}", False)
        scene.collection.objects.link(made)
        yield made, picture


def _quads(points: Float64, normals: Float64) -> bpy.types.Mesh:
    """Return a mesh with a square at each point, its front towards the normal."""
    # The axis that the normal is farthest from gives tangents that never vanish.
    axis = np.eye(3)[np.abs(normals).argmin(axis=1)]
    tangent = np.cross(normals, axis)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    bitangent = np.cross(normals, tangent)
    half = _HALF_QUAD * (float(np.abs(points).max()) or 1.0)
    corners = [points + half * (a * tangent + b * bitangent) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    count = len(points)
    mesh = bpy.data.meshes.new("Receivers")
    mesh.vertices.add(_CORNERS * count)
    mesh.vertices.foreach_set("co", np.stack(corners, axis=1).astype(np.float32).reshape(-1))
    mesh.loops.add(_CORNERS * count)
    mesh.loops.foreach_set("vertex_index", np.arange(_CORNERS * count, dtype=np.int32))
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, _CORNERS * count, _CORNERS, dtype=np.int32))
    width, height = _image_size(count)
    row, column = np.divmod(np.arange(count), width)
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    uvs = (np.stack([column, row], axis=1)[:, None] + square) / (width, height)
    mesh.uv_layers.new(name="Receivers").uv.foreach_set("vector", uvs.astype(np.float32).reshape(-1))
    mesh.update()
    return mesh


def _image_size(points: int) -> tuple[int, int]:
    """Return the width and height of an image with a texel for each point."""
    width = min(_WIDTH, math.ceil(math.sqrt(points)))
    return width, math.ceil(points / width)


def _white(picture: bpy.types.Image) -> bpy.types.Material:
    """Return a material that reflects all light diffusely, and is baked into an image."""
    material = bpy.data.materials.new("Receivers")
    tree = material.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    target = tree.nodes.new("ShaderNodeTexImage")
    target.image = picture
    tree.nodes.active = target
    return material
