"""A run that is killed goes on to the result it would have had, bit for bit."""

import csv
import gc
import io
import itertools
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from structures import run_command, same, stored_bytes

import blockvis
import solver
from blockvis import generators
from blockvis.cli import main
from solver import mechanics

#: Two phases, and a hinge that jumps: the path goes back, halves its steps, proves places.
CASE = """
[geometry]
layout = "arch"
[geometry.parameters]
voussoirs = 13
[material]
friction_coefficient = 0.7
[[settlement]]
direction = [1.0, 0.0]
increment = 0.02
limit = 0.05
[[settlement]]
direction = [0.0, -1.0]
increment = 0.03
limit = 0.5
[analysis]
falling_frames = 3
[output]
animation = false
"""


#: Analyses of an arch whose right springer spreads first, or as it spreads; each ends in a collapse.
ARCH = """
[geometry]
layout = "arch"
[material]
friction_coefficient = 0.7
[[settlement]]
direction = [1.0, 0.0]
increment = 0.02
limit = 0.02
[[settlement]]
direction = [1.0, 0.0]
increment = 0.01
limit = 0.03
[output]
animation = false
"""
SIDEWAYS = '[[loads]]\nkind = "live"\nweight_fraction = [1.0, 0.0]\n'
OTHERS = {
    "pushover": SIDEWAYS + '[analysis]\nkind = "pushover"\nfalling_frames = 2\n'
    '[control]\nblock = "voussoir 4"\nincrement = 0.003\n',
    "limit load": SIDEWAYS + '[analysis]\nkind = "limit load"\ncapacity_at = [0.0, 0.015, 0.03]\n',
    "load that moves": '[analysis]\nkind = "limit load"\n[[loads]]\nkind = "live"\nforce = [0.0, -1000.0]\n'
    "positions = [-0.8, 0.8, 5]\n",
}


