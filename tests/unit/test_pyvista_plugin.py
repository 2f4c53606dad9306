"""Blockvis as a guest of PyVista."""

import numpy as np
import pytest
import pyvista as pv

from blockvis import pyvista_plugin
from blockvis.formats.read import read


def polygons(outlines):
    points = np.concatenate([np.column_stack([ring, np.zeros(len(ring))]) for ring in outlines])
    starts = np.cumsum([0, *(len(ring) for ring in outlines[:-1])])
    faces = np.concatenate([[len(r), *range(s, s + len(r))] for r, s in zip(outlines, starts, strict=True)])
    return pv.PolyData(points, faces=faces)


def test_layouts_through_pyvista(tmp_path):
    mesh = polygons([np.array([[0, 0], [2, 0], [2, 1], [0, 1.0]]), np.array([[2, 0], [3, 0], [2, 1.0]])])
    mesh.cell_data["name"] = ["left", "right"]
    for suffix in pyvista_plugin.WRITES:
        mesh.save(tmp_path / f"a{suffix}")
        assert read(tmp_path / f"a{suffix}").names == ("left", "right")
    assert ".dxf" in pyvista_plugin.READS
    for suffix in set(pyvista_plugin.READS) & set(pyvista_plugin.WRITES):
        again = pv.read(tmp_path / f"a{suffix}")
        assert again.n_cells == 2
        assert list(again.cell_data["name"]) == ["left", "right"]


def test_three_lines_from_a_polygon_mesh_to_a_solved_collapse():
    # Two blocks side by side between abutments, the right one moves out: falls at 2 (sqrt(a² + h²) - a).
    a, h = 1.0, 0.25
    box = np.array([[0, 0], [a, 0], [a, h], [0, h]])
    mesh = polygons([box, box + np.array([a, 0]), box + np.array([-a, 0]), box + np.array([2 * a, 0])])
    mesh.cell_data["role"] = ["free", "free", "fixed", "moving"]
    response = mesh.blockvis.settle(direction=(1, 0), increment=0.005, limit=0.2, friction_coefficient=2.0)
    assert response.collapse.displacement == pytest.approx(2 * (np.hypot(a, h) - a), rel=5e-3)
    assert mesh.blockvis.assembly({"block 0": "fixed"}).roles[0] == "fixed"


def test_meshes_without_flat_blocks_stay_with_pyvista(tmp_path):
    ball = pv.Sphere(theta_resolution=8, phi_resolution=8).delaunay_3d()
    pv.save_meshio(tmp_path / "ball.msh", ball, file_format="gmsh22")
    assert ".msh" in pyvista_plugin.READS
    again = pv.read(tmp_path / "ball.msh")
    assert again.n_cells == ball.n_cells
    assert set(np.asarray(again.celltypes)) == {10}
    skin = ball.extract_surface(algorithm="dataset_surface").triangulate()
    pv.save_meshio(tmp_path / "skin.msh", skin, file_format="gmsh22")
    assert pv.read(tmp_path / "skin.msh").n_cells == skin.n_cells
    (tmp_path / "broken.msh").write_text("no mesh", encoding="utf-8")
    with pytest.raises(ValueError, match="is not a gmsh mesh: it has no section"):
        pv.read(tmp_path / "broken.msh")


def test_a_block_in_pieces_is_refused_and_one_with_a_hole_is_left_out_with_a_note():
    corners = np.array([[x, y, 0.0] for y in range(4) for x in range(5)])

    def mesh(cells, blocks):
        faces = np.array([[4, 5 * y + x, 5 * y + x + 1, 5 * y + x + 6, 5 * y + x + 5] for x, y in cells])
        grid = pv.PolyData(corners, faces=faces.ravel()).cast_to_unstructured_grid()
        grid.cell_data["block_id"] = blocks
        return grid

    ring = [(x, y) for x in range(3) for y in range(3) if (x, y) != (1, 1)]
    with pytest.warns(UserWarning, match="left out: 1 face with a hole"):
        assert mesh([*ring, (3, 0)], [0] * 8 + [1]).blockvis.assembly().n_blocks == 1
    with pytest.raises(ValueError, match="is in 2 separate pieces"):
        mesh([(0, 0), (2, 2), (3, 0)], [0, 0, 1]).blockvis.assembly()
