"""Mortar joints: what is moved, what keeps its place, and that faces meet afterwards."""

import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from structures import brick

import solver
from blockvis import read_layout
from blockvis.layout.assemble import assemble
from blockvis.layout.joints.close import close_joints
from blockvis.layout.joints.facing_edges import facing_edges, proposed_thickness
from solver import mechanics

FACADE = Path(__file__).resolve().parents[3] / "shared" / "data" / "facade" / "facade.dxf"
needs_facade = pytest.mark.skipif(not FACADE.exists(), reason="third-party drawing, not part of the project")


def wall(joints, courses, height=0.065, length=0.25):
    """Running bond with a joint thickness of its own per course and per head joint."""
    bricks, y = [], 0.0
    for k in range(courses):
        x = 0.0 if k % 2 == 0 else length / 2
        for m in range(4):
            bricks.append(brick(x, y, length, height))
            x += length + joints[(5 * k + m) % len(joints)]
        y += height + joints[(3 * k + 1) % len(joints)]
    return bricks


def voussoirs(n, inner, outer, gap):
    """Blocks of equal width on a semicircle, so that the joints between them are wedges."""
    blocks = []
    width = math.pi * inner / n - gap
    for i in range(n):
        a = math.pi * (i + 0.5) / n
        radial, tangent = np.array([math.cos(a), math.sin(a)]), np.array([-math.sin(a), math.cos(a)])
        corners = [(inner, -1), (outer, -1), (outer, 1), (inner, 1)]
        blocks.append(np.array([r * radial + s * width / 2 * tangent for r, s in corners]))
    return blocks


def total_area(rings):
    return sum(shapely.Polygon(ring).area for ring in rings)


def assert_closed(rings, thickness, scale):
    """No overlap, and no gap left where edges face each other."""
    assembly = solver.Assembly.from_outlines(rings)
    _, _, depth = mechanics.overlap_depths(assembly.vertices, assembly.offsets, 1e-9 * scale)
    assert len(depth) == 0, depth
    left = facing_edges(rings, thickness, 1e-6 * scale)
    assert len(left) > 0
    assert np.abs(left.gaps).max() <= 1e-9 * scale


def test_two_bricks_meet_half_way_and_keep_their_outer_corners():
    closing = close_joints([brick(0, 0, 1, 1), brick(1.02, 0, 1, 1)], 0.03)
    assert closing.n_joints == 1
    assert np.allclose(closing.outlines[0], brick(0, 0, 1.01, 1), atol=1e-15)
    assert np.allclose(closing.outlines[1], brick(1.01, 0, 1.01, 1), atol=1e-15)


def test_a_wider_gap_is_an_opening():
    blocks = [brick(0, 0, 1, 1), brick(1.02, 0, 1, 1)]
    closing = close_joints(blocks, 0.01)
    assert closing.n_joints == 0
    assert all((a == b).all() for a, b in zip(closing.outlines, blocks, strict=True))


def test_t_junction_of_running_bond_closes_exactly():
    blocks = [brick(0, 0, 1, 0.5), brick(1.01, 0, 1, 0.5), brick(0.5, 0.51, 1, 0.5)]
    closing = close_joints(blocks, 0.012)
    assert [len(ring) for ring in closing.outlines] == [4, 4, 4]
    assert closing.outlines[2][0] == pytest.approx([0.5, 0.505], abs=1e-15)
    assert closing.outlines[0][2] == pytest.approx([1.005, 0.505], abs=1e-15)
    assert_closed(closing.outlines, 0.012, 1.0)


@pytest.mark.parametrize("n", [7, 12, 25])
def test_wedges_between_voussoirs_close_to_their_bisector(n):
    blocks = voussoirs(n, 1.0, 1.25, 0.01)
    thickness, found = proposed_thickness(blocks)
    assert len(found) == n - 1
    closing = close_joints(blocks, thickness)
    assert_closed(closing.outlines, thickness, 1.25)
    for i, ring in enumerate(closing.outlines[1:-1], start=1):
        for corner in ring:
            angle = math.atan2(corner[1], corner[0]) * n / math.pi
            assert min(abs(angle - i), abs(angle - i - 1)) < 1e-12
    # Springing faces are outer edges: they stay.
    assert np.abs(closing.outlines[0][:2] @ [0, 1] - blocks[0][:2] @ [0, 1]).max() < 0.05


