"""Stones that are not convex, cut into convex parts that fill them exactly."""

import numpy as np
import pytest
from structures import prism, turn_by, upright, with_hole

import solver
from solver import mechanics

ANGLES = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)
TURN = turn_by([0.5, 0.7, 0.4])

OUTLINES = {
    "L": ([(0, 0), (2, 0), (2, 1), (1, 1), (1, 3), (0, 3)], 2),
    "U": ([(0, 0), (3, 0), (3, 3), (2, 3), (2, 1), (1, 1), (1, 3), (0, 3)], 3),
    "Z": ([(0, 0), (2, 0), (2, 1), (4, 1), (4, 2), (1, 2), (1, 1), (0, 1)], 2),
    "T": ([(0, 0), (3, 0), (3, 1), (2, 1), (2, 3), (1, 3), (1, 1), (0, 1)], 3),
    "star": ([(r * np.cos(a), r * np.sin(a)) for a, r in zip(ANGLES, [2.0, 1.0] * 6, strict=True)], 7),
    "arc": (
        [(r * np.cos(a), r * np.sin(a)) for r, way in ((1.0, 1), (1.3, -1)) for a in ANGLES[:4][::way]],
        3,
    ),
}


def ring():
    """A square with a square hole through it."""
    outer, inner = ([(-r, -r), (r, -r), (r, r), (-r, r)] for r in (2.0, 1.0))
    return with_hole(outer, inner)


def parts_of(solid):
    corners, faces = solid
    assembly = solver.Assembly.from_solids([(np.asarray(corners) @ TURN.T + [100.0, 200.0, 0.0], faces)])
    return assembly.shapes, assembly.shapes.parts


def out_of_faces(solids, part):
    """How far a corner of a part is in front of one of its own faces."""
    faces = solids.faces(solids.vertices)
    own = solids.vertices[solids.offsets[part] : solids.offsets[part + 1]]
    which = np.flatnonzero(solids.block_of_face == part)
    return max(((own - faces.middles[k]) @ faces.normals[k]).max() for k in which)


def shared_volume(solids, first, second):
    manifold = pytest.importorskip("manifold3d")

    def body(part):
        own = solids.vertices[solids.offsets[part] : solids.offsets[part + 1]]
        return manifold.Manifold.hull_points(own - solids.vertices[0])

    return (body(first) ^ body(second)).volume()


@pytest.mark.parametrize("name", [*OUTLINES, "ring"])
def test_parts_are_convex_and_fill_the_stone(name):
    outline, most = OUTLINES.get(name, (None, 4))
    shapes, parts = parts_of(ring() if outline is None else prism(outline))
    n = len(parts.block_of_part)
    assert 1 < n <= most
    assert parts.solids.volumes.sum() == pytest.approx(shapes.volumes[0], rel=1e-9)
    assert max(out_of_faces(parts.solids, k) for k in range(n)) < 1e-6
    assert max(shared_volume(parts.solids, i, j) for i in range(n) for j in range(i)) < 1e-6
    moved = shapes.vertices @ TURN + [1.0, 2.0, 3.0]
    np.testing.assert_allclose(parts.placed(moved).vertices, parts.solids.vertices @ TURN + [1.0, 2.0, 3.0], atol=1e-9)


def test_a_stone_that_is_convex_to_a_thousandth_of_its_width_is_left_whole():
    shapes, parts = parts_of(prism([(0, 0), (1, 0), (1, 1), (0.5, 0.9999), (0, 1)]))
    assert parts.whole
    assert parts.solids is shapes


def test_a_surface_that_crosses_itself_is_refused():
    corners, faces = prism([(0, 0), (4, 0), (4, 4), (1, 4), (1, 3), (5, 3), (5, 5), (0, 5)])
    with pytest.raises(
        ValueError, match=r"block 0 \('block 0'\) cannot be cut into convex parts: its surface crosses itself near"
    ):
        parts_of((corners, faces))


def test_only_whole_stones_touch_each_other():
    """A key in a notch: points on the floor and both walls of the notch, none between the parts of one stone."""
    stone = prism(OUTLINES["U"][0])
    key = prism([(1, 1), (2, 1), (2, 2), (1, 2)])
    assembly = solver.Assembly.from_solids([stone, key])
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 0.1)
    assert (contacts.block_a != contacts.block_b).all()
    sense = np.where(contacts.block_a == 1, 1.0, -1.0)[:, None]
    normals, counts = np.unique(np.round(sense * contacts.frames[:, 0], 9) + 0.0, axis=0, return_counts=True)
    assert len(normals) == 3
    np.testing.assert_allclose(contacts.gaps, 0.0, atol=1e-12)
    assert contacts.areas.sum() == pytest.approx(3.0)
    assert counts.tolist() == [4, 4, 4]


