"""Joints that are closed, in the plane and in space: what is moved, what keeps its place, and that faces meet."""

import itertools
import math
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from structures import box, brick, drawn, fans, layout_of

import solver
from blockvis import generators, inspect, read, read_layout, run_case, write_layout
from blockvis.cli import main
from blockvis.layout.assemble import assemble
from blockvis.layout.faces import with_plane_faces
from blockvis.layout.facing import faced, facing_tolerance
from blockvis.layout.joints.close import close_joints, proposed
from blockvis.layout.joints.facing_edges import facing_edges, proposed_thickness
from blockvis.layout.joints.nearest_stone import share_out
from blockvis.layout.layout import Layout
from blockvis.layout.solids import triangles_of
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
@pytest.mark.slow
def test_running_bond_with_joints_of_any_thickness(joints, courses, turn):
    bricks = wall(joints, courses)
    rotation = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    bricks = [ring @ rotation.T for ring in bricks]
    closing = close_joints(bricks, 0.0125)
    assert_closed(closing.outlines, 0.0125, 1.0)
    # Blocks grow into the joints and nowhere else.
    for laid, closed in zip(bricks, closing.outlines, strict=True):
        before, after = shapely.Polygon(laid), shapely.Polygon(closed)
        assert before.buffer(0.0125, join_style="mitre").covers(after)
        assert after.buffer(1e-9).covers(before)
    union = shapely.union_all([shapely.Polygon(ring) for ring in closing.outlines], grid_size=1e-10)
    assert total_area(closing.outlines) == pytest.approx(union.area, rel=1e-7)


@pytest.mark.thorough
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


def test_stones_that_touch_have_no_joint_to_close():
    """Of two points at one place a triangulation keeps one: the joint of width 0 itself, then."""
    drawn = [brick(0.4 * k + 0.2 * (course % 2), 0.2 * course, 0.4, 0.2) for course in range(5) for k in range(5)]
    with pytest.warns(UserWarning, match="found 0 m"):
        closed = assemble(layout(drawn), supports=GROUND, joint_thickness="auto", closing="voronoi")
    assert closed.areas[: len(drawn)] == pytest.approx([shapely.Polygon(ring).area for ring in drawn])


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


@pytest.mark.slow
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


WIDTH, HEIGHT = 1.6, 1.2

GROUND = (
    {"name": "ground left", "role": "fixed", "outline": [[-0.3, -0.2], [0.9, -0.2], [0.9, 0.0], [-0.3, 0.0]]},
    {"name": "ground right", "role": "moving", "outline": [[0.9, -0.2], [1.9, -0.2], [1.9, 0.0], [0.9, 0.0]]},
)


def ring_of(shape):
    return np.array(shapely.orient_polygons(shape).exterior.coords)[:-1]


def cells(seed, n=45):
    """Cells of a wall without mortar, about equally large."""
    box = shapely.box(0, 0, WIDTH, HEIGHT)
    points = np.random.default_rng(seed).uniform(0, 1, (n, 2)) * [WIDTH, HEIGHT]
    for _ in range(4):
        found = shapely.get_parts(shapely.voronoi_polygons(shapely.MultiPoint(points), extend_to=box))
        found = shapely.intersection(found, box)
        points = shapely.get_coordinates(shapely.centroid(found))
    return found


def rubble(seed, *, rough=0.004):
    """Stones with blunt corners and rough faces, mortar of 6 to 30 mm between them."""
    generator = np.random.default_rng(seed)
    border = shapely.box(0, 0, WIDTH, HEIGHT).exterior
    stones = []
    for cell in cells(seed):
        blunt = cell.buffer(-generator.uniform(0.003, 0.015)).buffer(-0.02).buffer(0.02, quad_segs=3)
        points = shapely.get_coordinates(blunt.exterior.segmentize(blunt.length / 14))[:-1]
        inner = shapely.distance(shapely.points(points), border) > 0.02
        points = points + inner[:, None] * generator.uniform(-rough, rough, points.shape)
        stones.append(ring_of(shapely.Polygon(points).buffer(0)))
    return stones


def layout(rings):
    return Layout(tuple(rings), tuple(f"stone {i}" for i in range(len(rings))))


