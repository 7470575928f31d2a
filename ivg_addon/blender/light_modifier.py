# SPDX-License-Identifier: GPL-3.0-or-later
"""The modifier "IVG Light" on objects: put there, taken off, and what hinders it.

Nodes reach a volume datablock through an object only. Each grid has one for them that is in no scene; its place does
not matter. A new bake gives the same volume another file, which modifiers then read.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import bpy

from ..core.errors import GridFileError
from . import grid_volume
from .bounds import reaches_out
from .grid_image import box, named
from .marks import KEY, bears
from .modifier_nodes import ATTRIBUTE, BIAS, FORMAT, GRID, NAME, STORED, UNREADABLE, VERSION, make_group

TYPES = frozenset({"MESH", "CURVE", "FONT", "CURVES", "POINTCLOUD"})
"""Of objects that can have the modifier, and that light falls on."""


@dataclass(frozen=True)
class Outcome:
    """What came of putting the modifier on objects, or taking it off.

    Parameters
    ----------
    done
        Objects that were changed.
    left_out
        Why others were not, by the object's name.
    """

    done: int
    left_out: dict[str, str]


def add(image: bpy.types.Image, objects: Iterable[bpy.types.Object], bias: float) -> Outcome:
    """Put the modifier on objects, at the end of their stacks; one that is there is made to read this grid.

    Parameters
    ----------
    image
        The grid.
    bias
        Normal bias, in voxels.

    Raises
    ------
    GridFileError
        The grid has no volume.
    """
    if grid_volume.volume_of(image) is None:
        raise GridFileError(f"{named(image)} has no volume: press Restore in the panel, or bake again")
    tree, grid = None, None
    done, left_out = 0, {}
    for target in objects:
        why = hindrance(target)
        if why:
            left_out[target.name] = why
            continue
        if tree is None:
            tree, grid = _group(), _grid_object(image)
        modifier = of(target) or target.modifiers.new(NAME, "NODES")
        modifier.node_group = tree
        _set(modifier, GRID, grid)
        _set(modifier, BIAS, bias)
        # Only this makes Blender see that the modifier depends on another object now.
        modifier.node_group = tree
        done += 1
    return Outcome(done, left_out)


def remove(objects: Iterable[bpy.types.Object]) -> Outcome:
    """Take the modifier off objects; what nothing uses then is removed from the file."""
    done, left_out = 0, {}
    for target in objects:
        if of(target) is None:
            continue
        if not target.is_editable:
            left_out[target.name] = _LINKED
            continue
        while (modifier := of(target)) is not None:
            # A modifier that is removed goes on counting as a user of its inputs.
            if any(item.name == GRID for item in modifier.node_group.interface.items_tree):
                _set(modifier, GRID, None)
            target.modifiers.remove(modifier)
        done += 1
    _remove_unused()
    return Outcome(done, left_out)


_LINKED = "it is linked: make a library override of it, or open its file"


def hindrance(target: bpy.types.Object) -> str:
    """Return why an object cannot have the modifier; empty if it can."""
    if not target.is_editable:
        return _LINKED
    if target.type not in TYPES:
        return "geometry nodes do not run on it, or nothing of it is lit"
    present = of(target)
    if present is not None and present.node_group[KEY].get("version") != VERSION and _newer(present.node_group):
        return "its IVG Light is of a newer Irradiance Vector Grid: update the extension"
    return ""


def of(target: bpy.types.Object) -> bpy.types.NodesModifier | None:
    """Return an object's modifier, of this version's layout or another; None if it has none."""
    return next((each for each in target.modifiers if each.type == "NODES" and _is_ours(each.node_group)), None)


def stores(target: bpy.types.Object, image: bpy.types.Image) -> bool:
    """Tell whether an object's modifier stores the light of a grid in renders, where materials look for it."""
    modifier = of(target)
    if modifier is None or not modifier.show_render or modifier.node_group[KEY].get("version") != VERSION:
        return False
    grid = _get(modifier, GRID)
    reads = grid is not None and grid.data is not None and grid.data == grid_volume.volume_of(image)
    return reads and _get(modifier, STORED) == ATTRIBUTE


