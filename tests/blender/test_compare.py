# SPDX-License-Identifier: GPL-3.0-or-later
"""The grid's picture and Cycles' show the same view, and a comparison leaves files, numbers and the user's scene."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from ivg_addon.blender import compare as comparing  # noqa: E402
from ivg_addon.blender.compare import compare_steps  # noqa: E402
from ivg_addon.blender.compare_points import compare_points_steps  # noqa: E402
from ivg_addon.blender.cycles_render import CyclesPicture, render_steps  # noqa: E402
from ivg_addon.blender.display import display_pixels, read_pixels  # noqa: E402
from ivg_addon.blender.export_camera import export_camera, hidden_from_camera  # noqa: E402
from ivg_addon.blender.montage import Panel, write_montage  # noqa: E402
from ivg_addon.core.bake import bake  # noqa: E402
from ivg_addon.core.errors import GridFileError, SceneError, SettingsError  # noqa: E402
from ivg_addon.core.exr import read_exr  # noqa: E402
from ivg_addon.core.grid import IrradianceVectorGrid  # noqa: E402
from ivg_addon.core.picture import Picture, shade_steps  # noqa: E402
from ivg_addon.core.settings import BakeSettings  # noqa: E402

from ..core.steps import drain  # noqa: E402
from .cycles_scenes import furnace, lit_room, plain, snapshot  # noqa: E402
from .export_scenes import add_object, empty_scene, viewport_scene  # noqa: E402


def small_grid() -> IrradianceVectorGrid:
    """Return a quick bake of the current scene's box from the origin to (2, 2, 2)."""
    settings = BakeSettings((0.0,) * 3, (2.0,) * 3, (6, 6, 6), photons=200_000, bounces=4)
    return bake(viewport_scene(), settings).grid


def confetti() -> bpy.types.Scene:
    """Make a ball of 400 triangles of eight colours around the origin, and a camera that looks at it askew."""
    scene = empty_scene()
    rng = np.random.default_rng(3)
    corners = rng.normal(scale=1.2, size=(400, 1, 3)) + rng.normal(scale=0.3, size=(400, 3, 3))
    mesh = bpy.data.meshes.new("Confetti")
    mesh.from_pydata(corners.reshape(-1, 3).tolist(), [], np.arange(1200).reshape(-1, 3).tolist())
    for index in range(8):
        mesh.materials.append(plain(f"{index}", (0.2 + 0.6 * (index & 1), 0.1 + 0.1 * index, 0.9 - 0.2 * (index >> 1))))
    mesh.polygons.foreach_set("material_index", np.arange(400) % 8)
    add_object("Confetti", mesh)
    camera = bpy.data.cameras.new("Camera")
    scene.camera = add_object("Camera", camera, location=(3.0, -4.0, 2.5), rotation_euler=(1.1, 0.1, 0.6))
    scene.camera.scale = (2.0, 0.5, 3.0)
    scene.render.resolution_x, scene.render.resolution_y = 40, 24
    bpy.context.view_layer.update()
    return scene


def wide(scene: bpy.types.Scene) -> None:
    scene.camera.data.sensor_fit = "HORIZONTAL"
    scene.camera.data.sensor_width, scene.camera.data.lens = 24.0, 18.0


def tall(scene: bpy.types.Scene) -> None:
    scene.render.resolution_x, scene.render.resolution_y = 20, 44
    scene.camera.data.sensor_height = 30.0


def vertical(scene: bpy.types.Scene) -> None:
    scene.camera.data.sensor_fit, scene.camera.data.sensor_height = "VERTICAL", 12.0


def shifted(scene: bpy.types.Scene) -> None:
    scene.camera.data.shift_x, scene.camera.data.shift_y = 0.2, -0.15


def stretched(scene: bpy.types.Scene) -> None:
    scene.render.pixel_aspect_x, scene.render.pixel_aspect_y = 1.0, 1.7
    scene.camera.data.shift_y = 0.1


def orthographic(scene: bpy.types.Scene) -> None:
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 3.0
    scene.camera.data.shift_x = 0.1


def clipped(scene: bpy.types.Scene) -> None:
    scene.camera.data.clip_start, scene.camera.data.clip_end = 4.5, 6.0


def clipped_orthographic(scene: bpy.types.Scene) -> None:
    orthographic(scene)
    clipped(scene)


def half_size(scene: bpy.types.Scene) -> None:
    scene.render.resolution_percentage = 50


