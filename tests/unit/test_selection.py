"""What of a drawing is a block: what is left out by itself or on request, and how it is told."""

import json
import re

import ezdxf
import numpy as np
import pytest
import structures
from structures import assembly_of, brick, case_from

from blockvis import inspect, read, read_case, read_layout, run_case, write_layout
from blockvis.cli import main


def wall(space, layer="brick", x=0.0, n=4):
    for course in range(4):
        for k in range(n):
            ring = brick(x + 250 * k, 75 * course, 240, 65)
            space.add_lwpolyline(ring.tolist(), close=True, dxfattribs={"layer": layer})


def drawn(tmp_path, *draw, unit=4):
    """A drawing in mm of sixteen bricks, and what else is asked for."""
    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = unit
    wall(document.modelspace())
    for one in draw:
        one(document.modelspace())
    document.saveas(tmp_path / "wall.dxf")
    return tmp_path / "wall.dxf"


def outline(ring, layer, close=True):
    return lambda space: space.add_lwpolyline(np.asarray(ring).tolist(), close=close, dxfattribs={"layer": layer})


def hatch_with_hole(space):
    hatch = space.add_hatch(dxfattribs={"layer": "mortar"})
    hatch.paths.add_polyline_path(brick(0, 0, 990, 290).tolist())
    hatch.paths.add_polyline_path(brick(250, 75, 240, 65).tolist())


@pytest.mark.parametrize(
    ("extra", "note"),
    [
        (
            outline([[1500, 600], [1600, 700], [1700, 640]], "notes", close=False),
            r"left out: 1 line that closes no outline on layer 'notes', 'line \w+' at \(1.5, 0.6\), its ends 0.204",
        ),
        (outline([[0, 500], [100, 500], [300, 500]], "brick"), "left out: 1 outline without area on layer 'brick'"),
        (
            outline(brick(0, 500, 900, 0.05), "brick"),
            r"left out: 1 sliver on layer 'brick', 'block \w+' at \(0.45, 0.5",
        ),
        (hatch_with_hole, r"left out: 1 mortar surface on layer 'mortar', 'hatch \w+' at \(0.495, 0.145\)"),
        (
            outline(brick(-500, -500, 2000, 1500), "sheet"),
            "left out: 1 frame or background around other blocks on layer",
        ),
        (outline(brick(0, 900, 500, 60), "Title"), "left out: 1 outline on a layer of annotations on layer 'Title'"),
        (
            outline(brick(0, 900, 50, 90), "North arrow"),
            "left out: 1 outline on a layer of annotations on layer 'North",
        ),
    ],
)
def test_what_is_no_block_is_left_out_with_a_note(tmp_path, extra, note):
    drawing = read_layout(drawn(tmp_path, extra))
    assert drawing.n_blocks == 16
    assert [words for words in drawing.notes if re.match(note, words)], drawing.notes
    with pytest.warns(UserWarning, match=note):
        assert read(tmp_path / "wall.dxf").n_blocks == 16


@pytest.mark.thorough
def test_windows_among_stones_on_their_own_layer_are_named(tmp_path, capsys):
    def facade(*windows):
        document = ezdxf.new("R2010")
        document.header["$INSUNITS"] = 4
        space = document.modelspace()
        cut = [brick(x, 300, 900, 900) for x in windows]
        stones = [brick(300 * k, 300 * course, 300, 300) for course in range(6) for k in range(14)]
        stones = [ring for ring in stones if not any((ring >= w[0]).all() and (ring <= w[2]).all() for w in cut)]
        # Neither a plinth nor a lintel is an opening, nor a buttress with stones to one side only.
        others = [brick(0, -300, 4200, 300), brick(0, 1800, 4200, 300), brick(-900, 0, 900, 1800)]
        rings = [*stones, *others, *cut]
        handles = [space.add_lwpolyline(ring.tolist(), close=True).dxf.handle for ring in rings]
        document.saveas(tmp_path / "facade.dxf")
        return [f"block {handle}" for handle in handles[len(stones) + len(others) :]]

    first, second = facade(600, 2400)
    assert main(["new", str(tmp_path / "facade.dxf"), "-o", str(tmp_path / "case.toml")]) == 0
    says = f"'{first}' around (1.05, 0.75) of 9 times the median area and 1 other count as stones; leave out what is"
    says += f' an opening: ignore = ["{first}", "{second}"]'
    assert says in capsys.readouterr().err
    left = read_layout(tmp_path / "facade.dxf", ignore=[first, second])
    assert not any("an opening" in note for note in left.notes)
    facade()
    assert not any("an opening" in note for note in read_layout(tmp_path / "facade.dxf").notes)


