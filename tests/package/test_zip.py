# SPDX-License-Identifier: GPL-3.0-or-later
"""The zip holds the extension for one platform and nothing else."""

from __future__ import annotations

import tomllib
from pathlib import Path, PurePosixPath
from zipfile import ZipFile

from scripts.wheel_lock import host_platform, read_lock


def test_name_says_version_and_platform(extension_zip: Path) -> None:
    with ZipFile(extension_zip) as archive:
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
    assert extension_zip.name == f"irradiance_vector_grid-{manifest['version']}-{host_platform()}.zip"
    assert manifest["platforms"] == [host_platform()]


def test_holds_this_platforms_wheels_unmodified(extension_zip: Path) -> None:
    expected = {f"wheels/{wheel.filename}" for wheel in read_lock() if wheel.platform == host_platform()}
    with ZipFile(extension_zip) as archive:
        packed = {name for name in archive.namelist() if name.startswith("wheels/")}
        manifest = tomllib.loads(archive.read("blender_manifest.toml").decode())
    assert packed == expected
    assert {name.removeprefix("./") for name in manifest["wheels"]} == expected


def test_holds_the_extension_and_nothing_else(extension_zip: Path) -> None:
    with ZipFile(extension_zip) as archive:
        names = [PurePosixPath(name) for name in archive.namelist()]
    assert {name.parts[0] for name in names} == {
        "CHANGELOG.md",
        "LICENSE",
        "README.md",
        "__init__.py",
        "blender_manifest.toml",
        "ivg_addon",
        "operators",
        "wheels",
    }
    hidden = [name for name in names if any(part.startswith(".") for part in name.parts)]
    compiled = [name for name in names if name.suffix in {".pyc", ".nbi", ".nbc"}]
    assert hidden == compiled == []
