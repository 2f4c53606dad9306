"""Contact polygons in space: the same as those of coal, and of the plane where that is extruded."""

from pathlib import Path

import numpy as np
import pytest
import shapely
from scipy.spatial import Voronoi, cKDTree
from structures import assembly_of, hull_of, turn_by, upright

import solver
from blockvis import generators, read_case
from solver import mechanics

#: Here coal 3.0.3 gives a polygon of half the area, whose corners are on no edge of the faces.
LOST_BY_COAL = 4


def random_stone(random, bottom):
    """A frustum on an irregular polygon, its bottom or top at z = 0."""
    n = random.integers(3, 8)
    angles = 2.0 * np.pi * (np.arange(n) + random.uniform(-0.3, 0.3, n)) / n
    radius = random.uniform(0.5, 1.5)
    ring = radius * np.column_stack([np.cos(angles), np.sin(angles)])
    top = np.column_stack([ring * random.uniform(0.3, 0.9), np.full(n, 1.0 if bottom else -1.0)])
    return np.concatenate([np.column_stack([ring, np.zeros(n)]), top])


def coal_polygon(first, second):
    coal = pytest.importorskip("coal", reason="coal, the oracle for contact polygons, is not installed")

    def convex(points):
        vector = coal.StdVec_Vec3s()
        for point in points:
            vector.append(point)
        return coal.Convex.convexHull(vector, True, "Qt")

    one, two, nowhere = convex(first), convex(second), coal.Transform3s()
    request, result = coal.CollisionRequest(), coal.CollisionResult()
    request.security_margin, request.enable_contact = 1e-3, True
    coal.collide(one, nowhere, two, nowhere, request, result)
    patches, found = coal.ContactPatchRequest(), coal.ContactPatchResult()
    patches.setPatchTolerance(1e-3)
    coal.computeContactPatch(one, nowhere, two, nowhere, result, patches, found)
    if found.numContactPatches() == 0:
        return np.zeros((0, 3)), None
    patch = found.getContactPatch(0)
    return np.array([patch.getPoint(k) for k in range(patch.size())]).reshape(-1, 3), np.array(patch.getNormal())


def same_places(first, second):
    if len(first) != len(second):
        return False
    distance = np.linalg.norm(first[:, None] - second, axis=2)
    return max(distance.min(axis=1).max(), distance.min(axis=0).max()) < 1e-5


@pytest.mark.parametrize("scene", range(50))
def test_polygons_are_those_of_coal(scene):
    """Two irregular frusta, one on the other, turned as a whole: the corners of the intersection of both faces."""
    random = np.random.default_rng(scene)
    turn = turn_by(random.normal(size=3))
    first, second = random_stone(random, bottom=False), random_stone(random, bottom=True)
    second = second @ turn_by([0.0, 0.0, random.uniform(0, 6)]).T
    second = second + np.append(random.uniform(-0.4, 0.4, 2), 0.0)
    polygons = [shapely.Polygon(stone[stone[:, 2] == 0.0, :2]) for stone in (first, second)]
    overlap = shapely.get_coordinates(polygons[0] & polygons[1])[:-1]
    expected = np.column_stack([overlap, np.zeros(len(overlap))]) @ turn.T
    assembly = solver.Assembly.from_solids([hull_of(first @ turn.T), hull_of(second @ turn.T)])
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 1e-3)
    assert same_places(contacts.points, expected)
    sense = np.where(contacts.block_a == 1, 1.0, -1.0)[:, None]
    np.testing.assert_allclose(sense * contacts.frames[:, 0], np.tile(turn[:, 2], (len(contacts), 1)), atol=1e-6)
    assert contacts.areas.sum() == pytest.approx((polygons[0] & polygons[1]).area)
    if scene == LOST_BY_COAL:
        return
    patch, normal = coal_polygon(first @ turn.T, second @ turn.T)
    assert same_places(contacts.points, patch)
    np.testing.assert_allclose(normal, turn[:, 2], atol=1e-6)


THICKNESS = 0.3


def in_space_of(assembly):
    solids = [upright(assembly.outline(block), 0.0, THICKNESS) for block in range(assembly.n_blocks)]
    return solver.Assembly.from_solids(solids, roles=list(assembly.roles), names=assembly.names)


def moved(assembly, by):
    """The pose in which blocks have moved and turned as far as this."""
    d = assembly.dimension
    return solver.Pose(assembly.centroids + by[:, :d], by[:, d:])


def rows(contacts, plane):
    """Blocks, place, normal into the lower number and gap of contact points, sorted; of those in space x and z."""
    flat = slice(None) if plane else [0, 2]
    sense = np.where(contacts.block_a > contacts.block_b, -1.0, 1.0)[:, None]
    normal = contacts.frames[:, 0][:, flat] * sense
    blocks = np.sort(np.stack([contacts.block_a, contacts.block_b], axis=1), axis=1)
    table = np.column_stack([blocks, contacts.points[:, flat], normal, contacts.gaps])
    return table[np.lexsort(np.round(table[:, [5, 4, 3, 2, 1, 0]], 6).T)]


