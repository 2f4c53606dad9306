"""Joints, cracks, hinges, resultants and the parts of a mechanism: what is marked, and how it is counted."""

import base64
import csv
import json
import re
import zlib
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely
import structures
from hypothesis import given
from hypothesis import strategies as st
from structures import (
    BENT,
    arch_response,
    brick,
    dropped_brick,
    portal_response,
    rectangle,
    report_of,
    stacked,
    vault_response,
    wall,
)

import blockvis
import solver
from blockvis import generators
from blockvis.cli import _in_words
from blockvis.pictures import marks
from blockvis.pictures.hatching import hatched
from blockvis.pictures.swing import swing_of
from blockvis.report.page import summary_rows
from blockvis.results.cracks import crack_rows, cracks_of
from blockvis.results.joints import initial_joints
from blockvis.results.mechanism_arrays import corner_speeds, swing_factors, swung_increment
from blockvis.text import rounded_length, width_text
from solver import mechanics


def all_cracks(assembly, pose):
    fallen = np.zeros(assembly.n_blocks, dtype=bool)
    return marks.cracks_between(assembly, initial_joints(assembly), pose, pose, fallen)


def cracks(assembly, pose):
    return all_cracks(assembly, pose)[0]


def test_one_joint_between_two_full_faces():
    assembly, _ = stacked()
    joints = initial_joints(assembly)
    assert len(joints.block_a) == 1
    assert {int(joints.block_a[0]), int(joints.block_b[0])} == {0, 1}
    assert np.sort(joints.ends[0, :, 0]).tolist() == [0.0, 1.0]
    assert joints.ends[0, :, 1].tolist() == [1.0, 1.0]


def test_joints_of_a_running_bond_wall_are_counted():
    assembly = wall(4, 2)
    joints = initial_joints(assembly)
    # Lower course of 4: three heads; upper course of 5 (halves at the ends): four heads; 8 beds between them,
    # since joints alternate; the 4 lower bricks stand on a footing each, the split falls on a head joint.
    assert len(joints.block_a) == 3 + 4 + 8 + 4


def test_a_lifted_block_leaves_a_crack_of_its_size():
    found = cracks(*stacked(shift=(0.0, 0.05)))
    assert len(found) == 1
    np.testing.assert_allclose(shapely.Polygon(found[0]).area, 0.05, rtol=1e-9)


def test_sliding_and_pressing_leave_none():
    assert len(cracks(*stacked(shift=(0.2, 0.0)))) == 0
    assert len(cracks(*stacked(shift=(0.0, -0.05)))) == 0


def test_where_blocks_lie_in_each_other_there_is_no_crack():
    """Turned about the middle of its face: only the half that gapes is a crack."""
    found = cracks(*stacked(shift=(-0.5 * np.sin(0.2), 0.5 * np.cos(0.2) - 0.5), turn=0.2))
    assert len(found) == 1
    np.testing.assert_allclose(shapely.Polygon(found[0]).area, 0.125 * np.sin(0.2), rtol=0.05)


def test_blocks_that_have_parted_have_no_joint():
    assert len(cracks(*stacked(shift=(0.0, 1.6)))) == 0
    assert len(cracks(*stacked(shift=(0.0, 0.4)))) == 1
    assert len(cracks(*stacked(shift=(0.0, 0.6)))) == 0
    assert len(cracks(*stacked(shift=(0.1, 0.3), turn=0.3))) == 1


def test_of_a_wedge_that_gapes_only_the_faces_are_marked():
    def marked(turn):
        c, s = np.cos(turn), np.sin(turn)
        # Rocked about the lower left corner.
        assembly, pose = stacked(shift=(0.5 * c - 0.5 * s - 0.5, 0.5 * s + 0.5 * c - 0.5), turn=turn)
        found, _, gapes, _ = all_cracks(assembly, pose)
        return np.count_nonzero(~gapes), found[gapes]

    assert marked(0.3)[0] == 1
    count, gaping = marked(0.8)
    assert count == 0
    ends = gaping.reshape(-1, 2)
    assert np.hypot(*(ends - [0.0, 1.0]).T).min() < 1e-9
    assert np.hypot(*(ends - [np.cos(0.8), 1.0 + np.sin(0.8)]).T).min() < 1e-9


