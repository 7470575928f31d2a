# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes and their instances, out of the evaluated depsgraph.

Blender turns curves, text, surfaces and metaballs into meshes of their own while it evaluates, so
meshes are all that is read here. Values go in bulk from Blender's arrays into numpy's.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import bpy
import numpy as np
from numpy.typing import DTypeLike, NDArray

from ..core.instancing import LIGHT_PASSES, Instance, MeshData
from ..core.report import Notice, merge
from ..core.scene import Float32, Int32
from .export_materials import MaterialTable

_UNREAD = {
    "VOLUME": "volumes",
    "POINTCLOUD": "point clouds",
    "CURVES": "hair curves",
    "GREASEPENCIL": "Grease Pencil strokes",
    "GPENCIL": "Grease Pencil strokes",
}
"""Types of objects that a render may show, and that are not meshes."""


class GeometryReader:
    """Collects what an evaluated depsgraph shows, one object instance at a time.

    Parameters
    ----------
    materials
        Where materials are looked up; it tells which UV maps are needed.
    """

    def __init__(self, materials: MaterialTable) -> None:
        self.meshes: list[MeshData] = []
        self.instances: list[Instance] = []
        self.objects: list[str] = []
        self.diffuse_visible: list[bool] = []
        self._materials = materials
        self._notices: list[Notice] = []
        self._mesh_index: dict[int, int] = {}
        self._object_index: dict[tuple[str, bool], int] = {}

    @property
    def notices(self) -> tuple[Notice, ...]:
        """Return what was left out or simplified."""
        return merge(self._notices)

    def add(self, instance: bpy.types.DepsgraphObjectInstance) -> None:
        """Read one of `Depsgraph.object_instances`."""
        shown = instance.object
        owner = instance.instance_object if instance.is_instance else shown
        subject = f"object '{(owner or shown).name}'"
        if instance.show_particles:
            self._note_hair(shown, subject)
        if not instance.show_self:
            return
        if shown.type in _UNREAD:
            self._notices.append(Notice("left out", subject, f"{_UNREAD[shown.type]} are not baked"))
        if shown.type != "MESH":
            return
        seers = [shown, instance.parent] if instance.is_instance and instance.parent else [shown]
        if not _visible_at_all(seers):
            return
        with _mesh_of(shown) as mesh:
            if not len(mesh.polygons):
                return
            self._note_simplified(owner or shown, seers, subject)
            self._add_mesh(instance, seers, mesh, subject)

    def _add_mesh(
        self,
        instance: bpy.types.DepsgraphObjectInstance,
        seers: list[bpy.types.Object],
        mesh: bpy.types.Mesh,
        subject: str,
    ) -> None:
        shown = instance.object
        materials = [self._materials.index(slot.material) for slot in shown.material_slots]
        materials = materials or [self._materials.index(None)]
        if all(index == LIGHT_PASSES for index in materials):
            return
        uv_map = tuple(self._uv_name(mesh, self._materials.uv_map(index), subject) for index in materials)
        pointer = shown.data.as_pointer()
        if pointer not in self._mesh_index:
            self._mesh_index[pointer] = len(self.meshes)
            self.meshes.append(read_mesh(mesh))
        index = self._mesh_index[pointer]
        for name in uv_map:
            if name is not None and name not in self.meshes[index].uv_maps:
                self.meshes[index].uv_maps[name] = read_uv_map(mesh, name)
        self.instances.append(
            Instance(
                mesh=index,
                object=self._object(subject, all(seer.visible_diffuse for seer in seers)),
                matrix=np.array(instance.matrix_world, dtype=np.float64),
                materials=tuple(materials),
                uv_map=uv_map,
            )
        )

    def _uv_name(self, mesh: bpy.types.Mesh, wanted: str | None, subject: str) -> str | None:
        """Return the name of the UV map that is meant by a material's wish, None without."""
        if wanted is None:
            return None
        if wanted and wanted in mesh.uv_layers:
            return wanted
        if not wanted:
            for layer in mesh.uv_layers:
                if layer.active_render:
                    return str(layer.name)
        name = f"UV map '{wanted}'" if wanted else "UV map"
        self._notices.append(Notice("warning", subject, f"has no {name}: its texture's corner texel is taken"))
        return None

    def _object(self, subject: str, diffuse_visible: bool) -> int:
        key = (subject, diffuse_visible)
        if key not in self._object_index:
            self._object_index[key] = len(self.objects)
            self.objects.append(subject.removeprefix("object '").removesuffix("'"))
            self.diffuse_visible.append(diffuse_visible)
        return self._object_index[key]

    def _note_hair(self, shown: bpy.types.Object, subject: str) -> None:
        for system in shown.particle_systems:
            settings = system.settings
            if settings.type == "HAIR" and settings.render_type == "PATH":
                self._notices.append(Notice("left out", subject, f"hair '{system.name}' is not baked"))

    def _note_simplified(self, owner: bpy.types.Object, seers: list[bpy.types.Object], subject: str) -> None:
        if not all(seer.visible_shadow for seer in seers):
            self._notices.append(Notice("simplified", subject, "casts shadows although its shadow rays are off"))
        if any(seer.is_shadow_catcher for seer in seers):
            self._notices.append(Notice("simplified", subject, "shadow catcher taken as an ordinary surface"))
        for modifier in owner.modifiers:
            if modifier.type == "SUBSURF" and modifier.use_adaptive_subdivision and modifier.show_render:
                levels = modifier.render_levels
                self._notices.append(
                    Notice("simplified", subject, f"adaptive subdivision replaced by {levels} uniform levels")
                )


def _visible_at_all(seers: list[bpy.types.Object]) -> bool:
    """Tell whether any kind of ray sees an instance: both it and its instancer must be visible to it."""
    kinds = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")
    return any(all(getattr(seer, f"visible_{kind}") for seer in seers) for kind in kinds)


@contextmanager
def _mesh_of(shown: bpy.types.Object) -> Iterator[bpy.types.Mesh]:
    """Hand out an evaluated object's mesh, complete even where the viewport subdivides on the GPU."""
    try:
        yield shown.to_mesh()
    finally:
        shown.to_mesh_clear()


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
