# SPDX-License-Identifier: GPL-3.0-or-later
"""`scene.ivg.inspection`: what is shown of the scene's grid, and how.

As with the settings of a bake, the same names, limits and tooltips serve the scene and the operator's overrides.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty

_DIRECTIONS = (
    ("PX", "+X", "Light on what faces +x"),
    ("NX", "−X", "Light on what faces −x"),
    ("PY", "+Y", "Light on what faces +y"),
    ("NY", "−Y", "Light on what faces −y"),
    ("PZ", "+Z", "Light on what faces up, a floor"),
    ("NZ", "−Z", "Light on what faces down, a ceiling"),
)
_NUMBERED = tuple((*item, number) for number, item in enumerate(_DIRECTIONS, start=1))
VECTORS = (
    ("FLUX", "Net Flux", "Sum of the vectors of any two opposite directions: where most of the light comes from", 0),
    *_NUMBERED,
)
QUANTITIES = (
    ("MEAN", "Mean", "Mean irradiance over all directions", 0),
    *_NUMBERED,
    ("LIT", "Lit Share", "How much of each vertex's cell light can reach", 7),
)
AXES = (
    ("X", "X", "Perpendicular to x", 0),
    ("Y", "Y", "Perpendicular to y", 1),
    ("Z", "Z", "Perpendicular to z", 2),
)

LOOK_OF_KIND = {
    "SPHERES": ("every", "sphere_size"),
    "ARROWS": ("every", "vectors", "arrow_size"),
    "SLICE": ("slice_axis", "slice_position", "quantity", "false_color"),
}
"""Which properties matter for what is shown, besides the exposure."""


def look_properties(options: Iterable[str] = ()) -> dict[str, Any]:
    """Return the properties that say what spheres, arrows and slices look like, by name.

    Parameters
    ----------
    options
        Blender's property options.
    """
    flags = set(options)
    return {
        "exposure": FloatProperty(
            name="Exposure",
            description="Stops brighter than that in which the grid's mean irradiance is a medium grey",
            default=0.0,
            soft_min=-10.0,
            soft_max=10.0,
            step=10,
            precision=2,
            options=flags,
        ),
        "every": IntProperty(
            name="Every",
            description="Show every so-manieth vertex along each axis; fewer in a large grid",
            default=1,
            min=1,
            soft_max=16,
            options=flags,
        ),
        "sphere_size": FloatProperty(
            name="Size",
            description="Diameter of spheres in distances between the vertices shown",
            default=0.5,
            min=0.01,
            soft_max=1.0,
            max=10.0,
            step=5,
            precision=2,
            options=flags,
        ),
        **_arrow_properties(flags),
        **_slice_properties(flags),
    }


def _arrow_properties(flags: set[str]) -> dict[str, Any]:
    """Return the properties of arrows alone."""
    return {
        "vectors": EnumProperty(
            name="Vectors",
            description="Which vectors arrows show. They point to where the light comes from",
            items=VECTORS,
            default="FLUX",
            options=flags,
        ),
        "arrow_size": FloatProperty(
            name="Length",
            description="Length of the long arrows in distances between the vertices shown",
            default=1.0,
            min=0.01,
            soft_max=4.0,
            max=100.0,
            step=5,
            precision=2,
            options=flags,
        ),
    }


def _slice_properties(flags: set[str]) -> dict[str, Any]:
    """Return the properties of slices alone."""
    return {
        "slice_axis": EnumProperty(
            name="Axis",
            description="Which axis the slice is perpendicular to",
            items=AXES,
            default="Y",
            options=flags,
        ),
        "slice_position": FloatProperty(
            name="Position",
            description="Where along the axis, from one side of the grid's box to the other",
            subtype="FACTOR",
            default=0.5,
            min=0.0,
            max=1.0,
            options=flags,
        ),
        "quantity": EnumProperty(
            name="Quantity",
            description="What the slice shows",
            items=QUANTITIES,
            default="MEAN",
            options=flags,
        ),
        "false_color": BoolProperty(
            name="False Color",
            description="Show luminance from black over violet and orange to yellow, not the light's own colour",
            default=False,
            options=flags,
        ),
    }


class IvgInspection(bpy.types.PropertyGroup):
    """`scene.ivg.inspection`: what the viewports show of the scene's grid."""

    __annotations__ = look_properties() | {
        "show_spheres": BoolProperty(
            name="Spheres",
            description="Draw a sphere at each vertex, coloured by the irradiance of every direction",
            default=False,
            options=set(),
        ),
        "show_arrows": BoolProperty(
            name="Arrows",
            description="Draw an arrow at each vertex, towards where its light comes from",
            default=False,
            options=set(),
        ),
        "show_slice": BoolProperty(
            name="Slice",
            description="Draw irradiance in a plane through the grid",
            default=False,
            options=set(),
        ),
        "show_box": BoolProperty(
            name="Box",
            description="Draw the grid's own box and voxels. (The switch in Bounds draws those of the next bake)",
            default=False,
            options=set(),
        ),
        "show_unlit": BoolProperty(
            name="Unlit Vertices",
            description="Mark in magenta, seen through everything, the vertices that no light reaches",
            default=False,
            options=set(),
        ),
    }
