# SPDX-License-Identifier: GPL-3.0-or-later
"""A fingerprint of what was baked, to tell a stale grid from a fresh one."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Sequence
from typing import Any

import numpy as np


def checksum(value: Any) -> str:
    """Return 32 hexadecimal digits of a dataclass, array, number, text, or nesting of them.

    Equal content gives equal digits in every process; an array's type and shape count as content.
    """
    digest = hashlib.blake2b(digest_size=16)
    _feed(digest, value)
    return digest.hexdigest()


def checksum_of(value: Any, names: Sequence[str]) -> str:
    """Return the checksum that a dataclass would have with no fields but these."""
    digest = hashlib.blake2b(digest_size=16)
    for name in names:
        digest.update(name.encode())
        _feed(digest, getattr(value, name))
    return digest.hexdigest()


def _feed(digest: hashlib.blake2b, value: Any) -> None:
    """Add one value to the digest, with its kind, so that different nestings differ."""
    if dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            digest.update(field.name.encode())
            _feed(digest, getattr(value, field.name))
    elif isinstance(value, np.ndarray):
        digest.update(f"{value.dtype.str}{value.shape}".encode())
        digest.update(np.ascontiguousarray(value).data)
    elif isinstance(value, (tuple, list)):
        digest.update(f"({len(value)}".encode())
        for item in value:
            _feed(digest, item)
    else:
        digest.update(f"{type(value).__name__}:{value!r};".encode())
