# SPDX-License-Identifier: GPL-3.0-or-later
"""Questions of no meaning, for a second Blender."""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

from ivg_addon.blender.asking import Find
from ivg_addon.blender.jobs import Steps
from ivg_addon.core.errors import SceneError
from ivg_addon.core.progress import Progress


def wait(find: Find, seconds: float) -> Steps[None]:
    """Answer after a while."""
    yield Progress("Waiting", 0.0)
    time.sleep(seconds)


def leave_a_file(find: Find) -> Steps[None]:
    """Leave a temporary file behind."""
    yield Progress("Waiting", 0.0)
    Path(tempfile.mkdtemp(), "left").write_text("left")


def process(find: Find) -> Steps[int]:
    """Tell which process answers."""
    yield Progress("Answering", 0.0)
    return os.getpid()


def refuse(find: Find, kind: str) -> Steps[None]:
    """Fail."""
    yield Progress("Failing", 0.0)
    if kind == "ours":
        raise SceneError("no light")
    if kind == "crash":
        os.write(2, b"a wild crash\n")
        os.abort()
    raise ValueError("not foreseen")
