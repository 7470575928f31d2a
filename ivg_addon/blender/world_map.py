# SPDX-License-Identifier: GPL-3.0-or-later
"""The world as Cycles has it, whatever its nodes are: rendered into maps of its radiance.

Cycles renders a scene that has nothing but the world and a panoramic camera: first all directions,
several samples a texel, so that a texel holds the mean of what it spans; then what is small and
bright again, finer, so that a sun keeps its place. What light paths would tell the nodes is
replaced, in a copy, by what they tell a ray that left a diffuse surface.
"""

from __future__ import annotations

import math
import tempfile
import time
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np

from ..core.environment import EnvironmentMap, Float32, Spot, bright_spots, cleaned, disjoint, without_spots
from ..core.errors import SceneError
from ..core.progress import Progress
from ..core.report import Notice, merge
from .asking import Asker, Find, here
from .cycles_render import no_new_result
from .cycles_stage import changed, removed, truthful
from .emission_nodes import constant_emission
from .export_colours import ColourReader, Notes
from .export_images import ImageTable
from .jobs import PatientSteps, Steps
from .world_content import images_in, trees_in, world_key
from .world_tree import as_diffuse_rays_see

_WIDTH = 2048
"""Texels around: 0.18° each. A grid of irradiance knows no finer directions."""
_SAMPLES = 8
_IMAGE_SAMPLES = 2.0
"""Samples for each pixel of the largest image in the nodes: a sun may be a single one."""
_MOST_SAMPLES = 64
_SAMPLES_A_STEP = 1 << 25
"""A bound on memory, and where Cycles is asked in this Blender, on how long Esc waits: some seconds."""
_SPOT_TEXELS = 1 << 16
"""Texels of a spot's own map, about."""
_SPOT_SAMPLES = 16
_EASY_SUN = math.radians(0.25)
"""A disc of a Sky Texture that samples cannot overlook."""
_SEARCH_WIDTH, _SEARCH_SUN = 512, math.radians(2.0)
"""Smaller ones are looked for in a coarser map with larger discs."""
_KEPT = 4
"""Worlds that are remembered."""

_TASK = "Evaluating the world by Cycles"


@dataclass(frozen=True)
class WorldLight:
    """What Cycles found.

    Parameters
    ----------
    maps
        Radiance from all directions; none where the world is black.
    notices
        What should be known about it.
    seconds
        What the renders took; 0 where they were still known.
    """

    maps: tuple[EnvironmentMap, ...]
    notices: tuple[Notice, ...]
    seconds: float


@dataclass(frozen=True)
class _Conditions:
    """What of the user's scene and world the renders need; nothing of Blender's is kept between steps."""

    frame: int
    subframe: float
    device: str
    shading_system: bool
    width: int
    samples: int
    tiny_suns: bool


_known: OrderedDict[str, WorldLight] = OrderedDict()
"""Worlds that were evaluated in this session, by their content."""


def world_of(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer) -> bpy.types.World | None:
    """Return the world that lights a view layer; None where its filter leaves the environment out."""
    return (view_layer.world_override or scene.world) if view_layer.use_sky else None


def lights_diffuse(world: bpy.types.World) -> bool:
    """Tell whether diffuse surfaces see a world (Ray Visibility: Diffuse)."""
    return bool(world.cycles_visibility.diffuse) if hasattr(world, "cycles_visibility") else True


def world_steps(
    scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, ask: Asker = here
) -> PatientSteps[WorldLight | None]:
    """Evaluate the world if it is anything but one colour; the file is as it was whenever this yields, ends or fails.

    Parameters
    ----------
    ask
        Where Cycles is asked.

    Returns
    -------
    WorldLight or None
        None where the world is one colour, lights nothing diffuse, or Cycles is not enabled.

    Raises
    ------
    SceneError
        Cycles cannot render it.
    """
    world = world_of(scene, view_layer)
    if world is None or not lights_diffuse(world) or not _varies(world) or not hasattr(scene, "cycles"):
        return None
    key = world_key(world, scene)
    if key in _known:
        _known.move_to_end(key)
        return replace(_known[key], seconds=0.0)
    start = time.perf_counter()
    subject = f"world '{world.name}'"
    about = list(_about(world, subject))
    conditions = _Conditions(
        frame=scene.frame_current,
        subframe=scene.frame_subframe,
        device=scene.cycles.device,
        shading_system=scene.cycles.shading_system,
        width=_WIDTH,
        samples=_samples(world),
        tiny_suns=_has_tiny_suns(world),
    )
    name = world.name_full
    maps, doubts = yield from ask(_maps, lambda: [_found(name)], conditions, subject)
    light = WorldLight(maps, merge([*about, *doubts]), time.perf_counter() - start)
    _known[key] = light
    while len(_known) > _KEPT:
        _known.popitem(last=False)
    return light


