"""The results folder: what is written comes back."""

import csv
import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from structures import equal_certificates, report_of

import blockvis
import solver
from blockvis import generators
from blockvis.cli import main
from solver import mechanics


def test_reopens_as_the_same_response(arch, arch_folder):
    again = blockvis.open_results(arch_folder)
    assert again.stop == arch.stop
    assert again.collapse.bracket == arch.collapse.bracket
    assert again.assembly.names == arch.assembly.names
    assert len(again.increments) == len(arch.increments)
    for one, other in zip(again.increments, arch.increments, strict=True):
        assert one.settlement == other.settlement
        assert (one.reaction, one.status) == (other.reaction, other.status)
        assert np.array_equal(one.pose.positions, other.pose.positions)
        for name in ("forces", "displacements", "friction", "velocity", "support_forces", "states"):
            assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name
        assert one.contacts.points.tobytes() == other.contacts.points.tobytes()
        assert equal_certificates(one.certificate, other.certificate)
        assert one.checkpoint is None
    np.testing.assert_allclose(again.collapse.mechanism, arch.collapse.mechanism, rtol=1e-12)


@pytest.mark.thorough
def test_a_collapse_without_frames_of_its_fall_comes_back_with_its_mechanism(arch, tmp_path):
    bare = replace(arch, increments=arch.path)
    again = blockvis.open_results(blockvis.write(bare, tmp_path / "out"))
    assert len(again.increments) == len(arch.path)
    np.testing.assert_allclose(again.collapse.mechanism, arch.collapse.mechanism, rtol=1e-12)
    assert np.array_equal(again.path[-1].pose.positions, arch.path[-1].pose.positions)
    for words in ("<td>mechanism</td>", "<td>falls</td>"):
        assert words in report_of(again)


def test_csv_counts_every_contact_once(arch, arch_folder):
    rows = list(csv.DictReader((arch_folder / "response.csv").read_text(encoding="utf-8").splitlines()))
    for row, increment in zip(rows, arch.path, strict=True):
        counted = sum(int(row[f"contacts_{s}"]) for s in ("open", "sticking", "sliding", "hinging"))
        assert counted == len(increment.contacts)


def test_summary_reports_the_worst_residuals(arch, arch_folder):
    summary = json.loads((arch_folder / "summary.json").read_text(encoding="utf-8"))
    worst = max(i.certificate.equilibrium_residual for i in arch.path)
    assert summary["largest_residuals"]["equilibrium_residual"] == worst
    assert worst < 1e-8


def test_the_last_equilibrium_has_the_joints_of_the_collapse_in_every_file(arch, arch_folder, tmp_path):
    *_, row = csv.DictReader((arch_folder / "response.csv").read_text(encoding="utf-8").splitlines())
    summary = json.loads((arch_folder / "summary.json").read_text(encoding="utf-8"))
    again, states = blockvis.open_results(arch_folder), ("open", "sticking", "sliding", "hinging")
    told = np.bincount(again.contacts(-1)["state"], minlength=len(states))
    assert [int(row[f"contacts_{state}"]) for state in states] == told.tolist()
    joints = [int(row[name]) for name in ("hinges", "sliding_joints")]
    assert joints == [summary[name] for name in ("hinges", "sliding_joints")]
    alone = mechanics.mechanism_of(arch.assembly, arch.path[-1])
    assert joints != [len(alone.hinges), len(alone.sliding)], "the motion in which the supports move on has others"
    assert len(again.increments[0].contacts) != summary["n_contacts"]
    report = blockvis.write_report(again, tmp_path / "report.html").read_text(encoding="utf-8")
    assert f"<td>contact points</td><td>{summary['n_contacts']}</td>" in report


@pytest.mark.thorough
def test_linear_programs_word_their_mechanism_as_the_summary_does(tmp_path):
    arch, controls = generators.arch(thickness_ratio=0.2, voussoirs=7), solver.Controls(increments="linear program")
    spread = solver.Settlement((1, 0), increment=0.1, limit=3.0)
    response = solver.settle(arch, spread, friction_coefficient=1.5, controls=controls)
    folder = blockvis.write(response, tmp_path / "out")
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    assert response.collapse.words == summary["mechanism"] == blockvis.open_results(folder).collapse.words
    assert summary["message"].endswith(summary["mechanism"])


def test_results_that_lack_their_last_states_are_refused(arch, arch_folder, tmp_path):
    """As a copy that broke off leaves them: they would open as a shorter path."""
    copy = shutil.copytree(arch_folder, tmp_path / "copy")
    for number in range(2, len(arch.increments)):
        (copy / "increments" / f"state_{number:05d}.npz").unlink()
    with pytest.raises(ValueError, match=r"state_00002\.npz' cannot be read .* run the case again"):
        blockvis.open_results(copy)


def test_what_colours_the_files_in_paraview_needs_no_picture(arch_folder):
    assert (arch_folder / "paraview_colours.py").is_file()


def test_no_results(tmp_path):
    with pytest.raises(ValueError, match="holds no results"):
        blockvis.open_results(tmp_path)


