# SPDX-License-Identifier: GPL-3.0-or-later
"""A grid's OpenVDB file: the grids that are promised, where they are promised, and the whole grid back to the bit."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ivg_addon.core import vdb, vdb_grid
from ivg_addon.core.errors import GridFileError
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.grid_parts import digest
from ivg_addon.core.reconstruction import coefficients
from ivg_addon.core.settings import Directional, Spatial
from ivg_addon.core.vdb_grid import AXES

from . import openvdb
from .grids import LATTICE, grid


def random_grid() -> IrradianceVectorGrid:
    rng = np.random.default_rng(5)
    weights = rng.uniform(size=(*LATTICE.shape, 3, 3, 3)).astype(np.float16)
    return grid(rng.normal(size=(*LATTICE.shape, 6, 3, 3)), rng.uniform(size=LATTICE.shape), lit_weights=weights)


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    path = tmp_path / "room.vdb"
    vdb_grid.save(random_grid(), path)
    return path


def test_openvdb_reads_every_vector_to_the_bit(saved: Path, tmp_path: Path) -> None:
    baked = random_grid()
    arrays, told = openvdb.read(saved, tmp_path)
    for d, direction in enumerate(("px", "nx", "py", "ny", "pz", "nz")):
        for c, channel in enumerate("RGB"):
            expected = np.ascontiguousarray(baked.vectors[..., d, c, :])
            assert arrays[f"I_{direction}_{channel}"].tobytes() == expected.tobytes()
        towards = np.einsum("...cx,x->...c", baked.vectors[..., d, :, :], AXES[d])
        np.testing.assert_array_equal(arrays[f"irradiance_{direction}"], towards)
    assert arrays["validity"].tobytes() == baked.validity.tobytes()
    assert set(arrays) >= {"irradiance_mean", "validity"}
    assert len(arrays) == 18 + 6 + 2
    grids, metadata = json.loads(told)
    np.testing.assert_allclose(grids["I_nz_B"]["origin"], LATTICE.bounds_min, rtol=1e-15)
    np.testing.assert_allclose(grids["I_nz_B"]["far"], LATTICE.bounds_max, rtol=1e-15)
    header = json.loads(metadata["ivg_header"])
    assert header["record"]["scene"] == "Test"
    assert tuple(header["resolution"]) == LATTICE.resolution


def test_the_grid_comes_back_to_the_bit(saved: Path) -> None:
    baked, back = random_grid(), vdb_grid.load(saved)
    assert digest(back) == digest(baked) == vdb_grid.stored_digest(saved)
    assert (back.lattice, back.record) == (baked.lattice, baked.record)
    for name in ("vectors", "validity", "lit_weights"):
        assert getattr(back, name).tobytes() == getattr(baked, name).tobytes()
    points = np.random.default_rng(0).uniform(LATTICE.bounds_min, LATTICE.bounds_max, (50, 3))
    np.testing.assert_array_equal(back.irradiance(points, points), baked.irradiance(points, points))


def test_what_look_ups_read_goes_along_when_asked_for(tmp_path: Path) -> None:
    """E = ½ (F·n + Σ_k D_k·W_k) of these grids is the irradiance at a vertex, where nothing is interpolated."""
    baked = grid(np.random.default_rng(7).normal(size=(*LATTICE.shape, 6, 3, 3)))
    path = tmp_path / "room.vdb"
    vdb_grid.save(baked, path, Spatial.TRILINEAR)
    assert digest(vdb_grid.load(path)) == digest(baked)
    read = {item.name: item.values.astype(np.float64) for item in vdb.read(path).grids}
    n = np.array([-0.6, 0.0, 0.8])
    c = coefficients(n, Directional.LEAST_SQUARES)
    w = c[0::2] - c[1::2]
    channels = [read[f"F_{a}"] @ n + sum(read[f"D_{k}_{a}"] @ w["xyz".index(k)] for k in "xyz") for a in "RGB"]
    e = 0.5 * np.stack(channels, axis=-1)
    points = LATTICE.vertex_positions().reshape(-1, 3)
    expected = baked.irradiance(points, np.broadcast_to(n, points.shape)).reshape(e.shape)
    # Sums of some twenty numbers of order one, in float32 by the look-up and here in float64.
    np.testing.assert_allclose(np.maximum(e, 0.0), expected, atol=64 * np.finfo(np.float32).eps)
    np.testing.assert_array_equal(read["lit"], 1.0)


def test_a_changed_number_is_noticed(saved: Path) -> None:
    content = bytearray(saved.read_bytes())
    baked = random_grid()
    at = content.index(np.ascontiguousarray(baked.vectors[0, 0, 0, 0, 0]).tobytes())
    content[at] ^= 1
    saved.write_bytes(content)
    with pytest.raises(GridFileError, match=r"room\.vdb was changed after it was written"):
        vdb_grid.load(saved)


def change_metadata(path: Path, **changes: vdb.MetaValue) -> None:
    file = vdb.read(path)
    with path.open("wb") as stream:
        vdb.write(stream, replace(file, metadata=dict(file.metadata) | changes))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"ivg_format": "other"}, "holds no irradiance vector grid"),
        ({"ivg_version": 2}, "has format version 2, this program reads 1"),
        ({"ivg_header": "{"}, "unreadable header"),
        ({"ivg_header": "{}"}, "damaged header"),
        ({"ivg_array_lit_weights": "%"}, "damaged, or not all of a grid"),
    ],
)
def test_bad_metadata_is_refused(saved: Path, changes: dict[str, vdb.MetaValue], message: str) -> None:
    change_metadata(saved, **changes)
    with pytest.raises(GridFileError, match=message) as caught:
        vdb_grid.load(saved)
    assert saved.name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_volume_of_another_program_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "smoke.vdb"
    smoke = vdb.VdbFile((vdb.VdbGrid("density", np.ones((3, 3, 3), np.float32)),), (1, 1, 1), (0, 0, 0))
    with path.open("wb") as stream:
        vdb.write(stream, smoke)
    with pytest.raises(GridFileError, match=r"smoke\.vdb holds no irradiance vector grid"):
        vdb_grid.load(path)


def test_a_failed_export_leaves_the_file_before(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    before = saved.read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(vdb, "write", full)
    with pytest.raises(GridFileError, match=r"cannot write .*room\.vdb \(No space left on device\)"):
        vdb_grid.save(random_grid(), saved)
    assert saved.read_bytes() == before
    assert list(saved.parent.iterdir()) == [saved]
