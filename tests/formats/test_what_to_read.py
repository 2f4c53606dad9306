"""What of a drawing is read: repaired, left out, and chosen by window, kind and colour."""

import ezdxf
import numpy as np
import pytest

import blockvis
from blockvis.cli import main


def drawn(path, *rings, **attributes):
    """Write a drawing of closed outlines in m."""
    document = ezdxf.new("R2000")
    document.header["$INSUNITS"] = 6
    for ring in rings:
        document.modelspace().add_lwpolyline(ring, close=True, dxfattribs=attributes)
    document.saveas(path)
    return document


def brick(x, y, length=1.0, height=0.5):
    return [(x, y), (x + length, y), (x + length, y + height), (x, y + height)]


def info(capsys, *arguments):
    """What ``blockvis info`` prints, or its refusal."""
    code = main(["info", *map(str, arguments)])
    said = capsys.readouterr()
    return said.out if code == 0 else said.err


def test_an_outline_that_crosses_itself_keeps_its_largest_piece_or_is_left_out(tmp_path, capsys):
    spur = [(1, 0), (2, 0), (2, 0.5), (2, 0.7), (2, 0.5), (1.001, 0.5), (1, 0.5), (1.01, 0.51)]
    bow = [(2, 0), (3, 0.5), (3, 0), (2, 0.5)]
    drawn(tmp_path / "wall.dxf", brick(0, 0), spur, bow, brick(0, 0.5, 3.0))
    said = info(capsys, tmp_path / "wall.dxf")
    assert "outlines        3" in said
    assert "repaired: 1 outline crosses or touches itself, 'block 30' at" in said
    assert "sum 2.49755 m²" in said
    assert "left out: 1 outline that crosses itself on layer '0', 'block 31' at (2.5, 0.25)" in said


@pytest.mark.parametrize("width", [1e-13, -1e-13])
@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_a_spike_of_rounding_is_dropped(tmp_path, capsys, turn, width):
    """As shapes cut from one another leave them; a block above would stand on it, and not on what is below."""
    spur = np.array([(0, 0), (3, 0), (1, width), (1, 0.5), (0, 0.5)])
    spur = spur @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    drawn(tmp_path / "wall.dxf", spur.tolist(), brick(5, 5))
    said = info(capsys, tmp_path / "wall.dxf")
    x, y = 3.0 * np.cos(turn), 3.0 * np.sin(turn)
    assert f"repaired: 1 outline crosses or touches itself, 'block 2F' at ({x:.6g}, {y:.6g})" in said
    assert "corners         8" in said


def test_a_background_alone_is_no_block(tmp_path, capsys):
    stones = "".join(f"M{x} 40h80v60h-80z" for x in (40, 140, 240))
    (tmp_path / "pile.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg"><rect id="sheet" width="512" height="512"/>'
        f'<path id="pile" d="M20 20h400v300h-400z{stones}"/></svg>'
    )
    assert "nothing but a background is left, 'sheet': <path> 'pile' has a hole" in info(capsys, tmp_path / "pile.svg")


@pytest.mark.parametrize(("gap", "says"), [(1.7e-5, "3 gaps of up to 2e-05 m are the rounding"), (0.01, "= 0.01 ")])
def test_only_gaps_that_are_joints_are_proposed_as_such(tmp_path, capsys, gap, says):
    drawn(tmp_path / "wall.dxf", *(brick(k * (1.0 + gap), 0.0) for k in range(4)))
    assert says in info(capsys, tmp_path / "wall.dxf")
    # What is no joint has no mark and no colour bar in the picture.
    assert len(blockvis.inspect(tmp_path / "wall.dxf").joints) == (3 if gap > 1e-3 else 0)


def test_edges_beside_a_corner_of_stones_that_touch_are_no_joint(tmp_path, capsys):
    """A stone under the haunch of an arch, which is not drawn, and the head of the pier below it."""
    haunch = [(3.5, 2.0), (3.56, 2.342), (3.594, 2.4), (3.15, 2.4), (3.15, 2.0)]
    stones = [brick(1.35, 2.0, 0.9, 0.4), brick(2.25, 2.0, 0.9, 0.4), brick(3.6, 1.6, 0.3, 0.4)]
    drawn(tmp_path / "wall.dxf", *stones, haunch)
    assert "mortar joints   none: no gaps between facing edges\n" in info(capsys, tmp_path / "wall.dxf")
    assert len(blockvis.inspect(tmp_path / "wall.dxf").joints) == 0


@pytest.mark.thorough
def test_a_window_reads_what_lies_within_it_and_tells_what_it_cuts(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    drawn("wall.dxf", *(brick(x, y) for x in (0, 1, 2) for y in (0, 0.5)), brick(10, 0), brick(12, 0))
    said = info(capsys, "wall.dxf", "--window", 0, -1, 2.5, 1)
    assert "outlines        4" in said
    assert "window: 2 outlines beyond it were left out" in said
    assert "left out: 2 outlines across the edge of the window" in said
    assert main(["new", "wall.dxf", "--window", "0", "0", "3", "1"]) == 0
    assert "window = [0.0, 0.0, 3.0, 1.0]" in (tmp_path / "wall.toml").read_text(encoding="utf-8")
    assert "written for 6 blocks" in capsys.readouterr().out
    assert main(["convert", "wall.dxf", "cut.svg", "--window", "9", "0", "14", "1"]) == 0
    assert "2 blocks written" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("window", "says"),
    [
        ((5, 5, 6, 6), "no block lies within the window [5, 5, 6, 6] m; the drawing goes from (0, 0) to (1, 0.5) m"),
        ((3, 0, 1, 1), "give [x0, y0, x1, y1] in m, with x0 < x1 and y0 < y1"),
    ],
)
def test_a_window_without_blocks_is_refused(tmp_path, capsys, window, says):
    drawn(tmp_path / "wall.dxf", brick(0, 0))
    assert says in info(capsys, tmp_path / "wall.dxf", "--window", *window)