def first_increment(assembly, friction=0.6):
    """Status and reaction over weight before the ground moves."""
    increments = mechanics.settlement_increments(
        assembly,
        (solver.Settlement(direction=(0, -1), increment=5e-4, limit=5e-4),),
        interfaces=solver.Interfaces(solver.InterfaceLaw(friction)),
        loads=solver.self_weight(assembly),
        controls=solver.Controls(falling_frames=1),
    )
    increment = next(increments)
    return increment.status, increment.reaction / mechanics.total_weight(assembly)


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize("seed", [3])
def test_rubble_closes_and_carries_as_the_cells_that_it_was_made_of(seed):
    with pytest.warns(UserWarning, match="giving the mortar to the nearest stone"):
        assembly = assemble(layout(rubble(seed)), supports=GROUND, joint_thickness="auto")
    status, reaction = first_increment(assembly)
    assert status is solver.Status.EQUILIBRIUM
    dry = assemble(layout([ring_of(cell) for cell in cells(seed)]), supports=GROUND)
    # Faces are rough by 4 mm and mortar is of any width: the borders are not quite those of the cells.
    assert reaction == pytest.approx(first_increment(dry)[1], rel=0.1)


@pytest.mark.slow
def test_a_case_of_rubble_runs(tmp_path):
    import ezdxf

    document = ezdxf.new("R2010")
    document.header["$INSUNITS"] = 6
    for ring in rubble(8):
        document.modelspace().add_lwpolyline(ring.tolist(), close=True, dxfattribs={"layer": "stone"})
    document.saveas(tmp_path / "rubble.dxf")
    ground = "".join(
        f'[[supports]]\nname = "{s["name"]}"\nrole = "{s["role"]}"\noutline = {s["outline"]}\n' for s in GROUND
    )
    (tmp_path / "case.toml").write_text(
        f'[geometry]\nfile = "rubble.dxf"\njoint_thickness = "auto"\n{ground}[material]\nfriction_coefficient = 0.6\n'
        "[settlement]\ndirection = [0, -1]\nincrement = 0.002\nlimit = 0.004\n[output]\nanimation = false\n",
        encoding="utf-8",
    )
    with pytest.warns(UserWarning, match='joint_thickness "auto" found'):
        run = run_case(tmp_path / "case.toml", tmp_path / "out", outputs=())
    assert run.summary["status"] == "limit reached"
    assert 0.1 < run.response.reaction[-1] / run.response.total_weight < 0.4


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.thorough)])
def test_neighbours_share_their_edges_to_the_last_digit(seed):
    stones = rubble(seed)
    closed = share_out(stones, 0.04, np.zeros(len(stones), bool))
    shapes = [shapely.Polygon(ring) for ring in closed]
    assert all(shape.is_valid for shape in shapes)
    assert shapely.coverage_is_valid(np.array(shapes))
    union = shapely.union_all(shapes)
    assert sum(shape.area for shape in shapes) == pytest.approx(union.area, rel=1e-12)
    # Every gap inside is closed, and mortar comes from between the stones only.
    assert not any(len(part.interiors) for part in shapely.get_parts(union))
    assert shapely.box(-1e-3, -1e-3, WIDTH + 1e-3, HEIGHT + 1e-3).covers(union)
    lengths = np.concatenate([np.hypot(*(np.roll(ring, -1, axis=0) - ring).T) for ring in closed])
    assert lengths.min() > 1e-3
    # Simplified: not many more corners than the stones have neighbours.
    assert sum(map(len, closed)) < 15 * len(closed)


@pytest.mark.thorough
def test_stones_end_where_an_uneven_ground_begins():
    x = np.linspace(-0.1, WIDTH + 0.1, 60)
    top = np.column_stack([x, 0.012 * np.sin(25.0 * x) - 0.012])
    ground = [*top[::-1].tolist(), [x[0], -0.2], [x[-1], -0.2]]
    stones = rubble(0)
    closed = close_joints([*stones, np.array(ground)], 0.05, anchored=np.arange(46) == 45, method="voronoi").outlines
    shapes = np.array([shapely.Polygon(ring) for ring in closed])
    assert shapely.is_valid(shapes).all()
    assert shapely.area(shapes).sum() == pytest.approx(shapely.union_all(shapes).area, rel=1e-9)
    pockets = [shapely.Polygon(hole) for part in [shapely.union_all(shapes)] for hole in part.interiors]
    assert sum(pocket.area for pocket in pockets) < 1e-9
    assert np.array_equal(closed[45], np.array(ground))


