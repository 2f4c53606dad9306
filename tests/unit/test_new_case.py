"""blockvis new writes a case that runs, whatever the drawing says of its supports."""

import json
import os
import re
import shutil
import tomllib
from itertools import pairwise
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from structures import assembly_of, case_from, hull_of, run_command

import solver
from blockvis import generators, read, read_case, save_layout
from blockvis.cli import main

ROOT = Path(__file__).parents[2]


def _written(drawing, *options):
    case = drawing.with_name("new.toml")
    assert main(["new", str(drawing), "-o", str(case), *options], outputs=()) == 0
    return case, tomllib.loads(case.read_text(encoding="utf-8"))


def _ran(case, capsys):
    capsys.readouterr()
    out = case.parent / "out"
    assert run_command(case, "-o", out) == 0, capsys.readouterr().err
    return json.loads((out / "summary.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize(("page", "stones"), [("black", True), ("grey", False)])
def test_white_stones_on_a_black_page_are_stones_and_no_openings_of_a_wall(tmp_path, page, stones):
    drawn = "".join(f'<path fill="#fff" d="M{x} 300h60v120h-60z"/>' for x in (100, 220, 340))
    path = tmp_path / "icon.svg"
    path.write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 512 512"><path fill="{page}" d="M0 0h512v512H0z"/>'
        f"{drawn}</svg>",
        encoding="utf-8",
    )
    _, values = _written(path, "--unit", "mm")
    assert ("bond" not in values) == stones


@pytest.mark.parametrize("ground", ["HATCH", pytest.param("stones", marks=pytest.mark.thorough), ""])
def test_ground_that_is_drawn_as_one_stone_below_all_is_told(tmp_path, capsys, ground):
    """A façade on it did not notice that half of it settled."""
    drawing = ezdxf.new("R2010")
    drawing.header["$INSUNITS"] = 4
    boxes = [(300 * k, 200 * course, 300, 200) for course in range(3) for k in range(10)]
    layers = [*["stones"] * len(boxes), *[ground] * bool(ground)]
    boxes += [(-200, -150, 3400, 150)] * bool(ground)
    for (x, y, width, height), layer in zip(boxes, layers, strict=True):
        corners = [(x, y), (x + width, y), (x + width, y + height), (x, y + height)]
        drawn = drawing.modelspace().add_lwpolyline(corners, close=True, dxfattribs={"layer": layer})
    drawing.saveas(tmp_path / "wall.dxf")
    name = f"block {drawn.dxf.handle}"
    _written(tmp_path / "wall.dxf")
    (told,) = [line for line in capsys.readouterr().err.splitlines() if "one stone" in line] or [""]
    pattern = {"HATCH": "HATCH", "stones": f"'{name}'"}.get(ground)
    says = f"'{name}' is one stone, 3.4 m long, over both halves of the ground, and bridges what settles below"
    assert told == (
        f"blockvis: note: {says}: if it is ground, leave it out, --ignore {pattern}; else draw its stones"
        if ground
        else ""
    )
    if ground:
        _written(tmp_path / "wall.dxf", "--force", "--ignore", pattern.strip("'"))
        assert "one stone" not in capsys.readouterr().err


@pytest.mark.slow
def test_a_dxf_with_mortar_and_no_supports_gets_a_ground_of_two_halves(tmp_path, capsys):
    """Three courses of running bond in mm with joints of 10 mm."""
    drawing = ezdxf.new("R2010")
    drawing.header["$INSUNITS"] = 4
    for course in range(3):
        edges = [0, 250, 500] if course % 2 else [0, 125, 375, 500]
        for left, right in pairwise(edges):
            low, high = course * 100 + 5, course * 100 + 95
            corners = [(left + 5, low), (right - 5, low), (right - 5, high), (left + 5, high)]
            drawing.modelspace().add_lwpolyline(corners, close=True, dxfattribs={"layer": "stones"})
    path = tmp_path / "wall.dxf"
    drawing.saveas(path)
    case, values = _written(path)
    assert values["geometry"] == {"file": "wall.dxf", "unit": "mm", "joint_thickness": "auto"}
    left, right = values["supports"]
    assert (left["role"], right["role"]) == ("fixed", "moving")
    # The ground begins below the lowest course, and is split in its middle.
    assert left["outline"][2] == pytest.approx([0.25, 0.005])
    assert right["outline"][3] == pytest.approx([0.25, 0.005])
    # Blocks of 240 mm by 90 mm are 0.256 m across.
    assert values["settlement"] == {"direction": [0.0, -1.0], "increment": 0.01, "limit": 0.2}
    summary = _ran(case, capsys)
    assert summary["status"] in ("collapsed", "limit reached")
    assert summary["n_blocks"] == 10


@pytest.mark.thorough
def test_an_svg_with_layers_of_roles(tmp_path, capsys):
    path = tmp_path / "portal.svg"
    rectangle = '<rect x="{}" y="{}" width="{}" height="{}"/>'
    path.write_text(
        '<svg xmlns="http://www.w3.org/2000/svg" width="3000mm" height="3000mm" viewBox="0 0 3 3">'
        + f'<g id="fixed">{rectangle.format(0, 2.5, 0.6, 0.4)}</g>'
        + f'<g id="moving">{rectangle.format(2, 2.5, 0.6, 0.4)}</g>'
        + rectangle.format(0.1, 0.7, 0.4, 1.8)
        + rectangle.format(2.1, 0.7, 0.4, 1.8)
        + rectangle.format(0.1, 0.3, 2.4, 0.4)
        + "</svg>",
        encoding="utf-8",
    )
    case, values = _written(path)
    assert "supports" not in values
    assert not values["roles"], "what the drawing says is not said again"
    assert '# "' in case.read_text(encoding="utf-8")
    assert _ran(case, capsys)["initial_reaction"] > 0


@pytest.mark.thorough
def test_a_msh_file_whose_groups_are_springers(tmp_path, capsys):
    shutil.copy(ROOT / "assets" / "semicircular_arch.msh", tmp_path / "arch.msh")
    case, values = _written(tmp_path / "arch.msh")
    assert values["roles"] == {"left springer": "fixed", "right springer": "moving"}
    assert _ran(case, capsys)["status"] in ("collapsed", "limit reached")


def test_supports_that_stand_leave_the_rightmost_to_move(tmp_path):
    save_layout(generators.portal(), tmp_path / "portal.json")
    text = (tmp_path / "portal.json").read_text(encoding="utf-8").replace('"moving"', '"fixed"')
    (tmp_path / "portal.json").write_text(text, encoding="utf-8")
    _, values = _written(tmp_path / "portal.json")
    assert list(values["roles"].values()) == ["moving"]
    assembly = read(tmp_path / "portal.json", roles=values["roles"])
    xs = [assembly.outline(i)[:, 0].mean() for i in range(assembly.n_blocks) if not assembly.free[i]]
    (moving,) = (i for i in range(assembly.n_blocks) if assembly.moving[i])
    assert assembly.outline(moving)[:, 0].mean() == max(xs)
    assert "density" not in values["material"], "the file has its own"


@pytest.mark.slow
def test_a_drawing_of_which_nothing_can_move_is_asked_for_its_horizontal_capacity(tmp_path, capsys):
    path = tmp_path / "block.json"
    blocks = [
        {"name": "ground", "role": "fixed", "outline": [[-1, -1], [2, -1], [2, 0], [-1, 0]]},
        {"name": "stone", "outline": [[0, 0], [0.5, 0], [0.5, 1], [0, 1]]},
    ]
    save_layout(generators.column(blocks=1), path)
    values = json.loads(path.read_text(encoding="utf-8"))
    example = values["blocks"][0]
    values["blocks"] = [example | block for block in blocks]
    values["blocks"][1]["role"] = "free"
    path.write_text(json.dumps(values), encoding="utf-8")
    case, values = _written(path)
    assert values["analysis"] == {"kind": "limit load"}
    # It overturns about its toe: half its width over half its height.
    assert _ran(case, capsys)["limit_load_multiplier"] == pytest.approx(0.5, rel=1e-6)


def test_an_existing_case_is_kept_without_force(tmp_path, capsys):
    path = tmp_path / "portal.svg"
    save_layout(generators.portal(), path)
    case, _ = _written(path)
    case.write_text("mine", encoding="utf-8")
    assert main(["new", str(path), "-o", str(case)]) == 2
    assert "is there already; choose another name or add --force" in capsys.readouterr().err
    assert case.read_text(encoding="utf-8") == "mine"
    _written(path, "--force")
    assert read_case(case).file == case.parent / "portal.svg"


@pytest.mark.thorough
def test_the_name_comes_from_the_drawing_and_the_path_leads_back(tmp_path, monkeypatch, capsys):
    (tmp_path / "drawings").mkdir()
    (tmp_path / "cases").mkdir()
    save_layout(generators.portal(), tmp_path / "drawings" / 'façade "west".svg')
    monkeypatch.chdir(tmp_path / "cases")
    assert main(["new", '../drawings/façade "west".svg']) == 0
    case = read_case('façade "west".toml')
    assert case.file.read_bytes()
    assert tomllib.loads(case.text)["geometry"]["file"] == '../drawings/façade "west".svg', "with slashes everywhere"
    assert os.fspath(case.file.as_posix()).endswith('../drawings/façade "west".svg')


def test_what_is_chosen_of_a_drawing_is_written(tmp_path):
    path = tmp_path / "portal.svg"
    save_layout(generators.portal(), path)
    _, values = _written(path, "--unit", "cm", "--ignore", "nothing*", "--view", "xy")
    assert values["geometry"]["unit"] == "cm"
    assert values["geometry"]["ignore"] == ["nothing*"]
    assert values["geometry"]["view"] == "xy"


def test_a_drawing_that_is_missing_is_refused(tmp_path, capsys):
    assert main(["new", str(tmp_path / "no.dxf"), "-o", str(tmp_path / "case.toml")]) == 2
    assert "no.dxf" in capsys.readouterr().err
    assert not (tmp_path / "case.toml").exists()


def test_hostile_names_stay_in_their_quotes_and_comments(tmp_path):
    names = ['q"\\', "new\nline = 1", "bell\x07", "[[loads]]", "support \x7f é", "support 2 \u2028"]
    blocks = [
        {"name": name, "role": "free", "outline": [[k, 0], [k + 0.9, 0], [k + 0.9, 1], [k, 1]]}
        for k, name in enumerate(names)
    ]
    path = tmp_path / "hostile.json"
    path.write_text(json.dumps({"format": "blockvis layout", "unit": "m", "blocks": blocks}), encoding="utf-8")
    _, values = _written(path)
    assert values["roles"] == {names[4]: "fixed", names[5]: "moving"}
    assert set(values) == {"geometry", "roles", "material", "settlement", "output"}


@pytest.mark.parametrize(
    "name",
    ["portal", *(pytest.param(one, marks=pytest.mark.slow) for one in ("column", "arch on piers", "barrel vault"))],
)
def test_supports_by_their_place_are_blocks_of_the_lowest_course(tmp_path, name):
    """Also of corners that scatter, of which none lies in a plane with others."""
    built, random = generators.build(name), np.random.default_rng(1)
    owner, free = built.block_of_vertex, np.flatnonzero(built.free)
    scattered = built.vertices + 1e-4 * random.uniform(-1.0, 1.0, built.vertices.shape)
    shapes = [scattered[owner == k] for k in free]
    names = [str(k) for k in free]
    if built.dimension == 2:
        drawn = solver.Assembly.from_outlines(shapes, names=names)
    else:
        drawn = solver.Assembly.from_solids([hull_of(shape) for shape in shapes], names=names)
    save_layout(drawn, tmp_path / "drawing.json")
    assert main(["new", str(tmp_path / "drawing.json"), "-o", str(tmp_path / "drawing.toml")]) == 0
    text = (tmp_path / "drawing.toml").read_text(encoding="utf-8")
    text = re.sub(r"^# (below = )", r"\1", text, flags=re.MULTILINE)
    assert "\nbelow = " in text
    assembly = assembly_of(case_from(text, tmp_path))
    low = np.array([assembly.vertices[assembly.block_of_vertex == k].min(axis=0)[-1] for k in range(assembly.n_blocks)])
    drawn_blocks = np.array([not one.startswith("ground") for one in assembly.names])
    course = low < low[drawn_blocks].min() + 0.01
    assert not (assembly.free & course).any()
    assert (assembly.free | course | ~drawn_blocks).all()
    several = (course & drawn_blocks).sum() > 1
    assert (assembly.moving & drawn_blocks).any() == several
    assert (~assembly.free & ~assembly.moving & drawn_blocks).any()


def test_every_commented_key_may_be_uncommented(tmp_path):
    """The values in the comments are of the right kind: the case stays a case with any one of them."""
    path = tmp_path / "portal.svg"
    save_layout(generators.portal(), path)
    case, _ = _written(path)
    lines = case.read_text(encoding="utf-8").splitlines()
    keys = [n for n, line in enumerate(lines) if line.startswith("# ") and " = " in line and line[2] != '"']
    assert len(keys) > 10
    for number in keys:
        text = "\n".join([*lines[:number], lines[number][2:], *lines[number + 1 :]])
        case.write_text(text, encoding="utf-8")
        read_case(case)