def test_a_window_beside_a_drawing_whose_unit_is_in_doubt_says_so(tmp_path, capsys):
    document = drawn(tmp_path / "wall.dxf", [(500.0 * x, 500.0 * y) for x, y in brick(0, 0)])
    document.header["$INSUNITS"] = 0
    document.saveas(tmp_path / "wall.dxf")
    said = info(capsys, tmp_path / "wall.dxf", "--window", -1, -1, -0.5, 1)
    assert "to (500, 250) m: unit m in doubt: it makes the median block 354 m across; mm would make it 0.354 m" in said


def test_a_kind_of_entity_or_a_colour_is_left_out_where_no_layer_is_called_so(tmp_path, capsys):
    document = drawn(tmp_path / "wall.dxf", brick(0, 0), brick(1, 0), brick(2, 0))
    space = document.modelspace()
    space.add_circle((0.5, 0.25), 0.1)
    space.add_circle((1.5, 0.25), 0.1, dxfattribs={"color": 1})
    space.add_lwpolyline(brick(4, 0), close=True, dxfattribs={"color": 1, "layer": "1"})
    document.saveas(tmp_path / "wall.dxf")
    file = tmp_path / "wall.dxf"
    assert "drawn as        polyline 4, circle 2" in info(capsys, file)
    assert "colours         #ffffff = 7 4, #ff0000 = 1 2" in info(capsys, file)
    assert "outlines        4" in info(capsys, file, "--ignore", "circle")
    assert "outlines        4" in info(capsys, file, "--ignore", "#F00")
    # A layer of that name is what is meant.
    assert "outlines        5" in info(capsys, file, "--ignore", "1")
    assert "outlines        3" in info(capsys, file, "--only", "polyline", "--ignore", "#ff0000")
    kinds = "its kinds and colours are #ff0000, #ffffff, 1, 7, circle, polyline"
    assert kinds in info(capsys, file, "--ignore", "arcs")


def test_shapes_of_an_svg_are_left_out_by_kind_and_colour(tmp_path, capsys):
    (tmp_path / "wall.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg"><g fill="#fc0"><rect id="a" width="9" height="5"/>'
        '<rect id="b" x="9" width="9" height="5"/><circle id="c" cx="30" cy="3" r="3" style="fill: red"/></g></svg>'
    )
    assert "names           a, b\n" in info(capsys, tmp_path / "wall.svg", "--ignore", "circle")
    assert "names           c\n" in info(capsys, tmp_path / "wall.svg", "--ignore", "#ffcc00")


@pytest.mark.thorough
def test_overlaps_name_the_smallest_set_to_leave_out_having_tried_it(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    bricks = [brick(x, y) for x in range(4) for y in (0, 0.5)]
    document = drawn("layers.dxf", *bricks)
    for x in (0, 2):
        plan = document.modelspace().add_lwpolyline(brick(x, -0.2, 1.5), close=True)
        plan.dxf.layer = "plan"
    document.saveas("layers.dxf")
    remedy = '--ignore "plan" leaves out 2 of 10 blocks, and then none overlap (tried; in a case ignore = ["plan"])'
    assert remedy in info(capsys, "layers.dxf")
    assert main(["new", "layers.dxf"]) == 0
    assert remedy in capsys.readouterr().err
    assert "overlaps        none" in info(capsys, "layers.dxf", "--ignore", "plan")
    document = drawn("discs.dxf", *bricks)
    document.modelspace().add_circle((1.0, 0.5), 0.3)
    document.saveas("discs.dxf")
    assert '--ignore "circle" leaves out 1 of 9 blocks' in info(capsys, "discs.dxf")
    document = drawn("windows.dxf", *bricks)
    for x in (2.0, 4.0):
        # A window, and what lies across it.
        for ring in (brick(x, 2.0), brick(x - 0.1, 2.1, 1.2, 0.3)):
            document.modelspace().add_lwpolyline(ring, close=True).dxf.layer = "windows"
    document.saveas("windows.dxf")
    assert '--ignore "windows" leaves out 4 of 12 blocks' in info(capsys, "windows.dxf")
    drawn("bands.dxf", *bricks, *(brick(0.1, y, 3.7, 0.2) for y in (0.1, 0.4)))
    assert '--ignore "block 37" --ignore "block 38" leaves out 2 of 10 blocks' in info(capsys, "bands.dxf")


def test_an_outline_around_a_hole_and_back_is_one_with_a_hole(tmp_path, capsys):
    ring = [(0, 0), (3, 0), (3, 2), (0, 2), (0, 1), (1, 1), (1, 1.5), (2, 1.5), (2, 0.5), (1, 0.5), (1, 1), (0, 1)]
    drawn(tmp_path / "wall.dxf", ring, brick(3, 0))
    assert "left out: 1 face with a hole on layer '0', 'block 2F' at (1.5, 1)" in info(capsys, tmp_path / "wall.dxf")
