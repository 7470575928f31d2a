# SPDX-License-Identifier: GPL-3.0-or-later
"""What the viewports draw of a grid, pixel by pixel, against rays and spheres in numpy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
import gpu
import numpy as np
from mathutils import Matrix
from numpy.typing import NDArray

from ivg_addon.blender import inspection_overlay
from ivg_addon.blender.bounds import Box
from ivg_addon.blender.bounds_overlay import draw_box
from ivg_addon.core import inspection
from ivg_addon.core.false_color import light_colors, linear, luminance
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.moments import vectors as of_moments
from tests.core.grids import LATTICE, UNIFORM, grid, own_weights

from .gpu_child import call_where_it_draws, draws
from .stored_grids import module, random_grid, store

SIDE = 160
HIGH = 12.0
"""Where the eye is; it looks down."""
CENTRE = (np.array(LATTICE.bounds_min) + LATTICE.bounds_max) / 2
VIEW = Matrix.Translation((-CENTRE[0], -CENTRE[1], -HIGH))
ORTHOGRAPHIC = Matrix(((0.7, 0, 0, 0), (0, 0.7, 0, 0), (0, 0, -0.1, -1), (0, 0, 0, 1)))
PERSPECTIVE = Matrix(((5.5, 0, 0, 0), (0, 5.5, 0, 0), (0, 0, -1.1, -2.1), (0, 0, -1, 0)))
DARK = (0.2, 0.0, 0.0)
"""Of what nothing is drawn over: no grid here has light of this colour."""

Float64 = NDArray[np.float64]


class Look(dict[str, Any]):
    """Settings that can be drawn without a scene."""

    __getattr__ = dict.__getitem__


LOOK = Look(
    **{f"show_{name}": False for name in ("spheres", "arrows", "slice", "box", "unlit")},
    exposure=0.0,
    every=1,
    sphere_size=0.7,
    vectors="FLUX",
    arrow_size=1.0,
    slice_axis="Z",
    slice_position=0.4,
    quantity="MEAN",
    false_color=False,
)


def drawn(shown: IrradianceVectorGrid, projection: Matrix, **look: object) -> tuple[Float64, Float64]:
    """Return the pixels' light (SIDE, SIDE, 3), and depth."""
    view = inspection_overlay.GridView(shown, inspection.mean_irradiance(shown))
    target = gpu.types.GPUOffScreen(SIDE, SIDE, format="RGBA32F")
    with target.bind():
        buffer = gpu.state.active_framebuffer_get()
        buffer.clear(color=(*DARK, 1.0), depth=1.0)
        view.draw(Look(LOOK | look), "TRILINEAR", VIEW, projection)
        colors = np.array(buffer.read_color(0, 0, SIDE, SIDE, 4, 0, "FLOAT").to_list())
        depth = np.array(buffer.read_depth(0, 0, SIDE, SIDE).to_list())
    untouched = (colors[..., :3] == np.float32(DARK)).all(axis=-1, keepdims=True)
    return np.where(untouched, -1.0, linear(colors[..., :3])), depth.reshape(SIDE, SIDE)


def rays(projection: Matrix) -> tuple[Float64, Float64]:
    """Return where the pixels' rays start, and their unit directions, (SIDE², 3) each."""
    axis = (np.arange(SIDE) + 0.5) / SIDE * 2.0 - 1.0
    x, y = np.meshgrid(axis, axis)
    back = np.array((projection @ VIEW).inverted())
    ends = []
    for z in (-1.0, 0.5):
        clip = np.stack([x, y, np.full_like(x, z), np.ones_like(x)], axis=-1).reshape(-1, 4) @ back.T
        ends.append(clip[:, :3] / clip[:, 3:])
    direction = ends[1] - ends[0]
    return ends[0], direction / np.linalg.norm(direction, axis=1, keepdims=True)


