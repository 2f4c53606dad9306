"""Contact points: which corners face which edges, with the touching joints of shapely as the independent measure."""

from itertools import combinations, pairwise

import numpy as np
import pytest
import shapely
from structures import rectangle

import solver
from solver import mechanics

#: Kind of a contact point at which a corner meets a corner.
ON_CORNER = 1

SQUARE = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def square(x, y):
    return SQUARE + np.array([x, y])


def find(outlines, roles=None, reach=0.05):
    assembly = solver.Assembly.from_outlines(outlines, roles=roles)
    return assembly, mechanics.find_contacts(assembly, assembly.vertices, reach)


def turned(outline, angle, centre):
    c, s = np.cos(angle), np.sin(angle)
    return (np.asarray(outline, dtype=float) - centre) @ np.array([[c, s], [-s, c]]) + centre


def joint_ends(assembly):
    """Both ends of every straight piece along which two blocks touch, {pair of blocks: sorted points}."""
    polygons = [shapely.Polygon(assembly.outline(i)) for i in range(assembly.n_blocks)]
    ends = {}
    for i, j in combinations(range(assembly.n_blocks), 2):
        if not (assembly.free[i] or assembly.free[j]):
            continue
        shared = shapely.line_merge(shapely.intersection(polygons[i], polygons[j]))
        for line in getattr(shared, "geoms", [shared]):
            if line.geom_type == "LineString":
                corners = np.asarray(line.coords)
                straight = np.split(np.repeat(corners, 2, axis=0)[1:-1], len(corners) - 1)
                ends.setdefault((i, j), []).extend(tuple(p) for piece in straight for p in piece)
    return {pair: sorted(points) for pair, points in ends.items()}


def contact_points(contacts):
    points = {}
    for a, b, p in zip(contacts.block_a, contacts.block_b, contacts.points, strict=True):
        points.setdefault((min(a, b), max(a, b)), []).append(tuple(p))
    return {pair: sorted(found) for pair, found in points.items()}


def assert_joints_have_a_contact_at_each_end(contacts, expected):
    found = contact_points(contacts)
    assert set(found) == set(expected)
    for pair, ends in expected.items():
        assert np.shape(found[pair]) == np.shape(ends), pair
        distance = np.linalg.norm(np.array(found[pair])[:, None] - np.array(ends)[None], axis=2)
        assert distance.min(axis=0).max() < 1e-9, pair
        assert distance.min(axis=1).max() < 1e-9, pair
    assert np.abs(contacts.gaps).max() < 1e-9


def running_bond(bricks, courses, length=2.0, height=1.0):
    outlines = []
    for course in range(courses):
        inner = np.arange(1, 2 * bricks, 2) if course % 2 else np.arange(2, 2 * bricks, 2)
        joints = np.concatenate([[0], inner, [2 * bricks]]) * length / 2
        for left, right in pairwise(joints):
            outlines.append(rectangle(left, course * height, right, (course + 1) * height))
    return outlines


L_BLOCK = [[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3]]

LAYOUTS = {
    "two bricks": [rectangle(0, 0, 2, 1), rectangle(0, 1, 2, 2)],
    "half a brick aside": [rectangle(0, 0, 2, 1), rectangle(1, 1, 3, 2)],
    "a small one on a large one": [rectangle(0, 0, 4, 1), rectangle(1, 1, 2, 2)],
    "stack bond": [rectangle(2 * i, j, 2 * i + 2, j + 1) for i in range(3) for j in range(3)],
    "running bond": running_bond(4, 5),
    "T-junction": [rectangle(0, 0, 2, 1), rectangle(0, 1, 0.7, 2), rectangle(0.7, 1, 2, 2)],
    "in a re-entrant corner": [L_BLOCK, rectangle(1, 1, 2, 2)],
    "filling a re-entrant corner": [L_BLOCK, rectangle(1, 1, 3, 3)],
    "two Ls that interlock": [
        L_BLOCK,
        [[3, 3], [1, 3], [1, 1], [3, 1]],
        [[3, 0], [4, 0], [4, 4], [0, 4], [0, 3], [3, 3]],
    ],
    "U with a plug": [
        [[0, 0], [3, 0], [3, 2], [2, 2], [2, 1], [1, 1], [1, 2], [0, 2]],
        [[1, 1], [2, 1], [2, 2], [3, 2], [3, 3], [0, 3], [0, 2], [1, 2]],
    ],
    "wedges": [[[0, 0], [4, 0], [4, 2]], [[0, 0], [4, 2], [4, 4], [0, 2]]],
}


