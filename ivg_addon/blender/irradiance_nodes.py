# SPDX-License-Identifier: GPL-3.0-or-later
"""The node group that looks a stored grid up where a surface is shaded: "IVG Irradiance".

The group does what `core/look_up.py` does, by the same formulas, with nothing but ordinary nodes: it works without this
program, appended and linked, in Cycles and in EEVEE. It reads the grid's image (docs/file-format.md, "The image").

Its output is E in W/m²: a diffuse surface of albedo ρ sends on ρ/π E. Its input is the normal that receives the light,
to which bump and normal maps go; where nothing is connected it is the surface's own. Which vertices see the place, and
how far the look-up moves off it, is a matter of the wall and not of the bumps on it: for that the group takes the
surface's own normal in any case. So a map of bumps changes where light is received from, as it does for any lamp.
"""

from __future__ import annotations

from typing import Any

import bpy

from ..core.dual_cells import Lattice
from ..core.errors import GridFileError
from ..core.grid_atlas import AtlasLayout
from . import grid_image
from .grid_reading import Reading
from .irradiance_formula import fill
from .marks import KEY, bears

NAME = "IVG Irradiance"
FORMAT = "irradiance-vector-grid-nodes"
VERSION = 3
"""Of the nodes; those of an older version are made anew."""
_PART = "part"
"""Under `KEY`, of the groups within: what they are for."""


def irradiance_group(image: bpy.types.Image) -> bpy.types.ShaderNodeTree:
    """Return the node group of a stored grid: the one that the file has, brought up to date, or a new one.

    Parameters
    ----------
    image
        The grid's; a linked one serves too.

    Raises
    ------
    GridFileError
        The image holds no grid or was changed by hand; or the group was made by a newer version, or is linked and not
        up to date.
    """
    group = find(image)
    wrong = _problem(image, group)
    if wrong:
        raise GridFileError(wrong)
    if group is None:
        group = bpy.data.node_groups.new(_free_name(image), "ShaderNodeTree")
    about = _about(image)
    if group.get(KEY) is None or group[KEY].to_dict() != about:
        if group.library:
            raise GridFileError(
                f"node group '{group.name}' is not up to date: open {group.library.filepath}, and choose the grid there"
            )
        _fill(group, image)
        group[KEY] = about
    return group


def follow(image: bpy.types.Image) -> None:
    """Bring the node group of a grid that was baked anew up to date, if there is one that this version may change."""
    group = find(image)
    if group is not None and not group.library and not _problem(image, group):
        irradiance_group(image)


def _problem(image: bpy.types.Image, group: bpy.types.ShaderNodeTree | None) -> str:
    """Return why there can be no node group of a grid, or the one there is cannot be changed; empty if it can."""
    wrong = grid_image.problem(image)
    if wrong:
        return wrong
    version = group[KEY]["version"] if group is not None else VERSION
    if group is not None and version > VERSION:
        return (
            f"node group '{group.name}' was made by a newer Irradiance Vector Grid (version {version}, this one has "
            f"{VERSION}): update the extension, or remove the group"
        )
    return ""


def find(image: bpy.types.Image) -> bpy.types.ShaderNodeTree | None:
    """Return the node group of a grid, of whatever version, if the file has one."""
    return next((group for group in bpy.data.node_groups if grid_of(group) == image), None)


def grid_of(group: bpy.types.NodeTree) -> bpy.types.Image | None:
    """Return the image of the grid that a node group looks up; None if it is no such group."""
    return group[KEY].get("image") if bears(group, FORMAT) else None


def _about(image: bpy.types.Image) -> dict[str, Any]:
    """Return what a group says about itself: all that its nodes follow from."""
    stored = image[KEY]
    return {
        "format": FORMAT,
        "version": VERSION,
        "image": image,
        "grid_digest": stored["grid_digest"],
        "layout": {name: list(stored[name]) for name in ("bounds_min", "bounds_max", "resolution", "size")}
        | {name: stored.get(name, 0) for name in ("across", "walls", "spatial")},
    }


def _fill(group: bpy.types.ShaderNodeTree, image: bpy.types.Image) -> None:
    """Make a group's nodes anew; what uses it stays linked to it."""
    stored = image[KEY]
    lattice = Lattice(tuple(stored["bounds_min"]), tuple(stored["bounds_max"]), tuple(stored["resolution"]))
    where = AtlasLayout(lattice.resolution, stored["across"], stored.get("walls", 0))
    parts = {tree[KEY][_PART]: tree for tree in _used(group) if _PART in tree.get(KEY, {})}

    def part(name: str) -> bpy.types.ShaderNodeTree:
        if name not in parts:
            # A name that begins with a dot is left out of Blender's lists.
            parts[name] = bpy.data.node_groups.new(f".{group.name}: {name}", "ShaderNodeTree")
            parts[name][KEY] = {_PART: name}
        return parts[name]

    fill(group, Reading(image, lattice, where), grid_image.spatial(image), part)


def _used(group: bpy.types.ShaderNodeTree) -> set[bpy.types.ShaderNodeTree]:
    """Return all groups that are used in one."""
    used = {node.node_tree for node in group.nodes if node.type == "GROUP" and node.node_tree is not None}
    return used.union(*(_used(tree) for tree in used))


def _free_name(image: bpy.types.Image) -> str:
    return f"{NAME} ({image.name})" if NAME in bpy.data.node_groups else NAME