def check_spheres(projection: Matrix) -> None:
    """Every pixel within a sphere has the irradiance of the direction that its ray meets, and its depth."""
    rng = np.random.default_rng(0)
    validity = (rng.uniform(size=LATTICE.shape) > 0.2).astype(np.float32)
    shown = grid(UNIFORM + 0.2 * of_moments(rng.normal(size=(*LATTICE.shape, 12, 3))), validity)
    vertices = inspection.choose_vertices(shown, 1, 1000).lit
    radius = 0.35 * vertices.spacing
    start, direction = rays(projection)
    to = vertices.positions[None] - start[:, None]
    along = np.einsum("pvx,px->pv", to, direction)
    aside = np.linalg.norm(to - along[..., None] * direction[:, None], axis=2)
    near = np.where(aside < radius, along - np.sqrt(np.maximum(radius**2 - aside**2, 0.0)), np.inf)
    first = near.argmin(axis=1)
    pixel = np.arange(len(start))
    hit = np.isfinite(near[pixel, first])
    # Pixels that an outline crosses blend what is before and behind it.
    across = ((np.abs(aside - radius) < 0.02) & (along < near[pixel, first][:, None] + radius)).any(axis=1)
    inside = hit & ~across
    place = start[inside] + near[pixel, first][inside, None] * direction[inside]
    normals = (place - vertices.positions[first[inside]]) / radius
    expected = np.empty((len(normals), 3))
    six = inspection.shown_vectors(shown, vertices)
    for vertex in np.unique(first[inside]):
        of = first[inside] == vertex
        unit = normals[of] / np.linalg.norm(normals[of], axis=1, keepdims=True)
        expected[of] = inspection.sphere_irradiance(six[[vertex]], np.clip(unit, -1.0, 1.0))[0]
    expected *= inspection.gain(inspection.mean_irradiance(shown), 0.0)
    light, depth = drawn(shown, projection, show_spheres=True)
    assert inside.mean() > 0.03
    # Rounding of the ray's place on the screen: 10⁻⁷ of 12 m over a radius of 9 cm, near the outline much more.
    np.testing.assert_allclose(light.reshape(-1, 3)[inside], expected, atol=2e-3)
    assert (light.reshape(-1, 3)[~hit & ~across] == -1.0).all()
    clip = np.concatenate([place, np.ones((len(place), 1))], axis=1) @ np.array(projection @ VIEW).T
    np.testing.assert_allclose(depth.reshape(-1)[inside], 0.5 + 0.5 * clip[:, 2] / clip[:, 3], atol=1e-4)
    marked, _ = drawn(shown, projection, show_unlit=True)
    magenta = np.isclose(marked, (1.0, 0.0, 0.6), atol=1e-3).all(axis=-1)
    assert 0.0 < magenta.mean() < 0.1


def check_arrows() -> None:
    """All arrows point to +y: in the middle of their heads is their colour, less what shading takes."""
    vectors = np.zeros((6, 3, 3))
    vectors[2, :, 1] = (3.0, 2.0, 1.0)
    shown = grid(vectors, lit_weights=own_weights())
    light, _ = drawn(shown, ORTHOGRAPHIC, show_arrows=True, every=2, vectors="PY", arrow_size=0.9, exposure=-3.0)
    vertices = inspection.choose_vertices(shown, 2, 1000)
    heads = vertices.positions + np.array((0.0, 0.75 * 0.9 * vertices.spacing, 0.0))
    clip = np.concatenate([heads, np.ones((len(heads), 1))], axis=1) @ np.array(ORTHOGRAPHIC @ VIEW).T
    column, row = ((0.5 + 0.5 * clip[:, :2]) * SIDE).astype(int).T
    brightness = inspection.gain(inspection.mean_irradiance(shown), -3.0)
    shade = light[row, column] / (brightness * np.array((3.0, 2.0, 1.0)))
    assert (shade > 0.5).all()
    assert (shade < 1.0 + 1e-3).all()
    np.testing.assert_allclose(shade, shade[:, :1].repeat(3, axis=1), atol=1e-3)
    assert (light == -1.0).all(axis=-1).mean() > 0.5