def in_use() -> bool:
    """Tell whether any object has the modifier; fast enough for drawing."""
    return any(_is_ours(tree) and tree.users > 0 for tree in bpy.data.node_groups)


def problems(image: bpy.types.Image | None, objects: Iterable[bpy.types.Object]) -> Iterator[str]:
    """Yield what is wrong with the modifiers of objects, for drawing."""
    for target in objects:
        modifier = of(target)
        if modifier is None:
            continue
        if modifier.node_group[KEY].get("version") != VERSION:
            yield f"'{target.name}' has an IVG Light of another version: add it again"
        elif (grid := _get(modifier, GRID)) is None or grid.type != "VOLUME":
            yield f"'{target.name}' has an IVG Light without a grid: add it again"
        elif UNREADABLE in (warning.message for warning in modifier.node_warnings):
            yield f"'{target.name}': {UNREADABLE}"
        elif image is not None and grid.data == grid_volume.volume_of(image) and reaches_out(target, box(image)):
            yield f"'{target.name}' reaches out of the grid: there it has the light of the grid's edge"


def _is_ours(tree: bpy.types.NodeTree | None) -> bool:
    return tree is not None and bears(tree, FORMAT)


def _newer(tree: bpy.types.NodeTree) -> bool:
    version = tree[KEY].get("version")
    return isinstance(version, int) and version > VERSION


def _group() -> bpy.types.GeometryNodeTree:
    """Return the node group of this version that the file has, or a new one."""
    ours = (tree for tree in bpy.data.node_groups if _is_ours(tree) and not tree.library)
    return next((tree for tree in ours if tree[KEY].get("version") == VERSION), None) or make_group()


def _grid_object(image: bpy.types.Image) -> bpy.types.Object:
    """Return the object through which nodes read a grid's volume, in no scene."""
    volume = grid_volume.volume_of(image)
    ours = (each for each in bpy.data.objects if each.data == volume and not each.library and not each.users_collection)
    return next(ours, None) or bpy.data.objects.new(image.name, volume)


def _remove_unused() -> None:
    """Remove node groups and grids' objects that no modifier uses any more."""
    for tree in [tree for tree in bpy.data.node_groups if _is_ours(tree) and not tree.users and not tree.library]:
        inner = {node.node_tree for node in tree.nodes if node.type == "GROUP"}
        bpy.data.node_groups.remove(tree)
        for look_up in inner:
            if not look_up.users:
                bpy.data.node_groups.remove(look_up)
    for each in [each for each in bpy.data.objects if each.type == "VOLUME" and not each.users and KEY in each.data]:
        bpy.data.objects.remove(each)


def _set(modifier: bpy.types.NodesModifier, name: str, value: object) -> None:
    """Give an input of the modifier a value."""
    key = _identifier(modifier, name)
    if _as_properties(modifier):
        getattr(modifier.properties.inputs, key).value = value
    else:
        modifier[key] = value


def _get(modifier: bpy.types.NodesModifier, name: str) -> Any:
    """Return the value of an input of the modifier."""
    key = _identifier(modifier, name)
    return getattr(modifier.properties.inputs, key).value if _as_properties(modifier) else modifier.get(key)


def _as_properties(modifier: bpy.types.NodesModifier) -> bool:
    """Tell whether inputs are properties, as in Blender 5.2, or the modifier's custom properties, as in 5.0."""
    return hasattr(modifier, "properties")


def _identifier(modifier: bpy.types.NodesModifier, name: str) -> str:
    """Return under which key a modifier keeps an input."""
    sockets = modifier.node_group.interface.items_tree
    return next(socket.identifier for socket in sockets if socket.name == name and socket.in_out == "INPUT")
