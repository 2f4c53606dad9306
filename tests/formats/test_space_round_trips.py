"""Blocks in space by round trip through every format that holds them: shapes, names, roles, materials, density."""

from dataclasses import replace

import numpy as np
import pytest
from structures import layout_of

import solver
from blockvis import generators, read, read_layout, save_layout, write_layout
from blockvis.cli import main
from solver import mechanics

#: What a file cannot say of a block.
SILENT = {".stl": ("roles", "materials", "density")}

WRITTEN = (".obj", ".stl", ".ply", ".json", ".compas.json", ".vtu", ".vtk")


@pytest.fixture(scope="module")
def vault():
    """Stones with three to eight faces, re-entrant ones, names with blanks and letters beyond ASCII."""
    built = generators.cross_vault(voussoirs=3, stone=2.0)
    names = [name.replace("keystone", 'Schlußstein "K"') for name in built.names]
    return replace(built, names=tuple(names), density=2000.0 + 10.0 * np.arange(built.n_blocks))


@pytest.mark.parametrize("suffix", WRITTEN)
def test_everything_comes_back(vault, suffix, tmp_path):
    path = tmp_path / f"vault{suffix}"
    save_layout(vault, path)
    again = read(path)
    order = [again.index(name) for name in vault.names]
    assert again.dimension == 3
    assert again.n_blocks == vault.n_blocks
    assert np.allclose(again.shapes.volumes[order], vault.shapes.volumes, rtol=1e-12)
    assert np.allclose(again.centroids[order], vault.centroids, atol=1e-12)
    for i, j in enumerate(order):
        corners, drawn = (a.vertices[a.block_of_vertex == k] for a, k in ((again, j), (vault, i)))
        assert np.abs(corners[:, None] - drawn[None]).max(axis=2).min(axis=0).max() < 1e-12
        assert len(corners) == len(drawn)
    faces = np.bincount(again.shapes.block_of_face)[order]
    assert faces.tolist() == np.bincount(vault.shapes.block_of_face).tolist()
    silent = SILENT.get(suffix, ())
    if "roles" not in silent:
        assert (again.roles[order] == vault.roles).all()
    if "materials" not in silent:
        assert tuple(again.materials[j] for j in order) == vault.materials
    if "density" not in silent:
        assert np.allclose(again.density[order], vault.density)


@pytest.mark.parametrize("suffix", [".obj", ".glb"])
def test_names_that_repeat_or_are_empty_lose_nothing(suffix, tmp_path):
    wall = layout_of(generators.build("two-leaf wall"))
    names = ("a", "a", "", "  b\t c ", "a (1)", "")
    layout = replace(
        wall.chosen(np.arange(len(names))),
        names=names,
        groups=tuple(f"group {k}" for k in range(len(names))),
        materials=tuple(f"stone {k}" for k in range(len(names))),
        density=2000.0 + np.arange(len(names)),
    )
    write_layout(layout, tmp_path / f"a{suffix}")
    again = read_layout(tmp_path / f"a{suffix}", dimension=3)
    for key in ("names", "groups", "materials"):
        assert getattr(again, key) == getattr(layout, key)
    np.testing.assert_array_equal(again.density, layout.density)
    for (points, _), (drawn, _) in zip(again.solids, layout.solids, strict=True):
        np.testing.assert_allclose(points.mean(axis=0), drawn.mean(axis=0), atol=1e-6)