def test_what_faces_a_support_comes_all_the_way():
    closing = close_joints([brick(0, 0.01, 1, 1), brick(-1, -1, 3, 1)], 0.02, anchored=np.array([False, True]))
    assert (closing.outlines[1] == brick(-1, -1, 3, 1)).all()
    assert np.allclose(closing.outlines[0], brick(0, 0, 1, 1.01), atol=1e-15)


def test_windows_keep_their_size():
    frame = [brick(0, 0, 3, 1), brick(0, 1.01, 1, 1), brick(2, 1.01, 1, 1), brick(0, 2.02, 3, 1)]
    closing = close_joints(frame, 0.02)
    window = shapely.union_all([shapely.Polygon(ring) for ring in closing.outlines]).interiors[0]
    assert np.allclose(shapely.Polygon(window).bounds, (1, 1.005, 2, 2.015), atol=1e-9)


def test_a_back_that_no_line_serves_is_cut_to_fit():
    """Three tops of a polygonal arch under one straight beam."""
    beam = brick(-1.0, 0.6, 2.0, 0.4)
    tops = []
    for centre, slope in ((-0.6, 0.3), (0.0, 0.0), (0.6, -0.3)):
        x = np.array([centre - 0.29, centre + 0.29])
        y = 0.5 + slope * (x - centre)
        tops.append(np.array([[x[0], 0], [x[1], 0], [x[1], y[1]], [x[0], y[0]]]))
    closing = close_joints([beam, *tops], 0.2)
    assert closing.n_cut > 0
    assert_closed(closing.outlines, 0.2, 2.0)
    touching = shapely.Polygon(closing.outlines[0]).buffer(1e-9)
    for ring in closing.outlines[1:]:
        assert touching.intersection(shapely.Polygon(ring).exterior).length > 0.5


def test_small_overlap_is_resolved_to_the_midline():
    closing = close_joints([brick(0, 0, 1, 1), brick(0.99, 0, 1, 1)], 0.0, overlap=0.02)
    assert closing.outlines[0][:, 0].max() == pytest.approx(0.995, abs=1e-15)
    assert closing.outlines[1][:, 0].min() == pytest.approx(0.995, abs=1e-15)


@given(st.lists(st.floats(0.004, 0.012), min_size=5, max_size=11), st.integers(2, 5), st.floats(-3, 3))
@settings(max_examples=40, deadline=None)
def test_running_bond_with_joints_of_any_thickness(joints, courses, turn):
    bricks = wall(joints, courses)
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    bricks = [ring @ rotation.T for ring in bricks]
    closing = close_joints(bricks, 0.0125)
    assert_closed(closing.outlines, 0.0125, 1.0)
    # Blocks grow into the joints and nowhere else.
    for drawn, closed in zip(bricks, closing.outlines, strict=True):
        before, after = shapely.Polygon(drawn), shapely.Polygon(closed)
        assert before.buffer(0.0125, join_style="mitre").covers(after)
        assert after.buffer(1e-9).covers(before)
    union = shapely.union_all([shapely.Polygon(ring) for ring in closing.outlines], grid_size=1e-10)
    assert total_area(closing.outlines) == pytest.approx(union.area, rel=1e-7)


@given(st.floats(1e-3, 1e3), st.floats(-1e4, 1e4))
@settings(max_examples=20, deadline=None)
def test_closing_follows_the_size_and_place_of_the_drawing(scale, shift):
    bricks = wall([0.01, 0.008], 3)
    reference = close_joints(bricks, 0.0125).outlines
    moved = close_joints([scale * ring + shift for ring in bricks], 0.0125 * scale).outlines
    for a, b in zip(reference, moved, strict=True):
        assert np.abs((b - shift) / scale - a).max() < 1e-9 + 1e-12 * abs(shift) / scale


def test_proposed_thickness_is_the_widest_joint():
    thickness, found = proposed_thickness(wall([0.0101, 0.008], 4))
    assert thickness == pytest.approx(0.011)
    assert len(found) > 20
    assert proposed_thickness([brick(0, 0, 1, 1), brick(1, 0, 1, 1)])[0] == 0.0


