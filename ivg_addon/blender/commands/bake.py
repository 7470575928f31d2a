# SPDX-License-Identifier: GPL-3.0-or-later
"""`ivg bake`: from a .blend to its grid file."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any, TextIO

import bpy

from ...core.errors import SettingsError
from .. import direct_light, jobs, outcome, scene_light
from ..bake_job import bake_job
from ..blend_file import check_can_save, open_blend, save_blend
from ..console import Console
from ..interrupts import Interrupts
from ..properties import ensure_registered


def run(options: argparse.Namespace, output: TextIO, interrupts: Interrupts) -> None:
    """Bake and print what was done; raises `IvgError`."""
    if options.materials and options.save_blend is None:
        raise SettingsError("--materials is for the .blend that --save-blend saves: give it too")
    if options.save_blend is not None:
        check_can_save(options.save_blend)
    ensure_registered()
    open_blend(options.blend)
    overrides = _overrides(options)
    scene = bpy.context.scene
    job = bake_job(bpy.context, overrides, interrupts.run, store=options.save_blend is not None)
    with Console(sys.stderr) as console:
        jobs.run_blocking(job, console.show, interrupts.check)
    output.write(outcome.text(scene.ivg.last_bake) + "\n")
    if options.save_blend is not None:
        _keep(scene, overrides, options.save_blend.resolve())
        if options.materials:
            output.write(_light_materials(scene))
        save_blend(options.save_blend)
        output.write(f"Saved:    {options.save_blend}\n")


def _light_materials(scene: bpy.types.Scene) -> str:
    """Let the scene be rendered with the grid's light; return what is to be said."""
    lit = scene_light.add(bpy.context)
    direct_light.switch_to_direct(scene)
    told = [f"Materials: {lit.materials} with the light of the grid; renders compute direct light only"]
    told += [f"  {notice}" for notice in lit.notices]
    return "\n".join(told) + "\n"


def _overrides(options: argparse.Namespace) -> dict[str, Any]:
    """Return what the command line says in place of the scene's settings."""
    names = ("photons", "bounces", "estimator", "seed", "threads", "include_direct", "grid")
    given = {name: getattr(options, name) for name in names if getattr(options, name) is not None}
    if options.resolution == "auto":
        given["resolution_mode"] = "AUTO"
    elif options.resolution is not None:
        given["resolution"] = options.resolution
    if options.bounds is not None:
        given["bounds_min"], given["bounds_max"] = options.bounds[:3], options.bounds[3:]
    if options.out is not None:
        given["filepath"] = str(Path.cwd() / options.out)
    return given


def _keep(scene: bpy.types.Scene, overrides: dict[str, Any], blend: Path) -> None:
    """Store in the scene what was used in place of its settings, for a .blend to be saved."""
    if "resolution" in overrides:
        scene.ivg.resolution_mode = "MANUAL"
    for name, value in overrides.items():
        if hasattr(scene.ivg, name) and name != "grid":  # a name here, there the grid itself, which the bake has set
            setattr(scene.ivg, name, value)
    path = outcome.grid_file(scene)
    scene.ivg.last_bake.filepath = outcome.near(path, blend)
    if "filepath" in overrides:
        scene.ivg.filepath = outcome.near(path, blend)
