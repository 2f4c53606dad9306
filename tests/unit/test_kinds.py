"""Kinds of analysis: no module but their own asks which it is, and a new one is an object, its solver and a test."""

import ast
import csv
import io
import json
import re
import threading
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from structures import case_from, rectangle, report_of, sunk_and_tilted

import blockvis
import solver
from blockvis import draw_curve
from blockvis.cli import _in_words
from blockvis.kinds.kind import AnalysisKind, AnalysisRun, RunInput, Steps
from blockvis.kinds.kinds import KINDS
from blockvis.pictures.captions import state_text
from blockvis.runs.progress import Progress
from solver import mechanics

ROOT = Path(__file__).parents[2]

#: What may know the kinds by their names.
HOME = ROOT / "blockvis" / "runs"


def _compared_names(path: Path) -> list[tuple[int, str]]:
    """Lines of a module where a name of a kind is compared with something, or looked up in a match."""
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Compare | ast.MatchValue):
            for part in ast.walk(node):
                if isinstance(part, ast.Constant) and part.value in KINDS:
                    found.append((node.lineno, part.value))
    return found


def test_the_search_for_comparisons_finds_them(tmp_path):
    module = tmp_path / "module.py"
    module.write_text(
        'if kind in ("pushover", "other"):\n    pass\nanalysis = "settlement"\nx != "limit load"\n', encoding="utf-8"
    )
    assert sorted(_compared_names(module)) == [(1, "pushover"), (4, "limit load")]


@pytest.mark.parametrize("package", ["solver", "blockvis"])
@pytest.mark.slow
def test_only_the_kinds_know_their_names(package):
    modules = [path for path in sorted((ROOT / package).rglob("*.py")) if path.parent != HOME]
    found = {str(path.relative_to(ROOT)): _compared_names(path) for path in modules}
    assert {path: lines for path, lines in found.items() if lines} == {}


def test_the_runs_ask_their_kind_too():
    kinds = {"kind.py", "kinds.py", *(f"{name.replace(' ', '_')}.py" for name in KINDS)}
    for path in sorted(HOME.glob("*.py")):
        if path.name not in kinds:
            assert _compared_names(path) == [], path.name


class TiltKind(AnalysisKind):
    """Gravity turns about the structure in equal steps until its limit load at that tilt is used up."""

    name = "tilt"
    parameter = mechanics.Quantity("tilt", "θ", "rad")
    measured = mechanics.Quantity("reserve", "r", "")

    def read(self, top: Any, analysis: Any) -> float:
        return analysis.number("tilt_step") or 0.02

    def start(self, given: RunInput, resume: Any, found: Sequence[solver.Increment]) -> AnalysisRun:
        return AnalysisRun(
            self.name, given, self.course(given.case), mechanics.Increments(_tilted(given, given.case.settings))
        )

    def summary(self, response: solver.Response) -> dict[str, Any]:
        return {"tilt_step": float(np.diff(response.parameters)[0])}

    def lines(self, response: solver.Response) -> list[str]:
        return [str(response.collapse)]

    def title(self, response: solver.Response) -> str:
        return f"Collapse at tilt {response.collapse.displacement:.5g} rad"

    def rows(self, response: solver.Response) -> list[tuple[str, str]]:
        return [("last reserve", f"{response.values[-1]:.5g}")]


def _tilted(given: RunInput, step: float) -> Steps:
    weight, previous = given.loads.dead[:, 1], None
    for number in range(1000):
        angle = number * step
        push = np.zeros_like(given.loads.dead)
        push[:, 0] = -weight
        dead = np.stack([-weight * np.sin(angle), weight * np.cos(angle), np.zeros(len(weight))], axis=1)
        limit = solver.limit_load(given.assembly, loads=solver.Loads(dead=dead, live=push), interfaces=given.interfaces)
        state = replace(limit.increment, parameter=angle, measured=limit.multiplier)
        if previous is not None and not limit.multiplier > 0.0:
            last = previous.parameter
            words = str(mechanics.mechanism_of(given.assembly, previous))
            collapse = solver.Collapse((last + angle) / 2, (last, angle), 0.0, previous.velocity, "rad", words)
            return mechanics.Ending(solver.Status.COLLAPSED, str(collapse), collapse)
        previous = state
        yield state
    return mechanics.Ending(solver.Status.LIMIT_REACHED)


