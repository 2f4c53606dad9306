"""Tables of cracks and displaced points, and drawings of the damaged state, as observations."""

from dataclasses import replace

import numpy as np
import pytest
from structures import drawn

import solver
from blockvis import generators, save_layout
from blockvis.explanation.observations import read_observations
from solver import mechanics

ARCH = generators.arch(voussoirs=6)
CROWN = "voussoir 3 | voussoir 4"


def table(tmp_path, text):
    path = tmp_path / "cracks.csv"
    path.write_text(text, encoding="utf-8")
    return read_observations(path, ARCH)


def test_a_width_belongs_to_the_middle_of_the_joint_between_two_blocks(tmp_path):
    found = table(tmp_path, f"joint,width [mm],uncertainty [mm]\n{CROWN},4.5,0.5\n")
    np.testing.assert_allclose(found.places, [[0.0, 1.0]], atol=1e-12)
    assert found.widths == pytest.approx([0.0045])
    assert found.uncertainties == pytest.approx([0.0005])
    assert found.named.tolist() == [True]


@pytest.mark.parametrize(
    "text",
    [
        "block_a,block_b,width\nvoussoir 3,voussoir 4,0.0045\n",
        "Block A;Block B;Width [mm]\nvoussoir 3;voussoir 4;4,5\n",
        "block_a\tblock_b\twidth_cm\nvoussoir 3\tvoussoir 4\t0.45\n",
        "block_a,block_b,width\n# seen in May\nvoussoir 4,voussoir 3,4.5e-3\n",
        "\ufeffjoint,width (mm)\nvoussoir 3 | voussoir 4,4.5\n\n",
    ],
)
def test_tables_of_other_makes_say_the_same(tmp_path, text):
    found = table(tmp_path, text)
    assert found.widths == pytest.approx([0.0045])
    assert found.uncertainties == pytest.approx([0.2 * 0.0045]), "a fifth, where the table gives none"


def test_closed_is_an_observation(tmp_path):
    found = table(tmp_path, "x,y,width [mm]\n0,1.0,3\n-0.85,0.5,closed\n0.85,0.5,0\n")
    assert found.widths == pytest.approx([0.003, 0.0, 0.0])
    assert found.uncertainties[1] == pytest.approx(2e-4)
    assert not found.named.any()


def test_columns_that_say_something_else_are_left_out_with_a_note(tmp_path):
    with pytest.warns(UserWarning, match="columns left out: seen by"):
        table(tmp_path, f"joint,width [mm],seen by\n{CROWN},3,A. Mason\n")


def test_displaced_points_by_block_and_by_place(tmp_path):
    found = table(
        tmp_path,
        "block,x,y,dx [mm],dy [mm],displaced_x,displaced_y\n"
        "voussoir 3,,,1.0,-5.0,,\n"
        "voussoir 4,0.3,1.0,,,0.301,0.995\n"
        ",0.3,1.01,2,0,,\n",
    )
    assert found.blocks == ("voussoir 3", "voussoir 4", "voussoir 4")
    np.testing.assert_allclose(found.points[0], ARCH.centroids[ARCH.index("voussoir 3")])
    np.testing.assert_allclose(found.displacements, [[1e-3, -5e-3], [1e-3, -5e-3], [2e-3, 0.0]], atol=1e-12)


def test_rows_of_a_table_in_python():
    found = read_observations([{"joint": CROWN, "width": 0.004, "uncertainty": float("nan")}], ARCH)
    assert found.widths == pytest.approx([0.004])


def test_every_row_of_python_may_have_its_own_keys():
    rows = [
        {"joint": CROWN, "width": 0.004},
        {"joint": "voussoir 1 | voussoir 2", "width": 0.002, "uncertainty": 1e-4},
        {"block": "right springer", "dx": 0.02, "dy": 0.0},
    ]
    for order in (rows, rows[::-1]):
        found = read_observations(order, ARCH)
        assert dict(zip(found.labels, found.uncertainties, strict=True))["voussoir 1 | voussoir 2"] == 1e-4
        np.testing.assert_allclose(found.displacements, [[0.02, 0.0]])


