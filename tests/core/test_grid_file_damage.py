# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever else lies where a grid's file should be is one clear error."""

from __future__ import annotations

import io
import json
import pickle
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ivg_addon.core import grid_file
from ivg_addon.core.errors import IvgError
from ivg_addon.core.grid import IrradianceVectorGrid

from .grid_files import SMALL, assert_refused, assert_same, one_temporary_folder, small


def test_a_missing_file(path: Path) -> None:
    assert_refused(path, "does not exist: bake it first")


@one_temporary_folder
@given(share=st.floats(0, 1, exclude_max=True))
def test_truncated_anywhere(saved: Path, share: float) -> None:
    whole = saved.read_bytes()
    cut = saved.with_name("cut.ivg.npz")
    cut.write_bytes(whole[: int(share * len(whole))])
    assert_refused(cut, "bake it again")


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=300)
@given(data=st.data())
def test_any_byte_overwritten(saved: Path, data: st.DataObject) -> None:
    """It is refused as damaged, or the byte was one that tells nothing (a date, a version)."""
    whole = bytearray(saved.read_bytes())
    # The arrays' bytes are most of the file; its structure is what can go wrong in most ways.
    with zipfile.ZipFile(saved) as archive:
        arrays_end = archive.start_dir
    at = data.draw(st.integers(arrays_end, len(whole) - 1) | st.integers(0, len(whole) - 1))
    whole[at] = data.draw(st.integers(0, 255))
    damaged = saved.with_name("damaged.ivg.npz")
    damaged.write_bytes(whole)
    try:
        back = IrradianceVectorGrid.load(damaged)
    except IvgError as error:
        assert damaged.name in str(error)
        assert "\n" not in str(error)
    else:
        assert_same(back, small())


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", "not a grid file"), (b"no zip at all", "not a grid file"), (b"PK\x03\x04" + bytes(100), "not a grid file")],
)
def test_not_a_zip(path: Path, content: bytes, words: str) -> None:
    path.write_bytes(content)
    assert_refused(path, words)


def test_a_foreign_zip(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("readme.txt", "hello")
    assert_refused(path, "no array 'header'", "not written by Irradiance Vector Grid")


def test_a_foreign_npz(path: Path) -> None:
    np.savez(path, header=np.arange(3), vectors=np.zeros(3))
    assert_refused(path, "unreadable header")


def rewritten(source: Path, target: Path, **changes: object) -> Path:
    """Write a grid file with some of its arrays changed; None leaves one out, bytes are taken as they are."""
    with np.load(source) as archive:
        members: dict[str, Any] = {name: archive[name] for name in archive.files}
    members.update(changes)
    with zipfile.ZipFile(target, "w") as archive:
        for name, value in members.items():
            if value is None:
                continue
            if not isinstance(value, bytes):
                stream = io.BytesIO()
                np.lib.format.write_array(stream, np.asarray(value))
                value = stream.getvalue()
            archive.writestr(f"{name}.npy", value)
    return target


def header_of(path: Path) -> dict[str, Any]:
    with np.load(path) as archive:
        return dict(json.loads(str(archive["header"])))


def with_header(saved: Path, change: Callable[[dict[str, Any]], object]) -> Path:
    header = header_of(saved)
    change(header)
    return rewritten(saved, saved.with_name("changed.ivg.npz"), header=json.dumps(header))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda h: h.update(format="photo"), ["'photo' file", "expected 'irradiance-vector-grid'"]),
        (lambda h: h.update(version=grid_file.VERSION + 1), ["format version 5", "update Irradiance Vector Grid"]),
        (lambda h: h.update(version=1), ["format version 1, this program reads 3 on: bake it again"]),
        (lambda h: h.update(version=0), ["no valid version"]),
        (lambda h: h.update(version="1"), ["no valid version"]),
        (lambda h: h.pop("version"), ["unreadable header"]),
        (lambda h: h.pop("record"), ["damaged header"]),
        (lambda h: h.update(resolution=[10**6] * 3), ["bytes where a grid of its resolution has"]),
        (lambda h: h.update(resolution=[0, 1, 1]), ["damaged header"]),
        (lambda h: h.update(resolution=[1, 1]), ["damaged header"]),
        (lambda h: h.update(resolution=["x", 1, 1]), ["damaged header"]),
        (lambda h: h.update(bounds_min=[0, 0]), ["damaged header"]),
        (lambda h: h.update(bounds_min=[0, 0, None]), ["damaged header"]),
        (lambda h: h.update(bounds_min=[0, 0, float("nan")]), ["damaged header"]),
        (lambda h: h.update(bounds_min=[5, 0, 0]), ["damaged header"]),
        (lambda h: h["record"].update(extra=1), ["damaged header"]),
        (lambda h: h["record"].pop("scene"), ["damaged header"]),
        (lambda h: h["record"].update(emitted=["much"]), ["damaged header"]),
        (lambda h: h["record"]["settings"].update(photons=0), ["damaged header", "0 photons"]),
        (lambda h: h["record"]["settings"].update(photons="many"), ["damaged header"]),
        (lambda h: h["record"]["settings"].update(estimator="SHOT"), ["damaged header"]),
        (lambda h: h["record"].update(settings=3), ["damaged header"]),
    ],
)
def test_a_header_that_says_something_else(
    saved: Path, change: Callable[[dict[str, Any]], object], words: list[str]
) -> None:
    assert_refused(with_header(saved, change), *words)


