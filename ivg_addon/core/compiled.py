# SPDX-License-Identifier: GPL-3.0-or-later
"""The one place where Numba is configured: how kernels are compiled and where they are kept.

Every kernel of this package is compiled by `kernel`, so that they agree on semantics: no fast
math (the same seed must give the same bits), the GIL released, machine code kept on disk.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

from .errors import DependencyError

try:
    import numba
except Exception as error:  # a broken llvmlite raises OSError, a wrong numpy ImportError
    raise DependencyError(
        f"numba does not load ({error}): reinstall the extension for this Blender, "
        "or `pip install numba` for this Python"
    ) from error

Kernel = TypeVar("Kernel", bound=Callable[..., Any])


def _fingerprint() -> str:
    """Return a digest of this package's sources.

    Numba looks at a kernel's own file to tell whether its machine code is stale, but not at the
    files of the functions that were inlined into it.
    """
    digest = hashlib.blake2b(digest_size=8)
    for source in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()


def set_cache_folder(folder: Path) -> None:
    """Keep compiled kernels in a folder of this version in `folder`; before the first is defined.

    Numba's own default is beside the code, which may be read-only and is no place for files.
    """
    numba.config.CACHE_DIR = str(folder / _fingerprint())  # type: ignore[attr-defined]


if not numba.config.CACHE_DIR:  # type: ignore[attr-defined]
    set_cache_folder(
        Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache", "irradiance_vector_grid")
        if os.access(Path.home(), os.W_OK)
        else Path(tempfile.gettempdir(), "irradiance_vector_grid")
    )


def kernel(function: Kernel) -> Kernel:
    """Compile `function` with Numba: no Python objects, the GIL released, cached on disk."""
    return cast(Kernel, numba.njit(nogil=True, cache=True, error_model="numpy")(function))


def inlined(function: Kernel) -> Kernel:
    """Compile a small function that kernels call; LLVM inlines it into them."""
    return cast(Kernel, numba.njit(error_model="numpy")(function))


def merged(function: Kernel) -> Kernel:
    """Compile a small function that takes arrays, as if its text stood where it is called.

    A call, though LLVM inlines it, counts references to every array it is handed: 100 ns for a
    tuple of ten. So functions of arrays that run once per photon are merged by Numba itself; it
    costs compilation time, which is why functions of numbers are `inlined`.
    """
    return cast(Kernel, numba.njit(error_model="numpy", inline="always")(function))
