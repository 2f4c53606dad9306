"""Layout to assembly: roles, supports, duplicates, overlaps, units; and what is refused."""

import json
import warnings
from dataclasses import replace

import numpy as np
import pytest
from structures import assembly_of, drawn

import blockvis
import solver
from blockvis import read, read_layout, save_layout

UNIT = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)


@pytest.fixture
def row(tmp_path):
    """A function that draws n bricks side by side, with what the file says of them beside."""

    def drawing(n, **words):
        bricks = [UNIT + np.array([k, 0]) for k in range(n)]
        return drawn(tmp_path / "row.json", bricks, [f"brick {k + 1}" for k in range(n)], **words)

    return drawing


def test_roles_by_name_group_material_and_pattern(row):
    drawing = row(4, group=("wall", "wall", "base", "base"), material=("brick", "brick", "stone", "brick"))
    roles = read(drawing, roles={"b*": "free", "base": "fixed", "brick 4": "moving"}).roles
    assert roles.tolist() == ["free", "free", "fixed", "moving"]
    assert read(drawing, roles={"stone": "fixed"}).roles.tolist() == ["free", "free", "fixed", "free"]


def test_a_role_by_a_word_that_is_a_name_and_a_group_is_of_all(row):
    drawing = row(3, name=("abutment", "brick", "abutment 2"), group=("abutment", "wall", "abutment"))
    assert read(drawing, roles={"abutment": "fixed"}).roles.tolist() == ["fixed", "free", "fixed"]


def test_a_group_or_block_called_fixed_or_moving_is_that(row):
    drawing = row(3, group=("Fixed", "", ""), role=("", "", "moving"))
    assert read(drawing).roles.tolist() == ["fixed", "free", "moving"]
    assert read(drawing, roles={"Fixed": "free"}).roles.tolist() == ["free", "free", "moving"]


def test_a_role_that_matches_nothing_lists_the_names_nearest_first(row):
    drawing = row(2, group=("left springer", "voussoirs"))
    with pytest.raises(ValueError, match=r"roles: 'left sprnger' matches no block.*has 'left springer', 'voussoirs'"):
        read(drawing, roles={"left sprnger": "fixed"})
    with pytest.raises(ValueError, match="roles: 'voussoirs' has role 'fxed'; roles are free, fixed, moving"):
        read(drawing, roles={"voussoirs": "fxed"})


def test_a_layout_is_changed_and_assembled(row):
    """A mask chose the blocks 0 and 1 again and again."""
    layout = blockvis.read_layout(row(3))
    kept = np.array(layout.names) != "brick 2"
    for blocks in (kept, kept.tolist(), [0, 2], np.array([0, 2])):
        assert layout.chosen(blocks).names == ("brick 1", "brick 3")
    assert layout.chosen([]).n_blocks == 0
    changed = replace(layout.chosen(kept), roles=np.array(["fixed", "free"]), density=[1800, np.nan])
    assembly = blockvis.assemble(changed, density=2200.0)
    assert (assembly.density.tolist(), assembly.free.tolist()) == ([1800.0, 2200.0], [False, True])
    assert repr(layout).startswith("<Layout of 3 blocks of '")


@pytest.mark.parametrize(
    ("change", "error", "message"),
    [
        (lambda layout: layout.chosen([7]), ValueError, r"no blocks \[7\]; give numbers from 0 to 1, or a bool each"),
        (lambda layout: layout.chosen(["brick 1"]), ValueError, r"no blocks \['brick 1'\]; give numbers"),
        (
            lambda layout: replace(layout, density=1800.0),
            ValueError,
            r"2 blocks but density of shape \(\); give one number per",
        ),
        (
            lambda layout: replace(layout, thickness=[1.0]),
            ValueError,
            r"2 blocks but thickness of shape \(1,\); give one",
        ),
        (lambda layout: replace(layout, roles=("free", "fred")), ValueError, "block 'brick 2' has role 'fred'"),
        (lambda layout: blockvis.assemble(layout.source), TypeError, "str is no Layout.*blockvis.read takes a file"),
        (lambda layout: blockvis.assemble(layout, supports={"name": "g"}), TypeError, "supports are .*; give a list"),
        (
            lambda layout: read_layout(layout.source, dimension=3, thickness=-1),
            ValueError,
            "has thickness -1 m; give a",
        ),
        (lambda layout: read_layout(layout.source, dimension=3, thickness=np.nan), ValueError, "has thickness nan m"),
        (lambda layout: read_layout(layout.source, dimension=3, thickness="1"), ValueError, "thickness is '1'; give a"),
        (lambda layout: blockvis.assemble(layout, density={"wall": 1}), ValueError, "density is {'wall': 1}; give num"),
        (
            lambda layout: blockvis.assemble(layout, roles=["free"] * 2),
            TypeError,
            r"roles are \['free', 'free'\]",
        ),
    ],
)
def test_what_a_layout_is_changed_to_is_checked(row, change, error, message):
    with pytest.raises(error, match=message):
        change(blockvis.read_layout(row(2)))