@pytest.mark.parametrize("name", [name for name in LAYOUTS if name != "stack bond"])
@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 2, 2.5])
def test_every_joint_has_a_contact_at_each_end(name, angle):
    """Neither fewer, nor one twice where corner pairs coincide, nor one where blocks touch at a mere corner."""
    drawn = solver.Assembly.from_outlines(LAYOUTS[name])
    ends = {pair: turned(points, angle, (0.4, 0.2)) for pair, points in joint_ends(drawn).items()}
    _, contacts = find([turned(outline, angle, (0.4, 0.2)) for outline in LAYOUTS[name]])
    assert_joints_have_a_contact_at_each_end(contacts, ends)


@pytest.mark.parametrize("angle", [0.0, 0.3, 0.7, 1.0, 2.5])
def test_diagonal_neighbours_in_stack_bond_do_not_touch(angle):
    _, contacts = find([turned(outline, angle, (0, 0)) for outline in LAYOUTS["stack bond"]])
    apart = np.abs(contacts.block_a - contacts.block_b)
    assert set(apart.tolist()) == {1, 3}
    assert len(contacts) == 2 * 12


@pytest.mark.parametrize("size", [1e-3, 1e-2, 1.0, 10.0])
def test_mixed_sizes(size):
    """A stone of a millimetre on a slab of ten metres, and every other pair."""
    outlines = [rectangle(0, -1, 10, 0), rectangle(3, 0, 3 + size, size)]
    outlines.append(rectangle(3, size, 3.001, size + 0.001))
    assembly, contacts = find(outlines, reach=1e-4)
    assert_joints_have_a_contact_at_each_end(contacts, joint_ends(assembly))
    assert len(contacts) == 4


def test_supports_do_not_touch_supports():
    outlines = [rectangle(0, 0, 2, 1), rectangle(2, 0, 4, 1), rectangle(0, 1, 4, 2)]
    assert len(find(outlines)[1]) == 6
    _, contacts = find(outlines, roles=["fixed", "moving", "free"])
    assert len(contacts) == 4
    assert ((contacts.block_a == 2) | (contacts.block_b == 2)).all()


@pytest.mark.parametrize("gap", [0.0, 0.01, 0.049])
def test_open_joint_within_reach(gap):
    _, contacts = find([rectangle(0, 0, 2, 1), rectangle(0.5, 1 + gap, 1.5, 2)])
    assert contacts.gaps == pytest.approx([gap, gap], abs=1e-12)


def test_joint_beyond_reach_is_none():
    assert len(find([rectangle(0, 0, 2, 1), rectangle(0.5, 1.051, 1.5, 2)])[1]) == 0


@pytest.mark.parametrize("angle", [1e-3, 0.01, 0.1, 0.3])
@pytest.mark.parametrize("frame", [0.0, 1.1])
@pytest.mark.parametrize("right", [True, False])
def test_hinge_of_a_turned_block(angle, frame, right):
    """A block turned about a corner keeps that corner, with the normal half-way between the two faces."""
    corner = np.array([1.0 if right else 0.0, 1.0])
    sense = -1.0 if right else 1.0
    upper = turned(square(0, 1), sense * angle, corner)
    outlines = [turned(outline, frame, (0, 0)) for outline in (SQUARE, upper)]
    _, contacts = find(outlines, reach=0.01)
    hinge = turned(corner[None], frame, (0, 0))[0]
    at_hinge = np.flatnonzero(np.hypot(*(contacts.points - hinge).T) < 1e-9)
    assert len(at_hinge) == 1
    k = at_hinge[0]
    assert contacts.features[k, 0] == ON_CORNER
    assert abs(contacts.gaps[k]) < 1e-12
    half_way = np.pi / 2 + sense * angle / 2 + frame
    normal = contacts.frames[k, 0] * (1 if contacts.block_a[k] == 1 else -1)
    assert normal == pytest.approx([np.cos(half_way), np.sin(half_way)], abs=1e-12)
    # The other corners have opened by sin(angle); seen from either block they are kept while that is within reach.
    others = np.delete(contacts.gaps, k)
    assert others == pytest.approx(np.full(len(others), np.sin(angle)), rel=1e-2)
    assert (len(others) > 0) == (np.sin(angle) < 0.01)