def _command(folder, *arguments, code=""):
    """The command line in a process of its own; ``code`` runs before it."""
    run = f"import sys; from blockvis.cli import main; sys.exit(main({[str(a) for a in arguments]!r}, outputs=()))"
    script = f"{code}\n{run}"
    return subprocess.Popen(
        [sys.executable, "-c", script], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def _killed_at(number):
    """Code that has the process killed, by the real signal, when it replaces a file for the n-th time, or before it."""
    return (
        "import os, signal, itertools\n"
        "replace, count = os.replace, itertools.count(1)\n"
        "def lethal(*names):\n"
        f"    if next(count) == {number}: os.kill(os.getpid(), signal.SIGKILL)\n"
        "    replace(*names)\n"
        "os.replace = lethal"
    )


class Killed(BaseException):
    """Stands in for the signal."""


def _main_until(moment, *arguments):
    """The command line up to where it replaces a file for the n-th time, or one of this name: it does so no more.

    Nothing changes on the disk after that, as if the process had been killed: half a file stays where it is.
    """
    count, dead = itertools.count(1), []

    def lethal(partial, target, replace=os.replace):
        if dead or moment in (next(count), os.path.basename(target)):
            dead.append(target)
            raise Killed
        replace(partial, target)

    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(os, "replace", lethal)
        unlink = Path.unlink
        patched.setattr(Path, "unlink", lambda self, **options: None if dead else unlink(self, **options))
        with suppress(Killed):
            run_command(*arguments)
        # What the run held, its lock on the folder among it, goes with its last frame.
        gc.collect()
    assert dead, f"the run was over before {moment}"


def _same_result(one: Path, other: Path) -> None:
    """Every file of the two folders but the pictures, timings apart."""
    names = sorted(str(p.relative_to(one)) for p in one.rglob("*") if p.is_file())
    assert names == sorted(str(p.relative_to(other)) for p in other.rglob("*") if p.is_file())
    tables = []
    for folder in (one, other):
        rows = list(csv.DictReader((folder / "response.csv").read_text(encoding="utf-8").splitlines()))
        tables.append([{key: value for key, value in row.items() if key != "seconds"} for row in rows])
    assert tables[0] == tables[1]
    for name in names:
        if name.endswith(".npz"):
            assert stored_bytes(one / name) == stored_bytes(other / name), name
        elif name.endswith((".vtu", ".pvd")):
            assert (one / name).read_bytes() == (other / name).read_bytes(), name
    summaries = [json.loads((folder / "summary.json").read_text(encoding="utf-8")) for folder in (one, other)]
    for summary in summaries:
        del summary["seconds"], summary["finished"]
    assert summaries[0] == summaries[1]


def _readable(folder: Path) -> None:
    """What is in the folder can be read: reopened as a response, tables and lists whole, nothing named is absent."""
    for name in ("blocks.pvd", "contacts.pvd"):
        if (folder / name).exists():
            text = (folder / name).read_text(encoding="utf-8")
            assert text.endswith("</VTKFile>\n")
            for file in re.findall(r'file="([^"]*)"', text):
                assert (folder / file).read_bytes().rstrip().endswith(b"</VTKFile>")
    if (folder / "response.csv").exists():
        rows = list(csv.reader((folder / "response.csv").read_text(encoding="utf-8").splitlines()))
        assert len({len(row) for row in rows}) == 1
    if (folder / "assembly.npz").exists():
        assert blockvis.open_results(folder).stop is solver.Status.INTERRUPTED


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A case and the folder of its run that nobody disturbed."""
    folder = tmp_path_factory.mktemp("whole")
    (folder / "case.toml").write_text(CASE, encoding="utf-8")
    assert run_command(folder / "case.toml", "-o", folder / "out") == 0
    summary = json.loads((folder / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["status"] == "collapsed"
    assert blockvis.open_results(folder / "out").path[-1].phase == 1
    return folder


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="the system has no SIGKILL")
@pytest.mark.thorough
def test_run_killed_by_the_signal_resumes(whole, tmp_path):
    out = tmp_path / "out"
    process = _command(tmp_path, "run", whole / "case.toml", "-o", out, code=_killed_at(74))
    _, said = process.communicate(timeout=120)
    assert process.returncode == -signal.SIGKILL, said
    _readable(out)
    assert run_command("--resume", out) == 0
    _same_result(whole / "out", out)


@pytest.mark.parametrize(
    "moments",
    [
        ("state_00001.npz", 40),
        *(pytest.param(moments, marks=pytest.mark.thorough) for moments in ((30, 40), (2,), (75,), (100,))),
    ],
)
@pytest.mark.slow
def test_killed_run_resumes(whole, tmp_path, moments):
    out = tmp_path / "out"
    arguments = [whole / "case.toml", "-o", out]
    for moment in moments:
        _main_until(moment, *arguments)
        assert len(list(out.rglob(".*.part*"))) == 1, "half a file is there"
        _readable(out)
        arguments = ["--resume", out]
    if moments == (2,):
        # Killed between the assembly and the record of the case: nothing has begun.
        assert run_command("--resume", out) == 2
        assert run_command(whole / "case.toml", "-o", out, "--force") == 0
    else:
        assert run_command("--resume", out) == 0
    _same_result(whole / "out", out)


@pytest.mark.parametrize(
    ("kind", "moment", "kept"),
    [
        ("pushover", "state_00002.npz", 2),
        pytest.param("limit load", "blocks_00002.vtu", 2, marks=pytest.mark.thorough),
        pytest.param("limit load", "contacts_00010.vtu", 5, marks=pytest.mark.thorough),
        pytest.param("load that moves", "state_00003.npz", 3, marks=pytest.mark.thorough),
        pytest.param("load that moves", "summary.json", 5, marks=pytest.mark.thorough),
    ],
)
@pytest.mark.slow
def test_killed_limit_loads_and_pushovers_resume(tmp_path, monkeypatch, kind, moment, kept):
    case = tmp_path / "case.toml"
    # Elastic joints go on from where they have no force; what the settlement has left of mortar is kept, too.
    strength = "\ncohesion = 2e4\ntensile_strength = 1e4" if kind == "load that moves" else ""
    joints = f"coefficient = 0.7\nnormal_stiffness = 1e10\nshear_stiffness = 4e9{strength}"
    text = (ARCH + OTHERS[kind]).replace("coefficient = 0.7", joints)
    case.write_text(text, encoding="utf-8")
    assert run_command(case, "-o", tmp_path / "whole") == 0
    _main_until(moment, case, "-o", tmp_path / "out")
    _readable(tmp_path / "out")
    before = [file.stat().st_mtime_ns for file in sorted((tmp_path / "out" / "increments").glob("state_*"))][:kept]
    assert len(before) == kept
    found = []
    for module, name in ((solver.Structure, "limit_load"), (mechanics, "settlement_increments")):
        function = getattr(module, name)
        monkeypatch.setattr(
            module, name, lambda *a, name=name, function=function, **k: found.append(name) or function(*a, **k)
        )
    assert run_command("--resume", tmp_path / "out") == 0
    _same_result(tmp_path / "whole", tmp_path / "out")
    # What had been found was neither solved nor written again.
    after = [file.stat().st_mtime_ns for file in sorted((tmp_path / "out" / "increments").glob("state_*"))][:kept]
    assert after == before
    # The last one after a settlement is told without joints that close, and where they close by more, too; each of a
    # load that moves without.
    limits = {"pushover": 0, "limit load": 5 - kept + 2 * (kept < 5), "load that moves": 2 * (5 - kept)}[kind]
    assert found == ["settlement_increments"] * (kind == "limit load") + ["limit_load"] * limits


@pytest.mark.slow
def test_ctrl_c_ends_cleanly_and_the_run_resumes(whole, tmp_path, monkeypatch, capsys):
    count, found = itertools.count(), mechanics.Increments.__next__

    def stopped(increments):
        if next(count) == 5:
            raise KeyboardInterrupt
        return found(increments)

    out = tmp_path / "out"
    monkeypatch.setattr(mechanics.Increments, "__next__", stopped)
    assert run_command(whole / "case.toml", "-o", out) == 130
    assert "--resume" in capsys.readouterr().err
    assert json.loads((out / "summary.json").read_text(encoding="utf-8"))["status"] == "interrupted"
    _readable(out)
    monkeypatch.undo()
    assert run_command("--resume", out) == 0
    _same_result(whole / "out", out)


@pytest.mark.slow
def test_ctrl_c_while_tables_are_written_says_how_to_go_on(whole, tmp_path, monkeypatch, capsys):
    def stopped(*_):
        raise KeyboardInterrupt

    out = tmp_path / "out"
    monkeypatch.setattr(sys.modules[blockvis.run_case.__module__], "finish", stopped)
    assert run_command(whole / "case.toml", "-o", out) == 130
    assert capsys.readouterr().err.endswith(f"by: blockvis run --resume {out}\n")
    monkeypatch.undo()
    assert run_command("--resume", out) == 0
    _same_result(whole / "out", out)


@pytest.mark.slow
def test_resuming_a_finished_run_draws_what_is_missing(whole, tmp_path, capsys):
    out = shutil.copytree(whole / "out", tmp_path / "out")
    before = (out / "response.csv").read_bytes()
    assert not (out / "mechanism.png").exists()
    cut = out / "increments" / "joints_00001.vtu"
    cut.write_bytes(b"")
    assert main(["run", "--resume", str(out), "--no-check-steps"]) == 0
    assert "had finished (collapsed)" in capsys.readouterr().err
    assert (out / "mechanism.png").stat().st_size > 500
    assert cut.read_bytes() == (whole / "out" / "increments" / cut.name).read_bytes(), "as a power cut may leave it"
    assert (out / "response.csv").read_bytes() == before


@pytest.mark.slow
def test_files_that_changed_are_named_and_not_read_again(whole, tmp_path, monkeypatch, capsys):
    case, out = tmp_path / "case.toml", tmp_path / "out"
    case.write_text(CASE, encoding="utf-8")
    _main_until(30, case, "-o", out)
    case.write_text(CASE.replace("0.7", "0.3"), encoding="utf-8")
    assert run_command("--resume", out) == 0
    assert "case.toml' has changed" in capsys.readouterr().err
    rows = [(f / "response.csv").read_text(encoding="utf-8").splitlines() for f in (out, whole / "out")]
    assert [row.rsplit(",", 1)[0] for row in rows[0]] == [row.rsplit(",", 1)[0] for row in rows[1]]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--resume", "nowhere"], "there is no folder 'nowhere'"),
        (["--resume", "nowhere", "-o", "out"], "takes the results folder alone"),
        (["case.toml", "--resume", "nowhere"], "takes the results folder alone"),
        ([], "name a case file"),
    ],
)
def test_what_cannot_be_resumed_is_refused(tmp_path, monkeypatch, capsys, arguments, words):
    monkeypatch.chdir(tmp_path)
    assert run_command(*arguments) == 2
    assert words in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_damaged_checkpoint_is_refused(whole, tmp_path, capsys):
    out = tmp_path / "out"
    shutil.copytree(whole / "out", out)
    (out / "summary.json").unlink()
    data = (out / "checkpoint.npz").read_bytes()
    for damaged in (b"", data[:120], data[: len(data) // 2], b"PK" + bytes(500)):
        (out / "checkpoint.npz").write_bytes(damaged)
        assert run_command("--resume", out) == 2
        assert "cannot go on" in capsys.readouterr().err


def _goes_on(told, k, again):
    """What follows the k-th increment is told again, bit for bit."""
    names = ("settlement", "pose", "forces", "velocity", "reaction", "load_multiplier", "certificate", "programs")
    for one, other in zip(again, told[k + 1 :], strict=True):
        for name in (*names, "checkpoint"):
            assert same(getattr(one, name), getattr(other, name)), (k, name)


@pytest.mark.thorough
def test_every_checkpoint_leads_to_the_same_end():
    arch = generators.arch(voussoirs=13)
    phases = (
        solver.Settlement(direction=(1, 0), increment=0.03, limit=0.06),
        solver.Settlement(direction=(0, -1), increment=0.04, limit=0.5),
    )
    setting = {
        "interfaces": solver.Interfaces(solver.InterfaceLaw(0.7)),
        "loads": solver.self_weight(arch),
        "controls": solver.Controls(falling_frames=2),
    }
    told = list(mechanics.settlement_increments(arch, phases, **setting))
    assert {i.phase for i in told} == {0, 1}
    for k in range(0, len(told), 3):
        if told[k].checkpoint is not None:
            _goes_on(told, k, mechanics.settlement_increments(arch, phases, resume=told[k].checkpoint, **setting))


@pytest.mark.thorough
def test_every_checkpoint_of_a_pushover_leads_to_the_same_end():
    arch = generators.arch(voussoirs=13)
    live = solver.weight_fraction(arch, (1.0, 0.0), np.flatnonzero(arch.free))
    control = solver.ControlDisplacement("voussoir 4", increment=0.003, limit=0.6)
    setting = {
        "interfaces": solver.Interfaces(solver.InterfaceLaw(0.45)),
        "loads": solver.Loads(solver.self_weight(arch).dead, live),
        "controls": solver.Controls(falling_frames=2),
    }
    told = list(mechanics.pushover_increments(arch, control, **setting))
    kept = [k for k, increment in enumerate(told) if increment.checkpoint is not None]
    assert len(kept) > 5
    for k in kept:
        checkpoint = told[k].checkpoint
        _goes_on(told, k, mechanics.pushover_increments(arch, control, resume=checkpoint, **setting))
    other = generators.arch(voussoirs=12)
    setting["loads"] = solver.Loads(solver.self_weight(other).dead, solver.weight_fraction(other, (1.0, 0.0), [3]))
    with pytest.raises(ValueError, match=r"has 15 blocks, the assembly 14: it belongs to another run"):
        next(mechanics.pushover_increments(other, control, resume=checkpoint, **setting))


@pytest.mark.thorough
def test_checkpoint_behind_the_last_increment_has_nothing_left_to_do():
    arch = generators.arch()
    phases = [solver.Settlement(direction=(1, 0), increment=0.01, limit=limit) for limit in (0.02, 0.01)]
    setting = {"interfaces": solver.Interfaces(), "loads": solver.self_weight(arch)}
    told = list(mechanics.settlement_increments(arch, phases, **setting))
    ends = [k for k, i in enumerate(told) if i.parameter == phases[i.phase].limit]
    assert [(told[k].phase, told[k].checkpoint.phase) for k in ends] == [(0, 0), (1, 1)]
    assert ends[-1] == len(told) - 1
    steps = mechanics.settlement_increments(arch, phases, resume=told[-1].checkpoint, **setting)
    assert steps.all() == ()
    assert steps.ending.stop is solver.Status.LIMIT_REACHED
    assert steps.ending.message == "the settlement reached its limit of 0.01 m"
    first = next(mechanics.settlement_increments(arch, phases, resume=told[ends[0]].checkpoint, **setting))
    assert same(first.pose, told[ends[0] + 1].pose)
    assert first.programs == told[ends[0] + 1].programs


def test_checkpoint_of_another_run_is_refused():
    arch, other = generators.arch(voussoirs=13), generators.arch(voussoirs=12)
    spread = solver.Settlement(direction=(1, 0), increment=0.03, limit=0.06)
    setting = {"interfaces": solver.Interfaces(), "controls": solver.Controls()}
    checkpoint = next(
        mechanics.settlement_increments(arch, (spread,), loads=solver.self_weight(arch), **setting)
    ).checkpoint
    with pytest.raises(ValueError, match="belongs to another run"):
        mechanics.settlement_increments(other, (spread,), loads=solver.self_weight(other), resume=checkpoint, **setting)


@pytest.mark.thorough
def test_a_response_keeps_no_checkpoints():
    arch = generators.arch()
    spread = solver.Settlement(direction=(1, 0), increment=0.05, limit=0.1)
    assert all(i.checkpoint is None for i in solver.settle(arch, spread).increments)


@pytest.mark.thorough
def test_an_increment_that_takes_longer_than_it_may_is_told_and_goes_on_bit_for_bit(tmp_path, capsys):
    case = tmp_path / "case.toml"
    text = '[geometry]\nlayout = "arch"\n[settlement]\ndirection = [1, 0]\nincrement = 0.01\nlimit = 0.02\n'
    case.write_text(text + "[analysis]\nincrement_seconds = 1e4\n", encoding="utf-8")
    quiet = ("--no-pictures", "--no-check-steps")
    assert main(["run", str(case), "-o", str(tmp_path / "straight"), *quiet]) == 0
    capsys.readouterr()
    out = tmp_path / "a folder ü"
    assert main(["run", str(case), "-o", str(out), "--increment-seconds", "1e-9", *quiet]) == 130
    told = capsys.readouterr()
    stopped = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert stopped["status"] == "interrupted"
    assert re.search(r"an increment took more than 1e-09 s .*: settlement \S+ of at most .* in steps of", told.out)
    assert stopped["message"] in told.out
    # What is told is a command, whatever the name of the folder.
    command = shlex.split(told.err.splitlines()[-1].partition("go on with it by blockvis ")[2])
    assert command == ["run", "--resume", str(out)]
    assert main([*command, *quiet]) == 0
    for name in ("response.csv", "joints.csv", "blocks.pvd"):
        one, other = ((of / name).read_text(encoding="utf-8") for of in (tmp_path / "straight", out))
        assert _without_seconds(one) == _without_seconds(other), name


def _without_seconds(text):
    rows = list(csv.reader(io.StringIO(text)))
    left_out = {k for k, name in enumerate(rows[0]) if name == "seconds"}
    return [[value for k, value in enumerate(row) if k not in left_out] for row in rows]


@pytest.mark.parametrize("change", ['increments = "linear program"', 'kind = "limit load"'])
def test_time_for_increments_is_refused_where_no_step_looks_at_it(change, tmp_path, capsys):
    live = '[[loads]]\nkind = "live"\nweight_fraction = [1.0, 0.0]\n[analysis]\nincrement_seconds = 5\n'
    text = CASE.replace("[analysis]", live + change)
    if "limit load" in change:
        text = re.sub(r"\[\[settlement\]\][^\[]*\[1.0, 0.0\][^\[]*", "", text)
        text = re.sub(r"\[\[settlement\]\][^\[]*\[0.0, -1.0\][^\[]*", "", text)
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    assert main(["run", str(tmp_path / "case.toml"), "-o", str(tmp_path / "out")]) == 2
    assert "increment_seconds is 5; it is looked at after the steps of a path" in capsys.readouterr().err
