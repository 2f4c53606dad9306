"""Memory does not grow with the number of increments: what is written is forgotten, and read back one at a time."""

import pickle
import shutil
import subprocess
import sys
import weakref
from dataclasses import replace

import numpy as np
import pytest
from structures import case_from, report_of

import blockvis
import solver
from blockvis import draw_curve, generators
from blockvis.pictures.drawer import Drawer, Look
from blockvis.pictures.film import film_of
from blockvis.pictures.video import write_film
from blockvis.results import increments
from blockvis.results.folder import ResultsFolder
from blockvis.results.increments import AT_LEAST, StoredIncrements

ARCH = """
[geometry]
layout = "arch"
[geometry.parameters]
voussoirs = 6
[material]
friction_coefficient = 0.7
[output]
animation = false
"""

SPREAD = """
[settlement]
direction = [1.0, 0.0]
increment = 0.006
limit = 0.5
"""

SIDEWAYS = """
[[loads]]
kind = "live"
weight_fraction = [1.0, 0.0]
"""

MOVING = """
[analysis]
kind = "limit load"
[[loads]]
kind = "live"
force = [0.0, -1000.0]
positions = [-0.9, 0.9, 11]
"""

ANALYSES = {
    "settlement": SPREAD + "[analysis]\nfalling_frames = 8\n",
    "capacity": SPREAD + SIDEWAYS + '[analysis]\nkind = "limit load"\n',
    "load that moves": MOVING,
    "pushover": SIDEWAYS + '[analysis]\nkind = "pushover"\n[control]\nblock = "voussoir 4"\nincrement = 0.03\n',
}

#: Increments alive at once while a run goes on: the one just told, the one before, and those that a pause holds back.
FEW = 5


