"""Contact points in space where it is difficult: other descriptions, tips and ridges, drawings a little off."""

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import HalfspaceIntersection
from structures import box, hull_of, layout_of, of_cubes, turn_by

import solver
from blockvis import generators
from solver import mechanics


def dome():
    return layout_of(generators.dome(lunes=10, courses=5, thickness_ratio=0.15, cap=15.0)).solids


#: Two walls that meet where headers and stretchers alternate, and a hemisphere under a polygonal cap.
STRUCTURES = {"corner": lambda: layout_of(generators.l_corner(bricks=3, across=3, courses=4)).solids, "dome": dome}


def found(solids, reach=0.01):
    assembly = solver.Assembly.from_solids(solids)
    return mechanics.find_contacts(assembly, assembly.vertices, reach)


def table(contacts, number=None, turn=None):
    """Blocks, place, normal into the lower number and gap of each point, sorted."""
    number = np.arange(1000) if number is None else number
    turn = np.eye(3) if turn is None else turn
    a, b = number[contacts.block_a], number[contacts.block_b]
    sense = np.where(a > b, -1.0, 1.0)[:, None]
    rows = np.column_stack(
        [
            np.minimum(a, b),
            np.maximum(a, b),
            contacts.points @ turn,
            sense * contacts.frames[:, 0] @ turn,
            contacts.gaps,
        ]
    )
    return rows[np.lexsort(np.round(rows[:, ::-1], 5).T)]


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize(
    "change",
    [
        pytest.param("turned", marks=pytest.mark.thorough),
        "mirrored",
        "renumbered",
        pytest.param("far away", marks=pytest.mark.thorough),
        "drawn otherwise",
    ],
)
def test_the_same_structure_has_the_same_points(structure, change):
    random = np.random.default_rng(5)
    solids = STRUCTURES[structure]()
    expected = table(found(solids))
    assert len(expected) > 200
    number, turn, shift = np.arange(len(solids)), np.eye(3), np.zeros(3)
    if change == "turned":
        turn = turn_by([0.3, -1.1, 0.6])
    if change == "mirrored":
        turn = np.diag([-1.0, 1.0, 1.0])
    if change == "far away":
        shift = np.array([4e5, 5e6, 300.0])
    other = [(corners @ turn.T + shift, faces) for corners, faces in solids]
    if change == "renumbered":
        number = random.permutation(len(solids))
        other = [other[k] for k in number]
    if change == "drawn otherwise":
        other = []
        for corners, faces in solids:
            order = random.permutation(len(corners))
            place = np.argsort(order)
            other.append((corners[order], [np.roll(place[face], random.integers(9)).tolist() for face in faces[::-1]]))
    contacts = found(other)
    rows = table(contacts, number, turn)
    rows[:, 2:5] -= shift
    loose = 1e-7 if change == "far away" else 1e-9
    np.testing.assert_allclose(rows, expected, atol=loose)


def test_every_joint_of_a_dome_has_its_four_corners():
    contacts = found(dome())
    lunes, courses = 10, 5
    pairs, joint = contacts.joints()
    # In the meridians, those of the supports too; between courses; under the cap and on the supports.
    assert len(pairs) == lunes * (courses + 1) + lunes * (courses - 1) + 2 * lunes
    assert set(np.bincount(joint)) == {4}


@pytest.mark.parametrize("lean", [0.0, 0.2, 0.6, 0.95])
def test_a_ridge_stands_on_a_plane(lean):
    """A roof upside down, its ridge on a slab, its flanks from flat to steep, leaning to one side."""
    for half in (0.05, 0.3, 0.8, 1.4):
        ring = np.array([[0, -0.5], [0, 0.5]])
        ends = np.column_stack([np.zeros(2), ring[:, 1], np.zeros(2)])
        flank = np.array([np.sin(half), 0.0, np.cos(half)])
        points = np.concatenate([ends, ends + flank, ends + flank * [-1, 1, 1]])
        turn = turn_by([0.0, lean * (np.pi / 2 - half), 0.0])
        contacts = found([box((-2, -2, -1), (2, 2, 0)), hull_of(points @ turn.T)], 1e-6)
        closed = contacts[np.abs(contacts.gaps) < 1e-9]
        np.testing.assert_allclose(closed.points[np.argsort(closed.points[:, 1])][[0, -1]], ends, atol=1e-9)
        normals = closed.frames[:, 0] * np.where(closed.block_a == 1, 1.0, -1.0)[:, None]
        np.testing.assert_allclose(normals, [[0.0, 0.0, 1.0]] * len(closed), atol=1e-9)


