"""Limit loads and pushovers from their case files to their results folders, and back."""

import csv
import json
import re
import tempfile
from dataclasses import replace

import numpy as np
import pytest
from structures import box, case_from, pixels, rectangle, report_of, run_command

import blockvis
import solver
from blockvis import draw_still
from blockvis.cli import _in_words, main

COLUMN = """
[geometry]
layout = "column"
[geometry.parameters]
blocks = 1
width = 0.2
block_height = 1.0
[material]
friction_coefficient = 0.7
"""

SIDEWAYS = """
[[loads]]
kind = "live"
weight_fraction = [1.0, 0.0]
"""

ARCH = """
[geometry]
layout = "arch"
[material]
friction_coefficient = 2.0
[analysis]
kind = "limit load"
[[loads]]
kind = "live"
force = [0.0, -1000.0]
positions = [-0.8, 0.8, 5]
[output]
animation = false
"""


def ran(text, tmp_path, *more, code=0, drawn=False):
    path = tmp_path / "case.toml"
    path.write_text(text, encoding="utf-8")
    assert run_command(path, "-o", tmp_path / "out", *more, drawn=drawn) == code
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    return tmp_path / "out", summary


def solved(text, tmp_path):
    """The response of a case and its summary, nothing drawn."""
    run = blockvis.run_case(case_from(text, tmp_path), tempfile.mkdtemp(dir=tmp_path), outputs=())
    return run.response, run.summary


def table(path):
    return list(csv.DictReader(path.read_text(encoding="utf-8").splitlines()))


@pytest.mark.slow
def test_limit_load_of_a_block_from_its_case_file(tmp_path, capsys):
    text = COLUMN + '[analysis]\nkind = "limit load"\n[output]\nanimation = "swing.gif"\n' + SIDEWAYS
    folder, summary = ran(text, tmp_path, drawn=True)
    assert summary["status"] == "collapsed"
    assert summary["analysis"] == "limit load"
    assert summary["limit_load_multiplier"] == pytest.approx(0.2, rel=1e-9)
    assert summary["limit_load_bounds"] == pytest.approx([0.2, 0.2], rel=1e-9)
    assert summary["limit_load_flow"] == "associative"
    assert summary["limit_load_status"] == "limit load"
    assert summary["live_load"] == pytest.approx(summary["total_weight"])
    assert "1 macro-block; hinge at" in summary["mechanism"]
    assert summary["effective_mass_share"] == pytest.approx(1.0)
    assert summary["collapse_displacement"] is None
    printed = capsys.readouterr().out
    assert "load multiplier               0.2     associative friction, static and kinematic bounds" in printed
    for name in ("curve.png", "mechanism.png", "report.html", "swing.gif"):
        assert (folder / name).stat().st_size > 500
    assert (folder / "blocks.pvd").read_text(encoding="utf-8").count("<DataSet") == 1, "the limit state, no pseudo-time"
    response = blockvis.open_results(folder)
    assert response.analysis == "limit load"
    assert response.settlements == ()
    assert response.limits[0].multiplier == summary["limit_load_multiplier"]
    assert response.limits[0].gap == pytest.approx(0.0, abs=1e-12)
    # The frames after the limit state swing the mechanism; they are no equilibrium.
    swung = [i for i in response.increments if i.status == solver.Status.FALLING]
    assert len(swung) == summary["n_falling_frames"] > 10
    turns = [i.pose.rotations[0, 0] for i in swung]
    assert all(np.diff(turns) < 0.0)
    assert main(["render", str(folder), "--no-film"]) == 0


@pytest.mark.slow
def test_envelope_after_a_settlement_has_the_mortar_that_is_left(tmp_path):
    """Each position is the limit load with the strength that the settlement has left, and a resumed run the same."""
    settled = '[roles]\n"right springer" = "moving"\n[settlement]\ndirection = [1.0, 0.0]\nincrement = 0.005\n'
    text = ARCH.replace("coefficient = 2.0", "coefficient = 2.0\ncohesion = 2e4\ntensile_strength = 1e4") + settled
    text = text.replace("-0.8, 0.8, 5", "-0.4, 0.4, 2") + "limit = 0.01\n"
    text = text.replace('"limit load"', '"limit load"\ndisplacement = 0.0002')
    response, _ = solved(text, tmp_path)
    path = solver.settle(
        response.assembly,
        solver.Settlement(direction=(1.0, 0.0), increment=0.005, limit=0.01),
        interfaces=response.interfaces,
        loads=solver.self_weight(response.assembly),
    )
    last = path.path[-1]
    assert last.bonds.left.min() == 0.0
    assert last.bonds.left.max() == 1.0
    for limit, x in zip(response.limits, (-0.4, 0.4), strict=True):
        live = solver.force_on_top(response.assembly, x, (0.0, -1000.0))
        whole = solver.Structure(response.assembly, response.interfaces, path.loads).with_live(live)
        expected = whole.limit_load(pose=last.pose, bonds_at=last.bonds, displacement=2e-4)
        assert limit.multiplier == pytest.approx(expected.multiplier, rel=1e-9)
        dry = whole.limit_load(pose=last.pose, bonds_at=replace(last.bonds, left=0.0 * last.bonds.left))
        assert limit.multiplier > 2.0 * dry.multiplier


