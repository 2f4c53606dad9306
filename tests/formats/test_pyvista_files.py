"""Files of VTK as pyvista and ParaView write them."""

import logging
import re

import numpy as np
import pytest
import pyvista as pv

import blockvis
import solver
from blockvis import read, read_layout


def quads(n=3):
    points = np.array([[k + i, j, 0] for k in range(n) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))], dtype=float)
    faces = np.array([[4, 4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 3] for k in range(n)])
    return pv.PolyData(points, faces=faces.ravel())


@pytest.mark.parametrize("suffix", [".vtp", ".vtk"])
def test_one_polygon_is_one_block_without_ids(tmp_path, suffix):
    quads().save(tmp_path / f"a{suffix}")
    drawing = read_layout(tmp_path / f"a{suffix}")
    assert drawing.n_blocks == 3
    assert any("one block per cell: no cell array 'block_id'" in note for note in drawing.notes)


def test_reading_leaves_logging_as_it_was(tmp_path):
    quads().save(tmp_path / "a.vtp")
    try:
        logging.disable(logging.WARNING)
        read_layout(tmp_path / "a.vtp")
        assert logging.root.manager.disable == logging.WARNING
    finally:
        logging.disable(logging.NOTSET)


def test_cells_with_one_id_are_one_block(tmp_path):
    mesh = pv.Plane(i_size=4, j_size=2, i_resolution=8, j_resolution=4)
    x = mesh.cell_centers().points[:, 0]
    mesh.cell_data["block_id"] = np.where(x < 0, 7, 9)
    mesh.cell_data["material"] = np.where(x < 0, "stone", "brick")
    mesh.triangulate().cast_to_unstructured_grid().save(tmp_path / "a.vtu")
    assembly = read(tmp_path / "a.vtu")
    assert assembly.names == ("block 7", "block 9")
    assert assembly.materials == ("stone", "brick")
    assert assembly.areas == pytest.approx([4, 4], rel=1e-6)
    assert np.diff(assembly.offsets).tolist() == [4, 4]


def test_triangles_that_share_points_are_one_block(tmp_path):
    pieces = [pv.Disc(center=(3 * k, 0, 0), inner=0, outer=1, c_res=6).triangulate().clean() for k in range(3)]
    pv.merge(pieces, merge_points=False).save(tmp_path / "a.vtp")
    assert read(tmp_path / "a.vtp").n_blocks == 3


def test_multiblock_names_the_blocks(tmp_path):
    both = pv.MultiBlock({"left": quads(1), "right": quads(1).translate((5, 0, 0))})
    both.save(tmp_path / "a.vtm")
    assert read(tmp_path / "a.vtm").names == ("left", "right")


def test_pvd_gives_its_first_time(tmp_path):
    for k in range(2):
        quads(1).translate((0, 10 * k, 0)).cast_to_unstructured_grid().save(tmp_path / f"{k}.vtu")
    entries = "".join(f'<DataSet timestep="{k}" part="0" file="{k}.vtu"/>' for k in range(2))
    path = tmp_path / "a.pvd"
    path.write_text(
        f'<VTKFile type="Collection" version="0.1"><Collection>{entries}</Collection></VTKFile>', encoding="utf-8"
    )
    assert read(path).centroids[0].tolist() == [0.5, 0.5]
    path.write_text(path.read_text(encoding="utf-8").replace("1.vtu", "lost.vtu"), encoding="utf-8")
    with pytest.raises(ValueError, match=r"names '.*lost.vtu', which does not exist"):
        read(path)


def test_results_are_layouts_too(tmp_path):
    wall = solver.Assembly.from_outlines(
        [[[0, 0], [1, 0], [1, 1], [0, 1]], [[1, 0], [2, 0], [2, 1], [1, 1]]],
        names=["a", "b"],
        roles=["fixed", "free"],
        materials=["stone", "brick"],
    )
    out = blockvis.write(
        solver.Structure(wall, friction_coefficient=0.6).limit_load(acceleration=(1, 0)).response, tmp_path / "out"
    )
    again = read(out / "increments" / "blocks_00000.vtu")
    assert again.names == wall.names
    assert again.roles.tolist() == wall.roles.tolist()
    assert again.materials == wall.materials


def test_extruded_cells_become_a_layout_with_a_thickness(tmp_path):
    boxes = pv.merge([pv.Box((k, k + 1, 0, 1, 0, 0.3)).delaunay_3d() for k in (0, 2)], merge_points=False)
    boxes.save(tmp_path / "a.vtu")
    assembly = read(tmp_path / "a.vtu")
    assert assembly.thickness == pytest.approx([0.3, 0.3], rel=1e-6)
    assert assembly.areas == pytest.approx([1, 1], rel=1e-6)