def test_an_opening_stays_open():
    def box(x, y, w, h):
        return ring_of(shapely.box(x, y, x + w, y + h).buffer(-0.02).buffer(0.02, quad_segs=4))

    frame = [box(0, 0, 0.9, 0.3), box(0, 0.31, 0.3, 0.3), box(0.6, 0.31, 0.3, 0.3), box(0, 0.62, 0.9, 0.3)]
    union = shapely.union_all([shapely.Polygon(ring) for ring in share_out(frame, 0.02, np.zeros(4, bool))])
    (opening,) = union.interiors
    assert shapely.Polygon(opening).bounds == pytest.approx((0.3, 0.305, 0.6, 0.615), abs=0.012)


def bricks(gap=0.01):
    found = []
    for course in range(6):
        y = gap + course * (0.065 + gap)
        lengths = [0.24] * 6 if course % 2 == 0 else [0.115, *[0.24] * 5, 0.115]
        x = 0.0
        for length in lengths:
            found.append(np.array([[x, y], [x + length, y], [x + length, y + 0.065], [x, y + 0.065]]))
            x += length + gap
    return found


def blunted(ring, style):
    shape = shapely.Polygon(ring)
    if style == "bevelled":
        return ring_of(shape.buffer(-0.01, join_style="mitre").buffer(0.01, join_style="bevel"))
    if style == "rounded":
        return ring_of(shape.buffer(-0.015).buffer(0.015, quad_segs=8))
    dense = shapely.get_coordinates(shapely.segmentize(shape.exterior, shape.length / 120))[:-1]
    return dense + np.random.default_rng(len(dense)).uniform(-1e-3, 1e-3, dense.shape)


@pytest.mark.slow
@pytest.mark.filterwarnings("error::RuntimeWarning")
@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(
    ("style", "joint"),
    [
        ("bevelled", "auto"),
        pytest.param("rounded", 0.011, marks=pytest.mark.thorough),
        pytest.param("roughened", "auto", marks=pytest.mark.thorough),
    ],
)
def test_blunt_and_rough_bricks_carry_like_sharp_ones(style, joint):
    sharp = first_increment(assemble(layout(bricks()), supports=GROUND, joint_thickness=joint))
    wall = layout([blunted(ring, style) for ring in bricks()])
    assembly = assemble(wall, supports=GROUND, joint_thickness=joint)
    assert assembly.polygons.edge_lengths.min() > 1e-3
    status, reaction = first_increment(assembly)
    assert status is solver.Status.EQUILIBRIUM
    assert reaction == pytest.approx(sharp[1], rel=0.1)


def test_the_joint_is_found_by_its_length_not_by_the_widest_gap():
    # From bevel to bevel across a crossing there are 21 mm; the joints are 10 mm wide.
    bevel = shapely.box(0, 0, 0.24, 0.065).buffer(-0.005, join_style="mitre").buffer(0.005, join_style="bevel")
    stack = [ring_of(bevel) + np.array([0.25 * i, 0.075 * j]) for i in range(5) for j in range(5)]
    thickness, found = proposed_thickness(stack)
    assert thickness == pytest.approx(0.01)
    assert found.gaps.max() == pytest.approx(0.0212, abs=1e-4)
    assert "and stay open" in proposed(stack).note


def test_the_limit_of_the_search_is_noted():
    box = shapely.box(0, 0, 0.2, 0.2)
    apart = [ring_of(box) + np.array([0.249 * i, 0.0]) for i in range(4)]
    assert "gaps were looked for up to 0.05 m" in proposed(apart).note
    near = [ring_of(box) + np.array([0.21 * i, 0.0]) for i in range(4)]
    assert proposed(near).note == ""


