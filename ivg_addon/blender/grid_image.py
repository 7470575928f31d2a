# SPDX-License-Identifier: GPL-3.0-or-later
"""A grid as an image datablock (docs/file-format.md, "The image in a .blend").

The pixels are what shaders look up (core/grid_atlas.py), packed as 32-bit floats. The grid itself, to the bit, is in
the image's custom properties, array by array: so it survives saving, appending and linking, and pixels that somebody
changed can be made anew from it.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core.checksum import checksum
from ..core.errors import GridFileError, SettingsError
from ..core.grid import BakeRecord, IrradianceVectorGrid
from ..core.grid_parts import arrays, assemble, digest, header, parse_header
from ..core.memory import human
from ..core.settings import Spatial
from .bounds import Box
from .marks import KEY, bears

VOLUME = "volume"
"""Under `KEY`: the volume datablock (grid_volume.py)."""
FORMAT = "irradiance-vector-grid-image"
VERSION = 2
"""Of the layout; version 1 is the same for a grid without thin walls, and has none of what is told of them."""
_KNOWN = (1, VERSION)
RESTORE = "press Restore in the panel, or run bpy.ops.ivg.restore()"
"""The cure of whatever was done to the datablocks, not to the grid."""

_LARGEST_PROPERTY = 2**31 - 1
"""Bytes that Blender counts in 32 bits."""


@dataclass(frozen=True)
class PreparedImage:
    """All that an image datablock is made of; prepared apart from Blender, on any thread.

    Parameters
    ----------
    exr
        The pixels' file.
    size
        Width and height.
    properties
        What goes under `KEY`.
    """

    exr: bytes
    size: tuple[int, int]
    properties: dict[str, Any]


def prepare(grid: IrradianceVectorGrid, spatial: Spatial = Spatial.TRILINEAR) -> PreparedImage:
    """Return what the image of a grid is made of; touches nothing of Blender, compiles kernels.

    Parameters
    ----------
    spatial
        How shaders are to interpolate.

    Raises
    ------
    SettingsError
        The grid is too large for an image, or for a .blend.
    """
    from ..core.exr import exr_bytes
    from ..core.grid_atlas import atlas, layout, most_walls

    where = layout(grid.resolution, most_walls(grid))
    largest = max(array.nbytes for array in arrays(grid).values())
    if largest > _LARGEST_PROPERTY:
        raise SettingsError(f"{human(largest)} of vectors are more than a .blend keeps in one place: bake fewer voxels")
    pixels = atlas(grid, spatial)
    exr = exr_bytes({channel: pixels[..., index] for index, channel in enumerate("RGB")})
    if len(exr) > _LARGEST_PROPERTY:
        raise SettingsError(f"{human(len(exr))} of pixels are more than a .blend keeps in one place: bake fewer voxels")
    told = header(grid.lattice, grid.record)
    return PreparedImage(
        exr=exr,
        size=where.size,
        properties={
            "format": FORMAT,
            # Without walls older versions of this program read it too.
            "version": VERSION if where.walls else 1,
            "bounds_min": told["bounds_min"],
            "bounds_max": told["bounds_max"],
            "resolution": told["resolution"],
            "record": json.dumps(told["record"]),
            "grid_digest": digest(grid),
            "spatial": str(spatial),
            "size": where.size,
            "across": where.across,
            "walls": where.walls,
            "pixel_digest": checksum(pixels),
            "arrays": {
                name: {"dtype": array.dtype.str, "shape": array.shape, "bytes": array.tobytes()}
                for name, array in arrays(grid).items()
            },
        },
    )


def put(prepared: PreparedImage, name: str, image: bpy.types.Image | None = None) -> bpy.types.Image:
    """Store a grid in an image, a new one unless one is given, whose users then see the new grid; its volume stays."""
    volume = image[KEY].get(VOLUME) if image is not None else None
    if image is None:
        image = bpy.data.images.new(name, *prepared.size, alpha=False, float_buffer=True, is_data=True)
    image.pack(data=prepared.exr, data_len=len(prepared.exr))
    image.source = "FILE"
    image.colorspace_settings.name = "Non-Color"
    image.alpha_mode = "NONE"
    # Otherwise EEVEE rounds texels to 11 bits.
    image.use_half_precision = False
    # Blender does not save what nothing uses.
    image.use_fake_user = True
    image[KEY] = prepared.properties
    if volume is not None:
        image[KEY][VOLUME] = volume
    return image


def is_grid(image: bpy.types.Image) -> bool:
    """Tell whether a bake stored a grid in an image, in this version's layout or another."""
    return bears(image, FORMAT)


