# SPDX-License-Identifier: GPL-3.0-or-later
"""A grid's light in the materials of a scene: which these are, and objects that have none.

Blender shows what has no material as it shows a material that is new. To such objects goes a new one, so that they have
the light too; it is taken away with the light, and slots that were made for it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import bpy

from ..core.errors import GridFileError, IvgError
from ..core.report import Notice
from . import material_light, staleness, stored_light
from .bounds import reaches_out
from .export_nodes import STAND_IN
from .grid_image import box, scene_grid, spatial
from .grid_pixels import interpolate
from .inspection_mark import is_inspection
from .modifier_nodes import NAME

_STAND_IN_NAME = "IVG Stand-In"
_ADDED_SLOT = "ivg_added_slot"
"""Of data to which a slot was added for it."""
_WITH_SURFACE = frozenset({"MESH", "CURVE", "SURFACE", "FONT", "META", "CURVES", "POINTCLOUD"})


@dataclass(frozen=True)
class Lit:
    """What `add` or `remove` did.

    Parameters
    ----------
    materials
        How many have, or had, the light.
    notices
        What is to be said.
    """

    materials: int
    notices: tuple[Notice, ...] = ()


def add(context: bpy.types.Context, selected: bool = False, light_from: str = "GRID") -> Lit:
    """Add the light of the scene's grid to the materials of all objects, or of the selected ones.

    It is interpolated as the scene's look-ups are, by all who have it.

    Parameters
    ----------
    light_from
        "GRID": it is looked up where surfaces are shaded. "MODIFIER": materials all of whose objects have the modifier
        "IVG Light" take what that has stored; others look it up.

    Raises
    ------
    GridFileError
        There is no grid, or nodes cannot read it.
    SceneError
        The scene cannot be evaluated.
    """
    image = scene_grid(context.scene)
    interpolate(image, context.scene)
    with staleness.no_change_of_light(context.scene):
        objects = _objects(context, selected)
        bare = _bare(objects)
        notices = _add_light(context, _materials(context, objects), image, light_from)
        if bare:
            notices += _add_light(context, [_give_stand_in(bare)], image, light_from)
    lit = [material for material in material_light.lit_materials() if material_light.grid_of(material) == image]
    outside = outside_message(objects_outside(context.scene, image))
    if outside:
        notices += (Notice("warning", f"grid '{image.name}'", outside),)
    return Lit(len(lit), notices)


def _add_light(
    context: bpy.types.Context, materials: list[bpy.types.Material], image: bpy.types.Image, light_from: str
) -> tuple[Notice, ...]:
    stored: frozenset[bpy.types.Material] = frozenset()
    notices: tuple[Notice, ...] = ()
    if light_from == "MODIFIER" and materials:
        stored, notices = stored_light.choose(context, materials, image)
    return notices + material_light.add_light(materials, image, stored)


def follow_modifiers(context: bpy.types.Context) -> tuple[Notice, ...]:
    """Let materials look their grid up where the modifier that stored it is gone; return what is to be said."""
    notices: tuple[Notice, ...] = ()
    takers = [material for material in material_light.lit_materials() if material_light.takes_stored(material)]
    for image in {image for material in takers if (image := material_light.grid_of(material)) is not None}:
        theirs = [material for material in takers if material_light.grid_of(material) == image]
        try:
            with staleness.no_change_of_light(context.scene):
                stored, why = stored_light.choose(context, theirs, image)
                lost = [material for material in theirs if material not in stored]
                notices += why + material_light.add_light(lost, image)
        except IvgError as error:
            told = f"materials whose modifier {NAME} is gone stay black: {error}"
            notices += (Notice("warning", f"grid '{image.name}'", told),)
    return notices


def remove(context: bpy.types.Context, selected: bool = False) -> Lit:
    """Take the light out of all materials of the file, or out of those of the selected objects."""
    lit = material_light.lit_materials()
    if selected:
        theirs = set(_materials(context, _objects(context, True)))
        lit = [material for material in lit if material in theirs]
    take_out(context.scene, lit)
    return Lit(len(lit))


def take_out(scene: bpy.types.Scene, materials: Iterable[bpy.types.Material]) -> None:
    """Take the light out of materials, and the stand-in from what had none."""
    chosen = list(materials)
    if not chosen:
        return
    with staleness.no_change_of_light(scene):
        material_light.remove_light(chosen)
        for material in chosen:
            if STAND_IN in material:
                _take_stand_in(material)


def stays_old(image: bpy.types.Image) -> tuple[Notice, ...]:
    """Return what is to be said where materials could not follow a grid that was baked anew."""
    lit = [material for material in material_light.lit_materials() if material_light.grid_of(material) == image]
    if all(material_light.takes_stored(material) for material in lit):
        return ()
    from .irradiance_nodes import irradiance_group

    try:
        irradiance_group(image)
    except GridFileError as error:
        return (Notice("warning", f"grid '{image.name}'", f"materials still have its light as it was: {error}"),)
    return ()


def _objects(context: bpy.types.Context, selected: bool) -> list[bpy.types.Object]:
    """Return objects with surfaces, and those of the collections that they show instances of."""
    todo = list(context.selected_objects if selected else context.scene.objects)
    found: dict[bpy.types.Object, None] = {}
    while todo:
        current = todo.pop()
        if current in found:
            continue
        found[current] = None
        if current.instance_type == "COLLECTION" and current.instance_collection is not None:
            todo += current.instance_collection.all_objects
    return [current for current in found if _has_surface(current)]


def _has_surface(candidate: bpy.types.Object) -> bool:
    """Tell whether an object is one that materials light; what shows the grid is none."""
    return candidate.type in _WITH_SURFACE and not is_inspection(candidate)


def _materials(context: bpy.types.Context, objects: Iterable[bpy.types.Object]) -> list[bpy.types.Material]:
    """Return the materials of objects: of their slots, and what geometry nodes set."""
    depsgraph = context.evaluated_depsgraph_get()
    found: dict[bpy.types.Material, None] = {}
    for current in objects:
        found.update((slot.material, None) for slot in current.material_slots if slot.material)
        evaluated = current.evaluated_get(depsgraph).data
        made = getattr(evaluated, "materials", ())
        found.update((material.original, None) for material in made if material is not None)
    return sorted(found, key=lambda material: material.name_full)


def _bare(objects: Iterable[bpy.types.Object]) -> list[bpy.types.Object]:
    """Return the objects that have surfaces without a material, where that can be changed."""
    return [
        current
        for current in objects
        if current.is_editable
        and current.data.is_editable
        and (not current.material_slots or any(slot.material is None for slot in current.material_slots))
    ]


def _give_stand_in(objects: Iterable[bpy.types.Object]) -> bpy.types.Material:
    """Give the stand-in to what has none; return it."""
    material = next((each for each in bpy.data.materials if STAND_IN in each and not each.library), None)
    if material is None:
        material = bpy.data.materials.new(_STAND_IN_NAME)
        material[STAND_IN] = True
    for current in objects:
        if not current.data.materials:
            current.data.materials.append(material)
            current.data[_ADDED_SLOT] = True
        for slot in current.material_slots:
            if slot.material is None:
                slot.material = material
    return material


def _take_stand_in(material: bpy.types.Material) -> None:
    """Take the stand-in from all that has it."""
    for current in bpy.data.objects:
        for slot in current.material_slots:
            if slot.material == material:
                slot.material = None
        if current.data is not None and _ADDED_SLOT in current.data:
            if len(current.data.materials) == 1 and current.data.materials[0] is None:
                current.data.materials.clear()
            del current.data[_ADDED_SLOT]
    bpy.data.materials.remove(material)


def objects_outside(scene: bpy.types.Scene, image: bpy.types.Image) -> list[str]:
    """Return the names of the rendered objects that reach out of a grid's box."""
    own = box(image)
    return [
        current.name
        for current in scene.objects
        if _has_surface(current) and not current.hide_render and reaches_out(current, own)
    ]


