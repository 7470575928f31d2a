# SPDX-License-Identifier: GPL-3.0-or-later
"""How pictures of any scenes come out: `python -m benchmarks.pictures FILE.blend … [--grids V:P …] [--no-caustics]`.

Bakes each scene with V voxels along its longest side by P million photons, and compares what its camera sees with
Cycles: indirect light, diffusely reflected. Prints one line per grid. The relative RMSE is without Cycles' own noise
(in squares), which stands beside it; where that is not much the smaller of the two, ask for more samples. Scenes with
glass and mirrors need them by the ten thousand, or `--no-caustics`. ± is the standard error that comes from the choice
of pixels. Minutes to an hour, by scene, photons and samples.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import bpy

from ivg_addon.blender.blend_file import open_blend
from ivg_addon.blender.bounds import automatic_resolution
from ivg_addon.blender.compare import compare_steps
from ivg_addon.blender.export import export_render_steps
from ivg_addon.core.bake import bake
from ivg_addon.core.progress import finish
from ivg_addon.core.settings import BakeSettings

from .accuracy import bounds


def grid_size(text: str) -> tuple[int, int]:
    """Return voxels along the longest side, and photons."""
    voxels, _, millions = text.partition(":")
    return int(voxels), int(float(millions or 8) * 1e6)


def main() -> int:
    """Bake, compare and print a table; return the exit status."""
    parser = argparse.ArgumentParser(description="Compare pictures lit by grids with Cycles.")
    parser.add_argument("blend", nargs="+", type=Path, metavar="FILE.blend")
    parser.add_argument(
        "--grids",
        nargs="+",
        type=grid_size,
        default=[grid_size("32:8"), grid_size("64:64")],
        metavar="V:P",
        help="voxels along the longest side and million photons (default 32:8 64:64)",
    )
    parser.add_argument("--size", type=int, default=115, help="pixels across (default 115)")
    parser.add_argument("--samples", type=int, default=16384, help="Cycles' paths per pixel (default 16384)")
    parser.add_argument("--no-caustics", action="store_true", help="switch caustics off, for both")
    parser.add_argument("--pictures", type=Path, help="folder to leave the pictures in")
    arguments = parser.parse_args()
    print(f"{'':44} RMSE            ratio  noise of Cycles  bake", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        pictures = arguments.pictures or Path(folder)
        pictures.mkdir(parents=True, exist_ok=True)
        for blend in arguments.blend:
            compare_scene(blend, pictures, arguments)
    return 0


def compare_scene(blend: Path, pictures: Path, arguments: argparse.Namespace) -> None:
    """Bake a scene into each of the grids, compare and print."""
    open_blend(blend)
    scene = bpy.context.scene
    scene.render.resolution_y = round(scene.render.resolution_y * arguments.size / scene.render.resolution_x)
    scene.render.resolution_x, scene.render.resolution_percentage = arguments.size, 100
    if arguments.no_caustics:
        scene.cycles.caustics_reflective = scene.cycles.caustics_refractive = False
    exported = finish(export_render_steps(scene, bpy.context.view_layer))
    low, high = bounds(exported)
    for longest_side, photons in arguments.grids:
        x, y, z = automatic_resolution((high[0] - low[0], high[1] - low[1], high[2] - low[2]), longest_side)
        start = time.perf_counter()
        grid = bake(exported, BakeSettings(low, high, (x, y, z), photons=photons)).grid
        seconds = time.perf_counter() - start
        label = f"{blend.stem}_{x}×{y}×{z}"
        output = pictures / f"{label}.png"
        steps = compare_steps(scene, bpy.context.view_layer, grid, output, samples=arguments.samples)
        found = finish(steps).agreement
        print(
            f"{f'{label}, {photons / 1e6:g} M':44} {found.own_rmse:.3f} ± {found.own_rmse_error:.3f}  "
            f"{found.energy_ratio:6.3f}  {found.noise:.3f}            {seconds:4.0f} s",
            flush=True,
        )


if __name__ == "__main__":
    sys.exit(main())
