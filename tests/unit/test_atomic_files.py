"""Files are written whole or not at all, and flushed to the disk before they count."""

import gc
import itertools
import os
import re
import threading
from pathlib import Path

import pytest
from structures import arch_response

import blockvis
import solver
from blockvis import generators
from blockvis.results.folder import ResultsFolder
from blockvis.results.record import Record
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


@on_linux
def test_states_are_flushed_before_the_checkpoint_and_the_rest_at_the_end(tmp_path, done):
    arch = generators.arch()
    results = ResultsFolder(tmp_path / "out", arch)
    del done[:]
    results.add(next(_steps(arch)))
    placed = [path.name for what, path in done if what == "replace"]
    files = [f"{kind}_00000.vtu" for kind in ("blocks", "contacts", "joints")]
    lists = ["blocks.pvd", "contacts.pvd", "joints.pvd", "response.csv"]
    assert placed == ["state_00000.npz", *files, *lists, "checkpoint.npz"]
    flushed = [path.name for what, path in done if what == "flush"]
    assert flushed == [".state_00000.part.npz", "increments", ".checkpoint.part.npz", "out"]
    last = done.index(("replace", tmp_path / "out" / "checkpoint.npz"))
    assert ("flush", tmp_path / "out" / "increments") in done[:last]
    assert done[last + 1 :] == [("flush", tmp_path / "out")]
    del done[:]
    results.finish(arch_response(), 0.0)
    before = done[: done.index(("replace", tmp_path / "out" / "summary.json"))]
    flushed = [path.name for what, path in before if what == "flush"]
    assert {f".{name.rpartition('.')[0]}.part.{name.rpartition('.')[2]}" for name in lists} <= set(flushed)
    del done[:]
    results.flush()
    assert [(what, path.name) for what, path in done] == [("flush", name) for name in (*files, "increments")]


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
