# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's grid, drawn in the viewports: spheres, arrows, a slice and its box.

What is drawn is prepared once and kept until the grid, or what it depends on, changes; turning the view, exposure and
sizes are uniforms. Nothing of it is in the file.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix
from numpy.typing import NDArray

from ..core.errors import IvgError
from ..core.settings import Spatial
from . import grid_image, inspection_shaders
from .bounds import Box
from .bounds_overlay import draw_box
from .grid_store import compiled_code_folder, keep_compiled_code
from .inspection_shaders import ARROW_TEXELS, RAMP, SPHERE_TEXELS, arrow_shader, slice_shader, sphere_shader
from .marks import KEY
from .viewport_overlay import ViewportOverlay

if TYPE_CHECKING:
    from ..core.grid import IrradianceVectorGrid
    from ..core.inspection import Vertices

Float32 = NDArray[np.float32]
Made = TypeVar("Made")

MOST_SHOWN = 20_000
"""Vertices that have a sphere or an arrow: what any graphics card draws at every redraw."""
BOX_COLOR = (0.35, 0.75, 1.0)
UNLIT_SIZE = 0.3
"""Of a mark where no light is, in sizes of spheres."""

_PER_ROW = 1024
_SQUARE = ((-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0))


@dataclass
class GridView:
    """What is drawn of one grid.

    Parameters
    ----------
    grid
        As it is stored in the .blend.
    mean
        Its mean irradiance, W/m².
    """

    grid: IrradianceVectorGrid
    mean: float
    _kept: dict[str, tuple[object, Any]] = field(default_factory=dict)

    def vertices(self, every: int) -> Vertices:
        """Return the vertices that have a sphere or an arrow."""
        from ..core.inspection import choose_vertices

        return self._keep("vertices", every, lambda: choose_vertices(self.grid, every, MOST_SHOWN))

    def vertices_shown(self, every: int) -> str:
        """Return in words how many vertices have a sphere or an arrow."""
        shown = self.vertices(every)
        return f"{len(shown.index):,} of {self.grid.lattice.vertex_count:,}" + (
            f", one in {shown.stride} along each axis" if shown.stride > 1 else ""
        )

    def gain(self, exposure: float) -> float:
        """Return the brightness of 1 W/m²."""
        from ..core.inspection import gain

        return gain(self.mean, exposure)

    def draw(self, settings: bpy.types.PropertyGroup, spatial: str, view: Matrix, projection: Matrix) -> None:
        """Draw what is switched on but the box.

        Parameters
        ----------
        settings
            `scene.ivg.inspection`.
        spatial
            Interpolation of slices.
        view, projection
            From world space to the eye's, and on to the screen.
        """
        position = view.inverted()
        perspective = projection[3][3] == 0.0
        eye = (*position.translation, 1.0) if perspective else (*position.col[2].xyz, 0.0)
        common = {"view_projection": projection @ view, "gain": self.gain(settings.exposure)}
        depth, mask = gpu.state.depth_test_get(), gpu.state.depth_mask_get()
        gpu.state.depth_test_set("LESS_EQUAL")
        gpu.state.depth_mask_set(True)
        gpu.state.blend_set("ALPHA")
        try:
            if settings.show_slice:
                self._draw_slice(settings, spatial, common)
            if settings.show_arrows:
                self._draw_arrows(settings, common | {"eye": eye})
            if settings.show_spheres:
                self._draw_spheres(settings, common | {"eye": eye}, (1.0, 0.0))
            if settings.show_unlit:
                # They are inside of things.
                gpu.state.depth_test_set("NONE")
                self._draw_spheres(settings, common | {"eye": eye}, (0.0, UNLIT_SIZE))
        finally:
            gpu.state.blend_set("NONE")
            gpu.state.depth_mask_set(mask)
            gpu.state.depth_test_set(depth)

    def _draw_slice(self, settings: bpy.types.PropertyGroup, spatial: str, uniforms: dict[str, Any]) -> None:
        axis = "XYZ".index(settings.slice_axis)
        key = (axis, settings.slice_position, settings.quantity, spatial)
        batch = self._keep("slice", key, lambda: _slice_batch(self.grid, *key))
        if batch is None:
            return
        if settings.quantity == "LIT":
            uniforms = uniforms | {"gain": 1.0}
        shader = slice_shader()
        _bind(shader, uniforms)
        shader.uniform_bool("false_color", settings.false_color)
        shader.uniform_sampler("ramp", _ramp())
        batch.draw(shader)

    def _draw_arrows(self, settings: bpy.types.PropertyGroup, uniforms: dict[str, Any]) -> None:
        key = (settings.every, settings.vectors)
        vertices = self.vertices(settings.every)
        texture, count, scale = self._keep("arrows", key, lambda: _arrow_instances(self.grid, vertices, key[1]))
        uniforms = uniforms | {"scale": settings.arrow_size * vertices.spacing * scale}
        _draw_instances(arrow_shader(), _arrow_batch(), texture, count, uniforms)

    def _draw_spheres(
        self, settings: bpy.types.PropertyGroup, uniforms: dict[str, Any], sizes: tuple[float, float]
    ) -> None:
        """Draw spheres, of so much of their size where light is, and where none is."""
        vertices = self.vertices(settings.every)
        texture, count = self._keep("spheres", settings.every, lambda: _sphere_instances(self.grid, vertices))
        radius = 0.5 * settings.sphere_size * vertices.spacing
        radii = tuple(radius * size for size in sizes)
        _draw_instances(sphere_shader(), _square(), texture, count, uniforms | {"radii": radii})

    def _keep(self, name: str, key: object, make: Callable[[], Made]) -> Made:
        """Return what was made for a key, or make it."""
        kept = self._kept.get(name)
        if kept is None or kept[0] != key:
            kept = self._kept[name] = (key, make())
        made: Made = kept[1]
        return made


