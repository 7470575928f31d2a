# SPDX-License-Identifier: GPL-3.0-or-later
"""Fetch the wheels of wheels.lock into wheels/ with pip, and verify them.

`python -m scripts.fetch_wheels [PLATFORM …]`: those for this machine's platform, or for the ones named, or for `all`.
Files that are there already are verified and kept.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from itertools import groupby
from pathlib import Path

from .wheel_lock import FOLDER, PLATFORMS, LockError, Wheel, host_platform, read_lock, sha256_of


def pip_download(requirements: list[str], python_tag: str, platform_tags: list[str], folder: Path) -> None:
    """Download wheels for another interpreter or system than this one; a requirement may carry a hash."""
    with tempfile.TemporaryDirectory() as temporary:
        listing = Path(temporary, "requirements.txt")
        listing.write_text("\n".join(requirements) + "\n", encoding="utf-8")
        command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", "download"]
        command += ["--no-deps", "--only-binary=:all:", "--dest", str(folder), "--requirement", str(listing)]
        command += ["--implementation=cp", f"--abi={python_tag}", f"--python-version={python_tag.removeprefix('cp')}"]
        command += [f"--platform={tag}" for tag in platform_tags]
        if subprocess.run(command, check=False).returncode:
            raise LockError(f"pip could not fetch {', '.join(requirements)} for {python_tag}, {platform_tags[0]}")


def verify(wheel: Wheel, folder: Path) -> bool:
    """Return whether the wheel is there; raise `LockError` if it is not the one that the lock describes."""
    path = folder / wheel.filename
    if not path.exists():
        return False
    if sha256_of(path) != wheel.sha256:
        raise LockError(f"{path}: its SHA-256 is not the one in wheels.lock; delete the file and fetch it again")
    return True


def fetch(wheels: list[Wheel], folder: Path = FOLDER) -> None:
    """Bring `folder` to hold `wheels`, each with the contents that the lock describes.

    Raises
    ------
    LockError
        If a wheel cannot be had, or is another file than the lock describes.
    """
    folder.mkdir(exist_ok=True)
    missing = [wheel for wheel in wheels if not verify(wheel, folder)]

    def tags(wheel: Wheel) -> tuple[str, list[str]]:
        return wheel.python_tag, wheel.platform_tags

    for (python_tag, platform_tags), group in groupby(sorted(missing, key=tags), key=tags):
        requirements = [f"{wheel.requirement} --hash=sha256:{wheel.sha256}" for wheel in group]
        pip_download(requirements, python_tag, platform_tags, folder)
    for wheel in missing:
        if not verify(wheel, folder):
            raise LockError(f"pip fetched another file than {wheel.filename}")


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("platforms", nargs="*", metavar="PLATFORM", help=f"{', '.join(PLATFORMS)} or all")
    chosen = parser.parse_args().platforms
    try:
        platforms = list(PLATFORMS) if "all" in chosen else chosen or [host_platform()]
        if unknown := set(platforms) - set(PLATFORMS):
            parser.error(f"no such platform: {', '.join(sorted(unknown))}; there are {', '.join(PLATFORMS)} and all")
        wheels = [wheel for wheel in read_lock() if wheel.platform in platforms]
        fetch(wheels)
    except LockError as error:
        sys.exit(f"fetch_wheels: {error}")
    megabytes = sum((FOLDER / wheel.filename).stat().st_size for wheel in wheels) / 1e6
    print(f"{len(wheels)} wheels for {', '.join(platforms)}, {megabytes:.0f} MB, verified in {FOLDER.name}/")


if __name__ == "__main__":
    main()
