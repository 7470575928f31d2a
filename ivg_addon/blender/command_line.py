# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line: `python -m ivg_addon …`, and `blender --command ivg …`.

Answers go to standard output, progress and errors to standard error. The exit status is 0 when
done, 1 after a failure with one line that says why, 2 for wrong usage, 130 when interrupted.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import math
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TextIO, TypeAlias

from ..core.errors import Cancelled, IvgError
from ..core.settings import Directional, Estimator, Spatial
from ..core.version import VERSION
from .interrupts import Interrupts

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"

DONE, FAILED, WRONG_USAGE, INTERRUPTED = 0, 1, 2, 130


def main(arguments: Sequence[str], program: str) -> int:
    """Run a command and return its exit status.

    Parameters
    ----------
    arguments
        The command and its options.
    program
        What the user typed before them, for the help.
    """
    try:
        options = build_parser(program).parse_args(arguments)
    except SystemExit as end:
        return int(end.code or DONE)
    try:
        with Interrupts() as interrupts, _own_output() as output:
            options.run(options, output, interrupts)
    except (KeyboardInterrupt, Cancelled):
        return _fail("cancelled, nothing was changed", INTERRUPTED)
    except IvgError as error:
        return _fail(str(error), FAILED)
    except Exception as error:
        if options.traceback:
            traceback.print_exc()
        return _fail(f"{error!r} (--traceback shows where: please report it)", FAILED)
    return DONE


def build_parser(program: str) -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    parser = argparse.ArgumentParser(
        prog=program,
        description="Precompute the indirect light of a scene into a grid of irradiance vectors.",
        epilog="Exit status: 0 done, 1 failed, 2 wrong usage, 130 cancelled.",
    )
    parser.add_argument("--version", action="version", version=f"%(prog)s {VERSION}")
    commands = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for add in (_add_bake, _add_compare, _add_export, _add_info):
        command = add(commands)
        command.add_argument("--traceback", action="store_true", help="show where an unexpected error arose")
    return parser


def _add_bake(commands: Commands) -> argparse.ArgumentParser:
    """Add `bake`."""
    bake = commands.add_parser(
        "bake",
        help="bake the light of a .blend into a grid file",
        description="Bake the light of a .blend into a grid file. What is not given is as set in the .blend.",
    )
    bake.add_argument("blend", type=Path, metavar="FILE.blend", help="the scene to bake")
    bake.add_argument(
        "--out",
        type=Path,
        metavar="GRID.ivg.npz",
        help="where to write the grid (beside the .blend)",
    )
    bake.add_argument(
        "--resolution",
        nargs="+",
        action=_Resolution,
        metavar="N",
        help="voxels along x, y and z; or the word auto: cubes, as many along the longest side as set in the .blend",
    )
    bake.add_argument(
        "--bounds",
        nargs=6,
        type=float,
        metavar=("X0", "Y0", "Z0", "X1", "Y1", "Z1"),
        help="the grid's box in metres (the scene's)",
    )
    bake.add_argument("--photons", type=_positive, help="photons to emit (8000000, or 8e6)")
    bake.add_argument("--bounces", type=_positive, help="most diffuse bounces of a photon (12)")
    bake.add_argument(
        "--estimator",
        type=str.upper,
        choices=[str(name) for name in Estimator],
        help="how a photon's flight is counted (TRACK_LENGTH)",
    )
    bake.add_argument("--seed", type=_not_negative, help="seed of the random numbers (0)")
    bake.add_argument("--threads", type=_not_negative, help="threads; 0 for all processors (0)")
    bake.add_argument(
        "--include-direct",
        action="store_true",
        default=None,
        help="store light that comes straight from the lights too",
    )
    bake.add_argument("--grid", metavar="NAME", help="name of the grid in the .blend (the scene's own grid)")
    bake.add_argument(
        "--save-blend",
        type=Path,
        metavar="OUT.blend",
        help="also save the scene, with the grid in it, these settings and the summary of the bake",
    )
    bake.add_argument(
        "--materials",
        action="store_true",
        help="with --save-blend: materials there have the grid's light, and renders compute direct light only",
    )
    bake.set_defaults(run=_run("bake"))
    return bake


