# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender data from plain values: meshes, materials, lights."""

from __future__ import annotations

import math
from collections.abc import Sequence

import bpy
import numpy as np
from mathutils import Vector

from .shapes import Point, Shape

Rgb = tuple[float, float, float]

SHARP = 40.0
WHITE_LIGHT: Rgb = (1.0, 1.0, 1.0)


def collection(name: str) -> bpy.types.Collection:
    """Return a new collection, linked to the current scene."""
    made = bpy.data.collections.new(name)
    bpy.context.scene.collection.children.link(made)
    return made


def mesh(name: str, shape: Shape, material: bpy.types.Material, *, smooth: bool = False) -> bpy.types.Mesh:
    """Return a mesh with one material; `smooth` shades all but edges beyond SHARP degrees smoothly."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(shape.vertices.tolist(), [], [list(face) for face in shape.faces])
    data.polygons.foreach_set("use_smooth", np.full(len(shape.faces), smooth))
    if shape.uv is not None:
        layer = data.uv_layers.new(name="UVMap")
        layer.uv.foreach_set("vector", np.array(shape.uv, dtype=np.float32).ravel())
    data.materials.append(material)
    data.validate()
    data.update()
    if smooth:
        data.set_sharp_from_angle(angle=math.radians(SHARP))
    return data


def add(
    group: bpy.types.Collection, name: str, data: bpy.types.ID, location: Sequence[float] = (0.0, 0.0, 0.0)
) -> bpy.types.Object:
    """Return a new object of a mesh, light or camera, in a collection."""
    made = bpy.data.objects.new(name, data)
    made.location = location
    group.objects.link(made)
    return made


def aim(thing: bpy.types.Object, target: Point) -> None:
    """Turn a light or a camera, which look along their own -z, to a point; x stays level."""
    direction = Vector(target) - thing.location
    thing.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()


def diffuse(name: str, colour: Rgb) -> bpy.types.Material:
    """Return a material of one Diffuse BSDF with a constant, scene-linear reflectance."""
    material, tree, output = _bare_material(name)
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*colour, 1.0)
    tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    material.diffuse_color = (*colour, 1.0)
    return material


def principled(
    name: str,
    colour: Rgb | None = None,
    *,
    image: bpy.types.Image | None = None,
    roughness: float = 0.5,
    specular: float = 0.5,
) -> bpy.types.Material:
    """Return a material of one Principled BSDF, its base colour a constant or an image by UV."""
    material, tree, output = _bare_material(name)
    shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
    shader.inputs["Roughness"].default_value = roughness
    shader.inputs["Specular IOR Level"].default_value = specular
    tree.links.new(shader.outputs["BSDF"], output.inputs["Surface"])
    if colour is not None:
        shader.inputs["Base Color"].default_value = (*colour, 1.0)
        material.diffuse_color = (*colour, 1.0)
    if image is not None:
        texture = tree.nodes.new("ShaderNodeTexImage")
        texture.image = image
        texture.location = (-320.0, 0.0)
        tree.links.new(texture.outputs["Color"], shader.inputs["Base Color"])
    return material


def _bare_material(
    name: str,
) -> tuple[bpy.types.Material, bpy.types.NodeTree, bpy.types.Node]:
    """Return a new material, its node tree and the one node in it, the output."""
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    tree.nodes.clear()
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    output.location = (320.0, 0.0)
    return material, tree, output


def area_light(
    group: bpy.types.Collection,
    name: str,
    location: Point,
    *,
    size: tuple[float, float],
    watts: float,
    colour: Rgb = WHITE_LIGHT,
) -> bpy.types.Object:
    """Return a rectangular area light that shines straight down."""
    light = bpy.data.lights.new(name, "AREA")
    light.shape = "RECTANGLE"
    light.size, light.size_y = size
    light.energy = watts
    light.color = colour
    return _add_visible(group, name, light, location)


def _add_visible(group: bpy.types.Collection, name: str, light: bpy.types.Light, location: Point) -> bpy.types.Object:
    """Add a lamp that can be seen: lights made by a script are hidden from the camera."""
    lamp = add(group, name, light, location)
    lamp.visible_camera = True
    return lamp


def point_light(
    group: bpy.types.Collection,
    name: str,
    location: Point,
    *,
    radius: float,
    watts: float,
    colour: Rgb = WHITE_LIGHT,
) -> bpy.types.Object:
    """Return a point light with a radius."""
    light = bpy.data.lights.new(name, "POINT")
    light.shadow_soft_size = radius
    light.energy = watts
    light.color = colour
    return _add_visible(group, name, light, location)


def spot_light(
    group: bpy.types.Collection,
    name: str,
    location: Point,
    target: Point,
    *,
    degrees: float,
    blend: float,
    watts: float,
    colour: Rgb = WHITE_LIGHT,
) -> bpy.types.Object:
    """Return a spot light aimed at a point, `degrees` wide, `blend` the soft share of its cone."""
    light = bpy.data.lights.new(name, "SPOT")
    light.spot_size = math.radians(degrees)
    light.spot_blend = blend
    light.shadow_soft_size = 0.04
    light.energy = watts
    light.color = colour
    spot = add(group, name, light, location)
    aim(spot, target)
    return spot
