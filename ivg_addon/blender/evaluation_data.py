# SPDX-License-Identifier: GPL-3.0-or-later
"""What networks of nodes read of meshes and objects, taken from the evaluated depsgraph."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.scene import Float32
from .export_needs import Needs

Colour = tuple[float, ...]
"""Red, green, blue and alpha."""

_MASK = 0xFFFFFFFF
_VALUE = {"FLOAT": 1, "INT": 1, "BOOLEAN": 1, "INT8": 1, "FLOAT2": 2, "FLOAT_VECTOR": 3}
_COLOURS = {"FLOAT_COLOR", "BYTE_COLOR"}


@dataclass
class SurfaceData:
    """What materials read of a mesh besides its shape.

    Parameters
    ----------
    attributes
        Values (nc, 4) float32 at the face corners by name, as colours: (x, y, z, 1) or (x, x, x, 1).
    uv_names
        Which of them are UV maps.
    uv, colour
        Those that are active for rendering, or None.
    generated : (nv, 3) float32
        Generated coordinates of the vertices, or None.
    """

    attributes: dict[str, Float32] = field(default_factory=dict)
    uv_names: set[str] = field(default_factory=set)
    uv: Float32 | None = None
    colour: Float32 | None = None
    generated: Float32 | None = None

    def read(self, mesh: bpy.types.Mesh, needs: Needs) -> None:
        """Read what is needed and was not read before."""
        for name in needs.attributes:
            if name not in self.attributes and name in mesh.attributes:
                values = _at_corners(mesh, mesh.attributes[name])
                if values is not None:
                    self.attributes[name] = values
                    if name in mesh.uv_layers:
                        self.uv_names.add(name)
        if needs.default_uv and self.uv is None:
            for layer in mesh.uv_layers:
                if layer.active_render:
                    self.uv = _at_corners(mesh, mesh.attributes[layer.name])
        if needs.default_colour and self.colour is None and mesh.color_attributes.render_color_index >= 0:
            self.colour = _at_corners(mesh, mesh.color_attributes[mesh.color_attributes.render_color_index])
        if needs.generated and self.generated is None:
            self.generated = _generated(mesh)


@dataclass(frozen=True)
class ObjectLook:
    """What materials read of an instance.

    Parameters
    ----------
    colour
        Object colour with alpha.
    index, random
        Pass index; random number in [0, 1].
    properties, instanced
        Properties, and attributes of the instance, by name.
    """

    colour: Colour = (1.0, 1.0, 1.0, 1.0)
    index: float = 0.0
    random: float = 0.0
    properties: dict[str, Colour] = field(default_factory=dict)
    instanced: dict[str, Colour] = field(default_factory=dict)


def object_look(
    instance: bpy.types.DepsgraphObjectInstance,
    needs: Needs,
    attribute: Callable[[bpy.types.DepsgraphObjectInstance, str], Colour],
) -> ObjectLook:
    """Return what materials read of an instance; `attribute` looks up its attributes by name."""
    shown = instance.object
    if instance.is_instance:
        number = instance.random_id & _MASK
    else:
        number = _hash(_hash_string(shown.name), 0)
    return ObjectLook(
        colour=tuple(shown.color),
        index=float(shown.pass_index),
        random=number / _MASK,
        properties={
            name: find_property((shown, shown.data), name) or (0.0, 0.0, 0.0, 0.0) for name in needs.properties
        },
        instanced={name: attribute(instance, name) for name in needs.instanced},
    )


def find_property(owners: tuple[bpy.types.bpy_struct | None, ...], name: str) -> Colour | None:
    """Return a property as Cycles' Attribute node finds it: a custom one, or a path from its owner; None without."""
    for owner in owners:
        if owner is None:
            continue
        for path in (f'["{bpy.utils.escape_identifier(name)}"]', name):
            try:
                value = owner.path_resolve(path)
            except ValueError:
                continue
            if isinstance(value, int | float):
                return (float(value),) * 3 + (1.0,)
            try:
                numbers = [float(number) for number in value][:4]
            except (TypeError, ValueError):
                continue
            red, green, blue, alpha = numbers + [0.0, 0.0, 0.0, 1.0][len(numbers) :]
            return red, green, blue, alpha
    return None


def attribute_values(attribute: bpy.types.Attribute) -> Float32 | None:
    """Return an attribute's values as colours, (n, 4), None where it has none."""
    count = len(attribute.data)
    values = np.ones((count, 4), dtype=np.float32)
    if attribute.data_type in _COLOURS:
        attribute.data.foreach_get("color", values.reshape(-1))
    elif attribute.data_type in _VALUE:
        width = _VALUE[attribute.data_type]
        kind = {"INT": np.int32, "INT8": np.int32, "BOOLEAN": np.bool_}.get(attribute.data_type, np.float32)
        raw: NDArray[Any] = np.empty((count, width), dtype=kind)
        attribute.data.foreach_get("vector" if width > 1 else "value", raw.reshape(-1))
        values[:, :3] = 0.0
        values[:, : 3 if width == 1 else width] = raw
    else:
        return None
    return values


def _at_corners(mesh: bpy.types.Mesh, attribute: bpy.types.Attribute) -> Float32 | None:
    """Return an attribute's values at the face corners, (nc, 4), None where it has none."""
    values = attribute_values(attribute)
    if values is None:
        return None
    corners = len(mesh.loops)
    if attribute.domain == "CORNER":
        return values
    if attribute.domain == "POINT":
        vertex = np.empty(corners, dtype=np.int32)
        mesh.attributes[".corner_vert"].data.foreach_get("value", vertex)
        return values[vertex]
    if attribute.domain == "FACE":
        sizes = np.empty(len(mesh.polygons), dtype=np.int32)
        mesh.polygons.foreach_get("loop_total", sizes)
        return np.repeat(values, sizes, axis=0)
    return None


def _generated(mesh: bpy.types.Mesh) -> Float32:
    """Return generated coordinates (nv, 3): undeformed positions in the texture space, 0 to 1."""
    positions = np.empty((len(mesh.vertices), 3), dtype=np.float32)
    mesh.vertices.foreach_get("undeformed_co", positions.reshape(-1))
    low = np.array(mesh.texspace_location, dtype=np.float32)
    size = np.array(mesh.texspace_size, dtype=np.float32)
    scale = np.where(size != 0.0, 0.5 / np.where(size != 0.0, size, 1.0), 0.0)
    return ((positions - low) * scale + 0.5).astype(np.float32)


def _hash_string(text: str) -> int:
    """Return the hash of a name from which Cycles makes an object's random number."""
    value = 0
    for byte in text.encode():
        value = (value * 37 + (byte - 256 if byte > 127 else byte)) & _MASK
    return value


def _hash(first: int, second: int) -> int:
    """Return Bob Jenkins' lookup3 hash of two words, as Cycles seeds it."""
    a = b = c = (0xDEADBEEF + (2 << 2) + 13) & _MASK
    a, b = (a + first) & _MASK, (b + second) & _MASK

    def rotated(value: int, by: int) -> int:
        return ((value << by) | (value >> (32 - by))) & _MASK

    c = ((c ^ b) - rotated(b, 14)) & _MASK
    a = ((a ^ c) - rotated(c, 11)) & _MASK
    b = ((b ^ a) - rotated(a, 25)) & _MASK
    c = ((c ^ b) - rotated(b, 16)) & _MASK
    a = ((a ^ c) - rotated(c, 4)) & _MASK
    b = ((b ^ a) - rotated(a, 14)) & _MASK
    return ((c ^ b) - rotated(b, 24)) & _MASK