def four_blocks(apart):
    """Four blocks of 1 m × 1 m around a point, each moved away from it along the diagonal."""
    corners = [(0, 0), (1, 0), (0, 1), (1, 1)]
    assembly = solver.Assembly.from_outlines(
        [[[x, y], [x + 1, y], [x + 1, y + 1], [x, y + 1]] for x, y in corners], roles=["free"] * 3 + ["fixed"]
    )
    away = apart * (2.0 * np.array(corners) - 1.0)
    return assembly, solver.Pose(assembly.centroids + away, np.zeros((4, 1)))


@pytest.mark.slow
@given(st.floats(0.01, 0.2))
def test_the_pocket_where_four_cracks_meet_is_air(apart):
    assembly, pose = four_blocks(apart)
    found, openings, *_ = all_cracks(assembly, pose)
    assert len(found) == 4
    np.testing.assert_allclose(openings, 2.0 * apart, rtol=1e-9)
    covered = shapely.union_all([shapely.Polygon(crack) for crack in found])
    assert not covered.contains(shapely.Point(1.0, 1.0))
    # Each crack is as long as the faces beside it, and nothing beyond them has its colour.
    np.testing.assert_allclose(covered.area, 4 * 2.0 * apart, rtol=1e-9)


@pytest.mark.slow
def test_a_joint_that_slides_on_one_point_is_marked_over_a_length():
    response = arch_response()
    last, joints = response.path[-1], initial_joints(response.assembly)
    fastest = np.abs(last.velocity[:, :2]).max()
    along = np.zeros_like(last.displacements)
    along[np.flatnonzero(last.forces[:, 0] > 0)[::2], 1] = fastest
    sliding = last.with_arrays(displacements=along)
    lines = marks.marks_of(response.assembly, joints, sliding, last.pose).sliding
    lengths = np.hypot(*(lines[:, 1] - lines[:, 0]).T)
    assert len(lines) > 0
    assert lengths.min() >= 0.3 * response.assembly.block_size * (1 - 1e-9)


@pytest.mark.thorough
def test_the_mark_of_a_brick_that_slides_beside_a_large_stone_stays_with_the_brick():
    response = dropped_brick()
    assembly, last = response.assembly, response.path[-1]
    falls = mechanics.with_motion(last, response.collapse.mechanism)
    lines = marks.marks_of(assembly, initial_joints(assembly), falls, last.pose).sliding
    assert len(lines) == 1
    assert np.hypot(*(lines[0, 1] - lines[0, 0])) <= 0.2, "the brick is 0.2 m thick, the stone 4 m wide"


@pytest.mark.slow
def test_joints_that_hardly_slide_are_not_marked():
    response = arch_response()
    last, joints = response.path[-1], initial_joints(response.assembly)
    used_up = np.stack([last.forces[:, 0], last.friction * last.forces[:, 0]], axis=1)
    fastest = np.abs(last.velocity[:, :2]).max()
    for slip, drawn in ((0.5, True), (1e-4, False)):
        along = np.tile([0.0, slip * fastest], (len(last.contacts), 1))
        sliding = last.with_arrays(forces=used_up, displacements=along)
        assert (sliding.states == mechanics.ContactState.SLIDING).any()
        assert (len(marks.marks_of(response.assembly, joints, sliding, last.pose).sliding) > 0) is drawn


@pytest.mark.slow
def test_resultants_balance_every_voussoir():
    response = arch_response()
    increment, assembly = response.path[-1], response.assembly
    _, forces, blocks = marks.resultants(increment)
    total = np.zeros((assembly.n_blocks, 2))
    np.add.at(total, blocks[:, 0], forces)
    np.subtract.at(total, blocks[:, 1], forces)
    weight = assembly.masses * solver.GRAVITY
    np.testing.assert_allclose(total[assembly.free, 1], weight[assembly.free], rtol=1e-6)
    assert len(forces) == 13


