# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes, out of Blender's arrays into numpy's."""

from __future__ import annotations

from typing import Any

import bpy
import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..core.instancing import MeshData
from ..core.scene import Float32, Int32


def read_mesh(mesh: bpy.types.Mesh) -> MeshData:
    """Return a mesh's triangles and normals; UV maps are read when a material asks for them."""
    mesh.calc_loop_triangles()
    triangles, corners = len(mesh.loop_triangles), len(mesh.loops)
    # A mesh that is only partly flat has corner normals that say so.
    smooth = mesh.normals_domain != "FACE"
    slot: Int32 | None = None
    slots = mesh.attributes.get("material_index")
    if slots is not None:
        face = _values(mesh.loop_triangle_polygons, "value", (triangles,), np.int32)
        slot = _values(slots.data, "value", (len(mesh.polygons),), np.int32)[face]
    return MeshData(
        positions=_values(mesh.attributes["position"].data, "vector", (len(mesh.vertices), 3), np.float32),
        corner_vertex=_values(mesh.attributes[".corner_vert"].data, "value", (corners,), np.int32),
        triangle_corners=_values(mesh.loop_triangles, "loops", (triangles, 3), np.int32),
        corner_normals=_values(mesh.corner_normals, "vector", (corners, 3), np.float32) if smooth else None,
        slot=slot,
    )


def read_uv_map(mesh: bpy.types.Mesh, name: str) -> Float32:
    """Return a UV map's coordinates at the face corners, (nc, 2)."""
    return _values(mesh.uv_layers[name].uv, "vector", (len(mesh.loops), 2), np.float32)


def _values(
    collection: bpy.types.bpy_prop_collection, attribute: str, shape: tuple[int, ...], dtype: DTypeLike
) -> NDArray[Any]:
    """Copy one attribute of all items of a collection."""
    values = np.empty(shape, dtype=dtype)
    collection.foreach_get(attribute, values.reshape(-1))
    return values