@pytest.mark.parametrize("past", [0.0, 1e-4, 1e-3, 0.02])
def test_corner_past_the_end_of_an_edge_does_not_touch(past):
    assert len(find([SQUARE, square(1 + past, 1)])[1]) == 0


@pytest.mark.parametrize("bearing", [1e-4, 1e-3, 0.02])
def test_narrow_bearing_is_a_joint(bearing):
    assert len(find([SQUARE, square(1 - bearing, 1)])[1]) == 2


def test_drift_of_a_hair_keeps_the_hinge():
    """A corner a millionth of the edge past the other, as after a finite rotation, stays one contact."""
    for drift in (-1e-6, 1e-6):
        upper = turned(square(drift, 1), -0.05, (1 + drift, 1))
        _, contacts = find([SQUARE, upper], reach=0.01)
        assert len(contacts) == 1
        assert contacts.features[0, 0] == ON_CORNER


@pytest.mark.parametrize("name", [name for name in LAYOUTS if name != "stack bond"])
def test_frames(name):
    """Orthonormal, the normal from block b into block a, the tangent a quarter turn counter-clockwise."""
    assembly, contacts = find([turned(outline, 0.7, (0, 0)) for outline in LAYOUTS[name]])
    n, t = contacts.frames[:, 0], contacts.frames[:, 1]
    assert np.abs(contacts.frames @ contacts.frames.transpose(0, 2, 1) - np.eye(2)).max() < 1e-12
    assert np.abs(t - np.stack([-n[:, 1], n[:, 0]], axis=1)).max() < 1e-12
    polygons = [shapely.Polygon(assembly.outline(i)) for i in range(assembly.n_blocks)]
    # A contact at the end of a joint: step along the joint to its inside before looking to either side.
    for k in range(len(contacts)):
        a, b = polygons[contacts.block_a[k]], polygons[contacts.block_b[k]]
        inside = [contacts.points[k] + step * t[k] for step in (-1e-3, 1e-3)]
        assert any(a.contains(shapely.Point(p + 1e-4 * n[k])) for p in inside)
        assert any(b.contains(shapely.Point(p - 1e-4 * n[k])) for p in inside)


def test_gaps_follow_the_moved_block():
    """To first order a gap changes by normal · (displacement of a - displacement of b), the slip by the tangent's."""
    assembly, before = find(LAYOUTS["running bond"], reach=0.3)
    random = np.random.default_rng(3)
    q = 1e-6 * random.normal(size=(assembly.n_blocks, 3))
    pose = solver.Pose(assembly.centroids + q[:, :2], q[:, 2:])
    after = assembly.shapes.measure(mechanics.moved_vertices(assembly, pose), before)
    # Work of a unit force at each contact point.
    units = np.eye(2 * len(before)).reshape(-1, len(before), 2)
    start = solver.Pose.initial(assembly)
    relative = np.array([(mechanics.block_forces(before, start, unit) * q).sum() for unit in units])
    assert np.abs(after.gaps - before.gaps - relative[0::2]).max() < 1e-10
    assert np.abs(after.slip[:, 0] - before.slip[:, 0] - relative[1::2]).max() < 1e-10