_views: dict[int, tuple[tuple[int, str], GridView | str]] = {}
"""By scene: of which image and grid, and what is drawn of it or why nothing is."""


def shows(scene: bpy.types.Scene) -> bool:
    """Tell whether anything of a scene's grid is to be drawn."""
    settings = scene.ivg.inspection
    return any(getattr(settings, f"show_{name}") for name in ("spheres", "arrows", "slice", "box", "unlit"))


def view_of(scene: bpy.types.Scene) -> GridView | str:
    """Return what is drawn of a scene's grid, or why nothing is; reads the grid when first asked for it."""
    image = scene.ivg.grid
    if image is None:
        return "The scene has no grid in this file"
    wrong = grid_image.problem(image)
    if wrong:
        return wrong
    key = (image.session_uid, str(image[KEY].get("grid_digest")))
    kept = _views.get(scene.session_uid)
    if kept is None or kept[0] != key:
        kept = _views[scene.session_uid] = (key, _read(image))
    return kept[1]


def _read(image: bpy.types.Image) -> GridView | str:
    """Read the grid, and what has to be known of all of it."""
    keep_compiled_code(compiled_code_folder())
    from ..core.inspection import mean_irradiance

    try:
        grid = grid_image.read(image)
    except IvgError as error:
        return str(error)
    return GridView(grid, mean_irradiance(grid))


def forget() -> None:
    """Let go of all grids."""
    _views.clear()


def _bind(shader: Any, uniforms: dict[str, Any]) -> None:
    """Bind a shader with some of its uniforms."""
    shader.bind()
    for name, value in uniforms.items():
        shader.uniform_float(name, value)


def _draw_instances(shader: Any, batch: Any, texture: Any, count: int, uniforms: dict[str, Any]) -> None:
    """Draw `count` instances that a texture tells of."""
    if not count:
        return
    _bind(shader, uniforms)
    shader.uniform_int("per_row", _PER_ROW)
    shader.uniform_sampler("instances", texture)
    batch.draw_instanced(shader, instance_count=count)


def _texture(texels: Float32) -> Any:
    """Return a texture of (height, width, 4) texels."""
    data = gpu.types.Buffer("FLOAT", texels.size, np.ascontiguousarray(texels, dtype=np.float32).reshape(-1))
    return gpu.types.GPUTexture((texels.shape[1], texels.shape[0]), format="RGBA32F", data=data)


