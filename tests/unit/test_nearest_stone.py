"""Rubble: irregular stones with mortar of any width, closed by giving the mortar to the nearest stone."""

import numpy as np
import pytest
import shapely

import solver
from blockvis import run_case
from blockvis.layout.assemble import assemble
from blockvis.layout.joints.close import close_joints, proposed
from blockvis.layout.joints.facing_edges import proposed_thickness
from blockvis.layout.joints.nearest_stone import share_out
from blockvis.layout.layout import Layout
from solver import mechanics

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


@pytest.mark.parametrize("seed", range(2))
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


def test_stones_end_where_an_uneven_ground_begins():
    x = np.linspace(-0.1, WIDTH + 0.1, 60)
    top = np.column_stack([x, 0.012 * np.sin(25.0 * x) - 0.012])
    ground = [*top[::-1].tolist(), [x[0], -0.2], [x[-1], -0.2]]
    stones = rubble(0)
    closed = close_joints([*stones, np.array(ground)], 0.05, anchored=np.arange(46) == 45, way="voronoi").outlines
    shapes = np.array([shapely.Polygon(ring) for ring in closed])
    assert shapely.is_valid(shapes).all()
    assert shapely.area(shapes).sum() == pytest.approx(shapely.union_all(shapes).area, rel=1e-9)
    pockets = [shapely.Polygon(hole) for part in [shapely.union_all(shapes)] for hole in part.interiors]
    assert sum(pocket.area for pocket in pockets) < 1e-9
    assert np.array_equal(closed[45], np.array(ground))


def test_supports_stay_and_stones_come_to_them():
    stones = rubble(2)
    ground = [np.array(support["outline"]) for support in GROUND]
    still = np.arange(len(stones) + 2) >= len(stones)
    closed = share_out([*stones, *ground], 0.04, still)
    assert (closed[-1] == ground[1]).all()
    assert min(ring[:, 1].min() for ring in closed[:-2]) == pytest.approx(0.0, abs=1e-12)


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
    assert assembly.edge_lengths.min() > 1e-3
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
    assert proposed(rings).way == "faces"
    assert proposed(rubble(1)).way == "voronoi"
    assert close_joints(rings[:4], 0.01, way="voronoi").way == "voronoi"


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_mortar_that_is_drawn_is_given_away_however_wide_and_openings_in_it_stay(tmp_path):
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