def test_joints_that_meet_at_a_place_are_told_apart_whatever_their_blocks_are_called(tmp_path):
    outlines = [[(x, y), (x + w, y), (x + w, y + 1), (x, y + 1)] for x, y, w in ((0, 0, 1), (1, 0, 1), (0, 1, 2))]
    wall = solver.Assembly.from_outlines(outlines, names=["left at a", "left at b", "right"])
    rows = [
        {"joint": "right | left at a", "x": 1, "y": 1, "width": 0.01},
        {"joint": "right | left at b", "x": 1, "y": 1, "width": 0.02},
    ]
    assert read_observations(rows, wall).widths == pytest.approx([0.01, 0.02])


def test_a_support_that_is_cut_is_named_by_its_name_or_its_pieces():
    outlines = [[(k, y), (k + 1, y), (k + 1, y + 1), (k, y + 1)] for y in (-1, 0) for k in (0, 1)]
    wall = solver.Assembly.from_outlines(
        outlines, names=["ground 1", "ground 2", "one", "two"], roles=["fixed", "fixed", "free", "free"]
    )
    wall = replace(wall, drawn_names=("ground", "ground", "one", "two"))
    for name in ("ground 2", "ground"):
        row = {"joint": f"two | {name}", "width": 0.001}
        found = read_observations([row, {"block": "ground", "dx": 0.001, "dy": 0.0}], wall)
        np.testing.assert_allclose(found.places, [[1.5, 0.0]])
        np.testing.assert_allclose(found.points, [[1.0, -0.5]])
    with pytest.raises(ValueError, match="'grounds' is no block"):
        read_observations([{"joint": "two | grounds", "width": 0.001}], wall)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty"),
        (
            "joint,width [mm],uncertainty\nvoussoir 1 | voussoir 2,6.2,0.3\n",
            r"line 2: uncertainty is 0.3 m, and the largest .* 0.0062 m: .* name the column uncertainty \[mm\]",
        ),
        ("joint,width\n", "has no observation"),
        (
            "date,joint,width [mm]\n2024,voussoir 1 | voussoir 2,1.3\n2025,voussoir 2 | voussoir 1,3.3\n",
            r"line 3: width \[mm\] is of voussoir 2 \| voussoir 1, as that of line 2 is; give one width for each place",
        ),
        (
            "date,block,dx [mm],dy [mm]\n2024,left springer,0,-3\n2024,voussoir 1,0,1\n2025,left springer,0,-9\n",
            r"line 4: dx \[mm\] is of 'left springer' at \(.*\) m, as that of line 2 is; give one displacement for "
            "each point, of one date",
        ),
        (
            "block,x,y,displaced_x,displaced_y\nvoussoir 4,0.3,1,0.301,1\n,0.3,1,0.302,1\n",
            r"line 3: displaced_x is of 'voussoir 4' at \(0.3, 1\) m, as that of line 2 is",
        ),
        ("joint\nvoussoir 3 | voussoir 4\n", "has no column 'width'; its columns are 'joint'"),
        ("width\n0.003\n", "has no column 'joint'"),
        ("block_a,width\nvoussoir 3,0.003\n", "has no column 'block_b'"),
        ("x,width\n0,0.003\n", "has no column 'y'"),
        ("joint,widht\na | b,1\n", r"column 'widht' is not known \(did you mean 'width'\?\)"),
        ("joint,width,opening\na | b,1,1\n", "columns 'width' and 'opening' hold the same"),
        ("joint,width [inch]\na | b,1\n", "has the unit 'inch'; lengths are in m, cm, mm"),
        (f"joint,width\n{CROWN},-0.001\n", "line 2: width is -0.001; give a width of at least 0"),
        (f"joint,width\n{CROWN},wide\n", "line 2: width is 'wide'; give a number"),
        (f"joint,width\n{CROWN},nan\n", "line 2: width is nan; give a finite number"),
        (f"joint,width\n{CROWN},\n", "line 2: width is missing"),
        (f"joint,width\n{CROWN},4.5\n", "is it in mm"),
        (f"joint,width,uncertainty\n{CROWN},0.004,0\n", "uncertainty is 0; give a number above 0"),
        (f"joint,width\n{CROWN},0\n", "nothing has opened or moved"),
        ("joint,width\nvoussoir 3,0.004\n", 'name two blocks as "A | B"'),
        ("joint,width\nvousoir 3 | voussoir 4,0.004\n", r"'vousoir 3' is no block \(did you mean 'voussoir \d'\?\)"),
        ("joint,width\nvoussoir 1 | voussoir 4,0.004\n", "do not touch; 'voussoir 1' touches"),
        ("x,y,width\n1000,1,0.004\n", "m from any joint"),
        (f"joint,x,y,width\n{CROWN},100,300,0.001\n", r"m from 'voussoir 3 \| voussoir 4'; the blocks lie"),
        ("block,x,y,dx [mm],dy [mm]\nvoussoir 4,130,990,1,2\n", r"x and y are \(130, 990\) m, .* m from 'voussoir 4'"),
        ("x,y,dx [mm],dy [mm]\n30,2,1,2\n", "m from any block; the blocks lie between .* check the unit"),
        ("x,y,width\n,1,0.004\n", "line 2: x is missing"),
        ("block,dx,dy\nvoussoir 1,0.1,\n", "dy is missing; give both"),
        ("block,x,y,dx,dy\n,,,0.1,0.1\n", "block is missing"),
    ],
)
def test_what_cannot_be_used_is_named(tmp_path, text, words):
    with pytest.raises(ValueError, match=words):
        table(tmp_path, text)