def test_forces_of_contact_points_give_resultants():
    """Forces on a block and its neighbours cancel in sum, moments about any point included."""
    assembly, contacts = find(LAYOUTS["running bond"])
    forces = np.random.default_rng(4).normal(size=(len(contacts), 2))
    pose = solver.Pose.initial(assembly)
    resultants = mechanics.block_forces(contacts, pose, forces)
    assert np.abs(resultants[:, :2].sum(axis=0)).max() < 1e-12
    moment = assembly.centroids[:, 0] * resultants[:, 1] - assembly.centroids[:, 1] * resultants[:, 0]
    assert abs((moment + resultants[:, 2]).sum()) < 1e-11
    assert np.abs(resultants).max() > 1.0


@pytest.mark.parametrize("mu", [-0.1, np.nan, np.inf])
def test_impossible_friction_is_refused(mu):
    with pytest.raises(ValueError, match="friction_coefficient"):
        solver.InterfaceLaw(mu)


def test_friction_of_pairs_of_materials():
    assembly = solver.Assembly.from_outlines([SQUARE, square(0, 1), square(0, 2)], materials=["a", "b", "a"])
    laws = solver.Interfaces(solver.InterfaceLaw(0.5), {("b", "a"): solver.InterfaceLaw(0.2)})
    first, second = np.array([0, 1, 2, 0]), np.array([1, 0, 1, 2])
    assert laws.friction(assembly, first, second).tolist() == [0.2, 0.2, 0.2, 0.5]


def test_a_pair_of_materials_with_two_laws_is_refused():
    laws = {("a", "b"): solver.InterfaceLaw(0.1), ("b", "a"): solver.InterfaceLaw(0.9)}
    with pytest.raises(ValueError, match="interface of 'a' and 'b' has another law as 'b' and 'a'; give one"):
        solver.Interfaces(pairs=laws)
    same = solver.Interfaces(pairs=dict.fromkeys(laws, solver.InterfaceLaw(0.1)))
    assert len(same.laws) == 3


def depths(outlines, tolerance=1e-6):
    assembly = solver.Assembly.from_outlines(outlines)
    i, j, depth = mechanics.overlap_depths(assembly.vertices, assembly.offsets, tolerance)
    return dict(zip(zip(i.tolist(), j.tolist(), strict=True), depth.tolist(), strict=True))


@pytest.mark.parametrize("angle", [0.0, 0.5])
@pytest.mark.parametrize(
    ("first", "second", "least", "most"),
    [
        pytest.param(rectangle(0, 0, 4, 4), rectangle(1, 1, 2, 2), 0.4, 2.0, id="nested"),
        pytest.param(rectangle(0, 0, 2, 1), rectangle(0, 0, 2, 1), 0.4, 1.0, id="identical"),
        pytest.param(rectangle(-2, 0, 2, 1), rectangle(0, -2, 1, 2), 0.4, 2.5, id="crossed"),
        pytest.param(rectangle(0, 0, 2, 1), rectangle(1.9, 0, 3, 1), 0.05, 0.1, id="by a tenth, equally high"),
        pytest.param(rectangle(0, 0, 2, 1), rectangle(1.9, 0.2, 3, 0.8), 0.09, 0.1, id="by a tenth, less high"),
        pytest.param(rectangle(0, 0, 2, 1), rectangle(1.9, 0.5, 3, 1.5), 0.09, 0.1, id="by a tenth, aside"),
        pytest.param(L_BLOCK, rectangle(0.9, 1, 2, 2), 0.05, 0.1, id="into an L"),
    ],
)
def test_overlap_depth(first, second, least, most, angle):
    """The depth is a lower bound of the way out, and not a small one."""
    found = depths([turned(first, angle, (0, 0)), turned(second, angle, (0, 0))])
    assert set(found) == {(0, 1)}
    assert least - 1e-9 <= found[0, 1] <= most + 1e-9


@pytest.mark.parametrize("name", LAYOUTS)
def test_blocks_that_merely_touch_do_not_overlap(name):
    assert depths([turned(outline, 0.3, (0, 0)) for outline in LAYOUTS[name]]) == {}


