# SPDX-License-Identifier: GPL-3.0-or-later
"""Write wheels.lock, and the list of wheels in blender_manifest.toml, for the versions that requirements.in pins.

`python -m scripts.lock_wheels` downloads the whole matrix (some 560 MB): every package that Blender lacks, for every
platform and every Python of a Blender that the extension supports.
"""

from __future__ import annotations

import re
import sys
import tempfile
from pathlib import Path

from .fetch_wheels import pip_download
from .wheel_lock import LOCK, PLATFORMS, ROOT, LockError, Wheel, sha256_of

#: Blender 5.0; Blender 5.1 and later; Blender as some Linux distributions build it.
PYTHON_TAGS = ["cp311", "cp313", "cp314"]

#: The oldest systems that Blender 5 runs on, as far as the packages go back; pip adds what older wheels are called.
SYSTEM_TAGS = {
    "linux-x64": ["manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux2014_x86_64"],
    "windows-x64": ["win_amd64"],
    "macos-arm64": ["macosx_13_0_arm64"],
}

MANIFEST = ROOT / "blender_manifest.toml"


def requirements() -> list[str]:
    """Return what requirements.in pins and Blender lacks: `["embreex==4.4.0.post1", …]`."""
    text = (ROOT / "requirements.in").read_text(encoding="utf-8")
    pins: list[str] = re.findall(r"^[\w-]+==\S+", text, re.MULTILINE)
    return [pin for pin in pins if not pin.startswith(("bpy==", "numpy=="))]


def download_matrix(folder: Path) -> list[Wheel]:
    """Download every wheel into `folder` and return them, sorted by file name."""
    for name in PLATFORMS:
        for python_tag in PYTHON_TAGS:
            pip_download(requirements(), python_tag, SYSTEM_TAGS[name], folder)
    return [Wheel(path.name, sha256_of(path)) for path in sorted(folder.glob("*.whl"))]


def with_wheels(manifest: str, wheels: list[Wheel]) -> str:
    """Return the manifest's text with its list of wheels replaced."""
    listing = "".join(f'  "./wheels/{wheel.filename}",\n' for wheel in wheels)
    text, count = re.subn(r"^wheels = \[\n.*?^\]\n", f"wheels = [\n{listing}]\n", manifest, flags=re.M | re.S)
    if count != 1:
        raise LockError("blender_manifest.toml has no list that starts with the line 'wheels = ['")
    return text


def main() -> None:
    """Run the command line."""
    try:
        with tempfile.TemporaryDirectory() as temporary:
            wheels = download_matrix(Path(temporary))
        MANIFEST.write_text(with_wheels(MANIFEST.read_text(encoding="utf-8"), wheels), encoding="utf-8")
        LOCK.write_text("".join(f"{wheel.sha256}  {wheel.filename}\n" for wheel in wheels), encoding="utf-8")
    except LockError as error:
        sys.exit(f"lock_wheels: {error}")
    print(f"{len(wheels)} wheels locked")


if __name__ == "__main__":
    main()