@pytest.mark.slow
def test_envelope_of_a_load_that_moves_over_an_arch(tmp_path, capsys):
    folder, summary = ran(ARCH, tmp_path)
    rows = table(folder / "envelope.csv")
    assert [float(row["position"]) for row in rows] == pytest.approx([-0.8, -0.4, 0.0, 0.4, 0.8])
    multipliers = [float(row["load_multiplier"]) for row in rows]
    assert multipliers == pytest.approx(multipliers[::-1], rel=1e-6)
    arch = blockvis.open_results(folder).assembly
    loads = solver.Loads(solver.self_weight(arch).dead, solver.load_on_top(arch, -0.4, (0.0, -1000.0)))
    assert multipliers[1] == pytest.approx(solver.limit_load(arch, loads=loads, friction_coefficient=2.0).multiplier)
    for row in rows:
        assert float(row["static"]) == pytest.approx(float(row["kinematic"]), rel=1e-9)
        assert "macro-block" in row["mechanism"]
    assert summary["limit_load_multiplier"] == min(multipliers)
    assert summary["governing_position"] == float(rows[int(np.argmin(multipliers))]["position"])
    path = table(folder / "response.csv")
    assert [float(row["load_position"]) for row in path] == [float(row["position"]) for row in rows]
    assert {row["settlement"] for row in path} == {"0.0"}
    assert f"the lowest of 5 positions: load at x = {summary['governing_position']:g} m" in capsys.readouterr().out
    response = blockvis.open_results(folder)
    assert response.governing.load_multiplier == min(multipliers)
    place = summary["governing_position"]
    assert np.array_equal(response.loads.live, solver.load_on_top(arch, place, (0.0, -1000.0)))
    curve = blockvis.draw_curve(response, tmp_path / "curve.svg").read_text(encoding="utf-8")
    assert "load position x [m]" in curve
    assert "load multiplier α" in curve
    # The page opens on the state that its title tells.
    assert f'"opens":{int(np.argmin(multipliers))},' in report_of(response)


#: An arch over piers that a settlement has opened: its tie is slack but at the last place of the load.
TIED = """
[geometry]
layout = "arch on piers"
[geometry.parameters]
span = 2.0
rise = 0.8
thickness = 0.35
voussoirs = 13
pier_width = 0.8
pier_height = 1.6
pier_blocks = 4
depth = 0.7
[material]
friction_coefficient = 0.7
[analysis]
kind = "limit load"
displacement = 0.0005
[[ties]]
name = "iron"
from = { block = "left pier 4", point = [-1.4, 1.4] }
to = { block = "right pier 4", point = [1.4, 1.4] }
stiffness = 2e6
strength = 2500.0
prestress = 500.0
[[backfill]]
over = "voussoir*"
surface = 3.2
unit_weight = 16000.0
pressure_coefficient = 0.35
[[loads]]
blocks = "left pier 4"
force = [0.0, -2000.0]
point = [-1.6, 1.6]
[[loads]]
kind = "live"
force = [500.0, -1000.0]
positions = [-0.4, 1.6, 6]
[settlement]
direction = [1.0, -0.3]
increment = 0.01
limit = 0.03
"""


