# SPDX-License-Identifier: GPL-3.0-or-later
"""Grids taken apart and put together: all arrays by name, and one clear error for what is not a grid's."""

from __future__ import annotations

import dataclasses
import json
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core import grid_parts
from ivg_addon.core.errors import GridFileError
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.grid_parts import arrays, assemble, digest, header, parse_header

from .grids import LATTICE, grid


def random_grid() -> IrradianceVectorGrid:
    return grid(np.random.default_rng(1).normal(size=(*LATTICE.shape, 6, 3, 3)), 0.5)


def test_parts_make_the_same_grid() -> None:
    baked = random_grid()
    told = json.loads(json.dumps(header(baked.lattice, baked.record)))
    lattice, record = parse_header(told, "test")
    back = assemble(lattice, record, arrays(baked), "test")
    assert digest(back) == digest(baked)
    assert (back.lattice, back.record) == (baked.lattice, baked.record)


def test_one_more_array_is_kept_without_a_change_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever arrays grids come to have go by their names; grids that lack an optional one still are grids."""

    @dataclasses.dataclass(frozen=True, kw_only=True)
    class Later(IrradianceVectorGrid):
        colours: NDArray[np.float32] = dataclasses.field(default_factory=lambda: np.zeros((0, 5), np.float32))

    monkeypatch.setattr(grid_parts, "IrradianceVectorGrid", Later)
    baked = random_grid()
    parts: dict[str, Any] = arrays(baked)
    assert assemble(baked.lattice, baked.record, parts, "test").colours.shape == (0, 5)  # type: ignore[attr-defined]
    colours = np.ones((2, 5), dtype=np.float32)
    later = assemble(baked.lattice, baked.record, parts | {"colours": colours}, "test")
    assert arrays(later)["colours"] is colours


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"colour": np.zeros(3)}, "test holds 'colour', which this version does not know: update"),
        ({"vectors": None}, "test has no 'vectors', an older version stored it: bake it again"),
        ({"validity": np.full(LATTICE.shape, np.nan, np.float32)}, "test holds numbers in 'validity' that are not"),
        ({"validity": np.zeros(3, np.float32)}, r"test is damaged \(grid validity have shape \(3,\)"),
        ({"validity": np.zeros(LATTICE.shape)}, r"test is damaged \(grid validity: float64"),
    ],
)
def test_what_is_no_grid_is_refused(change: dict[str, Any], message: str) -> None:
    baked = random_grid()
    parts = {name: array for name, array in (arrays(baked) | change).items() if array is not None}
    with pytest.raises(GridFileError, match=message):
        assemble(baked.lattice, baked.record, parts, "test")


@pytest.mark.parametrize(
    "change",
    [
        {"resolution": (5, 4)},
        {"resolution": (5, 4, 0)},
        {"bounds_min": (0.0, 0.0, float("nan"))},
        {"bounds_max": LATTICE.bounds_min},
        {"record": {}},
        {"record": None},
    ],
)
def test_damaged_headers_are_refused(change: dict[str, Any]) -> None:
    told = header(LATTICE, random_grid().record) | change
    with pytest.raises(GridFileError, match="test has a damaged header"):
        parse_header(told, "test")
