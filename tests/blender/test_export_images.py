# SPDX-License-Identifier: GPL-3.0-or-later
"""Image textures against Cycles: what it bakes at given texture coordinates is what kernels look up."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest

from ivg_addon.blender import export_images
from ivg_addon.core.scene import Scene
from tests.blender.export_scenes import (
    add_object,
    bake_diffuse_colour,
    diffuse_of,
    empty_scene,
    exported_albedo,
    new_material,
    quads_with_uvs,
    viewport_scene,
)

WIDTH, HEIGHT = 5, 3
UVS = np.random.default_rng(11).uniform(-1.7, 2.6, (120, 2))
MAGENTA = (1.0, 0.0, 1.0)

ROUNDING = 2e-5
"""float32, and Cycles' approximation of the sRGB curve."""
ALPHA_STEP = 2.3 / 255
"""Cycles multiplies bytes by alpha and cuts off the fraction: one step, by the largest slope of the sRGB curve."""
HALF_STEP = 2.0**-11
"""Half of the last digit of a half float below 1."""


def pixels(alpha: str) -> np.ndarray:
    rgba = np.random.default_rng(5).random((HEIGHT, WIDTH, 4)).astype(np.float32)
    if alpha == "opaque":
        rgba[..., 3] = 1
    if alpha == "associated":
        rgba[..., :3] *= rgba[..., 3:]
    return rgba


def generated(alpha: str, is_float: bool = False, space: str = "sRGB", mode: str = "STRAIGHT") -> bpy.types.Image:
    image = bpy.data.images.new("Picture", WIDTH, HEIGHT, alpha=True, float_buffer=is_float)
    image.colorspace_settings.name = space
    image.alpha_mode = mode
    image.pixels.foreach_set(pixels(alpha).ravel())
    image.update()
    return image


def from_file(
    folder: Path, alpha: str, file_format: str, space: str, mode: str, depth: str = "8", channels: str = "RGBA"
) -> bpy.types.Image:
    """Return an image loaded from a file, saved without any conversion of colours."""
    image = generated(alpha, is_float=file_format == "OPEN_EXR" or depth == "16", space="Non-Color")
    path = folder / f"picture.{'exr' if file_format == 'OPEN_EXR' else 'png'}"
    settings = bpy.context.scene.render.image_settings
    settings.file_format, settings.color_depth, settings.color_mode = file_format, depth, channels
    bpy.context.scene.view_settings.view_transform = "Raw"
    image.save_render(str(path), scene=bpy.context.scene)
    loaded = bpy.data.images.load(str(path))
    loaded.colorspace_settings.name = space
    loaded.alpha_mode = mode
    return loaded