def box(image: bpy.types.Image) -> Box:
    """Return the box of a stored grid."""
    return Box.between(image[KEY]["bounds_min"], image[KEY]["bounds_max"])


def spatial(image: bpy.types.Image) -> Spatial:
    """Return the interpolation that a stored grid's pixels are for."""
    return Spatial(image[KEY]["spatial"])


def scene_grid(scene: bpy.types.Scene) -> bpy.types.Image:
    """Return the image of a scene's grid; raises `GridFileError` if it has none in the .blend."""
    if scene.ivg.grid is None:
        raise GridFileError(f"scene '{scene.name}' has no grid in the .blend: bake it, or choose one")
    return scene.ivg.grid


def named(image: bpy.types.Image) -> str:
    """Return an image's name for messages, with the file that it is linked from."""
    return f"image '{image.name}'" + (f" of {image.library.filepath}" if image.library else "")


def version_problem(image: bpy.types.Image) -> str:
    """Return why this version cannot use what is stored in an image; empty if it can."""
    if not is_grid(image):
        return f"{named(image)} holds no irradiance vector grid: choose one that a bake has stored"
    version = image[KEY].get("version")
    if version in _KNOWN:
        return ""
    if isinstance(version, int) and version > VERSION:
        return (
            f"{named(image)} was stored by a newer Irradiance Vector Grid (layout {version}, this version has "
            f"{VERSION}): update the extension, or bake a grid of another name"
        )
    return f"{named(image)} has no layout that is known ({version!r}): remove it, and bake again"


def problem(image: bpy.types.Image) -> str:
    """Return what was done to an image, and the cure, as far as can be told at once; empty if nothing."""
    wrong = version_problem(image)
    if wrong:
        return wrong
    expected = tuple(image[KEY].get("size", ()))
    cure = f"open {image.library.filepath} and {RESTORE}" if image.library else RESTORE
    if image.packed_file is None:
        return f"{named(image)} is no longer packed in the .blend: {cure}"
    if tuple(image.size) != expected:
        width, height = image.size
        return f"{named(image)} has {width} × {height} pixels, not those of its grid: {cure}"
    if image.is_dirty:
        return f"{named(image)} was painted on or changed: {cure}"
    if image.use_half_precision or image.colorspace_settings.name != "Non-Color" or image.alpha_mode != "NONE":
        return f"{named(image)} is read with other settings, as a picture and not as numbers: {cure}"
    return ""


def pixel_problem(image: bpy.types.Image) -> str:
    """Return what was done to an image's pixels, and the cure; reads all of them."""
    wrong = problem(image)
    if wrong:
        return wrong
    width, height = image.size
    pixels = np.empty(width * height * 4, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    rgb = np.ascontiguousarray(pixels.reshape(height, width, 4)[..., :3])
    if checksum(rgb) != image[KEY].get("pixel_digest"):
        return f"{named(image)} was painted on or changed: {RESTORE}"
    return ""


def record(image: bpy.types.Image) -> BakeRecord:
    """Return how the stored grid came to be; raises `GridFileError`."""
    return parse_header(_header(image), named(image))[1]


def read(image: bpy.types.Image) -> IrradianceVectorGrid:
    """Return the stored grid, whatever became of the pixels; raises `GridFileError`."""
    wrong = version_problem(image)
    if wrong:
        raise GridFileError(wrong)
    lattice, came_from = parse_header(_header(image), named(image))
    try:
        parts = {name: _array(stored) for name, stored in image[KEY]["arrays"].items()}
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise GridFileError(f"{named(image)} has damaged properties ({error}): bake it again") from error
    return assemble(lattice, came_from, parts, named(image))


def _array(stored: Any) -> NDArray[Any]:
    return np.frombuffer(stored["bytes"], dtype=stored["dtype"]).reshape(tuple(stored["shape"])).copy()


def _header(image: bpy.types.Image) -> dict[str, Any]:
    """Return where the grid lies and how it came to be."""
    stored = image[KEY]
    try:
        corners = {name: tuple(stored[name]) for name in ("bounds_min", "bounds_max", "resolution")}
        return corners | {"record": json.loads(stored["record"])}
    except (KeyError, TypeError, ValueError) as error:
        raise GridFileError(f"{named(image)} has damaged properties ({error}): bake it again") from error
