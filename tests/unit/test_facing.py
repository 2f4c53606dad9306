"""Joints in space that do not quite meet, and warped faces: one plane each, what is moved is counted."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
import trimesh
from structures import box, drawn, fans, layout_of

import solver
from blockvis import generators, inspect, read, read_layout, write_layout
from blockvis.layout.faces import with_plane_faces
from blockvis.layout.facing import faced, facing_tolerance
from blockvis.layout.solids import triangles_of
from solver import mechanics

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


def test_what_is_moved_is_counted_and_named(tmp_path):
    stones = [box((0, 0, 0), (1, 1, 1)), box((0, 0, 1.004), (1, 1, 2)), box((0, 0, 1.998), (1, 1, 3))]
    path = drawn(tmp_path / "a.json", stones, ["low", "middle", "high"])
    with pytest.warns(
        UserWarning,
        match=r"2 joints between faces were not plane: they were open by up to 0.004 m \('low' and 'middle'\)",
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


@pytest.mark.parametrize("name", ["extruded arch", "barrel vault", "L corner"])
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


@pytest.mark.parametrize("tolerance", [None, pytest.param(0.1, marks=pytest.mark.thorough)])
def test_facing_never_makes_the_deepest_overlap_deeper(tolerance):
    drawn = generators.build("barrel vault", SMALL["barrel vault"])
    solids = [with_plane_faces(p, triangles_of(p, f)).solid for p, f in shaken(layout_of(drawn), 2e-3).solids]
    near = facing_tolerance(solids, 0.0, tolerance)
    found = faced(solids, drawn.names, near)
    assert deepest(found.solids) <= max(deepest(solids), 0.5 * near)


def test_a_tolerance_does_not_face_less_than_none():
    solids = layout_of(generators.build("dome", SMALL["dome"])).solids
    assert facing_tolerance(solids, 0.0, 1e-9) == facing_tolerance(solids) < facing_tolerance(solids, 0.0, 1.0) == 1.0