@pytest.fixture(scope="module")
def tied(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tied")
    (folder / "case.toml").write_text(TIED, encoding="utf-8")
    return blockvis.run_case(folder / "case.toml", folder / "out", outputs=())


@pytest.mark.slow
def test_a_load_that_moves_is_told_with_joints_that_stay_open(tied):
    rows = table(tied.folder / "envelope.csv")
    case = tied.folder.parent / "apart.toml"
    case.write_text(TIED.replace("displacement = 0.0005", "displacement = 0.0"), encoding="utf-8")
    apart = blockvis.run_case(case, tied.folder.parent / "apart", outputs=())
    without = [limit.multiplier for limit in apart.response.limits]
    assert [float(row["staying_open"]) for row in rows] == pytest.approx(without, rel=1e-6)
    assert [limit["staying_open"] for limit in tied.summary["limit_loads"]] == pytest.approx(without, rel=1e-6)
    (k,) = (k for k, row in enumerate(rows) if float(row["load_multiplier"]) > 1.01 * without[k])
    least, most, x = without[k], float(rows[k]["load_multiplier"]), float(rows[k]["position"])
    note = f"at 1 of 6 positions: {least:.6g} instead of {most:.6g} at x = {x:.6g} m"
    assert f"note: where open joints stay open α is less {note}\n" in _in_words(tied.response, tied.folder)
    again = blockvis.open_results(tied.folder)
    assert [limit.staying_open for limit in again.limits] == [limit.staying_open for limit in tied.response.limits]
    assert "staying_open" not in table(apart.folder / "envelope.csv")[0]


@pytest.mark.slow
def test_a_tie_beside_a_load_that_moves_is_told_at_the_place_that_governs(tied):
    rows, place = table(tied.folder / "ties.csv"), tied.summary["governing_position"]
    assert [row["state"] for row in rows] == ["slack"] * 5 + ["yielding"]
    assert {row["settlement"] for row in rows} == {"0.0"}
    assert [float(row["load_position"]) for row in rows] == [state.parameter for state in tied.response.path]
    (iron,) = tied.summary["ties"]
    assert (iron["last_force"], iron["last_state"], iron["yields_at"]) == (0.0, "slack", None)
    said = f"iron (tie): no force: slack, load at x = {place:.6g} m\n"
    assert said in _in_words(tied.response, tied.folder)


@pytest.mark.slow
def test_live_load_is_drawn_where_it_acts_at_each_position(tmp_path):
    """The arrow stands over the place of the load, whichever position is drawn."""

    folder, _ = ran(ARCH, tmp_path)
    response = blockvis.open_results(folder)
    places = []
    for number in (1, 3):
        path = draw_still(response, number, tmp_path / f"{number}.png", size=(800, 600))
        picture = pixels(path)[:520]
        _, columns = np.nonzero((np.abs(picture - (190, 24, 118)) < 30).all(axis=2))
        places.append(columns.mean())
    assert places[1] - places[0] > 100


@pytest.mark.slow
def test_the_capacity_is_asked_for_in_each_settlement_that_reaches_it(tmp_path, capsys):
    """The ground tilts downhill, sinks by less than is asked for, and tilts back; a block has tan(atan(b/h) - θ)."""
    tilt = "[[settlement]]\nrotation_centre = [0.0, 0.0]\nrotation = {}\nincrement = 0.03\nlimit = {}\n"
    text = (
        COLUMN
        + '[roles]\n"ground" = "moving"\n'
        + tilt.format(-1.0, 0.04)
        + "[[settlement]]\ndirection = [0.0, -1.0]\nincrement = 0.01\nlimit = 0.01\n"
        + tilt.format(1.0, 0.03)
        + '[analysis]\nkind = "limit load"\ncapacity_at = [0.0, 0.02, 0.04]\n[output]\nanimation = false\n'
    )
    rows = table(ran(text + SIDEWAYS, tmp_path)[0] / "capacity.csv")
    asked = {0: [0.0, 0.02, 0.04], 1: [0.0], 2: [0.0, 0.02]}
    stops = [(phase, stop) for phase, found in asked.items() for stop in found]
    assert [(int(row["phase"]), float(row["settlement"])) for row in rows] == stops
    expected = np.tan(np.arctan(0.2) - np.array([0.0, 0.02, 0.04, 0.04, 0.04, 0.02]))
    assert "after a settlement of        0.02 rad in phase 3   before it 0.2\n" in capsys.readouterr().out
    assert [float(row["load_multiplier"]) for row in rows] == pytest.approx(expected, rel=1e-5)
    with pytest.raises(ValueError, match=r"capacity_at: settlement stop 0\.05 is not between 0 and the limit of 0\.04"):
        case_from(text.replace("0.04]", "0.05]") + SIDEWAYS, tmp_path)


@pytest.mark.slow
def test_the_capacity_of_a_wall_is_told_with_and_without_joints_that_close(tmp_path, capsys):
    text = """
[geometry]
layout = "wall"
parameters = { bricks = 3, courses = 3, settling = [0.375, 0.75], brick_length = 0.25 }
[settlement]
direction = [0, -1]
increment = 0.002
limit = 0.004
[analysis]
kind = "limit load"
capacity_at = [0.004]
"""
    summary = ran(text + SIDEWAYS, tmp_path)[1]
    said = capsys.readouterr()
    # Nothing was asked of the wall as drawn.
    assert re.search(r"after a settlement of +0\.004 m\n", said.out)
    (note,) = summary["notes"]
    assert note in said.err
    more, closing, apart = (
        ran(text.replace("[0.004]", f"[0.004]\ndisplacement = {within}") + SIDEWAYS, tmp_path, "--force")[1]
        for within in (0.001, 0.0001, 0.0)
    )
    wider, with_it, without = (f"{one['limit_load_multiplier']:.6g}" for one in (more, closing, apart))
    assert note.startswith(
        f"at a settlement of 0.004 m α = {with_it}, {without} without, {wider} where they close by 10 times as much: "
        "joints that are open may close"
    )
    # Bricks are 0.1 m high.
    assert "by up to 0.0001 m" in note
    assert apart["notes"] == []


@pytest.mark.thorough
def test_capacity_up_to_where_the_settlement_alone_collapses(tmp_path, capsys):
    text = """
[geometry]
layout = "arch"
[material]
friction_coefficient = 2.0
[settlement]
direction = [1.0, 0.0]
increment = 0.04
limit = 0.5
[analysis]
kind = "limit load"
falling_frames = 3
[output]
animation = false
"""
    folder, summary = ran(text + SIDEWAYS, tmp_path)
    assert summary["collapse_displacement"] == pytest.approx(0.14104982, rel=2e-3)
    alpha = [float(row["load_multiplier"]) for row in table(folder / "capacity.csv")]
    assert alpha[0] == pytest.approx(0.157332, abs=1e-6)
    assert 0.0 < alpha[-1] < 1e-3
    assert "the settlement alone brings it down" in capsys.readouterr().out


PUSHED = (
    COLUMN
    + SIDEWAYS
    + """
[analysis]
kind = "pushover"
[control]
block = "block 1"
direction = [1.0, 0.0]
point = [0.1, 1.0]
increment = 0.03
"""
)


@pytest.mark.slow
def test_a_mechanism_that_moves_upright_in_space_swings(tmp_path):
    text = '[geometry]\nlayout = "column"\ndimension = 3\n[analysis]\nkind = "limit load"\n'
    lifted = '[[loads]]\nkind = "live"\nweight_fraction = [0.0, 0.0, 1.0]\n'
    response, summary = solved(text + lifted, tmp_path)
    assert summary["limit_load_multiplier"] == pytest.approx(1.0)
    rising = np.array([i.pose.positions[response.assembly.free, 2].max() for i in response.increments])
    assert len(rising) > 2
    assert (np.diff(rising) > 0.0).all()


@pytest.mark.slow
def test_pushover_of_a_block_follows_the_closed_form(tmp_path, capsys):
    folder, summary = ran(PUSHED + "[output]\nanimation = false\n", tmp_path, drawn=True)
    rows = table(folder / "response.csv")
    d = np.array([float(row["control_displacement"]) for row in rows])
    alpha = np.array([float(row["load_multiplier"]) for row in rows])
    assert alpha == pytest.approx(np.tan(np.arctan(0.2) - np.arcsin(d)), abs=5e-6)
    assert summary["status"] == "collapsed"
    assert summary["limit_load_multiplier"] == pytest.approx(0.2, abs=1e-7)
    assert summary["collapse_displacement"] == pytest.approx(np.sin(np.arctan(0.2)), rel=1e-5)
    assert summary["mechanism"].startswith("1 macro-block; hinge at")
    printed = capsys.readouterr().out
    assert "zero capacity at" in printed
    assert "first multiplier" in printed
    assert re.search(r"largest multiplier .* at 0 m, .*, the largest of the told increments\n", printed)
    response = blockvis.open_results(folder)
    assert response.settlements == ()
    assert response.control == solver.ControlDisplacement(**summary["control"])
    assert response.load_multiplier == pytest.approx(alpha)
    assert (response.analysis, response.collapse.lost) == ("pushover", "capacity")
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "<td>largest of the told increments, last</td>" in page
    assert "Zero capacity at a control displacement of 0.1961" in page
    assert "control displacement [m]" in page


@pytest.mark.slow
def test_the_largest_multiplier_where_joints_give_is_one_that_is_carried(tmp_path, capsys):
    """Springs k A / 2 at the ends of the base: α W h / 2 = (k A b² / 4 - W h / 2) θ until an end lifts at 0.098."""
    text = PUSHED.replace("friction_coefficient = 0.7", "friction_coefficient = 0.7\nnormal_stiffness = 2e6")
    _, summary = ran(text.replace("increment = 0.03", "increment = 0.03\nlimit = 0.15"), tmp_path)
    weight = 0.2 * 2000.0 * 9.81
    at = summary["largest_load_multiplier_at"]
    # Between the increments of 0.09 and 0.12, where the multiplier falls from a peak.
    assert at == pytest.approx(weight / (2e6 * 0.2 * 0.1), rel=0.01)
    by_hand = (2e6 * 0.2 * 0.2**2 / 4.0 / (weight * 0.5) - 1.0) * at
    assert summary["limit_load_multiplier"] == pytest.approx(0.2, abs=1e-6)
    # What the end has lifted by then, and what small angles leave out, is missing.
    assert summary["largest_load_multiplier"] == pytest.approx(by_hand, rel=0.04)
    assert summary["largest_load_multiplier"] > 0.0985
    assert re.search(r"first multiplier .* at 0 m, .*, were joints and ground rigid\n", capsys.readouterr().out)


@pytest.mark.thorough
@pytest.mark.path
def test_pushover_that_snaps_says_at_which_multiplier(tmp_path, capsys):
    text = '[geometry]\nlayout = "arch on piers"\n[material]\nfriction_coefficient = 0.75\n' + SIDEWAYS
    control = '[analysis]\nkind = "pushover"\n[control]\nblock = "voussoir 4"\nincrement = 0.02\nlimit = 0.3\n'
    folder, summary = ran(text + control + "[output]\nanimation = false\n", tmp_path, drawn=True)
    assert summary["status"] == "collapsed"
    assert summary["last_reaction"] > 0.1 * summary["total_weight"]
    words = "equilibrium lost along the control at α = 0.1"
    printed, page = capsys.readouterr().out, (folder / "report.html").read_text(encoding="utf-8")
    assert words in printed
    assert words[1:] in page
    assert "zero capacity" not in (printed + page).lower()
    assert "equilibrium is lost along the control at α = 0.1" in summary["message"]
    assert summary["collapse_lost"] == blockvis.open_results(folder).collapse.lost == "equilibrium"


@pytest.mark.slow
@pytest.mark.parametrize("increment", [0.001, 0.0002])
def test_a_multiplier_that_comes_to_zero_is_the_end_of_the_capacity_by_any_increment(increment, tmp_path):
    """It falls by 0.29 a millimetre, in a straight line; viscosity carries blocks at 1.18 within the last bracket."""
    arch = """
[geometry]
layout = "arch"
parameters = { radius = 2.0, thickness_ratio = 0.2, embrace = 150, voussoirs = 9, depth = 0.7 }
[material]
friction_coefficient = 0.7
[analysis]
kind = "pushover"
falling_frames = 0
[[loads]]
kind = "live"
force = [0.0, -1000.0]
point = [-1.0, 1.9]
blocks = "voussoir 3"
[settlement]
direction = [1.0, 0.0]
increment = 0.1
limit = 0.1
[control]
block = "voussoir 3"
direction = [0.0, -1.0]
limit = 0.4
step_tolerance = 0.001
"""
    _, summary = solved(f"{arch}increment = {increment}\n", tmp_path)
    assert summary["collapse_lost"] == "capacity"
    assert summary["collapse_displacement"] == pytest.approx(0.0038336, rel=1e-3)


@pytest.mark.thorough
def test_pushover_after_a_tilt_starts_at_what_is_left(tmp_path):
    tilt = '[roles]\n"ground" = "moving"\n[settlement]\nrotation_centre = [0.0, 0.0]\nrotation = -1.0\nlimit = 0.1\n'
    response, summary = solved(PUSHED + tilt, tmp_path)
    assert summary["limit_load_multiplier"] == pytest.approx(np.tan(np.arctan(0.2) - 0.1), rel=1e-6)
    # Neither its curve nor its table tells that the capacity is not that of the drawing.
    told = [note for note in response.notes if "settlement" in note]
    assert told == ["the live load comes after a settlement of 0.1 rad"]
    nothing = PUSHED + tilt.replace("limit = 0.1", "limit = 0.5") + "[output]\nanimation = false\n"
    _, summary = ran(nothing, tmp_path, code=5)
    assert summary["status"] == "no initial equilibrium"
    assert "the settlement alone: collapse at 0.197" in summary["message"]
    assert "nothing is left to push over" in summary["message"]


@pytest.mark.path
@pytest.mark.parametrize("block", ["pier", pytest.param("pinnacle", marks=pytest.mark.thorough)])
def test_a_control_beside_what_topples_is_told(block, tmp_path, capsys):
    """The capacity of the pinnacle was lost at a displacement of the pier, which stands, without a word."""
    two = solver.Assembly.from_outlines(
        [rectangle(0.0, 0.0, 0.2, 1.0), rectangle(1.0, 0.0, 2.0, 1.0), rectangle(-1.0, -1.0, 3.0, 0.0)],
        roles=["free", "free", "fixed"],
        names=["pinnacle", "pier", "ground"],
    )
    blockvis.save_layout(two, tmp_path / "two.json")
    text = PUSHED.partition("[geometry.parameters]")[0].replace('layout = "column"', 'file = "two.json"')
    text += "[material]\nfriction_coefficient = 0.7\n" + PUSHED[len(COLUMN) :].partition("direction")[0]
    _, summary = ran(text.replace("block 1", block), tmp_path)
    assert summary["limit_load_multiplier"] == pytest.approx(0.2, abs=1e-6)
    message = "[control] block = 'pier' is not what the live load moves: 'pinnacle' moves"
    assert (message in " ".join(capsys.readouterr().err.split())) == (block == "pier")


@pytest.mark.slow
def test_pressure_on_the_top_and_on_an_edge(tmp_path):
    """Pressure p on the flank of b × h overturns it at p h²/2 = W b/2; pressure on the top holds it."""
    push = '[[loads]]\nkind = "live"\npressure = 1000.0\ndirection = [1.0, 0.0]\n'
    text = COLUMN + '[analysis]\nkind = "limit load"\n'
    response, summary = solved(text + push, tmp_path)
    weight, thickness = response.total_weight, summary["live_load"] / 1000.0
    assert summary["limit_load_multiplier"] == pytest.approx(weight * 0.2 / (1000.0 * thickness), rel=1e-9)
    top = "[[loads]]\npressure = 5000.0\n"
    _, held = solved(text + push + top, tmp_path)
    more = (weight + 5000.0 * 0.2 * thickness) / weight
    assert held["limit_load_multiplier"] == pytest.approx(more * summary["limit_load_multiplier"], rel=1e-9)
    edge = '[[loads]]\nkind = "live"\npressure = 1000.0\nblocks = "block 1"\nedge = 4\n'
    _, flank = solved(text + edge, tmp_path)
    assert flank["limit_load_multiplier"] == pytest.approx(summary["limit_load_multiplier"], rel=1e-9)


def test_a_load_without_limit_is_unbounded(tmp_path, capsys):
    down = '[[loads]]\nkind = "live"\nforce = [0.0, -1.0]\n'
    folder, summary = ran(COLUMN + '[analysis]\nkind = "limit load"\n[output]\nanimation = false\n' + down, tmp_path)
    assert summary["status"] == "limit reached"
    assert summary["limit_load_multiplier"] is None
    assert summary["limit_load_status"] == "unbounded"
    assert "unbounded: no live load of this pattern" in capsys.readouterr().out
    assert summary["initial_reaction"] is summary["reaction_at_rest"] is summary["last_reaction"] is None
    opened = blockvis.open_results(folder)
    assert opened.limits[0].multiplier == opened.path[0].reaction == np.inf
    assert "<td>status</td><td>unbounded</td>" in blockvis.write_report(opened, folder / "page.html").read_text("utf-8")
    assert next(csv.DictReader((folder / "response.csv").open()))["reaction"] == "inf"


def test_live_loads_in_a_settlement_are_left_out_with_a_note(tmp_path, capsys):
    text = COLUMN + '[roles]\n"ground" = "moving"\n[settlement]\ndirection = [0.0, -1.0]\nlimit = 0.02\n'
    ran(text + "[output]\nanimation = false\n" + SIDEWAYS, tmp_path)
    assert 'a settlement analysis leaves the live loads out; give loads that act during it kind = "dead"' in (
        capsys.readouterr().err
    )


LIMIT = COLUMN + '[analysis]\nkind = "limit load"\n'
MOVING = '[[loads]]\nkind = "live"\nforce = [0.0, -1.0]\npositions = {}\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (LIMIT, ['kind is "limit load", but no load is live', 'kind = "live"']),
        (LIMIT + MOVING.format("[-1.0, 5.0, 4]"), ["[loads 1] positions: ", "reaches from"]),
        (LIMIT + MOVING.format("[0.0, 1.0]"), ["give [first x, last x, number of places]"]),
        (LIMIT + MOVING.format("[0.05, 0.15, 2]") + 'blocks = "x"\n', ["blocks does not go with positions"]),
        (
            LIMIT + MOVING.format("[0.05, 0.15, 2]") + MOVING.format("[0.05, 0.15, 3]"),
            ["[loads 2] positions: loads that move do so together", "the first of them has 2, this one 3"],
        ),
        (LIMIT + SIDEWAYS + '[control]\nblock = "block 1"\n', ['[control] belongs to [analysis] kind = "pushover"']),
        (LIMIT + "capacity_at = [0.1]\n" + SIDEWAYS, ["capacity_at asks for limit loads", "along a [settlement]"]),
        (LIMIT + "displacement = 0.1\n" + SIDEWAYS, ["displacement is that of a limit load after a settlement"]),
        (LIMIT + 'increments = "linear program"\n' + SIDEWAYS, ['"linear program" is of settlements', "leave it out"]),
        (LIMIT + 'flow = "asociative"\n' + SIDEWAYS, ["did you mean 'associative'"]),
        (LIMIT + '[[loads]]\nkind = "live"\n', ["[loads] force is missing or zero"]),
        (LIMIT + '[[loads]]\nkind = "live"\npressure = 1.0\nedge = 9\n', ["edge is 9", "has edges 1 to 4"]),
        (LIMIT + '[[loads]]\nkind = "live"\nforce = [1.0, 0.0]\nedge = 2\n', ["edge is that of a pressure"]),
        (PUSHED.replace('"block 1"', '"blok 1"'), ["[control] block 'blok 1' is no block", "did you mean 'block 1'"]),
        (PUSHED.replace('"block 1"', '"ground"'), ["[control] block 'ground' is a support", "block 1"]),
        (PUSHED.replace("[1.0, 0.0]\npoint", "[-1.0, 0.0]\npoint"), ["the mechanism does not move block 'block 1'"]),
        (PUSHED[: PUSHED.index("[control]")], ["[control] is missing", "in space [1, 0, 0]"]),
        (LIMIT + '[output]\nanimation = "none"\n' + SIDEWAYS, ["animation is 'none'", "false for none"]),
        (PUSHED + MOVING.format("[0.05, 0.15, 2]"), ["[loads 2] positions belong to"]),
    ],
)
def test_what_cannot_be_analysed_is_refused_before_anything_is_written(tmp_path, capsys, text, words):
    path = tmp_path / "case.toml"
    path.write_text(text, encoding="utf-8")
    assert run_command(path, "-o", tmp_path / "out") == 2
    message = capsys.readouterr().err
    for word in words:
        assert word in message, message
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
@pytest.mark.parametrize("courses", [1, 4])
def test_effective_mass_of_a_portal_however_many_courses_its_columns_have(courses, tmp_path):
    """Columns turn, their centroids moving half as far as the lintel: e* = (Wc + Wl)² / ((2 Wc + Wl) (Wc / 2 + Wl))."""
    height = 1.0 / courses
    shapes = [rectangle(x, k * height, x + 0.2, (k + 1) * height) for x in (0.0, 1.2) for k in range(courses)]
    shapes += [rectangle(-0.1, 1.0, 1.5, 1.3), rectangle(-1.0, -0.2, 2.0, 0.0)]
    assembly = solver.Assembly.from_outlines(shapes, roles=["free"] * (2 * courses + 1) + ["fixed"])
    blockvis.save_layout(assembly, tmp_path / "portal.json")
    _, summary = solved('[geometry]\nfile = "portal.json"\n[analysis]\nkind = "limit load"\n' + SIDEWAYS, tmp_path)
    column, lintel = 0.2, 1.6 * 0.3
    expected = (column + lintel) ** 2 / ((2.0 * column + lintel) * (0.5 * column + lintel))
    assert summary["effective_mass_share"] == pytest.approx(expected, rel=1e-6)
    assert "effective_mass_note" not in summary
    assert summary["limit_load_multiplier"] == pytest.approx(0.2, rel=1e-6)
    assert summary["spectral_acceleration"] == pytest.approx(0.2 / expected, rel=1e-6)
    half = SIDEWAYS.replace("1.0", "0.5")
    text = '[geometry]\nfile = "portal.json"\n[analysis]\nkind = "limit load"\n' + half
    _, summary = solved(text, tmp_path)
    assert summary["limit_load_multiplier"] == pytest.approx(0.4, rel=1e-6)
    assert summary["spectral_acceleration"] == pytest.approx(0.2 / expected, rel=1e-6)
    assert "effective_mass_share" not in solved(text + SIDEWAYS.replace("weight_fraction", "force"), tmp_path)[1]