@pytest.mark.parametrize("ends", [(-9.0, 9.0), (-9.0, 0.2), (-0.3, 0.2)])
def test_a_stone_on_an_edge_bears_on_both_ends_of_what_lies_on_the_slab(ends):
    """Whichever of its faces opposes the slab best: of flat stones often one that has one end of the edge, or none."""
    random = np.random.default_rng(18)
    for _ in range(6):
        points = random.normal(size=(8, 3))
        corners, faces = hull_of(points / np.linalg.norm(points, axis=1)[:, None] * [1.0, 0.25, 1.0])
        edge = corners[faces[0][:2]]
        sides = [corners[face[:3]] for face in faces if {*faces[0][:2]} <= {*face}]
        normals = np.array([np.cross(side[1] - side[0], side[2] - side[0]) for side in sides])
        up = -(normals / np.linalg.norm(normals, axis=1)[:, None]).T @ random.dirichlet([3.0, 3.0])
        length, up = np.linalg.norm(edge[1] - edge[0]), up / np.linalg.norm(up)
        along = (edge[1] - edge[0]) / length
        stone = (corners - edge.mean(axis=0)) @ np.array([along, np.cross(up, along), up]).T
        slab, way = box((ends[0] * length, -3, -1), (ends[1] * length, 3, 0)), turn_by(random.normal(size=3))
        contacts = found([(slab[0] @ way.T, slab[1]), (stone @ way.T, faces)])
        closed = contacts.points[np.abs(contacts.gaps) < 1e-9] @ way
        expected = [[place * length, 0.0, 0.0] for place in np.clip(ends, -0.5, 0.5)]
        np.testing.assert_allclose(closed[np.argsort(closed[:, 0])], expected, atol=1e-9)


@pytest.mark.parametrize("ends", [0.5, 2.0])
def test_a_slab_lies_on_a_knife(ends):
    """Whose flanks do not face it, and which ends under it or goes on beyond its edges."""
    ridge = np.array([[0.0, -ends, 0.0], [0.0, ends, 0.0]])
    knife = hull_of(np.concatenate([ridge, ridge - [0.01, 0.0, 0.4], ridge - [-0.01, 0.0, 0.4]]))
    contacts = found([knife, box((-2, -1, 0), (2, 1, 0.1))])
    np.testing.assert_allclose(np.sort(contacts.points[:, 1]), [-min(ends, 1.0), min(ends, 1.0)], atol=1e-9)
    np.testing.assert_allclose(contacts.gaps, 0.0, atol=1e-9)


