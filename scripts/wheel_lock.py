# SPDX-License-Identifier: GPL-3.0-or-later
"""The wheels that the extension ships, as wheels.lock names them: one `sha256  file name` per line.

The format is sha256sum's, so `cd wheels && sha256sum --check ../wheels.lock` verifies a full set by hand.
"""

from __future__ import annotations

import hashlib
import platform
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LOCK = ROOT / "wheels.lock"
FOLDER = ROOT / "wheels"

#: Blender's platform names, each with the start and the end of the wheel tags that run on it.
PLATFORMS = {
    "linux-x64": ("manylinux", "x86_64"),
    "windows-x64": ("win", "amd64"),
    "macos-arm64": ("macosx", "arm64"),
}


class LockError(Exception):
    """A wheel, or the lock that describes it, is not what it should be."""


@dataclass(frozen=True)
class Wheel:
    """One line of wheels.lock."""

    filename: str
    sha256: str

    @property
    def requirement(self) -> str:
        """What pip calls it: `numba==0.68.1`."""
        name, version = self.filename.split("-")[:2]
        return f"{name}=={version}"

    @property
    def python_tag(self) -> str:
        """The interpreter that it is made for: `cp313`."""
        return self.filename.split("-")[-3]

    def runs_in(self, python_tag: str) -> bool:
        """Return whether that interpreter loads it: its own one does, and a later one if it keeps to the stable ABI."""
        stable = self.filename.split("-")[-2] == "abi3"
        minor, wanted = (int(tag.removeprefix("cp3")) for tag in (self.python_tag, python_tag))
        return minor == wanted or (stable and minor < wanted)

    @property
    def platform_tags(self) -> list[str]:
        """The systems that it runs on, as the file name says: `["manylinux_2_27_x86_64", …]`."""
        return self.filename.removesuffix(".whl").split("-")[-1].split(".")

    @property
    def platform(self) -> str:
        """The same in Blender's words: a key of `PLATFORMS`."""
        for name, (start, end) in PLATFORMS.items():
            if all(tag.startswith(start) and tag.endswith(end) for tag in self.platform_tags):
                return name
        raise LockError(f"{self.filename} is for none of {', '.join(PLATFORMS)}")


def read_lock(path: Path = LOCK) -> list[Wheel]:
    """Return the wheels that the lock lists, in its order."""
    wheels = []
    for line in path.read_text(encoding="utf-8").splitlines():
        sha256, _, filename = line.partition("  ")
        if len(sha256) != 64 or not filename.endswith(".whl"):
            raise LockError(f"{path.name}: not a line of the form 'sha256  file name': {line!r}")
        wheels.append(Wheel(filename, sha256))
    return wheels


def sha256_of(path: Path) -> str:
    """Return a file's SHA-256 in hexadecimal."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def host_platform() -> str:
    """Return this machine's platform in Blender's words; raise `LockError` if there are no wheels for it."""
    system, machine = platform.system().lower(), platform.machine().lower()
    system = {"darwin": "macos"}.get(system, system)
    machine = {"x86_64": "x64", "amd64": "x64", "aarch64": "arm64"}.get(machine, machine)
    name = f"{system}-{machine}"
    if name not in PLATFORMS:
        raise LockError(f"no wheels for {name}: there are {', '.join(PLATFORMS)}")
    return name
