# SPDX-License-Identifier: GPL-3.0-or-later
"""The grid in half floats, as textures of graphics cards hold it: twelve RGB values, 72 bytes a vertex.

Two forms of one size, where the grid has 216 bytes:

`MOMENTS` (the default) keeps F and D_k (moments.py), in which the six vectors are contained: it costs the half floats'
eleven bits and nothing else.

`REPORT` is the one printed in [IVG §4.2]. Of each direction δ it keeps the lengths of the three channels' vectors, and
one direction for all channels:

    colour = (‖I_R‖, ‖I_G‖, ‖I_B‖)        d = (I_R + I_G + I_B) / ‖I_R + I_G + I_B‖        I_c ≈ colour_c d

Near coloured walls the channels' light comes from different directions, and what this loses is a hundred times as
much (`python -m benchmarks.compressed`). It is kept so that the report's numbers can be reproduced.

What is compressed are the values that look-ups interpolate (prefilter.py), so nothing is left to be done after the
textures are read. Look-ups weigh vertices by what is lit of their cells, which the report does not: a further texture
of one channel holds the validity. Values are divided by a power of two, for half floats end at 65,504 and become
coarse below 6·10⁻⁵.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .dual_cells import Lattice
from .grid import BakeRecord, IrradianceVectorGrid
from .grid_parts import arrays, assemble
from .moments import moments, vectors
from .settings import Spatial

Float16 = NDArray[np.float16]
Float64 = NDArray[np.float64]

LARGEST = 2.0**15
"""Of the half floats, so that rounding never ends at infinity."""

_REPLACED = ("vectors", "validity", "lit_weights", "corrected", "corrections")
_CANCELLED = 1e-6
"""Of the longest channel's vector: sums of the channels below have no direction of their own."""


class Form(StrEnum):
    """What the twelve values of a vertex are."""

    MOMENTS = "MOMENTS"
    REPORT = "REPORT"


@dataclass(frozen=True)
class CompressedGrid:
    """A grid in half floats.

    Parameters
    ----------
    texels : (Ni+1, Nj+1, Nk+1, 12, 3) float16
        Divided by `scale`. `MOMENTS`: F_x, F_y, F_z, D_xx, D_xy … D_zz, three channels each. `REPORT`: for the
        directions +x, −x, +y, −y, +z, −z the colour, three channels, and the direction d, three components that no
        scale applies to; zero where there is no light.
    validity : (Ni+1, Nj+1, Nk+1) float16
        Lit share of each dual cell; vertices with 0 are left out of the interpolation.
    form
        What the texels are.
    scale
        W/m² of a texel of one.
    lattice, record
        As in the grid.
    others
        Arrays of the grid that are neither replaced nor compressed, by name.
    """

    texels: Float16
    validity: Float16
    form: Form
    scale: float
    lattice: Lattice
    record: BakeRecord = field(compare=False)
    others: Mapping[str, NDArray[Any]] = field(default_factory=dict)

    def expand(self) -> IrradianceVectorGrid:
        """Return the grid of the decompressed vectors.

        Its lit weights say that vectors are to be interpolated as they stand.
        """
        texels = self.texels.astype(np.float64)
        if self.form is Form.MOMENTS:
            six = vectors(texels * self.scale)
        else:
            six = self.scale * texels[..., 0::2, :, None] * texels[..., 1::2, None, :]
        lit_weights = np.zeros((*self.lattice.shape, 3, 3, 3), dtype=np.float16)
        lit_weights[..., 1, 1, 1] = 1
        parts: dict[str, NDArray[Any]] = {
            "vectors": six.astype(np.float32),
            "validity": self.validity.astype(np.float32),
            "lit_weights": lit_weights,
            **self.others,
        }
        return assemble(self.lattice, self.record, parts, "the compressed grid")


def compress(grid: IrradianceVectorGrid, form: Form = Form.MOMENTS) -> CompressedGrid:
    """Return a grid in half floats."""
    six = grid.interpolated(Spatial.TRILINEAR).astype(np.float64)
    six *= (grid.validity > 0.0)[..., None, None, None]
    if form is Form.MOMENTS:
        texels = moments(six)
        scale = _scale(texels)
        texels /= scale
    else:
        colours, directions = _colours_and_directions(six)
        scale = _scale(colours)
        texels = np.stack([colours / scale, directions], axis=-2).reshape(*grid.validity.shape, 12, 3)
    validity = grid.validity.astype(np.float16)
    # What takes part in look-ups must not cease to by rounding.
    validity[(validity == 0.0) & (grid.validity > 0.0)] = np.finfo(np.float16).tiny
    return CompressedGrid(
        texels=texels.astype(np.float16),
        validity=validity,
        form=form,
        scale=scale,
        lattice=grid.lattice,
        record=grid.record,
        others={name: array for name, array in arrays(grid).items() if name not in _REPLACED},
    )


def _scale(values: Float64) -> float:
    """Return the power of two that brings values into the half floats' range."""
    largest = float(np.abs(values).max())
    return 2.0 ** math.ceil(math.log2(largest / LARGEST)) if largest > 0.0 else 1.0


def _colours_and_directions(six: Float64) -> tuple[Float64, Float64]:
    """Return lengths (…, 6, 3 channel), and the shared directions (…, 6, 3 xyz), of six vectors."""
    colours = np.linalg.norm(six, axis=-1)
    total = six.sum(axis=-2)
    # Channels may cancel each other: then the brightest has its way.
    brightest = np.take_along_axis(six, colours.argmax(axis=-1)[..., None, None], axis=-2)[..., 0, :]
    cancelled = np.linalg.norm(total, axis=-1) <= _CANCELLED * colours.max(axis=-1)
    total[cancelled] = brightest[cancelled]
    length = np.linalg.norm(total, axis=-1, keepdims=True)
    return colours, np.divide(total, length, out=np.zeros_like(total), where=length > 0.0)