def show(image: bpy.types.Image | None, interpolation: str = "Linear", extension: str = "REPEAT") -> bpy.types.Object:
    def colour(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
        node = tree.nodes.new("ShaderNodeTexImage")
        node.image, node.interpolation, node.extension = image, interpolation, extension
        return node.outputs["Color"]

    mesh = quads_with_uvs(UVS)
    mesh.materials.append(new_material("Painted", diffuse_of(colour)))
    return add_object("Quads", mesh)


def messages(scene: Scene, subject: str) -> list[str]:
    return [f"{notice.kind}: {notice.message}" for notice in scene.notices if notice.subject == subject]


def compare(shown: bpy.types.Object, tolerance: float) -> None:
    want = np.clip(bake_diffuse_colour(shown)[::4], 0, 1)  # no surface here reflects more
    got = exported_albedo(viewport_scene())[::2]
    np.testing.assert_allclose(got, want, rtol=0, atol=tolerance)
    assert np.ptp(want) > 0.1, "the image shows something"


@pytest.mark.parametrize("extension", ["REPEAT", "EXTEND", "CLIP", "MIRROR"])
@pytest.mark.parametrize("interpolation", ["Linear", "Closest"])
def test_interpolation_and_extension(interpolation: str, extension: str) -> None:
    empty_scene()
    compare(show(generated("opaque"), interpolation, extension), ROUNDING)


@pytest.mark.parametrize(
    ("alpha", "is_float", "space", "mode", "tolerance"),
    [
        ("any", False, "sRGB", "STRAIGHT", ALPHA_STEP),
        ("any", False, "sRGB", "CHANNEL_PACKED", ROUNDING),
        ("any", False, "sRGB", "NONE", ROUNDING),
        ("any", False, "Non-Color", "STRAIGHT", ROUNDING),
        ("opaque", False, "Linear Rec.709", "STRAIGHT", ROUNDING),
        ("opaque", True, "Linear Rec.709", "STRAIGHT", ROUNDING),
        ("opaque", True, "sRGB", "STRAIGHT", ROUNDING),
        ("associated", True, "Linear Rec.709", "PREMUL", ROUNDING),
    ],
)
def test_generated_images(alpha: str, is_float: bool, space: str, mode: str, tolerance: float) -> None:
    empty_scene()
    compare(show(generated(alpha, is_float, space, mode)), tolerance)


@pytest.mark.parametrize(
    ("alpha", "file_format", "space", "mode", "depth", "channels", "tolerance"),
    [
        ("any", "PNG", "sRGB", "STRAIGHT", "8", "RGBA", ALPHA_STEP),
        ("any", "PNG", "Non-Color", "STRAIGHT", "8", "RGBA", ROUNDING),
        ("opaque", "PNG", "sRGB", "STRAIGHT", "8", "RGB", ROUNDING),
        ("opaque", "PNG", "sRGB", "STRAIGHT", "8", "BW", ROUNDING),
        ("opaque", "PNG", "sRGB", "STRAIGHT", "16", "RGB", ROUNDING),
        ("opaque", "PNG", "Non-Color", "STRAIGHT", "16", "RGB", ROUNDING),
        ("associated", "OPEN_EXR", "Linear Rec.709", "PREMUL", "32", "RGBA", ROUNDING),
        ("opaque", "OPEN_EXR", "Linear Rec.709", "PREMUL", "16", "RGB", HALF_STEP),
        ("opaque", "OPEN_EXR", "sRGB", "PREMUL", "32", "RGB", ROUNDING),
        ("opaque", "OPEN_EXR", "ACEScg", "PREMUL", "32", "RGB", ROUNDING),
    ],
)
@pytest.mark.parametrize("packed", [False, True])
def test_image_files(
    tmp_path: Path,
    alpha: str,
    file_format: str,
    space: str,
    mode: str,
    depth: str,
    channels: str,
    tolerance: float,
    packed: bool,
) -> None:
    empty_scene()
    image = from_file(tmp_path, alpha, file_format, space, mode, depth, channels)
    if packed:
        image.pack()
    compare(show(image), tolerance)


def test_missing_image_is_magenta_as_in_cycles() -> None:
    empty_scene()
    image = bpy.data.images.new("Lost", 4, 4)
    image.source, image.filepath = "FILE", "/nowhere/lost.png"
    shown = show(image)
    np.testing.assert_allclose(bake_diffuse_colour(shown)[::4], [MAGENTA] * len(UVS), atol=1e-6)
    scene = viewport_scene()
    np.testing.assert_allclose(exported_albedo(scene), [MAGENTA] * len(scene.geometry.triangles))
    assert messages(scene, "image 'Lost'") == ["warning: cannot be read (/nowhere/lost.png): magenta, as in Cycles"]


def test_node_without_image_is_magenta_as_in_cycles() -> None:
    empty_scene()
    shown = show(None)
    np.testing.assert_allclose(bake_diffuse_colour(shown)[::4], [MAGENTA] * len(UVS), atol=1e-6)
    scene = viewport_scene()
    np.testing.assert_allclose(exported_albedo(scene), [MAGENTA] * len(scene.geometry.triangles))
    assert messages(scene, "material 'Painted'") == [
        "warning: Color: an Image Texture node has no image: magenta, as in Cycles"
    ]


def test_one_texture_for_all_that_read_it_alike() -> None:
    empty_scene()
    image = generated("opaque")
    for height, interpolation in enumerate(("Linear", "Linear", "Closest")):
        show(image, interpolation).location.z = height
    scene = viewport_scene()
    assert len(scene.textures) == 2
    assert sorted(scene.materials.texture) == [0, 0, 1]


def test_file_is_not_kept_in_memory(tmp_path: Path) -> None:
    empty_scene()
    image = from_file(tmp_path, "opaque", "PNG", "sRGB", "STRAIGHT")
    image.buffers_free()
    show(image)
    assert len(viewport_scene().textures) == 1
    assert not image.has_data


@pytest.mark.parametrize("is_float", [False, True])
def test_large_images_are_averaged(monkeypatch: pytest.MonkeyPatch, is_float: bool) -> None:
    empty_scene()
    image = generated("opaque", is_float)
    use = export_images.ImageUse(image, True, "REPEAT", "")
    whole = export_images.ImageTable().mean(use)
    monkeypatch.setattr(export_images, "LARGEST", 4)
    table = export_images.ImageTable()
    index = table.texture(use)
    texture = table.textures[index]
    assert texture.pixels.shape == (2, 3, 3)
    assert [str(notice) for notice in table.notices] == ["simplified: image 'Picture': 5 × 3 pixels averaged to 3 × 2"]
    # Columns of 2, 2 and 1 texels, rows of 2 and 1: weighted so, the mean is kept.
    linear = texture.pixels
    if texture.encoded:
        linear = np.where(linear <= 0.04045, linear / 12.92, ((linear + 0.055) / 1.055) ** 2.4)
    weights = np.outer([2, 1], [2, 2, 1])
    np.testing.assert_allclose(np.einsum("ij,ijk->k", weights, linear) / 15, whole, rtol=1e-5)


def test_pixels_that_are_not_numbers_are_black() -> None:
    empty_scene()
    image = generated("opaque", is_float=True, space="Linear Rec.709")
    values = pixels("opaque")
    values[0, 0, 0], values[1, 1, 2] = np.nan, np.inf
    image.pixels.foreach_set(values.ravel())
    show(image)
    scene = viewport_scene()
    assert np.isfinite(scene.textures[0].pixels).all()
    assert messages(scene, "image 'Picture'") == ["warning: has pixels that are not numbers: taken as black"]


def test_other_colour_spaces_are_named() -> None:
    empty_scene()
    show(generated("opaque", space="AgX Log"))
    assert messages(viewport_scene(), "image 'Picture'") == ["simplified: colour space 'AgX Log' taken as sRGB"]


def test_reflectance_above_one_is_named() -> None:
    empty_scene()
    image = generated("opaque", is_float=True, space="Linear Rec.709")
    image.pixels.foreach_set((3 * pixels("opaque")).ravel())
    show(image)
    assert any("above 1" in message for message in messages(viewport_scene(), "material 'Painted'"))


def test_only_the_first_of_several_udim_tiles_is_used() -> None:
    empty_scene()
    image = bpy.data.images.new("Tiles", 4, 4, tiled=True)
    image.tiles.new(1002)
    show(image)
    assert messages(viewport_scene(), "image 'Tiles'")[0] == "simplified: only tile 1001 of its UDIM tiles is used"