def check_slice() -> None:
    """Light of radiance a + b·x, in three colours, gone where x < −0.375."""
    positions = LATTICE.vertex_positions()
    ramp = (1.0 + 0.2 * positions[..., 0] + 0.1 * positions[..., 1])[..., None, None, None]
    vectors = UNIFORM * ramp * np.array((1.0, 0.7, 0.4))[:, None]
    shown = grid(vectors, np.where(positions[..., 0] < -0.4, 0.0, 1.0), lit_weights=own_weights())
    brightness = inspection.gain(inspection.mean_irradiance(shown), 0.5)
    start, _ = rays(ORTHOGRAPHIC)
    x, y = start[:, 0], start[:, 1]
    low, high = LATTICE.bounds_min, LATTICE.bounds_max
    inside = (x > 0.02) & (x < high[0] - 0.02) & (y > low[1] + 0.02) & (y < high[1] - 0.02)
    outside = (x < -0.395) | (y < low[1] - 0.02) | (y > high[1] + 0.02)
    expected = brightness * np.pi * (1.0 + 0.2 * x + 0.1 * y)[inside, None] * (1.0, 0.7, 0.4)
    light, _ = drawn(shown, ORTHOGRAPHIC, show_slice=True, exposure=0.5)
    np.testing.assert_allclose(light.reshape(-1, 3)[inside], expected, atol=1e-4)
    assert (light.reshape(-1, 3)[outside] == -1.0).all()
    light, _ = drawn(shown, ORTHOGRAPHIC, show_slice=True, exposure=0.5, false_color=True)
    # The ramp has 256 steps.
    np.testing.assert_allclose(
        light.reshape(-1, 3)[inside], linear(light_colors(luminance(expected))), atol=2.0 / 255.0
    )
    light, _ = drawn(shown, ORTHOGRAPHIC, show_slice=True, exposure=0.5, quantity="LIT")
    np.testing.assert_allclose(light.reshape(-1, 3)[inside], 1.0, atol=1e-5)


def check_box() -> None:
    target = gpu.types.GPUOffScreen(SIDE, SIDE, format="RGBA32F")
    with target.bind(), gpu.matrix.push_pop(), gpu.matrix.push_pop_projection():
        buffer = gpu.state.active_framebuffer_get()
        buffer.clear(color=(0.0, 0.0, 0.0, 1.0), depth=1.0)
        gpu.matrix.load_matrix(VIEW)
        gpu.matrix.load_projection_matrix(ORTHOGRAPHIC)
        draw_box(Box(LATTICE.bounds_min, LATTICE.bounds_max), LATTICE.resolution, inspection_overlay.BOX_COLOR)
        colors = np.array(buffer.read_color(0, 0, SIDE, SIDE, 4, 0, "FLOAT").to_list())[..., :3]
    lines = colors.any(axis=-1)
    rows, columns = np.nonzero(lines)
    extent = 0.7 * SIDE / 2 * (np.array(LATTICE.bounds_max) - LATTICE.bounds_min)
    np.testing.assert_allclose((np.ptp(columns), np.ptp(rows)), extent[:2], atol=3.0)
    assert 0.0 < lines.mean() < 0.2


def check_all() -> None:
    check_spheres(ORTHOGRAPHIC)
    check_spheres(PERSPECTIVE)
    check_arrows()
    check_slice()
    check_box()


@draws
def test_what_is_drawn_is_what_the_grid_holds(tmp_path: Path) -> None:
    call_where_it_draws(tmp_path, check_all)


def test_a_grid_is_read_once_and_let_go(extension: str, tmp_path: Path) -> None:
    bpy.ops.wm.read_homefile(use_empty=True)
    overlay, scene = module(extension, "inspection_overlay"), bpy.context.scene
    assert "no grid" in overlay.view_of(scene)
    store(extension, "Room", random_grid(), tmp_path)
    shown = overlay.view_of(scene)
    np.testing.assert_array_equal(shown.grid.vectors, random_grid().vectors)
    assert shown.vertices_shown(2) == "36 of 240, one in 2 along each axis"
    assert overlay.view_of(scene) is shown
    assert shown.vertices(2) is shown.vertices(2)
    store(extension, "Room", random_grid(1), tmp_path)
    np.testing.assert_array_equal(overlay.view_of(scene).grid.vectors, random_grid(1).vectors)
    scene.ivg.grid.pixels[0] = 3.0
    assert "was painted on" in overlay.view_of(scene)
    bpy.ops.wm.read_homefile(use_empty=True)
    assert not overlay._views
