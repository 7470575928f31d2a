# SPDX-License-Identifier: GPL-3.0-or-later
"""`python -m ivg_addon …`: what it prints where, and its exit status. Each call starts Blender: few."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from ivg_addon.blender.command_line import DONE, FAILED, INTERRUPTED, WRONG_USAGE, main
from ivg_addon.core import IrradianceVectorGrid, vdb_grid
from ivg_addon.core.grid_parts import digest

from .stored_grids import in_fresh_process

ROOT = Path(__file__).resolve().parents[2]
CORNELL = ROOT / "sample_blend" / "cornell.blend"
PROGRAM = (sys.executable, "-m", "ivg_addon")


def run(*arguments: str | Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command as a user would, from the checkout."""
    command = [*PROGRAM, *(str(argument) for argument in arguments)]
    return subprocess.run(
        command, cwd=ROOT, env=os.environ | environment, capture_output=True, text=True, check=False, timeout=300
    )


def one_error(result: subprocess.CompletedProcess[str]) -> str:
    """Return the only line of standard error that is not progress."""
    lines = [line for line in result.stderr.splitlines() if line.startswith("ivg: ")]
    assert len(lines) == 1, result.stderr
    assert result.stderr.splitlines()[-1] == lines[0]
    assert result.stdout == ""
    return lines[0]


@pytest.fixture(scope="module")
def baked(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, subprocess.CompletedProcess[str]]:
    """Return a folder with the outcome of a small bake, and what the command said."""
    folder = tmp_path_factory.mktemp("baked")
    options = "--photons 2e4 --resolution 3 4 5 --seed 7 --bounces 3 --estimator crossing --threads 1".split()
    kept = ["--out", folder / "room.ivg.npz", "--save-blend", folder / "kept.blend", "--materials"]
    return folder, run("bake", CORNELL, *options, *kept)


