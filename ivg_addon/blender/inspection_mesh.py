# SPDX-License-Identifier: GPL-3.0-or-later
"""A grid as an object of the scene that shows it: spheres, arrows or a slice, for renders and figures.

Its light is a float colour attribute and its material emits it, so it shows in Cycles, EEVEE and the viewport, also
where this extension is not installed. Cameras see it and nothing else does: it lights nothing, shades nothing, and is
no part of the scene for a bake (inspection_mark.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.errors import GridFileError
from ..core.settings import Spatial
from . import storage
from .grid_image import scene_grid
from .grid_store import compiled_code_folder, keep_compiled_code
from .inspection_mark import inspection_objects, is_inspection, mark, told_of

if TYPE_CHECKING:
    from ..core.grid import IrradianceVectorGrid
    from ..core.inspection import Surface

KINDS = (
    ("SPHERES", "Spheres", "A sphere at each vertex, coloured by the irradiance of every direction", 0),
    ("ARROWS", "Arrows", "An arrow at each vertex, towards where its light comes from", 1),
    ("SLICE", "Slice", "Irradiance in a plane through the grid", 2),
)
MOST_SPHERES = 5_000
MOST_ARROWS = 20_000
IRRADIANCE, LIT_SHARE = "irradiance", "lit_share"
"""Names of the attribute: W/m², linear; or how much of a vertex's cell light can reach."""

_COLLECTION = "IVG Inspection"
_RAMP_STOPS = 9
_UNSEEN = ("diffuse", "glossy", "transmission", "volume_scatter", "shadow")
_PROBES = ("volume", "sphere", "plane")


def make_inspection_mesh(scene: bpy.types.Scene, kind: str, look: Mapping[str, Any]) -> bpy.types.Object:
    """Make the object that shows a scene's grid, in place of the one of the same grid and kind.

    Parameters
    ----------
    kind
        One of `KINDS`.
    look
        Values of `look_properties`.

    Raises
    ------
    GridFileError
        The scene has no grid, its datablock was changed, or it has nothing to show.
    """
    image = scene_grid(scene)
    keep_compiled_code(compiled_code_folder())
    grid = storage.load_grid(image)
    surface = _surface(grid, kind, look, scene.ivg.spatial)
    if not len(surface.faces):
        raise GridFileError(f"grid '{image.name}' has nothing to show there: no light reaches it")
    name = f"{image.name} {next(label for item, label, *_ in KINDS if item == kind)}"
    mesh = _mesh(name, surface, LIT_SHARE if _shows_share(kind, look) else IRRADIANCE)
    mesh.materials.append(_material(name, grid, kind, look))
    return _placed(scene, name, mesh, kind, image.name_full)


def _surface(grid: IrradianceVectorGrid, kind: str, look: Mapping[str, Any], spatial: str) -> Surface:
    """Return the mesh and its light."""
    from ..core import inspection, inspection_slice

    if kind == "SLICE":
        axis = "XYZ".index(look["slice_axis"])
        quantity = inspection_slice.Quantity(look["quantity"])
        sampled = inspection_slice.sample_slice(grid, axis, look["slice_position"], quantity, Spatial(spatial))
        return inspection_slice.slice_surface(sampled)
    most = MOST_SPHERES if kind == "SPHERES" else MOST_ARROWS
    vertices = inspection.choose_vertices(grid, look["every"], most).lit
    if kind == "SPHERES":
        return inspection.spheres(grid, vertices, look["sphere_size"])
    return inspection.arrows(grid, vertices, inspection.Vectors(look["vectors"]), look["arrow_size"])


def _shows_share(kind: str, look: Mapping[str, Any]) -> bool:
    return bool(kind == "SLICE" and look["quantity"] == "LIT")


def _mesh(name: str, surface: Surface, attribute: str) -> bpy.types.Mesh:
    """Return a new mesh with the light as its active colours."""
    count, corners = surface.faces.shape
    mesh = bpy.data.meshes.new(name)
    mesh.vertices.add(len(surface.positions))
    mesh.vertices.foreach_set("co", surface.positions.reshape(-1))
    mesh.loops.add(count * corners)
    mesh.loops.foreach_set("vertex_index", surface.faces.reshape(-1))
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, count * corners, corners, dtype=np.int32))
    mesh.update()
    colors = mesh.color_attributes.new(attribute, "FLOAT_COLOR", "POINT")
    colors.data.foreach_set("color", _with_alpha(surface.values).reshape(-1))
    mesh.color_attributes.active_color = colors
    mark(mesh)
    return mesh