@pytest.mark.parametrize("text", ["", "{", "[]", "3", "null", '"text"', "[" * 100_000])
def test_a_header_that_is_no_header(saved: Path, text: str) -> None:
    assert_refused(rewritten(saved, saved.with_name("changed.ivg.npz"), header=text), "header")


def test_a_header_of_enormous_size(saved: Path) -> None:
    big = "x" * (1 << 20)
    assert_refused(rewritten(saved, saved.with_name("big.ivg.npz"), header=big), "header of", "not a grid file")


@pytest.mark.parametrize("name", ["vectors", "validity", "lit_weights"])
@pytest.mark.parametrize(
    "value",
    [
        None,
        np.zeros(SMALL.shape),
        np.zeros((*SMALL.shape, 6, 3, 3), dtype=np.int32),
        np.zeros((*SMALL.shape[::-1], 6, 3, 3), dtype=np.float32),
        np.full((*SMALL.shape, 6, 3, 3), np.nan, dtype=np.float32),
        np.full(SMALL.shape, np.inf, dtype=np.float32),
        np.zeros(SMALL.shape[::-1], dtype=np.float32),
        np.full((*SMALL.shape, 3, 3, 3), np.inf, dtype=np.float16),
        np.zeros((*SMALL.shape, 27), dtype=np.float16),
        np.zeros((*SMALL.shape, 3, 3, 3), dtype=np.float32),
        b"\x93NUMPY",
        bytes(4 * 12 * 54 + 128),
    ],
    ids="missing float64 int32 turned NaN infinite flat-turned half-infinite flat single short zeros".split(),
)
def test_arrays_that_do_not_belong(saved: Path, name: str, value: object) -> None:
    assert_refused(rewritten(saved, saved.with_name("changed.ivg.npz"), **{name: value}))


class Trap:
    """Unpickling it makes a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[Any, ...]:
        return open, (str(self.path), "w")


@pytest.mark.parametrize("name", ["header", "vectors", "validity", "lit_weights"])
def test_pickles_are_not_opened(saved: Path, name: str) -> None:
    sprung = saved.with_name("sprung")
    shapes = {"header": (), "vectors": (*SMALL.shape, 6, 3, 3), "validity": SMALL.shape}
    shape = shapes.get(name, (*SMALL.shape, 3, 3, 3))
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "|O", "fortran_order": False, "shape": shape})  # type: ignore[no-untyped-call]
    pickled = stream.getvalue() + pickle.dumps(Trap(sprung))
    size = (2 if name == "lit_weights" else 4) * int(np.prod(shape)) + 128
    trap = rewritten(saved, saved.with_name("trap.ivg.npz"), **{name: pickled.ljust(size, b"\0")})
    assert_refused(trap)
    assert not sprung.exists()
    pickle.loads(pickle.dumps(Trap(sprung))).close()
    assert sprung.exists(), "the trap does not work"


def test_a_file_that_claims_more_than_it_has(saved: Path) -> None:
    """Sizes in the archive's directory agree with a resolution of millions; nothing is allocated for them."""
    header = header_of(saved)
    header["resolution"] = [999, 999, 999]
    changed = rewritten(saved, saved.with_name("changed.ivg.npz"), header=json.dumps(header))
    content = bytearray(changed.read_bytes())
    entry = content.rindex(b"vectors.npy") - 46
    assert content[entry : entry + 4] == b"PK\x01\x02"
    content[entry + 24 : entry + 28] = (2**32 - 2).to_bytes(4, "little")
    changed.write_bytes(content)
    assert_refused(changed, "bytes where a grid of its resolution has")
