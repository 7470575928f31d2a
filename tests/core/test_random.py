# SPDX-License-Identifier: GPL-3.0-or-later
"""Philox against its published vectors, and the numbers made of it against the uniform distribution."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from ivg_addon.core.compiled import kernel
from ivg_addon.core.random import (
    STREAM_CAMERA,
    STREAM_EMISSION,
    STREAM_LIT_VOLUME,
    STREAM_SCATTER,
    philox4x32,
    random4,
)

from .z_tests import assert_counts

seeds = st.integers(0, 2**63 - 1)
indices = st.integers(0, 2**63 - 1)
streams = st.integers(0, 2**32 - 1)


@kernel
def philox_block(counter, key, out):
    out[0], out[1], out[2], out[3] = philox4x32(counter[0], counter[1], counter[2], counter[3], key[0], key[1])


@kernel
def draw(seed, first, stream, out):
    for row in range(len(out)):
        out[row, 0], out[row, 1], out[row, 2], out[row, 3] = random4(seed, first + row, stream)


def numbers(seed: int, first: int, stream: int, count: int) -> NDArray[np.float64]:
    """Return (count, 4) random numbers of consecutive indices."""
    out = np.empty((count, 4))
    draw(seed, first, stream, out)
    return out


@pytest.mark.parametrize(
    ("counter", "key", "expected"),
    [
        ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
        ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
        ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
    ],
)
def test_known_answers_of_random123(counter: str, key: str, expected: str) -> None:
    """The vectors for philox4x32-10 that Random123 ships (kat_vectors)."""

    def words(text: str) -> NDArray[np.uint32]:
        return np.array([int(word, 16) for word in text.split()], dtype=np.uint32)

    out = np.empty(4, dtype=np.uint32)
    philox_block(words(counter), words(key), out)
    np.testing.assert_array_equal(out, words(expected))


@pytest.mark.parametrize(("seed", "first", "stream"), [(0, 0, 0), (1, 0, 16), (2**62, 2**40, 2**20), (0, 2**32 - 1, 3)])
def test_each_number_is_uniform(seed: int, first: int, stream: int) -> None:
    for column in numbers(seed, first, stream, 1 << 16).T:
        assert_counts(np.histogram(column, bins=256, range=(0, 1))[0], 1 / 256)


def test_what_is_used_together_is_independent() -> None:
    """Pairs within a block, of neighbouring photons, of neighbouring streams and of neighbouring seeds."""
    here = numbers(7, 0, 16, 1 << 16)
    neighbours = [
        *itertools.combinations(here.T, 2),
        *zip(here[:-1].T, here[1:].T, strict=True),
        *zip(here.T, numbers(7, 0, 17, 1 << 16).T, strict=True),
        *zip(here.T, numbers(8, 0, 16, 1 << 16).T, strict=True),
    ]
    for x, y in neighbours:
        assert_counts(np.histogram2d(x, y, bins=16, range=((0, 1), (0, 1)))[0], 1 / 256)


@given(seeds, indices, streams)
def test_numbers_lie_between_zero_and_one(seed: int, index: int, stream: int) -> None:
    block = numbers(seed, index, stream, 1)
    assert (block > 0.0).all()
    assert (block < 1.0).all()


@given(seeds, indices, streams, st.integers(0, 63), st.integers(0, 31))
@settings(max_examples=200)
def test_every_bit_of_the_address_counts(seed: int, index: int, stream: int, bit: int, stream_bit: int) -> None:
    block = numbers(seed, index, stream, 1)
    bit %= 63
    assert (block != numbers(seed ^ (1 << bit), index, stream, 1)).any()
    assert (block != numbers(seed, index ^ (1 << bit), stream, 1)).any()
    assert (block != numbers(seed, index, stream ^ (1 << stream_bit), 1)).any()


def test_streams_do_not_overlap() -> None:
    """Emission may use 16 streams, scattering one per bounce, the lit-volume estimate one per ray of a point."""
    assert STREAM_EMISSION + 16 <= STREAM_SCATTER < STREAM_LIT_VOLUME < STREAM_CAMERA < 2**32