def test_the_way_can_be_chosen():
    rings = bricks()
    with pytest.raises(ValueError, match="closing is 'glue'; choose from auto, faces, voronoi"):
        assemble(layout(rings), joint_thickness=0.01, closing="glue")
    assert proposed(rings).method == "faces"
    assert proposed(rubble(1)).method == "voronoi"
    assert close_joints(rings[:4], 0.01, method="voronoi").method == "voronoi"


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_mortar_that_is_drawn_is_laidaway_however_wide_and_openings_in_it_stay(tmp_path):
    from blockvis import read

    stones = [shapely.Polygon(ring) for ring in rubble(3)]
    border = shapely.box(0, 0, WIDTH, HEIGHT)
    # A window takes the place of a stone, and at the edge of the wall a pocket is wider than any joint.
    window = shapely.box(0.7, 0.5, 0.9, 0.7)
    stones = [stone for stone in stones if not stone.intersects(window)]
    stones[0] = stones[0].buffer(-0.06)
    holes = [np.asarray(shape.exterior.coords)[:-1] for shape in (*stones, window)]

    def path(rings):
        return " ".join("M" + " L".join(f"{x:.9f},{-y:.9f}" for x, y in ring) + " Z" for ring in rings)

    (tmp_path / "a.svg").write_text(
        '<svg xmlns="http://www.w3.org/2000/svg"><g id="mortar">'
        f'<path d="{path([ring_of(border), *holes])}"/></g><g id="stone">'
        + "".join(f'<path d="{path([hole])}"/>' for hole in holes[:-1])
        + "</g></svg>",
        encoding="utf-8",
    )
    for ignore in ((), "mortar"):
        assembly = read(tmp_path / "a.svg", joint_thickness="auto", closing="voronoi", ignore=ignore)
        assert assembly.n_blocks == len(stones)
        # Outside, borders are simplified, too.
        assert assembly.areas.sum() == pytest.approx(border.area - window.area, rel=1e-2)


SMALL = {
    "barrel vault": {"voussoirs": 5, "stones": 2},
    "dome": {"lunes": 5, "courses": 2},
    "cross vault": {"voussoirs": 3, "stone": 2.0},
    "pavilion vault": {"voussoirs": 3, "bonded": False},
    "L corner": {"bricks": 2, "across": 2, "courses": 2},
}


def shaken(layout, amount, seed=3):
    """Move every corner of every block by itself, up to an amount [m] along each axis."""
    random = np.random.default_rng(seed)
    moved = tuple((points + amount * random.uniform(-1, 1, points.shape), faces) for points, faces in layout.solids)
    return replace(layout, blocks=moved)


def corners_of(assembly, block):
    return assembly.vertices[assembly.block_of_vertex == block]


def volume(points, faces):
    return trimesh.Trimesh(points, fans(faces), process=False).volume


def joints(assembly, least):
    """Pairs of blocks with at least so many contact points of faces that cover each other."""
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 1e-5 * assembly.block_size)
    contacts = contacts[contacts.areas > 0.0]
    pairs = Counter(map(frozenset, zip(contacts.block_a.tolist(), contacts.block_b.tolist(), strict=True)))
    return {pair for pair, count in pairs.items() if count >= least}


@pytest.mark.parametrize("name", SMALL)
@pytest.mark.filterwarnings("ignore")
@pytest.mark.slow
def test_a_shaken_drawing_is_faced(name, tmp_path):
    built = generators.build(name, SMALL[name])
    amount = 1e-3 * built.block_size
    write_layout(shaken(layout_of(built), amount), tmp_path / "a.obj")
    layout = read_layout(tmp_path / "a.obj", dimension=3)
    assert any("planes were fitted to warped faces of" in note for note in layout.notes)
    assembly = read(tmp_path / "a.obj", dimension=3)
    assert assembly.names == built.names
    assert not len(assembly.shapes.overlaps(assembly.vertices, 1e-5 * built.block_size)[0])
    # Stones that touch along an edge, with two points, may do so no longer.
    assert joints(built, 3) <= joints(assembly, 3)
    assert assembly.shapes.volumes == pytest.approx(built.shapes.volumes, rel=0.02)
    assert np.abs(assembly.centroids - built.centroids).max() < 4.0 * amount


@pytest.mark.slow
@pytest.mark.parametrize("name", ["barrel vault", "dome", "cross vault", "L corner"])
@pytest.mark.filterwarnings("ignore")
def test_a_shaken_drawing_stands_again(name, tmp_path):
    built = generators.build(name, SMALL[name])
    write_layout(shaken(layout_of(built), 1e-3 * built.block_size), tmp_path / "a.obj")
    assembly = read(tmp_path / "a.obj")
    down = solver.Settlement(direction=(0, 0, -1), increment=1e-6, limit=1e-6)
    response = solver.settle(assembly, down, friction_coefficient=0.7)
    assert response.stop == solver.Status.LIMIT_REACHED, response.message


