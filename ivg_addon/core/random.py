# SPDX-License-Identifier: GPL-3.0-or-later
"""Counter-based random numbers: the number depends on what it is for, not on when it is asked.

Philox-4x32-10 of Salmon, Moraes, Dror & Shaw, "Parallel Random Numbers: As Easy as 1, 2, 3"
(SC 2011). The key is the seed; the counter is (photon index, stream). So a photon's whole life is
the same whatever thread, batch or machine traces it.
"""

from __future__ import annotations

import numpy as np

from .compiled import inlined

STREAM_EMISSION = 0
"""First of the streams that emission may use (0 to 15)."""
STREAM_SCATTER = 16
"""Scattering at a photon's bounce b draws from stream 16 + b."""
STREAM_LIT_VOLUME = 1 << 20
"""First of the streams of the lit-volume estimate; the counter is then the point's index."""
STREAM_PARTITION = 3 << 19
"""The stream of the points that tell the sides of thin walls apart; the counter is then the voxel's index."""
STREAM_CAMERA = 1 << 21
"""First of the streams of camera rays; the counter is then the pixel's index."""

_M0 = np.uint64(0xD2511F53)
_M1 = np.uint64(0xCD9E8D57)
_W0 = np.uint32(0x9E3779B9)
_W1 = np.uint32(0xBB67AE85)
_LOW = np.uint64(0xFFFFFFFF)
_32 = np.uint64(32)
_TO_UNIT = 1.0 / 4294967296.0


@inlined
def philox4x32(c0, c1, c2, c3, k0, k1):
    """Return the four uint32 that Philox-4x32-10 makes of a counter (c0…c3) and a key (k0, k1)."""
    for _ in range(10):
        p0 = _M0 * np.uint64(c0)
        p1 = _M1 * np.uint64(c2)
        c0, c1, c2, c3 = (
            np.uint32(p1 >> _32) ^ c1 ^ k0,
            np.uint32(p1 & _LOW),
            np.uint32(p0 >> _32) ^ c3 ^ k1,
            np.uint32(p0 & _LOW),
        )
        k0 = np.uint32(k0 + _W0)
        k1 = np.uint32(k1 + _W1)
    return c0, c1, c2, c3


@inlined
def random4(seed, index, stream):
    """Return four independent float64, uniform in (0, 1), addressed by (seed, index, stream).

    `seed` and `index` are 64-bit, `stream` 32-bit unsigned counts. Values lie at the centres of
    2³² equal intervals, so neither 0 nor 1 ever comes.
    """
    seed64 = np.uint64(seed)
    index64 = np.uint64(index)
    r0, r1, r2, r3 = philox4x32(
        np.uint32(index64 & _LOW),
        np.uint32(index64 >> _32),
        np.uint32(stream),
        np.uint32(0),
        np.uint32(seed64 & _LOW),
        np.uint32(seed64 >> _32),
    )
    return (
        (r0 + 0.5) * _TO_UNIT,
        (r1 + 0.5) * _TO_UNIT,
        (r2 + 0.5) * _TO_UNIT,
        (r3 + 0.5) * _TO_UNIT,
    )
