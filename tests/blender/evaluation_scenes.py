# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials evaluated by the export, and the same asked of Cycles another way: baked to vertex colours, as they are."""

from __future__ import annotations

import bpy
import numpy as np
from numpy.typing import NDArray

from ivg_addon.blender.export import export_render_steps
from ivg_addon.core.progress import finish
from ivg_addon.core.scene import NO_TEXTURE, Scene
from tests.blender.export_scenes import Build, add_object, new_material
from tests.blender.export_trees import Maker, Tree

DATA = ("scenes", "meshes", "objects", "materials", "images", "node_groups", "cameras", "collections", "worlds")


_CELLS = 12
SPREAD = np.array(
    [
        (1 - (i + j + 2 * third) / _CELLS, (i + third) / _CELLS, (j + third) / _CELLS)
        for i in range(_CELLS)
        for j in range(_CELLS - i)
        for third in (1 / 3, 2 / 3)
        if i + j + 2 * third < _CELLS
    ]
)
"""Barycentric coordinates spread evenly over a triangle: the centroids of its 12² parts."""


WITHIN = 0.01
"""Largest difference of colours up to 1 that are linear on each triangle: on its long side a texel's samples are moved
onto the triangle, by up to half a texel; triangles have 2 × 2 texels, and a 40th of the colour's range."""
ON_AVERAGE = 0.002
"""The same of the mean over all triangles, relative to the brightest colour."""


def evaluated_scene() -> Scene:
    """Export the scene as a bake does."""
    return finish(export_render_steps(bpy.context.scene, bpy.context.view_layer))


def curved_grid(steps: int = 40) -> bpy.types.Mesh:
    """Return a smooth hill of quads, with a UV map, a colour attribute and a number at its vertices."""
    x, y = np.meshgrid(np.linspace(-1, 1, steps + 1), np.linspace(-1, 1, steps + 1))
    height = 0.4 * np.cos(1.5 * x) * np.cos(y)
    positions = np.stack([x, y, height], axis=-1).reshape(-1, 3)
    first = (np.arange(steps)[:, None] * (steps + 1) + np.arange(steps)).reshape(-1)
    faces = first[:, None] + np.array([0, 1, steps + 2, steps + 1])
    mesh = bpy.data.meshes.new("Hill")
    mesh.from_pydata(positions.tolist(), [], faces.tolist())
    corners = positions[faces.reshape(-1)]
    mesh.uv_layers.new(name="First").uv.foreach_set("vector", (corners[:, :2] * 0.5 + 0.5).astype(np.float32).ravel())
    turned = np.stack([corners[:, 1], -corners[:, 0]], axis=1) * 0.3
    mesh.uv_layers.new(name="Second").uv.foreach_set("vector", turned.astype(np.float32).ravel())
    colours = np.concatenate([positions * 0.3 + 0.5, np.full((len(positions), 1), 0.5)], axis=1)
    painted = mesh.color_attributes.new("Painted", "FLOAT_COLOR", "POINT")
    painted.data.foreach_set("color", colours.astype(np.float32).ravel())
    number = mesh.attributes.new("Number", "FLOAT", "POINT")
    number.data.foreach_set("value", np.abs(positions[:, 0]).astype(np.float32))
    mesh.shade_smooth()
    mesh.update()
    return mesh


def cycles_at_corners(target: bpy.types.Object, kind: str) -> NDArray[np.float32]:
    """Return what Cycles bakes at each face corner, (corners, 3): "DIFFUSE" colour, "EMIT", or "ROUGHNESS"."""
    mesh = target.data
    mesh.color_attributes.new("baked", "FLOAT_COLOR", "CORNER")
    mesh.color_attributes.active_color = mesh.color_attributes["baked"]
    for shown in bpy.context.view_layer.objects:
        shown.select_set(False)
    target.select_set(True)
    bpy.context.view_layer.objects.active = target
    bpy.ops.object.bake(type=kind, pass_filter={"COLOR"}, target="VERTEX_COLORS")
    colours = np.empty((len(mesh.loops), 4), dtype=np.float32)
    mesh.color_attributes["baked"].data.foreach_get("color", colours.reshape(-1))
    mesh.color_attributes.remove(mesh.color_attributes["baked"])
    return colours[:, :3]


def cycles_at_triangles(target: bpy.types.Object, kind: str) -> NDArray[np.float64]:
    """Return what Cycles bakes at the corners of each triangle, (triangles, corner, 3)."""
    at_corners = cycles_at_corners(target, kind)
    mesh = target.data
    mesh.calc_loop_triangles()
    corners = np.empty((len(mesh.loop_triangles), 3), dtype=np.int32)
    mesh.loop_triangles.foreach_get("loops", corners.reshape(-1))
    return at_corners[corners].astype(np.float64)


def cycles_on_triangles(target: bpy.types.Object, kind: str) -> NDArray[np.float64]:
    """Return the mean of what Cycles bakes at the corners of each triangle, (triangles, 3)."""
    return cycles_at_triangles(target, kind).mean(axis=1)


