# SPDX-License-Identifier: GPL-3.0-or-later
"""What renders with a grid's light in the materials are worth: `python -m benchmarks.grid_render [PART …]`.

Parts: `error` (the indirect light of Cycles and EEVEE with the grid, against Cycles), `time` (what Cycles takes for the
same error, with and without its denoiser), `flicker` (how much pixels change from seed to seed, with the pixel filter
as it is, which moves the point that a pixel shows, and with one that keeps it), `detail` (an object baked with 24
thousand triangles and rendered with two million). Scene: `sample_blend/cornell.blend`, 20³ voxels.

RMSE are relative to the mean indirect light of the reference; ratios of times hold for a machine that does nothing
else. About twenty minutes on two cores.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import bpy
import numpy as np

from ivg_addon.blender import scene_light
from ivg_addon.blender.properties import ensure_registered

from .detailed_object import detailed_mesh
from .eevee_child import by_eevee
from .grid_shots import Picture, Truth, baked, cycles, displayed, open_scene, reference, save, shoot
from .grid_times import LitShots, lit_shots, times

PARTS = ("error", "time", "flicker", "detail")
RESOLUTION = (20, 20, 20)
FLICKER_FRAMES, FLICKER_SAMPLES = 10, 4
COARSE, FINE = (155, 78), (1416, 708)
"""Divisions of the detailed object around and along its axis: 24 thousand and two million triangles."""
_FILTERS = {"pixel filter as it is": None, "a hundredth of a pixel wide, so that the point stays": 0.01}
"""Widths in pixels; Cycles has none below the last."""


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
        baked(arguments.photons, RESOLUTION)
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


def errors(truth: Truth, with_grid: LitShots, pictures: Path | None) -> None:
    """Print the error of the indirect light, in Cycles and in EEVEE."""
    print("\nindirect light with the grid        RMSE   asked   ratio of energy")
    _, indirect = with_grid[max(with_grid)]
    lines = {"Cycles": indirect}
    found = by_eevee("benchmarks.grid_render")
    if found is not None:
        print(f"(EEVEE: {found['seconds']:.1f} s a frame)")
        lines["EEVEE"] = found["indirect"]
    for name, light in lines.items():
        ratio = light.mean() / truth.indirect.mean()
        print(f"{name:35} {truth.rmse(light):.4f}   0.07   {ratio:.3f}", flush=True)
        if pictures:
            save(pictures / f"{name.lower()}.png", ("Cycles", f"{name} with the grid"), truth.indirect, light)


def in_eevee() -> dict[str, Picture]:
    """Return the indirect light of the open file in EEVEE, and how long a frame takes."""
    lit, again = shoot(), shoot()
    scene_light.remove(bpy.context)
    return {"indirect": lit.picture - shoot().picture, "seconds": np.array(again.seconds)}


def flicker(truth: Truth) -> None:
    """Print how much a pixel's light changes from seed to seed."""
    told = f"over {FLICKER_FRAMES} seeds, {FLICKER_SAMPLES} samples, of the mean indirect light"
    print(f"\nstandard deviation of a pixel {told}")
    for name, width in _FILTERS.items():
        print(name)
        scene_light.remove(bpy.context)
        without, denoised = frames(width, direct=True), frames(width, denoise=True)
        scene_light.add(bpy.context)
        rows = {
            "with the grid, indirect light": frames(width, direct=True) - without,
            "Cycles, denoised, whole picture": denoised,
            "with the grid, denoised, whole picture": frames(width, direct=True, denoise=True),
        }
        for row, found in rows.items():
            scatter = found.std(axis=0, ddof=1)[truth.surfaces] / truth.indirect.mean()
            numbers = f"mean {scatter.mean():.5f}   median {np.median(scatter):.6f}   largest {scatter.max():.4f}"
            print(f"  {row:40} {numbers}", flush=True)


def frames(width: float | None, **how: bool) -> Picture:
    """Render with one seed after the other; return all pictures."""
    seeds = range(FLICKER_FRAMES)
    return np.array([cycles(FLICKER_SAMPLES, seed=seed, width=width, **how).picture for seed in seeds])


def detail(size: int, photons: int, pictures: Path | None) -> None:
    """Print what it costs to bake an object with 24 thousand triangles that is rendered with two million."""
    shots = {}
    for name, divisions in (("coarse", COARSE), ("fine", FINE)):
        open_scene(size)
        thing = bpy.data.objects.new("Detailed", detailed_mesh(*divisions))
        bpy.context.scene.collection.objects.link(thing)
        bpy.context.view_layer.update()
        baked(photons, RESOLUTION)
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


if __name__ == "__main__":
    sys.exit(main())
