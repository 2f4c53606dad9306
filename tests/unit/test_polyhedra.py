"""Blocks in space: volumes, and the points at which they touch."""

import numpy as np
import pytest
from structures import box

import solver
from solver import mechanics
from solver.geometry.contacts import matched_contacts
from solver.geometry.spatial_contacts import ACROSS, ON_CORNER, ON_FACE
from solver.kinematics import moved, relative_velocities, rotation_matrices

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
    assert assembly.shapes.sizes[0] == pytest.approx(np.cbrt(6.0))


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
        there = mechanics.measure_contacts(assembly, mechanics.moved_vertices(assembly, moved(pose, motion)), contacts)
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