def test_glazing_bars_that_cut_a_window_are_told_with_their_layer_and_that_this_is_no_stone(tmp_path):
    def window(space):
        ring = [[250, 300], [490, 300], [490, 540], [250, 540]]
        space.add_lwpolyline(ring, close=True, dxfattribs={"layer": "A-GLAZ"})
        space.add_line((370, 300), (370, 540), dxfattribs={"layer": "A-GLAZ"})

    notes = read_layout(drawn(tmp_path, window)).notes
    assert any(
        note.endswith('if they are no joints, leave them out: ignore = ["line"] or their layers, ["A-GLAZ"]')
        for note in notes
    )
    assert any(
        note.startswith("what is called 'A-GLAZ' counts as a stone; of an opening leave it out") for note in notes
    )
    assert read_layout(tmp_path / "wall.dxf", ignore=["A-GLAZ"]).n_blocks == 16


def test_lines_across_the_wall_are_left_out_and_cut_nothing(tmp_path):
    def axes(space):
        for a, b in (((-300, 100), (1300, 100)), ((-300, 200), (1300, 200)), ((120, -300), (120, 900))):
            space.add_line(a, b, dxfattribs={"layer": "axes"})
        space.add_line((870, -300), (870, 900), dxfattribs={"layer": "axes"})

    drawing = read_layout(drawn(tmp_path, axes))
    assert drawing.n_blocks == 16
    # Four crossing lines enclose a face, which lies across bricks.
    assert any("1 face of loose lines across outlines on layer 'axes'" in note for note in drawing.notes)


def test_a_title_block_goes_with_its_frame_and_bricks_on_a_background_stay(tmp_path):
    cells = [outline(brick(1000 + 200 * k, -500, 200, 120), "sheet") for k in range(3)]
    drawing = read_layout(drawn(tmp_path, outline(brick(-500, -500, 2100, 1500), "sheet"), *cells))
    assert drawing.n_blocks == 16
    assert any("3 cells of a title block on layer 'sheet'" in note for note in drawing.notes)
    # Bricks that reach the border of what lies behind them are no title block.
    drawing = read_layout(drawn(tmp_path, outline(brick(0, 0, 990, 290), "mortar")))
    assert drawing.n_blocks == 16
    assert any("1 mortar surface on layer 'mortar'" in note for note in drawing.notes)


def test_inner_lines_of_blocks_go_and_one_block_in_another_is_refused(tmp_path):
    inner = [outline(brick(250 * k + 10, 10, 220, 45), "brick") for k in range(4)]
    drawing = read_layout(drawn(tmp_path, *inner))
    assert drawing.n_blocks == 16
    assert any("4 inner lines of blocks on layer 'brick'" in note for note in drawing.notes)
    with pytest.raises(ValueError, match="overlaps"):
        read(drawn(tmp_path, outline(brick(10, 10, 220, 45), "brick")))


