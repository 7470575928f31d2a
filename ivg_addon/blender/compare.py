# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera's view by the grid and by Cycles, beside each other: a picture and numbers.

What is compared is diffusely reflected indirect light as it reaches the camera, ρ E/π: the product of Cycles' passes
Diffuse Indirect and Diffuse Color. Numbers are taken over all pixels in which a surface is seen:

    relative RMSE = √mean((grid − Cycles)²) / mean(Cycles)          energy ratio = mean(grid) / mean(Cycles)
"""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import bpy
import numpy as np

from ..core.closures import Caustics
from ..core.errors import GridFileError, SceneError
from ..core.false_color import difference_colors, local_mean, luminance, round_scale
from ..core.metrics import Agreement
from ..core.metrics import compare as agreement_of
from ..core.progress import Progress, part
from ..core.report import Notice, merge
from ..core.scene import Scene
from .asking import Asker, here
from .cycles_render import CyclesPicture, render_steps
from .display import display_pixels
from .export import export_render_steps
from .export_camera import export_camera, hidden_from_camera
from .export_depsgraph import with_render_depsgraph
from .export_materials import caustics_of
from .jobs import PatientSteps, Runner, Steps, in_foreground
from .montage import Panel, check_picture, write_montage
from .summary import Row, count, duration, voxels

if TYPE_CHECKING:
    from ..core.camera import Camera
    from ..core.grid import IrradianceVectorGrid
    from ..core.picture import LookUp, Picture

_LEAST_RAYS, _MOST_RAYS = 64, 1024
"""Camera rays per pixel of the grid's picture. At edges of things 25 times as bright as the rest, 64 leave an error of
6 % of the mean, 256 one of 2 %."""
_RAYS = 1 << 24
"""Of the whole picture, as far as that allows: some five seconds."""

_EXPORTED, _SHADED, _RENDERED, _KEPT = 0.05, 0.2, 0.97, 0.98
_SCALE_STEPS = 255
_LEGIBLE_NOISE = 0.05
"""Relative noise up to which the map of differences shows single pixels."""
_WIDEST_MEAN = 9


@dataclass(frozen=True)
class Comparison:
    """How a grid's picture compares with Cycles'.

    Parameters
    ----------
    scene
        The scene's name.
    agreement
        Over all pixels in which a surface is seen, three channels each.
    samples
        Cycles' paths per pixel.
    grid_seconds, cycles_seconds
        What the two pictures took.
    picture, layers
        The PNG, and the EXR with the layers Cycles, Grid, Difference and Noise in scene-linear radiance.
    notices
        What should be known about the comparison.
    """

    scene: str
    agreement: Agreement
    samples: int
    grid_seconds: float
    cycles_seconds: float
    picture: Path
    layers: Path
    notices: tuple[Notice, ...]

    def rows(self) -> list[Row]:
        """Return the numbers in words."""
        return [
            ("Error", rmse_words(self.agreement)),
            ("Energy", f"{self.agreement.energy_ratio:.4f} of Cycles'"),
            ("Samples", f"{self.samples:,} a pixel by Cycles"),
            ("Time", f"grid {duration(self.grid_seconds)}, Cycles {duration(self.cycles_seconds)}"),
            ("Picture", f"{self.picture}, and {self.layers.name}"),
        ]


def compare_steps(
    scene: bpy.types.Scene,
    view_layer: bpy.types.ViewLayer,
    grid: IrradianceVectorGrid,
    output: Path,
    look_up: LookUp | None = None,
    *,
    samples: int | None = None,
    run: Runner = in_foreground,
    ask: Asker = here,
) -> PatientSteps[Comparison]:
    """Compare a grid with Cycles in the camera's view; writes the pictures, returns a `Comparison`.

    Parameters
    ----------
    output
        The PNG to write; the EXR goes beside it.
    look_up
        How the grid is looked up.
    samples
        Cycles' paths per pixel; as the scene's render settings have it when not given.
    run
        How the part that never touches Blender is drained.
    ask
        Where Cycles is asked.

    Raises
    ------
    GridFileError
        The pictures cannot be written where they should go: before anything is computed.
    SceneError
        No camera, or one that is not supported; no geometry; no indirect light; Cycles is missing or busy.
    SettingsError
        A name that is not a PNG's, settings of the look-up out of range.
    """
    layers = check_picture(output)
    yield Progress("Evaluating the camera", 0.0)
    camera, hidden, notices = _read_camera(scene, view_layer)
    arrays, seen = yield from part(_export_steps(scene, view_layer, ask, run), 0.0, _EXPORTED)
    shaded, grid_seconds = yield from part(run(_shade_steps(seen, grid, camera, look_up, hidden)), _EXPORTED, _SHADED)
    settings = grid.record.settings
    rendering = render_steps(
        scene, view_layer, samples=samples, bounces=settings.bounces, include_direct=settings.include_direct, ask=ask
    )
    cycles = yield from part(rendering, _SHADED, _RENDERED)
    agreement = yield from part(run(_measure_and_keep(layers, shaded, cycles)), _RENDERED, _KEPT)
    comparison = Comparison(
        scene=scene.name,
        agreement=agreement,
        samples=cycles.samples,
        grid_seconds=grid_seconds,
        cycles_seconds=cycles.seconds,
        picture=output,
        layers=layers,
        notices=merge((*notices, *grid_notices(arrays, grid), *arrays.notices)),
    )
    yield from part(_write_picture(comparison, scene, grid, shaded, cycles, run), _KEPT, 1.0)
    return comparison


def _export_steps(
    scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer, ask: Asker, run: Runner
) -> PatientSteps[tuple[Scene, Scene]]:
    """Return the scene as photons meet it, and as the camera sees it: the same where caustics are on."""
    differ = caustics_of(scene) != Caustics()
    met = yield from part(export_render_steps(scene, view_layer, ask, run), 0.0, 0.5 if differ else 1.0)
    if not differ:
        return met, met
    return met, (yield from part(export_render_steps(scene, view_layer, ask, run, to_camera=True), 0.5, 1.0))


def grid_notices(scene: Scene, grid: IrradianceVectorGrid) -> list[Notice]:
    """Warn where the grid cannot be expected to fit the scene."""
    if scene.fingerprint() == grid.record.checksum:
        return []
    return [Notice("warning", "grid", "the scene is not as it was baked; bake it again to compare like with like")]


def rmse_words(agreement: Agreement) -> str:
    """Return the relative RMSE, and what Cycles' noise has to do with it."""
    return (
        f"relative RMSE {agreement.relative_rmse:.1%}; {agreement.own_rmse:.1%} without Cycles' own noise "
        f"of {agreement.noise:.1%}"
    )


