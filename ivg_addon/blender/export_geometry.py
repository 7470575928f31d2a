# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces and their instances, out of the evaluated depsgraph.

Blender turns curves, text, surfaces and metaballs into meshes of their own while it evaluates. Hair
and point clouds are made into triangles here. Values go in bulk from Blender's arrays into numpy's.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import bpy
import numpy as np

from ..core.instancing import LIGHT_PASSES, Instances, MeshData
from ..core.report import Notice, merge
from ..core.scene import Float32
from ..core.spheres import sphere_cloud
from ..core.strands import Strands, strand_tubes
from .evaluation_data import ObjectLook, SurfaceData, object_look
from .export_materials import MaterialTable
from .export_mesh import read_mesh, read_uv_map
from .export_needs import Needs
from .export_strands import hair_systems, read_curves, read_hair, read_points
from .instancers import Instancers

_UNREAD = {
    "VOLUME": "volumes are not baked",
    "GREASEPENCIL": "Grease Pencil strokes are not baked: Cycles does not render them either",
}
"""What is said of types of objects that are left out."""
_EVEN = 0.999
"""Smallest scale over the largest, from which on scale counts as even."""


@dataclass(frozen=True)
class _Places:
    """Where a mesh stands: rows that grow, for a scene may have a million."""

    mesh: int
    materials: tuple[int, ...]
    uv_map: tuple[str | None, ...]
    objects: array[int] = field(default_factory=lambda: array("i"))
    matrices: array[float] = field(default_factory=lambda: array("f"))
    needs: Needs | None = None
    looks: list[ObjectLook] = field(default_factory=list)

    def instances(self) -> Instances:
        """Return them as arrays."""
        return Instances(
            mesh=self.mesh,
            objects=np.array(self.objects, dtype=np.int32),
            matrices=np.array(self.matrices, dtype=np.float32).reshape(-1, 4, 4),
            materials=self.materials,
            uv_map=self.uv_map,
        )


@dataclass(frozen=True)
class _Part:
    """What an object consists of: a mesh that stands in it once, or in each of several places."""

    places: _Places
    object: int
    inside: Float32 | None = None

    def add(self, instance: bpy.types.DepsgraphObjectInstance, instancers: Instancers) -> None:
        """Add an instance of the object."""
        if self.places.needs is not None:
            look = object_look(instance, self.places.needs, instancers.look_up)
            self.places.looks.extend([look] * (1 if self.inside is None else len(self.inside)))
        if self.inside is None:
            self.places.objects.append(self.object)
            for row in instance.matrix_world:
                self.places.matrices.extend(row)
        else:
            placed = np.array(instance.matrix_world, dtype=np.float64) @ self.inside
            self.places.objects.extend([self.object] * len(placed))
            self.places.matrices.frombytes(placed.astype(np.float32).tobytes())