def test_a_missing_file_names_those_beside_it(tmp_path):
    (tmp_path / "cracks.csv").write_text("x", encoding="utf-8")
    with pytest.raises(ValueError, match=r"no observations '.*crack\.csv'; beside it are cracks\.csv"):
        read_observations(tmp_path / "crack.csv", ARCH)


def test_a_file_of_another_kind_is_no_table(tmp_path):
    (tmp_path / "photo.jpg").write_bytes(b"\xff\xd8\xff\xe0")
    with pytest.raises(ValueError, match="is no table in UTF-8"):
        read_observations(tmp_path / "photo.jpg", ARCH)


def lifted():
    pose = solver.Pose.initial(ARCH)
    right = ARCH.centroids[:, 0] > 0.0
    pose.positions[right] += [0.004, 0.0]
    pose.rotations[ARCH.index("voussoir 6")] -= 0.01
    return pose


@pytest.mark.parametrize("renamed", [False, True])
def test_a_drawing_of_the_damaged_state_gives_widths_and_displacements(tmp_path, renamed):
    path = tmp_path / "damaged.json"
    if renamed:
        corners = corners_of(lifted())
        drawn(path, corners[::-1], [f"stone {k}" for k in range(len(corners))[::-1]])
    else:
        save_layout(ARCH, path, pose=lifted())
    found = read_observations(path, ARCH)
    wide = dict(zip(found.labels, found.widths.tolist(), strict=True))
    crown = next(width for label, width in wide.items() if set(label.split(" | ")) == set(CROWN.split(" | ")))
    assert crown == pytest.approx(0.004, abs=2e-5)
    moved = dict(zip(found.blocks, found.displacements.tolist(), strict=True))
    assert moved["voussoir 4"] == pytest.approx([0.004, 0.0], abs=2e-5)
    assert moved["voussoir 3"] == pytest.approx([0.0, 0.0], abs=2e-5)
    assert found.widths[[k for k, label in enumerate(found.labels) if "voussoir 6" in label]].max() > 1e-3


def corners_of(pose):
    return np.split(mechanics.moved_vertices(ARCH, pose), ARCH.offsets[1:-1])


def test_joints_of_a_drawing_that_are_closed_but_for_rounding_are_closed(tmp_path):
    rounded = [np.round(ring, 5) for ring in corners_of(lifted())]
    found = read_observations(drawn(tmp_path / "damaged.json", rounded, ARCH.names), ARCH)
    open_ones = [label for label, width in zip(found.labels, found.widths, strict=True) if width > 0.0]
    assert len(open_ones) == 3
    assert all({"voussoir 4", "voussoir 6"} & {*label.split(" | ")} for label in open_ones)


@pytest.mark.parametrize("shift", [(100.0, 5.0), (0.3, 0.0)])
def test_a_drawing_with_another_origin_is_refused(tmp_path, shift):
    path = drawn(tmp_path / "damaged.json", [ring + shift for ring in corners_of(lifted())], ARCH.names)
    with pytest.raises(ValueError, match=r"its blocks, supports too, lie about \(.*\) m beside those of the case"):
        read_observations(path, ARCH)