def _add_compare(commands: Commands) -> argparse.ArgumentParser:
    """Add `compare`."""
    compare = commands.add_parser(
        "compare",
        help="compare a grid with Cycles: a picture and numbers",
        description="Render the camera's view by Cycles and by the grid, beside each other, and "
        "print how far they differ. What is not given is as set in the .blend.",
    )
    compare.add_argument("blend", type=Path, metavar="FILE.blend", help="the scene")
    compare.add_argument("grid", type=Path, metavar="GRID.ivg.npz", help="its baked grid")
    compare.add_argument("--out", type=Path, metavar="PICTURE.png", help="Cycles | grid | difference, as PNG and EXR")
    compare.add_argument(
        "--points",
        type=_positive,
        metavar="N",
        help="compare at N random points in free space and N on surfaces instead",
    )
    compare.add_argument("--spatial", type=str.upper, choices=[str(name) for name in Spatial], help="interpolation")
    compare.add_argument(
        "--directional",
        type=str.upper,
        choices=[str(name) for name in Directional],
        help="interpolation",
    )
    compare.add_argument(
        "--normal-bias",
        type=float,
        metavar="VOXELS",
        help="look up so many voxels above the surface",
    )
    compare.add_argument(
        "--samples",
        type=_positive,
        help="Cycles' paths per pixel (as the scene renders), or per point (1024)",
    )
    compare.set_defaults(run=_run("compare"))
    return compare


def _add_info(commands: Commands) -> argparse.ArgumentParser:
    """Add `info`."""
    info = commands.add_parser("info", help="tell what is in a grid file", description="Tell what is in a grid file.")
    info.add_argument("grid", type=Path, metavar="GRID.ivg.npz")
    info.set_defaults(run=_run("info"))
    return info


def _add_export(commands: Commands) -> argparse.ArgumentParser:
    """Add `export`."""
    export = commands.add_parser(
        "export",
        help="write a grid in other formats",
        description="Write a grid as an OpenVDB file, as half floats, or, from either of these, as a grid file again.",
    )
    export.add_argument("grid", type=Path, metavar="GRID", help="a .ivg.npz, .vdb or .ivg16.npz file")
    export.add_argument(
        "--vdb", type=Path, metavar="OUT.vdb", help="write OpenVDB: a vector grid per direction, channel"
    )
    export.add_argument("--compressed", type=Path, metavar="OUT.ivg16.npz", help="write half floats, 72 bytes a vertex")
    export.add_argument(
        "--form",
        type=str.upper,
        choices=("MOMENTS", "REPORT"),
        default="MOMENTS",
        help="what the half floats are: exact but for rounding, or as the report has them (MOMENTS)",
    )
    export.add_argument("--npz", type=Path, metavar="OUT.ivg.npz", help="write a grid file")
    export.set_defaults(run=_run("export"))
    return export


class _Resolution(argparse.Action):
    """Three positive whole numbers, or the word auto."""

    def __call__(
        self,
        parser: argparse.ArgumentParser,
        namespace: argparse.Namespace,
        values: str | Sequence[object] | None,
        option_string: str | None = None,
    ) -> None:
        """Store a tuple of three, or "auto"."""
        words = [str(value) for value in values or ()]
        if words == ["auto"]:
            namespace.resolution = "auto"
            return
        try:
            x, y, z = (_positive(word) for word in words)
        except (ValueError, argparse.ArgumentTypeError):
            raise argparse.ArgumentError(self, "expected three whole numbers above zero, or auto") from None
        namespace.resolution = (x, y, z)


def _positive(text: str) -> int:
    """Return a whole number above zero; 8e6 is one."""
    number = _not_negative(text)
    if number == 0:
        raise argparse.ArgumentTypeError("expected a whole number above zero")
    return number


def _not_negative(text: str) -> int:
    """Return a whole number from zero on; 8e6 is one."""
    try:
        number = float(text)
    except ValueError:
        number = math.nan
    if not (0 <= number < 2**31 and number.is_integer()):
        raise argparse.ArgumentTypeError(f"expected a whole number, not {text!r}")
    return int(number)


def _run(name: str) -> Callable[[argparse.Namespace, TextIO, Interrupts], None]:
    """Return the function that runs a command; its imports (Blender's) wait until it is called."""

    def run(options: argparse.Namespace, output: TextIO, interrupts: Interrupts) -> None:
        command = importlib.import_module(f".commands.{name}", __package__)
        interrupts.check()
        command.run(options, output, interrupts)

    return run


def _fail(message: str, status: int) -> int:
    """Say one line on standard error and return the status."""
    line = " ".join(message.split())
    sys.stderr.write(f"ivg: {line}\n")
    return status


@contextlib.contextmanager
def _own_output() -> Iterator[TextIO]:
    """Give standard output to our answers alone: what Blender prints there is dropped."""
    sys.stdout.flush()
    kept = os.dup(1)
    with open(os.devnull, "wb") as nothing:
        os.dup2(nothing.fileno(), 1)
    try:
        with os.fdopen(os.dup(kept), "w", encoding="utf-8") as output:
            yield output
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)