@pytest.mark.parametrize(
    "change",
    [wide, tall, vertical, shifted, stretched, orthographic, clipped, clipped_orthographic, half_size],
    ids=lambda change: change.__name__,
)
def test_both_look_through_the_same_camera(change: Callable[[bpy.types.Scene], None]) -> None:
    """Each pixel shows the same triangle at its centre, but where an edge passes by rounding.

    The first sample of each of Cycles' renders is a pixel's centre; here the renders have but one.
    """
    scene = confetti()
    change(scene)
    cycles, shaded = both_pictures(scene, filter_width=1e-6)
    assert shaded.color.shape == cycles.color.shape
    assert 0.1 < shaded.coverage.mean() < 1.0
    agree = np.abs(shaded.color - cycles.color).max(axis=-1) < 1e-3
    assert agree.mean() > 0.99


def both_pictures(
    scene: bpy.types.Scene, samples: int = 2, filter_width: float | None = None
) -> tuple[CyclesPicture, Picture]:
    """Return the camera's view by Cycles and by a grid, of which only the colours are of interest."""
    cycles = drain(render_steps(scene, bpy.context.view_layer, samples=samples))
    depsgraph = bpy.context.evaluated_depsgraph_get()
    arrays = viewport_scene()
    settings = BakeSettings((-3.0,) * 3, (3.0,) * 3, (1, 1, 1), photons=1000)
    dark = bake(replace(arrays, lights=replace(arrays.lights, world=np.ones(3, np.float32))), settings).grid
    hidden = hidden_from_camera(depsgraph)
    visible = np.array([name not in hidden for name in arrays.objects])
    camera = export_camera(depsgraph)
    camera = replace(camera, filter_width=filter_width or camera.filter_width)
    return cycles, drain(shade_steps(arrays, dark, camera, samples, visible=visible))


def test_the_pixel_filter_is_cycles_own() -> None:
    """Coverage of the pixels along the edge of a half-plane, which runs up the middle of the picture.

    Cycles' mean over 40 rows is known to its standard error, measured over the rows; six of them are allowed.
    """
    scene = empty_scene()
    mesh = bpy.data.meshes.new("Half")
    mesh.from_pydata([(0, -9, 0), (9, -9, 0), (9, 9, 0), (0, 9, 0)], [], [(0, 1, 2, 3)])
    mesh.materials.append(plain("White", (1.0, 1.0, 1.0)))
    add_object("Half", mesh)
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale = "ORTHO", 40.0
    scene.camera = add_object("Camera", camera, location=(0.3, 0.0, 5.0))
    scene.render.resolution_x = scene.render.resolution_y = 40
    for kind, width in (("BLACKMAN_HARRIS", 1.5), ("GAUSSIAN", 1.2), ("BOX", 2.0)):
        scene.cycles.pixel_filter_type, scene.cycles.filter_width = kind, width
        cycles, shaded = both_pictures(scene, samples=64)
        edge = slice(17, 23)
        expected, rows = shaded.color[12:28, edge, 0].mean(axis=0), cycles.color[12:28, edge, 0]
        error = rows.std(axis=0, ddof=1) / math.sqrt(len(rows))
        # One sample in each of Cycles' four renders goes to the pixel's very centre.
        assert (np.abs(rows.mean(axis=0) - expected) < 6 * error + 4 / 64).all(), kind


def test_objects_hidden_from_the_camera_are_in_neither_picture() -> None:
    scene = confetti()
    scene.objects["Confetti"].visible_camera = False
    cycles, shaded = both_pictures(scene)
    assert not cycles.color.any() and not shaded.color.any()


def test_cycles_picture_of_a_furnace() -> None:
    """Each pixel shows ρ L Σ ρ^b; half of the samples' noise is in the stated error, so six of them are allowed."""
    rho, radiance = np.array((0.5, 0.25, 0.75)), np.array((1.0, 2.0, 0.5))
    scene = furnace(tuple(rho), tuple(radiance))
    scene.camera = add_object("Camera", bpy.data.cameras.new("Camera"), location=(1.0, 1.0, 1.0))
    scene.render.resolution_x = scene.render.resolution_y = 16
    picture = drain(render_steps(scene, bpy.context.view_layer, samples=64, bounces=3))
    truth = rho * radiance * (rho + rho**2 + rho**3)
    error = np.sqrt((picture.error.astype(float) ** 2).sum(axis=(0, 1))) / 256
    assert (np.abs(picture.light.mean(axis=(0, 1)) - truth) < 6 * error).all()
    everything = drain(render_steps(scene, bpy.context.view_layer, samples=16, bounces=3, include_direct=True))
    np.testing.assert_allclose(everything.light.mean(axis=(0, 1)), truth + rho * radiance, rtol=0.05)


@pytest.fixture
def room(tmp_path: Path) -> Iterator[tuple[bpy.types.Scene, IrradianceVectorGrid, Path]]:
    scene = lit_room()
    yield scene, small_grid(), tmp_path / "room.png"


