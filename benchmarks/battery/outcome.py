# SPDX-License-Identifier: GPL-3.0-or-later
"""What is said of a case: it passes, it fails, or it fails and the bake had said so."""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Literal

import bpy

from ..cell_tests import Verdict, compare_cells
from ..proof import CELLS, LIGHTS, Effort, Light, ask_cycles, bake_scene
from . import bumps, caustics, geometry, lights, reflection, settings, textures, worlds
from .stage import TESTED, Case

CASES: tuple[Case, ...] = (
    *lights.CASES,
    *worlds.CASES,
    *reflection.CASES,
    *textures.CASES,
    *bumps.CASES,
    *caustics.CASES,
    *geometry.CASES,
    *settings.CASES,
)

FALSE_ALARM = 1e-3
"""Chance that the whole battery fails at all where everything is right, with new seeds (Bonferroni over all cases and
both kinds of light)."""
CASE_FALSE_ALARM = FALSE_ALARM / (len(CASES) * len(LIGHTS))
"""The same for one comparison."""

DEFAULT = Effort(bakes=32, photons=1 << 16, points=32)
QUICK = Effort(bakes=16, photons=1 << 15, points=12)

Status = Literal["pass", "named", "FAIL"]


@dataclass(frozen=True)
class Outcome:
    """How a case went.

    Parameters
    ----------
    verdicts
        By the kind of light; empty where there was an error.
    found
        Whether the bake's light times 1.03 would have failed, by the kind of light.
    notices
        What the bake said about what is tested.
    error
        What kept it from being compared.
    """

    name: str
    verdicts: Mapping[Light, Verdict] = field(default_factory=dict)
    found: Mapping[Light, bool] = field(default_factory=dict)
    notices: tuple[str, ...] = ()
    error: str = ""

    @property
    def status(self) -> Status:
        """Return "named" for a failure that a notice foretells."""
        if not self.error and all(passed(verdict) for verdict in self.verdicts.values()):
            return "pass"
        return "named" if self.notices and not self.error else "FAIL"


def passed(verdict: Verdict) -> bool:
    """Tell whether a comparison shows no difference."""
    return verdict.p >= CASE_FALSE_ALARM


def run(case: Case, effort: Effort, seed: int = 1, factor: float = 1.0) -> Outcome:
    """Build a case's scene and compare it.

    Parameters
    ----------
    factor
        Multiplies the bake's light: what is not 1 should fail.
    """
    # Other random numbers for each case: what chance does to one says nothing about the next.
    seed = seed * 100_000 + zlib.crc32(case.name.encode()) % 100_000
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.cycles.glossy_bounces = bpy.context.scene.cycles.transmission_bounces = 12
    try:
        case.build()
        baked = bake_scene(effort, seed)
    except Exception as error:  # whatever it is: the case fails, the others go on
        return Outcome(case.name, error=f"{type(error).__name__}: {error}")
    notices = tuple(str(notice) for notice in baked.notices if TESTED in notice.subject)
    verdicts, found = {}, {}
    for index, light in enumerate(LIGHTS):
        paths = effort.samples * (case.paths if light == "INDIRECT" else 1)
        points = ask_cycles(replace(effort, samples=paths), len(LIGHTS) * seed + index, light)
        verdicts[light] = compare_cells(CELLS, factor * baked.light[light], points)
        found[light] = not passed(compare_cells(CELLS, 1.03 * factor * baked.light[light], points))
    return Outcome(case.name, verdicts, found, notices)