@pytest.mark.parametrize(
    ("name", "size"),
    [
        *((name, size) for name in ("arch", "portal", "arch_on_piers", "pointed_arch") for size in (0.0, 1e-6, 3e-3)),
        ("buttressed_arch", 3e-3),
        ("wall", 0.0),
        ("panel", 1e-3),
    ],
)
def test_extruded_structures_have_the_points_of_the_plane(name, size):
    """Also where blocks have moved: the same gaps, normals and places, once at either end of the thickness."""
    plane, random = getattr(generators, name)(), np.random.default_rng(19)
    space = in_space_of(plane)
    motion = random.normal(size=(plane.n_blocks, 3)) * size * [plane.block_size, plane.block_size, 1.0]
    in_space = np.zeros((plane.n_blocks, 6))
    # Counter-clockwise in the plane x, z is clockwise about y.
    in_space[:, 0], in_space[:, 2], in_space[:, 4] = motion[:, 0], motion[:, 1], -motion[:, 2]
    reach = 0.05 * plane.block_size
    flat, solid = (
        mechanics.find_contacts(one, mechanics.moved_vertices(one, moved(one, by)), reach)
        for one, by in ((plane, motion), (space, in_space))
    )
    expected = rows(flat, True)
    np.testing.assert_allclose(solid.frames[:, 0, 1], 0.0, atol=1e-12)
    for end in (0.0, THICKNESS):
        found = rows(solid[np.abs(solid.points[:, 1] - end) < 1e-9], False)
        np.testing.assert_allclose(found, expected, atol=2e-9)
    assert len(solid) == 2 * len(flat)


PLANE = [name for name in generators.LAYOUTS if generators.dimension_of(name) == 2]
EXAMPLES = {path.stem: read_case(path) for path in sorted((Path(__file__).parents[2] / "examples").glob("*.toml"))}
FLAT = [name for name, case in EXAMPLES.items() if case.layout is None or generators.dimension_of(case.layout) == 2]
SMALL_FACADE = {"bricks": 12, "courses": 22, "storeys": 1, "windows": 1, "window_bricks": 6, "window_courses": 9}


@pytest.mark.parametrize(
    "name",
    [*(pytest.param(name, marks=[pytest.mark.slow] * (name == "facade")) for name in [*PLANE, *FLAT]), "small facade"],
)
@pytest.mark.slow
def test_what_touches_in_the_plane_touches_there_in_space(name):
    """Of every layout and example of the plane, at either end of the thickness; also at re-entrant corners."""
    if name == "small facade":
        plane = generators.build("facade", SMALL_FACADE)
    else:
        plane = generators.build(name) if name in PLANE else assembly_of(EXAMPLES[name])
    space, reach = in_space_of(plane), 1e-6 * plane.block_size
    expected = rows(mechanics.find_contacts(plane, plane.vertices, reach), True)
    solid = mechanics.find_contacts(space, space.vertices, reach)
    weights = np.array([1, 1, 1, 1, 1e-2, 1e-2, 1])
    for end in (0.0, THICKNESS):
        found = rows(solid[np.abs(solid.points[:, 1] - end) < 1e-9], False)
        assert len(found) == len(expected)
        far, which = cKDTree(found * weights).query(expected * weights)
        assert far.max() < 1e-6
        assert len(np.unique(which)) == len(which)
    assert len(solid) == 2 * len(expected)


@pytest.mark.thorough
def test_cells_of_space_touch_in_their_common_faces():
    """A cube cut into the cells around random points, with faces and edges of all sizes: every face, to its area."""
    random = np.random.default_rng(1)
    points, n = random.uniform(0.0, 1.0, (120, 3)), 120
    mirrored = [np.where(np.arange(3) == k, 2 * wall - points, points) for k in range(3) for wall in (0, 1)]
    cells = Voronoi(np.concatenate([points, *mirrored]))
    solids = [hull_of(cells.vertices[cells.regions[cells.point_region[k]]]) for k in range(n)]
    assembly = solver.Assembly.from_solids(solids)
    assert assembly.shapes.volumes.sum() == pytest.approx(1.0, rel=1e-9)
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 1e-7)
    pairs, joint = contacts.joints()
    found = dict(zip(map(tuple, pairs.tolist()), np.bincount(joint, contacts.areas), strict=True))
    expected = {}
    for pair, ring in zip(cells.ridge_points, cells.ridge_vertices, strict=True):
        if (pair < n).all():
            arms = cells.vertices[ring] - cells.vertices[ring[0]]
            i, j = sorted(pair.tolist())
            expected[i, j] = np.linalg.norm(np.cross(arms[1:-1], arms[2:]).sum(axis=0)) / 2.0
    assert set(found) == set(expected)
    np.testing.assert_allclose([found[pair] for pair in expected], list(expected.values()), atol=1e-9)
    np.testing.assert_allclose(contacts.gaps, 0.0, atol=1e-9)
