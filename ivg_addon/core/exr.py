"""OpenEXR files of named float channels, by the format's own library.

Blender hands out the pixels of a render's passes only as a file, and its own reader of layered files
gives Python no pixels.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from .errors import DependencyError, GridFileError
from .scene import Float32

try:
    import OpenEXR
except Exception as error:  # a missing shared library raises OSError or ImportError
    raise DependencyError(
        f"OpenEXR does not load ({error}): reinstall the extension for this Blender, "
        "or `pip install OpenEXR` for this Python"
    ) from error


def write_exr(path: Path, channels: Mapping[str, Float32]) -> None:
    """Write an image.

    Parameters
    ----------
    path
        The file; replaced if it exists.
    channels
        Name, such as ``Grid.Combined.R``, to (height, width) float32, first row at the bottom. All of the same
        shape.

    Raises
    ------
    GridFileError
        The file cannot be written.
    """
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    pixels = {name: np.ascontiguousarray(image[::-1], dtype=np.float32) for name, image in channels.items()}
    try:
        with OpenEXR.File(header, pixels) as file:
            file.write(str(path))
    except (OSError, RuntimeError) as error:
        raise GridFileError(
            f"cannot write {path} ({error}): choose a folder that exists, is writable and has space"
        ) from error


def read_exr(path: Path) -> dict[str, Float32]:
    """Return the channels of an image by name, each (height, width) float32, first row at the bottom.

    Raises
    ------
    GridFileError
        The file is missing, truncated or of a kind that is not read here.
    """
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            return {
                name: np.ascontiguousarray(channel.pixels[::-1], dtype=np.float32)
                for name, channel in file.channels().items()
            }
    except (OSError, RuntimeError, ValueError) as error:
        raise GridFileError(f"cannot read {path} ({error}): check that it exists and is an OpenEXR image") from error