#: Outlines that are their own mirror images, and the corners that lie between others.
SYMMETRIC = {
    "quoin": ([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)], [3]),
    "thin quoin": ([(0, 0), (2, 0), (2, 0.3), (0.3, 0.3), (0.3, 2), (0, 2)], [3]),
    "cross": (
        [(3, -1), (3, 1), (1, 1), (1, 3), (-1, 3), (-1, 1), (-3, 1), (-3, -1), (-1, -1), (-1, -3), (1, -3), (1, -1)],
        [2, 5, 8, 11],
    ),
}


@pytest.mark.parametrize("first", [0, 1, 3])
@pytest.mark.parametrize("name", SYMMETRIC)
def test_a_face_shares_its_area_among_its_corners_however_it_was_cut(name, first):
    """Two cuts are as good: which of them is taken follows from the order of corners, which is that of the drawing."""
    outline, between = SYMMETRIC[name]
    solid, slab = prism(outline[first:] + outline[:first]), prism([(-5, -5), (5, -5), (5, 5), (-5, 5)], -1.0, 0.0)
    solids = [(np.asarray(corners) @ TURN.T, faces) for corners, faces in (solid, slab)]
    assembly = solver.Assembly.from_solids(solids, roles=["free", "fixed"])
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 0.05)
    apart = np.abs((contacts.points @ TURN)[:, None, :2] - np.array(outline)).max(axis=2)
    assert (apart.min(axis=1) < 1e-6).all()
    areas = np.zeros(len(outline))
    areas[apart.argmin(axis=1)] = contacts.areas
    assert areas.sum() == pytest.approx(assembly.shapes.volumes[0])
    # A cross turned by a quarter is itself, an L is its mirror image.
    image = np.roll(areas, 3) if name == "cross" else np.roll(areas[::-1], 1)
    np.testing.assert_allclose(areas, image, rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(areas[between], 0.0, atol=1e-12)
    assert (np.delete(areas, between) > 0.0).all()


def test_each_foot_of_a_stone_has_its_own_area():
    """On one slab and in one plane, they are two faces, of 0.2 m² and of 1 m²."""
    outline = [(0, 0), (0.2, 0), (0.2, 0.5), (2, 0.5), (2, 0), (3, 0), (3, 1), (0, 1)]
    stone, slab = upright(outline, 0.0, 1.0), prism([(-1, -1), (4, -1), (4, 2), (-1, 2)], -1.0, 0.0)
    assembly = solver.Assembly.from_solids([stone, slab], roles=["free", "fixed"])
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 0.05)
    small = contacts.points[:, 0] < 1.0
    assert contacts.areas[small] == pytest.approx(0.05)
    assert contacts.areas[~small] == pytest.approx(0.25)


def groin_stone(low, high, end=2.6):
    """Two voussoirs between two angles, of crossing barrels, that are one stone along the groin."""
    profile = np.array([(r * np.cos(a), r * np.sin(a)) for r, a in ((2, low), (2.3, low), (2.3, high), (2, high))])
    u, z = profile.T
    groin, first, second = (np.column_stack(at) for at in ((u, u, z), (u, np.full(4, end), z), (np.full(4, end), u, z)))
    sides = [[k, (k + 1) % 4, (k + 1) % 4 + 4, k + 4] for k in range(4)]
    others = [[(k + 1) % 4, k, k + 8, (k + 1) % 4 + 8] for k in range(4)]
    return np.concatenate([groin, first, second]), [*sides, *others, [4, 5, 6, 7], [11, 10, 9, 8]]


@pytest.mark.parametrize("shift", [0.0, 1e-6, 1e-4, 1e-3])
def test_the_arm_of_one_groin_stone_does_not_touch_the_cut_of_the_next(shift):
    """Also where the stones have slid along each other: the only normals are those of the two joint faces."""
    low, middle, high = 0.5, 0.8, 1.1
    first, second = groin_stone(low, middle), groin_stone(middle, high)
    slid = second[0] + np.array([0.0, -1.0, 0.0]) * shift
    assembly = solver.Assembly.from_solids([first, (slid, second[1])])
    assert np.bincount(assembly.shapes.parts.block_of_part).tolist() == [2, 2]
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 0.05)
    assert len(contacts) >= 8
    sense = np.where(contacts.block_a == 1, 1.0, -1.0)[:, None]
    joint_faces = np.array([[-np.sin(middle), 0.0, np.cos(middle)], [0.0, -np.sin(middle), np.cos(middle)]])
    along = (sense * contacts.frames[:, 0]) @ joint_faces.T
    np.testing.assert_allclose(along.max(axis=1), 1.0, atol=1e-6)
    area = 2 * 0.3 * (2.6 - 2.15 * np.cos(middle))
    assert contacts.areas.sum() == pytest.approx(area, abs=0.01)