@pytest.mark.thorough
@needs_facade
def test_the_facade_closes_without_overlap_and_its_openings_stay():
    drawing = read_layout(FACADE, unit="m")
    supports = [
        {"name": "ground left", "role": "fixed", "outline": [[-1, -0.5], [4, -0.5], [4, 0], [-1, 0]]},
        {"name": "ground right", "role": "moving", "outline": [[4, -0.5], [7, -0.5], [7, 0], [4, 0]]},
    ]
    with pytest.warns(UserWarning, match="6 of 1568 blocks are drawn twice and were dropped"):
        assembly = assemble(drawing, supports=supports, joint_thickness="auto")
    assert assembly.n_blocks == 1564
    assert len(mechanics.overlap_depths(assembly.vertices, assembly.offsets, 1e-7)[0]) == 0
    walls = shapely.union_all([shapely.Polygon(assembly.outline(i)).buffer(1e-7) for i in range(1562)])
    windows = [hole for hole in walls.interiors if shapely.Polygon(hole).area > 0.1]
    assert len(windows) == 4
    for hole in windows:
        assert shapely.Polygon(hole).bounds[2] - shapely.Polygon(hole).bounds[0] == pytest.approx(1.05, abs=0.012)
    contacts = mechanics.find_contacts(assembly, assembly.vertices, reach=0.005)
    # No corner starts behind a face, and the faces of the joints touch.
    assert contacts.gaps.min() > -1e-9
    assert (np.abs(contacts.gaps) < 1e-6).mean() > 0.95


@given(st.integers(0, 10_000), st.sampled_from(["running", "stack", "arch"]))
@settings(max_examples=40, deadline=None)
def test_drawings_by_hand_leave_no_overlap(seed, kind):
    """Every corner off by up to a millimetre, where joints are a centimetre wide."""
    blocks = {
        "running": lambda: wall([0.01, 0.008, 0.012], 5),
        "stack": lambda: [brick(0.26 * i, 0.075 * j, 0.25, 0.065) for i in range(4) for j in range(4)],
        "arch": lambda: voussoirs(11, 1.0, 1.25, 0.01),
    }[kind]()
    generator = np.random.default_rng(seed)
    drawn = [ring + generator.uniform(-1e-3, 1e-3, ring.shape) for ring in blocks]
    thickness, _ = proposed_thickness(drawn)
    closing = close_joints(drawn, thickness)
    assembly = solver.Assembly.from_outlines(closing.outlines)
    assert len(mechanics.overlap_depths(assembly.vertices, assembly.offsets, 1e-7)[0]) == 0
    # Every block still touches its neighbours: along most of the length over which it faced them.
    faced = facing_edges(drawn, thickness).lengths.sum()
    left = facing_edges(closing.outlines, thickness, 1e-6)
    assert left.lengths[np.abs(left.gaps).max(axis=1) < 1e-7].sum() > 0.97 * faced


def test_rubble_of_any_shape_closes_at_exactly_its_joint_thickness():
    generator = np.random.default_rng(3)
    cells = shapely.voronoi_polygons(shapely.MultiPoint(generator.uniform(0, 3, (80, 2)))).geoms
    shrunk = [cell.intersection(shapely.box(0, 0, 3, 3)).buffer(-0.008, join_style="mitre") for cell in cells]
    rings = [np.array(shapely.orient_polygons(cell).exterior.coords)[:-1] for cell in shrunk if cell.area > 0.01]
    assert proposed_thickness(rings)[0] == pytest.approx(0.016)
    closing = close_joints(rings, 0.016)
    union = shapely.union_all([shapely.Polygon(ring) for ring in closing.outlines])
    assert total_area(closing.outlines) == pytest.approx(union.area, rel=1e-9)
    # What is left open is pockets at junctions, where the mitres of three blocks leave a triangle.
    joints = sum(cell.length for cell in shrunk) * 0.008
    filled = union.area - sum(cell.area for cell in shrunk)
    assert filled > 0.85 * joints
    left = facing_edges(closing.outlines, 0.016, 1e-6)
    assert left.lengths[np.abs(left.gaps).max(axis=1) < 1e-7].sum() > 0.98 * left.lengths.sum()
