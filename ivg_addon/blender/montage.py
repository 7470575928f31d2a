# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures side by side, with captions: what a comparison leaves to be looked at."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import blf
import bpy
import imbuf
import numpy as np
from numpy.typing import NDArray

from ..core.errors import GridFileError, SettingsError
from .cycles_stage import removed

Float64 = NDArray[np.float64]

_FONT = 0
"""Blender's own interface font."""
_LEAST_WIDTH = 400
"""Smaller pictures are shown with whole pixels repeated."""

_BACKGROUND = (0.105, 0.105, 0.115)
_BRIGHT = (0.95, 0.95, 0.95)
_DIM = (0.62, 0.62, 0.65)


@dataclass(frozen=True)
class Panel:
    """One picture.

    Parameters
    ----------
    title, note
        What it is, and one line about it.
    pixels : (height, width, 3)
        Display values in [0, 1], first row at the bottom.
    scale : (n, 3), optional
        Colours of a scale below the picture, from left to right.
    scale_labels
        What stands at the scale's left end, middle and right end.
    """

    title: str
    note: str
    pixels: Float64
    scale: Float64 | None = None
    scale_labels: tuple[str, str, str] = ("", "", "")


@dataclass(frozen=True)
class _Text:
    """A line of text: baseline position in pixels from the bottom left, and where in the line that position is."""

    text: str
    x: float
    y: float
    size: float
    color: tuple[float, float, float]
    most_width: float
    anchor: float = 0.0


def check_picture(output: Path) -> Path:
    """Return where the EXR goes; raises `GridFileError` if either file cannot be written, `SettingsError` if no PNG."""
    from ..core.whole_file import check_writable

    if output.is_dir():
        raise GridFileError(f"{output} is a folder: name a picture in it, for instance {output / 'compare.png'}")
    if output.suffix.lower() != ".png":
        raise SettingsError(f"{output} does not end in .png: the picture is a PNG, with an EXR beside it")
    layers = output.with_suffix(".exr")
    for path in (output, layers):
        check_writable(path)
    return layers


def write_montage(path: Path, heading: str, subheading: str, panels: Sequence[Panel], footer: Sequence[str]) -> None:
    """Write panels of equal size side by side as a PNG, with a heading above and lines of text below.

    Raises
    ------
    GridFileError
        The file cannot be written.
    """
    height, width, _ = panels[0].pixels.shape
    repeat = max(1, -(-_LEAST_WIDTH // width))
    height, width = height * repeat, width * repeat
    unit = max(15.0, min(width / 24.0, 48.0))  # size of ordinary text, from which all distances follow
    margin, gap = round(1.6 * unit), round(1.1 * unit)
    head, under, foot = round(7.0 * unit), round(2.6 * unit), round(1.7 * unit * len(footer) + 0.6 * unit)
    total_width = 2 * margin + len(panels) * width + (len(panels) - 1) * gap
    total_height = head + height + under + foot
    canvas = np.empty((total_height, total_width, 3))
    canvas[:] = _BACKGROUND
    inner = total_width - 2 * margin
    top = total_height
    texts = [
        _Text(heading, margin, top - 2.5 * unit, 1.6 * unit, _BRIGHT, 0.5 * inner),
        _Text(subheading, total_width - margin, top - 2.5 * unit, unit, _DIM, 0.48 * inner, anchor=1.0),
    ]
    bottom = foot + under
    for index, panel in enumerate(panels):
        left = margin + index * (width + gap)
        canvas[bottom : bottom + height, left : left + width] = np.kron(panel.pixels, np.ones((repeat, repeat, 1)))
        base = bottom + height
        texts.append(_Text(panel.title, left, base + 2.1 * unit, 1.15 * unit, _BRIGHT, width))
        texts.append(_Text(panel.note, left, base + 0.65 * unit, 0.88 * unit, _DIM, width))
        if panel.scale is not None:
            texts += _draw_scale(canvas, panel, left, bottom, width, unit)
    for index, line in enumerate(footer):
        y = foot - 0.7 * unit - 1.7 * unit * index
        texts.append(_Text(line, margin, y, 1.1 * unit if index == 0 else unit, _DIM if index else _BRIGHT, inner))
    _write(path, canvas, texts)


def _draw_scale(canvas: Float64, panel: Panel, left: int, bottom: int, width: int, unit: float) -> list[_Text]:
    """Draw a panel's scale of colours below it, and return its labels."""
    assert panel.scale is not None
    high = bottom - round(0.45 * unit)
    low = high - round(0.5 * unit)
    column = np.arange(width) * len(panel.scale) // width
    canvas[low:high, left : left + width] = panel.scale[column]
    y = low - 1.0 * unit
    return [
        _Text(label, left + anchor * width, y, 0.85 * unit, _DIM, width / 2.0, anchor)
        for label, anchor in zip(panel.scale_labels, (0.0, 0.5, 1.0), strict=True)
    ]


def _write(path: Path, canvas: Float64, texts: Sequence[_Text]) -> None:
    """Write a canvas with texts drawn into it."""
    with tempfile.TemporaryDirectory(prefix="ivg-") as folder:
        bare = Path(folder, "bare.png")
        with removed(bpy.data.images, lambda: _image(canvas)) as image:
            image.filepath_raw, image.file_format = str(bare), "PNG"
            image.save()
        buffer = imbuf.load(str(bare))
        try:
            with blf.bind_imbuf(_FONT, buffer, display_name="sRGB"):
                for text in texts:
                    _draw(text)
            fresh = path.with_name(f".{path.name}.new.png")
            try:
                imbuf.write(buffer, filepath=str(fresh))
                fresh.replace(path)
            finally:
                fresh.unlink(missing_ok=True)
        except OSError as error:
            raise GridFileError(
                f"cannot write {path} ({error.strerror or error}): choose a folder that is writable and has space"
            ) from error
        finally:
            buffer.free()


def _draw(text: _Text) -> None:
    """Draw a line into the bound buffer, smaller where it would be too wide."""
    blf.size(_FONT, text.size)
    width, _ = blf.dimensions(_FONT, text.text)
    if width > text.most_width:
        blf.size(_FONT, 0.98 * text.size * text.most_width / width)  # widths do not quite scale with sizes
        width, _ = blf.dimensions(_FONT, text.text)
    blf.color(_FONT, *text.color, 1.0)
    blf.position(_FONT, text.x - text.anchor * width, text.y, 0.0)
    blf.draw_buffer(_FONT, text.text)


def _image(canvas: Float64) -> bpy.types.Image:
    """Return a new image with one byte per channel, whose values are stored as they are."""
    height, width, _ = canvas.shape
    image = bpy.data.images.new("IVG montage", width, height, alpha=False)
    pixels = np.ones((height, width, 4), dtype=np.float32)
    pixels[:, :, :3] = canvas
    image.pixels.foreach_set(pixels.reshape(-1))
    return image
