"""The results folder: what is written comes back."""

import csv
import json

import numpy as np
import pytest
from structures import equal_certificates

import blockvis
import solver
from blockvis import generators
from blockvis.cli import main
from solver import mechanics


@pytest.fixture(scope="module")
def response():
    spread = solver.Settlement(direction=(1, 0), increment=0.02, limit=0.5)
    return solver.settle(
        generators.arch(), spread, friction_coefficient=0.6, controls=solver.Controls(falling_frames=3)
    )


@pytest.fixture(scope="module")
def folder(response, tmp_path_factory):
    return blockvis.write(response, tmp_path_factory.mktemp("results") / "out")


def test_reopens_as_the_same_response(response, folder):
    again = blockvis.open_results(folder)
    assert again.stop == response.stop
    assert again.collapse.bracket == response.collapse.bracket
    assert again.assembly.names == response.assembly.names
    assert len(again.increments) == len(response.increments)
    for one, other in zip(again.increments, response.increments, strict=True):
        assert one.settlement == other.settlement
        assert one.reaction == other.reaction
        assert np.array_equal(one.pose.positions, other.pose.positions)
        assert np.array_equal(one.forces, other.forces)
        assert np.array_equal(one.states, other.states)
        assert equal_certificates(one.certificate, other.certificate)
    np.testing.assert_allclose(again.collapse.mechanism, response.collapse.mechanism, rtol=1e-12)


def test_csv_counts_every_contact_once(response, folder):
    rows = list(csv.DictReader((folder / "response.csv").read_text(encoding="utf-8").splitlines()))
    for row, increment in zip(rows, response.path, strict=True):
        counted = sum(int(row[f"contacts_{s}"]) for s in ("open", "sticking", "sliding", "hinging"))
        assert counted == len(increment.contacts)


def test_summary_reports_the_worst_residuals(response, folder):
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    worst = max(i.certificate.equilibrium_residual for i in response.path)
    assert summary["largest_residuals"]["equilibrium_residual"] == worst
    assert worst < 1e-8


def test_no_results(tmp_path):
    with pytest.raises(ValueError, match="holds no results"):
        blockvis.open_results(tmp_path)


def test_refuses_to_overwrite(response, folder):
    with pytest.raises(ValueError, match="holds results already"):
        blockvis.write(response, folder)


def test_the_worst_of_some_certificates_passes_over_what_was_not_worked_out():
    first = solver.Certificate(equilibrium_residual=1e-9, largest_penetration=3e-8)
    second = solver.Certificate(equilibrium_residual=2e-9, largest_penetration=1e-8, duality_gap=4e-12)
    for pair in ((first, second), (second, first)):
        worst = mechanics.worst_of(pair)
        assert (worst.equilibrium_residual, worst.largest_penetration, worst.duality_gap) == (2e-9, 3e-8, 4e-12)
        assert np.isnan(worst.kinematic_violation)
    assert mechanics.worst_of([]) is None


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


@pytest.mark.parametrize(
    ("name", "text"), [("summary.json", '{"status": '), ("step_check.json", "{"), ("range.csv", "a,b\n1,2\n")]
)
def test_files_of_a_folder_that_are_damaged_are_named_with_the_remedy(name, text, arch_results, capsys):
    (arch_results / name).write_text(text, encoding="utf-8")
    assert main(["report", str(arch_results)]) == 2
    message = capsys.readouterr().err
    assert message.startswith(f"blockvis: '{arch_results / name}' is not what a run wrote (")
    assert message.endswith("); run the case again with --force\n")