@pytest.mark.slow
@pytest.mark.parametrize("flow", ["associative", "non-associative"])
def test_effective_mass_of_drums_that_may_slide_anywhere_is_on_the_safe_side(flow, tmp_path):
    """All of them on their base at least: e* = 1, whatever mechanism is found."""
    drums = [(0.0, 0.5 * k, 0.8, 0.5 * k + 0.5) for k in range(5)] + [(-1.0, -0.3, 2.0, 0.0)]
    roles = ["free"] * 5 + ["fixed"]
    solids = [box((x0, 0.0, z0), (x1, 0.8, z1)) for x0, z0, x1, z1 in drums]
    assembly = solver.Assembly.from_solids(solids, roles=roles)
    blockvis.save_layout(assembly, tmp_path / "drums.json")
    case = '[geometry]\nfile = "drums.json"\n[material]\nfriction_coefficient = {}\n[analysis]\nkind = "limit load"\n'
    case += f'flow = "{flow}"\n' + SIDEWAYS.replace("0.0]", "0.0, 0.0]")
    response, summary = solved(case.format(0.1), tmp_path)
    assert summary["limit_load_multiplier"] == pytest.approx(0.1)
    assert summary["limit_load_flow"] == flow
    assert ("values, no bounds, differ by" in _in_words(response, tmp_path)) == (flow == "non-associative")
    assert summary["effective_mass_share"] == 1.0
    assert summary["spectral_acceleration"] == pytest.approx(0.1)
    assert "several mechanisms have this multiplier" in summary["effective_mass_note"]
    if flow == "associative":
        _, summary = solved(case.format(0.1).replace("flow", 'torsion = "uniform"\nflow'), tmp_path)
        assert summary["effective_mass_share"] == 1.0
        assert "not known where torsion is uniform" in summary["effective_mass_note"]
    # They rock as one in one way only.
    _, summary = solved(case.format(0.9), tmp_path)
    assert summary["effective_mass_share"] == pytest.approx(1.0)
    assert "effective_mass_note" not in summary


