# SPDX-License-Identifier: GPL-3.0-or-later
"""What is stored in the .blend: `scene.ivg`, the settings of a bake and what the last one did, and `object.ivg`.

The settings are declared once, by `settings_properties`: the same names, limits and tooltips serve
`scene.ivg` and the operators' overrides. Every enum item has its number, because that number is
what a saved file holds.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

from . import staleness
from .grid_image import is_grid
from .inspection_properties import IvgInspection
from .outcome_properties import IvgNotice, IvgOutcome, IvgRow

BOUNDS_MODES = (
    ("SCENE", "Scene", "Smallest box around everything that is rendered", "SCENE_DATA", 0),
    ("OBJECT", "Object", "Box of an empty or a mesh object", "MESH_CUBE", 1),
)
RESOLUTION_MODES = (
    ("AUTO", "Automatic", "Cubic voxels, as many along the longest side as given", 0),
    ("MANUAL", "Manual", "Voxels along x, y and z as given", 1),
)
ESTIMATORS = (
    (
        "TRACK_LENGTH",
        "Track Length",
        "Count a photon by the length of its path through a cell: unbiased, the least noise",
        0,
    ),
    (
        "CROSSING",
        "Crossing",
        "Count a photon where it crosses a cell's face, divided by the cosine: unbiased, noisier",
        1,
    ),
    (
        "REPORT",
        "Report",
        "The formula as printed in INRIA RR-6983: too dark, kept to reproduce its numbers",
        2,
    ),
)
SPATIAL_INTERPOLATIONS = (
    ("TRILINEAR", "Trilinear", "Eight vertices around the point: fast", 0),
    ("TRICUBIC", "Tricubic", "64 vertices around the point (cubic B-spline): smooth, softer", 1),
)
DIRECTIONAL_INTERPOLATIONS = (
    ("LEAST_SQUARES", "Least Squares", "Best fit of the six vectors to the normal's cosine", 0),
    ("REPORT", "Report", "The formula as printed in INRIA RR-6983: too dark between the axes", 1),
)
LIGHT_FROM = (
    ("GRID", "Grid", "Look the grid up wherever a surface is shaded, with bump and normal maps", 0),
    (
        "MODIFIER",
        "Modifier",
        "Take what the modifier IVG Light has stored at the points of objects: faster, but received along the normals "
        "of the geometry, without bump and normal maps. Materials that other objects show too look the grid up",
        1,
    ),
)


def settings_properties(options: Iterable[str] = ()) -> dict[str, Any]:
    """Return the properties that say what to bake and how to look it up, by name.

    Parameters
    ----------
    options
        Blender's property options; operators pass ``{"SKIP_SAVE"}``, so that an override is valid
        for one call only.
    """
    flags = set(options)
    return {
        **_box_properties(flags),
        **_photon_properties(flags),
        "filepath": StringProperty(
            name="Grid File",
            description="Where the grid is kept (.ivg.npz). Empty: beside the .blend file, under its name",
            subtype="FILE_PATH",
            default="",
            options=flags | {"PATH_SUPPORTS_BLEND_RELATIVE"},
        ),
    }


def _box_properties(flags: set[str]) -> dict[str, Any]:
    """Return the properties that say which box is baked, and into how many voxels."""
    return {
        "bounds_mode": EnumProperty(
            name="Bounds",
            description="Which box the grid fills",
            items=BOUNDS_MODES,
            default="SCENE",
            options=flags,
        ),
        "margin": FloatProperty(
            name="Margin",
            description="Distance by which the box is made larger on every side",
            subtype="DISTANCE",
            unit="LENGTH",
            default=0.0,
            min=0.0,
            soft_max=1.0,
            options=flags,
        ),
        "resolution_mode": EnumProperty(
            name="Resolution",
            description="How the number of voxels is chosen",
            items=RESOLUTION_MODES,
            default="AUTO",
            options=flags,
        ),
        "longest_side": IntProperty(
            name="Longest Side",
            description="Voxels along the longest side of the box; the others follow, so that voxels are cubes",
            default=32,
            min=1,
            soft_min=4,
            soft_max=64,
            max=1024,
            options=flags,
        ),
        "resolution": IntVectorProperty(
            name="Voxels",
            description="Voxels along x, y and z; the grid has one vertex more along each",
            subtype="XYZ",
            size=3,
            default=(20, 20, 20),
            min=1,
            soft_max=128,
            max=1024,
            options=flags,
        ),
    }


def _photon_properties(flags: set[str]) -> dict[str, Any]:
    """Return the properties that say which photons fly, and what is made of them."""
    return {
        "photons": IntProperty(
            name="Photons",
            description="Photons that the lights emit: four times as many halve the noise and "
            "take four times as long. Memory does not grow with them",
            default=8_000_000,
            min=1,
            soft_min=10_000,
            soft_max=1_000_000_000,
            options=flags,
        ),
        "bounces": IntProperty(
            name="Bounces",
            description="Most diffuse bounces of a photon, as in Cycles' light paths",
            default=12,
            min=1,
            soft_max=32,
            max=1024,
            options=flags,
        ),
        "seed": IntProperty(
            name="Seed",
            description="Another seed gives other noise; the same seed gives the same grid to the "
            "bit, whatever the number of threads",
            default=0,
            min=0,
            options=flags,
        ),
        "estimator": EnumProperty(
            name="Estimator",
            description="How a photon's flight becomes irradiance vectors",
            items=ESTIMATORS,
            default="TRACK_LENGTH",
            options=flags,
        ),
        "include_direct": BoolProperty(
            name="Include Direct Light",
            description="Store the light that comes straight from the lights too, not only after "
            "its first bounce. Shadows softer than a voxel are lost",
            default=False,
            options=flags,
        ),
        "threads": IntProperty(
            name="Threads",
            description="Processor threads to use; 0 uses all",
            default=0,
            min=0,
            soft_max=64,
            max=1024,
            options=flags,
        ),
    }


def look_up_properties(options: Iterable[str] = ()) -> dict[str, Any]:
    """Return the properties that say how irradiance is read from the grid, by name."""
    flags = set(options)
    return {
        "spatial": EnumProperty(
            name="Spatial",
            description="How the grid's vertices around a point are weighted",
            items=SPATIAL_INTERPOLATIONS,
            default="TRILINEAR",
            options=flags,
        ),
        "directional": EnumProperty(
            name="Directional",
            description="How the six vectors of a vertex become the irradiance of a normal",
            items=DIRECTIONAL_INTERPOLATIONS,
            default="LEAST_SQUARES",
            options=flags,
        ),
        "normal_bias": FloatProperty(
            name="Normal Bias",
            description="Look up this many voxels above the surface, along its normal: less light leaks through walls",
            default=0.375,
            min=0.0,
            soft_max=1.0,
            max=4.0,
            step=5,
            precision=3,
            options=flags,
        ),
    }


def light_from_property(options: Iterable[str] = ()) -> Any:
    """Return the property that says where materials take the grid's light from."""
    return EnumProperty(
        name="Light From",
        description="Where materials take the light of the grid from",
        items=LIGHT_FROM,
        default="GRID",
        options=set(options),
    )


