# SPDX-License-Identifier: GPL-3.0-or-later
"""A stage on which Cycles is asked for the truth: the user's scene with its own settings put aside.

The stage is a copy of the scene that shares all its contents, so the user's settings, selection and mode are never
touched; what is added to it is removed again. It lives within one step of the work: between steps nothing of it is in
the file, whatever the user does meanwhile.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from functools import partial
from typing import Any

import bpy

from ..core.errors import SceneError
from .left_out import left_out

Settings = Mapping[tuple[bpy.types.bpy_struct, str], Any]
"""Values by the Blender data that has them and the name of the property."""

_RENDER_JOBS = ("RENDER", "OBJECT_BAKE")


@contextmanager
def cycles_stage(
    scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, *, samples: int, bounces: int, seed: int
) -> Iterator[tuple[bpy.types.Scene, bpy.types.ViewLayer]]:
    """Set the stage: Cycles, tracing paths of at most so many bounces without any bias; see `truthful`.

    Objects that a bake leaves out are not on it, so that both have the same light.

    Raises
    ------
    SceneError
        Cycles is not enabled, or a render is running.
    """
    if not hasattr(scene, "cycles"):
        raise SceneError("the comparison needs Cycles: enable the add-on 'Cycles Render Engine' in the preferences")
    if any(bpy.app.is_job_running(job) for job in _RENDER_JOBS):
        raise SceneError("a render is running: wait until it is done, or cancel it")
    with copy_of(scene) as stage, _world_for_portals(stage):
        layer = stage.view_layers[view_layer.name]
        with changed(truthful(stage, layer, samples=samples, bounces=bounces, seed=seed)):
            yield stage, layer


@contextmanager
def _world_for_portals(stage: bpy.types.Scene) -> Iterator[None]:
    """Give a stage without a world a black one where there are portals: without any, Cycles crashes (Blender 5.2)."""
    if stage.world is not None or not any(_is_portal(light) for light in bpy.data.lights):
        yield
        return
    with removed(bpy.data.worlds, _black) as world, changed({(stage, "world"): world}):
        yield


def _is_portal(light: bpy.types.Light) -> bool:
    return light.type == "AREA" and bool(light.cycles.is_portal)


def _black() -> bpy.types.World:
    """Return a world without light."""
    world = bpy.data.worlds.new("Black")
    world.node_tree.nodes.clear()
    return world


@contextmanager
def changed(settings: Settings) -> Iterator[None]:
    """Change settings for a while; whatever happens, they are put back, in the order in which they are given.

    A setting that others depend on (an image's format, before its colour depth) comes first.
    """
    before = {setting: getattr(*setting) for setting in settings}
    try:
        for (owner, name), value in settings.items():
            setattr(owner, name, value)
        yield
    finally:
        for (owner, name), value in before.items():
            setattr(owner, name, value)


@contextmanager
def bake_into_images() -> Iterator[Callable[..., object]]:
    """Yield the operator that bakes the active object into the images of its materials.

    It would say, where a terminal listens, that these are not saved: they live as long as the stage.
    """
    settings = {"target": "IMAGE_TEXTURES", "save_mode": "INTERNAL", "margin": 0, "use_clear": True}
    with redirect_stdout(io.StringIO()):
        yield partial(bpy.ops.object.bake, use_selected_to_active=False, **settings)


@contextmanager
def removed(collection: bpy.types.bpy_prop_collection, make: Callable[[], bpy.types.ID]) -> Iterator[bpy.types.ID]:
    """Make a datablock, and remove it from `bpy.data`'s collection in the end."""
    made = make()
    try:
        yield made
    finally:
        collection.remove(made)


def truthful(
    scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, *, samples: int, bounces: int, seed: int
) -> dict[tuple[bpy.types.bpy_struct, str], Any]:
    """Return the settings that make Cycles' light comparable with a grid's.

    Off is what trades truth for less noise (clamping, denoising, adaptive sampling, filtered glossy, fast global
    illumination), what scales the result (film exposure), and what a grid knows nothing of (motion blur, further view
    layers, objects that only show a grid or are left out of bakes). A path has at most `bounces` bounces in all and as
    many diffuse ones, as a photon's path has. Limits of other bounces, caustics, light tree, path guiding and the
    device stay as the user has them: the light that glass and metal pass on belongs to the truth, whether the bake
    knows of it or not.
    """
    cycles, render = scene.cycles, scene.render
    other_layers = {(layer, "use"): layer.name == view_layer.name for layer in scene.view_layers}
    return {
        (render, "engine"): "CYCLES",
        (cycles, "samples"): samples,
        (cycles, "seed"): seed,
        (cycles, "max_bounces"): bounces,
        (cycles, "diffuse_bounces"): bounces,
        (cycles, "film_exposure"): 1.0,
        (cycles, "sample_clamp_direct"): 0.0,
        (cycles, "sample_clamp_indirect"): 0.0,
        (cycles, "blur_glossy"): 0.0,
        (cycles, "time_limit"): 0.0,
        (cycles, "use_layer_samples"): "IGNORE",
        (cycles, "use_auto_tile"): True,
        (cycles, "tile_size"): _TILE,
        **{(cycles, f"use_{feature}"): False for feature in _BIASED},
        **{(render, f"use_{feature}"): False for feature in _UNKNOWN_TO_GRIDS},
        **other_layers,
        **{(shown, "hide_render"): True for shown in left_out(scene)},
    }


_TILE = 512
"""Pixels along a tile's edge: each tile that is done is told. What is rendered is the same to the bit."""
_BIASED = ("denoising", "adaptive_sampling", "fast_gi", "animated_seed", "sample_subset")
_UNKNOWN_TO_GRIDS = ("compositing", "sequencer", "border", "multiview", "motion_blur", "freestyle", "persistent_data")


@contextmanager
def copy_of(scene: bpy.types.Scene) -> Iterator[bpy.types.Scene]:
    """Hand out a copy of a scene, with all its settings, that shares its objects."""
    if scene.rigidbody_world is not None:
        # Blender 5.0 to 5.2 crash when a copied rigid body world is freed: then the scene is its own stage.
        yield scene
        return
    copy = scene.copy()
    try:
        yield copy
    finally:
        bpy.data.scenes.remove(copy)
