# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene that shows by how much the node group is off from the Python look-up, a pixel for each point.

At each point stands a small square that faces along its normal, on the ray through the middle of a pixel of an
orthographic camera. It shines with the difference between what the group finds, in the renderer, and what Python finds
at its corners: so nothing is lost where a renderer's pictures are half floats.
"""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np
from numpy.typing import NDArray

from ivg_addon.blender.irradiance_nodes import irradiance_group
from ivg_addon.core.exr import read_exr
from ivg_addon.core.grid import DEFAULT_NORMAL_BIAS, IrradianceVectorGrid
from ivg_addon.core.look_up import irradiance
from ivg_addon.core.settings import Directional, Spatial

Float64 = NDArray[np.float64]

VIEWS = np.array([(0.48, 0.6, 0.64), (-0.48, -0.6, -0.64)])
"""Ways to the camera, unit vectors along which no grid lies: every normal faces one or the other."""
_SQUARE = 0.1
"""Edge of a square, pixels."""
_LEAST_COSINE = 0.3
"""Between a square's normal and the way to the camera."""
_PLACING = np.array([(0.0, 4.0, 0.0, 0.5), (0.0, 0.0, -0.5, -1.0), (2.0, 0.0, 0.0, 0.25), (0.0, 0.0, 0.0, 1.0)])
"""Of the squares' object: turned, stretched and mirrored. In powers of two, since they are small."""
_SCALE, _GREY = 100.0, 8.0
"""Pixels are _SCALE times the relative difference plus _GREY, since negative light would be cut off: half floats then
tell 4·10⁻⁵, and up to 8 % either way."""


@dataclass(frozen=True)
class Squares:
    """What a camera sees.

    Parameters
    ----------
    view : (3,) float64
        The way to the camera.
    low, size
        The picture's lower left corner along its right and up (`_axes`), and its edge, metres.
    side
        The picture's edge, pixels.
    pixels : (n,) int64
        Those in which a square is seen, row after row from below.
    points, facing, normals : (n, 3) float64
        The squares' middles, where they face, and the normals of the bumps on them.
    corners : (n, 4, 3) float64
    """

    view: Float64
    low: Float64
    size: float
    side: int
    pixels: NDArray[np.int64]
    points: Float64
    facing: Float64
    normals: Float64
    corners: Float64


def squares(view: Float64, points: Float64, facing: Float64, normals: Float64, side: int = 128) -> Squares:
    """Return squares at those points that the camera can see, one in a pixel, moved to the pixel's middle."""
    right, up = _axes(view)
    plane = np.stack([points @ right, points @ up], axis=-1)
    low = plane.min(axis=0)
    size = float((plane.max(axis=0) - low).max())
    pixel = np.floor((plane - low) / size * side).clip(0, side - 1)
    offset = low + (pixel + 0.5) * size / side - plane
    middles = points + offset[:, :1] * right + offset[:, 1:] * up
    number = (pixel[:, 1] * side + pixel[:, 0]).astype(np.int64)
    seen = np.flatnonzero(facing @ view >= _LEAST_COSINE)
    seen = seen[np.unique(number[seen], return_index=True)[1]]
    tangent = np.cross(facing, np.eye(3)[np.abs(facing).argmin(axis=1)])
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    bitangent = np.cross(facing, tangent)
    half = 0.5 * _SQUARE * size / side
    ways = [half * (a * tangent + b * bitangent) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    corners = middles[:, None] + np.stack(ways, axis=1)
    return Squares(view, low, size, side, number[seen], middles[seen], facing[seen], normals[seen], corners[seen])


def _axes(view: Float64) -> tuple[Float64, Float64]:
    """Return the picture's right and up."""
    right = np.cross((0.0, 0.0, 1.0), view)
    right /= np.linalg.norm(right)
    return right, np.cross(view, right)


@dataclass(frozen=True)
class Wanted:
    """What Python finds at squares, W/m².

    Parameters
    ----------
    corners : (n, 4, 3) float64
    middles : (n, 3) float64
    """

    corners: Float64
    middles: Float64

    @property
    def mean(self) -> float:
        """Return the mean of all points and channels, to which differences are relative."""
        return float(self.middles.mean())

    def bent(self) -> Float64:
        """Return by how much the mean of two opposite corners is off from the middle, relative, (n,).

        A renderer interpolates between corners: where this is not small, the picture shows it and not the group.
        """
        diagonals = 0.5 * (self.corners[:, :2] + self.corners[:, 2:])
        return np.asarray(np.abs(diagonals - self.middles[:, None]).max(axis=(1, 2)) / self.mean)


def wanted(grid: IrradianceVectorGrid, spatial: Spatial, what: Squares) -> Wanted:
    """Return what Python finds at the squares."""

    def look_up(points: Float64) -> Float64:
        each = len(points) // len(what.points)
        normals, facing = (np.ascontiguousarray(n.repeat(each, axis=0)) for n in (what.normals, what.facing))
        values = grid.interpolated(spatial), grid.validity, grid.partitions, grid.lattice
        way = spatial, Directional.LEAST_SQUARES, DEFAULT_NORMAL_BIAS
        return irradiance(*values, points, normals, *way, facing=facing).astype(np.float64)

    corners = look_up(np.ascontiguousarray(what.corners.reshape(-1, 3))).reshape(-1, 4, 3)
    return Wanted(corners, look_up(what.points))


def build(image: bpy.types.Image, what: Squares, expected: Wanted, bumps: bool) -> None:
    """Fill the current, empty scene, so that pixels will show differences to what is expected.

    Parameters
    ----------
    bumps
        Whether the normals of bumps go into the group; otherwise it takes the squares' own.
    """
    mesh = bpy.data.meshes.new("Squares")
    placed = (what.corners.reshape(-1, 3) - _PLACING[:3, 3]) @ np.linalg.inv(_PLACING[:3, :3]).T
    mesh.from_pydata(placed.tolist(), [], np.arange(4 * len(what.points)).reshape(-1, 4).tolist())
    for name, values in (("expected", expected.corners.reshape(-1, 3)), ("bump", what.normals.repeat(4, axis=0))):
        attribute = mesh.attributes.new(name, "FLOAT_VECTOR", "CORNER")
        attribute.data.foreach_set("vector", values.astype(np.float32).reshape(-1))
    material = bpy.data.materials.new("Squares")
    _fill_material(material.node_tree, image, bumps, _SCALE / expected.mean)
    mesh.materials.append(material)
    scene = bpy.context.scene
    shown = bpy.data.objects.new("Squares", mesh)
    shown.matrix_world = _PLACING.T.tolist()
    scene.collection.objects.link(shown)
    _add_camera(scene, what)
    scene.render.engine = "CYCLES"
    scene.cycles.samples = scene.eevee.taa_render_samples = 1
    scene.cycles.use_adaptive_sampling = scene.cycles.use_denoising = False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01
    scene.render.filter_size = 0.01
    # Otherwise graphics cards get the normals of meshes in ten bits.
    scene.render.use_high_quality_normals = True
    scene.render.resolution_x = scene.render.resolution_y = what.side
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"


def _fill_material(tree: bpy.types.NodeTree, image: bpy.types.Image, bumps: bool, scale: float) -> None:
    tree.nodes.clear()
    group = tree.nodes.new("ShaderNodeGroup")
    group.node_tree = irradiance_group(image)
    if bumps:
        tree.links.new(_attribute(tree, "bump"), group.inputs["Normal"])
    off = tree.nodes.new("ShaderNodeVectorMath")
    off.operation = "SUBTRACT"
    tree.links.new(group.outputs["Irradiance"], off.inputs[0])
    tree.links.new(_attribute(tree, "expected"), off.inputs[1])
    large = tree.nodes.new("ShaderNodeVectorMath")
    large.operation = "MULTIPLY_ADD"
    tree.links.new(off.outputs[0], large.inputs[0])
    large.inputs[1].default_value = (scale,) * 3
    large.inputs[2].default_value = (_GREY,) * 3
    emission = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(large.outputs[0], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])


