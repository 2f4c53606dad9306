"""Ties, props and bars of a case: what it may say of them, and what is told of them."""

import csv
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import structures
from PIL import Image

import blockvis
import solver
from blockvis.case_files.read import case_of
from blockvis.cases.build import case_assembly, case_ties
from blockvis.cli import main
from blockvis.generators import arch, panel
from blockvis.pictures import palette
from blockvis.runs.plan import planned

#: Two piers of a block each, 0.5 m wide and 2 m high, 2 m apart, on a ground; the right one stands on what moves.
PIERS = {
    "geometry": {"file": "piers.json"},
    "settlement": [{"direction": [1, 0], "limit": 0.01}],
}
BLOCKS = """{"blocks": [
  {"name": "left", "outline": [[0, 0], [0.5, 0], [0.5, 2], [0, 2]]},
  {"name": "right", "outline": [[2.5, 0], [3, 0], [3, 2], [2.5, 2]]},
  {"name": "ground", "role": "fixed", "outline": [[-1, -0.3], [1, -0.3], [1, 0], [-1, 0]]},
  {"name": "footing", "role": "moving", "outline": [[2, -0.3], [4, -0.3], [4, 0], [2, 0]]}
]}"""
BLOCK_NAMES = [block["name"] for block in json.loads(BLOCKS)["blocks"]]
TIE = {"name": "iron", "from": [0.25, 1.5], "to": [2.75, 1.5], "stiffness": 1e7}


def case_with(folder: Path, *ties, **tables):
    (folder / "piers.json").write_text(BLOCKS, encoding="utf-8")
    return case_of(PIERS | {"ties": list(ties)} | tables, folder / "case.toml")


def ties_of(folder, *ties, **tables):
    case = case_with(folder, *ties, **tables)
    return case_ties(case, case_assembly(case))


def plan(folder, *ties, **tables):
    case = case_with(folder, *ties, **tables)
    return planned(case, case_assembly(case))


def refused(folder, *ties, **tables) -> str:
    with pytest.raises(ValueError) as error:
        plan(folder, *ties, **tables)
    message = str(error.value)
    assert "\n" not in message
    assert str(folder / "case.toml") in message
    return message


def test_ends_are_held_by_the_blocks_at_their_points_by_named_ones_and_by_the_ground(tmp_path):
    ground = {"name": "stay", "from": {"block": "right", "point": [2.75, 2.4]}, "to": {"fixed": [5.0, 0.0]}}
    iron, stay = ties_of(tmp_path, TIE, ground | {"stiffness": 2e6, "kind": "bar", "phase": 1, "prestress": 10.0})
    assert (iron.blocks, iron.points) == ((0, 1), ((0.25, 1.5), (2.75, 1.5)))
    assert (iron.kind, iron.stiffness, iron.strength, iron.phase) == ("tie", 1e7, np.inf, 1)
    assert (stay.blocks, stay.kind, stay.prestress) == ((1, None), "bar", 10.0)


@pytest.mark.parametrize(("to", "taken", "beside"), [([2.75, 1.5], "ground", "left"), ([0.75, -0.2], "left", "ground")])
def test_an_end_on_a_joint_is_held_by_the_block_behind_it_and_a_note_says_which(tmp_path, to, taken, beside):
    says = rf"iron' from \(0.25, 0\) m lies on a joint: '{taken}' is taken, not '{beside}'"
    with pytest.warns(UserWarning, match=says):
        (tie,) = ties_of(tmp_path, TIE | {"from": [0.25, 0.0], "to": to})
    assert BLOCK_NAMES[tie.blocks[0]] == taken