@pytest.mark.filterwarnings("error")
def test_exact_joints_stay_bit_for_bit(tmp_path):
    dome = generators.dome(lunes=5, courses=2)
    write_layout(layout_of(dome), tmp_path / "dome.json")
    assert (read(tmp_path / "dome.json").vertices == layout_of(dome).points).all()


SHEET = 0.003
SHEETS = {
    "one": [(0.5, 0.5, SHEET)],
    "two on each other": [(0.5, 0.5, SHEET), (0.5, 0.5, SHEET)],
    "wider than the stones": [(0.7, 0.7, SHEET)],
    "under a part of the stone": [(0.5, 0.2, SHEET)],
}


@pytest.mark.parametrize("name", SHEETS)
@pytest.mark.filterwarnings("error")
def test_thin_sheets_between_thick_stones_stay_as_drawn(name, tmp_path):
    """Lead, slate, damp-proof courses: the gap between the stones that they fill is no joint."""
    solids, z = [box((-1, -1, -0.5), (1, 1, 0)), box((-0.5, -0.5, 0), (0.5, 0.5, 0.5))], 0.5
    for x, y, thick in SHEETS[name]:
        solids.append(box((-x, -y, z), (x, y, z + thick)))
        z += thick
    solids.append(box((-0.5, -0.5, z), (0.5, 0.5, z + 0.5)))
    path = drawn(tmp_path / "a.json", solids, [f"stone {k}" for k in range(len(solids))])
    assert (read(path).vertices == read_layout(path).points).all()
    assert inspect(path).open_joints == ()


def test_joints_of_sheets_stay_apart_where_others_are_faced(tmp_path):
    """Columns side by side, their sheets not quite at one height, under stones with open beds."""
    solids, names = [box((-2, -0.3, -0.5), (2, 0.3, 0))], ["ground"]
    for k, z in enumerate((0.4, 0.4, 0.401, 0.4)):
        x = k - 2
        levels = {"low": (0, z), "sheet": (z, z + 0.002), "high": (z + 0.002, 0.8)}
        solids += [box((x, -0.3, low), (x + 1, 0.3, high)) for low, high in levels.values()]
        names += [f"{name} {k}" for name in levels]
    solids += [box((-2, -0.3, 0.8024), (-1, 0.3, 1.1)), box((-1, -0.3, 0.8016), (2, 0.3, 1.1))]
    path = drawn(tmp_path / "a.json", solids, [*names, "top left", "top"])
    with pytest.warns(UserWarning, match=r"not plane, open by up to 0.0024 m \('high 0' and 'top left'\)"):
        volumes = read(path).shapes.volumes
    assert volumes[[2, 5, 8, 11]] == pytest.approx(0.002 * 0.6, rel=0.5)
    assert not len(read(path).shapes.overlaps(read(path).vertices, 1e-5)[0])


def test_what_is_moved_is_counted_and_named(tmp_path):
    stones = [box((0, 0, 0), (1, 1, 1)), box((0, 0, 1.004), (1, 1, 2)), box((0, 0, 1.998), (1, 1, 3))]
    path = drawn(tmp_path / "a.json", stones, ["low", "middle", "high"])
    with pytest.warns(
        UserWarning,
        match=r"2 joints between faces were not plane, open by up to 0.004 m \('low' and 'middle'\)",
    ):
        assembly = read(path)
    tops = [corners_of(assembly, block)[:, 2].max() for block in range(3)]
    feet = [corners_of(assembly, block)[:, 2].min() for block in range(3)]
    assert tops[:2] == pytest.approx([1.002, 1.999])
    assert feet[1:] == pytest.approx([1.002, 1.999])


@pytest.mark.filterwarnings("ignore:.*joint")
def test_wider_joints_are_closed_if_asked_for(tmp_path):
    stones = [box((0, 0, 0), (1, 1, 1)), box((0, 0, 1.05), (1, 1, 2))]
    path = drawn(tmp_path / "a.json", stones)
    assert corners_of(read(path), 0)[:, 2].max() == 1.0
    closed = read(path, joint_thickness=0.06)
    assert corners_of(closed, 0)[:, 2].max() == corners_of(closed, 1)[:, 2].min() == pytest.approx(1.025)


