# SPDX-License-Identifier: GPL-3.0-or-later
"""Half floats: their size, and how far they may be from what was compressed."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from ivg_addon.core import compressed_file
from ivg_addon.core.compressed import Form, compress
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.errors import GridFileError
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.moments import moments, vectors

from .grids import LATTICE, grid, own_weights

ROUNDING = 2.0**-11
"""Relative, of a half float."""
SMALLEST = 2.0**-25
"""Half of the distance of half floats below the smallest normal one."""


def hemispheres(seed: int, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Return six vectors (…, 6, 3, 3) of twenty distant lights each, of random directions and colours."""
    rng = np.random.default_rng(seed)
    ways = rng.normal(size=(*shape, 20, 3))
    ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
    colours = rng.exponential(size=(*shape, 20, 3))
    result = np.zeros((*shape, 6, 3, 3))
    for k in range(3):
        for side, sign in enumerate((1.0, -1.0)):
            seen = ways[..., k] * sign > 0.0
            result[..., 2 * k + side, :, :] = np.einsum("...lc,...lx,...l->...cx", colours, ways, seen)
    return result


def lit_grid(scale: float = 1.0) -> IrradianceVectorGrid:
    """Return a grid of such vectors, interpolated as they stand."""
    return grid(scale * hemispheres(1, LATTICE.shape), lit_weights=own_weights())


def test_size_is_the_reports() -> None:
    lattice = Lattice((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (15, 15, 15))
    baked = grid(np.ones((6, 3, 3)), lattice=lattice)
    for form in Form:
        small = compress(baked, form)
        assert small.texels.nbytes == 72 * lattice.vertex_count == 288 * 1024
        assert small.validity.nbytes == 2 * lattice.vertex_count


def test_moments_contain_the_six_vectors() -> None:
    six = hemispheres(2, (4,))
    np.testing.assert_allclose(vectors(moments(six)), six, atol=64 * np.finfo(np.float64).eps)


@pytest.mark.parametrize("scale", [1e-12, 1.0, 1e9])
def test_moments_are_lost_to_rounding_only(scale: float) -> None:
    baked = lit_grid(scale)
    small = compress(baked)
    exact = moments(baked.vectors)
    bound = ROUNDING * np.abs(exact) + SMALLEST * small.scale
    assert (np.abs(small.texels.astype(np.float64) * small.scale - exact) <= bound).all()
    assert np.abs(small.texels).max() >= 2.0**14, "the half floats' range is used"


def test_report_form_is_exact_for_grey_light() -> None:
    """Then the channels share their direction: each product of two half floats is off by two roundings."""
    grey = hemispheres(3, LATTICE.shape)
    grey[..., :, :] = grey[..., :1, :]
    baked = grid(grey, lit_weights=own_weights())
    back = compress(baked, Form.REPORT).expand()
    longest = np.linalg.norm(baked.vectors, axis=-1, keepdims=True)
    assert (np.abs(back.vectors - baked.vectors) <= 2.0 * ROUNDING * longest).all()


def test_report_form_gives_channels_one_direction() -> None:
    six = np.zeros((6, 3, 3))
    six[:, 0, 0] = six[:, 1, 1] = 1.0
    back = compress(grid(six, lit_weights=own_weights()), Form.REPORT).expand()
    expected = np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)
    np.testing.assert_allclose(back.vectors[0, 0, 0, 0, 0], expected, rtol=2 * ROUNDING)
    np.testing.assert_allclose(back.vectors[0, 0, 0, 0, 1], expected, rtol=2 * ROUNDING)


def test_channels_that_cancel_keep_the_brightest_ones_direction() -> None:
    six = np.zeros((6, 3, 3))
    six[:, 0, 0], six[:, 1, 0] = 1.0, -1.0
    back = compress(grid(six, lit_weights=own_weights()), Form.REPORT).expand()
    assert back.vectors[0, 0, 0, 0, 0, 0] == 1.0