def corbel_on_a_wall():
    """A stone glued to a wall, a second glued to its underside, a third on a moving support."""
    boxes = {"wall": (-1, -1, 0, 1), "ground": (3, -1, 4, 0), "corbel": (0, 0, 0.5, 0.5), "hanger": (0.1, -0.4, 0.4, 0)}
    outlines = [[(x, y), (u, y), (u, v), (x, v)] for x, y, u, v in (*boxes.values(), (3, 0, 4, 0.5))]
    assembly = solver.Assembly.from_outlines(
        outlines, names=[*boxes, "block"], roles=["fixed", "moving", *["free"] * 3], density=2000.0
    )
    law = solver.InterfaceLaw(0.6, cohesion=2e5, tensile_strength=1e5)
    sinks = solver.Settlement(direction=(0, -1), increment=0.01, limit=0.01)
    return solver.settle(assembly, sinks, interfaces=solver.Interfaces(law))


def test_resultants_of_mortar_that_is_bent_and_pulled_balance_the_stones():
    response = corbel_on_a_wall()
    increment, assembly = response.path[-1], response.assembly
    points, forces, blocks = marks.resultants(increment)
    weight = assembly.masses * solver.GRAVITY
    told = {
        tuple(assembly.names[k] for k in pair): (point, force)
        for pair, point, force in zip(blocks, points, forces, strict=True)
    }
    place, force = told["corbel", "hanger"]
    np.testing.assert_allclose(force, [0.0, -weight[3]], atol=1e-6 * weight[3])
    np.testing.assert_allclose(place, [0.25, 0.0], atol=1e-9)
    # Sheared and bent: what presses below pulls above, and the resultant never crosses the joint.
    place, force = told["wall", "corbel"]
    np.testing.assert_allclose(force, [0.0, -weight[2] - weight[3]], atol=1e-6 * weight[3])
    np.testing.assert_allclose(place, [0.0, 0.25], atol=1e-9)
    points, forces, _ = marks.joint_forces(increment, "points")
    np.testing.assert_allclose(forces[points[:, 0] < 1.0][:, 1].sum(), weight[2] + 2.0 * weight[3])
    contacts = response.contacts(-1)
    assert contacts["carries"][contacts["normal_force"] < -1.0].all()


def test_the_thrust_line_of_an_arch_with_mortar_leaves_the_stones():
    law = solver.InterfaceLaw(0.6, cohesion=2e5, tensile_strength=1e5)
    spread = solver.Settlement(direction=(1, 0), increment=0.002, limit=0.002)
    response = solver.settle(generators.arch(thickness_ratio=0.15), spread, interfaces=solver.Interfaces(law))
    increment, assembly = response.path[-1], response.assembly
    points, forces, blocks = marks.resultants(increment)
    total = np.zeros((assembly.n_blocks, 3))
    for sense, of in ((1.0, blocks[:, 0]), (-1.0, blocks[:, 1])):
        arms = points - increment.pose.positions[of]
        moments = arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0]
        np.add.at(total, of, sense * np.column_stack([forces, moments]))
    weight = assembly.masses * solver.GRAVITY
    expected = np.outer(weight, [0.0, 1.0, 0.0])
    np.testing.assert_allclose(total[assembly.free], expected[assembly.free], atol=1e-6 * weight.sum())
    assert increment.forces[:, 0].min() < -100.0


def test_arch_spreads_on_three_hinges_and_falls_on_five():
    response = arch_response()
    last, joints = response.path[-1], initial_joints(response.assembly)
    spreading = marks.marks_of(response.assembly, joints, last, last.pose)
    assert len(spreading.hinges) == 3
    falling = mechanics.with_motion(last, response.collapse.mechanism)
    assert len(marks.marks_of(response.assembly, joints, falling, last.pose).hinges) == 5
    parts = mechanics.rigid_parts(response.assembly, falling)
    assert sorted(np.bincount(parts[parts >= 0]).tolist()) == [2, 2, 4, 4]
    assert (parts[~response.assembly.free] == -1).all()


