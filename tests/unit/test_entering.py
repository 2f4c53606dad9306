"""The contact points that would have kept blocks apart which a movement has put into each other."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from structures import box, brick

import solver
from solver import mechanics

#: An outline with a notch, in which a corner of another block may lie.
NOTCHED = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.2, 1.0], [1.0, 0.6], [0.8, 1.0], [0.0, 1.0]])


def moved_pair(rng, d):
    """Two blocks, free to move, apart, and where a movement has put them: the assembly and two poses."""
    sizes = rng.uniform(0.4, 2.0, (2, d))
    if d == 3:
        assembly = solver.Assembly.from_solids([box(-s / 2.0, s / 2.0) for s in sizes], roles=["free"] * 2)
    else:
        outlines = [NOTCHED if rng.random() < 0.5 else brick(0.0, 0.0, *s) for s in sizes]
        assembly = solver.Assembly.from_outlines(outlines, roles=["free"] * 2)
    away = rng.normal(size=d)
    away /= np.linalg.norm(away)
    turns = rng.uniform(-2.0, 2.0, (2, d * (d - 1) // 2))
    before = solver.Pose(np.stack([np.zeros(d), rng.uniform(0.5, 2.5) * away]), turns)
    motion = np.concatenate([rng.uniform(-0.1, 0.1, (2, d)), rng.uniform(-0.2, 0.2, turns.shape)], axis=1)
    motion[1, :d] -= rng.uniform(0.0, 0.3) * away
    return assembly, before, mechanics.moved(before, motion)


def gaps_after(points, before, after):
    """Gaps of points that ride on their first block, before planes that ride on the second."""
    a, b = points.block_a, points.block_b
    d = points.points.shape[1]
    planes = mechanics.carried(points.points - points.gaps[:, None] * points.frames[:, 0], b, before, after)
    normals = mechanics.turned(points.frames[:, 0], before.movement_to(after)[b, d:])
    return ((mechanics.carried(points.points, a, before, after) - planes) * normals).sum(axis=1)


@pytest.mark.parametrize("d", [2, 3])
@settings(max_examples=12)
@given(seed=st.integers(0, 100_000))
def test_what_overlaps_after_a_movement_has_come_through_a_plane_that_was_between(d, seed):
    assembly, before, after = moved_pair(np.random.default_rng(seed), d)
    shapes, corners = assembly.shapes, [mechanics.moved_vertices(assembly, pose) for pose in (before, after)]
    assume(len(shapes.overlaps(corners[0], 0.0)[0]) == 0)
    none = mechanics.find_contacts(assembly, corners[0], 1e-9)[np.zeros(0, dtype=int)]
    points = shapes.entered(*corners, assembly.free, 1e-4, none)
    if len(shapes.overlaps(corners[1], 1e-4)[0]) == 0:
        assert len(points) == 0
        return
    # Edges that turn meet elsewhere than where they cross: then the plane that was between them is asked.
    points = mechanics.joined_contacts([points, shapes.entered(*corners, assembly.free, 1e-4, points)])
    assert len(points)
    assert (points.gaps > -1e-9).all()
    assert gaps_after(points, before, after).min() < -1e-5


def test_what_is_known_is_not_found_again():
    assembly = solver.Assembly.from_solids([box((0, 0, 0), (1, 1, 1)), box((0.2, 0.2, 1), (0.8, 0.8, 2))])
    below = assembly.vertices - np.where(assembly.block_of_vertex == 1, 0.01, 0.0)[:, None] * [0.0, 0.0, 1.0]
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 0.01)
    none = contacts[np.zeros(0, dtype=int)]
    assert len(assembly.shapes.entered(assembly.vertices, below, assembly.free, 1e-4, none)) == 4
    assert len(assembly.shapes.entered(assembly.vertices, below, assembly.free, 1e-4, contacts)) == 0
