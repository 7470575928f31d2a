# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole of `sample_blend/semi_dynamic.blend` by its own camera, as a film with the grid's light.

The engines compute direct light; the room looks the grid up, and the stone has what the modifier stores.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path

import bpy

from ivg_addon.blender import direct_light, scene_light
from ivg_addon.blender.cycles_stage import changed

ENGINES = {"CYCLES": "Cycles", "BLENDER_EEVEE": "EEVEE"}
"""What they are called."""
SAMPLES = 16
"""Of either engine; Cycles' direct light is denoised."""


def film(scene: bpy.types.Scene, folder: Path, engines: Iterable[str], step: int) -> None:
    """Render a baked scene every so many frames, as PNG files `cycles_0001.png`, `eevee_0001.png` and so on."""
    for notice in scene_light.add(bpy.context, light_from="MODIFIER").notices:
        print(notice)
    direct_light.switch_to_direct(scene)
    render = scene.render
    settings = {
        (scene.cycles, "samples"): SAMPLES,
        (scene.cycles, "use_denoising"): True,
        (scene.eevee, "taa_render_samples"): SAMPLES,
        (render.image_settings, "media_type"): "IMAGE",
        (render.image_settings, "file_format"): "PNG",
    }
    for engine in engines:
        for number in range(scene.frame_start, scene.frame_end + 1, step):
            scene.frame_set(number)
            path = folder.absolute() / f"{ENGINES[engine].lower()}_{number:04}.png"
            start = time.perf_counter()
            with changed({(render, "engine"): engine, (render, "filepath"): str(path), **settings}):
                bpy.ops.render.render(write_still=True)
            print(f"{path.name} {time.perf_counter() - start:6.1f} s", flush=True)
