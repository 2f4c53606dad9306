"""Bodies of any shape are cut into convex parts that fill them, whatever their place, scale and order."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from structures import box, of_cubes, prism, turn_by, with_hole
from test_convex_parts import out_of_faces

import solver

#: Lengths of arms, legs and notches.
length = st.floats(0.2, 3.0)
turn = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


def outline_of(name, a, b, c):
    """An outline of three lengths that is not convex, and the most parts it may have."""
    if name == "L":
        return [(0, 0), (a + b, 0), (a + b, c), (a, c), (a, b + c), (0, b + c)], 2
    if name == "U":
        return [
            (0, 0),
            (a + b + c, 0),
            (a + b + c, b + c),
            (a + b, b + c),
            (a + b, c),
            (a, c),
            (a, a + c),
            (0, a + c),
        ], 3
    if name == "T":
        return [(0, 0), (a + b + c, 0), (a + b + c, a), (a + b, a), (a + b, a + c), (a, a + c), (a, a), (0, a)], 3
    angles = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
    return [(r * np.cos(t), r * np.sin(t)) for t, r in zip(angles, [3.0 + a, 0.4 * (3.0 + b)] * 6, strict=True)], 8


def frame(a, b, c):
    """A square frame of unequal bars."""
    outer = [(-a, -b), (c + 1, -b), (c + 1, a + 1), (-a, a + 1)]
    return with_hole(outer, [(0, 0), (1, 0), (1, 1), (0, 1)])


def parts_of(corners, faces):
    shapes = solver.Assembly.from_solids([(corners, faces)]).shapes
    return shapes, shapes.parts


def check(corners, faces, rotation, scale, most):
    """Cut a body, turned, moved and scaled."""
    corners = scale * (corners @ turn_by(rotation).T) + [3.0, -7.0, 2.0]
    shapes, parts = parts_of(corners, faces)
    assert 1 < len(parts.block_of_part) <= most
    assert parts.solids.volumes.sum() == pytest.approx(shapes.volumes[0], rel=1e-9)
    assert max(out_of_faces(parts.solids, k) for k in range(len(parts.block_of_part))) < 1e-6 * scale


@pytest.mark.thorough
@settings(max_examples=12, deadline=None)
@given(st.sampled_from(["L", "U", "T", "star"]), length, length, length, turn, st.sampled_from([1e-3, 1.0, 1e3]))
def test_prisms_are_filled_by_few_convex_parts(name, a, b, c, rotation, scale):
    outline, most = outline_of(name, a, b, c)
    check(*prism(outline, 0.0, c), rotation, scale, most)


@pytest.mark.thorough
@settings(max_examples=8, deadline=None)
@given(length, length, length, turn)
def test_a_frame_is_cut_through_its_limbs(a, b, c, rotation):
    check(*frame(a, b, c), rotation, 1.0, 6)


@settings(max_examples=8, deadline=None)
@given(st.floats(0.1, 0.8), st.floats(0.1, 0.8), st.floats(0.1, 0.8), turn)
def test_a_box_without_one_corner(x, y, z, rotation):
    points = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1) if i + j + k < 3], dtype=float)
    points = np.vstack([points, [(x, y, z), (1, y, z), (x, 1, z), (x, y, 1), (1, 1, z), (1, y, 1), (x, 1, 1)]])
    number = {tuple(p): k for k, p in enumerate(points.tolist())}
    loops = [
        [(0, 0, 0), (0, 1, 0), (1, 1, 0), (1, 0, 0)],
        [(0, 0, 0), (1, 0, 0), (1, 0, 1), (0, 0, 1)],
        [(0, 0, 0), (0, 0, 1), (0, 1, 1), (0, 1, 0)],
        [(1, 0, 0), (1, 1, 0), (1, 1, z), (1, y, z), (1, y, 1), (1, 0, 1)],
        [(0, 1, 0), (0, 1, 1), (x, 1, 1), (x, 1, z), (1, 1, z), (1, 1, 0)],
        [(0, 0, 1), (1, 0, 1), (1, y, 1), (x, y, 1), (x, 1, 1), (0, 1, 1)],
        [(x, y, z), (1, y, z), (1, 1, z), (x, 1, z)],
        [(x, y, z), (x, y, 1), (1, y, 1), (1, y, z)],
        [(x, y, z), (x, 1, z), (x, 1, 1), (x, y, 1)],
    ]
    faces = [[number[tuple(map(float, p))] for p in loop] for loop in loops]
    check(points, faces, rotation, 1.0, 4)


@pytest.mark.parametrize("shift", [0.0, 1e-8, 1e-7])
def test_corners_of_single_precision_leave_no_sheet_at_a_cut(shift):
    """A face in the plane of a cut belongs to one side of it, also where its corners are off by rounding."""
    corners, faces = prism([(0, 0), (3, 0), (3, 1), (1, 1), (1, 2), (2, 2), (2, 3), (0, 3)])
    noise = np.random.default_rng(4).uniform(-shift, shift, corners.shape)
    shapes, parts = parts_of(corners + noise, faces)
    assert len(parts.block_of_part) <= 4
    assert parts.solids.volumes.sum() == pytest.approx(shapes.volumes[0], rel=1e-6)


@pytest.mark.parametrize("rotation", [(0, 0, 0), (2.1, 0.8, 0.1), (-2.1, 2.0, 0.9)])
def test_a_face_with_a_corner_in_the_middle_of_a_side_keeps_all_its_corners(rotation):
    """An edge ends there. One corner of the stone got lost with a 21st of its volume, or the stone was refused."""
    check(*of_cubes([(0, 0, 0), (0, 1, 0), (0, 2, 0), (0, 3, 0), (1, 3, 0), (1, 3, 1), (1, 4, 1)]), rotation, 1.0, 4)


def test_a_warped_voussoir_has_few_parts():
    corners, faces = box((0, 0, 0), (1, 1, 1))
    corners = corners + 4e-3 * np.random.default_rng(3).uniform(-1, 1, corners.shape)
    rings = [[face[k] for k in some] for face in faces for some in ((0, 1, 2), (0, 2, 3))]
    shapes, parts = parts_of(corners, rings)
    assert len(parts.block_of_part) <= 6
    assert parts.solids.volumes.sum() == pytest.approx(shapes.volumes[0], rel=2e-3)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_parts_follow_from_the_body_not_from_the_order_of_its_corners(order):
    corners, faces = prism(outline_of("T", 0.7, 1.1, 1.6)[0])
    number = np.random.default_rng(order).permutation(len(corners))
    place = np.argsort(number)
    loops = [[int(place[k]) for k in face] for face in faces[::-1]]
    volumes = [np.sort(parts_of(*body)[1].solids.volumes) for body in ((corners, faces), (corners[number], loops))]
    mirrored = parts_of(corners * [-1.0, 1.0, 1.0], [face[::-1] for face in faces])[1].solids.volumes
    np.testing.assert_allclose(volumes[0], volumes[1], rtol=1e-9)
    np.testing.assert_allclose(volumes[0], np.sort(mirrored), rtol=1e-9)
