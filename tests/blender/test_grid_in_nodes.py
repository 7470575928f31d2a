# SPDX-License-Identifier: GPL-3.0-or-later
"""What nodes read: every number of the image by Image Texture nodes, every vector of the volume by Sample Grid."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import bpy
import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.exr import read_exr
from ivg_addon.core.grid_atlas import PLANES, atlas, layout
from ivg_addon.core.reconstruction import coefficients
from ivg_addon.core.settings import Directional
from tests.core.grids import LATTICE, grid

from .export_scenes import add_object, empty_scene, new_material
from .gpu_child import draws, rendered_by_eevee
from .stored_grids import random_grid, store

SIDE = 64
"""Pixels along an edge of the picture, each of which shows one texel."""
WIDE = Lattice((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (1, 1, 6000))
"""A grid whose image is as long as graphics cards take."""


@pytest.fixture(autouse=True)
def end_empty(extension: str) -> Iterator[None]:
    yield
    bpy.ops.wm.read_homefile(use_empty=True)


def texels_of(lattice: Lattice) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return columns and rows of as many random vertices' texels, in random planes, as the picture has pixels."""
    rng = np.random.default_rng(0)
    where = layout(lattice.resolution)
    i, j, k = (rng.integers(0, n, SIDE * SIDE) for n in lattice.shape)
    planes = rng.integers(0, len(PLANES), SIDE * SIDE)
    column, row = np.empty_like(i), np.empty_like(i)
    for plane in range(len(PLANES)):
        of = planes == plane
        column[of], row[of] = where.texel(i[of], j[of], k[of], plane)
    return column, row


def show_texels(image: bpy.types.Image, column: NDArray[np.int64], row: NDArray[np.int64]) -> bpy.types.Node:
    """Make a scene in which every pixel shows one texel of an image; return the node that reads it."""
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    x, y = np.meshgrid(np.arange(SIDE), np.arange(SIDE))
    places = (np.stack([x.reshape(-1), y.reshape(-1)], axis=-1)[:, None] + corners) / SIDE
    places = np.concatenate([places.reshape(-1, 2), np.zeros((4 * SIDE * SIDE, 1))], axis=1)
    mesh = bpy.data.meshes.new("Texels")
    mesh.from_pydata(places.tolist(), [], np.arange(len(places)).reshape(-1, 4).tolist())
    at = np.zeros((SIDE * SIDE, 3), dtype=np.float32)
    at[:, 0], at[:, 1] = (column + 0.5) / image.size[0], (row + 0.5) / image.size[1]
    mesh.attributes.new("at", "FLOAT_VECTOR", "CORNER").data.foreach_set("vector", at.repeat(4, axis=0).reshape(-1))
    read = None

    def build(tree: bpy.types.NodeTree, output: bpy.types.Node) -> None:
        nonlocal read
        attribute = tree.nodes.new("ShaderNodeAttribute")
        attribute.attribute_name = "at"
        read = tree.nodes.new("ShaderNodeTexImage")
        read.image, read.interpolation, read.extension = image, "Closest", "EXTEND"
        tree.links.new(attribute.outputs["Vector"], read.inputs["Vector"])
        positive = tree.nodes.new("ShaderNodeVectorMath")
        positive.operation = "ABSOLUTE"
        tree.links.new(read.outputs["Color"], positive.inputs[0])
        emission = tree.nodes.new("ShaderNodeEmission")
        tree.links.new(positive.outputs[0], emission.inputs["Color"])
        tree.links.new(emission.outputs[0], output.inputs["Surface"])

    mesh.materials.append(new_material("Texels", build))
    add_object("Texels", mesh)
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", 1.0
    scene = bpy.context.scene
    scene.camera = add_object("Camera", camera, location=(0.5, 0.5, 1.0))
    scene.render.resolution_x = scene.render.resolution_y = SIDE
    scene.render.filter_size = 0.01
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    assert read is not None
    return read


