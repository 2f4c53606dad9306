"""``blockvis run``: a path with a quarter of the step tolerance, and the error that follows, told and written."""

import json
import subprocess
import sys
from argparse import Namespace
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from structures import arch_response, case_from, run_command

import blockvis
import solver
from blockvis import write_report
from blockvis.cli import _say_error, main
from blockvis.report.page import add_error
from blockvis.runs import step_check
from blockvis.runs.once_more import traced
from blockvis.runs.step_check import StepCheck, StepChecking, compared, stored_check
from solver import mechanics

CASE = """
[geometry]
layout = "arch"

[geometry.parameters]
voussoirs = 6
thickness_ratio = 0.2

[material]
friction_coefficient = 2.0

[settlement]
direction = [1.0, 0.0]
increment = 0.1
limit = 1.0
tolerance = 1e-3
"""

#: The first increments of it.
SHORT = CASE.replace("limit = 1.0", "limit = 0.1")

LIMIT_LOAD = """
[geometry]
layout = "arch"

[material]
friction_coefficient = 2.0

[analysis]
kind = "limit load"

[[loads]]
kind = "live"
blocks = "voussoir 3"
force = [0.0, -1.0]
"""

CHECK = StepCheck("reaction", 0.01, 0.1, "m", float("nan"), 0.002, "collapsed", "collapsed")


def run(folder, text, *options, pictures=False):
    (folder / "case.toml").write_text(text, encoding="utf-8")
    options = (*options, "--no-film" if pictures else "--no-pictures")
    command = [sys.executable, "-m", "blockvis", "run", "case.toml", "-o", "out", *options]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def run_here(folder, text, *options):
    (folder / "case.toml").write_text(text, encoding="utf-8")
    return run_command(folder / "case.toml", "-o", folder / "out", "--no-pictures", *options)


@pytest.mark.slow
def test_a_run_prints_its_step_error_by_default(tmp_path):
    done = run(tmp_path, CASE)
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("error of the steps: reaction")]
    assert line == str(stored_check(tmp_path / "out"))
    check = json.loads((tmp_path / "out" / "step_check.json").read_text(encoding="utf-8"))
    assert check["stop"] == check["stop_of_check"] == "collapsed"
    # The collapse is enclosed to a thousandth of a metre, in other steps at other places.
    displacement = blockvis.open_results(tmp_path / "out").collapse.displacement
    assert 0.0 < check["collapse"] < 2e-3 / displacement
    assert 0.0 < check["difference"] < 1e-5
    assert "collapse" in line
    assert "steps matter" not in done.stderr
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["step_error"] == {
        "reaction": 2.0 * check["difference"],
        "collapse": 2.0 * check["collapse"],
        "position": 2.0 * check["position"],
    }


@pytest.mark.slow
def test_the_report_of_a_run_has_its_step_error(tmp_path):
    done = run(tmp_path, CASE, "--check-steps", pictures=True)
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("error of the steps")]
    assert (tmp_path / "out" / "report.html").read_text(encoding="utf-8").count(row_of(line)) == 1


def row_of(line):
    return "<tr><td>{}</td><td>{}</td></tr>".format(*line.split(": "))


@pytest.mark.slow
def test_a_report_keeps_its_step_error_when_it_is_drawn_again(tmp_path, capsys):
    assert run_here(tmp_path, SHORT, "--check-steps") == 0
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("error of the steps")]
    response, report = blockvis.open_results(tmp_path / "out"), tmp_path / "out" / "report.html"
    write_report(response, report)
    assert row_of(line) not in report.read_text(encoding="utf-8")
    add_error(report, line)
    assert report.read_text(encoding="utf-8").count(row_of(line)) == 1
    report.unlink()
    (tmp_path / "out" / "range.csv").write_text(
        "phase,settlement,reaction_low,reaction_high,runs\n0,0.0,1e3,2e3,9\n0,0.01,1e3,2e3,9\n", encoding="utf-8"
    )
    assert main(["run", "--resume", str(tmp_path / "out"), "--no-film"]) == 0
    drawn = report.read_text(encoding="utf-8")
    assert drawn.count(row_of(line)) == 1
    assert "band behind the curve" in drawn
    assert '"band":[[0.0,' in drawn