def test_mortar_drawn_as_blocks_of_its_own_stays(tmp_path):
    bricks = [brick(0, 0, 1, 0.4), brick(1.05, 0, 1, 0.4), brick(0, 0.45, 2.05, 0.4)]
    mortar = [brick(1.0, 0, 0.05, 0.4), brick(0, 0.4, 2.05, 0.05)]
    groups = ["stone"] * 3 + ["mortar"] * 2
    assert read_layout(structures.drawn(tmp_path / "a.json", bricks + mortar, "abcde", group=groups)).n_blocks == 5


def test_ignore_and_only(tmp_path):
    path = drawn(
        tmp_path, outline(brick(2000, 0, 300, 100), "steel"), outline(brick(2000, 200, 300, 100), "steel beam")
    )
    assert read_layout(path).n_blocks == 18
    assert read_layout(path, ignore="steel").n_blocks == 17
    assert read_layout(path, ignore=["steel*"]).n_blocks == 16
    assert read_layout(path, only=["brick"]).n_blocks == 16
    assert read_layout(path, only="steel*").n_blocks == 2
    assert read(path, ignore=["steel*"]).n_blocks == 16
    assert inspect(path, ignore=["steel*"]).layout.n_blocks == 16
    assert any(
        "2 outlines, as asked for on layer" in n or "1 outline, as asked for" in n
        for n in read_layout(path, ignore="steel*").notes
    )
    with pytest.raises(ValueError, match=r"only: 'brik' matches no layer, group or name; the drawing has 'brick'"):
        read_layout(path, only="brik")
    with pytest.raises(ValueError, match="all that it draws is left out as asked"):
        read_layout(path, ignore="*")
    assert "ignore: 'stel' matches no layer, group or name; the drawing has 'steel'" in " ".join(
        read_layout(path, ignore="stel").notes
    )
    said = "'brick, steel*' is one pattern, and matches nothing; give each of its parts by itself"
    assert f"ignore: {said}" in read_layout(path, ignore="brick, steel*").notes
    with pytest.raises(ValueError, match=re.escape(f"only: {said}")):
        read_layout(path, only="brick, steel*")


def test_what_only_names_is_not_left_out_by_itself(tmp_path):
    path = drawn(tmp_path, outline(brick(0, 900, 500, 60), "Title"))
    assert read_layout(path, only=["brick", "Title"]).n_blocks == 17


@pytest.mark.thorough
def test_what_is_asked_to_go_cannot_refuse_the_file(tmp_path):
    """A surface in pieces is refused, unless it is left out."""
    rings = [brick(0, 0, 1, 1), brick(1, 0, 1, 1), brick(5, 5, 1, 1)]
    plain = structures.drawn(tmp_path / "a.json", rings, "abc", group=["stone", "soil", "soil"])
    write_layout(read_layout(plain), tmp_path / "a.vtu")
    import pyvista as pv

    mesh = pv.read(tmp_path / "a.vtu")
    mesh.cell_data["block_id"] = np.array([0, 1, 1])
    mesh.cell_data["name"] = np.array(["a", "b", "b"])
    mesh.save(tmp_path / "b.vtu")
    with pytest.raises(ValueError, match=r"'b' is in 2 separate pieces.*or leave it out \(ignore\)|separate pieces"):
        read_layout(tmp_path / "b.vtu")
    assert read_layout(tmp_path / "b.vtu", ignore="soil").names == ("a",)


def test_keys_of_the_case(tmp_path):
    drawn(tmp_path, outline(brick(2000, 0, 300, 100), "steel"))
    text = '[geometry]\nfile = "wall.dxf"\nignore = ["steel"]\njoint_thickness = "auto"\nclosing = "faces"\n'
    text += '[roles]\n"block 2F" = "moving"\n[settlement]\ndirection = [0, -1]\n'
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    case = read_case(tmp_path / "case.toml")
    assert (case.ignore, case.only, case.closing) == (("steel",), (), "faces")
    with pytest.warns(UserWarning, match="1 outline, as asked for on layer 'steel'"):
        assert assembly_of(case).n_blocks == 16
    with pytest.raises(ValueError, match=r"\[geometry\] ignore is 3; give texts in quotes"):
        case_from('[geometry]\nfile = "wall.dxf"\nignore = 3', tmp_path)
    with pytest.raises(ValueError, match=r"\[geometry\] closing is 'voronoy' \(did you mean 'voronoi'\?\)"):
        case_from('[geometry]\nfile = "wall.dxf"\nclosing = "voronoy"', tmp_path)
    with pytest.raises(ValueError, match=r"\[geometry\] only belongs to a file"):
        case_from('[geometry]\nlayout = "wall"\nonly = ["a"]', tmp_path)


