# SPDX-License-Identifier: GPL-3.0-or-later
"""OpenEXR files of named float channels: the only file that knows the OpenEXR library.

Blender hands out the pixels of a render's passes only as a layered file, and its own reader gives Python no pixels of
such a file.
"""

from __future__ import annotations

import tempfile
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
        "or `pip install openexr` for this Python"
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
    rows_down = {name: np.ascontiguousarray(pixels[::-1], dtype=np.float32) for name, pixels in channels.items()}
    try:
        with OpenEXR.File(header, rows_down) as file:
            file.write(str(path))
    except (OSError, RuntimeError) as error:
        raise GridFileError(
            f"cannot write {path} ({error}): choose a folder that exists, is writable and has space"
        ) from error


def exr_bytes(channels: Mapping[str, Float32]) -> bytes:
    """Return an image as the bytes of its file; arguments and errors as of `write_exr`."""
    with tempfile.TemporaryDirectory(prefix="ivg-") as folder:
        path = Path(folder, "image.exr")
        write_exr(path, channels)
        return path.read_bytes()


def read_exr(path: Path) -> dict[str, Float32]:
    """Return the channels of an image by name, each (height, width) float32, first row at the bottom.

    Raises
    ------
    GridFileError
        The file is missing or damaged.
    """
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            return {
                name: np.ascontiguousarray(channel.pixels[::-1], dtype=np.float32)
                for part in file.parts
                for name, channel in part.channels.items()
            }
    except (OSError, RuntimeError) as error:
        raise GridFileError(f"cannot read {path} ({error}): check that it is a whole OpenEXR file") from error