TILT = """
[geometry]
layout = "column"
[geometry.parameters]
blocks = 1
width = 0.2
block_height = 1.0
[material]
friction_coefficient = 0.7
[analysis]
kind = "tilt"
tilt_step = 0.03
"""


SETTLING = TILT.replace('"tilt"\ntilt_step = 0.03', '"settlement"') + "[settlement]\ndirection = [0, -1]\nlimit = 0.4\n"


def test_a_new_kind_is_an_object_of_its_own(tmp_path, monkeypatch):
    """A block of b × h on ground that tilts turns over at tan θ = b/h."""
    monkeypatch.setitem(KINDS, "tilt", TiltKind())
    case = case_from(TILT, tmp_path)
    run = blockvis.run_case(case, tmp_path / "out", outputs=())
    low, high = run.summary["collapse_bracket"]
    assert low < np.arctan(0.2) < high == pytest.approx(low + 0.03)
    stored = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert (stored["analysis"], stored["parameter"], stored["tilt_step"]) == ("tilt", "tilt", pytest.approx(0.03))
    rows = list(csv.DictReader((tmp_path / "out" / "response.csv").open(encoding="utf-8")))
    assert [float(row["tilt"]) for row in rows] == pytest.approx(0.03 * np.arange(7))
    # Turned by θ, the block is held by tan(arctan(b/h) - θ) of its weight beside it, times cos θ.
    again = blockvis.open_results(tmp_path / "out")
    assert again.parameter == TiltKind.parameter
    assert again.measured == TiltKind.measured
    assert again.values == pytest.approx(0.2 * np.cos(again.parameters) - np.sin(again.parameters), abs=1e-7)
    assert again.collapse.bracket == (low, high)
    assert draw_curve(again, tmp_path / "curve.png").stat().st_size > 10_000
    assert state_text(again.path[1], again) == f"Tilt 0.0300 rad   ·   Reserve r = {again.values[1]:.5g}"
    assert "Collapse at tilt 0.195 rad" in report_of(again)
    assert str(again.collapse) in _in_words(again, tmp_path)


def test_keys_of_a_kind_belong_to_it(tmp_path):
    with pytest.raises(ValueError, match="kind is 'tilt'"):
        case_from(TILT, tmp_path)
    settling = TILT.replace('kind = "tilt"', 'kind = "settlement"') + "[settlement]\ndirection = [0, -1]\n"
    with pytest.raises(ValueError, match="tilt_step is not a key here"):
        case_from(settling, tmp_path)


class Terminal(io.StringIO):
    """A stream that somebody watches."""

    def isatty(self) -> bool:
        return True


def standing(phase=0):
    """An increment in equilibrium at 0.05, with 7 of whatever is measured."""
    nothing = np.zeros((0, 2))
    state = mechanics.State(None, None, nothing, nothing, nothing, nothing, nothing)
    certificate, status = solver.Certificate(), solver.Status.EQUILIBRIUM
    return solver.Increment(0.05, 7.0, phase, 7.0, 7.0, certificate, status, 1, 0.1, state)


@pytest.mark.parametrize(
    ("analysis", "extra", "line"),
    [
        ("settlement", "", "settlement 0.05 of at most 0.4 m, reaction 7 N, 1 increment"),
        (
            "settlement",
            "rotation_centre = [0, 0]\n",
            "settlement 0.05 of at most 0.4 rad, reaction 7 N·m, 1 incr",
        ),
        ("limit load", "", "settlement 0.05 of at most 0.4 m, load multiplier 7, 1 increment"),
        ("pushover", "", "control displacement 0.05 of at most 1 m, load multiplier 7, 1 increment"),
    ],
)
def test_the_bar_shows_the_quantities_of_the_kind(analysis, extra, line, tmp_path, monkeypatch):
    monkeypatch.setattr("blockvis.runs.progress.REDRAW", -1.0)
    direction = "" if extra else "direction = [0, -1]\n"
    text = TILT.replace('"tilt"\ntilt_step = 0.03', f'"{analysis}"') + f"[settlement]\n{direction}limit = 0.4\n{extra}"
    if analysis != "settlement":
        text += '[[loads]]\nkind = "live"\nweight_fraction = [1.0, 0.0]\n'
    if analysis == "pushover":
        text += '[control]\nblock = "block 1"\n'
    course = KINDS[analysis].course(case_from(text, tmp_path))
    stream = Terminal()
    monkeypatch.setattr("sys.stderr", stream)
    Progress(course, None).increment(standing())
    assert f"] {line}" in stream.getvalue()


