# SPDX-License-Identifier: GPL-3.0-or-later
"""`ivg compare`: a grid beside Cycles, as a picture or at random points."""

from __future__ import annotations

import argparse
import sys
from typing import TextIO

import bpy

from .. import jobs, outcome
from ..blend_file import open_blend
from ..compare_job import CompareRequest, compare_job, picture_of
from ..console import Console
from ..interrupts import Interrupts
from ..properties import ensure_registered

_LOOK_UP = ("spatial", "directional", "normal_bias")


def run(options: argparse.Namespace, output: TextIO, interrupts: Interrupts) -> None:
    """Compare and print the numbers; raises `IvgError`."""
    ensure_registered()
    open_blend(options.blend)
    request = CompareRequest(
        grid=options.grid,
        output=(options.out or picture_of(options.grid)).resolve(),
        points=options.points,
        samples=options.samples,
        look_up={name: getattr(options, name) for name in _LOOK_UP if getattr(options, name) is not None},
    )
    job = compare_job(bpy.context, request, interrupts.run)
    with Console(sys.stderr) as console:
        jobs.run_blocking(job, console.show, interrupts.check)
    output.write(outcome.text(bpy.context.scene.ivg.last_compare) + "\n")