def test_a_hostile_count_is_refused_before_memory_is_reserved(tmp_path):
    quads().cast_to_unstructured_grid().save(tmp_path / "a.vtu")
    data = (tmp_path / "a.vtu").read_bytes()
    assert b'NumberOfPoints="12"' in data
    (tmp_path / "a.vtu").write_bytes(data.replace(b'NumberOfPoints="12"', b'NumberOfPoints="900000000000"'))
    with pytest.raises(ValueError, match=r"announces 900000000000 items in \d+ bytes"):
        read(tmp_path / "a.vtu")
    (tmp_path / "b.vtk").write_text(
        "# vtk DataFile Version 3.0\nx\nASCII\nDATASET POLYDATA\nPOINTS 999999999999 float\n",
        encoding="utf-8",
    )
    with pytest.raises(ValueError, match="announces 999999999999 items"):
        read(tmp_path / "b.vtk")


@pytest.mark.parametrize("index", [-7, 2147483648])
def test_a_part_of_an_absurd_number_is_refused(tmp_path, index):
    """VTK reserves memory for as many parts, and ended the process."""
    quads().cast_to_unstructured_grid().save(tmp_path / "part.vtu")
    dataset = f'<vtkMultiBlockDataSet><DataSet index="{index}" file="part.vtu"/></vtkMultiBlockDataSet>'
    (tmp_path / "a.vtm").write_text(
        f'<VTKFile type="vtkMultiBlockDataSet" version="1.0">{dataset}</VTKFile>', encoding="utf-8"
    )
    with pytest.raises(ValueError, match=rf"announces {index} items in \d+ bytes"):
        read(tmp_path / "a.vtm")


@pytest.mark.parametrize("binary", [True, False])
def test_offsets_beyond_the_numbers_of_cells_are_refused(tmp_path, binary):
    """VTK read on beyond them, and ended the process."""
    quads().cast_to_unstructured_grid().save(tmp_path / "a.vtk", binary=binary)
    data = (tmp_path / "a.vtk").read_bytes()
    assert read(tmp_path / "a.vtk").n_blocks
    old, new = (b"\0\0\0\x04", b"\0\0@\x04") if binary else (b"\n0 4 ", b"\n0 4000 ")
    start = data.index(b"OFFSETS")
    (tmp_path / "b.vtk").write_bytes(data[:start] + data[start:].replace(old, new, 1))
    with pytest.raises(ValueError, match=r"cells do not add up to the \d+ numbers that it announces"):
        read(tmp_path / "b.vtk")


@pytest.mark.parametrize("announced", ["2 2 10", "2 10 10", "2 9", "3 10"])
def test_cells_of_old_files_that_do_not_add_up_are_refused(tmp_path, announced):
    cells = "CELLS 2 10\n4 0 1 2 3\n4 1 4 5 2\nCELL_TYPES 2\n9\n9\n"
    points = "POINTS 6 double\n0 0 0 1 0 0 1 1 0 0 1 0 2 0 0 2 1 0\n"
    # A field whose name is that of cells is none.
    field = "CELL_DATA 2\nFIELD f 1\nlines 1 2 int\n5 6\n"
    text = f"# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\n{points}{cells}{field}"
    (tmp_path / "a.vtk").write_text(text, encoding="utf-8")
    assert read(tmp_path / "a.vtk").n_blocks == 2
    (tmp_path / "b.vtk").write_text(text.replace("2 10", announced, 1), encoding="utf-8")
    with pytest.raises(ValueError, match=r"cells do not add up to|cannot be read whole"):
        read(tmp_path / "b.vtk")


@pytest.mark.parametrize("version", [b"0.1", b"-7.1", b"1e308.1", b"5.vtk", b""])
def test_a_version_that_is_not_that_of_the_cells_is_refused(tmp_path, version):
    """VTK read their offsets as numbers of corners, and ended the process."""
    quads().cast_to_unstructured_grid().save(tmp_path / "a.vtk")
    data = (tmp_path / "a.vtk").read_bytes()
    assert data.startswith(b"# vtk DataFile Version 5.1\n")
    (tmp_path / "b.vtk").write_bytes(data.replace(b"5.1", version, 1))
    with pytest.raises(ValueError, match="is not of the version of its cells; export it again"):
        read(tmp_path / "b.vtk")


def test_a_cell_array_whose_name_is_no_text_is_refused(tmp_path):
    grid = quads().cast_to_unstructured_grid()
    grid.cell_data["thickness"] = np.ones(grid.n_cells)
    grid.save(tmp_path / "a.vtk")
    data = (tmp_path / "a.vtk").read_bytes()
    (tmp_path / "b.vtk").write_bytes(data.replace(b"thickness", b"thickne\xf3s", 1))
    with pytest.raises(ValueError, match="cell array whose name cannot be read; give it another name"):
        read(tmp_path / "b.vtk")


