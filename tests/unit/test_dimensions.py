"""The core without a dimension: motions, wrenches and contact points of blocks in the plane and in space."""

from itertools import product

import numpy as np
import pytest
from structures import box

import solver
from blockvis.results.mechanism_arrays import swung
from solver import mechanics
from solver.equilibrium import wrench_matrix
from solver.geometry.contacts import matched_contacts
from solver.geometry.spatial_features import ACROSS, ON_CORNER, ON_FACE
from solver.kinematics import (
    composed_rotations,
    dimension_of,
    moved,
    relative_velocities,
    rotation_count,
    rotation_matrices,
)

RANDOM = np.random.default_rng(7)
ROTATIONS = RANDOM.normal(size=(20, 3)) * np.geomspace(1e-9, 1.0, 20)[:, None]


def poses(d, n=20):
    return solver.Pose(RANDOM.normal(size=(n, d)), RANDOM.normal(size=(n, rotation_count(d))))


def test_rotations_in_space_are_rotations_about_their_vector():
    """Proper, they leave their vector alone and turn by its length; about the third axis they are the plane's."""
    matrices = rotation_matrices(ROTATIONS)
    np.testing.assert_allclose(matrices @ matrices.transpose(0, 2, 1), np.tile(np.eye(3), (20, 1, 1)), atol=1e-14)
    np.testing.assert_allclose(np.linalg.det(matrices), 1.0, rtol=1e-14)
    np.testing.assert_allclose(np.einsum("nij,nj->ni", matrices, ROTATIONS), ROTATIONS, rtol=1e-12)
    traces = np.trace(matrices, axis1=1, axis2=2)
    np.testing.assert_allclose(traces, 1.0 + 2.0 * np.cos(np.linalg.norm(ROTATIONS, axis=1)), rtol=1e-14)
    angles = np.linspace(-3.0, 3.0, 7)[:, None]
    about_z = rotation_matrices(angles * np.array([0.0, 0.0, 1.0]))[:, :2, :2]
    np.testing.assert_allclose(about_z, rotation_matrices(angles), atol=1e-15)


def test_composed_rotations_are_products_of_matrices():
    first, then = RANDOM.normal(size=(2, 200, 3)) * 1.5
    both = composed_rotations(first, then)
    np.testing.assert_allclose(rotation_matrices(both), rotation_matrices(then) @ rotation_matrices(first), atol=1e-13)
    assert np.linalg.norm(both, axis=1).max() <= np.pi + 1e-12
    np.testing.assert_allclose(composed_rotations(ROTATIONS, 0.0 * ROTATIONS), ROTATIONS, rtol=1e-13)
    np.testing.assert_allclose(composed_rotations(ROTATIONS, -ROTATIONS), 0.0, atol=1e-15)


@pytest.mark.parametrize("d", [2, 3])
def test_velocities_are_the_limit_of_small_movements(d):
    pose, block = poses(d), np.arange(20)
    points, motion = RANDOM.normal(size=(20, d)), RANDOM.normal(size=(20, d + rotation_count(d)))
    velocity = mechanics.point_velocities(points, block, pose, motion)
    for move in (moved, swung):
        small = mechanics.carried(points, block, pose, move(pose, 1e-7 * motion))
        np.testing.assert_allclose((small - points) / 1e-7, velocity, atol=1e-5)


@pytest.mark.parametrize("d", [2, 3])
def test_swung_blocks_of_one_rigid_motion_stay_together(d):
    pose = poses(d, 2)
    spin = RANDOM.normal(size=rotation_count(d))
    rows = mechanics.cross_rows(pose.positions)
    travel = RANDOM.normal(size=d) + np.einsum("nri,r->ni", rows, spin)
    motion = np.concatenate([travel, np.tile(spin, (2, 1))], axis=1)
    points = RANDOM.normal(size=(5, d))
    after = swung(pose, motion)
    on_each = [mechanics.carried(points, np.full(5, k), pose, after) for k in (0, 1)]
    np.testing.assert_allclose(on_each[0], on_each[1], atol=1e-12)


@pytest.mark.parametrize("d", [2, 3])
def test_size_of_a_motion(d):
    motion = np.zeros((2, d + rotation_count(d)))
    motion[0, 0], motion[1, -1] = -0.3, 0.2
    np.testing.assert_allclose(mechanics.motion_size(motion, 2.0), [0.3, 0.4])
    assert dimension_of(motion.shape[1]) == d


