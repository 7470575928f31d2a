# SPDX-License-Identifier: GPL-3.0-or-later
"""The room of the benchmarks of renders with a grid's light: opened, baked, rendered, and what its light truly is."""

from __future__ import annotations

import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ivg_addon.blender import grid_image
from ivg_addon.blender.cycles_render import render_steps
from ivg_addon.blender.cycles_stage import changed, truthful
from ivg_addon.blender.export import export_render_steps
from ivg_addon.blender.montage import Panel, write_montage
from ivg_addon.core.bake import bake
from ivg_addon.core.exr import read_exr
from ivg_addon.core.false_color import difference_colors, luminance
from ivg_addon.core.metrics import Agreement, compare, mean_and_error
from ivg_addon.core.progress import finish
from ivg_addon.core.settings import BakeSettings

Picture = NDArray[np.float64]

SCENE = Path(__file__).resolve().parent.parent / "sample_blend" / "cornell.blend"
BOUNCES = 12
_LAMP = 0.2
"""Of the brightest pixel: what is as bright is the lamp."""
_REPEATS = 3
"""Renders of which the fastest is taken."""


@dataclass(frozen=True)
class Shot:
    """A render: its picture (height, width, 3), and how long it took."""

    picture: Picture
    seconds: float


@dataclass(frozen=True)
class Truth:
    """The reference: direct light, indirect light, and their standard errors, (height, width, 3) each.

    Where the lamp itself is seen, or its edge, pixels tell nothing of surfaces: they are left out.
    """

    direct: Picture
    indirect: Picture
    direct_error: Picture
    error: Picture

    @property
    def surfaces(self) -> NDArray[np.bool_]:
        """Return which pixels (height, width) are away from the lamp."""
        bright = luminance(self.direct) > _LAMP * luminance(self.direct).max()
        near = [np.roll(bright, (y, x), axis=(0, 1)) for y in range(-2, 3) for x in range(-2, 3)]
        return np.asarray(~np.any(near, axis=0))

    def indirect_agreement(self, indirect: Picture) -> Agreement:
        """Compare indirect light."""
        seen = self.surfaces
        return compare(indirect[seen], self.indirect[seen], self.error[seen])

    def rmse(self, indirect: Picture) -> float:
        """Return how far indirect light is off, without the reference's own noise."""
        return self.indirect_agreement(indirect).own_rmse

    def whole_rmse(self, picture: Picture) -> float:
        """Return how far a whole picture is off, relative to the mean indirect light, without the reference's noise."""
        seen = self.surfaces
        error = np.hypot(self.error, self.direct_error)
        return compare((picture - self.direct)[seen], self.indirect[seen], error[seen]).own_rmse


def open_scene(size: int) -> None:
    """Open the scene, for pictures of so many pixels along an edge."""
    bpy.ops.wm.open_mainfile(filepath=str(SCENE))
    render = bpy.context.scene.render
    render.resolution_x = render.resolution_y = size
    render.dither_intensity = 0.0
    render.image_settings.media_type = "IMAGE"
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    render.image_settings.exr_codec = "NONE"


def baked(photons: int, resolution: tuple[int, int, int]) -> None:
    """Bake the open scene with so many voxels, and keep its grid in it."""
    scene = bpy.context.scene
    exported = finish(export_render_steps(scene, bpy.context.view_layer))
    low, high = (tuple(map(float, corner)) for corner in exported.geometry.bounds())
    grid = bake(exported, BakeSettings(low, high, resolution, photons=photons, bounces=BOUNCES)).grid
    scene.ivg.grid = grid_image.put(grid_image.prepare(grid), "Grid", scene.ivg.grid)


def reference(samples: int) -> Truth:
    """Render the open scene by Cycles."""
    seen = finish(render_steps(bpy.context.scene, bpy.context.view_layer, samples=samples, bounces=BOUNCES))
    per_half = min(samples, 512) // 2
    direct, direct_error = mean_and_error([cycles(per_half, direct=True, seed=seed).picture for seed in (98, 99)])
    return Truth(direct, seen.light.astype(np.float64), direct_error, seen.error.astype(np.float64))


def cycles(
    samples: int, *, direct: bool = False, denoise: bool = False, seed: int = 0, width: float | None = None
) -> Shot:
    """Render the open scene as it is by Cycles, `direct`: without diffuse bounces; `width`: of the pixel filter."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    settings = truthful(scene, layer, samples=samples, bounces=BOUNCES, seed=seed)
    settings |= {(scene.cycles, "use_denoising"): denoise}
    if direct:
        settings |= {(scene.cycles, "diffuse_bounces"): 0}
    if width is not None:
        settings |= {(scene.cycles, "filter_width"): width}
    with changed(settings):
        return shoot()


def shoot() -> Shot:
    """Render the open scene as it is."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "a.exr")
        bpy.context.scene.render.filepath = str(path)
        start = time.perf_counter()
        bpy.ops.render.render(write_still=True)
        seconds = time.perf_counter() - start
        channels = read_exr(path)
    return Shot(np.stack([channels[name] for name in "RGB"], axis=-1).astype(np.float64), seconds)


def fastest(samples: int, **how: bool) -> Shot:
    """Render several times; return the picture with the least time."""
    return min((cycles(samples, **how) for _ in range(_REPEATS)), key=lambda shot: shot.seconds)


def displayed(picture: Picture) -> Picture:
    """Return a picture as a display shows it, in [0, 1]."""
    light = np.clip(picture, 0.0, 1.0)
    return np.where(light < 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def save(path: Path, names: tuple[str, str], truth: Picture, found: Picture) -> None:
    """Write the truth, what was found, and the difference of both."""
    mean = float(luminance(truth).mean())
    off = luminance(found - truth) / mean
    limit = float(np.abs(off).max())
    scale = difference_colors(np.linspace(-1.0, 1.0, 64))
    labels = (f"−{limit:.0%}", "0", f"+{limit:.0%}")
    panels = (
        Panel(names[0], "", displayed(truth)),
        Panel(names[1], "", displayed(found)),
        Panel("Difference", "of the mean", difference_colors(off / limit), scale, labels),
    )
    write_montage(path, "Cornell box", path.stem, panels, ("",))