def override_properties() -> dict[str, Any]:
    """Return the properties of a bake operator: every setting, and the box as names or numbers.

    What is not given in a call is taken from `scene.ivg`.
    """
    flags = {"SKIP_SAVE"}
    return settings_properties(flags) | {
        "grid": StringProperty(
            name="Grid",
            description="Name of the grid in this file: replaced if there is one. Empty: the scene's own",
            default="",
            options=flags,
        ),
        "bounds_object": StringProperty(
            name="Bounds Object",
            description="Name of the empty or mesh whose box the grid fills",
            default="",
            options=flags,
        ),
        "bounds_min": FloatVectorProperty(
            name="Bounds Minimum",
            description="Lower corner of the grid's box, together with the upper one",
            subtype="TRANSLATION",
            unit="LENGTH",
            size=3,
            options=flags,
        ),
        "bounds_max": FloatVectorProperty(
            name="Bounds Maximum",
            description="Upper corner of the grid's box, together with the lower one",
            subtype="TRANSLATION",
            unit="LENGTH",
            size=3,
            options=flags,
        ),
    }


def _has_box(settings: IvgSettings, candidate: bpy.types.Object) -> bool:
    """Tell whether an object may be the bounds: an empty or a mesh."""
    return candidate.type in {"EMPTY", "MESH"}


