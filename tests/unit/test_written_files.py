"""Files that are whole or not there, under any operating system."""

import errno
import gc
import io
import itertools
import os
import re
import subprocess
import sys
import threading
import types
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from structures import arch_response

import blockvis
import solver
from blockvis import generators, read_case, save_layout
from blockvis.cli import main
from blockvis.results import folder as results_folder
from blockvis.results.folder import ResultsExist, ResultsFolder
from blockvis.results.npz import packed, unpacked
from blockvis.results.record import Record
from blockvis.system import atomic_files, processes
from blockvis.system.atomic_files import PARTIAL, atomic_file, write_atomic
from blockvis.system.vtk_files import write_pvd
from solver import mechanics

ROOT = Path(__file__).parents[2]


@pytest.fixture
def done(monkeypatch):
    """What is asked of the system, in order: ("flush" or "replace", path)."""
    calls = []
    fsync, replace = os.fsync, os.replace

    def flushed(handle):
        calls.append(("flush", Path(os.readlink(f"/proc/self/fd/{handle}"))))
        fsync(handle)

    def replaced(partial, target):
        calls.append(("replace", Path(target)))
        replace(partial, target)

    monkeypatch.setattr(os, "fsync", flushed)
    monkeypatch.setattr(os, "replace", replaced)
    return calls


on_linux = pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="the system does not tell what is flushed")


@on_linux
def test_a_file_is_flushed_before_it_is_put_in_its_place_and_its_folder_after(tmp_path, done):
    target = tmp_path / "new" / "folder" / "table.csv"
    assert write_atomic(target, "é") == target
    assert target.read_bytes() == "é".encode()
    partial = target.with_name(".table.part.csv")
    assert partial.match(PARTIAL)
    made = [("flush", target.parents[1]), ("flush", tmp_path)]
    assert done == [*made, ("flush", partial), ("replace", target), ("flush", target.parent)]


