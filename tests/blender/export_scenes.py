# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes for the tests of the export, and what Cycles makes of them."""

from __future__ import annotations

from collections.abc import Callable

import bpy
import numpy as np
from numpy.typing import NDArray

from ivg_addon.blender.export import export_scene
from ivg_addon.core.compiled import kernel
from ivg_addon.core.scene import Geometry, Scene
from ivg_addon.core.textures import pack_textures, surface_albedo

Build = Callable[[bpy.types.NodeTree, bpy.types.Node], None]


def empty_scene() -> bpy.types.Scene:
    """Start from nothing, with Cycles as the engine and one sample."""
    bpy.ops.wm.read_homefile(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 1
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    return scene


def add_object(name: str, data: bpy.types.ID | None, **values: object) -> bpy.types.Object:
    made = bpy.data.objects.new(name, data)
    for key, value in values.items():
        setattr(made, key, value)
    bpy.context.scene.collection.objects.link(made)
    return made


def cube_mesh(name: str = "Cube", size: float = 1.0) -> bpy.types.Mesh:
    corners = [(x, y, z) for x in (0, size) for y in (0, size) for z in (0, size)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(corners, [], faces)
    return mesh


def point_cloud(centers: NDArray[np.float64], radii: NDArray[np.float64] | None = None) -> bpy.types.Object:
    """Add a point cloud, made from the vertices of a mesh: Blender 5.0 has no other way for scripts."""
    mesh = bpy.data.meshes.new("Cloud")
    mesh.from_pydata(np.asarray(centers).tolist(), [], [])
    made = add_object("Cloud", mesh)
    bpy.ops.object.select_all(action="DESELECT")
    made.select_set(True)
    bpy.context.view_layer.objects.active = made
    bpy.ops.object.convert(target="POINTCLOUD")
    if radii is not None:
        attribute = made.data.attributes.get("radius") or made.data.attributes.new("radius", "FLOAT", "POINT")
        attribute.data.foreach_set("value", np.asarray(radii, dtype=np.float32))
    return made


def quads_with_uvs(uvs: NDArray[np.float64], name: str = "UVMap") -> bpy.types.Mesh:
    """Return a mesh of separate quads, each with one texture coordinate at all its corners."""
    n = len(uvs)
    positions = np.zeros((n, 4, 3))
    positions[:, :, 0] = 2 * np.arange(n)[:, None] + np.array([0, 1, 1, 0])
    positions[:, :, 1] = [0, 0, 1, 1]
    mesh = bpy.data.meshes.new("Quads")
    mesh.from_pydata(positions.reshape(-1, 3).tolist(), [], np.arange(4 * n).reshape(n, 4).tolist())
    layer = mesh.uv_layers.new(name=name)
    layer.uv.foreach_set("vector", np.repeat(uvs, 4, axis=0).astype(np.float32).ravel())
    return mesh


def new_material(name: str, build: Build) -> bpy.types.Material:
    """Return a material whose tree is emptied, given a material output, and handed to `build`."""
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    tree.nodes.clear()
    build(tree, tree.nodes.new("ShaderNodeOutputMaterial"))
    return material


def diffuse_of(colour: Callable[[bpy.types.NodeTree], bpy.types.NodeSocket]) -> Build:
    """Return a builder of a Diffuse BSDF with the colour that `colour` makes in the tree."""

    def build(tree: bpy.types.NodeTree, output: bpy.types.Node) -> None:
        shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
        tree.links.new(colour(tree), shader.inputs["Color"])
        tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])

    return build


def viewport_scene() -> Scene:
    return export_scene(bpy.context.evaluated_depsgraph_get())


def bake_diffuse_colour(target: bpy.types.Object) -> NDArray[np.float32]:
    """Return Cycles' diffuse colour at each face corner, (corners, 3)."""
    mesh = target.data
    attribute = mesh.color_attributes.new("baked", "FLOAT_COLOR", "CORNER")
    mesh.color_attributes.active_color = attribute
    bpy.context.view_layer.update()
    target.select_set(True)
    bpy.context.view_layer.objects.active = target
    bpy.ops.object.bake(type="DIFFUSE", pass_filter={"COLOR"}, target="VERTEX_COLORS")
    colours = np.empty((len(mesh.loops), 4), dtype=np.float32)
    mesh.color_attributes["baked"].data.foreach_get("color", colours.reshape(-1))
    return colours[:, :3]


@kernel
def _albedo(materials, uv, albedo, texture, pool):
    out = np.empty((len(uv), 3))
    for i in range(len(uv)):
        out[i, 0], out[i, 1], out[i, 2] = surface_albedo(materials[i], uv[i, 0], uv[i, 1], albedo, texture, pool)
    return out


def exported_albedo(scene: Scene) -> NDArray[np.float64]:
    """Return the diffuse reflectance at the first corner of each exported triangle, (triangles, 3)."""
    geometry, materials = scene.geometry, scene.materials
    pool = pack_textures(scene.textures)
    return _albedo(geometry.material, geometry.uvs[:, 0], materials.albedo, materials.texture, pool)


def area_vectors(geometry: Geometry) -> NDArray[np.float64]:
    """Return each triangle's area times its unit normal, (triangles, 3)."""
    p = geometry.vertices[geometry.triangles].astype(np.float64)
    return np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) / 2


def volume(geometry: Geometry) -> float:
    """Return the volume that closed surfaces enclose; negative where they are inside out."""
    corners = geometry.vertices[geometry.triangles].astype(np.float64)
    return float(np.einsum("ij,ij->", corners[:, 0], area_vectors(geometry)) / 3)
