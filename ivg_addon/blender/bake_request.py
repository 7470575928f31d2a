# SPDX-License-Identifier: GPL-3.0-or-later
"""What is asked for: the scene's settings, and in their place what a call or a command line says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import bpy

from ..core.errors import SettingsError
from ..core.scene import Scene
from ..core.settings import BakeSettings, Estimator
from .bounds import Box, Resolution, automatic_resolution, object_box
from .grid_store import grid_path
from .storage import default_name, target_name

Overrides = Mapping[str, Any]
"""Settings by their names on `scene.ivg`, and `bounds_min`, `bounds_max`; `bounds_object` and
`grid` may be names."""


@dataclass(frozen=True)
class BakeRequest:
    """A bake as asked for; independent of Blender's data, which may change meanwhile.

    Parameters
    ----------
    output
        Where the grid goes.
    grid
        The name under which the .blend keeps it.
    box
        The grid's box without the margin; None: the smallest around the scene.
    margin
        Metres by which the box is made larger on every side.
    resolution
        Voxels along x, y and z; None: cubes, `longest_side` of them along the longest side.
    settings
        All other settings; box and resolution in it mean nothing.
    """

    output: Path
    grid: str
    box: Box | None
    margin: float
    resolution: Resolution | None
    longest_side: int
    settings: BakeSettings

    def settings_for(self, scene: Scene) -> BakeSettings:
        """Return the settings of the bake of a scene; raises `SettingsError` for an empty box."""
        box = self.box
        if box is None:
            low, high = scene.geometry.bounds()
            box = Box.between(low, high)
        box = box.grown(self.margin)
        resolution = self.resolution
        if resolution is None:
            resolution = automatic_resolution(box.size, self.longest_side)
        return replace(self.settings, bounds_min=box.low, bounds_max=box.high, resolution=resolution)


def read_request(context: bpy.types.Context, overrides: Overrides) -> BakeRequest:
    """Return what is asked for; raises `SettingsError` that says what to change."""
    chosen = _Chosen(context.scene.ivg, overrides)
    resolution = _resolution(chosen)
    grid = target_name(context.scene, overrides.get("grid", ""))
    also_named = "" if grid == default_name(context.scene) else grid
    return BakeRequest(
        output=grid_path(context.scene, chosen["filepath"], also_named),
        grid=grid,
        box=_box(chosen, context),
        margin=0.0 if "bounds_min" in overrides else chosen["margin"],
        resolution=resolution,
        longest_side=chosen["longest_side"],
        settings=BakeSettings(
            bounds_min=(0.0, 0.0, 0.0),
            bounds_max=(1.0, 1.0, 1.0),
            resolution=resolution or (1, 1, 1),
            photons=chosen["photons"],
            bounces=chosen["bounces"],
            seed=chosen["seed"],
            estimator=Estimator(chosen["estimator"]),
            include_direct=chosen["include_direct"],
            threads=chosen["threads"],
        ),
    )


class _Chosen:
    """Settings by name: as overridden, else as in the scene."""

    def __init__(self, settings: Any, overrides: Overrides) -> None:
        self._settings = settings
        self.overrides = overrides

    def __getitem__(self, name: str) -> Any:
        """Return a setting."""
        return self.overrides[name] if name in self.overrides else getattr(self._settings, name)

    def mode(self, name: str, **implied_by: str) -> str:
        """Return a mode: as overridden, as an overridden setting implies it, or the scene's."""
        if name not in self.overrides:
            for setting, mode in implied_by.items():
                if setting in self.overrides:
                    return mode
        return str(self[name])


def _box(chosen: _Chosen, context: bpy.types.Context) -> Box | None:
    """Return the grid's box, or None where it is the scene's."""
    low, high = (chosen.overrides.get(name) for name in ("bounds_min", "bounds_max"))
    if low is not None and high is not None:
        return Box.between(low, high)
    if low is not None or high is not None:
        raise SettingsError("bounds need both corners: give bounds_min and bounds_max")
    if chosen.mode("bounds_mode", bounds_object="OBJECT") == "SCENE":
        return None
    bounds_object = _bounds_object(chosen["bounds_object"])
    return object_box(bounds_object, context.evaluated_depsgraph_get())


def _bounds_object(named: bpy.types.Object | str | None) -> bpy.types.Object:
    """Return the object that bounds the grid."""
    if not named:
        raise SettingsError("no bounds object is chosen: choose an empty or a mesh, or take the scene's bounds")
    if not isinstance(named, str):
        return named
    found = bpy.data.objects.get(named)
    if found is None:
        raise SettingsError(f"there is no object '{named}' to bound the grid: check the name")
    return found


def _resolution(chosen: _Chosen) -> Resolution | None:
    """Return the grid's voxels, or None where they follow from the box."""
    if chosen.mode("resolution_mode", resolution="MANUAL", longest_side="AUTO") == "AUTO":
        return None
    x, y, z = (int(voxels) for voxels in chosen["resolution"])
    return x, y, z