@pytest.mark.slow
def test_no_steps_are_checked_where_none_are_to_be(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "step_check.json").write_text("{}", encoding="utf-8")
    done = run(tmp_path, SHORT, "--no-check-steps", "--force")
    assert done.returncode == 0, done.stderr
    assert "error of the steps" not in done.stdout
    # That of results before is none of these.
    assert not (tmp_path / "out" / "step_check.json").exists()


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("text", "what"),
    [
        (SHORT + '[analysis]\nincrements = "linear program"\n', "settlement, 2 increments, by linear program"),
        (LIMIT_LOAD, "limit load"),
    ],
)
def test_what_has_no_steps_is_refused(text, what, tmp_path, capsys):
    assert run_here(tmp_path, text, "--check-steps") == 2
    assert f"has no path whose steps could be checked ({what}" in capsys.readouterr().err
    assert (tmp_path / "out" / "summary.json").is_file()


def test_the_error_is_twice_the_difference_and_what_matters_is_warned_of():
    assert str(CHECK) == "error of the steps: reaction ± 2 % (at 0.1 m), blocks ± 4 mm"
    assert "the steps matter by more than 1 %: take a smaller step_tolerance" in CHECK.warning
    assert CHECK.warning.endswith("give results with their range (--range)")
    # Limit loads and pushovers have none.
    assert replace(CHECK, what="load multiplier").warning.endswith("a wall may have several paths")
    assert str(replace(CHECK, position=0.117)).endswith(", blocks ± 230 mm")
    assert ", collapse ± 0.6 %, blocks" in str(replace(CHECK, collapse=0.003))
    small = replace(CHECK, difference=1e-7, position=1e-9, collapse=0.0)
    words = "reaction below 0.01 %, collapse below 0.01 %, blocks below 0.01 mm"
    assert str(small) == f"error of the steps: {words}"
    assert small.warning == ""


def test_where_one_run_collapses_and_the_other_does_not_both_ends_are_named():
    check = replace(CHECK, difference=0.001, stop_of_check="limit reached")
    assert str(check).endswith(", but with a quarter of the step tolerance it ends as 'limit reached', not 'collapsed'")
    assert check.warning.startswith("the steps matter")
    assert "not solved" in replace(check, stop_of_check="solver failed").warning
    assert check.step_error == {"reaction": 0.002, "collapse": None, "position": 0.004}


def test_a_check_is_read_as_it_was_written(tmp_path):
    numbers = {**vars(CHECK), "collapse": None}
    (tmp_path / "step_check.json").write_text(json.dumps(numbers), encoding="utf-8")
    assert str(stored_check(tmp_path)) == str(CHECK)


@pytest.fixture(scope="module")
def settled():
    arch = blockvis.generators.arch(voussoirs=6, thickness_ratio=0.2)
    settlement = solver.Settlement(direction=(1, 0), increment=0.1, limit=0.2)
    return solver.settle(arch, settlement, friction_coefficient=2.0)


def test_runs_are_compared_at_the_same_places_only(settled):
    ours = traced(settled)
    other = replace(
        ours,
        parameters=ours.parameters + np.array([0.0, 0.0, 0.03]),
        measured=ours.measured * [1.0, 1.02, 1.5],
        positions=ours.positions + np.array([0.0, 1.0, 9.0])[:, None, None] * [0.003, 0.004],
    )
    check = compared(settled, other)
    assert (check.difference, check.at) == (pytest.approx(0.02), pytest.approx(0.1))
    assert check.position == pytest.approx(0.005)
    assert check.error == 2.0 * check.difference


def test_the_peaks_of_two_pushovers_are_compared_wherever_they_are(settled):
    ours = traced(settled)
    last = np.arange(len(ours.parameters)) == len(ours.parameters) - 1
    higher = np.where(last, 2.0 * ours.measured.max(), ours.measured)
    other = replace(ours, parameters=ours.parameters + 1e-3 * last, measured=higher)
    assert compared(settled, other).difference == 0.0
    assert compared(replace(settled, measured=mechanics.LOAD_MULTIPLIER), other).difference == pytest.approx(1.0)


def test_an_error_is_told_in_the_unit_of_the_settlement_where_it_is_and_with_its_phase(settled):
    turning = solver.Settlement(rotation_centre=(1.0, 0.0), rotation=1.0)
    other = traced(settled)
    other.measured[1] *= 1.02
    check = compared(replace(settled, settlements=(*settled.settlements, turning)), other)
    assert (check.unit, check.phase) == ("m", 1)
    assert " (at 0.1 m in phase 1), " in str(check)