@pytest.mark.parametrize("half", [0.02, 0.3, 0.8, 1.4])
def test_a_tip_stands_on_a_plane(half):
    around = 2 * np.pi * np.arange(5) / 5
    ring = np.column_stack([np.sin(half) * np.cos(around), np.sin(half) * np.sin(around), np.full(5, np.cos(half))])
    contacts = found([box((-2, -2, -1), (2, 2, 0)), hull_of(np.concatenate([[[0.0, 0.0, 0.0]], ring]))], 1e-6)
    np.testing.assert_allclose(contacts.points, [[0.0, 0.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(contacts.gaps, 0.0, atol=1e-9)


@pytest.mark.parametrize("chamfer", [0.3, 0.02])
def test_a_tip_stands_on_a_plane_though_flatter_faces_beside_it_oppose_that_better(chamfer):
    """A pyramid on its tip, whose ridges are cut by flatter faces from a height on."""
    directions = np.pi / 4 * np.arange(8)
    steep = np.radians(np.where(np.arange(8) % 2, 71.0, 75.0))
    normals = np.column_stack([np.sin(steep) * np.cos(directions), np.sin(steep) * np.sin(directions), -np.cos(steep)])
    radius = chamfer * np.sqrt(2.0) / np.tan(np.radians(75.0))
    corner = np.column_stack([radius * np.cos(directions), radius * np.sin(directions), np.full(8, chamfer)])
    offsets = np.where(np.arange(8) % 2, -(normals * corner).sum(axis=1), 0.0)
    planes = np.vstack([np.column_stack([normals, offsets]), [0.0, 0.0, 1.0, -1.0]])
    corners = HalfspaceIntersection(planes, np.array([0.0, 0.0, 0.5])).intersections
    contacts = found([box((-2, -2, -1), (2, 2, 0)), hull_of(np.unique(corners.round(12), axis=0))], 1e-6)
    np.testing.assert_allclose(contacts.points, [[0.0, 0.0, 0.0]], atol=1e-9)


def touching(lower, upper, way):
    """The corners of the upper one moved along a way until the two convex bodies just touch."""
    n, m = len(upper), len(lower)
    equal = np.zeros((5, n + m + 1))
    equal[:3, :n], equal[:3, n:-1], equal[:3, -1] = upper.T, -lower.T, way
    equal[3, :n] = equal[4, n:-1] = 1.0
    cost = np.append(np.zeros(n + m), -1.0)
    bounds = [(0.0, None)] * (n + m) + [(None, None)]
    return upper + linprog(cost, A_eq=equal, b_eq=[0, 0, 0, 1, 1], bounds=bounds).x[-1] * way


@pytest.mark.parametrize("tilt", [0.1, 0.5, 3.0])
@pytest.mark.parametrize("corners", [8, 14])
@pytest.mark.slow
def test_bodies_that_touch_have_a_point_there(corners, tilt):
    """However tips, edges and faces come to lie on each other; bricks and frustums, or any convex bodies."""
    random = np.random.default_rng(corners)
    unit = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]) / 2.0
    missed = []
    for scene in range(40):
        bodies = []
        for _ in range(2):
            body = unit * random.uniform(0.3, 1.0, 3) if corners == 8 else random.normal(size=(corners, 3))
            body[4:8, :2] *= random.uniform(0.7, 1.0)
            bodies.append(body @ turn_by(tilt * random.normal(size=3)).T)
        way = np.append(0.3 * random.normal(size=2), 1.0)
        upper = touching(*bodies, way / np.linalg.norm(way))
        contacts = found([hull_of(bodies[0]), hull_of(upper)], 0.1)
        missed += [scene] if np.abs(contacts.gaps).min(initial=np.inf) > 1e-6 else []
    assert not missed


@pytest.mark.parametrize(("lean", "roll"), [(1.0, 5.0), (5.0, 1.0), (10.0, 10.0), (15.0, 15.0)])
def test_a_lintel_lies_on_the_edges_of_leaning_piers(lean, roll):
    """Its lower edge across one of either pier, which oppose it by -0.98; pushed along it slides at about μ."""

    def turned(solid, rotation, about):
        corners, faces = solid
        return (corners - about) @ turn_by(np.radians(rotation)).T + about, faces

    solids = [
        turned(box((-1, -1.6, -1), (1, -1, 0)), (lean, 0, 0), (0, -1, 0)),
        turned(box((-1, 1, -1), (1, 1.6, 0)), (-lean, 0, 0), (0, 1, 0)),
        turned(box((0.3, -0.1, -1), (0.4, 0.1, 0)), (0, -roll, 0), (0, 0, 0)),
        turned(box((0, -1.3, 0), (0.4, 1.3, 0.3)), (0, -roll, 0), (0, 0, 0)),
    ]
    assembly = solver.Assembly.from_solids(solids, roles=["fixed"] * 3 + ["free"])
    along = solver.weight_fraction(assembly, (0.0, 1.0, 0.0))
    limit = solver.Structure(assembly, friction_coefficient=0.6).with_live(along).limit_load()
    assert limit.multiplier == pytest.approx(0.6, abs=0.01)


@pytest.mark.parametrize("angle", [0.02, 0.049, 0.051, 0.2, 1.0, np.pi / 4])
@pytest.mark.parametrize("shift", [0.0, 1e-7, 1e-3, 0.1])
def test_a_brick_turned_on_a_brick_bears_on_all_of_both(angle, shift):
    """No corner of the polygon is lost, whichever way corners and edges lie on each other."""
    import shapely

    corners, faces = box((0, 0, 0), (1, 0.4, 0.2))
    turn = turn_by([0.0, 0.0, angle])
    above = corners @ turn.T + [shift, 0.0, 0.2]
    contacts = found([(corners, faces), (above, faces)])
    first, second = shapely.Polygon(corners[:4, :2]), shapely.Polygon(above[:4, :2])
    assert contacts.areas.sum() == pytest.approx((first & second).area, rel=1e-4)
    hull = shapely.MultiPoint(contacts.points[:, :2]).convex_hull
    assert hull.area == pytest.approx((first & second).area, rel=1e-4)
    np.testing.assert_allclose(contacts.gaps, 0.0, atol=1e-12)


@pytest.mark.parametrize("off", [pytest.param(1e-4, marks=pytest.mark.thorough), 1e-3])
@pytest.mark.parametrize("structure", STRUCTURES)
def test_drawings_a_little_off_keep_their_joints(structure, off):
    """Each stone larger or smaller, shifted and turned by a thousandth: every joint keeps its area and three points."""
    random = np.random.default_rng(8)
    solids = STRUCTURES[structure]()
    expected = found(solids)
    pairs, joint = expected.joints()
    area = np.bincount(joint, expected.areas)
    size = 0.1
    other = []
    for corners, faces in solids:
        middle = corners.mean(axis=0)
        turn = turn_by(random.normal(size=3) * off)
        grown = (corners - middle) * (1.0 + random.uniform(-off, off)) @ turn.T
        other.append((middle + grown + random.uniform(-1, 1, 3) * off * size, faces))
    contacts = found(other)
    for (i, j), expected_area in zip(pairs, area, strict=True):
        here = (np.minimum(contacts.block_a, contacts.block_b) == i) & (
            np.maximum(contacts.block_a, contacts.block_b) == j
        )
        assert here.sum() >= 3, (i, j)
        assert contacts.areas[here].sum() == pytest.approx(expected_area, rel=0.05), (i, j)


@pytest.mark.parametrize("scene", [*range(12), *(pytest.param(k, marks=pytest.mark.thorough) for k in range(12, 40))])
def test_overlaps_are_those_that_share_volume(scene):
    manifold = pytest.importorskip("manifold3d")
    random = np.random.default_rng(scene)
    stones = [random.normal(size=(10, 3)) * 0.5 + shift for shift in ([0, 0, 0], random.normal(size=3) * 0.9)]
    shapes = solver.Assembly.from_solids([hull_of(stone) for stone in stones]).shapes
    one, two = (manifold.Manifold.hull_points(stone) for stone in stones)
    shared = (one ^ two).volume()
    _, _, depth = shapes.overlaps(shapes.vertices, 1e-4)
    if len(depth) == 0:
        assert shared < 1e-6
        return
    assert shared > 0.0
    # Moved apart by the depth, and a little more, along some direction they no longer share anything.
    directions = random.normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    ways = min(
        (np.max(stones[0] @ direction) - np.min(stones[1] @ direction))
        for direction in np.concatenate([directions, -directions])
    )
    assert depth[0] <= ways + 1e-9


def test_a_joint_that_is_a_little_warped_is_closed_at_its_corners():
    lower, faces = box((0, 0, 0), (1, 0.8, 0.5))
    upper, _ = box((0, 0, 0.5), (1, 0.8, 1.0))
    lower[6, 2] = upper[2, 2] = 0.5 + 2e-4
    contacts = found([(lower, faces), (upper, faces)])
    assert len(contacts) == 4
    np.testing.assert_allclose(contacts.gaps, 0.0, atol=1e-12)


def test_edges_across_each_other_are_one_point():
    """Two roofs, ridge across ridge, so flat that their flanks cover each other too."""
    ends = np.array([[-1.0, 0, 0], [1, 0, 0]])
    flank = np.array([0.0, 1.0, -0.3])
    lower = np.concatenate([ends, ends + flank, ends + flank * [1, -1, 1]])
    upper = lower[:, [1, 0, 2]] * [1, 1, -1]
    contacts = found([hull_of(lower), hull_of(upper)], 1e-6)
    np.testing.assert_allclose(contacts.points, [[0.0, 0.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(np.abs(contacts.frames[:, 0, 2]), 1.0)


@pytest.mark.parametrize("bonded", [pytest.param(True, marks=pytest.mark.thorough), False])
def test_contact_points_do_not_depend_on_how_corners_are_numbered(bonded):
    """Stones on the groins are cut into convex parts, in one of two ways that are as good."""
    vault = generators.cross_vault(voussoirs=7, stone=1.2, bonded=bonded)
    found = []
    for seed in (None, 5):
        solids = []
        for block in range(vault.n_blocks):
            vertices, faces = vault.polyhedra.surface(block)
            order = np.arange(len(vertices)) if seed is None else np.random.default_rng(seed).permutation(len(vertices))
            number = np.argsort(order)
            solids.append((vertices[order], [[int(number[k]) for k in face] for face in faces]))
        assembly = solver.Assembly.from_solids(solids)
        contacts = mechanics.find_contacts(assembly, assembly.vertices, 1e-6)
        points = np.column_stack([contacts.points, np.abs(contacts.frames[:, 0])])
        order = np.lexsort(points.round(6).T)
        found.append(np.column_stack([points, contacts.areas])[order])
    assert found[0].shape == found[1].shape
    np.testing.assert_allclose(found[1], found[0], atol=1e-9)


@pytest.mark.slow
def test_contact_points_do_not_depend_on_which_pairs_are_worked_on_together(monkeypatch):
    """Stones with other numbers of corners stand in one array, filled up; one by one nothing is filled."""
    vault = generators.cross_vault(voussoirs=3, stone=1.2)
    random, middles = np.random.default_rng(7), vault.centroids[vault.polyhedra.block_of_vertex]
    turns = np.array([turn_by(vector) for vector in random.normal(0.0, 0.02, (vault.n_blocks, 3))])
    arms = vault.vertices - middles
    moved = middles + np.einsum("nij,nj->ni", turns[vault.polyhedra.block_of_vertex], arms)
    together = mechanics.find_contacts(vault, moved, 0.1)
    monkeypatch.setattr("solver.geometry.portions.PORTION", 1)
    one_by_one = mechanics.find_contacts(vault, moved, 0.1)
    assert set(together.features[:, 0]) == {0, 2}, "corners in faces, and edges across each other"
    for name in ("features", "points", "frames", "gaps", "slip", "areas"):
        np.testing.assert_array_equal(getattr(one_by_one, name), getattr(together, name))


def about_z(turn):
    """Rows turned about the vertical axis."""
    return turn_by([0.0, 0.0, turn]).T


@pytest.mark.parametrize("turn", [0.0, 0.3, np.pi / 2])
def test_a_stone_beside_a_ledge_is_not_held_by_the_corner_in_which_that_ends(turn):
    """Pressed onto a face by four times its weight, with air below it: it slides down at 4 μ - 1."""
    corners, faces = of_cubes([(0, 0, 1), (1, 0, 1), (0, 1, 1), (0, 0, 2), (1, 0, 2)])
    stone, sides = box((1, 1, 2), (2, 2, 3))
    solids = [(corners @ about_z(turn), faces), (stone @ about_z(turn), sides)]
    assembly = solver.Assembly.from_solids(solids, roles=["fixed", "free"])
    dead = solver.self_weight(assembly).dead.copy()
    weight = -dead[1, 2]
    dead[1, :3] += 4.0 * weight * np.array([0.0, -1.0, 0.0]) @ about_z(turn)
    live = np.zeros_like(dead)
    live[1, 2] = -weight
    structure = solver.Structure(assembly, friction_coefficient=0.5, loads=solver.Loads(dead, live))
    assert structure.limit_load().multiplier == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_a_stone_over_a_pit_of_its_size_is_not_held_by_the_ledges_beside_it(turn):
    """Without friction nothing holds it, though its lower edges lie along those of the ledges."""
    pit = [(x, y, 0) for x in range(3) for y in range(3) if (x, y) != (1, 1)]
    corners, faces = of_cubes([*pit, *((x, y, 1) for x in range(3) for y in (0, 2))])
    stone, sides = box((1, 1, 1), (2, 2, 2))
    solids = [(corners @ about_z(turn), faces), (stone @ about_z(turn), sides)]
    assembly = solver.Assembly.from_solids(solids, roles=["fixed", "free"])
    found = solver.Structure(assembly, friction_coefficient=0.0).limit_load(acceleration=(1, 0, 0))
    assert found.status == "no equilibrium"


@pytest.mark.parametrize("foot", [(0, 0, 0), (0, 1, 0)])
@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_a_stone_that_leans_over_the_top_of_another_slides_however_that_is_cut(foot, turn):
    """A quarter is left out of the plate below: where it is cut ends the stone, whose side overhangs by 31 degrees."""
    plate, faces = of_cubes({(x, y, 0) for x in (0, 1) for y in (0, 1)} - {foot})
    stone, sides = of_cubes([(1, 1, 1)])
    stone = np.where(stone[:, 2:] > 1.0, stone - [0.0, 0.3, 0.5], stone)
    solids = [(plate @ about_z(turn), faces), (stone @ about_z(turn), sides)]
    structure = solver.Structure(
        solver.Assembly.from_solids(solids, roles=["fixed", "free"]), friction_coefficient=0.15
    )
    for way in ((0, -1, 0), (0, 1, 0), (1, 0, 0)):
        found = structure.limit_load(acceleration=tuple(np.array(way) @ about_z(turn)))
        assert found.multiplier == pytest.approx(0.15, rel=1e-6)
