"""Joints, cracks, hinges, resultants and the parts of a mechanism."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from structures import BENT, arch_response, dropped_brick, parted, stacked, wall

import solver
from blockvis.pictures import marks
from blockvis.pictures.hatching import hatch_lines
from blockvis.results.joints import initial_joints
from blockvis.text import rounded_length
from solver import mechanics


def all_cracks(assembly, pose):
    fallen = np.zeros(assembly.n_blocks, dtype=bool)
    return marks.cracks_between(assembly, initial_joints(assembly), pose, pose, fallen)


def cracks(assembly, pose):
    return all_cracks(assembly, pose)[0]


def area(polygon):
    x, y = polygon.T
    return abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))) / 2.0


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
    np.testing.assert_allclose(area(found[0]), 0.05, rtol=1e-9)


def test_sliding_and_pressing_leave_none():
    assert len(cracks(*stacked(shift=(0.2, 0.0)))) == 0
    assert len(cracks(*stacked(shift=(0.0, -0.05)))) == 0


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
        found, _, gapes = all_cracks(assembly, pose)
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


@given(st.floats(0.01, 0.2))
def test_the_pocket_where_four_cracks_meet_is_air(apart):
    assembly, pose = four_blocks(apart)
    found, openings, _ = all_cracks(assembly, pose)
    assert len(found) == 4
    np.testing.assert_allclose(openings, 2.0 * apart, rtol=1e-9)
    covered = shapely.union_all([shapely.Polygon(crack) for crack in found])
    assert not covered.contains(shapely.Point(1.0, 1.0))
    # Each crack is as long as the faces beside it, and nothing beyond them has its colour.
    np.testing.assert_allclose(covered.area, 4 * 2.0 * apart, rtol=1e-9)


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
    displaced = mechanics.swung(falling.pose, 0.1 * response.collapse.mechanism)
    outlines = marks.part_outlines(response.assembly, mechanics.moved_vertices(response.assembly, displaced), parts)
    length = np.hypot(*(outlines[:, 1] - outlines[:, 0]).T).sum()
    before = marks.part_outlines(response.assembly, mechanics.moved_vertices(response.assembly, falling.pose), parts)
    np.testing.assert_allclose(length, np.hypot(*(before[:, 1] - before[:, 0]).T).sum(), rtol=1e-2)


def test_a_sinking_wall_is_one_part():
    response = parted(wall(8, 6), 2, 0)
    parts = mechanics.rigid_parts(response.assembly, response.increments[-1])
    assert set(parts) == {-1, 0}


def test_hatch_stays_inside_the_support():
    assembly = solver.Assembly.from_outlines([BENT["U"]], roles=["fixed"])
    points, blocks = hatch_lines(assembly, np.array([0]), np.array([-100.0, -100.0]), np.array([100.0, 100.0]), 0.1)
    assert len(points) == len(blocks) > 20
    middles = (points[::2] + points[1::2]) / 2.0
    notch = (middles[:, 0] > 5.001) & (middles[:, 0] < 5.999) & (middles[:, 1] > 1.001)
    assert not notch.any()
    assert points.min() >= -1e-9


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