def test_on_the_command_line(tmp_path, capsys):
    path = drawn(tmp_path, outline(brick(2000, 0, 300, 100), "steel"), outline(brick(2000, 200, 300, 100), "wood"))
    assert main(["info", str(path), "--ignore", "steel", "--ignore", "wood"]) == 0
    assert "outlines        16" in capsys.readouterr().out
    assert main(["convert", str(path), str(tmp_path / "a.json"), "--only", "brick"]) == 0
    assert read_layout(tmp_path / "a.json").n_blocks == 16


@pytest.mark.thorough
def test_info_honours_roles_of_layers_and_draws_what_was_left_out(tmp_path):
    path = drawn(
        tmp_path,
        outline(brick(-100, -100, 600, 100), "fixed"),
        outline(brick(500, -100, 600, 100), "Moving"),
        outline([[1500, 600], [1600, 700], [1700, 640]], "notes", close=False),
    )
    found = inspect(path)
    assert "'free' 16, 'fixed' 1, 'moving' 1" in str(found)
    assert main(["info", str(path), "--picture", str(tmp_path / "a.svg")]) == 0
    picture = (tmp_path / "a.svg").read_text(encoding="utf-8")
    for words in ("left out: 1", "moving: 1", "fixed: 1", "gap between facing edges"):
        assert words in picture


def test_bodies_are_left_out_before_they_hide_the_others(tmp_path):
    import trimesh

    scene = trimesh.Scene()
    for name, place in (("stone 1", (0, 0, 0)), ("stone 2", (1, 0, 0)), ("second leaf", (0, 0, 2))):
        stone = trimesh.creation.box((1, 1, 1), trimesh.transformations.translation_matrix(place))
        scene.add_geometry(stone, node_name=name, geom_name=name)
    scene.export(tmp_path / "a.glb")
    drawing = read_layout(tmp_path / "a.glb", ignore="second*")
    assert drawing.names == ("stone 1", "stone 2")
    assert any("left out: 1 outline, as asked for, 'second leaf'" in note for note in drawing.notes)
    with pytest.raises(ValueError, match="all that it draws is left out as asked"):
        read_layout(tmp_path / "a.glb", ignore="*")


def test_names_with_brackets_name_their_blocks(tmp_path):
    """Beside patterns, of which [1] would mean the figure alone."""
    names = {"stone [1]": 0.0, "stone [2]": 2.0}
    blocks = [{"name": name, "outline": brick(x, 0, 1, 1).tolist()} for name, x in names.items()]
    blocks.append({"name": "ground", "outline": brick(-1, -1, 5, 1).tolist(), "role": "moving"})
    (tmp_path / "stones.json").write_text(json.dumps({"blocks": blocks}), encoding="utf-8")
    text = """
[geometry]
file = "stones.json"
[[loads]]
blocks = "stone [1]"
force = [0, -10]
[[backfill]]
over = "stone [2]"
surface = 2.0
unit_weight = 1e4
[[remove]]
phase = 1
blocks = "stone [1]"
[[settlement]]
direction = [0, -1]
limit = 0.01
increment = 0.01
"""
    run = run_case(case_from(text, tmp_path), tmp_path / "results", outputs=())
    assert run.response.path[-1].removed.tolist() == [True, False, False]
