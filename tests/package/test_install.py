# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip works in a Blender that knows nothing of this checkout and has none of its packages."""

from __future__ import annotations

import os
import subprocess
import sys
import sysconfig
from pathlib import Path

from scripts.lock_wheels import requirements

#: Packages that must come out of the extension's wheels: the child process gets all others.
BUNDLED = tuple(requirement.partition("==")[0] for requirement in requirements())
#: What is imported, where its name differs from the package's.
MODULES = {"openexr": "OpenEXR"}


def folder_without_bundled_packages(folder: Path) -> Path:
    """Return `folder`, filled with links to this environment's packages except the bundled ones."""
    folder.mkdir()
    for path in Path(sysconfig.get_path("platlib")).iterdir():
        if not path.name.lower().startswith(BUNDLED) and path.suffix != ".pth":
            (folder / path.name).symlink_to(path)
    return folder


def test_installed_extension_bakes(extension_zip: Path, tmp_path: Path) -> None:
    resources = tmp_path / "resources"
    packages = folder_without_bundled_packages(tmp_path / "packages")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA_", "PYTHON"))}
    environment |= {
        "BLENDER_USER_RESOURCES": str(resources),
        "HOME": str(tmp_path),
        "PYTHONPATH": str(packages),
    }
    # -S: without site, the environment's own packages, and so its numba, are out of reach.
    command = [sys.executable, "-S", str(Path(__file__).with_name("use_installed_extension.py"))]
    command += [str(extension_zip), str(tmp_path / "room.ivg.npz")]
    command += [MODULES.get(name, name) for name in BUNDLED]
    result = subprocess.run(
        command, cwd=tmp_path, env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False,
        timeout=600,
    )  # fmt: skip
    assert result.returncode == 0, result.stdout + result.stderr