def _varies(world: bpy.types.World) -> bool:
    """Tell whether a world's nodes are more than a constant."""
    if world.node_tree is None:
        return False
    notes = Notes("")
    constant_emission(world.node_tree, ColourReader(ImageTable(), notes))
    return any(notice.kind != "left out" for notice in notes.notices)


def _maps(find: Find, conditions: _Conditions, subject: str) -> Steps[tuple[tuple[EnvironmentMap, ...], list[Notice]]]:
    """Render a world, one band of latitudes or one spot a step."""
    width, height, samples = conditions.width, conditions.width // 2, conditions.samples
    bands = max(1, 2 ** math.ceil(math.log2(width * height * samples / _SAMPLES_A_STEP)))
    rows = []
    for band in range(bands):
        yield Progress(_TASK, 0.8 * band / bands, until=0.8 * (band + 1) / bands)
        view = _View((width, height // bands), latitude=(_height(band / bands), _height((band + 1) / bands)))
        rows.append(_render(conditions, find()[0], view, samples))
    whole = cleaned(np.concatenate(rows))
    sky = EnvironmentMap(whole.radiance)
    tiny = (yield from _tiny_suns(find, conditions)) if conditions.tiny_suns else []
    spots = disjoint([*tiny, *bright_spots(sky)])
    maps = [without_spots(sky, spots)]
    for index, spot in enumerate(spots):
        yield Progress(f"{_TASK}: bright spot {index + 1} of {len(spots)}", 0.9 + 0.1 * index / len(spots))
        patch = _finer(conditions, find()[0], sky, spot)
        # What is tiny even here, the smallest of suns, once more.
        smaller = bright_spots(patch)
        maps.append(without_spots(patch, smaller))
        maps.extend(_finer(conditions, find()[0], patch, one) for one in smaller)
    doubts = _doubts(subject, whole.not_numbers, whole.negative, sky.radiance.shape)
    return tuple(one for one in maps if one.shines()), list(doubts)


def _height(share: float) -> float:
    """Return the latitude at a share of the way up."""
    return math.pi * (share - 0.5)


def _tiny_suns(find: Find, conditions: _Conditions) -> Steps[list[Spot]]:
    """Return where the discs of Sky Textures are that the map of the whole sphere may have overlooked."""
    yield Progress(f"{_TASK}: small suns", 0.85)
    view = _View((_SEARCH_WIDTH, _SEARCH_WIDTH // 2))
    found = cleaned(_render(conditions, find()[0], view, _SAMPLES, _SEARCH_SUN))
    return [spot.scaled(conditions.width // _SEARCH_WIDTH) for spot in bright_spots(EnvironmentMap(found.radiance))]


def _found(name: str) -> bpy.types.World:
    """Return the world, which undo may have moved in memory, or the user removed between two steps."""
    for world in bpy.data.worlds:
        if world.name_full == name:
            return world
    raise SceneError(f"world '{name}' was removed while it was evaluated: nothing was changed")


def _finer(conditions: _Conditions, world: bpy.types.World, sky: EnvironmentMap, spot: Spot) -> EnvironmentMap:
    """Render a rectangle of a map anew, in texels so small that there are about `_SPOT_TEXELS`."""
    rows, columns = (end - first for first, end in (spot.rows, spot.columns))
    finer = max(1, round(math.sqrt(_SPOT_TEXELS / (rows * columns))))
    left, right = (float(sky.column_edges[column]) for column in spot.columns)
    low, high = (float(sky.row_edges[row]) for row in spot.rows)
    view = _View((columns * finer, rows * finer), (left, right), (low, high))
    radiance = cleaned(_render(conditions, world, view, _SPOT_SAMPLES)).radiance
    return EnvironmentMap(radiance, view.longitude, view.latitude)


def _samples(world: bpy.types.World) -> int:
    """Return how many samples a texel needs, so that no pixel of an image is overlooked."""
    widest = max((image.size[0] for image in images_in(world)), default=0)
    return int(min(max(_SAMPLES, _IMAGE_SAMPLES * (widest / _WIDTH) ** 2), _MOST_SAMPLES))


def _has_tiny_suns(world: bpy.types.World) -> bool:
    nodes = (node for tree in trees_in(world) for node in tree.nodes if node.type == "TEX_SKY")
    return any(node.sun_disc and node.sun_size < _EASY_SUN for node in nodes)


@dataclass(frozen=True)
class _View:
    """A rectangle of directions, and the texels that it is divided into, (width, height)."""

    size: tuple[int, int]
    longitude: tuple[float, float] = (-math.pi, math.pi)
    latitude: tuple[float, float] = (-0.5 * math.pi, 0.5 * math.pi)


def _render(
    conditions: _Conditions, world: bpy.types.World, view: _View, samples: int, smallest_sun: float = 0.0
) -> Float32:
    """Render a world's radiance, (height, width, 3)."""
    from ..core.exr import read_exr

    with (
        tempfile.TemporaryDirectory(prefix="ivg-") as folder,
        _stage(conditions, world, samples, smallest_sun) as stage,
        no_new_result(),
    ):
        path = Path(folder, "world.exr")
        _look_at(stage.camera.data, view)
        stage.render.resolution_x, stage.render.resolution_y = view.size
        stage.render.filepath = str(path)
        try:
            bpy.ops.render.render(scene=stage.name, write_still=True)
        except RuntimeError as error:
            raise SceneError(f"Cycles cannot render world '{world.name}': {error}") from error
        channels = read_exr(path)
    pixels = [plane for axis in "RGB" for name, plane in channels.items() if name.rpartition(".")[2] == axis]
    if len(pixels) != 3 or pixels[0].shape != view.size[::-1]:
        raise SceneError(f"Cycles gave no picture of world '{world.name}': render it once to see why")
    return np.stack(pixels, axis=-1)


@contextmanager
def _stage(
    conditions: _Conditions, world: bpy.types.World, samples: int, smallest_sun: float
) -> Iterator[bpy.types.Scene]:
    """Make a scene of nothing but a world and a camera that sees every direction as the maps have it."""
    data = bpy.data
    with ExitStack() as stack:
        stage = stack.enter_context(removed(data.scenes, lambda: data.scenes.new("World")))
        stage.world = stack.enter_context(as_diffuse_rays_see(world, smallest_sun))
        camera = stack.enter_context(removed(data.cameras, lambda: data.cameras.new("World")))
        stage.camera = stack.enter_context(removed(data.objects, lambda: data.objects.new("World", camera)))
        # It looks along +x, the middle of a map.
        stage.camera.rotation_euler = (0.5 * math.pi, 0.0, -0.5 * math.pi)
        stage.collection.objects.link(stage.camera)
        stage.frame_set(conditions.frame, subframe=conditions.subframe)
        stage.cycles.device = conditions.device
        stage.cycles.shading_system = conditions.shading_system
        stage.cycles.pixel_filter_type = "BOX"
        stage.render.resolution_percentage = 100
        stage.render.use_file_extension = False
        for name, value in _FORMAT.items():
            setattr(stage.render.image_settings, name, value)
        layer = stage.view_layers[0]
        stack.enter_context(changed(truthful(stage, layer, samples=samples, bounces=0, seed=0)))
        yield stage


_FORMAT = {
    "media_type": "IMAGE",
    "file_format": "OPEN_EXR",
    "color_mode": "RGB",
    "color_depth": "32",
    "exr_codec": "NONE",
}


def _look_at(camera: bpy.types.Camera, view: _View) -> None:
    """Let a camera see a rectangle of directions."""
    camera.type = "PANO"
    camera.panorama_type = "EQUIRECTANGULAR"
    camera.longitude_min, camera.longitude_max = view.longitude
    camera.latitude_min, camera.latitude_max = view.latitude


def _doubts(subject: str, not_numbers: int, negative: int, shape: tuple[int, ...]) -> Iterator[Notice]:
    """Warn of values that no light has."""
    count = shape[0] * shape[1]
    if not_numbers:
        share = f"{not_numbers / count:.2g} of its directions"
        yield Notice("warning", subject, f"its radiance is not a number, or infinite, in {share}: taken as black there")
    if negative:
        yield Notice("simplified", subject, "takes light away: what is negative of its light is ignored")


def _about(world: bpy.types.World, subject: str) -> Iterator[Notice]:
    """Say what Cycles has otherwise than the maps, and which images are missing."""
    for image in images_in(world):
        path = bpy.path.abspath(image.filepath, library=image.library)
        is_file = image.source in {"FILE", "SEQUENCE", "MOVIE"} and image.packed_file is None
        if is_file and image.source == "FILE" and not Path(path).is_file():
            yield Notice("warning", subject, f"image '{image.name}' is missing ({path}): magenta, as Cycles shows it")
        if image.source in {"SEQUENCE", "MOVIE"}:
            yield Notice("simplified", subject, f"image '{image.name}' moves: its light is that of the current frame")