def _is_grid(settings: IvgSettings, candidate: bpy.types.Image) -> bool:
    """Tell whether an image is a grid that a bake has stored."""
    return is_grid(candidate)


class IvgSettings(bpy.types.PropertyGroup):
    """`scene.ivg`: what to bake, how to look it up, and what the last bake did."""

    __annotations__ = (
        settings_properties()
        | look_up_properties()
        | {
            "bounds_object": PointerProperty(
                name="Object",
                description="Empty or mesh whose axis-aligned box in world space the grid fills",
                type=bpy.types.Object,
                poll=_has_box,
            ),
            "show_bounds": BoolProperty(
                name="Show Bounds",
                description="Draw the grid's box and its voxels in the viewports",
                default=False,
                options=set(),
            ),
            "grid": PointerProperty(
                name="Grid",
                description="The scene's grid, an image in this file that a bake replaces. Empty: the next bake makes "
                "a new one",
                type=bpy.types.Image,
                poll=_is_grid,
            ),
            "seen_checksum": StringProperty(
                name="Seen",
                description="Checksum of the scene when it was last baked or checked",
                options={"HIDDEN"},
            ),
            "changed_since": BoolProperty(
                name="Changed",
                description="Whether something has changed since that could change the light",
                default=False,
                options={"HIDDEN"},
            ),
            "light_from": light_from_property(),
            "inspection": PointerProperty(type=IvgInspection),
            "settings_before": StringProperty(
                name="Settings Before",
                description="Render settings that were changed so that only direct light is computed, as JSON",
                options={"HIDDEN"},
            ),
            "last_bake": PointerProperty(type=IvgOutcome),
            "last_compare": PointerProperty(type=IvgOutcome),
        }
    )


def _left_out_or_not(settings: IvgObjectSettings, context: bpy.types.Context) -> None:
    """Note that the light of the object's scenes may be another."""
    for scene in settings.id_data.users_scene:
        staleness.edited(scene)
    settings.id_data.update_tag()


class IvgObjectSettings(bpy.types.PropertyGroup):
    """`object.ivg`: what a bake makes of an object."""

    __annotations__ = {
        "leave_out": BoolProperty(
            name="Leave Out of the Bake",
            description="Bake as if the object, what it instances and the light it gives were not there, though they "
            "render: for what moves. Hold Alt to set it for all selected objects",
            default=False,
            update=_left_out_or_not,
            options=set(),
        ),
    }


_CLASSES = (IvgRow, IvgNotice, IvgOutcome, IvgInspection, IvgSettings, IvgObjectSettings)


def register() -> None:
    """Give every scene and every object its `ivg`."""
    for index, cls in enumerate(_CLASSES):
        try:
            bpy.utils.register_class(cls)
        except Exception:
            for registered in reversed(_CLASSES[:index]):
                bpy.utils.unregister_class(registered)
            raise
    bpy.types.Scene.ivg = PointerProperty(type=IvgSettings)
    bpy.types.Object.ivg = PointerProperty(type=IvgObjectSettings)


def unregister() -> None:
    """Take `ivg` away from scenes and objects; what the files hold stays there."""
    del bpy.types.Object.ivg
    del bpy.types.Scene.ivg
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)


def ensure_registered() -> None:
    """Give scenes and objects their `ivg` unless the extension, or an earlier call, has done so."""
    if not hasattr(bpy.types.Scene, "ivg"):
        register()