def test_refuses_to_overwrite(arch, arch_folder):
    with pytest.raises(ValueError, match=r"holds results already .*add --force \(in Python overwrite=True\)"):
        blockvis.write(arch, arch_folder)


def test_the_worst_of_some_certificates_passes_over_what_was_not_worked_out():
    first = solver.Certificate(equilibrium_residual=1e-9, largest_penetration=3e-8)
    second = solver.Certificate(equilibrium_residual=2e-9, largest_penetration=1e-8, duality_gap=4e-12)
    for pair in ((first, second), (second, first)):
        worst = mechanics.worst_of(pair)
        assert (worst.equilibrium_residual, worst.largest_penetration, worst.duality_gap) == (2e-9, 3e-8, 4e-12)
        assert np.isnan(worst.kinematic_violation)
    assert mechanics.worst_of([]) is None


@pytest.mark.slow
def test_numbers_of_numpy_are_written(tmp_path):
    """Those of np.arange and of data in single precision, which compute like others."""
    block, ground = [[0, 0], [1, 0], [1, 1], [0, 1]], [[-1, -1], [2, -1], [2, 0], [-1, 0]]
    assembly = solver.Assembly.from_outlines([ground, block], names=["ground", "block"], roles=["moving", "free"])
    settlement = solver.Settlement(
        (0, -1),
        (0, 0),
        rotation=np.float32(0.25),
        increment=np.float32(0.5),
        limit=np.int64(1),
        blocks=np.array(["ground"]),
    )
    response = solver.settle(assembly, settlement, friction_coefficient=np.float32(0.5))
    again = blockvis.open_results(blockvis.write(response, tmp_path / "out"))
    assert again.settlements == response.settlements == (settlement,)
    live = solver.Loads(solver.self_weight(assembly).dead, solver.weight_fraction(assembly, (1, 0)))
    control = solver.ControlDisplacement("block", increment=np.float32(0.25), limit=np.int64(1))
    pushed = solver.pushover(assembly, control, loads=live, friction_coefficient=0.3)
    assert blockvis.open_results(blockvis.write(pushed, tmp_path / "pushed")).control == control


def _stack(roles=("moving", "free", "free")):
    outlines = [[[0, 0], [4, 0], [4, 1], [0, 1]], *([[1, y], [2, y], [2, y + 1], [1, y + 1]] for y in (1, 2))]
    return solver.Assembly.from_outlines(outlines, names=["ground", "low", "top"], roles=roles)


@pytest.mark.slow
def test_laws_loads_and_changes_given_in_python_come_back(tmp_path):
    """The fall, the pictures and the capacity of what is reopened are those of what was written."""
    stack = _stack()
    top = solver.PointForces.at(2, (0, -5e4), (1.5, 3))
    loads = solver.self_weight(stack).with_forces(stack, top)
    laws = solver.Interfaces(solver.InterfaceLaw(0.2), {("", ""): solver.InterfaceLaw(0.3)}, ground={"ground": 1e9})
    phase = solver.Settlement(rotation_centre=(0, 0), rotation=1, increment=0.005, limit=0.005)
    change = solver.PhaseChange(1, dead=[[0, 0, 0], [0, 0, 0], [0, -500, 0]])
    response = solver.Structure(stack, laws, loads).settle([phase, phase], changes=[change])
    again = blockvis.open_results(blockvis.write(response, tmp_path / "out"))
    again = blockvis.open_results(blockvis.write(again, tmp_path / "copy"))
    assert again.interfaces == response.interfaces
    for one, other in ((again.increments[-1], response.increments[-1]), (again.path[0], response.path[0])):
        assert np.array_equal(again.dead_at(one), response.dead_at(other))
    assert np.array_equal(again.loads.dead_arms, loads.dead_arms)


@pytest.mark.thorough
def test_what_a_folder_does_not_hold_is_told(tmp_path):
    scatter = solver.JointScatter(3, lambda part: 0.9 + 0.2 * part)
    laws = solver.Interfaces(solver.InterfaceLaw(0.4), scatter=scatter)
    response = solver.settle(_stack(), solver.Settlement((0, -1), increment=1, limit=1), interfaces=laws)
    folder = blockvis.write(response, tmp_path / "out")
    with pytest.warns(UserWarning, match="does not hold the scatter of friction from joint to joint"):
        assert blockvis.open_results(folder).interfaces.default == laws.default
    (folder / "laws_and_loads.npz").unlink()
    with pytest.warns(UserWarning, match="does not hold its laws, loads and changes; friction 0.6 and self-weight"):
        blockvis.open_results(folder)


