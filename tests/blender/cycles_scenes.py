# SPDX-License-Identifier: GPL-3.0-or-later
"""Small scenes that Cycles renders, and what must be as it was after somebody else rendered them."""

from __future__ import annotations

import bpy

from .export_scenes import add_object, cube_mesh, empty_scene, new_material

Color = tuple[float, float, float]


def plain(name: str, color: Color, radiance: Color = (0.0, 0.0, 0.0)) -> bpy.types.Material:
    """Return a material that reflects diffusely and emits."""

    def build(tree: bpy.types.NodeTree, output: bpy.types.Node) -> None:
        reflect = tree.nodes.new("ShaderNodeBsdfDiffuse")
        reflect.inputs["Color"].default_value = (*color, 1.0)
        emit = tree.nodes.new("ShaderNodeEmission")
        emit.inputs["Color"].default_value = (*radiance, 1.0)
        add = tree.nodes.new("ShaderNodeAddShader")
        tree.links.new(reflect.outputs["BSDF"], add.inputs[0])
        tree.links.new(emit.outputs["Emission"], add.inputs[1])
        tree.links.new(add.outputs[0], output.inputs["Surface"])

    return new_material(name, build)


def furnace(color: Color, radiance: Color, size: float = 2.0) -> bpy.types.Scene:
    """Make a closed cube from the origin to (size, size, size) that reflects and emits the same all over."""
    scene = empty_scene()
    mesh = cube_mesh(size=size)
    mesh.materials.append(plain("Wall", color, radiance))
    add_object("Furnace", mesh)
    return scene


def lit_room() -> bpy.types.Scene:
    """Make a closed white room of 2 m with a coloured block, an area light under its ceiling and a camera in it."""
    scene = empty_scene()
    scene.name = "Room"
    walls = cube_mesh("Walls", size=2.0)
    walls.materials.append(plain("White", (0.7, 0.6, 0.5)))
    add_object("Walls", walls)
    block = cube_mesh("Block", size=0.6)
    block.materials.append(plain("Red", (0.8, 0.2, 0.1)))
    add_object("Block", block, location=(1.1, 1.2, 0.0), rotation_euler=(0.0, 0.0, 0.4))
    light = bpy.data.lights.new("Lamp", "AREA")
    light.shape, light.size, light.energy = "SQUARE", 0.6, 20.0
    add_object("Lamp", light, location=(1.0, 1.0, 1.95))
    camera = bpy.data.cameras.new("Camera")
    camera.lens = 20.0
    scene.camera = add_object("Camera", camera, location=(1.0, 0.02, 1.0), rotation_euler=(1.5708, 0.0, 0.0))
    scene.render.resolution_x, scene.render.resolution_y = 48, 32
    scene.cycles.samples = 8
    bpy.context.view_layer.update()
    return scene


def snapshot(scene: bpy.types.Scene) -> dict[str, object]:
    """Return everything of the file that a measurement might leave changed."""
    collections = {
        name: sorted(item.name for item in getattr(bpy.data, name))
        for name in dir(bpy.data)
        if isinstance(getattr(bpy.data, name), bpy.types.bpy_prop_collection)
    }
    layers = {layer.name: _values(layer) for layer in scene.view_layers}
    active = bpy.context.view_layer.objects.active
    return {
        **collections,
        "scene": (scene.name, scene.frame_current, scene.camera, scene.world, scene.rigidbody_world is None),
        "render": _values(scene.render),
        "image": _values(scene.render.image_settings),
        "bake": _values(scene.render.bake),
        "cycles": _values(scene.cycles),
        "layers": layers,
        "selected": sorted(item.name for item in scene.objects if item.select_get()),
        "active": active.name if active else None,
        "mode": bpy.context.mode,
        "context": (bpy.context.scene.name, bpy.context.view_layer.name),
        "camera": {item.name: (_values(item), _values(item.dof)) for item in bpy.data.cameras},
    }


def _values(owner: bpy.types.bpy_struct) -> dict[str, object]:
    """Return the plain values among the properties of something."""
    values = {}
    for item in owner.bl_rna.properties:
        if item.type in {"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"}:
            value = getattr(owner, item.identifier)
            values[item.identifier] = value if isinstance(value, str | set | int | float) else tuple(value)
    return values
