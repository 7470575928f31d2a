# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the extension's zip with Blender's own tool: `python -m scripts.build_extension [--platform …]`.

The checkout's files are copied to a temporary folder, together with the platform's wheels and a manifest that names
only these, and packed from there, so that nothing that happens to lie in the checkout gets into the zip. Needs the
bpy module (for its `blender_ext.py`) and git.
"""

from __future__ import annotations

import argparse
import importlib.util
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from .fetch_wheels import fetch
from .wheel_lock import FOLDER, PLATFORMS, ROOT, LockError, Wheel, host_platform, read_lock

MANIFEST = "blender_manifest.toml"


class BuildError(Exception):
    """The zip cannot be built."""


def git_files(*options: str) -> list[str]:
    """Return paths, relative to the root, that `git ls-files` lists and that exist."""
    command = ["git", "-C", str(ROOT), "ls-files", "-z", *options]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode:
        raise BuildError(f"git could not list the checkout's files: {result.stderr.strip()}")
    return [name for name in result.stdout.split("\0") if name and (ROOT / name).is_file()]


def restricted_manifest(text: str, platform: str, wheels: list[Wheel]) -> str:
    """Return the manifest's text with `platforms` and `wheels` cut down to one platform."""
    keep = {wheel.filename for wheel in wheels}
    text = re.sub(r"^platforms = .*$", f'platforms = ["{platform}"]', text, flags=re.MULTILINE)
    lines = [line for line in text.splitlines() if ".whl" not in line or line.strip(' ",').rpartition("/")[2] in keep]
    text = "\n".join(lines) + "\n"
    manifest = tomllib.loads(text)
    if manifest["platforms"] != [platform] or len(manifest["wheels"]) != len(wheels):
        raise BuildError(f"{MANIFEST} does not list the wheels of wheels.lock, one a line: run `make lock`")
    return text


def stage(folder: Path, platform: str, wheels: list[Wheel]) -> None:
    """Fill `folder` with what the zip is packed from."""
    uncommitted = git_files("--others", "--exclude-standard")
    if uncommitted:
        print(f"note: {len(uncommitted)} files are not known to git and are packed like the others")
    for name in git_files() + uncommitted:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name)
    (folder / FOLDER.name).mkdir()
    for wheel in wheels:
        shutil.copy2(FOLDER / wheel.filename, folder / FOLDER.name)
    manifest = restricted_manifest((ROOT / MANIFEST).read_text(encoding="utf-8"), platform, wheels)
    (folder / MANIFEST).write_text(manifest, encoding="utf-8")


def blender_ext() -> Path:
    """Return the path of Blender's packaging tool, which the bpy module brings along."""
    spec = importlib.util.find_spec("bpy")
    for folder in (spec and spec.submodule_search_locations) or []:
        for path in Path(folder).glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py"):
            return path
    raise BuildError("this Python has no bpy module with Blender's packaging tool: pip install -r requirements.txt")


def run_blender_ext(*arguments: str) -> None:
    """Run Blender's packaging tool, with its list of valid tags; raise `BuildError` if it refuses."""
    tool = blender_ext()
    tags = tool.parents[3] / "modules/_bpy_internal/extensions/tags.py"
    if subprocess.run([sys.executable, str(tool), *arguments, f"--valid-tags={tags}"], check=False).returncode:
        raise BuildError(f"blender_ext.py {arguments[0]} failed")


def build(platform: str, output: Path) -> Path:
    """Build and validate the zip for a platform, a key of `PLATFORMS`; return its path in the folder `output`."""
    wheels = [wheel for wheel in read_lock() if wheel.platform == platform]
    fetch(wheels)
    manifest = tomllib.loads((ROOT / MANIFEST).read_text(encoding="utf-8"))
    path = output.resolve() / f"{manifest['id']}-{manifest['version']}-{platform}.zip"
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as temporary:
        stage(Path(temporary), platform, wheels)
        run_blender_ext("build", f"--source-dir={temporary}", f"--output-filepath={path}")
    run_blender_ext("validate", str(path))
    return path


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--platform", choices=[*PLATFORMS, "all"], help="default: this machine's")
    parser.add_argument("--output", type=Path, default=ROOT / "dist", metavar="FOLDER", help="default: dist")
    options = parser.parse_args()
    try:
        chosen = options.platform or host_platform()
        for platform in PLATFORMS if chosen == "all" else [chosen]:
            build(platform, options.output)
    except (BuildError, LockError) as error:
        sys.exit(f"build_extension: {error}")


if __name__ == "__main__":
    main()