def ran(text, folder):
    """The run of a case, nothing drawn."""
    return blockvis.run_case(case_from(ARCH + text, folder), folder / "out", outputs=())


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Results with more increments than are ever kept."""
    run = ran(ANALYSES["settlement"], tmp_path_factory.mktemp("memory"))
    assert len(run.response.increments) > 4 * FEW
    return run.folder


@pytest.mark.parametrize(
    "kind", [pytest.param(kind, marks=() if kind == "settlement" else pytest.mark.thorough) for kind in ANALYSES]
)
@pytest.mark.slow
def test_a_run_forgets_what_it_has_written(kind, tmp_path, monkeypatch):
    seen, most = [], []
    add = ResultsFolder.add

    def watched(self, increment):
        add(self, increment)
        seen.append(weakref.ref(increment.contacts))
        most.append(sum(ref() is not None for ref in seen))

    # Small ones are kept as long as all together are small; here none is.
    monkeypatch.setattr(increments, "CACHED", 0)
    monkeypatch.setattr(ResultsFolder, "add", watched)
    ran(ANALYSES[kind], tmp_path)
    assert len(seen) > 2 * FEW
    assert max(most) <= FEW, most


@pytest.mark.parametrize("use", ["summary", "curve", "report", "film"])
@pytest.mark.slow
def test_results_are_read_one_at_a_time(use, folder, tmp_path, monkeypatch):
    seen, most = [], []
    read = StoredIncrements._read

    def watched(self, number):
        increment = read(self, number)
        seen.append(weakref.ref(increment))
        most.append(sum(ref() is not None for ref in seen))
        return increment

    monkeypatch.setattr(increments, "CACHED", 0)
    monkeypatch.setattr(StoredIncrements, "_read", watched)
    response = blockvis.open_results(folder)
    n = len(response.increments)
    assert n <= len(seen) <= n + 1
    assert n > 4 * AT_LEAST
    if use == "summary":
        blockvis.write(response, tmp_path / "again")
    elif use == "curve":
        draw_curve(response, tmp_path / "curve.png")
    elif use == "report":
        assert f"{response.collapse.displacement:.6g} m" in report_of(response)
    else:
        drawer = Drawer(response, Look(), (320, 180), response.increments, curve=True)
        write_film(film_of(drawer, 4.0, 2.0), tmp_path / "film.gif", size=(320, 180), fps=4.0)
    # Each is read, and no more than a few times.
    assert n < len(seen) < 6 * n
    assert max(most) <= AT_LEAST + 1, most


@pytest.mark.slow
def test_a_few_small_increments_are_read_once(folder, monkeypatch):
    numbers = []
    read = StoredIncrements._read
    monkeypatch.setattr(StoredIncrements, "_read", lambda self, number: numbers.append(number) or read(self, number))
    response = blockvis.open_results(folder)
    for _ in range(3):
        for increment in response.increments:
            assert increment.pose.positions.shape == (response.assembly.n_blocks, 2)
            assert len(increment.forces) == len(increment.contacts)
    assert len(numbers) == len(set(numbers)) >= len(response.increments) - 1


@pytest.mark.thorough
def test_stored_increments_are_written_again_changed_and_copied(tmp_path):
    assembly = generators.arch()
    spread = solver.Settlement(direction=(1, 0), increment=0.04, limit=0.5)
    told = solver.settle(assembly, spread, controls=solver.Controls(falling_frames=2))
    stored = blockvis.open_results(blockvis.write(told, tmp_path / "out"))
    for other in stored.increments:
        assert isinstance(other, solver.Increment)
        assert not hasattr(other, "nonsense")
    # Once more from what was read, to the same files; a changed one is in memory, and a copy reads the same file.
    again = blockvis.write(stored, tmp_path / "again")
    for file in sorted((tmp_path / "out" / "increments").iterdir()):
        assert file.read_bytes() == (again / "increments" / file.name).read_bytes()
    moved = replace(stored.increments[0].with_arrays(), parameter=9.0)
    copied = pickle.loads(pickle.dumps(stored.increments[1]))
    assert copied.forces.tobytes() == told.increments[1].forces.tobytes()
    shutil.rmtree(tmp_path / "out")
    assert moved.settlement == 9.0
    assert moved.forces.tobytes() == told.increments[0].forces.tobytes()


@pytest.mark.slow
def test_results_that_change_below_the_reader_are_named(folder, tmp_path, monkeypatch):
    monkeypatch.setattr(increments, "CACHED", 0)
    shutil.copytree(folder, tmp_path / "out")
    response = blockvis.open_results(tmp_path / "out")
    files = sorted((tmp_path / "out" / "increments").glob("state_*.npz"))
    shutil.copy(files[1], files[0])
    with pytest.raises(ValueError, match=r"state_00000.npz' is not what it was when it was opened; open the results"):
        response.increments[0].pose  # noqa: B018 - it is read here
    files[2].write_bytes(files[2].read_bytes()[:-200])
    with pytest.raises(ValueError, match=r"state_00002.npz' cannot be read"):
        response.increments[2].forces  # noqa: B018 - it is read here
    files[3].unlink()
    with pytest.raises(ValueError, match=r"state_00003.npz' cannot be read"):
        response.increments[3].contacts  # noqa: B018 - it is read here


@pytest.mark.slow
def test_results_are_not_written_over_what_they_are_read_from(folder):
    response = blockvis.open_results(folder)
    with pytest.raises(ValueError, match=r"is read from '.*' itself; write it to another folder"):
        blockvis.write(response, folder, overwrite=True)
    assert len(blockvis.open_results(folder).increments) == len(response.increments)


@pytest.mark.thorough
def test_limit_loads_of_a_run_have_the_arrays_of_their_increments(tmp_path):
    run = ran(ANALYSES["capacity"], tmp_path)
    assert len(run.response.limits) == run.summary["n_increments"] > 4
    for limit, state in zip(run.response.limits, run.response.increments, strict=False):
        assert limit.multiplier == state.load_multiplier
        assert np.array_equal(limit.mechanism, state.velocity)
        assert np.array_equal(limit.forces, state.forces)
        assert limit.increment.pose.positions.shape == state.pose.positions.shape
        assert str(limit).startswith("load multiplier")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no limit of the addresses of a process")
def test_where_memory_is_limited_a_run_says_so_and_ends(tmp_path):
    """With 0.5 GB a library of HiGHS would ask for its memory for ever."""
    case_from(ARCH + SPREAD, tmp_path)
    run = f"ulimit -v 500000; exec {sys.executable} -m blockvis run case.toml"
    ended = subprocess.run(["sh", "-c", run], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert ended.stderr.startswith("blockvis: there is not enough memory for what is asked for: ")
