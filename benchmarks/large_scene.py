# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure a scene of two million triangles: `python -m benchmarks.large_scene [--bunny FILE] [--photons N]`.

The Stanford bunny, subdivided and displaced by modifiers, and a smaller one beside it, in a room. Prints how long the
export takes and how much memory it holds at most per triangle beyond what Blender itself holds for a render of the
scene, and what the steps before the first photon take; then bakes. Each measurement runs in a process of its own.
Exits with 1 if the export misses what is asked for.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ivg_addon.core.memory import peak

BUNNY = Path(__file__).resolve().parent.parent.parent / "shared" / "models" / "stanford-bunny.obj"
MOST_SECONDS, AIM_SECONDS = 10.0, 4.0
MOST_BYTES, AIM_BYTES = 1000.0, 300.0

ROOM = 4.0
"""Metres, its edges."""
BUNNIES = ((2.4, (1.4, 2.2), 2), (1.2, (3.0, 1.2), 1))
"""Height in metres, place on the floor, and levels of subdivision of each."""
RESOLUTION = (32, 32, 32)


def build(file: Path) -> None:
    """Make the scene in an empty Blender."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.obj_import(filepath=str(file), forward_axis="NEGATIVE_Z", up_axis="Y")
    mesh = bpy.context.object.data
    bpy.data.objects.remove(bpy.context.object)
    mesh.shade_smooth()
    texture = bpy.data.textures.new("Bumps", "CLOUDS")
    low, high = (tuple(edge(v.co[axis] for v in mesh.vertices) for axis in range(3)) for edge in (min, max))
    for height, place, levels in BUNNIES:
        bunny = bpy.data.objects.new("Bunny", mesh.copy())
        scale = height / (high[1] - low[1])
        bunny.rotation_euler[0] = 0.5 * 3.141592653589793
        bunny.scale = (scale, scale, scale)
        bunny.location = (place[0], place[1], -scale * low[1])
        subdivision = bunny.modifiers.new("Subdivision", "SUBSURF")
        subdivision.levels, subdivision.render_levels = 0, levels
        # The limit surface of a mesh that was scanned takes Blender half a minute and seven GB.
        subdivision.use_limit_surface = False
        displacement = bunny.modifiers.new("Displacement", "DISPLACE")
        displacement.texture, displacement.texture_coords = texture, "LOCAL"
        displacement.strength, texture.noise_scale = 0.01 / scale, 0.05
        displacement.show_viewport = False
        bpy.context.scene.collection.objects.link(bunny)
    bpy.ops.mesh.primitive_cube_add(size=ROOM, location=(0.5 * ROOM,) * 3)
    light = bpy.data.lights.new("Lamp", "AREA")
    light.size, light.energy = 1.0, 100.0
    lamp = bpy.data.objects.new("Lamp", light)
    lamp.location = (0.5 * ROOM, 0.5 * ROOM, 0.98 * ROOM)
    bpy.context.scene.collection.objects.link(lamp)
    bpy.context.view_layer.update()


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """Return what some work returns, and its seconds."""
    start = time.perf_counter()
    result = work()
    return result, time.perf_counter() - start


def evaluate(file: Path) -> dict[str, float]:
    """Let Blender evaluate the scene for a render, and make the triangles and normals that a render needs."""
    import bpy

    from ivg_addon.blender.export_depsgraph import with_render_depsgraph

    def read(depsgraph: Any, _stop: Any) -> float:
        for instance in depsgraph.object_instances:
            if instance.object.type == "MESH":
                mesh = instance.object.data
                mesh.calc_loop_triangles()
                len(mesh.corner_normals)
        return float(peak())

    build(file)
    before = resident()
    held, seconds = timed(lambda: with_render_depsgraph(bpy.context.scene, bpy.context.view_layer, read))
    return {"seconds": seconds, "bytes": held - before}


def export(file: Path, photons: int) -> dict[str, float]:
    """Export the scene, take the steps before the first photon one by one, and bake it."""
    import bpy

    from ivg_addon.blender.export import export_render_steps
    from ivg_addon.core.bake import bake
    from ivg_addon.core.checksum import checksum
    from ivg_addon.core.embree import Tracer
    from ivg_addon.core.progress import finish
    from ivg_addon.core.settings import BakeSettings
    from ivg_addon.core.surface_bins import SurfaceBins

    build(file)
    before = resident()
    scene, seconds = timed(lambda: finish(export_render_steps(bpy.context.scene, bpy.context.view_layer)))
    numbers = {"seconds": seconds, "bytes": float(peak() - before), "triangles": scene.geometry.triangle_count}
    numbers["checksum"] = timed(lambda: checksum(scene))[1]
    numbers["tracer"] = timed(lambda: Tracer(scene.geometry))[1]
    numbers["bins"] = timed(lambda: SurfaceBins.of(scene.geometry, ROOM / RESOLUTION[0] / 8))[1]
    if photons:
        settings = BakeSettings((0.0,) * 3, (ROOM,) * 3, RESOLUTION, photons=photons)
        start = peak()
        result, numbers["bake"] = timed(lambda: bake(scene, settings))
        statistics = result.statistics
        numbers["prepare"], numbers["photons"] = statistics.prepare_seconds, statistics.photon_seconds
        numbers["lit"], numbers["bake_bytes"] = statistics.lit_seconds, float(peak() - start)
    return numbers


def resident() -> int:
    """Return the memory that this process holds now, bytes."""
    import psutil

    return int(psutil.Process().memory_info().rss)


def in_child(*arguments: str) -> dict[str, float]:
    """Run a part of this module in a new process; return the numbers that it prints last."""
    command = [sys.executable, "-m", "benchmarks.large_scene", *arguments]
    lines = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout.splitlines()
    numbers: dict[str, float] = json.loads(lines[-1])
    return numbers


def main() -> int:
    """Measure and print a table; return the exit status."""
    parser = argparse.ArgumentParser(description="Measure a scene of two million triangles.")
    parser.add_argument("--bunny", type=Path, default=BUNNY, help=f"the model (default {BUNNY})")
    parser.add_argument("--photons", type=int, default=1_000_000, help="to bake with; 0 leaves the bake out")
    parser.add_argument("--part", choices=("evaluate", "export"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if not options.bunny.is_file():
        parser.error(f"no model at {options.bunny}: name one with --bunny")
    if options.part == "evaluate":
        print(json.dumps(evaluate(options.bunny)))
        return 0
    if options.part == "export":
        print(json.dumps(export(options.bunny, options.photons)))
        return 0

    common = ("--bunny", str(options.bunny))
    blender = in_child("--part", "evaluate", *common)
    ours = in_child("--part", "export", "--photons", str(options.photons), *common)
    triangles = ours["triangles"]
    own = (ours["bytes"] - blender["bytes"]) / triangles
    print(f"{int(triangles):,} triangles")
    print(
        f"evaluation by Blender alone   {blender['seconds']:6.2f} s   {blender['bytes'] / triangles:6.0f} B a triangle"
    )
    print(f"export with it                {ours['seconds']:6.2f} s   {ours['bytes'] / triangles:6.0f} B a triangle")
    print(f"export beyond it              {ours['seconds'] - blender['seconds']:6.2f} s   {own:6.0f} B a triangle")
    for name, what in (("checksum", "checksum"), ("tracer", "Embree's structure"), ("bins", "surface bins")):
        print(f"{what:28}  {ours[name]:6.2f} s")
    if options.photons:
        print(
            f"bake, {options.photons:,} photons    {ours['bake']:6.2f} s   "
            f"{ours['bake_bytes'] / triangles:6.0f} B a triangle (prepare {ours['prepare']:.2f} s, "
            f"photons {ours['photons']:.2f} s, lit volumes {ours['lit']:.2f} s)"
        )
    slow, big = ours["seconds"] > MOST_SECONDS, ours["bytes"] / triangles > MOST_BYTES
    print(
        f"export with evaluation: at most {MOST_SECONDS:.0f} s, aim {AIM_SECONDS:.0f} s{'  MISSED' if slow else ''}; "
        f"at most {MOST_BYTES:.0f} B a triangle, aim {AIM_BYTES:.0f} B{'  MISSED' if big else ''}"
    )
    return int(slow or big)


if __name__ == "__main__":
    sys.exit(main())