@pytest.mark.filterwarnings("ignore:.*joint")
def test_supports_keep_their_faces(tmp_path):
    stones = [box((0, 0, 0), (1, 1, 1)), box((0, 0, 1.004), (1, 1, 2))]
    ground = {"outline": stones[0][0][:4, :2].tolist(), "levels": [0, 1], "role": "fixed"}
    assembly = read(drawn(tmp_path / "a.json", stones[1:]), supports=[ground], dimension=3)
    assert corners_of(assembly, 1)[:, 2].max() == 1.0
    assert corners_of(assembly, 0)[:, 2].min() == pytest.approx(1.0, abs=1e-12)


def test_triangles_become_plane_faces():
    solid = generators.cross_vault(voussoirs=3, stone=2.0)
    for points, faces in layout_of(solid).solids:
        found = with_plane_faces(points, fans(faces))
        assert found.warp == 0.0
        assert sorted(map(len, found.solid[1])) == sorted(map(len, faces))
        assert volume(*found.solid) == pytest.approx(volume(points, faces), rel=1e-12)


def test_a_fan_around_a_re_entrant_corner_is_one_face():
    ring = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)
    low, high = (np.column_stack([ring, np.full(6, z)]) for z in (0.0, 1.0))
    fan = [[0, k, k + 1] for k in range(1, 5)]
    sides = [[k, (k + 1) % 6, (k + 1) % 6 + 6] for k in range(6)] + [[k, (k + 1) % 6 + 6, k + 6] for k in range(6)]
    faces = [[a, c, b] for a, b, c in fan] + [[6 + k for k in face] for face in fan] + sides
    found = with_plane_faces(np.vstack([low, high]), np.array(faces))
    assert sorted(map(len, found.solid[1])) == [4] * 6 + [6, 6]
    assert volume(*found.solid) == pytest.approx(3.0)


def test_a_face_warped_beyond_the_tolerance_stays_two_triangles():
    points, faces = box((0, 0, 0), (1, 1, 1))
    top = int(np.flatnonzero((points == [1, 1, 1]).all(axis=1))[0])
    raised = points.copy()
    raised[top, 2] += 0.2
    found = with_plane_faces(raised, fans(faces))
    assert found.warp == 0.0
    assert len(found.solid[1]) == 7
    raised[top, 2] = 1.004
    found = with_plane_faces(raised, fans(faces))
    assert 0.0009 < found.warp < 0.0011
    assert len(found.solid[1]) == 6
    assert found.place == pytest.approx(raised[top], abs=1.1)


def shrunk(layout, by):
    """Every stone smaller about the mean of its corners: joints open everywhere."""
    smaller = tuple((points + by * (points.mean(axis=0) - points), faces) for points, faces in layout.solids)
    return replace(layout, blocks=smaller)


@pytest.mark.parametrize(
    "name",
    [
        "extruded arch",
        pytest.param("barrel vault", marks=pytest.mark.thorough),
        pytest.param("L corner", marks=pytest.mark.thorough),
    ],
)
def test_open_joints_are_measured_and_closed(name, tmp_path):
    """Named with their gaps, and closed by the joint thickness that is proposed, by hand or as "auto"."""
    built = generators.build(name, SMALL.get(name, {"voussoirs": 6}))
    layout = shrunk(layout_of(built), 0.05)
    write_layout(layout, tmp_path / "a.json")
    found = inspect(tmp_path / "a.json")
    assert {frozenset(pair[:2]) for pair in found.open_joints} >= joints(built, 4) - {
        frozenset(np.flatnonzero(~built.free))
    }
    gaps = [gap for *_, gap in found.open_joints]
    assert gaps == sorted(gaps, reverse=True)
    assert found.joint_thickness > gaps[0] > 0.01 * built.block_size
    assert f"joint_thickness = {found.joint_thickness:g} closes them" in str(found)
    closed = {}
    for thickness in ("auto", found.joint_thickness):
        with pytest.warns(UserWarning, match="open by up to"):
            closed[thickness] = read(tmp_path / "a.json", joint_thickness=thickness)
    assert (closed["auto"].vertices == closed[found.joint_thickness].vertices).all()
    assert joints(closed["auto"], 3) >= joints(built, 4)