def block_on_a_plane(d, width, height):
    """The contact points of a free block (0) on a support (1), normal up, at the corners of its base."""
    corners = np.array([[*place, 0.0] for place in product((0.0, width), repeat=d - 1)])
    n = len(corners)
    up = np.eye(d)[-1]
    tangents = np.eye(d)[:-1] * (-1.0 if d == 2 else 1.0)
    zero = np.zeros(n)
    contacts = mechanics.Contacts(
        features=np.stack([zero, np.arange(n), zero, zero - 1], axis=1).astype(int),
        block_a=np.zeros(n, dtype=int),
        block_b=np.ones(n, dtype=int),
        points=corners,
        frames=np.tile(np.vstack([up, tangents]), (n, 1, 1)),
        gaps=zero,
        slip=np.zeros((n, d - 1)),
        areas=zero,
    )
    middle = np.array([*[width / 2.0] * (d - 1), height / 2.0])
    return contacts, solver.Pose(np.stack([middle, -middle]), np.zeros((2, rotation_count(d))))


@pytest.mark.parametrize("d", [2, 3])
def test_wrench_matrix_is_the_transpose_of_the_relative_velocities(d):
    contacts, pose = block_on_a_plane(d, 0.7, 1.3)
    motion = RANDOM.normal(size=(2, d + rotation_count(d)))
    rates = (wrench_matrix(contacts, pose).T @ motion.ravel()).reshape(-1, d)
    np.testing.assert_allclose(rates, relative_velocities(contacts, pose, motion), atol=1e-14)


def test_contact_points_are_known_by_their_first_three_features():
    """Found again in any order, whatever the fourth says; the kind tells two of the same features apart."""
    contacts, _ = block_on_a_plane(3, 1.0, 1.0)
    other = contacts.features.copy()
    other[:, 3] = 9
    other[0, 0] = 1
    before = mechanics.Contacts(other[::-1], *(getattr(contacts, name)[::-1] for name in list(contacts.__dict__)[1:]))
    place, same = matched_contacts(contacts, before)
    assert same.tolist() == [False, True, True, True]
    assert place[1:].tolist() == [2, 1, 0]


def test_polygons_have_what_shapes_ask_for():
    shapes: mechanics.Shapes = solver.Assembly.from_outlines([[(0, 0), (2, 0), (2, 1), (0, 1)]], thickness=0.5).shapes
    assert shapes.volumes.tolist() == [1.0]
    assert shapes.centroids.tolist() == [[1.0, 0.5]]
    assert shapes.size(np.array([True])) == pytest.approx(np.sqrt(2.0))
    assert len(shapes.find(shapes.vertices, 0.1, np.array([True]))) == 0
    assert len(shapes.overlaps(shapes.vertices, 0.0)[0]) == 0


RANDOM = np.random.default_rng(3)


def turned(solid, rotation, centre=(0.0, 0.0, 0.0)):
    matrix = rotation_matrices(np.asarray(rotation, dtype=float)[None])[0]
    return (np.asarray(solid[0]) - centre) @ matrix.T + centre, solid[1]


def points(solids, reach=0.1, roles=None):
    assembly = solver.Assembly.from_solids(solids, roles=roles)
    return assembly, mechanics.find_contacts(assembly, assembly.vertices, reach)


def test_integrals_of_a_tetrahedron_far_from_the_origin():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 6]]) + np.array([4e5, 5e6, 100.0])
    shapes = solver.Assembly.from_solids([(corners, [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])]).shapes
    assert shapes.volumes[0] == pytest.approx(1.0, rel=1e-9)
    np.testing.assert_allclose(shapes.centroids[0] - [4e5, 5e6, 100.0], [0.25, 0.25, 1.5], atol=1e-8)
    # Of a tetrahedron with legs a, b, c: 3 V / 80 (b² + c²) about the centroid, and V a b / 80 off the diagonal.
    np.testing.assert_allclose(np.diag(shapes.inertia[0]), 3 / 80 * np.array([37.0, 37.0, 2.0]), rtol=1e-6)
    assert shapes.inertia[0, 0, 1] == pytest.approx(1 / 80, rel=1e-6)
    assert shapes.inertia[0, 0, 2] == pytest.approx(6 / 80, rel=1e-6)


def test_a_cube_inside_out_is_turned():
    corners, faces = box((0, 0, 0), (1, 2, 3))
    assembly = solver.Assembly.from_solids([(corners, [face[::-1] for face in faces])])
    assert assembly.dimension == 3
    assert assembly.shapes.volumes[0] == pytest.approx(6.0)