def _with_alpha(colors: NDArray[Any]) -> NDArray[np.float32]:
    return np.concatenate([colors, np.ones((len(colors), 1))], axis=1, dtype=np.float32)


def _material(name: str, grid: IrradianceVectorGrid, kind: str, look: Mapping[str, Any]) -> bpy.types.Material:
    """Return a new material that emits the attribute, brightened by the exposure, or false colours of it."""
    from ..core.inspection import gain, mean_irradiance

    share = _shows_share(kind, look)
    brightness = 1.0 if share else gain(mean_irradiance(grid), look["exposure"])
    material = bpy.data.materials.new(name)
    tree = material.node_tree
    tree.nodes.clear()
    attribute = _node(tree, "ShaderNodeAttribute", 0)
    attribute.attribute_name = LIT_SHARE if share else IRRADIANCE
    emission = _node(tree, "ShaderNodeEmission", 4)
    if look["false_color"] and kind == "SLICE":
        grey, scaled, ramp = (
            _node(tree, f"ShaderNode{kind}", column)
            for column, kind in enumerate(("RGBToBW", "Math", "ValToRGB"), start=1)
        )
        scaled.operation = "MULTIPLY"
        scaled.inputs[1].default_value = brightness
        _fill(ramp.color_ramp)
        tree.links.new(attribute.outputs["Color"], grey.inputs[0])
        tree.links.new(grey.outputs[0], scaled.inputs[0])
        tree.links.new(scaled.outputs[0], ramp.inputs[0])
        tree.links.new(ramp.outputs["Color"], emission.inputs["Color"])
    else:
        emission.inputs["Strength"].default_value = brightness
        tree.links.new(attribute.outputs["Color"], emission.inputs["Color"])
    output = _node(tree, "ShaderNodeOutputMaterial", 5)
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    if hasattr(material, "cycles"):
        material.cycles.emission_sampling = "NONE"
    mark(material)
    mark(tree)
    return material


def _node(tree: bpy.types.NodeTree, kind: str, column: int) -> bpy.types.Node:
    node = tree.nodes.new(kind)
    node.location = (200.0 * column, 0.0)
    return node


def _fill(ramp: bpy.types.ColorRamp) -> None:
    """Give a ramp the false colours."""
    from ..core.false_color import light_colors, linear

    places = np.linspace(0.0, 1.0, _RAMP_STOPS)
    colors = _with_alpha(linear(light_colors(places)))
    while len(ramp.elements) < _RAMP_STOPS:
        ramp.elements.new(1.0)
    for element, place, color in zip(ramp.elements, places, colors, strict=True):
        element.position, element.color = place, color


def _placed(scene: bpy.types.Scene, name: str, mesh: bpy.types.Mesh, kind: str, grid: str) -> bpy.types.Object:
    """Return the scene's object of this grid and kind, with a new mesh."""
    for shown in inspection_objects(scene):
        if shown.type == "MESH" and (told_of(shown, "kind"), told_of(shown, "grid")) == (kind, grid):
            before = shown.data
            shown.data = mesh
            _remove_unused(before)
            mesh.name = mesh.materials[0].name = name
            return shown
    made = bpy.data.objects.new(name, mesh)
    for ray in _UNSEEN:
        setattr(made, f"visible_{ray}", False)
    for probe in _PROBES:
        setattr(made, f"hide_probe_{probe}", True)
    mark(made, kind=kind, grid=grid)
    _collection(scene).objects.link(made)
    return made


def _remove_unused(mesh: bpy.types.Mesh) -> None:
    """Remove a mesh and its materials, unless something else uses them."""
    materials = [material for material in mesh.materials if material is not None and is_inspection(material)]
    if not mesh.users:
        bpy.data.meshes.remove(mesh)
    for material in materials:
        if not material.users:
            bpy.data.materials.remove(material)


def _collection(scene: bpy.types.Scene) -> bpy.types.Collection:
    """Return the scene's collection of what shows grids; a new one if there is none."""
    for collection in scene.collection.children_recursive:
        if is_inspection(collection):
            return collection
    made = bpy.data.collections.new(_COLLECTION)
    mark(made)
    scene.collection.children.link(made)
    return made
