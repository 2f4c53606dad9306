"""Crack lines: which joints they hold, how wide, how steep and from where to where."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
import structures
from structures import report_of

import blockvis
import solver
from blockvis.layout.layout import layout_of, standing
from blockvis.results.cracks import crack_rows, cracks_of
from blockvis.text import width_text


def moved(assembly, **motions):
    """The pose in which blocks, by their names with _ for a space, have moved and turned."""
    pose = solver.Pose.initial(assembly)
    for name, (dx, dy, turn) in motions.items():
        block = assembly.index(name.replace("_", " ").replace("N", "-"))
        pose.positions[block] += dx, dy
        pose.rotations[block] += turn
    return pose


def squares(*corners, size=1.0):
    outlines = [[[x, y], [x + size, y], [x + size, y + size], [x, y + size]] for x, y in corners]
    return solver.Assembly.from_outlines(outlines)


def test_nothing_that_has_not_moved_is_cracked():
    wall = structures.wall(4, 3)
    assert cracks_of(wall, solver.Pose.initial(wall)) == []


def test_a_block_that_is_lifted_leaves_a_level_crack():
    assembly = squares((0, 0), (0, 1), (1, 0))
    (crack,) = cracks_of(assembly, moved(assembly, block_1=(0.0, 0.01, 0.0)))
    assert crack.width == pytest.approx(0.01)
    assert set(crack.widest.split(" | ")) == {"block 0", "block 1"}
    assert crack.inclination == pytest.approx(0.0)
    np.testing.assert_allclose(crack.ends, [[0, 1], [1, 1]], atol=1e-12)
    assert crack.size == pytest.approx(1.0)


def test_a_stepped_crack_is_one_line_through_joints_that_only_slide():
    """Two courses in running bond; their right ends go: two head joints open, the bed joint between them slides."""
    outlines = [
        [[0, 0], [2, 0], [2, 1], [0, 1]],
        [[2, 0], [4, 0], [4, 1], [2, 1]],
        [[0, 1], [3, 1], [3, 2], [0, 2]],
        [[3, 1], [4, 1], [4, 2], [3, 2]],
    ]
    assembly = solver.Assembly.from_outlines(outlines)
    (crack,) = cracks_of(assembly, moved(assembly, block_1=(0.02, 0.0, 0.0), block_3=(0.02, 0.0, 0.0)))
    assert crack.width == pytest.approx(0.02)
    np.testing.assert_allclose(crack.ends, [[2, 0], [3, 2]], atol=1e-12)
    assert crack.inclination == pytest.approx(np.degrees(np.arctan2(2, 1)))
    assert len(crack.joints) == 3


def test_cracks_apart_are_lines_of_their_own_the_widest_first():
    assembly = squares((0, 0), (0, 1), (5, 0), (5, 1))
    cracks = cracks_of(assembly, moved(assembly, block_1=(0, 0.01, 0), block_3=(0, 0.03, 0)))
    assert [round(crack.width, 6) for crack in cracks] == [0.03, 0.01]
    words = crack_rows(cracks, 1)
    assert words[0][1].startswith("30 mm at block")
    assert words[1] == ("and", "1 narrower ones")


def test_the_cracks_of_an_arch_are_its_hinges(tmp_path):
    arch = structures.arch_response()
    cracks = cracks_of(arch.assembly, arch.path[-1].pose)
    assert len(cracks) >= 3
    assert all(crack.size == pytest.approx(0.15, rel=0.01) for crack in cracks)
    blockvis.write(arch, tmp_path / "out")
    stored = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["cracks"]
    assert [c["width_mm"] for c in stored] == pytest.approx([1e3 * c.width for c in cracks], abs=1e-3)
    assert stored[0]["widest_joint"] == cracks[0].widest
    # Places are numbers that can be read: 0, not 5.66e-17.
    assert not re.search(r"\de-\d", " ".join(words for _, words in crack_rows(cracks, len(cracks))))
    page = report_of(arch)
    assert f"{width_text(cracks[0].width)} at {cracks[0].widest}" in page


def test_every_key_of_a_crack_is_named_in_the_manual():
    assembly = squares((0, 0), (0, 1))
    (crack,) = cracks_of(assembly, moved(assembly, block_1=(0, 0.01, 0)))
    manual = (structures.Path(__file__).parents[2] / "docs" / "results.md").read_text(encoding="utf-8")
    assert [key for key in crack.values() if f"`{key}`" not in manual] == []


def in_space(flat, depth):
    """The same blocks in space, upright, as deep everywhere."""
    sketch = replace(layout_of(flat), thickness=None)
    return solver.Assembly.from_solids(standing(sketch, depth).solids)


def test_a_stepped_crack_in_space_is_that_of_the_plane():
    outlines = [
        [[0, 0], [2, 0], [2, 1], [0, 1]],
        [[2, 0], [4, 0], [4, 1], [2, 1]],
        [[0, 1], [3, 1], [3, 2], [0, 2]],
        [[3, 1], [4, 1], [4, 2], [3, 2]],
    ]
    flat = solver.Assembly.from_outlines(outlines)
    solid = in_space(flat, 0.5)
    (crack,) = cracks_of(solid, moved_in_space(solid, {1: (0.02, 0.0, 0.0), 3: (0.02, 0.0, 0.0)}))
    assert crack.width == pytest.approx(0.02)
    assert len(crack.joints) == 3
    assert crack.size == pytest.approx(3 * 0.5)
    values = crack.values()
    assert values["area"] == pytest.approx(1.5)
    assert (values["from"][0], values["from"][2], values["to"][0], values["to"][2]) == (2.0, 0.0, 3.0, 2.0)
    assert crack.inclination == pytest.approx(np.degrees(np.arctan2(2.0, np.hypot(1.0, 0.5))))
    assert "1.5 m², 61°, from (2, " in crack_rows([crack], 1)[0][1]


def test_joints_that_part_otherwise_are_cracks_of_their_own():
    """A block that stays, one that goes up from it and one that goes aside: their joints meet at an edge."""
    flat = squares((0, 0), (0, 1), (1, 0))
    solid = in_space(flat, 1.0)
    cracks = cracks_of(solid, moved_in_space(solid, {1: (0.0, 0.0, 0.01), 2: (0.02, 0.0, 0.0)}))
    assert [round(crack.width, 9) for crack in cracks] == [0.02, 0.01]
    assert cracks_of(solid, solver.Pose.initial(solid)) == []


def moved_in_space(assembly, motions):
    """The pose in which blocks, by their numbers, have moved."""
    pose = solver.Pose.initial(assembly)
    for block, by in motions.items():
        pose.positions[block] += by
    return pose


def test_cracks_that_fork_and_turn_are_told_one_by_one():
    """A wall of squares whose upper right goes up and right: a level crack that turns upwards, and a branch."""
    wall = squares(*((x, y) for y in range(6) for x in range(6)))
    lifted = {f"block_{6 * y + x}": (0.02 if x >= 3 else 0.0, 0.03, 0.0) for y in range(3, 6) for x in range(6)}
    cracks = cracks_of(wall, moved(wall, **lifted))
    level = [crack for crack in cracks if crack.inclination < 1.0]
    upright = [crack for crack in cracks if abs(crack.inclination - 90.0) < 1.0]
    assert len(cracks) == len(level) + len(upright)
    assert len(upright) == 1
    assert upright[0].size == pytest.approx(3.0)
    assert upright[0].width == pytest.approx(0.02)
    assert upright[0].places[1] == "the top"
    # The branch of the larger area goes on where they meet.
    assert sum(crack.size for crack in level) == pytest.approx(6.0)
    assert {place for crack in level for place in crack.places} >= {"the left edge", "the right edge"}
    assert sum(len(crack.joints) for crack in cracks) == 9


def test_places_are_told_by_openings():
    """A ring of squares around a window whose right column goes."""
    wall = squares(*((x, y) for y in range(3) for x in range(3) if (x, y) != (1, 1)))
    column = {f"block_{number}": (0.02, 0.0, 0.0) for number in (2, 4, 7)}
    above, below = sorted(cracks_of(wall, moved(wall, **column)), key=lambda crack: -crack.at[1])
    assert above.places == ("the upper right corner of the opening", "the top")
    assert below.places[1] == "the lower right corner of the opening"
