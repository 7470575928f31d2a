# SPDX-License-Identifier: GPL-3.0-or-later
"""Which materials can take their light from what the modifier "IVG Light" stores: those of which all that shows has it.

That is asked of the scene as renders evaluate it: so instances, and geometry that nodes realise, count as what they
show. A material that something without the attribute shows would be black there, so it looks the grid up.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import bpy

from ..core.report import Notice
from . import light_modifier
from .export_depsgraph import with_render_depsgraph
from .inspection_mark import is_inspection
from .modifier_nodes import ATTRIBUTE, NAME

_NAMED = 3
"""So many objects, or materials, are named in one line."""

Surface = tuple[bpy.types.Material, str, bool]
"""A material, the name of an object that shows it, and whether the light is stored there."""


def choose(
    context: bpy.types.Context, materials: Iterable[bpy.types.Material], image: bpy.types.Image
) -> tuple[frozenset[bpy.types.Material], tuple[Notice, ...]]:
    """Return those of some materials that can take a grid's light from the modifier, and why the others cannot.

    Raises
    ------
    SceneError
        The scene cannot be evaluated: a render is running.
    """
    shown: dict[bpy.types.Material, tuple[list[str], list[str]]] = {material: ([], []) for material in materials}
    for material, name, stored in _surfaces(context, image):
        if material in shown:
            shown[material][stored].append(name)
    chosen = set()
    nowhere, notices = [], []
    for material, (without, having) in shown.items():
        if having and not without:
            chosen.add(material)
        elif having:
            cure = f"add {NAME} there too, or let it have a copy of the material"
            told = f"looks the grid up: {listed(sorted(set(without)))} shows it without {NAME}; {cure}"
            notices.append(Notice("simplified", f"material '{material.name}'", told))
        else:
            nowhere.append(material.name)
    if nowhere:
        told = f"{listed(nowhere)}: the grid is looked up, for no object with the material has {NAME} of this grid"
        notices.append(Notice("simplified", f"grid '{image.name}'", told))
    return frozenset(chosen), tuple(notices)


def listed(names: Sequence[str]) -> str:
    """Return the first of some names, quoted."""
    return ", ".join(f"'{name}'" for name in names[:_NAMED]) + (", …" if len(names) > _NAMED else "")


def problems(objects: Iterable[bpy.types.Object], takes_stored: Callable[[bpy.types.Material], bool]) -> Iterator[str]:
    """Yield which objects lack the modifier that their materials take light from, for drawing."""
    for target in objects:
        if light_modifier.of(target) is None:
            theirs = (slot.material for slot in target.material_slots if slot.material)
            black = next((material for material in theirs if takes_stored(material)), None)
            if black is not None:
                told = f"takes its light from {NAME}, which '{target.name}' does not have: add that, or the light again"
                yield f"'{black.name}' {told}"


def _surfaces(context: bpy.types.Context, image: bpy.types.Image) -> list[Surface]:
    """Return what shows materials in renders of the file's scenes; of the others than this one by their modifiers."""

    def read(depsgraph: bpy.types.Depsgraph, _: object) -> list[Surface]:
        seen = set()
        found = []
        for instance in depsgraph.object_instances:
            shown = instance.object
            key = (shown.name_full, shown.data.as_pointer() if shown.data else 0)
            if key not in seen and not is_inspection(shown):
                seen.add(key)
                found += _of(shown, _is_stored(shown, image))
        return found

    scene = context.scene
    found = with_render_depsgraph(scene, context.view_layer, read)
    for other in bpy.data.objects:
        if not other.hide_render and set(other.users_scene) - {scene}:
            found += _of(other, light_modifier.stores(other, image))
    return found


def _of(shown: bpy.types.Object, stored: bool) -> list[Surface]:
    """Return the materials that an object, evaluated or not, shows."""
    slots = {slot.material for slot in shown.material_slots} | set(getattr(shown.data, "materials", ()))
    return [(material.original, shown.name, stored) for material in slots if material is not None]


def _is_stored(shown: bpy.types.Object, image: bpy.types.Image) -> bool:
    """Tell whether what an evaluated object shows has the light of a grid, by a modifier that was not applied."""
    if light_modifier.of(shown.original) is not None:
        return light_modifier.stores(shown.original, image)
    return ATTRIBUTE in getattr(shown.data, "attributes", ())