def test_a_drawing_of_what_moved_nearly_as_one_beside_a_support_is_taken(tmp_path):
    """The support that stands has moved by rounding."""
    pose = solver.Pose.initial(ARCH)
    pose.positions[:] += [0.02, 0.0]
    pose.positions[ARCH.index("left springer")] -= [0.0199, 0.0]
    found = read_observations(drawn(tmp_path / "damaged.json", corners_of(pose), ARCH.names), ARCH)
    assert found.largest == pytest.approx(0.02)


@pytest.mark.parametrize(
    ("one", "other", "words"),
    [
        ("voussoir 1", "voussoir 5", r"'voussoir 1' 1.\d+ m, 'voussoir 5' 1.\d+ m from where the case draws it"),
        ("voussoir 3", "voussoir 4", "'voussoir 3' where 'voussoir 4' lies, 'voussoir 4' where 'voussoir 3'"),
    ],
)
def test_a_drawing_whose_names_are_swapped_is_refused(tmp_path, one, other, words):
    swapped = {one: other, other: one}
    names = [swapped.get(name, name) for name in ARCH.names]
    path = drawn(tmp_path / "damaged.json", corners_of(lifted()), names)
    with pytest.raises(ValueError, match=f"puts {words}"):
        read_observations(path, ARCH)


def test_a_drawing_of_small_stones_that_have_moved_far_is_taken(tmp_path):
    """A support may move by more than the stones on it are large."""
    wall = generators.wall(bricks=8, courses=6, brick_length=0.2, brick_height=0.1)
    away = 1.8 * wall.block_size
    pose = solver.Pose.initial(wall)
    pose.positions[wall.centroids[:, 0] > np.median(wall.centroids[:, 0])] += [away, 0.0]
    corners = np.split(mechanics.moved_vertices(wall, pose), wall.offsets[1:-1])
    found = read_observations(drawn(tmp_path / "damaged.json", corners, wall.names), wall)
    assert np.linalg.norm(found.displacements, axis=1).max() == pytest.approx(away)


def test_a_stone_that_has_fallen_in_a_drawing_without_names_is_paired_with_none(tmp_path):
    """Both joints beside it would have opened by more than a block is wide."""
    pose = lifted()
    pose.positions[ARCH.index("voussoir 3")] -= [0.0, 1.5 * ARCH.block_size]
    corners = corners_of(pose)
    path = drawn(tmp_path / "damaged.json", corners, [f"stone {k}" for k in range(len(corners))])
    with pytest.warns(UserWarning, match=r"1 block of the case is not in it .*'voussoir 3'.*; 1 of .*'stone 2'"):
        found = read_observations(path, ARCH)
    assert "voussoir 3" not in found.blocks
    assert found.largest < 0.1 * ARCH.block_size


def test_a_drawing_of_something_else_is_refused(tmp_path):
    save_layout(generators.wall(bricks=2, courses=2, brick_length=0.05, brick_height=0.02), tmp_path / "other.json")
    with pytest.raises(ValueError, match=r"of its . blocks? none is one of the case"):
        read_observations(tmp_path / "other.json", generators.arch(radius=30.0))


def test_widths_at_the_middles_of_joints_are_noted(tmp_path, recwarn):
    table(tmp_path, "x,y,width [mm]\n0,1.07,3\n-0.81,0.47,2\n0.5,0.866,closed\n")
    assert not recwarn.list
    with pytest.warns(UserWarning, match=r"2 of 3 widths are given at the middle of a joint .* name the joint instead"):
        table(tmp_path, "x,y,width [mm]\n0,1.0,3\n-0.87,0.5,2\n0.53,0.92,1\n")


def test_a_place_far_away_is_told_in_one_sentence(tmp_path):
    with pytest.raises(ValueError, match=r"line 2: x and y are \(1445, 293\) m, .* from any joint"):
        table(tmp_path, "x,y,width\n1445,293,0.003\n")


def test_an_observation_of_one_of_several_blocks_with_its_name_needs_a_place(tmp_path):
    row = [[[k, 0], [k + 1, 0], [k + 1, 1], [k, 1]] for k in range(3)]
    assembly = solver.Assembly.from_outlines(row, names=["a", "cap", "cap"])
    (tmp_path / "seen.csv").write_text("block,dx,dy\ncap,0.01,0\n", encoding="utf-8")
    with pytest.raises(ValueError, match="'cap' is the name of 2 blocks; leave it out and give the place"):
        read_observations(tmp_path / "seen.csv", assembly)