@pytest.mark.parametrize("far", [0.0, 2600000.0])
def test_a_block_called_as_the_frame_of_trimesh_stays_where_it_is(far, tmp_path):
    stones = [[[0, 0], [1, 0], [1, 1], [0, 1]], [[0, 1], [1, 1], [1, 2], [0, 2]]]
    drawn = solver.Assembly.from_outlines(np.add(stones, [far, 1200.0]), names=["ground", "world"])
    save_layout(drawn, tmp_path / "a.glb")
    again = read(tmp_path / "a.glb")
    assert again.names == drawn.names
    np.testing.assert_allclose(again.centroids, drawn.centroids, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("suffix", [".stl", ".compas.json"])
def test_the_same_joints_are_found(vault, suffix, tmp_path):
    path = tmp_path / f"vault{suffix}"
    save_layout(vault, path)
    again = read(path, roles={"springer *": "fixed"})
    points = [len(mechanics.find_contacts(a, a.vertices, 1e-6)) for a in (vault, again)]
    assert points[0] == points[1]


@pytest.mark.parametrize("suffix", [".stl", pytest.param(".glb", marks=pytest.mark.thorough)])
def test_one_file_per_stone(suffix, tmp_path):
    """In a .glb y is up."""
    dome = generators.dome(lunes=4, courses=2)
    for i, name in enumerate(dome.names):
        layout = layout_of(dome).chosen([i])
        write_layout(layout, tmp_path / f"{name}{suffix}")
    again = read(tmp_path, roles={"springer *": "moving"}, dimension=3)
    assert sorted(again.names) == sorted(dome.names)
    order = [again.index(name) for name in dome.names]
    np.testing.assert_allclose(again.centroids[order], dome.centroids, atol=1e-6)
    np.testing.assert_allclose(again.shapes.volumes[order], dome.shapes.volumes, rtol=1e-6)
    assert int(again.moving.sum()) == 4


def test_files_with_different_coordinates_up_are_refused(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    trimesh.Scene(trimesh.creation.box((1, 1, 1))).export(tmp_path / "a.glb")
    save_layout(generators.dome(lunes=4, courses=2), tmp_path / "b.glb")
    with pytest.raises(
        ValueError, match="y is up in some of its files and z in others; export them alike, or give view"
    ):
        read_layout(tmp_path, dimension=3)
    assert read_layout(tmp_path, dimension=3, view="xy").n_blocks == 14


def test_formats_of_the_plane_refuse_blocks_in_space(vault, tmp_path):
    for suffix in (".dxf", ".svg", ".msh", ".vtp"):
        with pytest.raises(ValueError, match=r"holds no blocks in space; use one of .*\.obj"):
            save_layout(vault, tmp_path / f"vault{suffix}")
        assert not (tmp_path / f"vault{suffix}").exists()


def test_convert_and_info(tmp_path, capsys):
    assert main(["layout", "dome", "lunes=4", "courses=2", "-o", str(tmp_path / "dome.obj")]) == 0
    assert main(["convert", str(tmp_path / "dome.obj"), str(tmp_path / "dome.vtu")]) == 0
    assert main(["info", str(tmp_path / "dome.vtu")]) == 0
    said = capsys.readouterr().out
    assert "blocks in space 13" in said
    assert "'free' 9, 'moving' 4" in said
    assert "weight" in said
    assert "largest block   'stone 1-" in said
    weight = 9.81 * generators.dome(lunes=4, courses=2).masses[:9].sum()
    assert f"weight          {weight:.6g} N, supports" in said


def test_the_plane_is_asked_for_or_refused(tmp_path, capsys):
    path = tmp_path / "dome.obj"
    save_layout(generators.dome(lunes=4, courses=1), path)
    assert main(["info", str(path), "--dimension", "2"]) == 2
    assert "dimension = 3 reads the blocks in space" in capsys.readouterr().err


def test_an_arch_of_bodies_is_in_the_plane_unless_space_is_asked_for(tmp_path):
    path = tmp_path / "arch.obj"
    save_layout(generators.extruded_arch(voussoirs=5), path)
    assert read_layout(path).dimension == 2
    assert read(path, dimension=3).shapes.volumes == pytest.approx(generators.extruded_arch(voussoirs=5).shapes.volumes)


def test_a_drawing_in_the_plane_stands_upright_in_space(tmp_path):
    flat = generators.segmental_arch(voussoirs=5, depth=0.4)
    save_layout(flat, tmp_path / "arch.dxf")
    deep = read(tmp_path / "arch.dxf", dimension=3, thickness=0.4)
    assert deep.shapes.volumes == pytest.approx(0.4 * flat.areas)
    assert deep.centroids == pytest.approx(np.insert(flat.centroids, 1, 0.0, axis=1), abs=1e-9)


def test_glb_comes_back_in_single_precision_with_y_up(vault, tmp_path):
    """One node a block, with its name; other programs find the vault standing."""
    import trimesh

    path = tmp_path / "vault.glb"
    save_layout(vault, path)
    scene = trimesh.load_scene(path)
    assert set(scene.geometry) == set(vault.names)
    np.testing.assert_allclose(scene.bounds[:, 1], [vault.vertices[:, 2].min(), vault.vertices[:, 2].max()], atol=1e-6)
    again = read(path)
    assert again.names == vault.names
    assert again.roles.tolist() == vault.roles.tolist()
    assert again.materials == vault.materials
    np.testing.assert_array_equal(again.density, vault.density)
    np.testing.assert_allclose(again.shapes.volumes, vault.shapes.volumes, rtol=1e-5)
    np.testing.assert_allclose(again.centroids, vault.centroids, atol=1e-5)
    flat = generators.arch()
    save_layout(flat, tmp_path / "arch.glb")
    again = read(tmp_path / "arch.glb")
    assert again.dimension == 2
    np.testing.assert_allclose(again.centroids, flat.centroids, atol=1e-6)


def test_coordinates_of_the_world_survive_single_precision_or_are_noted(tmp_path):
    """A .glb is written about the middle of the blocks; what others rounded to 0.25 m is said."""
    import trimesh

    flat = generators.arch()
    rings = [np.add(flat.outline(i), [2600000.0, 1200000.0]) for i in range(flat.n_blocks)]
    far = solver.Assembly.from_outlines(rings, names=flat.names, roles=flat.roles)
    save_layout(far, tmp_path / "far.glb")
    np.testing.assert_allclose(read(tmp_path / "far.glb").areas, flat.areas, rtol=1e-6)
    assert "single precision" not in " ".join(read_layout(tmp_path / "far.glb").notes)
    solids = [trimesh.creation.box(bounds=[[2600000.2 + k, 0, 0], [2600001.2 + k, 0.5, 1]]) for k in range(2)]
    (tmp_path / "a.stl").write_bytes(trimesh.util.concatenate(solids).export(file_type="stl"))
    assert "numbers of single precision, 0.25 units apart at 2.6e+06" in " ".join(read_layout(tmp_path / "a.stl").notes)


def test_coordinates_of_single_precision_are_noted_though_planes_are_fitted_to_faces(tmp_path):
    """The corners of these have all digits again."""
    dome = layout_of(generators.dome(lunes=8, courses=4))
    far = tuple((np.float32(points + 45000.0).astype(float), faces) for points, faces in dome.solids)
    write_layout(replace(dome, blocks=far), tmp_path / "a.obj")
    notes = " ".join(read_layout(tmp_path / "a.obj").notes)
    assert "planes were fitted to warped faces" in notes
    assert "numbers of single precision, 0.00391 units apart at 4.5e+04" in notes