def test_overlaps_are_those_of_shapely():
    random = np.random.default_rng(11)
    outlines = [
        turned(rectangle(0, 0, *random.uniform(0.3, 1.5, 2)), random.uniform(0, 3), (0, 0)) + random.uniform(0, 6, 2)
        for _ in range(40)
    ]
    polygons = [shapely.Polygon(outline) for outline in outlines]
    overlapping = {(i, j) for i, j in combinations(range(40), 2) if polygons[i].intersection(polygons[j]).area > 0}
    found = depths(outlines, 1e-9)
    assert set(found) == overlapping
    assert len(overlapping) > 10
    for (i, j), depth in found.items():
        # No wider than the overlap itself: its area is at most its length times its width.
        shared = polygons[i].intersection(polygons[j])
        assert depth <= np.sqrt(polygons[i].area + polygons[j].area)
        assert shared.area > 0.1 * depth**2


def test_where_three_blocks_meet_two_corners_touch_along_their_closest_faces_only():
    """A slab, a post that leans over it, a wedge between them: the wedge's faces do not hold slab and post apart."""
    slab = [[0, 0], [2.4, 0], [2, 1], [0, 1]]
    post = [[2.4, 0], [3, 0], [3, 2], [1.61, 2], [2, 1]]
    wedge = [[0, 1], [2, 1], [1.61, 2], [0, 2]]
    assembly = solver.Assembly.from_outlines([slab, post, wedge])
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 1e-3)
    pair = {*zip(contacts.block_a.tolist(), contacts.block_b.tolist(), strict=True)} & {(0, 1), (1, 0)}
    chosen = np.array([(a, b) in pair for a, b in zip(contacts.block_a, contacts.block_b, strict=True)])
    assert sorted(contacts.points[chosen].tolist()) == [[2.0, 1.0], [2.4, 0.0]]
    across = np.array([1.0, 0.4]) / np.hypot(1.0, 0.4)
    np.testing.assert_allclose(np.abs(contacts.frames[chosen, 0] @ across), 1.0)


@pytest.mark.parametrize("flip", [1, -1])
@pytest.mark.parametrize(("under", "lip"), [(0.004, 0.03), (0.012, 0.008), (0.03, 0.002)])
@pytest.mark.parametrize("below", [0.0, 0.003])
def test_a_stone_whose_tenon_is_under_a_lip_does_not_rest_on_it(under, lip, below, flip):
    """Its only bed is to the right of its centroid: the upper face of the lip is behind the lower one."""
    held = [[0, -0.5], [0.95, -0.5], [0.95, under], [1, under], [1, under + lip], [0, under + lip]]
    stone = [[0.95, 0], [2, 0], [2, 0.5], [1, 0.5], [1, under - below], [0.95, under - below]]
    bed = [[1.8, -0.5], [2.2, -0.5], [2.2, 0], [1.8, 0]]
    outlines = [[[flip * x, y] for x, y in outline][::flip] for outline in (held, stone, bed)]
    assembly = solver.Assembly.from_outlines(outlines, roles=["fixed", "free", "fixed"])
    found = solver.Structure(assembly, friction_coefficient=0.6).limit_load(acceleration=(flip, 0))
    assert found.status is solver.LimitStatus.NO_EQUILIBRIUM


@pytest.mark.parametrize("inside", [0.0, 5e-6, 2e-5, 4e-4])
def test_a_stone_in_a_re_entrant_corner_stands_on_both_faces_however_far_it_is_in_one(inside):
    """The corner is past the end of the bed, where there is still the block."""
    angle = [[inside, 0], [3, 0], [3, -1], [-1, -1], [-1, 2], [inside, 2]]
    assembly = solver.Assembly.from_outlines([angle, SQUARE], roles=["fixed", "free"])
    for way, expected in ((1, 0.6), (-1, np.inf)):
        found = solver.Structure(assembly, friction_coefficient=0.6).limit_load(acceleration=(way, 0))
        assert found.multiplier == pytest.approx(expected)
