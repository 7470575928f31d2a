# SPDX-License-Identifier: GPL-3.0-or-later
"""A grid taken apart, and put together again: a header of texts and numbers, and named arrays.

Whatever keeps a grid (a datablock, an OpenVDB file, a compressed file) keeps these. Arrays go by the names that they
have in `IrradianceVectorGrid`, so that one more there is kept everywhere.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .checksum import checksum, checksum_of
from .dual_cells import Lattice
from .errors import GridFileError, SettingsError
from .grid import BakeRecord, IrradianceVectorGrid
from .settings import BakeSettings, Estimator, Vec3

Arrays = Mapping[str, NDArray[Any]]

OPTIONAL = ("corrected", "corrections")
"""Arrays that grids of older versions have not: without any corrections a grid is as it was for them."""


def digest(grid: IrradianceVectorGrid) -> str:
    """Return 32 hexadecimal digits of all that a grid is: its numbers, its lattice and its record."""
    if len(grid.corrected):
        return checksum(grid)
    return checksum_of(grid, [item.name for item in dataclasses.fields(grid) if item.name not in OPTIONAL])


def header(lattice: Lattice, record: BakeRecord) -> dict[str, Any]:
    """Return where a grid lies and how it came to be, as JSON can hold it."""
    return {
        "bounds_min": lattice.bounds_min,
        "bounds_max": lattice.bounds_max,
        "resolution": lattice.resolution,
        "record": dataclasses.asdict(record),
    }


def parse_header(content: Mapping[str, Any], source: str) -> tuple[Lattice, BakeRecord]:
    """Return lattice and record of a header; raises `GridFileError` that names its `source`."""
    try:
        record = dict(content["record"])
        settings = dict(record["settings"])
        settings["estimator"] = Estimator(settings["estimator"])
        for name in ("bounds_min", "bounds_max", "resolution"):
            settings[name] = tuple(settings[name])
        record["settings"] = BakeSettings(**settings)
        record["emitted"] = _vec3(record["emitted"])
        i, j, k = (int(n) for n in content["resolution"])
        lattice = Lattice(_vec3(content["bounds_min"]), _vec3(content["bounds_max"]), (i, j, k))
        if min(lattice.resolution) < 1 or not np.less(lattice.bounds_min, lattice.bounds_max).all():
            raise SettingsError(f"{lattice.resolution} voxels, {lattice.bounds_min} to {lattice.bounds_max}")
        return lattice, BakeRecord(**record)
    except (KeyError, TypeError, ValueError, SettingsError) as error:
        raise GridFileError(f"{source} has a damaged header ({error}): bake it again") from error


def arrays(grid: IrradianceVectorGrid) -> dict[str, NDArray[Any]]:
    """Return the arrays of a grid by name, those that it has."""
    values = {item.name: getattr(grid, item.name) for item in dataclasses.fields(grid)}
    absent = () if len(grid.corrected) else OPTIONAL
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray) and name not in absent}


def assemble(lattice: Lattice, record: BakeRecord, parts: Arrays, source: str) -> IrradianceVectorGrid:
    """Return the grid of these arrays; raises `GridFileError` that names their `source`.

    An array that this version does not know comes from a newer one, one that lacks from an older one.
    """
    known = {item.name: item for item in dataclasses.fields(IrradianceVectorGrid)}
    unknown = sorted(parts.keys() - known.keys())
    if unknown:
        raise GridFileError(
            f"{source} holds '{unknown[0]}', which this version does not know: update Irradiance Vector Grid"
        )
    needed = {
        name
        for name, item in known.items()
        if item.default is dataclasses.MISSING and item.default_factory is dataclasses.MISSING
    } - {"lattice", "record"}
    missing = sorted(needed - parts.keys())
    if missing:
        raise GridFileError(f"{source} has no '{missing[0]}', an older version stored it: bake it again")
    for name, array in parts.items():
        if np.issubdtype(array.dtype, np.floating) and not np.isfinite(array).all():
            raise GridFileError(f"{source} holds numbers in '{name}' that are not finite: bake it again")
    try:
        return IrradianceVectorGrid(lattice=lattice, record=record, **parts)
    except SettingsError as error:
        raise GridFileError(f"{source} is damaged ({error}): bake it again") from error


def _vec3(values: Any) -> Vec3:
    """Return three finite floats."""
    x, y, z = (float(value) for value in values)
    if not np.isfinite((x, y, z)).all():
        raise ValueError(f"{values} where finite numbers belong")
    return x, y, z
