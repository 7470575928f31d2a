# SPDX-License-Identifier: GPL-3.0-or-later
"""What renders with a grid's light in the materials are worth: `python -m benchmarks.grid_render [PART …]`.

Parts: `error` (the indirect light of Cycles and EEVEE with the grid, against Cycles), `time` (what Cycles takes for the
same error, with and without its denoiser), `flicker` (how much pixels change from seed to seed), `detail` (an object
baked with 24 thousand triangles and rendered with two million). Scene: `sample_blend/cornell.blend`, 20³ voxels.

RMSE are relative to the mean indirect light of the reference; ratios of times hold for a machine that does nothing
else. About twenty minutes on two cores.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ivg_addon.blender import direct_light, grid_image, scene_light
from ivg_addon.blender.cycles_render import render_steps
from ivg_addon.blender.cycles_stage import changed, truthful
from ivg_addon.blender.export import export_render_steps
from ivg_addon.blender.montage import Panel, write_montage
from ivg_addon.blender.properties import ensure_registered
from ivg_addon.core.bake import bake
from ivg_addon.core.exr import read_exr
from ivg_addon.core.false_color import difference_colors, luminance
from ivg_addon.core.metrics import compare
from ivg_addon.core.progress import finish
from ivg_addon.core.settings import BakeSettings

from .detailed_object import detailed_mesh

Picture = NDArray[np.float64]

ROOT = Path(__file__).resolve().parent.parent
SCENE = ROOT / "sample_blend" / "cornell.blend"
PARTS = ("error", "time", "flicker", "detail")
RESOLUTION = (20, 20, 20)
BOUNCES = 12
GRID_SAMPLES = (1, 4, 16)
FULL_SAMPLES = (16, 64)
DENOISED_SAMPLES = (1, 4, 16, 64)
FLICKER_FRAMES, FLICKER_SAMPLES = 10, 4
COARSE, FINE = (155, 78), (1416, 708)
"""Divisions of the detailed object around and along its axis: 24 thousand and two million triangles."""
_LAMP = 0.2
"""Of the brightest pixel: what is as bright is the lamp."""
REPEATS = 3
"""Renders of which the fastest is taken."""


@dataclass(frozen=True)
class Shot:
    """A render: its picture (height, width, 3), and how long it took."""

    picture: Picture
    seconds: float


@dataclass(frozen=True)
class Truth:
    """The reference: direct light, indirect light, and the latter's standard error, (height, width, 3) each.

    Where the lamp itself is seen, or its edge, pixels tell nothing of surfaces: they are left out.
    """

    direct: Picture
    indirect: Picture
    error: Picture

    @property
    def surfaces(self) -> NDArray[np.bool_]:
        """Return which pixels (height, width) are away from the lamp."""
        bright = luminance(self.direct) > _LAMP * luminance(self.direct).max()
        near = [np.roll(bright, (y, x), axis=(0, 1)) for y in range(-2, 3) for x in range(-2, 3)]
        return np.asarray(~np.any(near, axis=0))

    def rmse(self, indirect: Picture) -> float:
        """Return how far indirect light is off, without the reference's own noise."""
        seen = self.surfaces
        return compare(indirect[seen], self.indirect[seen], self.error[seen]).own_rmse

    def whole_rmse(self, picture: Picture) -> float:
        """Return how far a whole picture is off, without the noise of the reference's indirect light."""
        return self.rmse(picture - self.direct)


def main() -> int:
    """Run the comparisons; return the exit status."""
    parser = argparse.ArgumentParser(description="Compare renders with the grid's light with Cycles and its denoiser.")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"of {', '.join(PARTS)}; default all")
    parser.add_argument("--samples", type=int, default=2048, help="of the reference (default 2048)")
    parser.add_argument("--size", type=int, default=256, help="pixels along a picture's edge (default 256)")
    parser.add_argument("--photons", type=int, default=8_000_000, help="photons of each bake (default 8 million)")
    parser.add_argument("--pictures", type=Path, help="folder to leave the pictures in")
    arguments = parser.parse_args()
    parts = arguments.parts or PARTS
    if set(parts) - set(PARTS):
        parser.error(f"unknown part: of {', '.join(PARTS)}")
    if arguments.pictures:
        arguments.pictures.mkdir(parents=True, exist_ok=True)
    ensure_registered()
    if set(parts) != {"detail"}:
        open_scene(arguments.size)
        baked(arguments.photons)
        truth = reference(arguments.samples)
        print(f"reference: {arguments.samples} samples, {np.sqrt((truth.error**2).mean()) / truth.indirect.mean():.4f}")
        with_grid = lit_shots()
        if "error" in parts:
            errors(truth, with_grid, arguments.pictures)
        if "time" in parts:
            times(truth, with_grid)
        if "flicker" in parts:
            flicker(truth)
    if "detail" in parts:
        detail(arguments.size, arguments.photons, arguments.pictures)
    return 0