def test_a_comparison_leaves_a_picture_layers_and_numbers(
    room: tuple[bpy.types.Scene, IrradianceVectorGrid, Path],
) -> None:
    scene, grid, output = room
    before = snapshot(scene)
    found = drain(compare_steps(scene, bpy.context.view_layer, grid, output))
    assert snapshot(scene) == before
    assert found.samples == 8
    # A coarse guard: what is off by a factor of π, 2 or a colour fails.
    assert 0.9 < found.agreement.energy_ratio < 1.1
    assert found.agreement.own_rmse < 0.5
    layers = read_exr(output.with_suffix(".exr"))
    assert {name.split(".")[0] for name in layers} == {"Cycles", "Grid", "Difference", "Noise"}
    grid_light, cycles_light = layers["Grid.Combined.G"], layers["Cycles.Combined.G"]
    np.testing.assert_allclose(layers["Difference.Combined.G"], grid_light - cycles_light, atol=1e-6)
    assert grid_light.shape == (32, 48)
    assert sorted(path.name for path in output.parent.iterdir()) == ["room.exr", "room.png"]
    words = dict(found.rows())
    assert words["Samples"].startswith("8 a pixel") and "RMSE" in words["Error"]
    assert found.notices == ()


def test_the_files_open_in_blender(room: tuple[bpy.types.Scene, IrradianceVectorGrid, Path]) -> None:
    scene, grid, output = room
    drain(compare_steps(scene, bpy.context.view_layer, grid, output))
    picture = bpy.data.images.load(str(output))
    width, height = picture.size
    assert width > 3 * 400 and height > 300
    # The heading is there, bright on dark.
    heading = read_pixels(picture)[int(0.9 * height) :, : width // 3]
    assert heading.max() > 0.8 and np.median(heading) < 0.2
    layers = bpy.data.images.load(str(output.with_suffix(".exr")))
    assert tuple(layers.size) == (0, 0)  # which makes Blender read it; Python gets no pixels of a layered image
    assert layers.type == "MULTILAYER"
    node = bpy.data.node_groups.new("Layers", "CompositorNodeTree").nodes.new("CompositorNodeImage")
    node.image = layers
    for name in ("Cycles", "Grid", "Difference", "Noise"):
        node.layer = name  # raises where there is no such layer


def test_random_points(room: tuple[bpy.types.Scene, IrradianceVectorGrid, Path]) -> None:
    scene, grid, _ = room
    before = snapshot(scene)
    found = drain(compare_points_steps(scene, bpy.context.view_layer, grid, 100, samples=64))
    assert snapshot(scene) == before
    for agreement in (found.free_space, found.surfaces):
        assert agreement.count == 300
        assert 0.9 < agreement.energy_ratio < 1.1  # the same coarse guard
        assert agreement.own_rmse < 0.5
    assert dict(found.rows())["Points"].startswith("100 in free space")


def test_what_was_baked_with_direct_light_is_compared_with_direct_light(tmp_path: Path) -> None:
    scene = lit_room()
    settings = BakeSettings((0.0,) * 3, (2.0,) * 3, (6, 6, 6), photons=200_000, bounces=4, include_direct=True)
    grid = bake(viewport_scene(), settings).grid
    found = drain(compare_points_steps(scene, bpy.context.view_layer, grid, 100, samples=64))
    assert 0.8 < found.free_space.energy_ratio < 1.25
    seen = drain(compare_steps(scene, bpy.context.view_layer, grid, tmp_path / "all.png"))
    assert 0.8 < seen.agreement.energy_ratio < 1.25


def test_a_scene_that_changed_since_and_depth_of_field_are_told(
    room: tuple[bpy.types.Scene, IrradianceVectorGrid, Path],
) -> None:
    scene, grid, output = room
    bpy.data.objects["Block"].location.x += 0.2
    scene.camera.data.dof.use_dof = True
    bpy.context.view_layer.update()
    found = drain(compare_steps(scene, bpy.context.view_layer, grid, output))
    told = "\n".join(map(str, found.notices))
    assert "not as it was baked" in told and "depth of field" in told
    assert scene.camera.data.dof.use_dof


def test_closing_it_early_changes_nothing(room: tuple[bpy.types.Scene, IrradianceVectorGrid, Path]) -> None:
    scene, grid, output = room
    before = snapshot(scene)
    steps = compare_steps(scene, bpy.context.view_layer, grid, output)
    for progress in steps:
        if progress is not None and "Cycles" in progress.task and progress.fraction > 0.3:
            break
    steps.close()
    assert snapshot(scene) == before
    assert not list(output.parent.iterdir())


@pytest.mark.parametrize(
    ("name", "error", "message"),
    [
        ("nowhere/room.png", GridFileError, "cannot write"),
        ("", GridFileError, "is a folder"),
        ("room.jpg", SettingsError, "does not end in .png"),
    ],
)
def test_pictures_that_cannot_be_written_fail_before_anything_is_computed(
    tmp_path: Path, name: str, error: type[Exception], message: str
) -> None:
    scene = lit_room()
    with pytest.raises(error, match=message):
        next(compare_steps(scene, bpy.context.view_layer, None, tmp_path / name))


def no_camera(scene: bpy.types.Scene) -> None:
    scene.camera = None


def panoramic(scene: bpy.types.Scene) -> None:
    scene.camera.data.type = "PANO"


def a_lamp(scene: bpy.types.Scene) -> None:
    scene.camera = bpy.data.objects["Lamp"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (no_camera, "'Room' has no camera"),
        (panoramic, "camera 'Camera' is of the type pano"),
        (a_lamp, "'Lamp' serves"),
    ],
)
def test_cameras_that_are_not_supported_are_named(
    change: Callable[[bpy.types.Scene], None], message: str, tmp_path: Path
) -> None:
    scene = lit_room()
    change(scene)
    with pytest.raises(SceneError, match=message):
        drain(compare_steps(scene, bpy.context.view_layer, None, tmp_path / "room.png"))