def test_area_and_modulus_give_the_stiffness(tmp_path):
    section = {key: value for key, value in TIE.items() if key != "stiffness"} | {"area": 5e-4, "modulus": 2.1e11}
    assert ties_of(tmp_path, section)[0].stiffness == pytest.approx(2.1e11 * 5e-4 / 2.5)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"to": [1.5, 1.5]}, "to (1.5, 1.5) m lies in no block; the nearest is 'left', 1 m away"),
        ({"to": [2750, 1500]}, "m away (is it in m?); move it there"),
        ({"to": [0.25, 0.5]}, "both ends are in the block 'left'"),
        ({"to": {"block": "rihgt", "point": [0, 0]}}, "no block is called 'rihgt'"),
        ({"from": {"fixed": [0, 1]}, "to": {"fixed": [1, 1]}}, "both ends are in the ground"),
        ({"strength": -5.0}, "[ties 'iron'] strength is -5; give a number above 0"),
        ({"kind": "prop", "to": [0.25, 1.5]}, "a prop has no length: both ends are at (0.25, 1.5)"),
        ({"kind": "chain"}, "choose from tie, prop, bar"),
        ({"area": 1e-4}, "stiffness and area or modulus are both given"),
        ({"stiffness": None, "area": 1e-4}, "modulus is missing; give stiffness [N/m], or area [m²] and modulus [Pa]"),
        ({"stiffness": None}, "stiffness is missing"),
        ({"phase": 2}, "phase is 2, and there is one settlement"),
        ({"prestress": 10.0, "strength": 5.0}, "prestress is 10 N, not below the strength of 5 N"),
        ({"brittle": True}, "brittle is true, and no strength says"),
        ({"to": None}, "[ties 'iron'] to is missing; give a point [x, y]"),
        ({"name": None}, "name is missing"),
        ({"to": {"block": "right"}}, 'give [x, y], { block = "name", point = [x, y] } or { fixed = [x, y] }'),
        ({"to": [2.75, 1.0, 1.5]}, "[ties 'iron'] to has 3 numbers, but the blocks are in the plane"),
        ({"layer": "TIES", "from": None, "to": None}, "layer is 'TIES', which is not in [geometry] ties"),
    ],
)
def test_what_cannot_be_a_tie_is_refused_in_a_line(tmp_path, change, words):
    tie = {key: value for key, value in (TIE | change).items() if value is not None}
    assert words in refused(tmp_path, tie)


def test_an_end_far_outside_its_named_block_is_told(tmp_path):
    far = TIE | {"from": {"block": "left", "point": [-100.0, 1.5]}}
    with pytest.warns(UserWarning, match=r"'iron' from \(-100, 1\.5\) lies 100 m outside block 'left', which holds"):
        ties_of(tmp_path, far)


def test_a_name_used_twice_is_refused(tmp_path):
    assert "[ties 2 'iron'] name is there twice" in refused(tmp_path, TIE, TIE)


def test_increments_by_linear_program_refuse_ties(tmp_path):
    said = refused(tmp_path, TIE, analysis={"increments": "linear program"})
    assert 'increments = "linear program" knows no ties' in said


@pytest.mark.slow
def test_positions_after_a_settlement_have_the_ties_that_it_has_left(tmp_path):
    # The left pier, of weight W, 0.5 m wide and 2 m high, is pushed to the left at its top: W b/2 + S 1.5 m = α 2 m.
    across, push = TIE | {"strength": 100.0}, {"kind": "live", "force": [-1.0, 0.0], "positions": [0.2, 0.3, 2]}
    for brittle, held in ((True, 0.0), (False, 150.0)):
        case = case_with(tmp_path, across | {"brittle": brittle}, analysis={"kind": "limit load"}, loads=[push])
        weight = case_assembly(case).masses[0] * solver.GRAVITY
        found = blockvis.run_case(case, tmp_path / str(brittle), pictures=False, film=False).response.limits
        # What the settlement has leant the pier by is below a micrometre.
        assert [limit.multiplier for limit in found] == pytest.approx([(0.25 * weight + held) / 2.0] * 2, rel=1e-5)


@pytest.mark.slow
def test_a_tie_adds_to_the_acceleration_that_overturns_a_pier_and_to_what_is_left_of_it(tmp_path):
    live = {"kind": "live", "weight_fraction": [1.0, 0.0]}
    stay = TIE | {"to": {"fixed": [-2.0, 1.5]}, "from": [0.25, 1.5], "strength": 500.0}
    # The left pier weighs W: it turns about its right corner, W b/2 + S 1.5 m = α W h/2.
    case = case_with(tmp_path, stay, analysis={"kind": "limit load", "capacity_at": [0.01]}, loads=[live])
    weight = case_assembly(case).masses[0] * solver.GRAVITY
    (limit,) = blockvis.run_case(case, tmp_path / "out", pictures=False, film=False).response.limits
    assert limit.multiplier == pytest.approx(0.25, rel=1e-6), "the right pier is not tied and falls first"
    both = [stay, stay | {"name": "other", "from": [2.75, 1.5], "to": {"fixed": [1.2, 1.5]}}]
    case = case_with(tmp_path, *both, analysis={"kind": "limit load", "capacity_at": [0.0]}, loads=[live])
    (limit,) = blockvis.run_case(case, tmp_path / "other", pictures=False, film=False).response.limits
    assert limit.multiplier == pytest.approx(0.25 + 1.5 * 500.0 / weight, rel=1e-6)
    assert limit.state.ties.forces == pytest.approx([500.0, 500.0], rel=1e-6)