def test_bake_prints_what_it_did(baked: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    folder, result = baked
    assert result.returncode == DONE, result.stderr
    assert "Traceback" not in result.stderr
    labels = [line.partition(":")[0] for line in result.stdout.splitlines()]
    assert {"File", "Grid", "Settings", "Photons", "Light", "Time", "Saved"} <= set(labels)
    for word in ("20,000 photons", "a second", "emitted", "absorbed", "escaped", "3 × 4 × 5"):
        assert word in result.stdout
    assert "Read blend" not in result.stdout
    assert "Tracing photons" in result.stderr
    assert {path.name for path in folder.iterdir()} == {"room.ivg.npz", "room.ivg.vdb", "kept.blend"}


def test_bake_uses_its_options(baked: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    record = IrradianceVectorGrid.load(baked[0] / "room.ivg.npz").record
    used = record.settings
    assert record.scene == "Cornell Box"
    assert (used.photons, used.resolution, used.seed, used.bounces) == (20_000, (3, 4, 5), 7, 3)
    assert (used.estimator, used.threads, used.include_direct) == ("CROSSING", 1, False)


def test_saved_blend_brings_the_settings_of_the_next_bake(
    baked: tuple[Path, subprocess.CompletedProcess[str]],
) -> None:
    """Without options, a bake is as set in the .blend; the grid goes beside it."""
    folder, _ = baked
    (folder / "room.ivg.npz").unlink()
    result = run("bake", folder / "kept.blend", "--photons", "1000")
    assert result.returncode == DONE, result.stderr
    used = IrradianceVectorGrid.load(folder / "room.ivg.npz").record.settings
    assert (used.photons, used.resolution, used.seed, used.estimator) == (1_000, (3, 4, 5), 7, "CROSSING")


def test_saved_blend_has_the_grid(baked: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    """In its image to the bit, and in its volume, whose file lies beside it and is found from there."""
    folder, _ = baked
    code = """
bpy.ops.wm.open_mainfile(filepath=arguments[0])
image = bpy.context.scene.ivg.grid
print(image.name, digest(storage.load_grid(image)), storage.problem(image) or 'intact', bpy.data.volumes[0].filepath)
"""
    expected = digest(vdb_grid.load(folder / "room.ivg.vdb"))
    told = in_fresh_process(code, folder / "kept.blend")
    assert told == f"IVG Cornell Box {expected} intact //room.ivg.vdb"


def test_a_blend_saved_with_materials_renders_with_the_grid(
    baked: tuple[Path, subprocess.CompletedProcess[str]], tmp_path: Path
) -> None:
    code = """
from ivg_addon.blender import direct_light, material_light
bpy.ops.wm.open_mainfile(filepath=arguments[0])
lit = [(material.name, material_light.grid_of(material).name) for material in material_light.lit_materials()]
print(lit, direct_light.is_direct_only(bpy.context.scene), bpy.context.scene.cycles.diffuse_bounces)
"""
    lit = [(name, "IVG Cornell Box") for name in ("Green", "Red", "White")]
    assert in_fresh_process(code, baked[0] / "kept.blend") == f"{lit} True 0"
    assert "3 with the light of the grid" in baked[1].stdout
    told = one_error(run("bake", CORNELL, "--materials", "--out", tmp_path / "a.ivg.npz"))
    assert "--save-blend" in told


def test_a_bake_that_is_not_saved_leaves_its_file_only(tmp_path: Path) -> None:
    path = tmp_path / "room.ivg.npz"
    result = run("bake", CORNELL, "--photons", "1000", "--resolution", "2", "2", "2", "--out", path)
    assert result.returncode == DONE, result.stderr
    assert list(tmp_path.iterdir()) == [path]


def test_baking_over_a_saved_blend_keeps_a_second_grid_apart(tmp_path: Path) -> None:
    blend = tmp_path / "two.blend"
    options = ("--photons", "1000", "--resolution", "2", "2", "2", "--save-blend", blend)
    first = run("bake", CORNELL, *options, "--out", tmp_path / "a.ivg.npz")
    second = run("bake", blend, *options, "--grid", "Second", "--seed", "1", "--out", tmp_path / "b.ivg.npz")
    assert (first.returncode, second.returncode) == (DONE, DONE), second.stderr
    code = """
bpy.ops.wm.open_mainfile(filepath=arguments[0])
grids = storage.grids(bpy.data)
print([(image.name, digest(storage.load_grid(image)), storage.problem(image)) for image in grids])
"""
    digests = [digest(IrradianceVectorGrid.load(tmp_path / name)) for name in ("a.ivg.npz", "b.ivg.npz")]
    told = in_fresh_process(code, blend)
    assert told == str([("IVG Cornell Box", digests[0], ""), ("Second", digests[1], "")])


def test_info_needs_no_blender(baked: tuple[Path, subprocess.CompletedProcess[str]], tmp_path: Path) -> None:
    (tmp_path / "bpy.py").write_text("raise ImportError('no Blender here')", encoding="utf-8")
    result = run("info", baked[0] / "room.ivg.npz", PYTHONPATH=str(tmp_path))
    assert (result.returncode, result.stderr) == (DONE, "")
    assert "3 × 4 × 5 voxels" in result.stdout
    assert "Cornell Box" in result.stdout


def test_compare_at_points_prints_numbers(baked: tuple[Path, subprocess.CompletedProcess[str]]) -> None:
    grid = baked[0] / "room.ivg.npz"
    result = run("compare", CORNELL, grid, "--points", "20", "--samples", "16", "--directional", "report")
    assert result.returncode == DONE, result.stderr
    labels = [line.partition(":")[0] for line in result.stdout.splitlines()]
    assert labels[:3] == ["Points", "Free", "Surfaces"]
    assert "relative RMSE" in result.stdout


def newer_blend(folder: Path) -> Path:
    """Return a copy of a .blend that says that Blender 9.9 wrote it."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True)
    plain = folder / "plain.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(plain), copy=True, compress=False)
    content = plain.read_bytes()
    version = b"v%02d%02d" % bpy.app.version[:2]
    assert version in content[:32]
    path = folder / "newer.blend"
    path.write_bytes(content.replace(version, b"v0909", 1))
    return path


def part_of_a_blend(folder: Path) -> Path:
    """Return the first half of a .blend."""
    path = folder / "part.blend"
    path.write_bytes(CORNELL.read_bytes()[: CORNELL.stat().st_size // 2])
    return path


def other_file(folder: Path) -> Path:
    """Return a file that is something else."""
    path = folder / "other.blend"
    path.write_text("hello", encoding="utf-8")
    return path


def missing_file(folder: Path) -> Path:
    """Return the path of no file."""
    return folder / "missing.blend"


def a_folder(folder: Path) -> Path:
    """Return a folder."""
    return folder


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (newer_blend, "was saved by Blender 9.9"),
        (part_of_a_blend, "only part of one"),
        (other_file, "is not a .blend file"),
        (missing_file, "does not exist"),
        (a_folder, "is a folder"),
    ],
)
def test_bad_blend_is_one_clear_line(make: object, says: str, tmp_path: Path) -> None:
    path = make(tmp_path)  # type: ignore[operator]
    result = run("bake", path, "--out", tmp_path / "room.ivg.npz")
    assert result.returncode == FAILED
    line = one_error(result)
    assert says in line
    assert str(path) in line
    assert not (tmp_path / "room.ivg.npz").exists()


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="needs permissions that bind")
def test_unreadable_blend_is_one_clear_line(tmp_path: Path) -> None:
    path = tmp_path / "locked.blend"
    path.write_bytes(CORNELL.read_bytes())
    path.chmod(0)
    assert "permissions" in one_error(run("bake", path))


def test_unwritable_output_is_said_before_the_bake(tmp_path: Path) -> None:
    result = run("bake", CORNELL, "--out", tmp_path / "nowhere" / "room.ivg.npz")
    assert result.returncode == FAILED
    assert "choose a folder that exists" in one_error(result)
    assert "%" not in result.stderr, "work was done before the output was checked"


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["bake"],
        ["bake", "a.blend", "--photons", "many"],
        ["bake", "a.blend", "--photons", "0"],
        ["bake", "a.blend", "--resolution", "3", "4"],
        ["bake", "a.blend", "--resolution", "-1", "4", "5"],
        ["bake", "a.blend", "--bounds", "0", "0", "0"],
        ["bake", "a.blend", "--estimator", "guess"],
        ["compare", "a.blend"],
        ["sing"],
    ],
)
def test_wrong_usage(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments, "ivg") == WRONG_USAGE
    assert "usage: ivg" in capsys.readouterr().err


@pytest.mark.parametrize("arguments", [["--help"], ["bake", "--help"], ["compare", "--help"], ["info", "--help"]])
def test_help(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(arguments, "ivg") == DONE
    assert "usage: ivg" in capsys.readouterr().out


def test_foreign_grid_is_one_clear_line(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    path = other_file(tmp_path)
    assert main(["info", str(path)], "ivg") == FAILED
    written = capfd.readouterr()
    assert written.out == ""
    assert written.err.startswith(f"ivg: {path} is not a grid file")
    assert len(written.err.splitlines()) == 1


@pytest.mark.skipif(os.name != "posix", reason="sends a signal")
def test_interrupt_changes_nothing(baked: tuple[Path, subprocess.CompletedProcess[str]], tmp_path: Path) -> None:
    output = tmp_path / "room.ivg.npz"
    output.write_text("the last grid", encoding="utf-8")
    command = [*PROGRAM, "bake", str(CORNELL), "--out", str(output), "--photons", "1e9"]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        assert any("Tracing" in line for line in process.stderr)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert process.returncode == INTERRUPTED, err
    assert (out, err) == ("", "ivg: cancelled, nothing was changed\n")
    assert {path.name: path.read_text(encoding="utf-8") for path in tmp_path.iterdir()} == {
        "room.ivg.npz": "the last grid"
    }