def check(scene: Scene, shown: bpy.types.Object, quantity: str, kind: str) -> float:
    """Hold what an object was exported with against Cycles; return the largest relative difference.

    The mean over a triangle of what lies between the values at its corners differs from their mean by at most two
    thirds of their range. Smooth noise curves within a triangle by less than `WITHIN` (half as long edges: a quarter).
    """
    here = scene.geometry.object == scene.objects.index(shown.name)
    corners = cycles_at_triangles(shown, kind)
    truth, brightest = corners.mean(axis=1), corners.max()
    difference = np.abs(exported(scene, quantity, here) - truth)
    assert (difference <= 2 / 3 * np.ptp(corners, axis=1) + WITHIN * brightest).all()
    assert np.abs((exported(scene, quantity, here) - truth).mean(axis=0)).max() < ON_AVERAGE * brightest
    return float(difference.max() / brightest)


def exported(scene: Scene, quantity: str, chosen: NDArray[np.bool_] | None = None) -> NDArray[np.float64]:
    """Return the mean "albedo" or "emission" over each exported triangle, (triangles, 3)."""
    geometry, materials = scene.geometry, scene.materials
    constant = getattr(materials, quantity)
    texture = materials.texture if quantity == "albedo" else materials.emission_texture
    assert texture is not None
    values = constant[geometry.material].astype(np.float64)
    for index in np.flatnonzero(texture != NO_TEXTURE):
        here = geometry.material == index
        values[here] *= texture_means(scene, int(texture[index]), geometry.uvs[here].astype(np.float64))
    return values if chosen is None else values[chosen]


def texture_means(scene: Scene, texture: int, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean of an atlas over triangles with texture coordinates (n, 3, 2)."""
    return np.mean([looked_up(scene, texture, np.einsum("c,ncx->nx", point, corners)) for point in SPREAD], axis=0)


def looked_up(scene: Scene, texture: int, uv: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return an atlas' texels at texture coordinates (n, 2)."""
    image = scene.textures[texture]
    assert not image.interpolate
    assert not image.encoded
    height, width = image.pixels.shape[:2]
    column, row = np.floor(uv * (width, height)).astype(int).T
    return image.pixels[row, column].astype(np.float64)


def datablocks() -> dict[str, list[str]]:
    """Return the names of all that is in the file."""
    return {kind: sorted(item.name_full for item in getattr(bpy.data, kind)) for kind in DATA}


def node_output(kind: str, output: str, **values: object) -> Maker:
    def make(tree: Tree) -> bpy.types.NodeSocket:
        node = tree.nodes.new(f"ShaderNode{kind}")
        for key, value in values.items():
            setattr(node, key, value)
        return node.outputs[output]

    return make


def through(kind: str, to: str | int, source: Maker, output: str | int = 0, **values: object) -> Maker:
    def make(tree: Tree) -> bpy.types.NodeSocket:
        node = tree.nodes.new(f"ShaderNode{kind}")
        for key, value in values.items():
            if key in node.inputs:
                node.inputs[key].default_value = value
            else:
                setattr(node, key, value)
        tree.links.new(source(tree), node.inputs[to])
        return node.outputs[output]

    return make


def soft_image(connect: Maker | None = None) -> Maker:
    """Return a maker of an Image Texture node whose image varies slowly."""

    def make(tree: Tree) -> bpy.types.NodeSocket:
        image = bpy.data.images.new("Soft", 64, 64, float_buffer=True)
        wave = 0.5 + 0.4 * np.sin(2 * np.pi * np.arange(64) / 64)
        pixels = np.ones((64, 64, 4), dtype=np.float32)
        pixels[..., 0], pixels[..., 1] = wave[:, None], wave[None, :]
        image.pixels.foreach_set(pixels.ravel())
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image = image
        if connect is not None:
            tree.links.new(connect(tree), node.inputs["Vector"])
        return node.outputs["Color"]

    return make


def noise(source: str | Maker = "Generated", scale: float = 1.5) -> Maker:
    """Return a maker of coloured noise that varies slowly."""
    coordinates = node_output("TexCoord", source) if isinstance(source, str) else source
    return through("TexNoise", "Vector", coordinates, "Color", Scale=scale, Detail=0.0)


def hills(material: bpy.types.Material, mirrored: bool = True) -> list[bpy.types.Object]:
    """Add two objects of one mesh, turned and scaled, the second one mirrored too."""
    mesh = curved_grid()
    mesh.materials.append(material)
    made = [
        add_object("One", mesh, location=(1, 2, 3), rotation_euler=(0.3, 0.5, 0.7), scale=(1, 0.7, 1.3)),
        add_object("Two", mesh, location=(-2, 1, 0), rotation_euler=(1, 0.2, 2), scale=(-1 if mirrored else 1, 1, 0.5)),
    ]
    made[0].color, made[1].color = (0.2, 0.3, 0.4, 0.5), (0.9, 0.1, 0.6, 0.8)
    made[0]["tint"], made[1]["tint"] = (0.1, 0.2, 0.3), (0.7, 0.6, 0.5)
    return made


def cycles_on_triangles_of(build: Build, shown: bpy.types.Object, kind: str) -> NDArray[np.float64]:
    """Return what Cycles bakes of another material on an object's triangles, (triangles, 3)."""
    before = shown.data.materials[0]
    shown.data.materials[0] = new_material("Other", build)
    truth = cycles_on_triangles(shown, kind)
    shown.data.materials[0] = before
    return truth


def exported_texture(scene: Scene, texture: int, name: str) -> NDArray[np.float64]:
    """Return the mean of an atlas over each of an object's triangles, (triangles, 3)."""
    here = scene.geometry.object == scene.objects.index(name)
    return texture_means(scene, int(texture), scene.geometry.uvs[here].astype(np.float64))