def test_an_array_that_vtk_gives_up_is_not_left_out_in_silence(tmp_path):
    """meshio names types of VTK's own, at which VTK leaves out all further arrays."""
    mesh = pv.Plane(i_resolution=2, j_resolution=1).triangulate().cast_to_unstructured_grid()
    mesh.cell_data["block_id"] = np.array([1, 1, 2, 2], dtype=np.int32)
    mesh.save(tmp_path / "a.vtk", binary=False)
    assert read(tmp_path / "a.vtk").n_blocks == 2
    text = (tmp_path / "a.vtk").read_text(encoding="utf-8").replace("block_id 1 4 int", "block_id 1 4 vtktypeint32")
    text = text.replace("SCALARS block_id int", "SCALARS block_id vtktypeint32")
    assert "vtktypeint32" in text
    (tmp_path / "a.vtk").write_text(text, encoding="utf-8")
    with pytest.raises(
        ValueError, match=r"cannot be read whole by VTK \(Unsupported .*vtktypeint32.*\); save it as .vtu"
    ):
        read(tmp_path / "a.vtk")


def test_a_broken_vtu_is_refused_with_the_reason_of_vtk_and_nothing_is_logged(tmp_path, caplog):
    mesh = pv.Plane(i_resolution=2, j_resolution=1).triangulate().cast_to_unstructured_grid()
    mesh.cell_data["block_id"] = np.array([1, 1, 2, 2], dtype=np.int32)
    mesh.save(tmp_path / "a.vtu", binary=False)
    text = (tmp_path / "a.vtu").read_text(encoding="utf-8")
    short = re.sub(r'(Name="block_id"[^>]*>)[^<]*<', r"\1 1 <", text)
    unknown = re.sub(r'type="\w+" Name="block_id"', 'type="Foo" Name="block_id"', text)
    for broken, reason in ((short, 'Cannot read cell data array "block_id"'), (unknown, 'Unknown data type "Foo"')):
        assert broken != text
        (tmp_path / "b.vtu").write_text(broken, encoding="utf-8")
        with pytest.raises(ValueError, match=rf"read whole by VTK \({reason}.*\); export it again"):
            read(tmp_path / "b.vtu")
    assert caplog.records == []


def test_points_and_lines_are_no_blocks(tmp_path):
    pv.Line().save(tmp_path / "a.vtp")
    with pytest.raises(ValueError, match="has no surface cells"):
        read(tmp_path / "a.vtp")
    quads().save(tmp_path / "b.vtp")
    bent = pv.read(tmp_path / "b.vtp")
    bent.points[2, 2] = 0.5
    bent.points[5, 2] = 0.25
    bent.points[8, 1] = 0.25
    bent.save(tmp_path / "b.vtp")
    with pytest.raises(ValueError, match="is not flat: its points spread over"):
        read(tmp_path / "b.vtp")


def row_of_squares(*types):
    points = np.array([[x, y, 0] for x in range(4) for y in (0, 1)], dtype=float)
    cells = [[4, 2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1] for k in range(len(types))]
    return pv.UnstructuredGrid(np.ravel(cells), np.array(types, dtype=np.uint8), points)


def test_cells_of_kinds_that_are_not_read_are_counted(tmp_path):
    grid = row_of_squares(pv.CellType.QUAD, pv.CellType.LAGRANGE_QUADRILATERAL, pv.CellType.QUAD)
    grid.save(tmp_path / "a.vtu")
    with pytest.warns(UserWarning, match=r"left out: 1 cell of kinds that are not read \(1 lagrange quadrilateral\)"):
        assert read(tmp_path / "a.vtu").n_blocks == 2
    lines = [2, 0, 1, 2, 1, 3]
    pv.PolyData(grid.points, faces=[4, 0, 2, 3, 1], lines=lines).save(tmp_path / "b.vtp")
    assert not any("left out" in note for note in read_layout(tmp_path / "b.vtp").notes)


@pytest.mark.parametrize(
    ("key", "values", "says"),
    [
        (
            "density",
            [1000.0, 3000.0, 2000.0],
            "cells of the block 'block 0' differ in the cell array 'density', as 1000",
        ),
        ("role", [0, 1, 0], "differ in the cell array 'role', as 0 and 1"),
        ("role", [1, 1, 5], "block 'block 1' has role '5'; roles are free, fixed, moving"),
    ],
)
def test_cells_that_say_different_things_of_one_block_are_refused(tmp_path, key, values, says):
    grid = row_of_squares(*[pv.CellType.QUAD] * 3)
    grid.cell_data["block_id"] = [0, 0, 1]
    grid.cell_data[key] = values
    grid.save(tmp_path / "a.vtu")
    with pytest.raises(ValueError, match=says):
        read_layout(tmp_path / "a.vtu")