def test_what_fails_leaves_the_file_before(tmp_path):
    target = tmp_path / "picture.png"
    write_atomic(target, b"before")

    def broken_off():
        with atomic_file(target) as partial:
            partial.write_bytes(b"half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        broken_off()
    assert target.read_bytes() == b"before"
    assert list(tmp_path.iterdir()) == [target]


def test_a_layout_that_cannot_be_written_leaves_the_file_before(tmp_path, monkeypatch):
    target = tmp_path / "arch.svg"
    blockvis.save_layout(generators.arch(), target)
    before = target.read_bytes()

    def broken(drawing, path):
        path.write_text("<svg", encoding="utf-8")
        raise OSError("No space left on device")

    monkeypatch.setattr("blockvis.formats.svg.write", broken)
    with pytest.raises(OSError, match="No space left"):
        blockvis.save_layout(generators.arch(voussoirs=5), target)
    assert target.read_bytes() == before
    assert list(tmp_path.iterdir()) == [target]


def _steps(arch):
    return mechanics.settlement_increments(
        arch,
        [solver.Settlement(direction=(1, 0), increment=0.02, limit=0.1)],
        interfaces=solver.Interfaces(),
        loads=solver.self_weight(arch),
    )


def test_another_run_that_is_writing_is_told_before_what_it_has_written(tmp_path):
    results = ResultsFolder(tmp_path / "out", generators.arch())
    with pytest.raises(ResultsExist, match=r"another run is writing to '.*out'; wait for it"):
        results_folder.refuse_results(tmp_path / "out")
    del results
    gc.collect()
    with pytest.raises(ResultsExist, match=r"holds results already .*; go on with it by blockvis run --resume"):
        results_folder.refuse_results(tmp_path / "out")


@on_linux
def test_states_are_flushed_before_the_checkpoint_and_the_rest_at_the_end(tmp_path, done):
    arch = generators.arch()
    results = ResultsFolder(tmp_path / "out", arch)
    del done[:]
    results.add(next(_steps(arch)))
    placed = [path.name for what, path in done if what == "replace"]
    files = [f"{kind}_00000.vtu" for kind in ("blocks", "contacts", "joints")]
    lists = ["blocks.pvd", "contacts.pvd", "joints.pvd", "response.csv", "supports.csv"]
    assert placed == ["state_00000.npz", *files, *lists, "checkpoint.npz"]
    flushed = [path.name for what, path in done if what == "flush"]
    assert flushed == [".state_00000.part.npz", "increments", ".checkpoint.part.npz", "out"]
    last = done.index(("replace", tmp_path / "out" / "checkpoint.npz"))
    assert ("flush", tmp_path / "out" / "increments") in done[:last]
    assert done[last + 1 :] == [("flush", tmp_path / "out")]
    del done[:]
    results.finish(replace(arch_response(), collapse=None), 0.0)
    before = done[: done.index(("replace", tmp_path / "out" / "summary.json"))]
    flushed = [path.name for what, path in before if what == "flush"]
    assert {f".{name.rpartition('.')[0]}.part.{name.rpartition('.')[2]}" for name in lists} <= set(flushed)
    del done[:]
    results.flush()
    assert [(what, path.name) for what, path in done] == [("flush", name) for name in (*files, "increments")]


@pytest.mark.slow
def test_what_a_power_cut_has_left_of_the_files_of_increments_is_made_again(tmp_path):
    arch, folder = generators.arch(), tmp_path / "out" / "increments"
    results = ResultsFolder(tmp_path / "out", arch, record=Record(case="x"))
    for increment in itertools.islice(_steps(arch), 3):
        results.add(increment)
    del results, increment
    gc.collect()
    whole = {file.name: file.read_bytes() for file in (*folder.glob("*.vtu"), tmp_path / "out" / "blocks.pvd")}
    assert len(whole) == 10
    (folder / "blocks_00000.vtu").write_bytes(b"")
    (folder / "joints_00001.vtu").write_bytes(whole["joints_00001.vtu"][:-40] + bytes(40))
    (folder / "contacts_00001.vtu").unlink()
    (tmp_path / "out" / "blocks.pvd").write_bytes(b"")
    untouched = (folder / "contacts_00002.vtu").stat().st_mtime_ns
    again, _ = ResultsFolder.reopened(tmp_path / "out", mechanics.SETTLEMENT, mechanics.PathState)
    assert len(again.increments) == 3
    assert {file.name: file.read_bytes() for file in (*folder.glob("*.vtu"), tmp_path / "out" / "blocks.pvd")} == whole
    assert (folder / "contacts_00002.vtu").stat().st_mtime_ns == untouched


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no named pipes among its files")
def test_a_link_stays_a_link_and_a_pipe_is_written_to(tmp_path):
    target, link, pipe = tmp_path / "target.svg", tmp_path / "link.svg", tmp_path / "pipe.svg"
    link.symlink_to(target)
    blockvis.save_layout(generators.arch(), link)
    assert link.is_symlink()
    assert target.read_text(encoding="utf-8").startswith("<?xml")
    os.mkfifo(pipe)
    read = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    blockvis.save_layout(generators.arch(), pipe)
    reader.join(timeout=30)
    assert read == [target.read_bytes()]
    assert pipe.is_fifo()


def test_there_is_one_way_to_write_a_file():
    """Nothing else in the package puts a file in the place of another, or writes a text where it shall stay."""
    ways = re.compile(r"os\.(replace|rename)\(|\.write_(text|bytes)\(")
    found = {
        file.relative_to(ROOT).as_posix(): ways.findall(file.read_text(encoding="utf-8"))
        for file in sorted((ROOT / "blockvis").rglob("*.py"))
    }
    allowed = {
        # Their writers get the name that atomic_file gives them.
        *(
            f"blockvis/formats/{name}.py"
            for name in ("compas_json", "geodata", "gmsh_mesh", "layout_json", "solids", "svg")
        ),
        # The case of one run of a study, which is made anew each time.
        "blockvis/studies/campaign.py",
        "blockvis/system/atomic_files.py",
    }
    assert {name for name, calls in found.items() if calls} == allowed


def test_a_list_of_files_is_flushed_with_what_follows(tmp_path, monkeypatch):
    flushed = []
    monkeypatch.setattr("blockvis.system.atomic_files.flush", flushed.append)
    write_pvd(tmp_path / "a.pvd", [(0.0, "a.vtu")], last=False)
    write_pvd(tmp_path / "b.pvd", [(0.0, "b.vtu")])
    assert flushed == [tmp_path / ".a.part.pvd", tmp_path / ".b.part.pvd", tmp_path]


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
    with pytest.raises(ResultsExist, match=r"another run is writing"):
        ResultsFolder(tmp_path / "out", assembly, overwrite=True)
    first.release()
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


@pytest.mark.slow
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


def test_two_runs_cannot_write_to_one_folder(tmp_path):
    assembly = generators.arch()
    first = ResultsFolder(tmp_path / "out", assembly)
    for overwrite in (False, True):
        with pytest.raises(ResultsExist, match=r"results already|another run is writing"):
            ResultsFolder(tmp_path / "out", assembly, overwrite=overwrite)
    del first
    ResultsFolder(tmp_path / "out", assembly, overwrite=True)


def test_a_checkpoint_is_stored_to_the_last_bit():
    arch = generators.arch()
    spread = [solver.Settlement(direction=(1, 0), increment=0.01, limit=0.03)]
    setting = {"interfaces": solver.Interfaces(solver.InterfaceLaw(0.7)), "loads": solver.self_weight(arch)}
    found = list(mechanics.settlement_increments(arch, spread, **setting))
    checkpoint, extra = unpacked(packed(found[1].checkpoint, increments=2), mechanics.PathState)
    assert extra == {"increments": 2}
    again = list(mechanics.settlement_increments(arch, spread, resume=checkpoint, **setting))
    assert [one.reaction for one in again] == [one.reaction for one in found[2:]]
    for one, other in zip(again, found[2:], strict=True):
        np.testing.assert_array_equal(one.forces, other.forces)
        np.testing.assert_array_equal(one.pose.positions, other.pose.positions)


def test_stored_values_refuse_what_they_cannot_hold():
    with pytest.raises(TypeError, match="cannot be stored"):
        packed(mechanics.Ending(solver.Status.LOCKED, {"a": 1}))
    buffer = io.BytesIO()
    np.savez(buffer, tree=np.array('{"value": {"phase": 1}, "extra": {}}'))
    with pytest.raises(ValueError, match="it has the fields"):
        unpacked(buffer.getvalue(), mechanics.PathState)
