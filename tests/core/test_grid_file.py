# SPDX-License-Identifier: GPL-3.0-or-later
"""The grid's file: what is written comes back to the bit."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.partitions import MOST_PLANES, Partitions
from ivg_addon.core.settings import BakeSettings, Estimator

from .grid_files import SMALL, assert_same, one_temporary_folder
from .grids import grid, record

finite = st.floats(allow_nan=False, allow_infinity=False, width=32)
bounds = st.tuples(*[st.tuples(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6)).map(lambda x: (x[0], x[0] + x[1]))] * 3)


@st.composite
def any_partitions(draw: st.DrawFn, vertex_count: int) -> Partitions:
    numbers = draw(arrays(np.int32, vertex_count, elements=st.integers(0, MOST_PLANES)))
    start = np.concatenate([[0], np.cumsum(numbers)]).astype(np.int32)
    return Partitions(start, draw(arrays(np.float32, (int(start[-1]), 5), elements=finite)))


@st.composite
def any_grid(draw: st.DrawFn) -> IrradianceVectorGrid:
    box = draw(bounds)
    lattice = Lattice(
        tuple(low for low, _ in box),  # type: ignore[arg-type]
        tuple(high for _, high in box),  # type: ignore[arg-type]
        draw(st.tuples(*[st.integers(1, 3)] * 3)),
    )
    baked = BakeSettings(
        lattice.bounds_min,
        lattice.bounds_max,
        lattice.resolution,
        photons=draw(st.integers(1, 10**9)),
        bounces=draw(st.integers(1, 100)),
        seed=draw(st.integers(0, 2**63 - 1)),
        estimator=draw(st.sampled_from(list(Estimator))),
        include_direct=draw(st.booleans()),
        threads=draw(st.integers(0, 64)),
        lit_points=draw(st.integers(0, 10_000)),
    )
    made = record(lattice, scene=draw(st.text()))
    sides = draw(any_partitions(lattice.vertex_count))
    corrected = np.array(sorted(draw(st.sets(st.integers(0, lattice.vertex_count - 1), max_size=3))), dtype=np.int32)
    return IrradianceVectorGrid(
        vectors=draw(arrays(np.float32, (*lattice.shape, 6, 3, 3), elements=finite)),
        validity=draw(arrays(np.float32, lattice.shape, elements=st.floats(0, 1, width=32))),
        lit_weights=draw(arrays(np.float16, (*lattice.shape, 3, 3, 3), elements=st.floats(0, 1, width=16))),
        plane_start=sides.start,
        planes=sides.planes,
        lattice=lattice,
        record=replace(made, settings=baked, emitted=draw(st.tuples(*[st.floats(0, 1e30)] * 3))),
        corrected=corrected,
        corrections=draw(arrays(np.float32, (len(corrected), 12, 3), elements=finite)),
    )


@one_temporary_folder
@given(original=any_grid())
def test_round_trip_to_the_bit(path: Path, original: IrradianceVectorGrid) -> None:
    original.save(path)
    assert_same(IrradianceVectorGrid.load(path), original)


def test_without_corrections_it_is_a_file_of_the_version_before(tmp_path: Path) -> None:
    """Which older programs read."""
    path = tmp_path / "plain.ivg.npz"
    plain = grid(np.ones((6, 3, 3)), lattice=SMALL)
    plain.save(path)
    with np.load(path) as stored:
        assert json.loads(str(stored["header"]))["version"] == 3
        assert sorted(stored) == ["header", "lit_weights", "plane_start", "planes", "validity", "vectors"]
    corrected = replace(plain, corrected=np.array([1], np.int32), corrections=np.ones((1, 12, 3), np.float32))
    corrected.save(path)
    with np.load(path) as stored:
        assert json.loads(str(stored["header"]))["version"] == 4


def test_what_comes_back_has_the_types_that_went_in(saved: Path) -> None:
    back = IrradianceVectorGrid.load(str(saved))
    assert isinstance(back.record.settings.estimator, Estimator)
    assert back.vectors.dtype == back.validity.dtype == np.float32
    assert back.lit_weights.dtype == np.float16
    assert hash(back.lattice) == hash(SMALL)
    assert back.irradiance([(0.5, 0.5, 0.5)], [(0, 0, 1)]).shape == (1, 3)
