# SPDX-License-Identifier: GPL-3.0-or-later
"""Independent pieces of work in several threads, step by step, so that they can be shown and cancelled."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

from .progress import Progress

Piece = TypeVar("Piece")
Found = TypeVar("Found")


def side_by_side_steps(
    work: Callable[[Piece], Found], pieces: Sequence[Piece], task: str, threads: int
) -> Generator[Progress, None, list[Found]]:
    """Return what `work` returns for each piece, in their order; `threads` is 0 for one per processor."""
    found: list[Found] = []
    with ThreadPoolExecutor(threads or os.cpu_count(), thread_name_prefix="ivg-pieces") as pool:
        futures = [pool.submit(work, piece) for piece in pieces]
        try:
            for future in futures:
                found.append(future.result())
                yield Progress(task, len(found) / len(pieces))
        finally:
            for future in futures:
                future.cancel()
    return found
