"""Layouts in space: dimensions, no overlaps, faces that meet, and the blocks of the references."""

import numpy as np
import pytest
import trimesh
from structures import fans, layout_of, small_layout

import solver
from blockvis import generators
from solver import mechanics

IN_SPACE = [name for name in generators.LAYOUTS if generators.dimension_of(name) == 3]


@pytest.mark.parametrize("name", IN_SPACE)
def test_no_block_overlaps_another_and_each_touches_others(name):
    assembly = small_layout(name)
    assert assembly.dimension == 3
    assert not len(assembly.shapes.overlaps(assembly.vertices, 1e-9)[0])
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 1e-9)
    touched = np.bincount(np.concatenate([contacts.block_a, contacts.block_b]), minlength=assembly.n_blocks)
    assert (touched[assembly.free] >= 6).all(), [assembly.names[i] for i in np.flatnonzero(touched < 6)]
    assert np.abs(contacts.gaps).max() < 1e-12


@pytest.mark.parametrize("name", IN_SPACE)
def test_faces_are_plane_and_seen_counter_clockwise(name):
    for points, faces in layout_of(small_layout(name)).solids:
        assert trimesh.Trimesh(points, fans(faces), process=False).volume > 0
        for face in faces:
            ring = points[face] - points[face].mean(axis=0)
            assert np.linalg.svd(ring)[1][-1] < 1e-12


def test_the_extruded_arch_is_the_arch_of_the_plane():
    flat, deep = generators.arch(voussoirs=9), generators.extruded_arch(voussoirs=9, depth=0.4)
    assert deep.names == flat.names
    assert deep.roles.tolist() == flat.roles.tolist()
    assert deep.shapes.volumes == pytest.approx(0.4 * flat.areas)
    assert deep.centroids == pytest.approx(np.insert(flat.centroids, 1, 0.0, axis=1))


def test_the_joints_of_a_barrel_vault_are_staggered():
    vault = generators.barrel_vault(voussoirs=5, stones=3, length=1.5, springers=2)
    assert vault.n_blocks == 3 * 3 + 2 * 4 + 4
    assert vault.names[:4] == ("stone 1-1", "stone 1-2", "stone 1-3", "stone 2-1")
    assert vault.names[-4:] == ("left springer 1", "left springer 2", "right springer 1", "right springer 2")
    assert vault.roles[-4:].tolist() == ["fixed", "fixed", "moving", "moving"]


def test_the_dome_is_what_the_reference_values_are_for():
    dome = generators.dome(lunes=8, courses=6, thickness_ratio=0.12)
    stones = np.linalg.norm(dome.vertices[dome.free[dome.block_of_vertex]], axis=1)
    assert np.unique(np.round(stones, 12)).tolist() == [0.94, 1.06]
    assert dome.n_blocks == 6 * 8 + 1 + 8
    assert generators.dome(oculus=True).n_blocks == dome.n_blocks - 1
    assert dome.vertices[dome.moving[dome.block_of_vertex]][:, 2].max() == 0.0


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        ({"lunes": 2}, "lunes is 2; give a whole number of at least 3"),
        ({"oculus": "no"}, "oculus is 'no'; give true or false"),
        ({"cap": 95.0}, "cap is 95 and springing 90 degrees"),
        ({"thickness_ratio": 0.0}, "thickness_ratio is 0"),
        ({"thickness_ratio": 1.2}, "thickness_ratio is 1.2; give at most 1"),
        ({"radius": -1.0}, "radius is -1 m; give a number above 0"),
    ],
)
def test_impossible_domes(parameters, reason):
    with pytest.raises(ValueError, match=reason):
        generators.dome(**parameters)


@pytest.mark.slow
@pytest.mark.parametrize("name", IN_SPACE)
def test_every_layout_stands(name):
    assembly = generators.build(name)
    down = solver.Settlement(direction=(0, 0, -1), increment=1e-7, limit=1e-7)
    response = solver.settle(assembly, down, friction_coefficient=0.6)
    assert response.stop == solver.Status.LIMIT_REACHED, response.message


def test_stones_cut_along_the_groin_are_convex_and_weigh_the_same():
    for vault in (generators.cross_vault, generators.pavilion_vault):
        whole, cut = vault(voussoirs=5), vault(voussoirs=5, bonded=False)
        assert cut.shapes.volumes.sum() == pytest.approx(whole.shapes.volumes.sum())
        assert cut.n_blocks == whole.n_blocks + 8


def test_headers_tie_both_leaves():
    wall = generators.two_leaf_wall(bricks=4, courses=3, cavity=0.05)
    headers = [i for i, name in enumerate(wall.names) if name.startswith("header")]
    assert len(headers) == 4
    for i in headers:
        assert np.ptp(wall.vertices[wall.block_of_vertex == i][:, 1]) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("bricks", "every", "spacing", "headers"), [(3, 2, 3, 8), (6, 2, 6, 8), (4, 1, 1, 64), (5, 9, 9, 2)]
)
def test_headers_come_in_all_their_courses_however_far_apart(bricks, every, spacing, headers):
    wall = generators.two_leaf_wall(bricks=bricks, header_courses=every, header_spacing=spacing)
    assert sum(name.startswith("header") for name in wall.names) == headers


@pytest.mark.parametrize(
    ("name", "parameters", "reason"),
    [
        ("cross vault", {"width": 4.0}, "width is 4 m, but the supports of the vault reach"),
        ("pavilion vault", {"voussoirs": 6}, "voussoirs is 6; a pavilion vault needs an odd number"),
        ("church bay", {"pier": 0.3}, "pier is 0.3 m; the vault's supports need"),
        ("T corner", {"bricks": 3}, "bricks is 3; give an even number"),
        ("cross vault", {"bonded": "False"}, "bonded is 'False'; give true or false"),
        ("pavilion vault", {"bonded": 1}, "bonded is 1; give true or false"),
        ("barrel vault", {"stones": 0}, "stones is 0; give a whole number of at least 1"),
        ("two-leaf wall", {"cavity": -0.1}, "cavity is -0.1"),
        (
            "two-leaf wall",
            {"header_courses": 12},
            "header_courses is 12 and courses 9, .* give header_courses of at most 9",
        ),
    ],
)
def test_impossible_dimensions_are_named(name, parameters, reason):
    with pytest.raises(ValueError, match=reason):
        generators.build(name, parameters)