def test_a_case_changed_in_python_reopens_as_it_ran(tmp_path):
    text = '[geometry]\nlayout = "arch"\nparameters = { voussoirs = 6 }\n[material]\nfriction_coefficient = 1.0\n'
    (tmp_path / "case.toml").write_text(
        f"{text}[settlement]\ndirection = [1, 0]\nincrement = 0.02\nlimit = 0.02\n", encoding="utf-8"
    )
    case = replace(blockvis.read_case(tmp_path / "case.toml"), friction_coefficient=0.5)
    run = blockvis.run_case(case, tmp_path / "out", pictures=False)
    assert blockvis.open_results(run.folder).interfaces == run.response.interfaces == solver.Interfaces(case.law)
    assert case.law.friction_coefficient == 0.5
    with pytest.raises(ValueError, match=r"case\.toml: no settlement was given; give one Settlement"):
        blockvis.run_case(replace(case, settlements=()), tmp_path / "none", pictures=False)
    assert not (tmp_path / "none").exists()
    (run.folder / "summary.json").unlink()
    assert blockvis.open_results(run.folder).interfaces == run.response.interfaces, "as of a run that was killed"


def test_no_name_is_no_folder(arch, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match="name the folder of the results"):
        blockvis.write(arch, "")
    with pytest.raises(ValueError, match="'' is no page"):
        blockvis.write_report(arch, "")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("name", ["report.pdf", "report.png", "report"])
def test_a_report_is_a_page_by_its_name(arch, tmp_path, name):
    with pytest.raises(ValueError, match=r"is no page; end its name in \.html or \.htm, or let 'blockvis"):
        blockvis.write_report(arch, tmp_path / name)


def test_results_opened_by_a_relative_path_are_read_from_another_folder(arch_folder, tmp_path, monkeypatch):
    monkeypatch.setattr("blockvis.results.increments.CACHED", 0)
    monkeypatch.chdir(arch_folder.parent)
    again = blockvis.open_results(arch_folder.name)
    monkeypatch.chdir(tmp_path)
    assert all(len(increment.forces) for increment in again.path)


@pytest.mark.parametrize(
    ("blocks", "points"),
    [
        ((1, None), (np.array([2, 1.5]), (9, 1.5))),
        ([1, None], [[2, 1.5], [9, 1.5]]),
        (np.array([1, 2]), np.array([[2, 1.5], [2, 2.5]])),
    ],
)
@pytest.mark.slow
def test_ties_of_arrays_and_lists_come_back(blocks, points, tmp_path):
    """Analyses took them, and the folder that was written in the end could not be read."""
    rod = solver.Tie("rod", blocks, points, 1e6)
    phase = solver.Settlement(rotation_centre=(0, 0), rotation=1, increment=0.005, limit=0.005)
    change = solver.PhaseChange(1, ties=["rod"])
    response = solver.Structure(_stack(), friction_coefficient=0.5, ties=[rod]).settle([phase] * 2, changes=[change])
    again = blockvis.open_results(blockvis.write(response, tmp_path / "out"))
    assert again.ties == (rod,)
    assert again.changes[0].ties == ("rod",)


@pytest.mark.parametrize("seconds", [-1, 0, np.nan])
def test_seconds_that_an_increment_cannot_take_are_refused(seconds, tmp_path):
    (tmp_path / "case.toml").write_text(
        '[geometry]\nlayout = "arch"\n[settlement]\ndirection = [1, 0]\n', encoding="utf-8"
    )
    with pytest.raises(ValueError, match=f"increment_seconds is {seconds:g}; give seconds above 0"):
        blockvis.run_case(tmp_path / "case.toml", tmp_path / "out", increment_seconds=seconds)
    assert blockvis.read_case(tmp_path / "case.toml", "settlement.limit=0.5").settlements[0].limit == 0.5


@pytest.mark.parametrize(
    ("name", "text"), [("summary.json", '{"status": '), ("step_check.json", "{"), ("range.csv", "a,b\n1,2\n")]
)
@pytest.mark.slow
def test_files_of_a_folder_that_are_damaged_are_named_with_the_remedy(name, text, arch_results, capsys):
    (arch_results / name).write_text(text, encoding="utf-8")
    assert main(["report", str(arch_results)]) == 2
    message = capsys.readouterr().err
    assert message.startswith(f"blockvis: '{arch_results / name}' is not what a run wrote (")
    assert message.endswith("); run the case again with --force\n")


@pytest.mark.slow
def test_the_unit_in_the_summary_is_that_of_the_displacement_at_collapse(tmp_path):
    """A stone falls between supports that part, before one of them turns."""
    outlines = [[[-1, -0.5], [0, -0.5], [0, 0], [-1, 0]], [[1, -0.5], [3, -0.5], [3, 0], [1, 0]]]
    outlines.append([[-0.3, 0], [1.3, 0], [1.3, 0.3], [-0.3, 0.3]])
    assembly = solver.Assembly.from_outlines(outlines, roles=["fixed", "moving", "free"])
    parts = solver.Settlement(direction=(1, 0), increment=0.05, limit=3.0)
    turns = solver.Settlement(rotation=-1.0, rotation_centre=(2, 0), increment=0.01, limit=0.1)
    response = solver.Structure(assembly, friction_coefficient=0.3).settle([parts, turns])
    assert response.collapse.unit == "m"
    out = blockvis.write(response, tmp_path / "out")
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert (summary["collapse_phase"], summary["settlement_unit"]) == (1, "m")
    assert blockvis.open_results(out).collapse.unit == "m"