def outside_message(names: list[str]) -> str:
    """Return what is said of objects that reach out of the grid's box; empty if none does."""
    if not names:
        return ""
    told = "out of the grid's box there is the light of its border; bake with larger bounds"
    return f"{stored_light.listed(names)}: {told}"


def interpolation_message(scene: bpy.types.Scene) -> str:
    """Return what is said where materials interpolate otherwise than the scene's look-ups; empty if they do not."""
    theirs = spatial(scene.ivg.grid)
    if theirs == scene.ivg.spatial:
        return ""
    cure = "open its file to change that" if scene.ivg.grid.library else "press Add Light to change that"
    return f"Materials' look-ups are {theirs.lower()}, not {scene.ivg.spatial.lower()}: {cure}"


def summary(image: bpy.types.Image) -> str:
    """Return how many materials have a grid's light, in words."""
    materials = material_light.lit_materials()
    theirs = [material for material in materials if material_light.grid_of(material) == image]
    here, elsewhere = len(theirs), len(materials) - len(theirs)
    stored = sum(map(material_light.takes_stored, theirs))
    told = f"{here or 'No'} material{'s have' if here > 1 else ' has'} the light of grid '{image.name}'"
    told += f", {stored} of them from {NAME}" if stored else ""
    return told + (f", {elsewhere} with that of another grid" if elsewhere else "")
