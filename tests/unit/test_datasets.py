"""Datasets and the files they go to."""

import re

import numpy as np
import pytest
import pyvista as pv
from structures import BENT, arch_response, parted, wall

import solver
from blockvis.results.datasets import block_dataset, contact_dataset
from blockvis.results.viewer_files import output_times
from blockvis.system.vtk_files import write_pvd, write_vtu


def test_every_block_is_one_polygon_bent_ones_too():
    bent = solver.Assembly.from_outlines(list(BENT.values()), names=list(BENT))
    grid = block_dataset(bent)
    assert grid.n_cells == 3
    assert set(grid.celltypes) == {int(pv.CellType.POLYGON)}
    for block in range(3):
        corners = grid.get_cell(block).points[:, :2]
        np.testing.assert_array_equal(corners, bent.outline(block))


def test_blocks_carry_what_happened_to_them():
    response = arch_response()
    increment = response.path[-1]
    grid = block_dataset(response.assembly, increment)
    moved = increment.pose.displacements(response.assembly)
    np.testing.assert_array_equal(grid.cell_data["displacement"][:, :2], moved[:, :2])
    np.testing.assert_array_equal(grid.cell_data["rotation"], moved[:, 2])
    np.testing.assert_allclose(
        grid.points[:, :2] - grid.point_data["displacement"][:, :2], response.assembly.vertices, atol=1e-12
    )
    names = [str(grid.field_data["role_names"][k]) for k in grid.cell_data["role"]]
    assert names == list(response.assembly.roles) == [str(name) for name in grid.cell_data["role_name"]]
    assert grid.field_data["reaction"][0] == increment.reaction
    assert grid.field_data["status"][0] == "equilibrium"


def test_contact_forces_balance_the_weight():
    response = arch_response()
    assembly, increment = response.assembly, response.path[-1]
    grid = contact_dataset(assembly, increment)
    total = np.zeros((assembly.n_blocks, 3))
    np.add.at(total, grid.point_data["block_a"], grid.point_data["force"])
    np.subtract.at(total, grid.point_data["block_b"], grid.point_data["force"])
    weight = assembly.masses * solver.GRAVITY
    np.testing.assert_allclose(total[assembly.free, 1], weight[assembly.free], rtol=1e-6)
    np.testing.assert_allclose(total[assembly.free, 0], 0.0, atol=1e-6 * weight.sum())


def test_vtu_comes_back_through_pyvista(tmp_path):
    names = ["plain", "Schlußstein №1", "<b> & \"quotes\" 'too'"]
    assembly = solver.Assembly.from_outlines(list(BENT.values()), names=names, materials=["tuff", "", "brick"])
    written = block_dataset(assembly)
    back = pv.read(write_vtu(written, tmp_path / "new folder" / "blocks.vtu"))
    assert [str(name) for name in back.cell_data["name"]] == names
    assert [str(name) for name in back.cell_data["material"]] == ["tuff", "", "brick"]
    np.testing.assert_array_equal(back.points, written.points)
    assert set(back.cell_data.keys()) == set(written.cell_data.keys())
    assert set(back.field_data.keys()) == set(written.field_data.keys())
    assert [path.name for path in (tmp_path / "new folder").iterdir()] == ["blocks.vtu"]


def test_contacts_come_back_through_pyvista(tmp_path):
    response = arch_response()
    written = contact_dataset(response.assembly, response.path[-1])
    back = pv.read(write_vtu(written, tmp_path / "contacts.vtu"))
    for name in written.point_data:
        np.testing.assert_array_equal(back.point_data[name], written.point_data[name])


def test_vtu_is_inline_binary_with_long_headers(tmp_path):
    response = parted(wall(12, 12), 2, 0)
    path = write_vtu(contact_dataset(response.assembly, response.increments[0]), tmp_path / "contacts.vtu")
    text = path.read_text(encoding="utf-8")
    assert len(text) > 10_000
    assert 'header_type="UInt64"' in text
    assert "vtkZLibDataCompressor" in text
    assert "AppendedData" not in text
    assert set(re.findall(r'format="(\w+)"', text)) == {"binary"}


def test_pvd_can_be_read_after_every_increment(tmp_path):
    response = arch_response()
    times = output_times(response.increments)
    entries = []
    for k in range(3):
        write_vtu(block_dataset(response.assembly, response.increments[k]), tmp_path / f"increments & more/{k}.vtu")
        entries.append((times[k], f"increments & more/{k}.vtu"))
        write_pvd(tmp_path / "blocks.pvd", entries)
        reader = pv.PVDReader(tmp_path / "blocks.pvd")
        assert list(reader.time_values) == pytest.approx(times[: k + 1])
        reader.set_active_time_point(k)
        assert reader.read()[0].n_cells == response.assembly.n_blocks
    assert not list(tmp_path.glob(".*"))


def test_times_never_stand_still():
    increments = arch_response().increments
    times = output_times(increments)
    assert (np.diff(times) > 0).all()
    assert times[0] == 0.0
    path = [i.settlement for i in increments if i.status == solver.Status.EQUILIBRIUM]
    assert times[: len(path)] == path


def test_a_second_phase_starts_at_the_end_of_the_first():
    from dataclasses import replace

    path = arch_response().path[:3]
    again = [replace(i, phase=1) for i in path]
    times = output_times([*path, *again])
    end = path[-1].settlement
    assert times[3] > end
    assert times[4:] == pytest.approx([end + i.settlement for i in path[1:]])