def test_supports_are_added_and_checked(row):
    ground = {"name": "ground", "role": "moving", "outline": [[0, -1], [2, -1], [2, 0], [0, 0]]}
    assembly = read(row(2), supports=[ground])
    assert assembly.names[-1] == "ground"
    assert assembly.roles[-1] == "moving"
    with pytest.raises(ValueError, match="support 'ground' has the key 'outlin'"):
        read(row(1), supports=[{"name": "ground", "outlin": []}])
    with pytest.raises(ValueError, match="support 'support 0' has no outline"):
        read(row(1), supports=[{"role": "fixed"}])


def test_duplicates_are_dropped_with_one_warning_that_names_them(tmp_path):
    bricks = [UNIT + np.array([k, 0]) for k in range(3)]
    names = ["brick 1", "brick 2", "brick 3", "again"]
    twice = drawn(tmp_path / "a.json", [*bricks, bricks[1][[2, 1, 0, 3]]], names)
    with pytest.warns(UserWarning, match="1 of 4 blocks is drawn twice and was dropped: 'again' = 'brick 2'") as seen:
        assembly = read(twice)
    assert len(seen) == 1
    assert assembly.n_blocks == 3


def test_small_overlaps_are_resolved_and_large_ones_name_both_blocks(tmp_path):
    def pair(depth):
        return drawn(tmp_path / "a.json", [UNIT, UNIT + np.array([1 - depth, 0])], ["left", "right"])

    closed = read(pair(0.01))
    assert closed.outline(0)[:, 0].max() == pytest.approx(0.995, abs=1e-12)
    assert closed.outline(1)[:, 0].min() == pytest.approx(0.995, abs=1e-12)
    with pytest.raises(
        ValueError, match=r"a.json': block 0 \('left'\) overlaps block 1 \('right'\) by 0.1 m .*raise overlap_tolerance"
    ):
        read(pair(0.1))
    assert read(pair(0.1), overlap_tolerance=0.2).outline(0)[:, 0].max() == pytest.approx(0.95)


@pytest.mark.parametrize("in_space", [False, True])
@pytest.mark.parametrize(
    ("key", "wrong"),
    [
        *(("joint_thickness", wrong) for wrong in ("automatic", -1.0, float("nan"), 10.0)),
        *((f"{what}_tolerance", wrong) for what in ("overlap", "outline") for wrong in (-1.0, float("nan"))),
        ("closing", "glue"),
    ],
)
def test_lengths_are_checked_in_the_plane_and_in_space(key, wrong, in_space, row):
    with pytest.raises(ValueError, match=f"{key} is .*(a length|mortar joints in m|choose from auto)"):
        read(row(3), dimension=3 if in_space else 2, **{key: wrong})


def test_exact_layouts_keep_their_coordinates(row):
    assembly = read(row(5))
    assert (assembly.outline(3) == UNIT + np.array([3, 0])).all()


def test_density_and_thickness_of_the_file_hold_where_it_has_them(row):
    drawing = row(2, density=(1800.0, None), thickness=(None, 0.3))
    assembly = read(drawing, density=2500.0, thickness=0.5)
    assert assembly.density.tolist() == [1800.0, 2500.0]
    assert assembly.thickness.tolist() == [0.5, 0.3]


@pytest.mark.parametrize(
    ("key", "given"), [("material", "density = 1800"), ("geometry", "thickness = 0.5"), ("geometry", "thickness = 0.2")]
)
def test_a_value_of_the_case_that_loses_against_the_file_is_told(tmp_path, row, key, given):
    row(3, density=[2000, None, 2200], thickness=[0.2, 0.2, None], role=["free", "free", "fixed"])
    case = tmp_path / "case.toml"
    tables = {"geometry": 'file = "row.json"\n', "material": "", "analysis": 'kind = "limit load"\n'}
    tables[key] += f"{given}\n"
    tables["[loads]"] = 'kind = "live"\nforce = [1, 0]\n'
    case.write_text("".join(f"[{name}]\n{text}" for name, text in tables.items()), encoding="utf-8")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        assembly_of(case)
    told = [str(warning.message) for warning in caught if "keep what 'row.json' says" in str(warning.message)]
    assert len(told) == (given != "thickness = 0.2")
    assert all(f"[{key}] {given} is that of 1 block; 2 of 3 keep" in text for text in told)


