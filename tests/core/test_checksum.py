# SPDX-License-Identifier: GPL-3.0-or-later
"""The fingerprint of what was baked: the same for equal content, another for any change."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ivg_addon.core.checksum import checksum

from .rooms import box, lamp, scene

ROOT = Path(__file__).resolve().parents[2]

leaves = st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text()
values = st.recursive(leaves, lambda inner: st.lists(inner, max_size=3).map(tuple), max_leaves=8)


@dataclass(frozen=True)
class Pair:
    a: Any
    b: Any


def test_32_hexadecimal_digits() -> None:
    digits = checksum(Pair(np.zeros((0, 3), dtype=np.float32), ("x", 1)))
    assert len(digits) == 32
    int(digits, 16)


@given(values, values)
def test_equal_content_and_only_that_gives_equal_digits(a: object, b: object) -> None:
    # 1, 1.0 and True are equal to Python; here a number's type counts as content.
    assert (checksum(a) == checksum(b)) == (repr(a) == repr(b))


@given(values, values)
def test_order_counts(a: object, b: object) -> None:
    assert (checksum(Pair(a, b)) == checksum(Pair(b, a))) == (repr(a) == repr(b))


def test_type_shape_and_content_of_arrays_count() -> None:
    base = np.arange(6, dtype=np.float32)
    different = [base, base.reshape(2, 3), base.reshape(3, 2), base.astype(np.float64), base.astype(np.int32), base + 1]
    assert len({checksum(array) for array in different}) == len(different)
    assert checksum(base.reshape(2, 3)) == checksum(np.asfortranarray(base.reshape(2, 3)))
    assert checksum(base[::2]) == checksum(base[::2].copy())


def test_any_part_of_a_scene_counts() -> None:
    room = scene([box((0, 0, 0), (1, 1, 1), inward=True)], lights=lamp((0.5, 0.5, 0.5)))
    geometry, materials = room.geometry, room.materials
    moved = geometry.vertices.copy()
    moved[3, 1] = np.nextafter(moved[3, 1], np.float32(2))
    changed = [
        room,
        replace(room, name="Other"),
        replace(room, geometry=replace(geometry, vertices=moved)),
        replace(room, geometry=replace(geometry, triangles=geometry.triangles[::-1].copy())),
        replace(room, materials=replace(materials, albedo=materials.albedo * np.float32(0.5))),
        replace(room, lights=lamp((0.5, 0.5, 0.4))),
        replace(room, diffuse_visible=~room.diffuse_visible),
    ]
    assert len({checksum(each) for each in changed}) == len(changed)
    assert checksum(room) == checksum(replace(room, geometry=replace(geometry, vertices=geometry.vertices.copy())))


@pytest.mark.parametrize("salt", ["1", "2"])
def test_every_process_gives_the_same_digits(salt: str) -> None:
    """Unlike hash(), which is salted."""
    code = "from ivg_addon.core.checksum import checksum; print(checksum(('text', 1, 2.5, None)))"
    result = subprocess.run(
        [sys.executable, "-c", code],
        cwd=ROOT,
        env={"PYTHONHASHSEED": salt, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert result.stdout.strip() == checksum(("text", 1, 2.5, None))
