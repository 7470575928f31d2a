# SPDX-License-Identifier: GPL-3.0-or-later
"""The grid's file: what is written comes back to the bit, and whatever else lies there is one clear error."""

from __future__ import annotations

import errno
import io
import json
import os
import pickle
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from ivg_addon.core import grid_file
from ivg_addon.core.dual_cells import Lattice
from ivg_addon.core.errors import GridFileError, IvgError
from ivg_addon.core.grid import IrradianceVectorGrid
from ivg_addon.core.partitions import MOST_PLANES, Partitions
from ivg_addon.core.settings import BakeSettings, Estimator
from ivg_addon.core.whole_file import check_writable

from .grids import grid, record

SMALL = Lattice((0.0, 0.0, 0.0), (1.0, 2.0, 3.0), (2, 1, 1))
one_temporary_folder = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=50)


def small() -> IrradianceVectorGrid:
    values = np.arange(np.prod(SMALL.shape) * 54, dtype=np.float32).reshape(*SMALL.shape, 6, 3, 3)
    return grid(values, 0.5, SMALL)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "room.ivg.npz"


@pytest.fixture
def saved(path: Path) -> Path:
    small().save(path)
    return path


def assert_refused(path: Path, *words: str) -> None:
    """Check that loading raises one line that names the file."""
    with pytest.raises(GridFileError) as caught:
        IrradianceVectorGrid.load(path)
    message = str(caught.value)
    assert "\n" not in message
    for word in (path.name, *words):
        assert word in message


def assert_same(a: IrradianceVectorGrid, b: IrradianceVectorGrid) -> None:
    assert a.vectors.tobytes() == b.vectors.tobytes()
    assert a.validity.tobytes() == b.validity.tobytes()
    assert a.lit_weights.tobytes() == b.lit_weights.tobytes()
    assert a.plane_start.tobytes() == b.plane_start.tobytes()
    assert a.planes.tobytes() == b.planes.tobytes()
    assert (a.lattice, a.record) == (b.lattice, b.record)


# --- Round trip -------------------------------------------------------------------------------------------------------

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
    return IrradianceVectorGrid(
        vectors=draw(arrays(np.float32, (*lattice.shape, 6, 3, 3), elements=finite)),
        validity=draw(arrays(np.float32, lattice.shape, elements=st.floats(0, 1, width=32))),
        lit_weights=draw(arrays(np.float16, (*lattice.shape, 3, 3, 3), elements=st.floats(0, 1, width=16))),
        plane_start=sides.start,
        planes=sides.planes,
        lattice=lattice,
        record=replace(made, settings=baked, emitted=draw(st.tuples(*[st.floats(0, 1e30)] * 3))),
    )


@one_temporary_folder
@given(original=any_grid())
def test_round_trip_to_the_bit(path: Path, original: IrradianceVectorGrid) -> None:
    original.save(path)
    assert_same(IrradianceVectorGrid.load(path), original)


def test_what_comes_back_has_the_types_that_went_in(saved: Path) -> None:
    back = IrradianceVectorGrid.load(str(saved))
    assert isinstance(back.record.settings.estimator, Estimator)
    assert back.vectors.dtype == back.validity.dtype == np.float32
    assert back.lit_weights.dtype == np.float16
    assert hash(back.lattice) == hash(SMALL)
    assert back.irradiance([(0.5, 0.5, 0.5)], [(0, 0, 1)]).shape == (1, 3)


def test_saving_replaces_and_leaves_nothing_else(saved: Path) -> None:
    other = grid(np.ones(1), 1.0, SMALL)
    other.save(saved)
    assert_same(IrradianceVectorGrid.load(saved), other)
    assert list(saved.parent.iterdir()) == [saved]


def test_a_saved_grid_is_an_ordinary_file(saved: Path) -> None:
    saved.parent.joinpath("ordinary").touch()
    assert saved.stat().st_mode == saved.parent.joinpath("ordinary").stat().st_mode


# --- Damage -----------------------------------------------------------------------------------------------------------


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
        (lambda h: h.update(version=grid_file.VERSION + 1), ["format version 4", "update Irradiance Vector Grid"]),
        (lambda h: h.update(version=1), ["format version 1, this program reads 3: bake it again"]),
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


# --- The file system --------------------------------------------------------------------------------------------------


def test_a_missing_file(path: Path) -> None:
    assert_refused(path, "does not exist: bake it first")


def test_a_folder(tmp_path: Path) -> None:
    assert_refused(tmp_path, "cannot read")
    with pytest.raises(GridFileError, match=r"is a folder: name a file in it, for instance grid\.ivg\.npz"):
        small().save(tmp_path)


@pytest.mark.parametrize("where", ["no/such/folder/room.ivg.npz", "file/room.ivg.npz"])
def test_a_place_where_no_file_can_be(tmp_path: Path, where: str) -> None:
    tmp_path.joinpath("file").touch()
    target = tmp_path / where
    with pytest.raises(GridFileError, match=r"cannot write .*: choose a folder that exists and is writable") as caught:
        small().save(target)
    assert str(target) in str(caught.value)
    with pytest.raises(GridFileError):
        IrradianceVectorGrid.load(target)


@pytest.fixture
def read_only(tmp_path: Path) -> Iterator[Path]:
    """Return a folder in which this user may not write, whoever that is."""
    folder = tmp_path / "read-only"
    folder.mkdir()
    folder.chmod(0o500)
    try:
        folder.joinpath("probe").touch()
    except OSError:
        yield folder
    else:  # an administrator may write everywhere, but not here
        folder.joinpath("probe").unlink()
        if not Path("/proc/self").is_dir():
            pytest.skip("this user may write everywhere")
        yield Path("/proc/self")
    folder.chmod(0o700)


def test_a_read_only_folder(read_only: Path) -> None:
    with pytest.raises(GridFileError, match=r"cannot write .*: choose a folder that exists and is writable"):
        check_writable(read_only / "room.ivg.npz")


def test_a_read_only_file(saved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(GridFileError, match=r"cannot replace .*: it is read-only"):
        small().save(saved)


def test_asking_whether_a_file_can_be_written_leaves_nothing(path: Path) -> None:
    check_writable(path)
    assert list(path.parent.iterdir()) == []


@pytest.mark.parametrize("step", ["savez", "fsync", "chmod", "replace"])
@pytest.mark.parametrize("failure", [OSError(errno.ENOSPC, "No space left on device"), KeyboardInterrupt()])
def test_an_interrupted_write_leaves_the_old_file(
    saved: Path, monkeypatch: pytest.MonkeyPatch, step: str, failure: BaseException
) -> None:
    before = saved.read_bytes()

    def fail(*_: object, **__: object) -> None:
        raise failure

    with monkeypatch.context() as patch:
        patch.setattr(np if step == "savez" else os, step, fail)
        expected = KeyboardInterrupt if isinstance(failure, KeyboardInterrupt) else GridFileError
        with pytest.raises(expected) as caught:
            grid(np.ones(1), 1.0, SMALL).save(saved)
    if expected is GridFileError:
        assert "No space left on device" in str(caught.value)
        assert "free some space" in str(caught.value)
        assert "previous file is unchanged" in str(caught.value)
    assert saved.read_bytes() == before
    assert list(saved.parent.iterdir()) == [saved]