MORTAR = "[material]\ncohesion = 1e4\ntensile_strength = 5e3\n"
CRUSHING = "[material]\ncompressive_strength = 1e6\n"
BESIDE = '[[ties]]\nname = "t"\nfrom = [-0.05, 1.1]\nto = { fixed = [-0.8, 1.1] }\nstiffness = 1e6\n'
PROP = BESIDE + 'kind = "prop"\n'
YIELDS = BESIDE + "strength = 1.0\n"


@pytest.mark.slow
@pytest.mark.parametrize("flow", ["associative", "non-associative"])
@pytest.mark.parametrize("portals", [1, 2])
@pytest.mark.parametrize("more", ["", MORTAR, CRUSHING, MORTAR + PROP])
def test_effective_mass_of_two_portals_alike_is_that_of_neither(portals, flow, more, tmp_path):
    """Joints with strength and props that hang slack let either go as dry ones do."""
    _, summary = pushed_portals(portals, f'flow = "{flow}"\n' + more, tmp_path)
    assert ("effective_mass_note" in summary) == (portals == 2)
    assert summary["effective_mass_share"] == pytest.approx((0.905956, 1.0)[portals - 1], rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(("tie", "several"), [(PROP, True), (BESIDE, False), (YIELDS, False)])
def test_a_tie_that_holds_one_of_two_portals_leaves_the_other_as_the_only_one_to_go(tie, several, tmp_path):
    _, summary = pushed_portals(2, tie, tmp_path)
    assert ("effective_mass_note" in summary) == several
    assert summary["effective_mass_share"] == pytest.approx(1.0 if several else 0.905956, rel=1e-5)


def pushed_portals(portals, more, tmp_path):
    """So many portals beside each other under a horizontal acceleration."""
    shapes = []
    for x in (0.0, 3.0)[:portals]:
        shapes += [rectangle(x, 0, x + 0.2, 1), rectangle(x + 1.2, 0, x + 1.4, 1), rectangle(x - 0.1, 1, x + 1.5, 1.3)]
    roles = ["free"] * len(shapes) + ["fixed"]
    blockvis.save_layout(
        solver.Assembly.from_outlines([*shapes, rectangle(-1, -0.2, 6, 0)], roles=roles), tmp_path / "portals.json"
    )
    case = f'[geometry]\nfile = "portals.json"\n[analysis]\nkind = "limit load"\n{more}' + SIDEWAYS
    return solved(case, tmp_path)