def open_scene(size: int) -> None:
    """Open the scene, for pictures of so many pixels along an edge."""
    bpy.ops.wm.open_mainfile(filepath=str(SCENE))
    render = bpy.context.scene.render
    render.resolution_x = render.resolution_y = size
    render.dither_intensity = 0.0
    render.image_settings.media_type = "IMAGE"
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    render.image_settings.exr_codec = "NONE"


def baked(photons: int) -> None:
    """Bake the open scene, and keep its grid in it."""
    scene = bpy.context.scene
    exported = finish(export_render_steps(scene, bpy.context.view_layer))
    low, high = (tuple(map(float, corner)) for corner in exported.geometry.bounds())
    grid = bake(exported, BakeSettings(low, high, RESOLUTION, photons=photons, bounces=BOUNCES)).grid
    scene.ivg.grid = grid_image.put(grid_image.prepare(grid), "Grid", scene.ivg.grid)


def reference(samples: int) -> Truth:
    """Render the open scene by Cycles."""
    seen = finish(render_steps(bpy.context.scene, bpy.context.view_layer, samples=samples, bounces=BOUNCES))
    direct = cycles(min(samples, 512), direct=True, seed=99).picture
    return Truth(direct, seen.light.astype(np.float64), seen.error.astype(np.float64))


def cycles(samples: int, *, direct: bool = False, denoise: bool = False, seed: int = 0) -> Shot:
    """Render the open scene as it is by Cycles, `direct`: without diffuse bounces."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    settings = truthful(scene, layer, samples=samples, bounces=BOUNCES, seed=seed)
    settings |= {(scene.cycles, "use_denoising"): denoise}
    if direct:
        settings |= {(scene.cycles, "diffuse_bounces"): 0}
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
    return min((cycles(samples, **how) for _ in range(REPEATS)), key=lambda shot: shot.seconds)


def lit_shots() -> dict[int, tuple[Shot, Picture]]:
    """Render with the grid's light; return, by samples, what that is, and the indirect light in it.

    Of the same seed, direct light has the same noise with the grid's light and without: the difference has none.
    """
    without = {samples: cycles(samples, direct=True).picture for samples in GRID_SAMPLES}
    scene_light.add(bpy.context)
    found = {samples: fastest(samples, direct=True) for samples in GRID_SAMPLES}
    return {samples: (shot, shot.picture - without[samples]) for samples, shot in found.items()}


def errors(truth: Truth, with_grid: dict[int, tuple[Shot, Picture]], pictures: Path | None) -> None:
    """Print the error of the indirect light, in Cycles and in EEVEE."""
    print("\nindirect light with the grid        RMSE   asked   ratio of energy")
    _, indirect = with_grid[max(GRID_SAMPLES)]
    lines = {"Cycles": indirect}
    found = eevee()
    if found is not None:
        lines["EEVEE"] = found
    for name, light in lines.items():
        ratio = light.mean() / truth.indirect.mean()
        print(f"{name:35} {truth.rmse(light):.4f}   0.07   {ratio:.3f}", flush=True)
        if pictures:
            save(pictures / f"{name.lower()}.png", ("Cycles", f"{name} with the grid"), truth.indirect, light)


EEVEE = """
import sys
import bpy, gpu
gpu.init()
print("gpu", flush=True)
import numpy as np
from benchmarks import grid_render
from ivg_addon.blender import scene_light
from ivg_addon.blender.properties import ensure_registered
ensure_registered()
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
scene = bpy.context.scene
scene.render.engine = "BLENDER_EEVEE"
scene.eevee.taa_render_samples = 16
lit = grid_render.shoot()
again = grid_render.shoot()
scene_light.remove(bpy.context)
direct = grid_render.shoot()
np.savez(sys.argv[2], whole=lit.picture, indirect=lit.picture - direct.picture, seconds=again.seconds)
"""


def eevee() -> Picture | None:
    """Return the indirect light that EEVEE renders with the grid, if there is a way to render with it here."""
    scene = bpy.context.scene
    with tempfile.TemporaryDirectory() as folder:
        blend, found = Path(folder, "a.blend"), Path(folder, "a.npz")
        direct_light.switch_to_direct(scene)
        bpy.ops.wm.save_as_mainfile(filepath=str(blend), copy=True)
        direct_light.switch_back(scene)
        command = [sys.executable, "-c", EEVEE, str(blend), str(found)]
        environment = os.environ | {"BLENDER_USER_RESOURCES": folder}
        done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
        if "gpu\n" not in done.stdout:
            print("EEVEE: no OpenGL here (libegl1, libgl1-mesa-dri)")
            return None
        if done.returncode:
            raise RuntimeError(done.stderr)
        with np.load(found) as file:
            print(f"(EEVEE: {float(file['seconds']):.1f} s a frame)")
            return np.asarray(file["indirect"])


def times(truth: Truth, with_grid: dict[int, tuple[Shot, Picture]]) -> None:
    """Print what Cycles takes for the same error."""
    scene_light.remove(bpy.context)
    print("\n                            samples  seconds   RMSE: indirect light, whole picture")
    rows = {
        "with the grid": [(n, shot, truth.rmse(indirect)) for n, (shot, indirect) in with_grid.items()],
        "Cycles": [(n, fastest(n), indirect_error(truth, n)) for n in FULL_SAMPLES],
        "Cycles, denoised": [],
    }
    for n in DENOISED_SAMPLES:
        shot = fastest(n, denoise=True)
        rows["Cycles, denoised"].append((n, shot, truth.whole_rmse(shot.picture)))
    for name, found in rows.items():
        for n, shot, error in found:
            whole = truth.whole_rmse(shot.picture)
            print(f"{name:28} {n:6}   {shot.seconds:6.2f}    {error:.4f}   {whole:.4f}", flush=True)
    for n, shot, error in rows["with the grid"]:
        full = seconds_for(error, rows["Cycles"])
        clean = seconds_for(error, rows["Cycles, denoised"])
        told = f"Cycles {full / shot.seconds:.0f} times as long, denoised {clean / shot.seconds:.1f} times"
        print(f"for the indirect error of the grid at {n} samples: {told}   (asked: 10, 2)", flush=True)


def indirect_error(truth: Truth, samples: int) -> float:
    """Return the error of Cycles' own indirect light, as its pass has it."""
    seen = finish(render_steps(bpy.context.scene, bpy.context.view_layer, samples=samples, bounces=BOUNCES, seed=7))
    return truth.rmse(seen.light.astype(np.float64))