def _instance_texture(texels: Float32) -> Any:
    """Return a texture of instances (n, texels of each, 4)."""
    count, each, _ = texels.shape
    across = min(count, _PER_ROW)
    rows = np.zeros((-(-count // across) * across, each, 4), dtype=np.float32)
    rows[:count] = texels
    return _texture(rows.reshape(-1, across * each, 4))


def _sphere_instances(grid: IrradianceVectorGrid, vertices: Vertices) -> tuple[Any, int]:
    """Return the texture that `sphere_shader` reads, and how many spheres it has."""
    from ..core.inspection import shown_vectors
    from ..core.moments import moments

    texels = np.empty((len(vertices.index), SPHERE_TEXELS, 4), dtype=np.float32)
    texels[:, 0, :3], texels[:, 0, 3] = vertices.positions, vertices.validity
    texels[:, 1:] = moments(shown_vectors(grid, vertices)).swapaxes(1, 2).reshape(len(texels), -1, 4)
    return _instance_texture(texels), len(texels)


def _arrow_instances(grid: IrradianceVectorGrid, vertices: Vertices, which: str) -> tuple[Any, int, float]:
    """Return the texture that `arrow_shader` reads, how many arrows it has, and the scale of the vectors."""
    from ..core.inspection import Vectors, arrow_scale, arrow_vectors

    lit = vertices.lit
    pointing, colors = arrow_vectors(grid, lit, Vectors(which))
    some = pointing.any(axis=1)
    if not some.any():
        return None, 0, 0.0
    texels = np.zeros((int(some.sum()), ARROW_TEXELS, 4), dtype=np.float32)
    texels[:, 0, :3], texels[:, 1, :3], texels[:, 2, :3] = lit.positions[some], pointing[some], colors[some]
    return _instance_texture(texels), len(texels), arrow_scale(pointing)


def _slice_batch(grid: IrradianceVectorGrid, axis: int, position: float, quantity: str, spatial: str) -> Any:
    """Return what `slice_shader` draws, None where the slice has nothing to show."""
    from ..core.inspection_slice import Quantity, sample_slice, slice_surface

    surface = slice_surface(sample_slice(grid, axis, position, Quantity(quantity), Spatial(spatial)))
    if not len(surface.faces):
        return None
    triangles = np.ascontiguousarray(surface.faces[:, [0, 1, 2, 0, 2, 3]]).reshape(-1, 3)
    content = {"pos": surface.positions, "value": surface.values}
    return batch_for_shader(slice_shader(), "TRIS", content, indices=triangles)


@functools.lru_cache(maxsize=1)
def _square() -> Any:
    return batch_for_shader(sphere_shader(), "TRI_STRIP", {"corner": _SQUARE})


@functools.lru_cache(maxsize=1)
def _arrow_batch() -> Any:
    from ..core.inspection import unit_arrow

    positions, triangles = unit_arrow()
    return batch_for_shader(arrow_shader(), "TRIS", {"pos": positions.astype(np.float32)}, indices=triangles)


@functools.lru_cache(maxsize=1)
def _ramp() -> Any:
    """Return the false colours, linear, from nothing to full scale."""
    from ..core.false_color import light_colors, linear

    texels = np.ones((1, RAMP, 4), dtype=np.float32)
    texels[0, :, :3] = linear(light_colors(np.linspace(0.0, 1.0, RAMP)))
    return _texture(texels)


def _draw() -> None:
    """Draw the grid of the scene that the viewport shows."""
    context = bpy.context
    scene = context.scene
    if not shows(scene):
        _views.pop(scene.session_uid, None)
        return
    if not context.space_data.overlay.show_overlays:
        return
    shown = view_of(scene)
    if isinstance(shown, str):
        return
    settings = scene.ivg.inspection
    view, projection = gpu.matrix.get_model_view_matrix(), gpu.matrix.get_projection_matrix()
    shown.draw(settings, scene.ivg.spatial, view, projection)
    if settings.show_box:
        lattice = shown.grid.lattice
        box = Box(lattice.bounds_min, lattice.bounds_max)
        draw_box(box, lattice.resolution, BOX_COLOR, context.preferences.system.pixel_size)


_overlay = ViewportOverlay(_draw)


def register() -> None:
    """Draw in every viewport."""
    _overlay.register()


def unregister() -> None:
    """Draw no more."""
    _overlay.unregister()
    forget()
    for kept in (_square, _arrow_batch, _ramp):
        kept.cache_clear()
    inspection_shaders.forget()