def test_parts_swing_as_one_body():
    response = arch_response()
    falling = mechanics.with_motion(response.path[-1], response.collapse.mechanism)
    parts = mechanics.rigid_parts(response.assembly, falling)
    displaced = swung_increment(falling, 0.1 * response.collapse.mechanism).pose
    outlines = marks.part_outlines(response.assembly, mechanics.moved_vertices(response.assembly, displaced), parts)
    length = np.hypot(*(outlines[:, 1] - outlines[:, 0]).T).sum()
    before = marks.part_outlines(response.assembly, mechanics.moved_vertices(response.assembly, falling.pose), parts)
    np.testing.assert_allclose(length, np.hypot(*(before[:, 1] - before[:, 0]).T).sum(), rtol=1e-2)


def test_a_sinking_stack_is_one_part():
    outlines = [brick(x, y, 1.0, 1.0) for x in (0.0, 1.5) for y in (-1.0, 0.0, 1.0)]
    roles = ["fixed", "free", "free", "moving", "free", "free"]
    stacks = solver.Assembly.from_outlines(outlines, roles=roles)
    sinks = solver.Settlement(direction=(0.0, -1.0), increment=0.01, limit=0.01)
    for increment in solver.settle(stacks, sinks).path:
        assert mechanics.rigid_parts(stacks, increment).tolist() == [-1, -1, -1, -1, 0, 0]


def test_hatch_stays_inside_the_support():
    lines = hatched(shapely.Polygon(BENT["U"]), 0.1, 1.0)
    assert len(lines) > 10
    middles = lines.mean(axis=1)
    notch = (middles[:, 0] > 5.001) & (middles[:, 0] < 5.999) & (middles[:, 1] > 1.001)
    assert not notch.any()
    assert lines.min() >= -1e-9


@given(st.floats(1e-9, 1e9))
def test_round_lengths_are_round_and_not_longer(length):
    round_length = rounded_length(length)
    assert round_length <= length * (1 + 1e-6)
    assert round_length > 0.39 * length
    assert f"{round_length:.0e}"[0] in "125"