def test_a_view_of_nothing_is_told(room: tuple[bpy.types.Scene, IrradianceVectorGrid, Path]) -> None:
    scene, grid, output = room
    scene.camera.location = (9.0, 9.0, 9.0)
    scene.camera.rotation_euler = (math.pi, 0.0, 0.0)
    bpy.context.view_layer.update()
    with pytest.raises(SceneError, match="sees no surface"):
        drain(compare_steps(scene, bpy.context.view_layer, grid, output))


def test_light_is_shown_through_the_scenes_colour_management() -> None:
    """As sRGB encodes it, one stop brighter."""
    scene = empty_scene()
    scene.view_settings.view_transform, scene.view_settings.exposure = "Standard", 1.0
    light = np.array([[[0.0, 0.05, 0.1], [0.2, 0.4, 2.0]]], dtype=np.float32)
    before = snapshot(scene)
    linear = np.clip(2.0 * light, 0.0, 1.0)
    srgb = np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(display_pixels(light, scene), srgb, atol=1e-3)
    assert snapshot(scene) == before


def test_the_montage_shows_panels_as_they_are(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    pixels = rng.uniform(size=(4, 400, 3))
    panels = [Panel("A", "a", pixels), Panel("B", "b", 1.0 - pixels)]
    write_montage(tmp_path / "m.png", "Heading", "so and so", panels, ("one", "two"))
    shown = read_pixels(bpy.data.images.load(str(tmp_path / "m.png")))
    lefts = [left for left in range(60) if found_at(shown[:, left : left + 400], pixels)]
    assert len(lefts) == 1
    rest = shown[:, lefts[0] + 400 :]
    assert any(found_at(rest[:, gap : gap + 400], 1.0 - pixels) for gap in range(60))


def found_at(strip: np.ndarray, pixels: np.ndarray) -> bool:
    """Tell whether some rows of a strip of a picture are these pixels, but for rounding to bytes."""
    windows = np.lib.stride_tricks.sliding_window_view(strip, len(pixels), axis=0).transpose(0, 3, 1, 2)
    return bool((np.abs(windows - pixels).max(axis=(1, 2, 3)) <= 0.5 / 255 + 1e-6).any())


def test_unwritable_files_are_named(tmp_path: Path) -> None:
    panels = [Panel("A", "a", np.zeros((4, 400, 3)))]
    with pytest.raises(GridFileError, match="nowhere"):
        write_montage(tmp_path / "nowhere" / "m.png", "", "", panels, ())


def test_the_map_of_differences_is_smoothed_where_noise_would_hide_it() -> None:
    light = np.ones((9, 9, 3), np.float32)
    cycles = CyclesPicture(light, 0.0 * light, light, 1, 0.0)
    shaded = Picture(1.1 * light, light, light[..., 0])
    fine, coarse = (comparing._difference_panel(shaded, cycles, noise) for noise in (0.01, 0.3))
    assert "smoothed" not in fine.note and "7 × 7" in coarse.note
    np.testing.assert_allclose(fine.pixels, coarse.pixels, atol=1e-6)
    assert (fine.pixels[..., 0] > fine.pixels[..., 2]).all()
    assert fine.scale_labels == ("−10%: too dark", "0", "+10%: too bright")
