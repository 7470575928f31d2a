# SPDX-License-Identifier: GPL-3.0-or-later
"""What is written down in two places says the same in both."""

from __future__ import annotations

import re
import tomllib
from itertools import product
from pathlib import Path

import pytest

from ivg_addon.core.version import VERSION
from scripts.lock_wheels import PYTHON_TAGS, requirements, with_wheels
from scripts.wheel_lock import PLATFORMS, ROOT, read_lock

MANIFEST = (ROOT / "blender_manifest.toml").read_text(encoding="utf-8")


def pins(filename: str) -> dict[str, set[str]]:
    """Return the versions of each package that a requirements file pins."""
    found: dict[str, set[str]] = {}
    for name, version in re.findall(r"^([\w-]+)==(\S+)", (ROOT / filename).read_text(encoding="utf-8"), re.MULTILINE):
        found.setdefault(name, set()).add(version)
    return found


def test_manifest_lists_the_locked_wheels() -> None:
    assert with_wheels(MANIFEST, read_lock()) == MANIFEST


@pytest.mark.parametrize(("platform", "python_tag"), list(product(PLATFORMS, PYTHON_TAGS)))
def test_each_blender_finds_one_wheel_of_each_package(platform: str, python_tag: str) -> None:
    wheels = [wheel for wheel in read_lock() if wheel.platform == platform and wheel.runs_in(python_tag)]
    assert sorted(wheel.requirement for wheel in wheels) == sorted(requirements())


def test_manifest_lists_the_locked_platforms() -> None:
    assert tomllib.loads(MANIFEST)["platforms"] == list(PLATFORMS)


@pytest.mark.parametrize("filename", ["requirements.txt", "requirements-dev.txt"])
def test_requirements_are_locked_at_the_pinned_versions(filename: str) -> None:
    locked = pins(filename)
    assert {name: locked[name] for name in pins("requirements.in")} == pins("requirements.in")


def test_changelog_starts_with_the_manifests_version() -> None:
    headings = re.findall(r"^## \[(.+?)\]", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert headings[:2] == ["Unreleased", tomllib.loads(MANIFEST)["version"]]


def test_code_says_the_manifests_version() -> None:
    assert tomllib.loads(MANIFEST)["version"] == VERSION


def test_name_is_one_that_the_extension_platform_accepts() -> None:
    assert "blender" not in tomllib.loads(MANIFEST)["name"].lower()


def test_tree_holds_no_machine_code_of_numba() -> None:
    folders = [ROOT / "ivg_addon", ROOT / "operators"]
    assert [path for folder in folders for path in Path(folder).rglob("*.nb[ic]")] == []
