# SPDX-License-Identifier: GPL-3.0-or-later
"""How much memory there is, and a clear refusal before more is asked for."""

from __future__ import annotations

import sys
from pathlib import Path

from .errors import MemoryLimitError


def human(size: float) -> str:
    """Return a size in bytes for people: ``1.5 GiB``."""
    for unit in ("bytes", "KiB", "MiB"):
        if size < 1024:
            return f"{size:.0f} {unit}"
        size /= 1024
    return f"{size:.1f} GiB"


def require(size: int, what: str, cure: str) -> None:
    """Raise `MemoryLimitError` when `size` bytes are more than this machine has to give.

    Grids are looked up with numpy and Numba alone: where psutil is missing too, nothing is known and nothing refused.
    """
    try:
        import psutil
    except ImportError:
        return
    available = psutil.virtual_memory().available
    if size > 0.9 * available:
        raise MemoryLimitError(f"{what} needs {human(size)} of memory, of which {human(available)} are free: {cure}")


def peak() -> int:
    """Return the most memory that this process has held so far, bytes."""
    if sys.platform == "win32":
        import psutil

        info = psutil.Process().memory_info()
        return int(getattr(info, "peak_wset"))  # noqa: B009 (a field that only Windows has)
    status = Path("/proc/self/status")
    if status.is_file():
        # Linux hands getrusage's figure on to child processes: this one is the process's own.
        (line,) = (line for line in status.read_text().splitlines() if line.startswith("VmHWM:"))
        return int(line.split()[1]) * 1024
    import resource

    return int(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss) * (1 if sys.platform == "darwin" else 1024)
