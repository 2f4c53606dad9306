"""``blockvis run --range``: a settlement again with friction, compliance and imperfection varied."""

import csv
import json
from argparse import Namespace
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure
from structures import arch_response, case_from, report_of, run_command
from test_step_check import CASE, LIMIT_LOAD, SHORT, run_here

import blockvis
import solver
from blockvis.cli import _say_range, main
from blockvis.pictures.curves import _Plot
from blockvis.results.folder import stored_assembly
from blockvis.results.reaction_range import ReactionRange, stored_range
from blockvis.runs import path_range
from blockvis.runs.once_more import Traced, followed, traced
from blockvis.runs.path_range import VARIATIONS, PathRange, Variation

ALL = "(friction ± 5 %, compliance × 3 and ÷ 3, both together, imperfection × 0 and × 2)"


class Here:
    """Another path, followed in this process."""

    def __init__(self, case, folder):
        self.case, self.folder = case, folder

    def found(self, seconds):
        return followed(self.case, stored_assembly(self.folder))

    def close(self):
        pass


def path(last, collapse=None, factor=1.0, unit=0.1):
    s = np.arange(0.0, last + 1e-9, unit)
    return Traced(np.zeros(len(s), dtype=int), s, factor * (10.0 + s), np.zeros((len(s), 1, 2)), collapse, "ended")


