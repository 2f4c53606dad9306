"""``blockvis run --check-steps``: the same path with half the step tolerance, through the real entry point."""

import json
import subprocess
import sys
from dataclasses import replace

import pytest

import blockvis
import solver
from blockvis.processes import cores
from blockvis.runs.step_check import StepCheck, compared, stored_check, traced

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


def run(folder, text, *options, pictures=False):
    (folder / "case.toml").write_text(text, encoding="utf-8")
    options = (*options, "--no-film" if pictures else "--no-pictures")
    command = [sys.executable, "-m", "blockvis", "run", "case.toml", "-o", "out", *options]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.thorough
def test_the_command_says_how_much_the_steps_matter(tmp_path):
    done = run(tmp_path, CASE, "--check-steps")
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("error of the steps")]
    check = json.loads((tmp_path / "out" / "step_check.json").read_text(encoding="utf-8"))
    assert check["stop"] == check["stop_of_check"] == "collapsed"
    # The collapse is enclosed to a thousandth of a metre, in other steps at other places.
    displacement = blockvis.open_results(tmp_path / "out").collapse.displacement
    assert 0.0 < check["collapse"] < 2e-3 / displacement
    assert check["difference"] < 1e-5
    assert "collapse" in line
    assert "steps matter" not in done.stderr


def test_a_run_says_so_without_being_asked_where_there_is_a_second_core(tmp_path):
    done = run(tmp_path, CASE)
    assert done.returncode == 0, done.stderr
    said = "error of the steps" in done.stdout
    assert (tmp_path / "out" / "step_check.json").is_file() == said
    # Where other processes have the cores it may come too late, which is said, too.
    assert (said or "error not known" in done.stderr) == (cores() > 1)


@pytest.mark.pictures
def test_the_report_says_so_too_also_when_it_is_drawn_again(tmp_path):
    done = run(tmp_path, CASE, "--check-steps", pictures=True)
    assert done.returncode == 0, done.stderr
    (line,) = [line for line in done.stdout.splitlines() if line.startswith("error of the steps")]
    row = "<tr><td>{}</td><td>{}</td></tr>".format(*line.split(": "))
    report = tmp_path / "out" / "report.html"
    assert report.read_text(encoding="utf-8").count(row) == 1
    report.unlink()
    again = [sys.executable, "-m", "blockvis", "render", "out"]
    subprocess.run(again, cwd=tmp_path, check=True, capture_output=True)
    assert report.read_text(encoding="utf-8").count(row) == 1


def test_no_steps_are_checked_where_none_are_to_be(tmp_path):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "step_check.json").write_text("{}", encoding="utf-8")
    done = run(tmp_path, CASE, "--no-check-steps", "--force")
    assert done.returncode == 0, done.stderr
    assert "error of the steps" not in done.stdout
    # That of results before is none of these.
    assert not (tmp_path / "out" / "step_check.json").exists()


def test_linear_programs_take_no_steps_that_could_be_compared(tmp_path):
    text = CASE + '\n[analysis]\nincrements = "linear program"\n'
    done = run(tmp_path, text)
    assert done.returncode == 0, done.stderr
    assert "error" not in done.stdout + done.stderr
    assert not (tmp_path / "out" / "step_check.json").exists()
    done = run(tmp_path, text, "--check-steps", "--force")
    assert done.returncode == 2
    assert "has no path whose steps could be checked (settlement, 4 increments, by linear program)" in done.stderr


def test_what_matters_is_warned_of():
    check = StepCheck("reaction", 0.02, 0.1, "m", float("nan"), "collapsed", "collapsed")
    assert str(check) == "error of the steps: reaction 2 % at 0.1 m (apart from a run with half the step tolerance)"
    assert "the steps matter by more than 1 %: take a smaller step_tolerance" in check.warning
    assert "collapse 0.3 % (apart" in str(replace(check, collapse=0.003))
    assert replace(check, difference=0.009).warning == ""
    assert replace(check, difference=0.009, stop_of_check="limit reached").warning


def test_a_check_is_read_as_it_was_written(tmp_path):
    check = StepCheck("reaction", 0.02, 0.1, "m", float("nan"), "collapsed", "collapsed")
    numbers = {**vars(check), "collapse": None, "way": "steps"}
    (tmp_path / "step_check.json").write_text(json.dumps(numbers), encoding="utf-8")
    assert str(stored_check(tmp_path)) == str(check)


@pytest.mark.thorough
def test_what_has_no_steps_is_refused(tmp_path):
    done = run(tmp_path, LIMIT_LOAD, "--check-steps")
    assert done.returncode == 2
    assert "has no path whose steps could be checked (limit load" in done.stderr
    assert (tmp_path / "out" / "summary.json").is_file()


def test_reactions_are_compared_at_the_same_places_only():
    arch = blockvis.generators.arch(voussoirs=6, thickness_ratio=0.2)
    settlement = solver.Settlement(direction=(1, 0), increment=0.1, limit=0.2)
    response = solver.settle(arch, settlement, friction_coefficient=2.0)
    heavier = [replace(i, measured=1.02 * i.measured, reaction=1.02 * i.reaction) for i in response.increments]
    elsewhere = [replace(i, parameter=i.parameter + 0.03) for i in response.increments[1:]]
    check = compared(response, traced(replace(response, increments=(*heavier[:2], *elsewhere))))
    assert check.at == pytest.approx(0.1)
    assert check.difference == pytest.approx(0.02 * response.reaction[1] / response.reaction.max())
    assert check.error == check.difference