def test_a_cube_on_a_cube_touches_at_four_corners():
    _, contacts = points([box((0, 0, 0), (1, 1, 1)), box((0, 0, 1), (1, 1, 2))])
    assert (contacts.features[:, 0] == ON_CORNER).all()
    np.testing.assert_allclose(contacts.areas, 0.25)
    np.testing.assert_allclose(contacts.gaps, 0.0, atol=1e-15)
    np.testing.assert_allclose(contacts.frames[:, 0], [[0, 0, -1.0]] * 4, atol=1e-15)


SCENES = {
    "corners": [box((0, 0, 0), (1, 1, 1)), box((0, 0, 1), (1, 1, 2))],
    "inside": [box((0, 0, 0), (1, 1, 1)), box((0.2, 0.3, 1), (0.7, 0.6, 2))],
    "boundary": [box((0, 0, 0), (1, 1, 1)), box((0, 0.2, 1), (0.7, 0.6, 2))],
    "across": [box((0, 0, 0), (1, 1, 1)), box((-0.5, 0.2, 1), (0.7, 0.6, 2))],
    "askew": [box((0, 0, 0), (1, 1, 1)), turned(box((-0.5, -0.5, 1), (0.5, 0.5, 2)), (0, 0, 0.6))],
    "nearly parallel": [box((0, 0, 0), (1, 1, 1)), turned(box((0, 0, 1), (1, 1, 2)), (0, 0, 0.01), (0.5, 0.5, 0))],
    "edges": [
        turned(box((-2, -0.5, -0.5), (2, 0.5, 0.5)), (np.pi / 4, 0, 0)),
        turned(box((-0.5, -2, 0), (0.5, 2, 1)), (0, np.pi / 4, 0)),
    ],
}
corners, faces = SCENES["edges"][1]
SCENES["edges"][1] = corners - np.array([0, 0, np.min(corners, axis=0)[2] - np.sqrt(0.5)]), faces


@pytest.mark.parametrize("scene", SCENES)
def test_gaps_and_slips_follow_the_motion_of_the_blocks(scene):
    """Measured again after a small motion they differ by the relative velocities of the two blocks, of every kind."""
    assembly, contacts = points(SCENES[scene])
    assert len(contacts) == (1 if scene == "edges" else 8 if scene == "nearly parallel" else 4)
    np.testing.assert_allclose(contacts.gaps, 0.0, atol=1e-12)
    np.testing.assert_allclose(
        contacts.frames @ contacts.frames.transpose(0, 2, 1), np.tile(np.eye(3), (len(contacts), 1, 1)), atol=1e-12
    )
    np.testing.assert_allclose(np.linalg.det(contacts.frames), 1.0)
    pose = solver.Pose.initial(assembly)
    for size in (1e-4, 1e-5):
        motion = RANDOM.normal(size=(2, 6)) * size
        there = assembly.shapes.measure(mechanics.moved_vertices(assembly, moved(pose, motion)), contacts)
        expected = relative_velocities(contacts, pose, motion)
        np.testing.assert_allclose(there.gaps - contacts.gaps, expected[:, 0], atol=60 * size**2)
        np.testing.assert_allclose(there.slip - contacts.slip, expected[:, 1:], atol=60 * size**2)


@pytest.mark.parametrize(
    ("scene", "kinds"), [("inside", {ON_FACE}), ("across", {ON_FACE, ACROSS}), ("edges", {ACROSS})]
)
def test_points_are_recognised_after_a_small_motion(scene, kinds):
    assembly, contacts = points(SCENES[scene])
    assert set(contacts.features[:, 0]) == kinds
    motion = RANDOM.normal(size=(2, 6)) * 1e-3
    vertices = mechanics.moved_vertices(assembly, moved(solver.Pose.initial(assembly), motion))
    place, known = matched_contacts(mechanics.find_contacts(assembly, vertices, 0.1), contacts)
    assert known.all()
    np.testing.assert_array_equal(np.sort(place), np.arange(len(contacts)))


def test_overlaps_are_as_deep_as_the_way_out():
    solids = [box((0, 0, 0), (1, 1, 1)), box((0.3, 0.2, 0.9), (0.6, 0.5, 2)), box((1, 0, 0), (2, 1, 1))]
    shapes = solver.Assembly.from_solids(solids).shapes
    i, j, depth = shapes.overlaps(shapes.vertices, 1e-3)
    assert (i.tolist(), j.tolist()) == ([0], [1])
    assert depth[0] == pytest.approx(0.1)