def _read_camera(
    scene: bpy.types.Scene, view_layer: bpy.types.ViewLayer
) -> tuple[Camera, frozenset[str], list[Notice]]:
    """Return the camera, the objects that it does not see, and what is left out of its view."""
    if scene.camera is None:
        raise SceneError(f"scene '{scene.name}' has no camera to compare from: add one (Ctrl Numpad 0 makes it active)")
    camera, hidden = with_render_depsgraph(
        scene, view_layer, lambda depsgraph, _: (export_camera(depsgraph, scene), hidden_from_camera(depsgraph))
    )
    data = scene.camera.data
    notices = []
    if data.dof.use_dof:
        notices.append(Notice("left out", f"camera '{camera.name}'", "depth of field"))
    return camera, hidden, notices


def _shade_steps(
    scene: Scene, grid: IrradianceVectorGrid, camera: Camera, look_up: LookUp | None, hidden: frozenset[str]
) -> Steps[tuple[Picture, float]]:
    """Shade the grid's picture and time it; touches nothing of Blender, so any thread will do."""
    yield Progress("Loading Numba and Embree", 0.0)
    from ..core.picture import shade_steps

    start = time.perf_counter()
    visible = np.array([name not in hidden for name in scene.objects], dtype=np.bool_)
    rays = min(max(_RAYS // (camera.width * camera.height), _LEAST_RAYS), _MOST_RAYS)
    shaded = yield from shade_steps(scene, grid, camera, rays, look_up, visible=visible)
    return shaded, time.perf_counter() - start


def _measure_and_keep(layers: Path, shaded: Picture, cycles: CyclesPicture) -> Steps[Agreement]:
    """Compare the two and write the EXR; touches nothing of Blender, so any thread will do."""
    yield Progress("Writing the layers", 0.0)
    agreement = _agreement(shaded, cycles)
    _write_layers(layers, shaded, cycles)
    return agreement


def _agreement(shaded: Picture, cycles: CyclesPicture) -> Agreement:
    """Compare the two over all pixels in which either sees a surface."""
    seen = (shaded.coverage > 0.0) | cycles.color.any(axis=-1)
    if not seen.any():
        raise SceneError("the camera sees no surface: turn it to where the grid is")
    if not cycles.light[seen].any():
        raise SceneError("Cycles finds no indirect diffuse light in the camera's view: nothing to compare with")
    return agreement_of(shaded.light[seen], cycles.light[seen], cycles.error[seen])


def _write_layers(path: Path, shaded: Picture, cycles: CyclesPicture) -> None:
    """Write everything as it was compared."""
    from ..core.exr import write_exr

    layers = {
        "Cycles": cycles.light,
        "Grid": shaded.light,
        "Difference": shaded.light - cycles.light,
        "Noise": cycles.error,
    }
    fresh = path.with_name(f".{path.name}.{os.getpid()}.new")
    try:
        write_exr(
            fresh, {f"{name}.Combined.{c}": rgb[..., i] for name, rgb in layers.items() for i, c in enumerate("RGB")}
        )
        fresh.replace(path)
    except OSError as error:
        raise GridFileError(
            f"cannot replace {path} ({error.strerror}): close what uses it, or choose another"
        ) from error
    finally:
        fresh.unlink(missing_ok=True)


def _write_picture(
    comparison: Comparison,
    scene: bpy.types.Scene,
    grid: IrradianceVectorGrid,
    shaded: Picture,
    cycles: CyclesPicture,
    run: Runner,
) -> PatientSteps[None]:
    """Write Cycles | grid | difference with the numbers, one panel a step."""
    agreement, settings = comparison.agreement, grid.record.settings
    yield Progress("Writing the pictures", 0.0)
    truth = display_pixels(cycles.light, scene)
    yield Progress("Writing the pictures", 0.2)
    ours = display_pixels(shaded.light, scene)
    difference = yield from run(_difference_steps(shaded, cycles, agreement.noise))
    yield Progress("Writing the pictures", 0.6)
    panels = (
        Panel("Cycles", f"{cycles.samples:,} samples a pixel, noise {agreement.noise:.1%}", truth),
        Panel(
            "Irradiance vector grid",
            f"{voxels(grid.resolution)} voxels, {count(settings.photons)} photons",
            ours,
        ),
        difference,
    )
    light = "direct and indirect" if settings.include_direct else "indirect"
    write_montage(
        comparison.picture,
        scene.name,
        f"{light} light, diffusely reflected",
        panels,
        (
            f"Relative RMSE {agreement.own_rmse:.1%} beyond Cycles' own noise, {agreement.relative_rmse:.1%} with it"
            f"   ·   energy ratio {agreement.energy_ratio:.3f}",
            f"{settings.bounces} bounces   ·   Cycles {duration(comparison.cycles_seconds)}, "
            f"grid {duration(comparison.grid_seconds)} after its bake",
        ),
    )


def _difference_steps(shaded: Picture, cycles: CyclesPicture, noise: float) -> Steps[Panel]:
    """Return the map of differences; touches nothing of Blender, so any thread will do."""
    yield Progress("Writing the pictures", 0.4)
    return _difference_panel(shaded, cycles, noise)


def _difference_panel(shaded: Picture, cycles: CyclesPicture, noise: float) -> Panel:
    """Return the map of (grid − Cycles) over the mean of Cycles, by luminance.

    Where Cycles' noise would hide everything else, local means are shown.
    """
    mean = float(luminance(cycles.light).mean())
    size = 2 * min(round(0.5 * noise / _LEGIBLE_NOISE), _WIDEST_MEAN // 2) + 1
    error = local_mean(luminance(shaded.light - cycles.light) / mean, shaded.coverage > 0.0, size)
    limit = round_scale(error)
    return Panel(
        "Difference: grid − Cycles",
        "of Cycles' mean" + (f", smoothed over {size} × {size} pixels" if size > 1 else ""),
        difference_colors(np.where(shaded.coverage > 0.0, error, 0.0) / limit),
        difference_colors(np.linspace(-1.0, 1.0, _SCALE_STEPS)),
        (f"−{limit:.0%}: too dark", "0", f"+{limit:.0%}: too bright"),
    )
