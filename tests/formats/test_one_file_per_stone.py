"""A folder or a pattern of files, one stone each."""

import hashlib
import json

import ezdxf
import pytest
import trimesh
from structures import assembly_of

import blockvis
from blockvis import read, read_case, read_layout, write_layout
from blockvis.cli import main

CASE = """
[geometry]
file = "{file}"
[roles]
"stone 1" = "fixed"
"stone 2" = "moving"
[settlement]
direction = [0.0, -1.0]
increment = 0.01
limit = 0.02
[output]
animation = false
"""


def stones(folder, suffix=".stl", n=12):
    """Cubes in a row, one a file; a cube alone fits every view, together only two."""
    folder.mkdir(exist_ok=True)
    for k in range(1, n + 1):
        at = trimesh.transformations.translation_matrix((k - 0.5, 0.25, 0.5))
        trimesh.creation.box((1, 0.5, 1), transform=at).export(folder / f"stone {k}{suffix}")
    return folder


def test_a_file_of_a_folder_has_the_roles_that_it_has_alone(tmp_path):
    for k, layers in enumerate((["stones", "moving"], ["fixed bricks", "moving crane walls"])):
        document = ezdxf.new("R2010")
        for row, layer in enumerate(layers):
            corners = [(2 * k + x, row + y) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
            document.modelspace().add_lwpolyline(corners, close=True, dxfattribs={"layer": layer})
        document.saveas(tmp_path / f"part {k}.dxf")
    alone = [read(tmp_path / f"part {k}.dxf").roles.tolist() for k in (0, 1)]
    assert alone == [["free", "moving"], ["free", "free"]]
    assert read(tmp_path).roles.tolist() == alone[0] + alone[1]


@pytest.mark.parametrize(
    "suffix",
    [
        ".stl",
        ".ply",
        pytest.param(".obj", marks=pytest.mark.thorough),
        pytest.param(".glb", marks=pytest.mark.thorough),
    ],
)
def test_a_folder_of_one_stone_per_file(tmp_path, suffix):
    folder = stones(tmp_path / "stones", suffix)
    (folder / "notes.txt").write_text("from the scanner", encoding="utf-8")
    layout = read_layout(folder, view="xz")
    assert layout.names == tuple(f"stone {k}" for k in range(1, 13)), "in the order of counting"
    assert layout.thickness == pytest.approx([0.5] * 12)
    assembly = read(folder / f"*{suffix}", density=1000.0, view="xz")
    assert assembly.masses == pytest.approx([500.0] * 12)
    assert assembly.centroids[11] == pytest.approx([11.5, 0.5])


def test_stones_that_touch_are_separate_bodies_in_one_view(tmp_path):
    folder = stones(tmp_path / "stones", n=2)
    at = trimesh.transformations.translation_matrix((0.5, 0.25, 1.5))
    trimesh.creation.box((1, 0.5, 1), transform=at).export(folder / "stone 3.stl")
    layout = read_layout(folder)
    assert any("3 bodies were read as outlines in xz" in note for note in layout.notes)
    at = trimesh.transformations.translation_matrix((0.5, 0.75, 0.5))
    trimesh.creation.box((1, 0.5, 1), transform=at).export(folder / "stone 4.stl")
    with pytest.raises(ValueError, match="'stone 4' lies behind 'stone 1'"):
        read(folder, view="xz")


def test_flat_files_are_joined(tmp_path):
    for k in range(3):
        drawing = ezdxf.new(units=4)
        drawing.modelspace().add_lwpolyline([(k, 0), (k + 1, 0), (k + 1, 1), (k, 1)], close=True)
        if k == 2:
            drawing.modelspace().add_lwpolyline([(k, 1), (k + 1, 1), (k + 1, 2), (k, 2)], close=True)
        drawing.saveas(tmp_path / f"p{k}.dxf")
    layout = read_layout(tmp_path / "p*.dxf", unit="m")
    assert layout.names[:2] == ("p0", "p1")
    assert layout.names[2:] == ("p2 1", "p2 2")
    assert layout.unit == "m"


def test_info_convert_and_a_case_take_them(tmp_path, capsys):
    stones(tmp_path / "stones", n=3)
    assert main(["info", f"{tmp_path}/stones/"]) == 0
    assert "outlines        3" in capsys.readouterr().out
    assert main(["convert", f"{tmp_path}/stones/*.stl", str(tmp_path / "wall.json")]) == 0
    assert [b["name"] for b in json.loads((tmp_path / "wall.json").read_text(encoding="utf-8"))["blocks"]] == [
        "stone 1",
        "stone 2",
        "stone 3",
    ]
    for file in ("stones/", "stones/*.stl"):
        (tmp_path / "case.toml").write_text(CASE.format(file=file), encoding="utf-8")
        assert assembly_of(read_case(tmp_path / "case.toml")).names == ("stone 1", "stone 2", "stone 3")


@pytest.mark.thorough
def test_a_run_knows_when_one_of_its_files_changes(tmp_path):
    folder = stones(tmp_path / "stones", n=3)

    def inputs(file):
        (tmp_path / "case.toml").write_text(CASE.format(file=file), encoding="utf-8")
        return blockvis.run_case(tmp_path / "case.toml", tmp_path / "out", overwrite=True, outputs=()).summary["inputs"]

    before = inputs("stones/*.stl")
    assert before["layout_file"] == "*.stl"
    assert inputs("stones/")["layout_sha256"] == before["layout_sha256"]
    at = trimesh.transformations.translation_matrix((2.5, 0.25, 0.6))
    trimesh.creation.box((1, 0.5, 1), transform=at).export(folder / "stone 3.stl")
    assert inputs("stones/")["layout_sha256"] != before["layout_sha256"]


def test_one_file_has_the_checksum_of_its_bytes(tmp_path):
    write_layout(read_layout(stones(tmp_path / "stones", n=3)), tmp_path / "wall.json")
    (tmp_path / "case.toml").write_text(CASE.format(file="wall.json"), encoding="utf-8")
    run = blockvis.run_case(tmp_path / "case.toml", tmp_path / "out", outputs=())
    sha256 = hashlib.sha256((tmp_path / "wall.json").read_bytes()).hexdigest()
    assert run.summary["inputs"]["layout_sha256"] == sha256


def test_what_is_no_set_of_stones_is_refused(tmp_path):
    folder = stones(tmp_path / "stones", n=2)
    (tmp_path / "empty").mkdir()
    with pytest.raises(ValueError, match="is a folder without a layout file"):
        read(tmp_path / "empty")
    with pytest.raises(ValueError, match=r"no file fits '.*\*\.obj'; check the folder and the pattern"):
        read(folder / "*.obj")
    stones(folder, ".ply", n=2)
    (folder / "summary.json").write_text("{}", encoding="utf-8")
    with pytest.raises(ValueError, match=r"is a folder of results; give '.*blocks.pvd', or one of its .vtu"):
        read(folder)
    (folder / "summary.json").unlink()
    with pytest.raises(
        ValueError, match=r"files of several formats \(2 .ply, 2 .stl\); choose one of them: '.*\*.ply'"
    ):
        read(folder)
    assert read(folder / "*.stl").n_blocks == 2
    (folder / "stone 3.stl").touch()
    with pytest.raises(ValueError, match=r"stone 3.stl' is empty \(0 bytes\)"):
        read(folder / "*.stl")


def test_a_name_with_brackets_is_a_name_where_there_is_such_a_file(tmp_path):
    write_layout(read_layout(stones(tmp_path / "stones", n=2)), tmp_path / "plan [1].svg")
    assert read(tmp_path / "plan [1].svg").n_blocks == 2


def test_files_in_different_units_are_refused(tmp_path):
    for k, units in enumerate((4, 6)):
        drawing = ezdxf.new(units=units)
        drawing.modelspace().add_lwpolyline([(k, 0), (k + 1, 0), (k + 1, 1), (k, 1)], close=True)
        drawing.saveas(tmp_path / f"p{k}.dxf")
    with pytest.raises(ValueError, match=r"its files state different units \('p0.dxf' mm, 'p1.dxf' m\)"):
        read(tmp_path / "*.dxf")