def test_the_bar_of_several_settlements_has_the_unit_of_each(tmp_path, monkeypatch):
    """The reaction to a second one that moved supports was told in N·m, after a first that turned them."""
    turns = "[[settlement]]\nrotation_centre = [0, 0]\nrotation = 1\nlimit = 0.1\n"
    text = '[geometry]\nlayout = "arch"\n' + turns + "[[settlement]]\ndirection = [0, -1]\nlimit = 0.1\n"
    stream = Terminal()
    monkeypatch.setattr("blockvis.runs.progress.REDRAW", -1.0)
    monkeypatch.setattr("sys.stderr", stream)
    bar = Progress(KINDS["settlement"].course(case_from(text, tmp_path)), None)
    for phase in (0, 1):
        bar.increment(standing(phase))
    assert "0.1 rad, reaction 7 N·m, 1 increment" in stream.getvalue()
    assert "0.1 m, reaction 7 N, 2 increments" in stream.getvalue()


def test_a_single_step_that_takes_long_is_told_too(tmp_path, monkeypatch):
    monkeypatch.setattr("blockvis.runs.progress.BEAT", 0.01)
    monkeypatch.setattr("blockvis.runs.progress.LINES", 0.0)
    told = threading.Event()

    class Stream(io.StringIO):
        def write(self, words):
            if "blockvis: increment 4 for 0 s" in words:
                told.set()
            return super().write(words)

    monkeypatch.setattr("sys.stderr", Stream())
    bar = Progress(KINDS["settlement"].course(case_from(SETTLING, tmp_path)), None, count=3)
    bar.watch()
    assert told.wait(timeout=60)
    bar.done()


def sinking(assembly, on_step):
    """The increments of a support that sinks by 0.1 m, with who hears each step."""
    return mechanics.settlement_increments(
        assembly,
        [solver.Settlement(direction=(0, -1), increment=0.1, limit=0.1)],
        interfaces=solver.Interfaces(solver.InterfaceLaw(0.6)),
        loads=solver.self_weight(assembly),
        on_step=on_step,
    )


def test_the_bar_says_what_an_increment_that_takes_long_is_doing(tmp_path, monkeypatch):
    monkeypatch.setattr("blockvis.runs.progress.REDRAW", -1.0)
    stream, seen = Terminal(), []
    outlines = [[[-1, -1], [1, -1], [1, 0], [-1, 0]], [[-0.2, 0], [0.2, 0], [0.2, 1], [-0.2, 1]]]
    assembly = solver.Assembly.from_outlines(outlines, roles=["moving", "free"])
    monkeypatch.setattr("sys.stderr", stream)
    bar = Progress(KINDS["settlement"].course(case_from(SETTLING, tmp_path)), assembly)
    steps = sinking(assembly, lambda state: (seen.append(state.place.s), bar.step(state)))
    assert len(list(steps)) == 2
    assert seen == sorted(seen)
    assert len(seen) > 2
    assert re.search(
        r"settlement 0\.0\d+ of at most 0.4 m, increment 1 in steps of 0\.\d+, 1 block moving, '[\w ]+' moves most",
        stream.getvalue(),
    )


def test_a_listener_hears_each_step_in_which_blocks_come_to_rest(tmp_path, monkeypatch):
    """A stone that is drawn above its support drops on it before the first increment."""
    monkeypatch.setattr("blockvis.runs.progress.REDRAW", -1.0)
    monkeypatch.setattr("sys.stderr", stream := Terminal())
    outlines = [[[-1, -1], [1, -1], [1, 0], [-1, 0]], [[-0.2, 1e-3], [0.2, 1e-3], [0.2, 1], [-0.2, 1]]]
    assembly = solver.Assembly.from_outlines(outlines, roles=["moving", "free"])
    bar, heard = Progress(KINDS["settlement"].course(case_from(SETTLING, tmp_path)), assembly), []
    steps = sinking(assembly, lambda state: (heard.append((state.phase, state.place.s)), bar.step(state)))
    first = next(iter(steps))
    assert first.pose.positions[1, 1] < assembly.centroids[1, 1] - 9e-4
    assert len(heard) > 2
    assert set(heard) == {(0, 0.0)}
    words = f"increment 1, step {len(heard) - 1} in time: blocks fall or come to rest while the supports stand"
    assert f"settlement 0 of at most 0.4 m, {words}" in stream.getvalue()


