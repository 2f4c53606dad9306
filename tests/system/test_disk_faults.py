"""Full disks, folders that cannot be written, results that are there: one message, and what is there stays."""

import errno
import json
import os
import re
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from structures import run_command

import blockvis
from blockvis.cli import main

CASE = """
[geometry]
layout = "arch"
[geometry.parameters]
voussoirs = 8
[settlement]
direction = [1.0, 0.0]
increment = 0.02
limit = 0.06
[output]
animation = "collapse.gif"
"""


@pytest.fixture
def case(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(CASE, encoding="utf-8")
    return path


@contextmanager
def _mounted(folder: Path, options: str):
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
    if sys.platform != "linux" or os.geteuid() != 0 or subprocess.run(command, capture_output=True).returncode != 0:
        pytest.skip("only root on Linux can mount a small disk")
    try:
        yield
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def _run(*arguments):
    """The command line in a process of its own: VTK's writer used to end it on a full disk."""
    command = [sys.executable, "-m", "blockvis", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)


@pytest.mark.thorough
def test_full_disk_keeps_what_is_there_and_the_run_resumes(case, tmp_path):
    disk = tmp_path / "disk"
    with _mounted(disk, "size=100k"):
        for size in ("100k", "300k"):
            subprocess.run(["mount", "-o", f"remount,size={size}", str(disk)], check=True)
            done = _run("run", case, "-o", disk / "out", "--force")
            assert done.returncode == 2, (size, done.stderr)
            assert "No space left on device" in done.stderr
            assert f"blockvis run --resume {disk / 'out'}" in done.stderr
            assert "Traceback" not in done.stderr
            assert not list((disk / "out").rglob(".*part*")), "half files are taken away"
            if (disk / "out" / "assembly.npz").exists():
                blockvis.open_results(disk / "out")
        subprocess.run(["mount", "-o", "remount,size=50m", str(disk)], check=True)
        assert run_command("--resume", disk / "out") == 0
        assert run_command(case, "-o", tmp_path / "out") == 0
        whole, rest = (
            (f / "response.csv").read_text(encoding="utf-8").splitlines() for f in (tmp_path / "out", disk / "out")
        )
        assert [row.rsplit(",", 1)[0] for row in whole] == [row.rsplit(",", 1)[0] for row in rest]


def test_read_only_folder(case, tmp_path, capsys):
    with _mounted(tmp_path / "disk", "ro"):
        assert run_command(case, "-o", tmp_path / "disk" / "out") == 2
    assert "Read-only file system; choose another folder with -o" in capsys.readouterr().err


@pytest.mark.thorough
def test_a_folder_whose_name_is_not_utf_8(case, tmp_path):
    """As old archives and shares have them."""
    folder = tmp_path / os.fsdecode(b"caf\xe9")
    try:
        folder.mkdir()
    except OSError:
        pytest.skip("this file system takes UTF-8 alone")
    case.rename(folder / "case.toml")
    assert run_command(folder / "case.toml", "-o", folder / "out") == 0
    record = json.loads((folder / "out" / "run.json").read_text(encoding="utf-8"))
    assert record["case_file"] == str(folder / "case.toml")


@pytest.mark.thorough
def test_what_could_not_be_written_is_named(case, tmp_path, capsys, monkeypatch):
    """By its own name, no temporary one, and a run that goes on says how to go on again."""
    assert run_command(case, "-o", tmp_path / "out", "--no-pictures", "--no-check-steps") == 0
    monkeypatch.setattr(Path, "write_bytes", _full)
    monkeypatch.setattr(Path, "write_text", _full)
    assert main(["report", str(tmp_path / "out")]) == 2
    assert re.search(r"blockvis: '.*/out/report\.html': No space left on device", capsys.readouterr().err)
    (tmp_path / "out" / "summary.json").unlink()
    assert run_command("--resume", tmp_path / "out", "--no-pictures", "--no-check-steps") == 2
    said = f"could not write to '{tmp_path / 'out'}': No space left on device; what is there stays as it is: make room"
    assert said in capsys.readouterr().err


@pytest.mark.thorough
def test_a_folder_that_is_moved_during_the_run_is_not_made_again(case, tmp_path, monkeypatch):
    """Made again it held half of the run, which could be neither opened nor resumed."""
    folders = sys.modules[blockvis.run_case.__module__].ResultsFolder
    # Before the first increment.
    monkeypatch.setattr(folders, "tell", lambda results, _: results.path.rename(results.path.with_name("moved")))
    with pytest.raises(OSError, match=r"out' was moved or removed during the run; .* --resume FOLDER"):
        blockvis.run_case(case, tmp_path / "out", outputs=[])
    monkeypatch.undo()
    assert not (tmp_path / "out").exists()
    assert run_command("--resume", tmp_path / "moved", "--no-pictures", "--no-check-steps") == 0


def _full(path: Path, *_: object, **__: object) -> int:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))


def test_a_file_where_the_folder_should_be(case, tmp_path, capsys):
    (tmp_path / "out").write_text("mine", encoding="utf-8")
    for name in ("out", "out/below"):
        assert run_command(case, "-o", tmp_path / name) == 2
        assert "choose" in capsys.readouterr().err
    assert (tmp_path / "out").read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize(
    "name", ["report.html", "curve.png", "response.csv", "summary.json", "assembly.npz", "blocks.pvd"]
)
def test_nothing_of_that_name_is_overwritten_without_force(case, tmp_path, capsys, name):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / name).write_text("mine", encoding="utf-8")
    assert run_command(case, "-o", tmp_path / "out") == 2
    said = capsys.readouterr().err
    assert f"({name})" in said
    assert "--force" in said
    assert [p.name for p in (tmp_path / "out").iterdir()] == [name]
    assert (tmp_path / "out" / name).read_text(encoding="utf-8") == "mine"
