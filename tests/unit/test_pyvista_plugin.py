"""Blockvis as a guest of PyVista."""

import numpy as np
import pytest
import pyvista as pv

import solver
from blockvis import generators, pyvista_plugin, read, save_layout


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


@pytest.mark.slow
def test_three_lines_from_a_polygon_mesh_to_a_solved_collapse():
    # Two blocks side by side between abutments, the right one moves out: falls at 2 (sqrt(a² + h²) - a).
    a, h = 1.0, 0.25
    box = np.array([[0, 0], [a, 0], [a, h], [0, h]])
    mesh = polygons([box, box + np.array([a, 0]), box + np.array([-a, 0]), box + np.array([2 * a, 0])])
    mesh.cell_data["role"] = ["free", "free", "fixed", "moving"]
    response = mesh.blockvis.settle(direction=(1, 0), increment=0.005, limit=0.2, friction_coefficient=2.0)
    assert response.collapse.displacement == pytest.approx(2 * (np.hypot(a, h) - a), rel=5e-3)
    assert mesh.blockvis.assembly({"block 0": "fixed"}).roles[0] == "fixed"


def flat_arch():
    """Two blocks between abutments as a MultiBlock, one part each, that falls at 2 (sqrt(a² + h²) - a)."""
    box = np.array([[0, 0], [1.0, 0], [1.0, 0.25], [0, 0.25]])
    places = {"left block": 0.0, "right block": 1.0, "left abutment": -1.0, "right abutment": 2.0}
    return pv.MultiBlock({name: polygons([box + np.array([x, 0.0])]) for name, x in places.items()})


ROLES = {"left abutment": "fixed", "right abutment": "moving"}


@pytest.mark.slow
def test_a_multiblock_settles_and_its_parts_name_the_blocks():
    accessor = flat_arch().blockvis
    response = accessor.settle(
        ROLES, direction=(1, 0), increment=0.02, limit=0.2, tolerance=1e-3, friction_coefficient=2.0
    )
    assert response.assembly.names == ("left block", "right block", "left abutment", "right abutment")
    assert response.collapse.displacement == pytest.approx(2 * (np.hypot(1.0, 0.25) - 1.0), rel=2e-2)
    low, high = response.collapse.bracket
    assert high - low <= 1e-3, "the tolerance is that of the caller"
    assert repr(accessor).startswith("<4 blocks")


@pytest.mark.thorough
def test_phases_follow_one_another():
    phases = [solver.Settlement(direction=(1, 0), limit=0.02), solver.Settlement(direction=(0, -1), limit=0.01)]
    response = flat_arch().blockvis.settle(ROLES, phases=phases, friction_coefficient=2.0)
    assert {increment.phase for increment in response.path} == {0, 1}
    assert response.parameters[-1] == pytest.approx(0.03)


def test_limit_load_of_a_mesh():
    # A block as wide as half its height tips under half its weight from the side.
    box = np.array([[0, 0], [0.5, 0], [0.5, 1.0], [0, 1.0]])
    base = np.array([[-1, -1], [2, -1], [2, 0], [-1, 0.0]])
    mesh = polygons([box, base])
    mesh.cell_data["role"] = ["free", "fixed"]
    found = mesh.blockvis.limit_load(friction_coefficient=2.0)
    assert found.multiplier == pytest.approx(0.5, rel=1e-6)
    assert mesh.blockvis.limit_load(friction_coefficient=0.3).multiplier == pytest.approx(0.3, rel=1e-6)
    with pytest.raises(TypeError, match="give one of them"):
        mesh.blockvis.limit_load(friction_coefficient=0.3, interfaces=solver.Interfaces(solver.InterfaceLaw()))


def test_cubes_are_blocks_alone_and_together():
    cubes = pv.MultiBlock({name: pv.Cube(center=(0, 0, z)) for name, z in (("base", 0.0), ("top", 1.0))})
    for layout in (cubes.blockvis.layout(), cubes.combine().blockvis.layout()):
        assert layout.n_blocks == 2
        heights = sorted(ring[:, 1].mean() for ring in layout.outlines)
        assert heights[1] - heights[0] == pytest.approx(1.0)
    assert cubes.blockvis.layout().names == ("base", "top")
    assert cubes.blockvis.assembly({"base": "fixed"}).roles.tolist() == ["fixed", "free"]


def test_an_open_shell_is_no_body():
    shell = pv.Cube().extract_cells(range(5)).extract_surface(algorithm="dataset_surface")
    with pytest.raises(ValueError, match="not flat"):
        shell.blockvis.layout()


def test_the_blocks_are_drawn_with_their_supports_apart(tmp_path):
    file = tmp_path / "blocks.png"
    flat_arch().blockvis.plot(ROLES, off_screen=True, screenshot=file, names=False, window_size=(400, 200))
    picture = np.asarray(pv.read(file).point_data.active_scalars).reshape(200, 400, -1)[..., :3].astype(int)
    row = picture[100, [60, 150, 250, 340]]
    assert np.ptp(row[0]) < 12, "a fixed support is grey"
    assert row[3][1] - row[3][0] > 40, "a moving support has the colour of the settlement"
    assert row[1][0] - row[1][2] > 15, "free blocks have that of stone"
    flat_arch().blockvis.save(tmp_path / "blocks.dxf")
    assert read(tmp_path / "blocks.dxf").n_blocks == 4


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


def test_closed_surfaces_in_space_are_blocks_in_space(tmp_path):
    built = generators.dome(lunes=4, courses=1)
    save_layout(built, tmp_path / "dome.vtu")
    assembly = pv.read(tmp_path / "dome.vtu").blockvis.assembly()
    assert assembly.dimension == 3
    assert assembly.roles.tolist() == built.roles.tolist()
    assert assembly.shapes.volumes == pytest.approx(built.shapes.volumes)