class GeometryReader:
    """Collects what an evaluated depsgraph shows, one object instance at a time.

    Parameters
    ----------
    materials
        Where materials are looked up; it tells which UV maps are needed.
    depsgraph
        Whose instances are added.
    """

    def __init__(self, materials: MaterialTable, depsgraph: bpy.types.Depsgraph) -> None:
        self.meshes: list[MeshData] = []
        self.objects: list[str] = []
        self.diffuse_visible: list[bool] = []
        self.shadow_visible: list[bool] = []
        self.data: dict[int, SurfaceData] = {}
        self._materials = materials
        self._rendered = depsgraph.mode == "RENDER"
        self._shows_hair = depsgraph.view_layer_eval.use_strand
        curves = getattr(depsgraph.scene_eval, "cycles_curves", None)  # absent where Cycles is disabled
        shape = getattr(curves, "shape", "RIBBONS")
        self._straight_hair, self._flat_hair = shape == "THICK_LINEAR", shape == "RIBBONS"
        self._notices: list[Notice] = []
        self._instancers = Instancers()
        self._parts: dict[tuple[object, ...], list[_Part]] = {}
        self._places: dict[tuple[object, ...], _Places] = {}
        self._mesh_index: dict[object, int] = {}
        self._object_index: dict[tuple[object, ...], int] = {}

    @property
    def instances(self) -> list[Instances]:
        """Return where all meshes stand."""
        return [places.instances() for places in self._places.values()]

    @property
    def looks(self) -> list[list[ObjectLook]]:
        """Return what each place of `instances` looks like; nothing where no material asks."""
        return [places.looks for places in self._places.values()]

    @property
    def notices(self) -> tuple[Notice, ...]:
        """Return what was left out or simplified."""
        return merge((*self._notices, *self._instancers.notices))

    def add(self, instance: bpy.types.DepsgraphObjectInstance) -> None:
        """Read one of `Depsgraph.object_instances`."""
        shown = instance.object
        data = shown.data
        if data is None:
            return
        parent = instance.parent if instance.is_instance else None
        # Of many instances that are alike in this, the first tells what all are.
        key = (
            shown.original.as_pointer(),
            data.as_pointer(),
            parent.as_pointer() if parent else 0,
            instance.show_self,
            instance.show_particles,
        )
        if key not in self._parts:
            owner = (instance.instance_object if instance.is_instance else shown) or shown
            self._parts[key] = self._read(instance, shown, owner, [shown, parent] if parent else [shown])
        for part in self._parts[key]:
            part.add(instance, self._instancers)

    def _read(
        self,
        instance: bpy.types.DepsgraphObjectInstance,
        shown: bpy.types.Object,
        owner: bpy.types.Object,
        seers: list[bpy.types.Object],
    ) -> list[_Part]:
        """Return what an object consists of, unless no ray sees it."""
        subject = f"object '{owner.name}'"
        if not _visible_at_all(seers):
            return []
        parts = []
        if instance.show_particles and self._shows_hair and shown.type == "MESH":
            parts += self._particle_hair(shown, seers, subject)
        if instance.show_self:
            if shown.type in _UNREAD:
                self._notices.append(Notice("left out", subject, _UNREAD[shown.type]))
            elif shown.type == "MESH":
                parts += self._mesh(shown, seers, subject)
            elif shown.type == "CURVES" and self._shows_hair:
                parts += self._curves(shown, seers, subject)
            elif shown.type == "POINTCLOUD":
                parts += self._points(shown, seers, subject)
        if parts:
            self._note_simplified(owner, seers, subject)
        return parts

    def _mesh(self, shown: bpy.types.Object, seers: list[bpy.types.Object], subject: str) -> list[_Part]:
        """Read a mesh."""
        with _mesh_of(shown) as mesh:
            materials = self._slot_materials(shown)
            if not len(mesh.polygons) or all(index == LIGHT_PASSES for index in materials):
                return []
            uv_map = tuple(self._uv_name(mesh, self._materials.uv_map(index), subject) for index in materials)
            pointer = shown.data.as_pointer()
            if pointer not in self._mesh_index:
                self._keep(pointer, read_mesh(mesh))
            index = self._mesh_index[pointer]
            for name in uv_map:
                if name is not None and name not in self.meshes[index].uv_maps:
                    self.meshes[index].uv_maps[name] = read_uv_map(mesh, name)
            for needs in self._needs(materials):
                self.data.setdefault(index, SurfaceData()).read(mesh, needs)
        return self._parts_by_shadow(index, materials, uv_map, subject, seers)

    def _parts_by_shadow(
        self,
        mesh: int,
        materials: tuple[int, ...],
        uv_map: tuple[str | None, ...],
        subject: str,
        seers: list[bpy.types.Object],
    ) -> list[_Part]:
        """Return a mesh as one part or two: that with materials that cast shadows, and that with those that do not."""
        parts = []
        for casts in (True, False):
            own = tuple(i if self._materials.casts_shadow(i) == casts else LIGHT_PASSES for i in materials)
            if any(i != LIGHT_PASSES for i in own):
                parts.append(_Part(self._places_of(mesh, own, uv_map), self._object(subject, seers, casts)))
        return parts

    def _curves(self, shown: bpy.types.Object, seers: list[bpy.types.Object], subject: str) -> list[_Part]:
        """Read hair curves: as in Cycles, all of the first material."""
        material = self._slot_materials(shown)[0]
        if material == LIGHT_PASSES:
            return []
        pointer = shown.data.as_pointer()
        wanted = self._hair_uv(material)
        if pointer not in self._mesh_index:
            strands = read_curves(shown.data, self._straight_hair)
            self._keep_tubes(pointer, strands, len(strands), subject)
        index = self._mesh_index[pointer]
        if not len(self.meshes[index].triangle_corners):
            return []
        uv_map: str | None = None
        if wanted is not None:
            uv_map = wanted or next(iter(self.meshes[index].uv_maps), None)
        self._lend_uv(index, uv_map)
        return self._parts_by_shadow(index, (material,), (uv_map,), subject, seers)

    def _particle_hair(self, shown: bpy.types.Object, seers: list[bpy.types.Object], subject: str) -> list[_Part]:
        """Read the strands of an object's particle systems."""
        parts = []
        materials = self._slot_materials(shown)
        for modifier, system in hair_systems(shown, self._rendered):
            material = materials[min(max(system.settings.material - 1, 0), len(materials) - 1)]
            if material == LIGHT_PASSES:
                continue
            uv_name = self._uv_name(shown.data, self._hair_uv(material), subject)
            key = (shown.original.as_pointer(), str(system.name), uv_name)
            if key not in self._mesh_index:
                names = () if uv_name is None else (uv_name,)
                strands, count = read_hair(shown, modifier, self._rendered, self._straight_hair, names)
                self._keep_tubes(key, strands, count, subject)
            index = self._mesh_index[key]
            self._lend_uv(index, uv_name)
            if len(self.meshes[index].triangle_corners):
                parts += self._parts_by_shadow(index, (material,), (uv_name,), subject, seers)
        return parts

    def _hair_uv(self, material: int) -> str | None:
        """Return the UV map that hair of a material needs, "" for the active one."""
        reads_uv = any(needs.default_uv for needs in self._needs((material,)))
        return "" if reads_uv else self._materials.uv_map(material)

    def _lend_uv(self, mesh: int, name: str | None) -> None:
        """Let materials that are evaluated read the UV map of hair."""
        uv_map = None if name is None else self.meshes[mesh].uv_maps.get(name)
        if uv_map is not None:
            self.data.setdefault(mesh, SurfaceData()).uv = uv_map

    def _points(self, shown: bpy.types.Object, seers: list[bpy.types.Object], subject: str) -> list[_Part]:
        """Read a point cloud: as in Cycles, all of the first material and without texture coordinates."""
        material = self._slot_materials(shown)[0]
        if material == LIGHT_PASSES:
            return []
        cloud = sphere_cloud(*read_points(shown.data))
        if cloud.thinned:
            self._note_thinned(subject, "points", len(cloud.matrices), cloud.points)
        if not cloud.points:
            return []
        scale = np.linalg.svd(np.array(shown.matrix_world, dtype=np.float64)[:3, :3], compute_uv=False)
        if scale[-1] < _EVEN * scale[0]:
            self._notices.append(
                Notice("simplified", subject, "points of uneven scale shaded as ellipsoids, by Cycles as spheres")
            )
        key = ("sphere", len(cloud.mesh.triangle_corners))
        if key not in self._mesh_index:
            self._keep(key, cloud.mesh)
        places = self._places_of(self._mesh_index[key], (material,), (None,))
        casts = self._materials.casts_shadow(material)
        return [_Part(places, self._object(subject, seers, casts), cloud.matrices)]

    def _needs(self, materials: tuple[int, ...]) -> list[Needs]:
        """Return what those of some materials need that are still to be evaluated."""
        unevaluated = self._materials.unevaluated
        return [unevaluated[index].tree.needs for index in dict.fromkeys(materials) if index in unevaluated]

    def _slot_materials(self, shown: bpy.types.Object) -> tuple[int, ...]:
        """Return the materials of an object's slots, at least one."""
        materials = tuple(self._materials.index(slot.material) for slot in shown.material_slots)
        return materials or (self._materials.index(None),)

    def _keep(self, key: object, mesh: MeshData) -> None:
        self._mesh_index[key] = len(self.meshes)
        self.meshes.append(mesh)

    def _keep_tubes(self, key: object, strands: Strands, count: int, subject: str) -> None:
        """Make tubes of some or all of `count` strands."""
        tubes = strand_tubes(replace(strands, round_ends=self._straight_hair))
        self._keep(key, replace(tubes.mesh, ribbons=self._flat_hair))
        if tubes.thinned or len(strands) < count:
            self._note_thinned(subject, "hairs", tubes.shown, count)

    def _note_thinned(self, subject: str, what: str, shown: int, count: int) -> None:
        self._notices.append(
            Notice(
                "simplified",
                subject,
                f"{shown:,} of {count:,} {what} taken and made larger to cover as much: more need too much memory",
            )
        )

    def _places_of(self, mesh: int, materials: tuple[int, ...], uv_map: tuple[str | None, ...]) -> _Places:
        key = (mesh, materials, uv_map)
        if key not in self._places:
            placed = Needs()
            for needs in self._needs(materials):
                placed.update(needs)
            self._places[key] = _Places(mesh, materials, uv_map, needs=placed if placed.placed else None)
        return self._places[key]

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

    def _object(self, subject: str, seers: list[bpy.types.Object], casts: bool) -> int:
        diffuse, shadow = _visible_to(seers, "diffuse"), casts and _visible_to(seers, "shadow")
        key = (subject, diffuse, shadow)
        if key not in self._object_index:
            self._object_index[key] = len(self.objects)
            self.objects.append(subject.removeprefix("object '").removesuffix("'"))
            self.diffuse_visible.append(diffuse)
            self.shadow_visible.append(shadow)
        return self._object_index[key]

    def _note_simplified(self, owner: bpy.types.Object, seers: list[bpy.types.Object], subject: str) -> None:
        diffuse = _visible_to(seers, "diffuse")
        if not diffuse == _visible_to(seers, "glossy") == _visible_to(seers, "transmission"):
            message = "to glossy and transmission rays as visible as to diffuse rays"
            self._notices.append(Notice("simplified", subject, message))
        for modifier in owner.modifiers:
            if modifier.type == "SUBSURF" and modifier.use_adaptive_subdivision and modifier.show_render:
                levels = modifier.render_levels
                self._notices.append(
                    Notice("simplified", subject, f"adaptive subdivision replaced by {levels} uniform levels")
                )


def _visible_to(seers: list[bpy.types.Object], rays: str) -> bool:
    """Tell whether a kind of rays sees an instance: both it and its instancer must be visible to it."""
    return all(getattr(seer, f"visible_{rays}") for seer in seers)


def _visible_at_all(seers: list[bpy.types.Object]) -> bool:
    """Tell whether any kind of rays sees an instance."""
    kinds = ("camera", "diffuse", "glossy", "transmission", "volume_scatter", "shadow")
    return any(_visible_to(seers, kind) for kind in kinds)


@contextmanager
def _mesh_of(shown: bpy.types.Object) -> Iterator[bpy.types.Mesh]:
    """Hand out an evaluated object's mesh, complete even where the viewport subdivides on the GPU."""
    try:
        yield shown.to_mesh()
    finally:
        shown.to_mesh_clear()
