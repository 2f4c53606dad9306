"""Pictures of drawings that are refused: they show why."""

import numpy as np
import pytest

import solver
from blockvis import inspect, read_layout, save_layout
from blockvis.cli import main
from blockvis.layout.assemble import supports_of
from blockvis.layout.faults import faults_of
from blockvis.layout.inspect import inspected
from blockvis.layout.layout import Layout
from blockvis.layout.left_out import LeftOut
from blockvis.layout.refusal import Refused
from blockvis.pictures.inspection import draw_inspection, draw_refusal

BOX = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]


def drawing(path, *lines):
    """A DXF of polylines: corners, and whether they are closed."""
    import ezdxf

    document = ezdxf.new()
    for corners, close in lines:
        document.modelspace().add_lwpolyline(corners, close=close)
    document.saveas(path)
    return path


def box(x, y=0.0, width=1.0, height=0.5):
    return [[x, y], [x + width, y], [x + width, y + height], [x, y + height]]


def solid(x, z=0.0):
    return [[x + i, j, z + k] for k in (0.0, 1.0) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]


def bodies(path, *faces_of_each):
    """An OBJ of unit cubes beside each other, with these faces each."""
    text = []
    for n, faces in enumerate(faces_of_each):
        text += [f"o stone {n}", *(f"v {x} {y} {z}" for x, y, z in solid(float(n) + 0.3 * (n == 1), z=0.2 * n))]
        text += [f"f {' '.join(str(8 * n + corner + 1) for corner in face)}" for face in faces]
    path.write_text("\n".join(text))
    return path


def words_of(picture):
    return picture.read_text(encoding="utf-8")


def test_lines_that_close_nothing_are_drawn_with_their_open_ends(tmp_path, capsys):
    path = drawing(tmp_path / "a.dxf", *(([*box(2 * k), [2 * k, 0.02]], False) for k in range(3)))
    assert main(["info", str(path), "--picture", str(tmp_path / "a.svg")]) == 2
    printed = capsys.readouterr()
    assert printed.out == f"drawn in {tmp_path / 'a.svg'}\n"
    assert printed.err.count("\n") == 1
    assert "has no closed outline" in printed.err
    assert {"open ends: 6", "lines as drawn: 3", "a.dxf: refused"} <= set(_comments(words_of(tmp_path / "a.svg")))


def _comments(text):
    """What matplotlib writes: each text stands in a comment before its shapes."""
    return [part.split(" -->")[0] for part in text.split("<!-- ")[1:]]


def test_ends_that_meet_are_not_open(tmp_path):
    path = drawing(tmp_path / "a.dxf", ([[0, 0], [1, 0]], False), ([[1, 0], [1, 1]], False))
    with pytest.raises(Refused) as refused:
        read_layout(path)
    assert sorted(faults_of(refused.value.layout).ends.tolist()) == [[0, 0], [1, 1]]


CROSSED = np.array([[0, 0.5], [2, 0.5], [0, 2.5], [1, 2.5]])


def test_an_outline_that_crosses_itself_is_ringed_and_named(tmp_path):
    layout = Layout((np.array(box(0)), np.array(box(1)), CROSSED), ("a", "b", "c"))
    with pytest.raises(Refused, match=r"'c'\) crosses itself") as refused:
        inspected(layout)
    faults = faults_of(refused.value.layout)
    assert faults.blocks == (2,)
    assert faults.crossings == pytest.approx(np.array([[2 / 3, 11 / 6]]))
    draw_refusal(refused.value, tmp_path / "a.svg")
    assert {"read: 2", "refused: 1", "crosses itself: 1"} <= set(_comments(words_of(tmp_path / "a.svg")))


def test_an_outline_that_is_left_out_for_crossing_itself_is_ringed(tmp_path):
    layout = Layout((np.array(box(0)), np.array(box(1))), ("a", "b"), left_out=(LeftOut("across", CROSSED, ""),))
    path = draw_inspection(inspected(layout), tmp_path / "a.svg")
    assert {"left out: 1", "crosses itself: 1"} <= set(_comments(words_of(path)))


def test_coordinates_of_what_a_reader_refuses_are_those_of_the_file(tmp_path):
    path = drawing(tmp_path / "a.dxf", ([[0, 0], [1000, 0], [1000, 500]], False))
    with pytest.raises(Refused, match=r"ends at \(1000, 500\)") as refused:
        read_layout(path, unit="mm")
    assert faults_of(refused.value.layout).ends.tolist() == [[0, 0], [1000, 500]]
    assert "x [mm]" in _comments(words_of(draw_refusal(refused.value, tmp_path / "a.svg")))


