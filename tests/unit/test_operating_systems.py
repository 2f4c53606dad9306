"""What Windows and macOS do differently, as far as it can be shown on any system."""

import errno
import os
import subprocess
import sys
import types
from pathlib import Path

import pytest

from blockvis import generators, read_case, save_layout
from blockvis.cli import main
from blockvis.results import folder as results_folder
from blockvis.results.folder import ResultsExist, ResultsFolder
from blockvis.system import atomic_files, processes

CASE = '[geometry]\nlayout = "arch"\n[settlement]\ndirection = [1, 0]\n'


@pytest.fixture
def windows(monkeypatch):
    """The branches for Windows, with its refusal to flush what is open for reading only."""
    for module in (atomic_files, results_folder, processes):
        monkeypatch.setattr(module, "WINDOWS", True)
    opened, fsync = os.open, os.fsync
    modes = {}

    def noted(path, flags, *rest):
        if Path(path).is_dir():
            raise PermissionError(errno.EACCES, "Windows opens no folder", str(path))
        handle = opened(path, flags, *rest)
        modes[handle] = flags & (os.O_RDWR | os.O_WRONLY)
        return handle

    def flushed(handle):
        if not modes.get(handle, os.O_RDWR):
            raise OSError(errno.EBADF, "Bad file descriptor")
        fsync(handle)

    monkeypatch.setattr(os, "open", noted)
    monkeypatch.setattr(os, "fsync", flushed)


@pytest.fixture
def locks(monkeypatch):
    """The locks of Windows: of a file, held through one handle, let go when it is closed."""
    held = {}

    def locking(handle, mode, n):
        place = os.fstat(handle).st_ino
        if place in held:
            raise PermissionError(errno.EACCES, "Permission denied")
        held[place] = handle

    close = os.close

    def closed(handle):
        for place in [place for place, other in held.items() if other == handle]:
            del held[place]
        close(handle)

    monkeypatch.setattr(os, "close", closed)
    monkeypatch.setitem(sys.modules, "msvcrt", types.SimpleNamespace(LK_NBLCK=2, locking=locking))


def test_files_are_flushed_through_a_handle_that_may_write(windows, tmp_path):
    assert atomic_files.write_atomic(tmp_path / "new" / "a.csv", "1\n").read_bytes() == b"1\n"


def test_a_file_that_is_open_for_a_moment_is_waited_for(windows, tmp_path, monkeypatch):
    replace, refusals = os.replace, [1, 2]

    def busy(partial, path):
        if refusals:
            refusals.pop()
            raise PermissionError(errno.EACCES, "in use")
        replace(partial, path)

    monkeypatch.setattr(os, "replace", busy)
    atomic_files.write_atomic(tmp_path / "a.csv", "whole")
    assert (tmp_path / "a.csv").read_text(encoding="utf-8") == "whole"


def test_a_file_that_stays_open_is_named(windows, tmp_path, monkeypatch):
    def busy(partial, path):
        raise PermissionError(errno.EACCES, "in use")

    monkeypatch.setattr(atomic_files, "ATTEMPTS", (0.0,))
    monkeypatch.setattr(os, "replace", busy)
    with pytest.raises(PermissionError, match=r"another program has the file open.*a\.csv"):
        atomic_files.write_atomic(tmp_path / "a.csv", "whole")
    assert list(tmp_path.iterdir()) == [], "nothing half-written stays"


def test_a_run_holds_its_folder(windows, locks, tmp_path):
    assembly = generators.arch(voussoirs=5)
    first = ResultsFolder(tmp_path / "out", assembly)
    with pytest.raises(ResultsExist, match="another run is writing"):
        ResultsFolder(tmp_path / "out", assembly, overwrite=True)
    first._release()
    ResultsFolder(tmp_path / "out", assembly, overwrite=True)


def test_a_folder_that_cannot_be_flushed_is_no_error(tmp_path, monkeypatch):
    def refused(handle):
        raise OSError(errno.EINVAL, "Invalid argument")

    monkeypatch.setattr(os, "fsync", refused)
    atomic_files.flush(tmp_path)
    file = tmp_path / "file"
    file.write_bytes(b"1")
    with pytest.raises(OSError, match="Invalid argument"):
        atomic_files.flush(file)


def test_macos_flushes_the_memory_of_the_disk_too(tmp_path, monkeypatch):
    fcntl = pytest.importorskip("fcntl")
    asked = []
    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setattr(fcntl, "F_FULLFSYNC", 51, raising=False)
    monkeypatch.setattr(fcntl, "fcntl", lambda handle, what: asked.append(what))
    atomic_files.write_atomic(tmp_path / "a.csv", "1")
    assert asked == [51, 51], "the file and its folder"


def test_a_closed_pipe_is_no_error_of_the_input(windows):
    assert processes.is_broken_pipe(OSError(errno.EINVAL, "Invalid argument"))
    assert not processes.is_broken_pipe(OSError(errno.EINVAL, "Invalid argument", "a file"))
    assert not processes.is_broken_pipe(OSError(errno.ENOSPC, "No space left"))


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_a_case_of_a_windows_editor_is_read(tmp_path, ending):
    file = tmp_path / "case.toml"
    file.write_bytes(b"\xef\xbb\xbf" + CASE.replace("\n", ending).encode())
    assert read_case(file).layout == "arch"


def test_backslashes_in_a_path_are_explained(tmp_path, capsys):
    (tmp_path / "case.toml").write_text('[geometry]\nfile = "drawings\\wall.dxf"\n', encoding="utf-8")
    with pytest.raises(ValueError, match="write paths with / or in single quotes"):
        read_case(tmp_path / "case.toml")


def test_a_case_in_another_encoding_says_what_to_do(tmp_path):
    (tmp_path / "case.toml").write_bytes(CASE.encode("utf-16"))
    with pytest.raises(ValueError, match="save it in UTF-8"):
        read_case(tmp_path / "case.toml")


def test_names_that_a_console_cannot_show_are_escaped(tmp_path):
    layout = tmp_path / "layout.svg"
    save_layout(generators.portal(), layout)
    layout.write_text(layout.read_text(encoding="utf-8").replace("left column 1", "λίθος"), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "blockvis", "info", str(layout)],
        capture_output=True,
        env={**os.environ, "PYTHONIOENCODING": "cp1252", "PYTHONUTF8": "0"},
    )
    assert done.returncode == 0, done.stderr
    assert "m²".encode("cp1252") in done.stdout
    assert b"\\u03bb\\u03af\\u03b8" in done.stdout


def test_the_schema_is_ascii(capsys):
    assert main(["schema"]) == 0
    assert capsys.readouterr().out.isascii()