def _attribute(tree: bpy.types.NodeTree, name: str) -> bpy.types.NodeSocket:
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_name = name
    return node.outputs["Vector"]


def _add_camera(scene: bpy.types.Scene, what: Squares) -> None:
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", what.size
    right, up = _axes(what.view)
    middle = (what.low[0] + what.size / 2.0) * right + (what.low[1] + what.size / 2.0) * up
    depth = what.corners @ what.view
    camera.clip_start, camera.clip_end = 0.1, float(depth.max() - depth.min()) + 2.0
    at = middle + (float(depth.max()) + 1.0) * what.view
    made = bpy.data.objects.new("Camera", camera)
    placing = np.eye(4)
    placing[:3] = np.column_stack([right, up, what.view, at])
    made.matrix_world = placing.T.tolist()
    scene.collection.objects.link(made)
    scene.camera = made


ENGINES = ("CYCLES", "BLENDER_EEVEE")
EXACT_FILTERS = {
    "MESA_EXTENSION_OVERRIDE": "-GL_EXT_texture_filter_anisotropic -GL_ARB_texture_filter_anisotropic",
}
"""Environment in which Mesa's software rasteriser interpolates linearly.

Its anisotropic filter, which Blender asks for, is off by up to a fifth of the difference of two texels.
"""
_RENDER = """
import sys
import bpy
path, engine, picture = sys.argv[1:]
if engine != "CYCLES":
    import gpu
    gpu.init()
print("engine", flush=True)
bpy.ops.wm.open_mainfile(filepath=path)
scene = bpy.context.scene
scene.render.engine, scene.render.filepath = engine, picture
bpy.ops.render.render(write_still=True)
"""


def render(engine: str, folder: Path) -> Path | None:
    """Save the current file, and render it in a process that has nothing but Blender; return the picture.

    None if the engine is EEVEE and there is no OpenGL, or Blender draws only with a window.

    Raises
    ------
    RuntimeError
        The rendering failed.
    """
    path, picture = folder / "squares.blend", folder / f"{engine}.exr"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True)
    done = subprocess.run(
        [sys.executable, "-c", _RENDER, str(path), engine, str(picture)],
        env=os.environ | EXACT_FILTERS | {"BLENDER_USER_RESOURCES": str(folder / "resources")},
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    if "engine\n" not in done.stdout and engine != "CYCLES":
        return None
    if done.returncode or not picture.exists():
        raise RuntimeError(done.stderr)
    return picture


def differences(what: Squares, picture: Path) -> Float64:
    """Return by how much the group is off at the squares of a picture, relative to the mean, (n, 3)."""
    channels = read_exr(picture)
    pixels = np.stack([channels[name] for name in "RGB"], axis=-1).reshape(-1, 3)[what.pixels]
    return np.asarray(np.abs(pixels.astype(np.float64) - _GREY) / _SCALE)