@pytest.mark.slow
def test_a_stone_that_creeps_keeps_no_increment():
    """It leans from one support to another; looked at for rest wherever the path went back to, it took 80 s."""
    places = [(-3, -0.5, 0, 0), (0.18, -0.5, 3, 0), (-3, 0, -2.5, 1), (2.5, 0, 3, 1), (-3, 1, 3, 1.3)]
    outlines = [rectangle(*place) for place in [*places, (-0.08, 0, 0.26, 0.1)]]
    assembly = solver.Assembly.from_outlines(outlines, roles=["fixed", "moving", *["free"] * 4])
    heard = [0.0]
    steps = mechanics.settlement_increments(
        assembly,
        [solver.Settlement(direction=(0, -1), increment=0.02, limit=0.06)],
        interfaces=solver.Interfaces(solver.InterfaceLaw(0.1)),
        loads=solver.self_weight(assembly),
        on_step=lambda state: heard.append(state.place.s),
    )
    assert [increment.settlement for increment in steps] == pytest.approx([0.0, 0.02, 0.04, 0.06])
    assert np.all(np.diff(heard) >= 0.0)
    assert len(heard) < 250


def test_words_of_phases_in_other_units():
    response = sunk_and_tilted(0.05)
    first, last = (state_text(increment, response) for increment in (response.path[1], response.path[-1]))
    assert first.startswith(("Settlement 50.00 mm", "Settlement 0.0500 m"))
    assert "1.0000 W" in first
    assert re.fullmatch(r"Settlement 0\.1000 rad   ·   Reaction [\d.]+ k?N·m", last)
    lines = KINDS["settlement"].lines(response)
    assert any(re.fullmatch(r"first reaction +9810 N   1\.000000 W", line) for line in lines)
    assert any(re.fullmatch(r"last reaction +[\d.]+ N·m", line) for line in lines)
    # At the height of the block, twice its width, programs leave so much of none.
    *others, last = response.increments
    tiny = 0.9e-6 * response.total_weight
    ended = replace(response, increments=(*others, replace(last, reaction=tiny, measured=tiny)))
    assert state_text(ended.path[-1], ended).endswith("Reaction 0 N·m")


@pytest.mark.thorough
def test_lines_rows_and_pictures_round_a_reaction_alike():
    kind, response = KINDS["settlement"], lifted_brick()
    *others, last = response.increments
    tiny = -6e-9 * response.total_weight
    ended = replace(response, increments=(*others, replace(last, reaction=tiny, measured=tiny)))
    assert ended.path[-1].reaction == tiny
    assert any(re.fullmatch(r"last reaction +0 N   0\.000000 W", line) for line in kind.lines(ended))
    assert dict(kind.rows(ended))["last reaction"].startswith("0 N = 0.0000 W")
    assert state_text(ended.path[-1], ended).endswith("0 N = 0.0000 W")


@pytest.mark.thorough
def test_rounding_of_a_reaction_is_none_and_unknown_bounds_make_no_linear_program():
    kind, response = KINDS["settlement"], lifted_brick()
    first, *others = response.increments
    rounded = replace(response, increments=(replace(first, reaction=-3e-3, measured=-3e-3, least=-3e-3), *others))
    lines = kind.lines(rounded)
    assert not any("against the movement" in line for line in lines)
    assert any(re.fullmatch(r"first reaction +0 N   0\.000000 W.*", line) for line in lines)
    unknown = replace(response, increments=(replace(first, least=np.nan, largest=np.nan), *others))
    assert kind.summary(unknown)["increments_by"] == "coulomb"


@pytest.mark.thorough
def test_supports_that_carry_nothing_are_told():
    said = "no free block touches the supports that move: nothing follows them"
    assert said not in KINDS["settlement"].lines(lifted_brick())
    assert said in KINDS["settlement"].lines(lifted_brick(aside=3.0))


def lifted_brick(aside: float = 0.0) -> solver.Response:
    """A brick on a fixed support, and one that moves under it or beside it."""
    assembly = solver.Assembly.from_outlines(
        [[(-2, -1), (0, -1), (0, 0), (-2, 0)], [(aside, -1), (2 + aside, -1), (2 + aside, 0), (aside, 0)],
         [(-1, 0), (1, 0), (1, 1), (-1, 1)]], roles=["fixed", "moving", "free"],
    )  # fmt: skip
    down = solver.Settlement(direction=(0.0, -1.0), increment=0.01, limit=0.02)
    return solver.settle(assembly, down, friction_coefficient=0.8)
