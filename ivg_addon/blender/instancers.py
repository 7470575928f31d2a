# SPDX-License-Identifier: GPL-3.0-or-later
"""What Attribute nodes of the type "Instancer" read: attributes of instances, and properties of what makes them.

Blender looks for them in the instances that geometry nodes made, the innermost first; then in the particle system's
settings; then in the instancing object and its data; at last in the object itself. Python sees no instance's row among
the attributes, but its identifiers from the outermost level on: the instances' "id", or without one their index.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy
import numpy as np

from ..core.report import Notice
from ..core.scene import Float32
from .evaluation_data import Colour, attribute_values, find_property

_UNUSED = 0x7FFFFFFF
"""Fills the identifiers up."""
_ABSENT: Colour = (0.0, 0.0, 0.0, 0.0)


class _Instances:
    """One level of instances.

    Parameters
    ----------
    geometry
        The set of geometry that has them; None where there is none.
    """

    def __init__(self, geometry: bpy.types.GeometrySet | None) -> None:
        self._geometry = geometry  # owns all that is read of it below
        cloud = None if geometry is None else geometry.instances_pointcloud()
        self._attributes = {} if cloud is None else {str(each.name): each for each in cloud.attributes}
        self._references = [] if geometry is None or cloud is None else geometry.instance_references()
        self._inner: dict[int, _Instances] = {}
        self._values: dict[str, Float32 | None] = {}
        identifier = self._attributes.get("id")
        self._index: dict[int, int] | None = None
        if identifier is not None:
            numbers = np.empty(len(identifier.data), dtype=np.int32)
            identifier.data.foreach_get("value", numbers)
            # Blender gives the first the identifier, and others that have it too another one.
            first, index = np.unique(numbers, return_index=True)
            self._index = dict(zip(first.tolist(), index.tolist(), strict=True))

    def __bool__(self) -> bool:
        """Tell whether there are any."""
        return bool(self._references)

    def row(self, identifier: int) -> int | None:
        """Return an instance's index, None where others have its identifier."""
        if self._index is not None:
            return self._index.get(identifier)
        return identifier if 0 <= identifier < len(self._attributes[".reference_index"].data) else None

    def value(self, name: str, row: int) -> Colour | None:
        """Return an attribute, None without."""
        if name not in self._values:
            attribute = self._attributes.get(name)
            self._values[name] = None if attribute is None else attribute_values(attribute)
        values = self._values[name]
        return None if values is None else tuple(values[row].tolist())

    def content(self, row: int) -> Any:
        """Return what stands there: a `GeometrySet`, an object or a collection."""
        return self._references[self._attributes[".reference_index"].data[row].value]

    def inner(self, row: int) -> _Instances:
        """Return the instances in an instance that is no collection."""
        number = self._attributes[".reference_index"].data[row].value
        if number not in self._inner:
            content = self._references[number]
            if isinstance(content, bpy.types.Object):
                content = _geometry_of(content)
            self._inner[number] = _Instances(content)
        return self._inner[number]


def _geometry_of(shown: bpy.types.Object) -> bpy.types.GeometrySet | None:
    """Return an evaluated object's geometry, None where its type has none."""
    try:
        return shown.evaluated_geometry()
    except TypeError:
        return None


class Instancers:
    """Looks up instances' attributes in one evaluated depsgraph; each object's are read once."""

    def __init__(self) -> None:
        self._known: dict[int, _Instances] = {}
        self.notices: list[Notice] = []

    def look_up(self, instance: bpy.types.DepsgraphObjectInstance, name: str) -> Colour:
        """Return an attribute of one of `Depsgraph.object_instances` as a colour, black and clear without."""
        for value in self._candidates(instance, name):
            if value is not None:
                return value
        return _ABSENT

    def _candidates(self, instance: bpy.types.DepsgraphObjectInstance, name: str) -> Iterator[Colour | None]:
        """Find values from the innermost on."""
        if instance.is_instance:
            parent = instance.parent
            yield from self._of_geometry(instance, parent, name)
            if instance.particle_system is not None:
                yield find_property((instance.particle_system.settings,), name)
            yield find_property((parent, parent.data), name)
        yield find_property((instance.object, instance.object.data), name)

    def _of_geometry(
        self, instance: bpy.types.DepsgraphObjectInstance, parent: bpy.types.Object, name: str
    ) -> list[Colour | None]:
        """Return what the levels of geometry nodes' instances say, from the innermost on."""
        identifiers = [number for number in reversed(instance.persistent_id) if number != _UNUSED]
        pointer = parent.as_pointer()
        if pointer not in self._known:
            self._known[pointer] = _Instances(_geometry_of(parent))
        level = self._known[pointer]
        if not level:
            self._note_if(len(identifiers) > 1, parent, name)
            return []
        found: list[Colour | None] = []
        while identifiers and level:
            row = level.row(identifiers.pop(0))
            if row is None:
                self._note_if(True, parent, name)
                break
            found.append(level.value(name, row))
            if isinstance(level.content(row), bpy.types.Collection):
                self._note_if(len(identifiers) > 1, parent, name)
                break
            level = level.inner(row)
        return found[::-1]

    def _note_if(self, lost: bool, parent: bpy.types.Object, name: str) -> None:
        """Say so where not all of an instance's levels can be told."""
        if lost:
            message = f"attribute '{name}' of instances with the same id, or nested in collections, may be missed"
            notice = Notice("simplified", f"object '{parent.name}'", message)
            if notice not in self.notices:
                self.notices.append(notice)