def test_expanding_looks_up_as_the_grid_does() -> None:
    """Deconvolution is done before compressing, and not again."""
    rng = np.random.default_rng(6)
    validity = np.clip(rng.uniform(-0.2, 1.5, LATTICE.shape), 0.0, 1.0)
    baked = grid(np.pi + 0.1 * hemispheres(4, LATTICE.shape), validity)
    points = rng.uniform(LATTICE.bounds_min, LATTICE.bounds_max, (200, 3))
    normals = rng.normal(size=(200, 3))
    for spatial in ("TRILINEAR", "TRICUBIC"):
        full = baked.irradiance(points, normals, spatial).astype(np.float64)
        small = compress(baked).expand().irradiance(points, normals, spatial)
        # The 12 numbers of a vertex and its validity are each off by a rounding.
        assert np.abs(small - full).max() <= 16 * ROUNDING * full.max()


def test_what_is_lit_stays_lit() -> None:
    validity = np.full(LATTICE.shape, 1e-9)
    validity[0] = 0.0
    small = compress(grid(np.ones((6, 3, 3)), validity))
    np.testing.assert_array_equal(small.validity > 0.0, validity > 0.0)
    assert not small.texels[0].any()


def test_a_black_grid_stays_black() -> None:
    for form in Form:
        assert not compress(grid(np.zeros((6, 3, 3))), form).expand().vectors.any()


# --- The file ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    path = tmp_path / "room.ivg16.npz"
    compressed_file.save(compress(lit_grid()), path)
    return path


@pytest.mark.parametrize("form", list(Form))
def test_file_gives_back_the_same_bits(tmp_path: Path, form: Form) -> None:
    small = compress(lit_grid(), form)
    path = tmp_path / "room.ivg16.npz"
    compressed_file.save(small, path)
    back = compressed_file.load(path)
    assert back.texels.tobytes() == small.texels.tobytes()
    assert back.validity.tobytes() == small.validity.tobytes()
    assert (back.form, back.scale, back.lattice, back.record) == (small.form, small.scale, small.lattice, small.record)
    assert {name: array.tobytes() for name, array in back.others.items()} == {
        name: array.tobytes() for name, array in small.others.items()
    }
    assert sorted(back.others) == ["plane_start", "planes"]


def rewrite(path: Path, **changes: object) -> None:
    """Change the header's entries, or arrays."""
    with np.load(path) as archive:
        parts = dict(archive)
    header = json.loads(str(parts.pop("header")))
    for name, value in changes.items():
        if isinstance(value, np.ndarray):
            parts[name] = value
        else:
            header[name] = value
    np.savez(path, header=np.array(json.dumps(header)), **parts)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "irradiance-vector-grid"}, "is a 'irradiance-vector-grid' file"),
        ({"version": 2}, "has format version 2, this program reads 1"),
        ({"form": "OTHER"}, "no compressed grid, or only part of one"),
        ({"scale": -1.0}, "damaged header"),
        ({"resolution": [5, 4]}, "damaged header"),
        ({"texels": np.zeros((2, 2), np.float16)}, r"array 'texels' is float16 \(2, 2\)"),
        ({"texels": np.full((*LATTICE.shape, 12, 3), np.inf, np.float16)}, "not finite"),
    ],
)
def test_bad_files_are_refused(saved: Path, changes: dict[str, object], message: str) -> None:
    rewrite(saved, **changes)
    with pytest.raises(GridFileError, match=message) as caught:
        compressed_file.load(saved)
    assert saved.name in str(caught.value)
    assert "\n" not in str(caught.value)


def test_any_part_of_a_file_is_refused(saved: Path) -> None:
    whole = saved.read_bytes()
    for size in range(0, len(whole), len(whole) // 50):
        saved.write_bytes(whole[:size])
        with pytest.raises(GridFileError, match="only part of one"):
            compressed_file.load(saved)


def test_packed_arrays_are_refused(saved: Path) -> None:
    """A small file must not become a large array."""
    with zipfile.ZipFile(saved) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(saved, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    with pytest.raises(GridFileError, match="is packed"):
        compressed_file.load(saved)


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(GridFileError, match="does not exist"):
        compressed_file.load(tmp_path / "none.ivg16.npz")
