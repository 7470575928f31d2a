# SPDX-License-Identifier: GPL-3.0-or-later
"""Write the sample scenes beside this file: `python make_samples.py [NAME ...]`, over the bpy module.

A newer Blender opens the files of an older one, not the other way round: run this with the oldest
Blender that the extension supports.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

# Objects have settings of this extension.
sys.path.append(str(Path(__file__).resolve().parents[1]))

from sample_scenes.cornell import build_cornell, build_cornell_tilted
from sample_scenes.gallery import build_gallery
from sample_scenes.semi_dynamic import build_semi_dynamic
from sample_scenes.stage import save
from sample_scenes.two_rooms import build_two_rooms

SAMPLES: dict[str, Callable[[], None]] = {
    "cornell": build_cornell,
    "cornell_tilted": build_cornell_tilted,
    "two_rooms": build_two_rooms,
    "gallery": build_gallery,
    "semi_dynamic": build_semi_dynamic,
}


def make(name: str, folder: Path) -> Path:
    """Build a sample in this session, whose data it replaces, and return the .blend in `folder`."""
    SAMPLES[name]()
    path = folder / f"{name}.blend"
    save(path)
    return path


def main() -> None:
    """Write the scenes named on the command line, or all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"one of: {', '.join(SAMPLES)}")
    names = parser.parse_args().names or list(SAMPLES)
    unknown = [name for name in names if name not in SAMPLES]
    if unknown:
        parser.error(f"no sample named {', '.join(unknown)}; there are {', '.join(SAMPLES)}")
    for name in names:
        path = make(name, Path(__file__).resolve().parent)
        print(f"{path.name}: {path.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    main()