DXF = {"geometry": {"file": "piers.dxf", "ties": ["TIES"]}, "roles": {"GROUND": "fixed", "FOOTING": "moving"}}


def drawing(folder, lines=(((0.25, 1.5), (2.75, 1.5)), ((0.5, 1.0), (2.5, 1.0)))):
    """The piers as a drawing, with lines on the layer TIES, which reach over the outlines."""
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.new(setup=False)
    document.header["$INSUNITS"] = 6
    space = document.modelspace()
    corners = re.findall(r"\[\[.*?\]\]", BLOCKS)
    for outline, layer in zip(corners, ("STONE", "STONE", "GROUND", "FOOTING"), strict=True):
        space.add_lwpolyline([tuple(p) for p in eval(outline)], close=True, dxfattribs={"layer": layer})
    for points in lines:
        if len(points) == 2:
            space.add_line(*points, dxfattribs={"layer": "TIES"})
        else:
            space.add_lwpolyline(points, dxfattribs={"layer": "TIES"})
    document.saveas(folder / "piers.dxf")


OF_LAYER = {"layer": "TIES", "stiffness": 1e7, "strength": 1e4}


def test_lines_on_a_layer_of_a_drawing_are_ties_and_no_joints(tmp_path):
    drawing(tmp_path)
    case = case_with(tmp_path, OF_LAYER, **DXF)
    assembly = case_assembly(case)
    assert assembly.n_blocks == 4
    ties = case_ties(case, assembly)
    assert [tie.name for tie in ties] == ["TIES 1", "TIES 2"]
    assert [tie.points for tie in ties] == [((0.25, 1.5), (2.75, 1.5)), ((0.5, 1.0), (2.5, 1.0))]
    assert {tie.strength for tie in ties} == {1e4}
    assert any('[geometry] ties = ["TIES"]' in note for note in blockvis.read_layout(tmp_path / "piers.dxf").notes)


def test_lines_of_an_svg_are_ties(tmp_path):
    paths = "".join(
        f'<path d="M {" L ".join(f"{x},{-y}" for x, y in eval(outline))} Z"/>'
        for outline in re.findall(r"\[\[.*?\]\]", BLOCKS)
    )
    (tmp_path / "piers.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" '
        f'viewBox="-1 -3 6 4" data-blockvis-unit="m"><g inkscape:groupmode="layer" inkscape:label="STONE">{paths}</g>'
        '<g inkscape:groupmode="layer" inkscape:label="TIES"><line x1="0.25" y1="-1.5" x2="2.75" y2="-1.5"/></g></svg>',
        encoding="utf-8",
    )
    below = {"below": {"y": 0.0, "role": "moving"}}
    case = case_with(tmp_path, OF_LAYER, geometry={"file": "piers.svg", "ties": "TIES"}, roles=below)
    assembly = case_assembly(case)
    (tie,) = case_ties(case, assembly)
    assert assembly.n_blocks == 4
    np.testing.assert_allclose(tie.points, [[0.25, 1.5], [2.75, 1.5]])


@pytest.mark.parametrize(
    ("lines", "geometry", "ties", "words"),
    [
        ([((0.25, 1.5), (1.5, 1.7), (2.75, 1.5))], {}, [OF_LAYER], "is bent; draw each tie as a straight line"),
        ([((0.25, 1.5), (1.5, 1.5))], {}, [OF_LAYER], "'TIES 1' to (1.5, 1.5) m lies in no block; the nearest is"),
        (
            [((0.25, 1.5), (1.5, 1.5))],
            {},
            [OF_LAYER],
            "leave layer out and write to = { fixed = [1.5, 1.5] } and from;",
        ),
        ([], {}, [OF_LAYER], "no line lies on the layer 'TIES'"),
        ([((0.25, 1.5), (2.75, 1.5))], {}, [TIE], "names the layer 'TIES', and no [[ties]] says what its lines are"),
        ([], {"file": "piers.json"}, [OF_LAYER], "ties are lines of a .dxf or .svg, and 'piers.json' has none"),
    ],
)
def test_lines_that_cannot_be_ties_are_refused_in_a_line(tmp_path, lines, geometry, ties, words):
    drawing(tmp_path, lines)
    assert words in refused(tmp_path, *ties, **DXF | {"geometry": DXF["geometry"] | geometry})