def rendered(path: Path) -> NDArray[np.float32]:
    """Render; return the pixels' colours, (SIDE², 3)."""
    bpy.context.scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    channels = read_exr(path)
    return np.stack([channels[name] for name in "RGB"], axis=-1).reshape(-1, 3)


@pytest.mark.parametrize("lattice", [LATTICE, WIDE], ids=["small", "wide"])
def test_cycles_reads_every_texel_to_the_bit(extension: str, tmp_path: Path, lattice: Lattice) -> None:
    scene = empty_scene()
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01
    values = np.random.default_rng(2).normal(size=(*lattice.shape, 6, 3, 3))
    baked = grid(values, lattice=lattice)
    image = store(extension, "Room", baked, tmp_path)
    column, row = texels_of(lattice)
    show_texels(image, column, row)
    expected = np.abs(atlas(baked)[row, column])
    np.testing.assert_array_equal(rendered(tmp_path / "a.exr"), expected)


@draws
def test_eevee_reads_every_texel(extension: str, tmp_path: Path) -> None:
    """A render is a picture of half floats: the difference to what was expected shows that the texels are not."""
    empty_scene().eevee.taa_render_samples = 1
    baked = grid(np.random.default_rng(2).normal(size=(*WIDE.shape, 6, 3, 3)), lattice=WIDE)
    image = store(extension, "Room", baked, tmp_path)
    column, row = texels_of(WIDE)
    read = show_texels(image, column, row)
    expected = np.abs(atlas(baked)[row, column])
    mesh = bpy.data.meshes["Texels"]
    wanted = mesh.attributes.new("wanted", "FLOAT_VECTOR", "CORNER")
    wanted.data.foreach_set("vector", expected.repeat(4, axis=0).reshape(-1))
    tree = read.id_data
    positive = read.outputs["Color"].links[0].to_node
    emission = positive.outputs[0].links[0].to_node
    attribute = tree.nodes.new("ShaderNodeAttribute")
    attribute.attribute_name = "wanted"
    off = tree.nodes.new("ShaderNodeVectorMath")
    off.operation = "SUBTRACT"
    tree.links.new(positive.outputs[0], off.inputs[0])
    tree.links.new(attribute.outputs["Vector"], off.inputs[1])
    large = tree.nodes.new("ShaderNodeVectorMath")
    large.operation = "SCALE"
    large.inputs["Scale"].default_value = 1e6
    tree.links.new(off.outputs[0], large.inputs[0])
    size = tree.nodes.new("ShaderNodeVectorMath")
    size.operation = "ABSOLUTE"
    tree.links.new(large.outputs[0], size.inputs[0])
    tree.links.new(size.outputs[0], emission.inputs["Color"])
    found = rendered_by_eevee(tmp_path, rendered)
    # Differences of float32 are 0, or 10⁻⁷ of the texel; half floats' would be 10⁻³ and more.
    assert found.max() <= 1e6 * np.finfo(np.float32).eps * expected.max()