@given(st.floats(-3, 3), st.floats(-10, 10), st.floats(-10, 10))
def test_carried_there_and_back(turn, x, y):
    before = solver.Pose(np.array([[1.0, 2.0]]), np.array([[0.3]]))
    after = solver.Pose(np.array([[x, y]]), np.array([[turn]]))
    point = np.array([[0.7, -0.4]])
    there = mechanics.carried(point, np.array([0]), before, after)
    np.testing.assert_allclose(mechanics.carried(there, np.array([0]), after, before), point, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("response_of", [arch_response, vault_response], ids=["plane", "space"])
def test_a_mechanism_that_rises_swings_as_far_as_it_is_to(response_of):
    response = response_of()
    assembly, last = response.assembly, response.path[-1]
    up = np.zeros_like(last.velocity)
    up[assembly.free, assembly.dimension - 1] = 3.0
    state = mechanics.with_motion(last, up)
    np.testing.assert_allclose(corner_speeds(assembly, last.pose, up), np.where(assembly.free, 3.0, 0.0))
    free = assembly.free[assembly.block_of_vertex]
    extent = np.ptp(mechanics.moved_vertices(assembly, last.pose)[free], axis=0).max()
    for share, factor in zip((0.5, 1.0), swing_factors(assembly, state, 0.1, np.array([0.5, 1.0])), strict=True):
        frame = swung_increment(state, factor * state.velocity)
        rise = (frame.pose.positions - last.pose.positions)[assembly.free]
        np.testing.assert_allclose(rise[:, -1], 0.1 * share * extent)
        np.testing.assert_allclose(rise[:, :-1], 0.0, atol=1e-12)
        assert frame.status == solver.Status.FALLING
    at_rest = mechanics.with_motion(last, np.zeros_like(up))
    assert swing_factors(assembly, at_rest, 0.1, np.ones(1)).tolist() == [0.0]


def moved(assembly, **motions):
    """The pose in which blocks, by their names with _ for a space, have moved and turned."""
    pose = solver.Pose.initial(assembly)
    for name, (dx, dy, turn) in motions.items():
        block = assembly.index(name.replace("_", " ").replace("N", "-"))
        pose.positions[block] += dx, dy
        pose.rotations[block] += turn
    return pose


def squares(*corners, size=1.0):
    width, height = np.broadcast_to(size, 2)
    outlines = [[[x, y], [x + width, y], [x + width, y + height], [x, y + height]] for x, y in corners]
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


#: Two stones of running bond, and two above.
TWO_COURSES = [rectangle(0, 0, 2, 1), rectangle(2, 0, 4, 1), rectangle(0, 1, 3, 2), rectangle(3, 1, 4, 2)]


def test_a_stepped_crack_is_one_line_through_joints_that_only_slide():
    """Two courses in running bond; their right ends go: two head joints open, the bed joint between them slides."""
    assembly = solver.Assembly.from_outlines(TWO_COURSES)
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
    assert words[1] == ("and", "1 narrower one")


@pytest.mark.thorough
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
    rings = np.split(flat.vertices, flat.offsets[1:-1])
    return solver.Assembly.from_solids([structures.upright(ring, 0.0, depth) for ring in rings])


def test_a_stepped_crack_in_space_is_that_of_the_plane():
    solid = in_space(solver.Assembly.from_outlines(TWO_COURSES), 0.5)
    (crack,) = cracks_of(solid, moved_in_space(solid, {1: (0.02, 0.0, 0.0), 3: (0.02, 0.0, 0.0)}))
    assert crack.width == pytest.approx(0.02)
    assert len(crack.joints) == 3
    assert crack.size == pytest.approx(3 * 0.5)
    values = crack.values()
    assert values["area"] == pytest.approx(1.5)
    assert (values["from"][0], values["from"][2], values["to"][0], values["to"][2]) == (2.0, 0.0, 3.0, 2.0)
    # However thick the wall is.
    assert crack.inclination == pytest.approx(np.degrees(np.arctan2(2, 1)))
    assert "1.5 m², 63°, from (2, " in crack_rows([crack], 1)[0][1]


@pytest.mark.parametrize("depth", [0.1, 1.0, 3.0])
def test_a_joint_in_space_is_as_steep_as_its_plane_not_its_diagonal(depth):
    solid = in_space(
        solver.Assembly.from_outlines([structures.rectangle(0, 0, 1, 1), structures.rectangle(1, 0, 2, 1)]), depth
    )
    (head,) = cracks_of(solid, moved_in_space(solid, {1: (0.02, 0.0, 0.0)}))
    assert head.inclination == pytest.approx(90.0)
    solid = in_space(
        solver.Assembly.from_outlines([structures.rectangle(0, 0, 1, 1), structures.rectangle(0, 1, 1, 2)]), depth
    )
    (bed,) = cracks_of(solid, moved_in_space(solid, {1: (0.0, 0.0, 0.02)}))
    assert bed.inclination == pytest.approx(0.0, abs=1e-6)


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


SINKS = (0.0, -1.0)


@cache
def facade():
    bricks = {"bricks": 14, "courses": 24, "storeys": 1, "windows": 1, "window_bricks": 3, "voussoirs": 3}
    sinks = solver.Settlement(direction=SINKS, increment=0.01, limit=0.04)
    return solver.settle(generators.build("facade", bricks), sinks, friction_coefficient=0.6)


RESPONSES = {"portal frame": portal_response, "semicircular arch": arch_response, "small façade": facade}

#: The façade takes as long as all others together.
MARKS = {"portal frame": pytest.mark.thorough, "small façade": pytest.mark.slow}
EACH = pytest.mark.parametrize("name", [pytest.param(name, marks=MARKS.get(name, ())) for name in RESPONSES])


def counted(response, increment):
    mechanism = mechanics.mechanism_of(response.assembly, increment)
    return len(mechanism.hinges), len(mechanism.sliding)


def in_words(text):
    """Hinges and sliding joints of a sentence: "hinges at a | b, c | d and 3 more; sliding at e | f"."""
    counts = []
    for what in ("hinges?", "sliding"):
        found = re.search(rf"(?:^|; ){what} at (.*?)(?: and (\d+) more)?(?=;|$)", text)
        counts.append(0 if found is None else found[1].count(" | ") + int(found[2] or 0))
    return tuple(counts)


def unpacked(table):
    planes = np.frombuffer(zlib.decompress(base64.b64decode(table["data"])), dtype=np.uint8)
    steps = planes.reshape(4, -1).T.copy().view("<i4").reshape(table["rows"], table["columns"])
    return np.cumsum(steps, axis=0)


@pytest.mark.thorough
@EACH
def test_every_increment_has_one_count(name, tmp_path):
    response = RESPONSES[name]()
    expected = [counted(response, increment) for increment in response.increments]
    assert max(hinges for hinges, _ in expected) > 0
    joints = initial_joints(response.assembly)
    for increment, (hinges, sliding) in zip(response.increments, expected, strict=True):
        words = str(mechanics.mechanism_of(response.assembly, increment))
        assert in_words(words) == (hinges, sliding)
        marked = marks.marks_of(response.assembly, joints, increment, increment.pose)
        assert (len(marked.hinges), len(marked.sliding)) == (hinges, sliding)

    # The last equilibrium shows the mechanism that follows it, as the picture of it and the film do.
    expected[len(response.path) - 1] = counted(response, swing_of(response).increment)
    with (blockvis.write(response, tmp_path / "out") / "response.csv").open(encoding="utf-8") as file:
        rows = [(int(row["hinges"]), int(row["sliding_joints"])) for row in csv.DictReader(file)]
    assert rows == expected[: len(response.path)]

    page = report_of(response)
    model = json.loads(re.search(r'<script id="model" type="application/json">(.*?)</script>', page, re.S)[1])
    packed = model["packed"]
    ends, kinds = unpacked(packed["mark_first"]).ravel(), unpacked(packed["mark_kind"]).ravel()
    frames = np.split(kinds, ends[1:-1])
    assert [((k == 1).sum(), (k == 2).sum()) for k in frames] == expected


@pytest.mark.parametrize("name", [pytest.param("portal frame", marks=pytest.mark.thorough), "semicircular arch"])
def test_collapse_has_one_count(name, tmp_path):
    """Of the fall, of the last equilibrium in the motion of the fall, which the picture shows, and in the summary."""
    response = RESPONSES[name]()
    falling = mechanics.with_motion(response.path[-1], response.collapse.mechanism)
    expected = counted(response, falling)
    assert in_words(response.collapse.words) == expected
    assert counted(response, response.increments[len(response.path)]) == expected
    summary = json.loads((blockvis.write(response, tmp_path / "out") / "summary.json").read_text(encoding="utf-8"))
    assert (summary["hinges"], summary["sliding_joints"]) == expected
    parts = len(mechanics.mechanism_of(response.assembly, falling).motions)
    counts = dict(summary_rows(response))["mechanism"]
    assert summary["mechanism"].startswith(f"{parts} macro-blocks; ")
    assert counts.startswith(f"{parts} moving parts, {expected[0]} hinges")


@pytest.mark.thorough
def test_console_and_summary_count_what_the_picture_shows(tmp_path):
    """Not the first frame of the fall, whose contact points and forces are others."""
    response = portal_response()
    shown = swing_of(response).increment
    collapse = replace(response.collapse, words="9 macro-blocks; hinge at a | b")
    response = replace(response, collapse=collapse)
    said = next(line for line in _in_words(response, tmp_path).splitlines() if line.startswith("mechanism: "))
    assert said == f"mechanism: {mechanics.mechanism_of(response.assembly, shown)}"
    summary = json.loads((blockvis.write(response, tmp_path / "out") / "summary.json").read_text(encoding="utf-8"))
    assert f"mechanism: {summary['mechanism']}" == said


def test_creeping_counts_for_nothing():
    """A joint that slides at a five hundredth of the speed of the fastest block does not slide."""
    response = arch_response()
    last = response.path[-1]
    fastest = np.abs(last.velocity[:, :2]).max()
    for part, slides in ((0.002, False), (0.5, True)):
        motion = np.zeros_like(last.velocity)
        motion[response.assembly.free] = [0.0, fastest, 0.0]
        along = np.tile([0.0, part * fastest], (len(last.contacts), 1))
        creeping = last.with_arrays(velocity=motion, displacements=along)
        assert bool(counted(response, creeping)[1]) is slides


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


def test_a_crack_goes_up_the_steps_of_a_bond_not_along_a_hairline_beside_them():
    """The lower right of a wall sinks along steps, its lowest course a little more."""
    wall = squares(*((x, y) for y in range(4) for x in range(8)))
    sinks = {(x, y): -0.036 if y == 0 and x > 1 else -0.03 for y in range(4) for x in range(y + 1, 8)}
    cracks = cracks_of(wall, moved(wall, **{f"block_{8 * y + x}": (0.0, dy, 0.0) for (x, y), dy in sinks.items()}))
    assert [crack.width for crack in cracks] == pytest.approx([0.03, 0.006])
    # Three beds that open and the joints between their ends, which slide.
    assert cracks[0].mean_width * cracks[0].size == pytest.approx(3 * 0.03)


@pytest.mark.parametrize("side", [1.0, -1.0], ids=["as drawn", "mirrored"])
@pytest.mark.parametrize("apart", [4, 0], ids=["side by side", "from one foot"])
def test_diagonals_through_a_bond_are_one_crack_each(side, apart):
    """A wall that parts along a stepped diagonal, and along the zigzag of the head joints over one place."""
    bricks = [(x + 0.5 * (y % 2), y) for y in range(12) for x in range(14)]
    wall = squares(*((0.25 * x if side > 0.0 else -0.25 * (x + 1.0), 0.1 * y) for x, y in bricks), size=(0.25, 0.1))
    motions = {}
    for k, (x, y) in enumerate(bricks):
        diagonal, upright = x > 1.9 + apart + 0.5 * y, x > 1.9 + 0.5 * (y % 2)
        motions[f"block_{k}"] = (side * (0.03 * diagonal + 0.05 * upright), 0.0, 0.0)
    cracks = cracks_of(wall, moved(wall, **motions))
    assert len(cracks) == 2
    flat, steep = sorted(cracks, key=lambda crack: abs(np.sin(np.radians(crack.inclination))))
    whole = 12 * 0.1 + 11 * 0.125
    assert steep.size == pytest.approx(whole)
    assert np.cos(np.radians(steep.inclination)) == pytest.approx(0.0, abs=0.15)
    # At their foot they have joints in common, which belong to the wider one.
    assert flat.size == pytest.approx(whole if apart else whole - 0.325)
    assert np.tan(np.radians(flat.inclination)) == pytest.approx(side * 0.1 / 0.125, rel=0.15)


def test_two_level_cracks_above_each_other_are_none_that_turns_back():
    """The right of two courses lifts, the upper one by twice as much: a joint that slides leads from bed to bed."""
    wall = squares(*((0.25 * x, 0.1 * y) for y in range(3) for x in range(8)), size=(0.25, 0.1))
    lifted = {f"block_{8 * y + x}": (0.0, 0.02 * y, 0.0) for y in (1, 2) for x in range(2, 8)}
    cracks = cracks_of(wall, moved(wall, **lifted))
    assert [(round(crack.width, 6), round(crack.inclination, 6)) for crack in cracks] == [(0.02, 0.0), (0.02, 0.0)]
    assert all(crack.places[1] == "the right edge" for crack in cracks)


def test_a_crack_ends_where_its_joints_do_not_at_one_beside_their_way():
    """The upper left corner of a bond goes, and most of what is on its right lifts from the course below."""
    bricks = [(0, 0, 1), (1, 0, 3), (3, 0, 5), (0, 1, 2), (2, 1, 5), (0, 2, 1), (1, 2, 3), (3, 2, 5)]
    wall = solver.Assembly.from_outlines([rectangle(left, y, right, y + 1) for left, y, right in bricks])
    right = {f"block_{k}": (0.0, 0.05, 0.0) for k in (2, 4, 6, 7)}
    widest = cracks_of(wall, moved(wall, block_3=(-0.03, 0.03, 0.0), block_5=(-0.07, 0.03, 0.0), **right))[0]
    assert "the top" in widest.places
    assert widest.ends.tolist() == pytest.approx(np.array([[0.0, 1.0], [1.0, 3.0]]))


def test_places_are_told_by_openings():
    """A ring of squares around a window whose right column goes."""
    wall = squares(*((x, y) for y in range(3) for x in range(3) if (x, y) != (1, 1)))
    column = {f"block_{number}": (0.02, 0.0, 0.0) for number in (2, 4, 7)}
    above, below = sorted(cracks_of(wall, moved(wall, **column)), key=lambda crack: -crack.at[1])
    assert above.places == ("the upper right corner of the opening", "the top")
    assert below.places[1] == "the lower right corner of the opening"


def test_a_crack_through_a_low_beam_ends_at_its_underside():
    """It is lower than what is near: the joint between its halves ended at the top twice."""
    halves = squares((0, 0), (1, 0), size=(1, 0.4))
    (crack,) = cracks_of(halves, moved(halves, block_1=(0.02, 0.0, 0.0)))
    assert crack.places == ("the underside", "the top")


def test_a_crack_that_ends_a_course_above_the_foot_ends_inside():
    """Courses are lower than bricks are long: the joint below it is shut."""
    wall = squares(*((0.25 * x, 0.1 * y) for y in range(4) for x in range(4)), size=(0.25, 0.1))
    parted = {f"block_{4 * y + x}": (0.02, 0.0, 0.0) for y in range(1, 4) for x in (2, 3)}
    (crack,) = cracks_of(wall, moved(wall, **parted))
    assert crack.ends.tolist() == pytest.approx(np.array([[0.5, 0.1], [0.5, 0.4]]))
    assert crack.places == ("inside", "the top")


def test_an_arch_has_an_opening_that_the_ground_closes_and_an_outer_face():
    arch = generators.arch(voussoirs=10, thickness_ratio=0.2)
    parts = {f"voussoir {k}": (0.02 * (k > 7) - 0.03 * (k < 4) + 0.01 * (k > 5), 0.0, 0.0) for k in range(1, 11)}
    found = {frozenset(crack.places) for crack in cracks_of(arch, moved(arch, **parts))}
    sides = {frozenset({f"the {side} haunch of the opening", "the outer face"}) for side in ("left", "right")}
    assert found >= sides | {frozenset({"the head of the opening", "the top"})}


def test_of_many_supports_each_side_has_arrows_of_its_own_to_one_scale():
    xs = range(12)
    outlines = [rectangle(x, -0.5, x + 0.6, 0.0) for x in xs] + [rectangle(x, 0.0, x + 0.6, 1.0) for x in xs]
    piers = solver.Assembly.from_outlines(outlines, roles=["moving"] * 12 + ["free"] * 12)
    profile = {piers.names[k]: (0.0, -1.0 if k < 6 else 0.5, 0.0) for k in xs}
    settlement = solver.Settlement(profile=profile, increment=0.05, limit=0.1)
    blocks, _, directions = marks.settlement_arrows(piers, settlement, solver.Pose.initial(piers))
    assert blocks.tolist() == [0, 2, 3, 5, 6, 8, 9, 11]
    assert directions[:, 1].tolist() == [-1.0] * 4 + [0.5] * 4


def test_arrows_that_are_seen_from_their_end_are_left_out():
    """They were blobs without a direction."""
    tips = np.array([[1.8, 0.0], [2.2, 0.0]])
    assert [len(shapes) for shapes in marks.arrow_shapes(np.zeros((2, 2)), tips, 1.0, 0.0)] == [1, 1]


def test_joints_that_give_leave_no_lines_in_the_outline_of_a_part():
    stones = [rectangle(0.0, 0.0, 1.0, 0.5), rectangle(1.004, 0.0, 2.0, 0.5)]
    wall_of_two = solver.Assembly.from_outlines([rectangle(-1, -0.5, 3, 0), *stones], roles=["fixed", "free", "free"])
    assert len(marks.part_outlines(wall_of_two, wall_of_two.vertices, np.array([-1, 0, 0]))) == 4