def test_a_file_without_geometry_is_refused_without_a_picture(tmp_path, capsys):
    (tmp_path / "a.dxf").write_text("Dear all\n")
    assert main(["info", str(tmp_path / "a.dxf"), "--picture", str(tmp_path / "a.png")]) == 2
    assert "drawn in" not in capsys.readouterr().out
    assert not (tmp_path / "a.png").exists()


@pytest.mark.slow
def test_a_body_that_is_not_closed_is_marked_with_its_open_edges(tmp_path):
    with pytest.raises(Refused, match="'stone 1' is not closed") as refused:
        read_layout(bodies(tmp_path / "a.obj", BOX, BOX[:5], BOX))
    layout = refused.value.layout
    faults = faults_of(layout)
    assert [layout.names[k] for k in faults.blocks] == ["stone 1"]
    assert len(faults.edges) == 4
    assert faults.edges[:, :, 0] == pytest.approx(1.3)
    draw_refusal(refused.value, tmp_path / "a.svg")
    said = set(_comments(words_of(tmp_path / "a.svg")))
    assert {"read: 2", "refused: 1", "edges that are not of two faces: 4", "stone 1"} <= said


@pytest.mark.thorough
def test_overlaps_in_space_are_coloured(tmp_path):
    found = inspect(bodies(tmp_path / "a.obj", BOX, BOX, BOX))
    draw_inspection(found, tmp_path / "a.svg")
    assert {"free: 1", "overlapping, refused: 2", "deepest overlaps: 1"} <= set(_comments(words_of(tmp_path / "a.svg")))


def test_the_ground_is_drawn_below_and_blocks_that_fall_are_told_apart(tmp_path):
    save_layout(solver.Assembly.from_outlines([box(0), box(1), box(0.5, 0.5)]), tmp_path / "a.json")
    ground = supports_of([{"name": "left", "outline": box(-1, -1)}, {"role": "moving", "outline": box(0, -1)}], 2)
    path = draw_inspection(inspect(tmp_path / "a.json"), tmp_path / "a.svg", ground=ground, falling=[2])
    said = {"free: 2", "does not stand: 1", "ground of blockvis new, fixed: 1", "ground of blockvis new, moving: 1"}
    assert said <= set(_comments(words_of(path)))


@pytest.mark.parametrize("lower", [0.0, pytest.param(0.1, marks=pytest.mark.thorough)])
def test_pits_in_the_ground_are_told_in_the_picture_and_in_the_case(tmp_path, lower):
    """They looked like slots that nobody had asked for."""
    drawn, case = tmp_path / "a.json", tmp_path / "a.toml"
    save_layout(solver.Assembly.from_outlines([box(0), [[1, -lower], [2, -lower], [2, 0.5], [1, 0.5]]]), drawn)
    assert main(["info", str(drawn), "--picture", str(tmp_path / "a.svg")]) == 0
    assert main(["new", str(drawn), "-o", str(case)], outputs=()) == 0
    told = " ".join(_comments(words_of(tmp_path / "a.svg"))), " ".join(case.read_text(encoding="utf-8").split("\n# "))
    says = "pits keep it off the sides of stones that reach lower"
    assert [says in words for words in told] == [lower > 0.0] * 2


def test_names_are_written_where_they_can_be_read(tmp_path):
    outlines = [box(0, width=20, height=10), *(box(20 + 0.01 * k, width=0.01, height=10) for k in range(40))]
    save_layout(solver.Assembly.from_outlines(outlines), tmp_path / "a.json")
    said = _comments(words_of(draw_inspection(inspect(tmp_path / "a.json"), tmp_path / "a.svg")))
    assert any("names not written: 40" in text for text in said)


@pytest.mark.thorough
def test_info_draws_supports_as_a_new_case_has_them(tmp_path):
    named = solver.Assembly.from_outlines(
        [box(0), box(2), box(0, 0.5, width=3)], names=["springer 1", "springer 2", "lintel"]
    )
    save_layout(named, tmp_path / "named.json")
    save_layout(solver.Assembly.from_outlines([box(0), box(1)]), tmp_path / "wall.json")
    for name in ("named", "wall"):
        assert main(["info", str(tmp_path / f"{name}.json"), "--picture", str(tmp_path / f"{name}.svg")]) == 0
    assert {"free: 1", "fixed: 1", "moving: 1"} <= set(_comments(words_of(tmp_path / "named.svg")))
    assert "ground of blockvis new, moving: 1" in _comments(words_of(tmp_path / "wall.svg"))