def test_a_deformed_pose_is_written(tmp_path, row):
    assembly = read(row(2))
    pose = solver.Pose(assembly.centroids + np.array([0, -0.25]), np.array([[0.0], [np.pi / 2]]))
    save_layout(assembly, tmp_path / "moved.json", pose=pose)
    moved = read(tmp_path / "moved.json")
    assert np.allclose(moved.centroids, assembly.centroids + np.array([0, -0.25]))


def test_units(tmp_path):
    path = tmp_path / "a.json"
    blocks = [{"outline": (UNIT * 250).tolist()}]
    path.write_text(json.dumps({"unit": "mm", "blocks": blocks}), encoding="utf-8")
    assert read(path).areas[0] == pytest.approx(0.0625)
    assert read(path, unit="cm").areas[0] == pytest.approx(6.25)
    assert "it was read in cm because that was asked for" in read_layout(path, unit="cm").notes[0]
    path.write_text(json.dumps({"blocks": [{"outline": UNIT.tolist()}]}), encoding="utf-8")
    assert read_layout(path).notes == ("the file does not say its unit; m was assumed",)
    with pytest.raises(ValueError, match="unit 'furlong' is not known"):
        read(path, unit="furlong")


def test_missing_and_empty_files(tmp_path):
    (tmp_path / "arch.msh").write_text("", encoding="utf-8")
    with pytest.raises(ValueError, match=r"there is no file .*arc.msh'; did you mean arch.msh"):
        read(tmp_path / "arc.msh")
    with pytest.raises(FileNotFoundError):
        read(tmp_path / "arc.msh")
    with pytest.raises(ValueError, match=r"is empty \(0 bytes\)"):
        read(tmp_path / "arch.msh")


@pytest.mark.parametrize(
    ("suffix", "words"),
    [
        (".xyz", r"'.xyz' is not read; give drawings .dxf .svg, .*; docs/formats.md has all"),
        ("", r"a file without suffix is not read; give drawings"),
        (".DWG", r"'.dwg' is not read: save it as .dxf .*ODA File Converter"),
        (".unv", r"'.unv' is not read: in gmsh: .*-o a\.msh"),
        (".3dm", r"in Rhino: Export Selected, .*\.obj"),
        (".ifc", r"Bonsai"),
        (".pdf", r"Inkscape"),
        (".skp", r"in SketchUp: .*\.dae"),
        (".rvt", r"in Revit: .*DXF"),
    ],
)
def test_what_is_not_read_says_how_to_get_there(tmp_path, suffix, words):
    (tmp_path / f"arch{suffix}").write_text("x", encoding="utf-8")
    with pytest.raises(ValueError, match=words) as caught:
        read(tmp_path / f"arch{suffix}")
    assert len(str(caught.value)) < 420
    assert "\n" not in str(caught.value)


def test_halves_of_characters_are_replaced_and_noted(tmp_path):
    """A name that no file can hold ended the process in VTK."""
    blocks = [
        {"name": "a\ud800b", "material": "m\udfff", "outline": [[0, 0], [1, 0], [1, 1], [0, 1]]},
        {"name": "c\u0001d \U0001f9f1", "outline": [[0, 1], [1, 1], [1, 2], [0, 2]]},
    ]
    path = tmp_path / "halves.json"
    path.write_text(
        json.dumps({"format": "blockvis layout", "version": 1, "unit": "m", "blocks": blocks}), encoding="utf-8"
    )
    drawing = read_layout(path)
    assert drawing.names == ("a\ufffdb", "c\u0001d \U0001f9f1")
    assert drawing.materials == ("m\ufffd", "")
    assert [note for note in drawing.notes if "encoding" in note] == [
        "characters that the file's encoding does not have are shown as \ufffd"
    ]
    assembly = read(path, roles={"a*": "moving"})
    spread = solver.Settlement(direction=(0, -1), increment=0.01, limit=0.01)
    folder = blockvis.write(solver.settle(assembly, spread), tmp_path / "out")
    assert blockvis.open_results(folder).assembly.names == drawing.names