ARCH = """[geometry]
layout = "arch on piers"
[geometry.parameters]
voussoirs = 5
pier_blocks = 1
pier_width = 0.5
[settlement]
direction = [1, 0]
increment = 0.005
limit = 0.02
[output]
animation = false
[[ties]]
name = "iron"
from = [-1.3, 1.95]
to = [1.3, 1.95]
stiffness = 1e7
strength = 3000
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tied")
    (folder / "case.toml").write_text(ARCH, encoding="utf-8")
    return blockvis.run_case(folder / "case.toml", folder / "out", outputs=())


def test_the_table_and_the_summary_say_what_a_tie_does(run):
    with (run.folder / "ties.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["state"] for row in rows][-1] == "yielding"
    assert list(rows[0]) == ["increment", "phase", "settlement", "name", "kind", "force", "elongation", "state"]
    forces = [float(row["force"]) for row in rows]
    np.testing.assert_array_equal(forces, [increment.ties.forces[0] for increment in run.response.path])
    (told,) = run.summary["ties"]
    assert (told["name"], told["kind"]) == ("iron", "tie")
    assert told["largest_force"] == pytest.approx(3000.0)
    first = next(float(row["settlement"]) for row in rows if row["state"] == "yielding")
    assert (told["yields_at"], told["breaks_at"]) == (first, None)


def test_the_loads_on_the_supports_balance_the_weight(run):
    with (run.folder / "supports.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    path, assembly = run.response.path, run.response.assembly
    weight = solver.self_weight(assembly).dead[assembly.free, 1].sum()
    for number, increment in enumerate(path):
        here = [row for row in rows if row["increment"] == str(number)]
        assert [row["support"] for row in here] == [assembly.names[k] for k in np.flatnonzero(~assembly.free)]
        assert sum(float(row["force_y"]) for row in here) == pytest.approx(weight, rel=1e-6)
        (moving,) = (float(row["force_x"]) for row in here if row["role"] == "moving")
        assert moving == pytest.approx(increment.reaction, rel=1e-6)
    assert list(rows[0])[5:] == ["force_x", "force_y", "moment"]


def test_a_folder_with_ties_opens_with_them_and_viewers_get_lines(run):
    again = blockvis.open_results(run.folder)
    for one, other in zip(run.response.path, again.path, strict=True):
        np.testing.assert_array_equal(one.ties.forces, other.ties.forces)
        np.testing.assert_array_equal(one.forces, other.forces)
    pyvista = pytest.importorskip("pyvista")
    assert "ties_00001.vtu" in (run.folder / "ties.pvd").read_text(encoding="utf-8")
    lines = pyvista.read(run.folder / "increments" / "ties_00001.vtu")
    assert lines.n_cells == 1
    assert {"force", "elongation", "state", "name"} <= set(lines.cell_data)
    assert lines.cell_data["force"][0] == again.path[1].ties.forces[0]


@pytest.mark.slow
def test_ties_are_a_dataset_a_block_of_the_series_and_a_rod_of_the_animation(run, tmp_path, capsys):
    assert main(["convert", str(run.folder), str(tmp_path / "blocks.dxf")]) == 0
    assert "; left out: 1 tie\n" in capsys.readouterr().out
    pyvista = pytest.importorskip("pyvista")
    lines = run.response.members(-1)
    assert (lines.n_cells, str(lines["name"][0])) == (1, "iron")
    assert lines["force"][0] == run.response.path[-1].ties.forces[0]
    for suffix in ("vtkhdf", "glb"):
        assert main(["convert", str(run.folder), str(tmp_path / f"tied.{suffix}")]) == 0
    reader = pyvista.HDFReader(tmp_path / "tied.vtkhdf")
    reader.reader.SetStep(len(run.response.path) - 1)
    assert reader.read()["ties"]["force"] == pytest.approx([run.response.path[-1].ties.forces[0]])
    data = (tmp_path / "tied.glb").read_bytes()
    tree = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    (rod,) = [k for k, node in enumerate(tree["nodes"]) if node.get("name") == "[ties] iron"]
    assert tree["nodes"][rod]["scale"][2] == pytest.approx(2.6)
    moved = {c["target"]["path"] for c in tree["animations"][0]["channels"] if c["target"]["node"] == rod}
    assert moved == {"translation", "rotation", "scale"}


def test_the_report_has_the_force_of_the_tie_over_the_settlement(run, tmp_path):
    page = blockvis.write_report(run.response, tmp_path / "report.html").read_text(encoding="utf-8")
    model = json.loads(re.search(r'<script id="model" type="application/json">(.*?)</script>', page, re.DOTALL)[1])
    (line,) = model["tie_curves"]["lines"]
    np.testing.assert_allclose(line["force"], [i.ties.forces[0] / 1e3 for i in run.response.path], atol=1e-6)
    assert model["ties"][-1][0]["words"] == "iron 3 kN, yielding"
    low, high = np.array(model["bounds"]).reshape(2, 2)
    ends = np.array(model["ties"][-1][0]["ends"]) - model["origin"]
    assert (ends >= low).all()
    assert (ends <= high).all()


@pytest.mark.slow
def test_the_curve_has_a_panel_for_ties(run, tmp_path):
    tied, bare = (
        Image.open(blockvis.draw_curve(response, tmp_path / f"{k}.png")).size
        for k, response in enumerate((run.response, structures.arch_response()))
    )
    assert tied[1] == 1.5 * bare[1]


def test_a_broken_tie_has_carried_its_strength_and_a_slack_one_carries_nothing(tmp_path):
    wire = TIE | {"strength": 100.0, "brittle": True}
    slack = TIE | {"name": "slack", "kind": "prop"}
    run = blockvis.run_case(case_with(tmp_path, wire, slack), tmp_path / "out", pictures=False, film=False)
    broken, idle = run.summary["ties"]
    assert (broken["largest_force"], broken["last_force"], broken["last_state"]) == (100.0, 0.0, "broken")
    assert broken["breaks_at"] == broken["largest_force_at"] > 0.0
    # The prop is touched as the piers come to rest.
    assert (idle["last_force"], idle["last_state"]) == (0.0, "slack")
    assert abs(idle["largest_force"]) < 0.1


@pytest.mark.parametrize(("prestress", "phase"), [(1e4, 1), (1e4, 2), (1e3, 1)])
@pytest.mark.slow
def test_a_prestress_that_tips_what_it_holds_is_told_with_what_is_left_of_it(tmp_path, capsys, prestress, phase):
    """Of a stay to the ground at 1.5 m there is W b/2 where the pier of 0.5 m leans; with less it stands."""
    (tmp_path / "piers.json").write_text(BLOCKS, encoding="utf-8")
    (tmp_path / "case.toml").write_text(
        '[geometry]\nfile = "piers.json"\n[material]\nfriction_coefficient = 2.0\n[[ties]]\nname = "stay"\n'
        "from = [0.25, 1.5]\nto = { fixed = [-1.0, 1.5] }\nstiffness = 1e6\n"
        f"prestress = {prestress}\nphase = {phase}\n"
        + phase
        * "[[settlement]]\ndirection = [1, 0]\nlimit = 1e-3\nincrement = 1e-3\n",
        encoding="utf-8",
    )
    arguments = ["run", str(tmp_path / "case.toml"), "-o", str(tmp_path / "out"), "--no-pictures", "--no-check-steps"]
    assert main(arguments) == 0
    told = capsys.readouterr()
    (stay,) = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["ties"]
    held = 2000.0 * solver.GRAVITY * 0.25 / 1.5
    assert stay["first_force"] == pytest.approx(min(prestress, held), rel=0.03)
    left = re.search(r": the blocks leave 3\.\d+ kN of its prestress of 10 kN, elastic", told.out)
    assert (left is not None) == (prestress > held)
    # From the second settlement on it is not as drawn.
    moved = re.findall(r"as drawn the blocks do not stand; look (.*) or a missing", told.err)
    from_drawing = ["at the prestress ('stay' 10000 N), for gaps between them (joint_thickness)"]
    assert moved == (from_drawing if prestress > held and phase == 1 else [])


@pytest.mark.slow
def test_a_tie_of_a_settlement_that_is_not_reached_is_told_so(tmp_path, capsys):
    (tmp_path / "case.toml").write_text(
        '[geometry]\nlayout = "arch"\n[[ties]]\nname = "late"\nfrom = [-0.95, 0.1]\nto = [0.95, 0.1]\n'
        "stiffness = 1e7\nprestress = 1000.0\nphase = 2\n"
        + 2
        * "[[settlement]]\ndirection = [1, 0]\nincrement = 0.05\nlimit = 0.5\n",
        encoding="utf-8",
    )
    arguments = ["run", str(tmp_path / "case.toml"), "-o", str(tmp_path / "out"), "--no-pictures", "--no-check-steps"]
    assert main(arguments) == 0
    assert "late (tie): never installed\n" in capsys.readouterr().out
    (late,) = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["ties"]
    assert (late["first_force"], late["last_state"]) == (None, "absent")


def test_a_picture_draws_the_tie_in_the_colour_of_its_state(run, tmp_path):
    picture = Image.open(
        blockvis.draw_still(run.response, run.response.path[-1], tmp_path / "last.png", size=(480, 360))
    )
    colours = {colour for _, colour in picture.convert("RGB").getcolors(picture.width * picture.height)}
    assert palette.YIELDING in colours


def test_the_label_of_a_tie_leaves_its_line_free(run, tmp_path):
    still = blockvis.draw_still(run.response, 0, tmp_path / "first.png", size=(960, 720), joints=False, forces="none")
    line = structures.alike(structures.pixels(still), palette.TIE).sum(axis=1).argmax()
    found = np.flatnonzero(structures.alike(structures.pixels(still)[line], palette.TIE))
    assert len(found) > 0.95 * np.ptp(found)


def test_a_folder_that_has_lost_its_ties_neither_opens_nor_goes_on(run, tmp_path, capsys):
    folder = shutil.copytree(run.folder, tmp_path / "lost")
    (folder / "ties.npz").unlink()
    with pytest.raises(ValueError, match=r"ties\.npz' is missing, but increments have 1 tie; .*run the case again"):
        blockvis.open_results(folder)
    (folder / "summary.json").unlink()
    assert main(["run", "--resume", str(folder), "--no-pictures"]) == 2
    assert "ties.npz' is missing" in capsys.readouterr().err


@pytest.mark.slow
def test_a_run_that_was_stopped_goes_on_with_its_ties(run, tmp_path):
    folder = tmp_path / "stopped"
    shutil.copytree(run.folder, folder)
    (folder / "summary.json").unlink()
    assert main(["run", "--resume", str(folder), "--no-pictures"]) == 0
    assert (folder / "ties.csv").read_bytes() == (run.folder / "ties.csv").read_bytes()
    assert json.loads((folder / "summary.json").read_text(encoding="utf-8"))["ties"] == run.summary["ties"]


@pytest.mark.parametrize("blocks", [("block 0", "block 1"), (0,)])
def test_blocks_of_a_tie_are_two_numbers(blocks):
    with pytest.raises(
        TypeError, match=r"tie 'rod' has blocks .*; give two numbers, assembly\.index finds them, or None"
    ):
        solver.Tie("rod", blocks, ((0, 0), (1, 0)), 1e6)


@pytest.mark.slow
def test_a_tie_that_yields_under_a_limit_load_has_not_yielded_before(tmp_path, capsys):
    """The settlement stretches the tie by a hundredth of its strength, the push at the limit by all of it."""
    (tmp_path / "piers.json").write_text(BLOCKS, encoding="utf-8")
    (tmp_path / "case.toml").write_text(
        """geometry = { file = "piers.json" }
        settlement = { direction = [1, 0], increment = 0.005, limit = 0.005 }
        analysis = { kind = "limit load" }
        [[loads]]
        kind = "live"
        blocks = "left"
        force = [-1.0, 0.0]
        [[ties]]
        name = "iron"
        from = [0.25, 1.5]
        to = [2.75, 1.5]
        stiffness = 100.0
        strength = 100.0""",
        encoding="utf-8",
    )
    main(["run", str(tmp_path / "case.toml"), "--output", str(tmp_path / "out"), "--no-pictures"])
    assert ": yields at 0 m under the limit load" in capsys.readouterr().out


def test_what_a_prop_presses_from_the_ground_alone_is_wedged():
    """The ground at the other end has no number of a block: no other one is named."""
    assembly = solver.Assembly.from_outlines(
        [
            structures.rectangle(-2, -1, 5, 0),
            structures.rectangle(-1, 1, 2, 2),
            structures.rectangle(0, 0, 1, 1),
            structures.rectangle(3, 0, 3.5, 1),
        ],
        names=["ground", "ceiling", "propped", "far away"],
        roles=["moving", "fixed", "free", "free"],
    )
    prop = solver.Tie("prop", (2, None), ((0.5, 0.9), (0.5, 2.0)), stiffness=1e9, kind="prop", prestress=1e7)
    rising = solver.Settlement((0.0, 1.0), increment=0.01, limit=0.02)
    response = solver.Structure(assembly, friction_coefficient=0.6, ties=[prop]).settle(rising)
    assert response.stop is solver.Status.LOCKED
    words, at = response.message.removesuffix(" m").rsplit(" at ", 1)
    assert words.endswith("1 block is wedged ('propped')")
    assert 0.0 < float(at) < 1e-3


@pytest.mark.thorough
def test_forces_within_joints_are_shared_alike_beside_a_tie_that_yields():
    """An arch whose springer moves out: both points of a joint that does not slide have about the same shear."""
    tie = solver.Tie("tie", (0, 11), ((-0.6, 0.2), (0.6, 0.2)), stiffness=1e6, strength=2e3)
    structure = solver.Structure(arch(), friction_coefficient=0.7, ties=[tie])
    last = structure.settle(solver.Settlement((1.0, 0.0), increment=0.02, limit=0.06)).path[-1]
    assert last.ties.forces == pytest.approx([2e3])
    pairs, joint = last.contacts.joints()
    of_springer = last.forces[joint == np.flatnonzero((pairs == [0, 12]).all(axis=1))[0]]
    assert len(of_springer) == 2
    assert np.ptp(of_springer[:, 1]) < 1e-3 * of_springer[:, 0].sum()


@pytest.mark.thorough
def test_a_prop_that_carries_nothing_changes_no_force():
    """A member without any force to choose has no place in the programs of the forces in the joints."""
    wall = panel(nb=3, nc=4, block_height=0.4, depth=0.6)
    top = int(np.flatnonzero(wall.free)[-1])
    above = tuple(wall.centroids[top]), (float(wall.centroids[top, 0]), 9.0)
    prop = solver.Tie("prop", (top, None), above, stiffness=1e5, kind="prop")
    sinking = solver.Settlement((0.0, -1.0), increment=0.005, limit=0.01)
    without, beside = (
        solver.Structure(wall, friction_coefficient=0.8, ties=ties).settle(sinking).path for ties in ((), (prop,))
    )
    for increment, other in zip(without, beside, strict=True):
        assert other.ties.forces == pytest.approx([0.0], abs=1.0)
        forces, of_all = increment.forces, other.forces[: len(increment.forces)]
        assert of_all == pytest.approx(forces, abs=1e-5 * np.abs(forces).max())


@pytest.mark.thorough
def test_a_bar_in_tension_acts_as_a_tie_from_the_start():
    """An arch with elastic joints, whose forces at rest decide its path; they were the mean of two limit states."""
    stiff = solver.Interfaces(solver.InterfaceLaw(0.7, normal_stiffness=1e8, shear_stiffness=4e7))
    bar, tie = (
        solver.Tie(kind, (2, 9), ((-0.5, 0.4), (0.5, 0.4)), stiffness=1e6, prestress=50.0, kind=kind)
        for kind in ("bar", "tie")
    )
    spreading = solver.Settlement((1.0, 0.0), increment=0.001, limit=0.001)
    of_bar, of_tie = (solver.Structure(arch(), stiff, ties=[member]).settle(spreading) for member in (bar, tie))
    assert of_bar.path[0].ties.forces[0] > 0.0
    for increment, other in zip(of_tie.path, of_bar.path, strict=True):
        assert other.reaction == pytest.approx(increment.reaction, rel=1e-6)