def test_collapses_of_two_settlements_are_no_measure_of_each_other():
    response = arch_response()
    check = compared(response, replace(traced(response), collapse=1e-6, collapse_phase=1))
    assert np.isnan(check.collapse)
    assert str(check).endswith(
        "with a quarter of the step tolerance it ends as 'collapsed in phase 2', not 'collapsed in phase 1'"
    )


def test_where_the_reaction_is_next_to_nothing_it_is_compared_with_a_part_of_the_first(settled):
    last = replace(settled.increments[2], measured=0.0)
    other = traced(settled)
    other.measured[2] = 0.001 * other.measured[0]
    check = compared(replace(settled, increments=(*settled.increments[:2], last)), other)
    assert (check.difference, check.at) == (pytest.approx(0.02), pytest.approx(0.2))


class Done:
    """Another path that is there."""

    path = None

    def __init__(self, case, _):
        assert case.controls.step_tolerance == 0.25 * solver.Controls().step_tolerance

    def found(self, seconds):
        return Done.path


@pytest.mark.parametrize(("reaction", "collapse", "told"), [(1.3, 0.27, 0.2), (1.001, 0.303, 0.02), (1.3, None, None)])
def test_a_path_with_a_quarter_of_the_tolerance_says_the_errors(
    tmp_path, monkeypatch, settled, reaction, collapse, told
):
    fallen = replace(settled, collapse=SimpleNamespace(displacement=0.3, bracket=(0.3, 0.3)))
    monkeypatch.setattr(step_check, "OnceMore", Done)
    Done.path = replace(traced(fallen), collapse=collapse)
    Done.path.measured[1] *= reaction
    (tmp_path / "summary.json").write_text("{}", encoding="utf-8")
    check = StepChecking(case_from(SHORT, tmp_path)).compared(tmp_path, fallen, 0.0)
    assert check.step_error["collapse"] == (None if told is None else pytest.approx(told))
    assert check.step_error["reaction"] == pytest.approx(2.0 * (reaction - 1.0))
    assert str(stored_check(tmp_path)) == str(check)


def test_nothing_is_compared_where_only_the_state_at_rest_is_in_both(tmp_path, monkeypatch, settled):
    ours = traced(settled)
    check = compared(settled, replace(ours, parameters=ours.parameters * 0.9))
    assert check.step_error == {"reaction": None, "collapse": None, "position": None}
    unknown = "reaction and blocks not known, as no increment is in both but that at rest"
    assert str(check) == f"error of the steps: {unknown}"
    assert (check.error, check.warning) == (0.0, "")
    fallen = replace(settled, collapse=SimpleNamespace(displacement=0.3, bracket=(0.3, 0.3)))
    monkeypatch.setattr(step_check, "OnceMore", Done)
    Done.path = replace(traced(fallen), parameters=ours.parameters * 0.9, collapse=0.303)
    (tmp_path / "summary.json").write_text("{}", encoding="utf-8")
    check = StepChecking(case_from(SHORT, tmp_path)).compared(tmp_path, fallen, 0.0)
    assert str(check) == f"error of the steps: collapse ± 2 %, {unknown}"
    assert (check.error, bool(check.warning)) == (pytest.approx(0.02), True)
    assert str(stored_check(tmp_path)) == str(check)
    assert json.loads((tmp_path / "summary.json").read_text(encoding="utf-8"))["step_error"]["reaction"] is None


class Late:
    """Another path that does not come."""

    def __init__(self, *_):
        pass

    def found(self, seconds):
        raise TimeoutError

    def close(self):
        pass


def test_a_path_that_does_not_come_is_left_in_one_line_with_the_remedy(tmp_path, monkeypatch, capsys, settled):
    monkeypatch.setattr(step_check, "OnceMore", Late)
    checking = StepChecking(case_from(SHORT, tmp_path))
    left = SimpleNamespace(had_finished=False, folder=tmp_path, response=settled)
    _say_error(Namespace(check_steps=None), left, checking, 0.0)
    assert capsys.readouterr().err == (
        "blockvis: error not known: the same path in shorter steps takes longer than 0 s more; --check-steps waits for "
        "it, --no-check-steps does without\n"
    )