@pytest.mark.slow
def test_a_range_is_printed_written_and_drawn(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(path_range, "OnceMore", Here)
    monkeypatch.setattr(path_range, "VARIATIONS", VARIATIONS[1:2])
    assert run_here(tmp_path, CASE, "--range") == 0
    told = capsys.readouterr()
    assert "blockvis: range: 1 more runs, " in told.err
    (line,) = [line for line in told.out.splitlines() if line.startswith("range of collapse ")]
    assert line.endswith(f" m {ALL}")
    out = tmp_path / "out"
    found = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    low, high = found["range"]["collapse"]
    assert low <= found["collapse_displacement"] <= high
    assert [run["friction_factor"] for run in found["range"]["runs"]] == [1.0, 1.05]
    assert {run["status"] for run in found["range"]["runs"]} == {"collapsed"}
    response, band = blockvis.open_results(out), stored_range(out)
    total, least, most = band.along(response)
    assert (np.interp(response.parameters, total, least) <= response.values * (1.0 + 1e-12)).all()
    assert (np.interp(response.parameters, total, most) >= response.values * (1.0 - 1e-12)).all()
    assert next(csv.DictReader((out / "range.csv").open(encoding="utf-8")))["runs"] == "2"
    # The case in the folder asks for it now; what is known is not worked out again, unless it is asked for again.
    assert run_command("--resume", out, "--no-pictures") == 0
    assert "range of" not in capsys.readouterr().out


@pytest.mark.slow
def test_processes_give_the_range_of_all_variations(tmp_path, capsys):
    (tmp_path / "case.toml").write_text(CASE + "\n[analysis]\nrange = true\n", encoding="utf-8")
    assert main(["run", str(tmp_path / "case.toml"), "-o", str(tmp_path / "out"), "--no-film", "--no-check-steps"]) == 0
    assert "range of collapse " in capsys.readouterr().out
    found = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert len(found["range"]["runs"]) == 1 + len(VARIATIONS)
    assert '"band":[[' in (tmp_path / "out" / "report.html").read_text(encoding="utf-8")


def test_a_variation_changes_friction_everywhere_and_the_controls():
    text = CASE + '\n[[interfaces]]\nmaterials = ["", ""]\nfriction_coefficient = 0.5\n'
    case = Variation(0.95, 3.0, 0.0).of(case_from(text))
    assert case.friction_coefficient == pytest.approx(1.9)
    assert [law.friction_coefficient for law in case.interfaces.values()] == [pytest.approx(0.475)]
    assert (case.controls.compliance_factor, case.controls.imperfection_factor) == (3.0, 0.0)


def test_the_range_says_how_many_collapse():
    plain, other = (Variation(), path(0.3, 0.35)), Variation(friction_factor=0.95)
    both = PathRange([plain, (other, path(0.2, 0.25, 1.1))], ["m"])
    assert str(both) == f"range of collapse 0.25 to 0.35 m {ALL}"
    near = PathRange([(Variation(), path(0.1, 0.141043)), (other, path(0.1, 0.141036))], ["m"])
    assert str(near) == f"range of collapse 0.141036 to 0.141043 m {ALL}"
    one = PathRange([plain, (other, path(0.5))], ["m"])
    assert str(one) == f"range of collapse from 0.35 m on, 1 of 2 runs without a collapse {ALL}"
    assert one.numbers()["collapse"] == [0.35, None]
    none = PathRange([(Variation(), path(0.5)), (other, path(0.5, factor=1.1)), (other, None)], ["m"])
    assert str(none).startswith("range of reaction 10.5 N to 11.55 N at 0.5 m, no collapse in 2 runs (friction")
    assert str(none).endswith("× 2; 1 run came to nothing)")
    assert none.numbers()["collapse"] is None
    alike = PathRange([(Variation(), path(0.5)), (other, path(0.5, factor=1.000001))], ["m"])
    assert str(alike).startswith("range of reaction 10.5 N at 0.5 m, no collapse in 2 runs")


def test_the_range_of_no_reaction_is_nothing():
    rounding = replace(path(0.2), measured=np.array([1e-5, -1e-5, 1e-5]), phases=np.array([0, 0, 1]))
    found = PathRange([(Variation(), rounding.without_rounding(np.array([1e-4, 1e-6])))], ["m", "m"])
    assert found.reaction().high.tolist() == [0.0, 0.0, 1e-5]


def test_a_run_that_does_not_stand_collapses_at_nothing_and_one_that_fails_says_nothing():
    stump = solver.Assembly.from_outlines(
        [[[0, 0], [1, 0], [1, 1], [0, 1]], [[0.9, 1], [2.9, 1], [2.9, 2], [0.9, 2]]], roles=["moving", "free"]
    )
    response = solver.settle(stump, solver.Settlement(direction=(1, 0), increment=0.1, limit=0.1))
    assert response.stop == solver.Status.NO_INITIAL_EQUILIBRIUM
    falls, failed = traced(response), replace(path(0.2), stop="solver failed")
    runs = [(Variation(), path(0.3, 0.35)), (Variation(0.95), falls), (Variation(1.05), failed)]
    found = PathRange(runs, ["m"])
    without = "1 run without an initial equilibrium; 1 run came to nothing)"
    assert str(found) == f"range of collapse 0 to 0.35 m {ALL[:-1]}; {without}"
    assert found.numbers()["collapse"] == [0.0, 0.35]
    assert [run["collapse_phase"] for run in found.numbers()["runs"]] == [1, 1, None]


def test_collapses_of_two_settlements_are_told_with_theirs():
    """What falls as the second begins has a displacement below that of what falls at the end of the first."""
    late = replace(path(0.1, 4e-6), collapse_phase=1)
    found = PathRange([(Variation(), late), (Variation(0.95), path(0.1, 0.141))], ["m", "rad"])
    assert str(found) == f"range of collapse 0.141 m in phase 1 to 4e-06 rad in phase 2 {ALL}"
    assert [run["collapse_phase"] for run in found.numbers()["runs"]] == [2, 1]
    early = replace(found, runs=[found.runs[1], (Variation(), path(0.5))])
    assert str(early).startswith("range of collapse from 0.141 m in phase 1 on, 1 of 2 runs without")


def test_the_reaction_ranges_over_the_runs_that_get_there():
    runs = [(Variation(), path(0.3, 0.35)), (Variation(0.95), path(0.2, 0.25, 1.1, unit=0.05))]
    reaction = PathRange(runs, ["m"]).reaction()
    assert reaction.settlements == pytest.approx([0.0, 0.05, 0.1, 0.15, 0.2, 0.3])
    # The first run tells nothing between rest, which its reaction leaves at once, and its first increment.
    assert reaction.low == pytest.approx((10.0 + reaction.settlements) * [1.0, 1.1, 1.0, 1.0, 1.0, 1.0])
    assert reaction.high == pytest.approx((10.0 + reaction.settlements) * [1.1, 1.1, 1.1, 1.1, 1.1, 1.0])
    assert reaction.runs.tolist() == [2, 2, 2, 2, 2, 1]


@pytest.mark.thorough
def test_the_band_of_a_later_phase_lies_behind_those_before():
    arch = blockvis.generators.arch(voussoirs=6, thickness_ratio=0.2)
    phases = [solver.Settlement(direction=d, increment=0.05, limit=0.05) for d in ((1, 0), (0, -1))]
    response = solver.settle(arch, phases, friction_coefficient=2.0)
    low = PathRange([(Variation(), traced(response))], ["m"]).reaction()
    band = ReactionRange(low.phases, low.settlements, low.low, 2.0 * low.high, low.runs)
    total, _, _ = band.along(response)
    assert total[-1] == pytest.approx(0.1)
    axes = Figure().add_subplot()
    _Plot(axes, response, words=True).draw(band)
    (drawn,) = axes.collections
    assert drawn.get_paths()[0].get_extents().x1 == pytest.approx(100.0)
    assert axes.get_ylim()[1] > drawn.get_paths()[0].get_extents().y1
    assert '"band":[[0.0,' in report_of(response, band=band)
    assert f"<td>1 run: {ALL[1:-1]}</td>" in report_of(response, band=band)
    assert '"band":[]' in report_of(response)


@pytest.mark.thorough
def test_words_of_a_collapse_lie_where_other_runs_leave_room():
    """Their band has no height, and goes on to three times the settlement of the collapse."""
    reaction = np.full(2, 2000.0)
    band = ReactionRange(np.zeros(2, dtype=int), np.array([0.0, 0.45]), reaction, reaction, np.array([9, 2]))
    figure = Figure()
    axes = figure.add_subplot()
    _Plot(axes, arch_response(), words=True).draw(band)
    figure.draw_without_rendering()
    (words,) = [text for text in axes.texts if "collapse" in text.get_text()]
    assert words.get_window_extent().x0 > axes.bbox.x0
    assert axes.collections[0].get_linewidth()[0] > 0.0


def test_ctrl_c_leaves_the_range_and_a_run_of_which_it_is_missing_is_interrupted(tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(path_range, "find_range", interrupted)
    (tmp_path / "out").mkdir()
    monkeypatch.setattr("blockvis.runs.step_check.stored_case", lambda _: SimpleNamespace(settings=True))
    response = SimpleNamespace(stop=solver.Status.COLLAPSED, increments=(), path=(None,))
    run = SimpleNamespace(response=response, folder=tmp_path / "out", had_finished=False)
    with pytest.raises(KeyboardInterrupt, match="range not known: interrupted; everything else is written"):
        _say_range(Namespace(range=False), run)


def test_a_range_that_is_asked_for_later_is_drawn_in_every_curve_that_is_there(tmp_path, monkeypatch):
    arch = blockvis.generators.arch(voussoirs=6, thickness_ratio=0.2)
    response = solver.settle(arch, solver.Settlement([1, 0], increment=0.01, limit=0.01), friction_coefficient=2.0)
    monkeypatch.setattr(path_range, "find_range", lambda *_: "range")
    monkeypatch.setattr("blockvis.runs.step_check.stored_case", lambda _: None)
    (tmp_path / "curve.svg").touch()
    _say_range(Namespace(range=True), SimpleNamespace(response=response, folder=tmp_path, had_finished=True))
    assert [(file.name, file.stat().st_size > 400) for file in tmp_path.iterdir()] == [("curve.svg", True)]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (SHORT + "\n[analysis]\nrange = 3\n", "[analysis] range is 3; give true or false"),
        (
            LIMIT_LOAD.replace("[[loads]]", "range = true\n\n[[loads]]"),
            '[analysis] range = true belongs to kind = "settlement"; a limit load has no range: leave it out',
        ),
        (
            SHORT + '\n[analysis]\nincrements = "linear program"\nrange = true\n',
            '[analysis] range = true belongs to increments = "coulomb"; a linear program knows no compliance and no '
            "imperfection",
        ),
        (
            SHORT + "step_tolerance = 0\n",
            "[settlement] step_tolerance is 0; give a number above 0 and below 1",
        ),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(tmp_path, capsys, text, words):
    assert run_here(tmp_path, text) == 2
    assert capsys.readouterr().err == f"blockvis: {tmp_path / 'case.toml'}: {words}\n"


def test_the_option_is_refused_where_there_is_no_settlement(tmp_path, capsys):
    assert run_here(tmp_path, LIMIT_LOAD, "--range") == 2
    assert '[analysis] range = true belongs to kind = "settlement"' in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_runs_that_came_to_nothing_are_left_out():
    found = PathRange([(Variation(), path(0.3, 0.35)), (replace(VARIATIONS[0]), None)], ["m"])
    assert found.numbers()["collapse"] == [0.35, 0.35]
    assert found.numbers()["runs"][1]["status"] is None