def seconds_for(error: float, rows: Sequence[tuple[int, Shot, float]]) -> float:
    """Return the time after which an error is reached: both go by powers of the samples between two measurements.

    Beyond the last measurement time grows with the samples, and the error falls as it did before.
    """
    table = np.array([(count, shot.seconds, error) for count, shot, error in rows])
    n, seconds, errors = table.T
    falling = np.minimum.accumulate(errors)
    if error >= falling[0]:
        return float(seconds[0])
    if error < falling[-1]:
        slope = math.log(errors[-1] / errors[-2]) / math.log(n[-1] / n[-2])
        if slope >= 0.0:
            return math.inf
        wanted = n[-1] * (error / errors[-1]) ** (1.0 / slope)
        per_sample = (seconds[-1] - seconds[-2]) / (n[-1] - n[-2])
        return float(seconds[-1] + per_sample * (wanted - n[-1]))
    wanted = math.exp(float(np.interp(-math.log(error), -np.log(falling), np.log(n))))
    return float(np.interp(wanted, n, seconds))


def flicker(truth: Truth) -> None:
    """Print how much a pixel's light changes from seed to seed."""
    told = f"over {FLICKER_FRAMES} seeds, {FLICKER_SAMPLES} samples, of the mean indirect light"
    print(f"\nstandard deviation of a pixel {told}")
    scene_light.remove(bpy.context)
    seeds = range(FLICKER_FRAMES)
    without = [cycles(FLICKER_SAMPLES, direct=True, seed=seed).picture for seed in seeds]
    denoised = [cycles(FLICKER_SAMPLES, denoise=True, seed=seed).picture for seed in seeds]
    scene_light.add(bpy.context)
    lit = [cycles(FLICKER_SAMPLES, direct=True, seed=seed).picture for seed in seeds]
    smooth = [cycles(FLICKER_SAMPLES, direct=True, denoise=True, seed=seed).picture for seed in seeds]
    rows = {
        "with the grid, indirect light": np.array(lit) - np.array(without),
        "Cycles, denoised, whole picture": np.array(denoised),
        "with the grid, denoised, whole picture": np.array(smooth),
    }
    for name, frames in rows.items():
        scatter = frames.std(axis=0, ddof=1)[truth.surfaces] / truth.indirect.mean()
        print(f"{name:40} mean {scatter.mean():.5f}   median {np.median(scatter):.6f}   largest {scatter.max():.4f}")


def detail(size: int, photons: int, pictures: Path | None) -> None:
    """Print what it costs to bake an object with 24 thousand triangles that is rendered with two million."""
    shots = {}
    for name, divisions in (("coarse", COARSE), ("fine", FINE)):
        open_scene(size)
        thing = bpy.data.objects.new("Detailed", detailed_mesh(*divisions))
        bpy.context.scene.collection.objects.link(thing)
        bpy.context.view_layer.update()
        baked(photons)
        thing.data = detailed_mesh(*FINE)
        scene_light.add(bpy.context)
        shots[name] = cycles(64, direct=True).picture
    shown = {name: displayed(picture) for name, picture in shots.items()}
    off = np.abs(shown["coarse"] - shown["fine"])
    print(f"\nbaked with {triangles(COARSE):,} triangles, rendered with {triangles(FINE):,}, against a bake with all:")
    print(f"pixels differ by {off.max():.2%} at most, {off.mean():.3%} on average, of the display's range")
    print("(asked: 5 %, 0.5 %)", flush=True)
    if pictures:
        names = (f"baked with {triangles(FINE):,} triangles", f"with {triangles(COARSE):,}")
        save(pictures / "detail.png", names, shots["fine"], shots["coarse"])


def triangles(divisions: tuple[int, int]) -> int:
    """Return the triangles of a detailed object."""
    around, along = divisions
    return 2 * around * along


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


if __name__ == "__main__":
    sys.exit(main())
