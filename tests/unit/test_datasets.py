"""Datasets and the files they go to."""

import re
from dataclasses import replace

import numpy as np
import pytest
import pyvista as pv
from structures import BENT, arch_response, parted, posed, wall

import blockvis
import solver
from solver import mechanics


def test_every_block_is_one_polygon_bent_ones_too():
    bent = solver.Assembly.from_outlines(list(BENT.values()), names=list(BENT))
    grid = posed(bent, solver.Pose.initial(bent)).mesh()
    assert grid.n_cells == 3
    assert set(grid.celltypes) == {int(pv.CellType.POLYGON)}
    for block in range(3):
        corners = grid.get_cell(block).points[:, :2]
        np.testing.assert_array_equal(corners, bent.outline(block))


def test_blocks_carry_what_happened_to_them():
    response = arch_response()
    increment = response.path[-1]
    grid = response.mesh(len(response.path) - 1)
    moved = increment.pose.displacements(response.assembly)
    np.testing.assert_array_equal(grid.cell_data["translation"][:, :2], moved[:, :2])
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
    assembly = response.assembly
    grid, last = response.contacts(len(response.path) - 1), response.path[-1]
    assert grid.n_cells == len(last.contacts)
    np.testing.assert_allclose(grid.point_data["normal_force"], last.forces[:, 0])
    total = np.zeros((assembly.n_blocks, 3))
    np.add.at(total, grid.point_data["block_a"], grid.point_data["force"])
    np.subtract.at(total, grid.point_data["block_b"], grid.point_data["force"])
    weight = assembly.masses * solver.GRAVITY
    np.testing.assert_allclose(total[assembly.free, 1], weight[assembly.free], rtol=1e-6)
    np.testing.assert_allclose(total[assembly.free, 0], 0.0, atol=1e-6 * weight.sum())


def test_files_come_back_through_pyvista(tmp_path):
    names = ["plain", "Schlußstein №1", "<b> & \"quotes\" 'too'", "ground"]
    ground = [[-1, -1], [15, -1], [15, 0], [-1, 0]]
    assembly = solver.Assembly.from_outlines(
        [*BENT.values(), ground],
        names=names,
        materials=["tuff", "", "brick", ""],
        roles=["free", "free", "free", "moving"],
    )
    response = solver.settle(assembly, solver.Settlement(direction=(0, -1), increment=0.01, limit=0.01))
    out = blockvis.write(response, tmp_path / "new folder")
    for part, written in (("blocks", response.mesh(1)), ("contacts", response.contacts(1))):
        back = pv.read(out / "increments" / f"{part}_00001.vtu")
        np.testing.assert_array_equal(back.points, written.points)
        for kind in ("cell_data", "point_data", "field_data"):
            arrays, ours = getattr(back, kind), getattr(written, kind)
            assert set(arrays.keys()) == set(ours.keys())
            for name in ours:
                np.testing.assert_array_equal(arrays[name], ours[name])
    blocks = pv.read(out / "increments" / "blocks_00001.vtu")
    assert [str(name) for name in blocks.cell_data["name"]] == names
    assert [str(name) for name in blocks.cell_data["material"]] == ["tuff", "", "brick", ""]


def test_vtu_is_inline_binary_with_long_headers(tmp_path):
    response = parted(wall(12, 12), 2, 0)
    out = blockvis.write(response, tmp_path / "out")
    text = (out / "increments" / "contacts_00000.vtu").read_text(encoding="utf-8")
    assert len(text) > 10_000
    assert 'header_type="UInt64"' in text
    assert "vtkZLibDataCompressor" in text
    assert "AppendedData" not in text
    assert set(re.findall(r'format="(\w+)"', text)) == {"binary"}


def times_in(out):
    return list(pv.PVDReader(out / "blocks.pvd").time_values)


@pytest.mark.thorough
def test_the_collection_ends_with_the_last_equilibrium_at_its_settlement(tmp_path):
    response = arch_response()
    out = blockvis.write(response, tmp_path / "a & b")
    times = times_in(out)
    assert (np.diff(times) > 0).all()
    assert times[0] == 0.0
    assert times == pytest.approx([i.settlement for i in response.path], abs=1e-12)
    reader = pv.PVDReader(out / "blocks.pvd")
    reader.set_active_time_point(2)
    assert reader.read()[0].n_cells == response.assembly.n_blocks


def test_a_second_phase_starts_at_the_end_of_the_first(tmp_path):
    response = arch_response()
    path = response.path[:3]
    again = [replace(i, phase=1) for i in path]
    times = times_in(blockvis.write(replace(response, increments=(*path, *again), collapse=None), tmp_path / "out"))
    end = path[-1].settlement
    assert times[3] > end
    assert times[4:] == pytest.approx([end + i.settlement for i in path[1:]])
    # Increments of a thousandth of what went before.
    fine = [replace(i, phase=1, parameter=1e-3 * end * k) for k, i in enumerate(path)]
    times = times_in(blockvis.write(replace(response, increments=(*path, *fine), collapse=None), tmp_path / "fine"))
    assert times[3] > end
    assert times[3:] == pytest.approx([end, 1.001 * end, 1.002 * end], rel=1e-8)


def test_blocks_say_how_they_move_on_and_what_falls():
    response = arch_response()
    assembly, last = response.assembly, response.mesh(-1)
    falling = mechanics.with_motion(response.path[-1], response.collapse.mechanism)
    mechanism = mechanics.mechanism_of(assembly, falling)
    np.testing.assert_array_equal(last["macro_block"], mechanism.parts)
    np.testing.assert_array_equal(last["falls"], mechanism.parts >= 0)
    # Integers of NumPy, too.
    for number in (-1, np.int64(-1)):
        assert response.mesh(number)["translation"].tolist() == last["translation"].tolist()
    np.testing.assert_allclose(last["mechanism_velocity"][:, :2], response.collapse.mechanism[:, :2])
    np.testing.assert_allclose(last["mechanism_rotation"], response.collapse.mechanism[:, 2])
    before, here = (response.path[k].pose.positions for k in (5, 4))
    velocity, step = response.mesh(4)["mechanism_velocity"][:, :2], response.settlement[5] - response.settlement[4]
    np.testing.assert_allclose(velocity[assembly.moving] * step, (before - here)[assembly.moving], atol=1e-9)
    assert not response.mesh(4)["falls"].any()


def test_contacts_say_how_much_of_their_friction_is_used_up():
    contacts = arch_response().contacts(-1)
    carries, used = contacts["carries"].astype(bool), contacts["utilisation"]
    normal, shear = contacts["normal_force"], np.abs(contacts["shear_force"])
    np.testing.assert_allclose(used[carries], shear[carries] / (contacts["friction"] * normal)[carries])
    assert carries.any()
    assert 0.0 < used.max() < 1.0 + 1e-6
    assert not used[~carries].any()


@pytest.mark.slow
def test_the_fall_begins_at_the_last_equilibrium_and_is_found_by_its_seconds():
    response = arch_response()
    start, later = response.fall(0.0), response.fall(0.5)
    # But for the supports, which are where no equilibrium is any more.
    np.testing.assert_allclose(start.points, response.mesh(-1).points, atol=1e-4)
    assert later.field_data["time"][0] == 0.5
    assert later.points[:, 1].max() < start.points[:, 1].max() - 0.1
    assert response.fall(99.0).field_data["time"][0] < 99.0
    with pytest.raises(ValueError, match="time is nan; give the seconds since the last equilibrium"):
        response.fall(np.nan)
    with pytest.raises(ValueError, match="nothing falls"):
        replace(response, collapse=None).fall(0.5)
