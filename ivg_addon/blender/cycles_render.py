# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera's view by Cycles: diffuse indirect light and its colour, with the noise that is left in them."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from ..core.errors import SceneError
from ..core.metrics import mean_and_error
from ..core.progress import Progress
from ..core.scene import Float32
from .asking import Asker, Find, here
from .cycles_stage import Settings, changed, cycles_stage
from .export_camera import picture_size
from .jobs import PatientSteps, Steps

_BATCH_SAMPLES = 16
_MOST_BATCHES = 16
_RESULT_IMAGE = "Render Result"
_INDIRECT, _DIRECT, _COLOR = "Diffuse Indirect", "Diffuse Direct", "Diffuse Color"
_FORMAT = {  # a format belongs to its media type, the rest to the format
    "media_type": "MULTI_LAYER_IMAGE",
    "file_format": "OPEN_EXR_MULTILAYER",
    "color_mode": "RGB",
    "color_depth": "32",
    "exr_codec": "NONE",
    "use_exr_interleave": True,
}


@dataclass(frozen=True)
class CyclesPicture:
    """What Cycles sees; arrays start with the row at the bottom.

    Parameters
    ----------
    light : (height, width, 3) float32
        Radiance of diffusely reflected indirect light that reaches the camera, W/(m² sr): the passes Diffuse Indirect
        and Diffuse Color multiplied. With direct light if asked for.
    error : (height, width, 3) float32
        Standard error of `light`, from the scatter of independent renders.
    color : (height, width, 3) float32
        Diffuse reflectance; zero where nothing is seen.
    samples
        Paths per pixel, all renders together.
    seconds
        Time that the renders took.
    """

    light: Float32
    error: Float32
    color: Float32
    samples: int
    seconds: float


def render_steps(
    scene: bpy.types.Scene,
    view_layer: bpy.types.ViewLayer,
    *,
    samples: int | None = None,
    bounces: int = 12,
    include_direct: bool = False,
    seed: int = 0,
    ask: Asker = here,
) -> PatientSteps[CyclesPicture]:
    """Render the camera's view by Cycles, one of several independent renders a step.

    The file is as it was whenever this yields, ends or fails; only the image "Render Result" shows the last render.
    Depth of field and the render border are left out.

    Parameters
    ----------
    samples
        Paths per pixel; as the scene's render settings have it when not given. Rounded up to a multiple of the number
        of renders, which is 2 to 16 of about 16 samples or more.
    bounces
        Most bounces of light.
    include_direct
        Add light that comes straight from lights, emissive surfaces and the world.
    ask
        Where Cycles is asked.

    Raises
    ------
    SceneError
        No camera, Cycles is not enabled, a render is running, or Blender cannot render.
    """
    if scene.camera is None:
        raise SceneError(f"scene '{scene.name}' has no camera to compare from: add one (Ctrl Numpad 0 makes it active)")
    wanted = samples or scene.cycles.samples
    batches = min(max(2, wanted // _BATCH_SAMPLES), _MOST_BATCHES)
    per_batch = -(-wanted // batches)
    names = (_INDIRECT, _DIRECT, _COLOR) if include_direct else (_INDIRECT, _COLOR)
    renders = _Renders(view_layer.name, names, batches, per_batch, bounces, seed)
    return (yield from ask(_render_all, lambda: [scene], renders))


@dataclass(frozen=True)
class _Renders:
    """What `render_steps` asks for: `count` renders of `samples` each."""

    layer: str
    names: tuple[str, ...]
    count: int
    samples: int
    bounces: int
    seed: int


def _render_all(find: Find, renders: _Renders) -> Steps[CyclesPicture]:
    """Render, one render a step."""
    lights, colors = [], []
    start = time.perf_counter()
    count, samples = renders.count, renders.samples
    for index in range(count):
        elapsed = time.perf_counter() - start
        yield Progress(
            f"Rendering with Cycles ({index * samples} of {count * samples} samples)",
            index / count,
            elapsed * (count - index) / index if index else None,
            until=(index + 1) / count,
        )
        (scene,) = find()
        layer = scene.view_layers[renders.layer]
        seed = count * renders.seed + index
        *parts, color = _render(scene, layer, renders.names, samples, renders.bounces, seed)
        lights.append(sum(parts) * color)
        colors.append(color)
    light, error = mean_and_error(lights)
    return CyclesPicture(
        light=light.astype(np.float32),
        error=error.astype(np.float32),
        color=np.mean(colors, axis=0, dtype=np.float32),
        samples=count * samples,
        seconds=time.perf_counter() - start,
    )


def _render(
    scene: bpy.types.Scene,
    view_layer: bpy.types.ViewLayer,
    names: tuple[str, ...],
    samples: int,
    bounces: int,
    seed: int,
) -> list[Float32]:
    """Render once; return the passes of these names, each (height, width, 3)."""
    with (
        tempfile.TemporaryDirectory(prefix="ivg-") as folder,
        cycles_stage(scene, view_layer, samples=samples, bounces=bounces, seed=seed) as (stage, layer),
        changed(_output(stage, layer, Path(folder, "passes.exr"))),
        no_new_result(),
    ):
        try:
            bpy.ops.render.render(scene=stage.name, write_still=True)
        except RuntimeError as error:
            raise SceneError(f"Cycles cannot render '{scene.name}': {error}") from error
        return _passes(Path(folder, "passes.exr"), names, picture_size(scene))


def _output(scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, path: Path) -> Settings:
    """Return the settings that make a render write our passes to a file, and see what camera rays see."""
    camera = scene.camera.data
    return {
        (scene.render, "filepath"): str(path),
        (scene.render, "use_file_extension"): False,
        (scene.render, "use_overwrite"): True,
        (scene.render, "use_placeholder"): False,
        (view_layer, "use_pass_diffuse_indirect"): True,
        (view_layer, "use_pass_diffuse_direct"): True,
        (view_layer, "use_pass_diffuse_color"): True,
        **{(scene.render.image_settings, name): value for name, value in _FORMAT.items()},
        **({(camera.dof, "use_dof"): False} if camera.dof.use_dof else {}),
    }


@contextmanager
def no_new_result() -> Iterator[None]:
    """Remove the image that shows the last render, unless there was one before."""
    had_result = _RESULT_IMAGE in bpy.data.images
    try:
        yield
    finally:
        if not had_result and _RESULT_IMAGE in bpy.data.images:
            bpy.data.images.remove(bpy.data.images[_RESULT_IMAGE])


def _passes(path: Path, names: tuple[str, ...], size: tuple[int, int]) -> list[Float32]:
    """Return the passes of these names that a render has written."""
    from ..core.exr import read_exr

    channels = read_exr(path)
    width, height = size
    passes = []
    for name in names:
        planes = [pixels for axis in "RGB" for full, pixels in channels.items() if full.endswith(f".{name}.{axis}")]
        if len(planes) != 3 or planes[0].shape != (height, width):
            raise SceneError(f"Cycles gave no pass '{name}' of {width} × {height} pixels: render once to see why")
        passes.append(np.stack(planes, axis=-1))
    return passes