def sampled(
    volume: bpy.types.Volume, names: tuple[str, ...], at: NDArray[np.float64], interpolation: str
) -> dict[str, NDArray[np.float32]]:
    """Return what Sample Grid finds of a volume's grids at points (n, 3); "NEAREST" or "TRILINEAR"."""
    mesh = bpy.data.meshes.new("Points")
    mesh.from_pydata(at.tolist(), [], [])
    points = add_object("Points", mesh)
    tree = bpy.data.node_groups.new("Sample", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    geometry = tree.nodes.new("NodeGroupInput").outputs[0]
    info = tree.nodes.new("GeometryNodeObjectInfo")
    info.inputs["Object"].default_value = add_object("Room", volume)
    for name in names:
        kind = "FLOAT" if name in {"validity", "lit"} else "VECTOR"
        named = tree.nodes.new("GeometryNodeGetNamedGrid")
        named.data_type, named.inputs["Name"].default_value = kind, name
        sample = tree.nodes.new("GeometryNodeSampleGrid")
        sample.data_type = kind
        sample.inputs["Interpolation"].default_value = {"NEAREST": "Nearest Neighbor"}.get(interpolation, "Trilinear")
        keep = tree.nodes.new("GeometryNodeStoreNamedAttribute")
        keep.data_type = "FLOAT" if kind == "FLOAT" else "FLOAT_VECTOR"
        keep.inputs["Name"].default_value = name
        tree.links.new(info.outputs["Geometry"], named.inputs[0])
        tree.links.new(named.outputs["Grid"], sample.inputs["Grid"])
        tree.links.new(geometry, keep.inputs["Geometry"])
        tree.links.new(sample.outputs[0], keep.inputs["Value"])
        geometry = keep.outputs[0]
    tree.links.new(geometry, tree.nodes.new("NodeGroupOutput").inputs[0])
    points.modifiers.new("Sample", "NODES").node_group = tree
    evaluated = points.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    read = {}
    for name in names:
        attribute = evaluated.attributes[name]
        three = attribute.data_type == "FLOAT_VECTOR"
        read[name] = np.empty(len(at) * (3 if three else 1), dtype=np.float32)
        attribute.data.foreach_get("vector" if three else "value", read[name])
    return read


def test_geometry_nodes_read_the_volume_at_every_vertex(extension: str, tmp_path: Path) -> None:
    """Blender's own reader finds the vectors where the vertices are."""
    bpy.ops.wm.read_homefile(use_empty=True)
    baked = random_grid()
    volume = store(extension, "Room", baked, tmp_path)["ivg"]["volume"]
    vertices = LATTICE.vertex_positions().reshape(-1, 3)
    read = sampled(volume, ("I_px_R", "I_nz_B", "irradiance_py", "validity"), vertices, "NEAREST")
    np.testing.assert_array_equal(read["I_px_R"], baked.vectors[..., 0, 0, :].reshape(-1))
    np.testing.assert_array_equal(read["I_nz_B"], baked.vectors[..., 5, 2, :].reshape(-1))
    np.testing.assert_array_equal(read["irradiance_py"], baked.vectors[..., 2, :, 1].reshape(-1))
    np.testing.assert_array_equal(read["validity"], baked.validity.reshape(-1))


def test_geometry_nodes_find_the_irradiance_anywhere(extension: str, tmp_path: Path) -> None:
    """Of what Sample Grid interpolates, E = ½ (F·n + Σ_k D_k·W_k) is the look-up's, where no cell is cut."""
    bpy.ops.wm.read_homefile(use_empty=True)
    rng = np.random.default_rng(9)
    baked = grid(rng.normal(size=(*LATTICE.shape, 6, 3, 3)))
    volume = store(extension, "Room", baked, tmp_path)["ivg"]["volume"]
    names = tuple(f"{part}_{channel}" for part in ("F", "D_x", "D_y", "D_z") for channel in "RGB")
    points = rng.uniform(LATTICE.bounds_min, LATTICE.bounds_max, (500, 3))
    read = sampled(volume, (*names, "lit"), points, "TRILINEAR")
    np.testing.assert_allclose(read["lit"], 1.0, atol=1e-5)
    n = np.array([0.36, 0.48, -0.8])
    c = coefficients(n, Directional.LEAST_SQUARES)
    w = np.stack([n, *(c[0::2] - c[1::2])])
    for index, channel in enumerate("RGB"):
        parts = [read[f"{part}_{channel}"].reshape(-1, 3) for part in ("F", "D_x", "D_y", "D_z")]
        e = 0.5 * sum(part @ weights for part, weights in zip(parts, w, strict=True))
        expected = baked.irradiance(points, np.broadcast_to(n, points.shape))[:, index]
        # Blender's positions are float32: 10⁻⁷ of 4 m, in voxels of 0.25 m and differences of about ten a voxel.
        np.testing.assert_allclose(np.maximum(e, 0.0), expected, atol=1e-4)