def test_what_touches_has_no_open_joints_and_what_overlaps_is_named(tmp_path):
    built = generators.build("L corner", SMALL["L corner"])
    layout = layout_of(built)
    write_layout(layout, tmp_path / "a.json")
    found = inspect(tmp_path / "a.json")
    assert (found.open_joints, found.overlapping, found.refused, found.joint_thickness) == ((), (), "", 0.0)
    points, faces = layout.solids[0]
    pushed = replace(layout, blocks=((points + np.array([0.01, 0.0, 0.0]), faces), *layout.solids[1:]))
    write_layout(pushed, tmp_path / "b.json")
    found = inspect(tmp_path / "b.json")
    assert 0 in found.overlapping[0][:2]
    assert found.overlapping[0][2] == pytest.approx(0.01, rel=1e-6)
    assert "refused: move the blocks apart or raise overlap_tolerance" in str(found)


def deepest(solids):
    """How deep any two blocks overlap, at most."""
    assembly = solver.Assembly.from_solids(solids)
    return assembly.shapes.overlaps(assembly.vertices, 1e-9)[2].max(initial=0.0)


@pytest.mark.thorough
@pytest.mark.parametrize("tolerance", [None, pytest.param(0.1, marks=pytest.mark.thorough)])
def test_facing_never_makes_the_deepest_overlap_deeper(tolerance):
    drawn = generators.build("barrel vault", SMALL["barrel vault"])
    solids = [with_plane_faces(p, triangles_of(p, f)).solid for p, f in shaken(layout_of(drawn), 2e-3).solids]
    near = facing_tolerance(solids, 0.0, tolerance)
    found = faced(solids, drawn.names, near)
    assert deepest(found.solids) <= max(deepest(solids), 0.5 * near)


@pytest.mark.parametrize("stay", [False, True])
def test_faces_are_said_to_be_moved_where_a_block_has_moved(stay, monkeypatch):
    slant = layout_of(generators.build("barrel vault", SMALL["barrel vault"]))
    solids = shaken(slant, 2e-3).solids
    if stay:
        every = {(k - 1, k): 1.0 for k in range(1, len(solids))}
        depths = iter([every, {}, {}])
        monkeypatch.setattr("blockvis.layout.facing._depths", lambda *_: next(depths))
    found = faced(solids, slant.names)
    assert all(solid is drawn for solid, drawn in zip(found.solids, solids, strict=True)) == stay
    assert ("moved into one plane" in found.note) == (not stay)
    assert not stay or f"{len(solids)} blocks stay as drawn" in found.note


def test_a_tolerance_does_not_face_less_than_none():
    solids = layout_of(generators.build("dome", SMALL["dome"])).solids
    assert facing_tolerance(solids, 0.0, 1e-9) == facing_tolerance(solids) < facing_tolerance(solids, 0.0, 1.0) == 1.0


def test_convert_closes_joints_and_says_no_more_of_the_blocks_than_the_drawing(tmp_path):
    """What a file does not say is the case's to say: role, thickness and density."""
    rings = [brick(0, 0, 0.5, 0.3), brick(0.52, 0, 0.5, 0.3)]
    write_layout(Layout(tuple(rings), ("a", "b"), ("stones",) * 2, roles=("moving", "")), tmp_path / "open.json")
    for joint, width in (("auto", 0.51), ("0.05", 0.51), ("0.0", 0.5)):
        files = (str(tmp_path / f"{name}.json") for name in ("open", joint))
        assert main(["convert", *files, "--joint-thickness", joint]) == 0
        layout = read_layout(tmp_path / f"{joint}.json")
        assert np.ptp(layout.outlines[0], axis=0) == pytest.approx([width, 0.3])
        assert (layout.groups, layout.roles) == (("stones",) * 2, ("moving", ""))
        assert layout.thickness is None
        assert layout.density is None


def test_what_lies_along_one_line_without_facing_is_no_joint(tmp_path):
    """Along the intrados of an arch the next stone is far from most points, and the joint between them narrow."""
    angles = np.linspace(0.0, np.pi, 8)
    rings = []
    for one, other in itertools.pairwise(angles):
        turn = np.array([one + 0.004, other - 0.004])
        inner, outer = (radius * np.stack([np.cos(turn), np.sin(turn)], axis=1) for radius in (2.5, 3.0))
        rings.append(np.array([inner[0], outer[0], outer[1], inner[1]]))
    with pytest.warns(UserWarning, match=r'"auto" found 0.02\d* m$'):
        assembly = read(drawn(tmp_path / "arch.json", rings), joint_thickness="auto", closing="voronoi")
    assert shapely.area(np.array([shapely.Polygon(assembly.outline(k)) for k in range(7)])).max() < 0.65
