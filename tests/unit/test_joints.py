"""Joints as lines and as a table, and the shapes and units of the datasets that viewers open."""

import csv
import re

import meshio
import numpy as np
import pytest
import pyvista as pv
from structures import (
    BENT,
    arch_response,
    dropped_brick,
    in_either,
    moved_and_turned,
    parted,
    posed,
    prism,
    rectangle,
    report_of,
    stacked,
    twisted,
    two_cubes,
    wall,
)

import blockvis
import solver
from solver import mechanics


def test_blocks_that_bear_on_each_other_by_little_have_a_joint_too(tmp_path):
    """The upper left one by 1 % of its length; by 0.1 % it is rounding of the drawing."""
    for by, joints in ((0.01, 3), (0.001, 2)):
        below = [rectangle(0.0, 0.0, 1.0, 1.0), rectangle(1.0, 0.0, 2.0, 1.0)]
        assembly = solver.Assembly.from_outlines([*below, rectangle(0.0, 1.0, 1.0 + by, 2.0)])
        blockvis.write(posed(assembly, solver.Pose.initial(assembly)), out := tmp_path / str(by))
        assert len((out / "joints.csv").read_text(encoding="utf-8").splitlines()) == 1 + joints


@pytest.mark.slow
def test_a_block_that_slides_has_slip_and_one_that_rocks_has_opening():
    assembly, slid = stacked(shift=(0.2, 0.0))
    joint = posed(assembly, slid).joints()
    assert joint["opening"][0] == pytest.approx(0.0, abs=1e-12)
    # The tangent is a quarter turn from the upward normal, so to the left, whichever block is the first.
    assert joint["slip"][0] == pytest.approx(-0.2)
    # Rocked by 0.1 about its lower left corner.
    c, s = np.cos(0.1), np.sin(0.1)
    assembly, rocked = stacked(shift=(0.5 * c - 0.5 * s - 0.5, 0.5 * s + 0.5 * c - 0.5), turn=0.1)
    joint = posed(assembly, rocked).joints()
    assert joint["opening"][0] == pytest.approx(2.0 * np.sin(0.05), rel=1e-9)
    assert joint["slip"][0] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("dimension", [2, 3])
def test_opening_and_slip_are_the_same_whichever_block_comes_first(dimension):
    """A block that has slid half of its length on another, and turned there."""
    found = []
    for order in ([0, 1], [1, 0]):
        if dimension == 2:
            blocks, roles = [rectangle(0, 0, 1, 1), rectangle(0, 1, 1, 2)], ["fixed", "free"]
            assembly = solver.Assembly.from_outlines([blocks[k] for k in order], roles=[roles[k] for k in order])
            shift, turn = [0.5, 0.2], [0.4]
        else:
            assembly = two_cubes(order)
            shift, turn = [0.5, 0.1, 0.2], [0.1, 0.4, 0.2]
        free = assembly.free[:, None]
        pose = solver.Pose(assembly.centroids + free * shift, free * turn)
        joint = posed(assembly, pose).joints()
        found.append((joint["opening"][0], abs(joint["slip"][0])))
    assert found[1] == pytest.approx(found[0], rel=1e-9)


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_a_stone_that_twists_slips_by_as_much_as_its_farthest_corner(order):
    for corner in [(0, 0), (1, 0), (1, 1), (0, 1)]:
        joint = posed(*twisted(order, corner, np.pi / 4.0)).joints()
        assert joint["opening"][0] == pytest.approx(0.0, abs=1e-12)
        assert joint["slip"][0] == pytest.approx(2.0 * np.sqrt(2.0) * np.sin(np.pi / 8.0))


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_slips_at_contact_points_are_measured_half_way_between_the_faces(order):
    """There a stone that twists has moved square to its arms, whichever block comes first."""
    response = posed(*twisted(order, (0, 0), np.pi / 4.0))
    contacts = response.contacts()
    assert contacts.n_points >= 4
    of_upper = np.where(response.assembly.free[contacts["block_a"]], 1.0, -1.0)[:, None] * contacts["slip"]
    square = np.cross([0.0, 0.0, 1.0], contacts.points - [0.0, 0.0, 1.0])
    np.testing.assert_allclose(of_upper, np.sin(np.pi / 4.0) * square, atol=1e-9)


def test_joints_carry_the_weight_above_them():
    response = arch_response()
    for k in (0, len(response.path) - 1):
        joints = response.joints(k)
        free = response.assembly.free
        at_supports = ~free[joints["block_a"]] | ~free[joints["block_b"]]
        # The springing joints of a semicircle are horizontal.
        assert joints["normal_force"][at_supports].sum() == pytest.approx(response.total_weight, rel=1e-6)
        assert joints.n_cells == response.assembly.n_blocks - 1
    mechanism = mechanics.mechanism_of(response.assembly, response.path[-1])
    wide = joints["opening"] > 0.01
    assert wide.sum() == 3
    hinged = {tuple(pair) for pair in mechanism.hinges}
    assert {tuple(sorted(p)) for p in zip(joints["block_a"][wide], joints["block_b"][wide], strict=True)} <= hinged


def test_blocks_that_are_not_convex_have_a_joint_on_each_face_and_keep_their_forces_apart():
    # An L that stands on a block and leans on the side of another.
    outlines = [BENT["L"], [[0, -1], [2, -1], [2, 0], [0, 0]], [[1, 1], [3, 1], [3, 3], [1, 3]]]
    assembly = solver.Assembly.from_outlines(outlines, roles=["free", "fixed", "free"], names=["L", "base", "tooth"])
    drawn = posed(
        assembly,
        solver.Pose.initial(assembly),
        lambda contacts: np.where(np.abs(contacts.frames[:, 0, 1:]) > 0.5, [[10.0, 0.0]], [[1.0, 0.0]]),
    )
    joints = drawn.joints()
    pairs = {tuple(sorted(p)) for p in zip(joints["block_a"], joints["block_b"], strict=True)}
    assert pairs == {(0, 1), (0, 2)}
    assert joints.n_cells == 3, "the tooth touches the L below and at its side"
    along = np.diff(joints.points.reshape(-1, 2, 3), axis=1)[:, 0]
    per_point = np.where(np.abs(along[:, 0]) > np.abs(along[:, 1]), 10.0, 1.0)
    assert np.all(joints["normal_force"] % per_point == 0.0)
    assert np.all(joints["normal_force"] >= per_point)
    assert joints["normal_force"].sum() == pytest.approx(drawn.path[0].forces[:, 0].sum())


def test_blocks_that_come_to_touch_later_have_a_joint_that_carries_their_force():
    assembly, _ = stacked()
    apart = solver.Assembly.from_outlines(
        [assembly.outline(0), assembly.outline(1) + np.array([0.0, 0.5])], roles=["fixed", "free"]
    )
    landed = solver.Pose(apart.centroids - np.array([(0, 0), (0, 0.5)]), np.zeros((2, 1)))
    assert posed(apart, solver.Pose.initial(apart)).joints().n_cells == 0
    response = posed(apart, landed, lambda contacts: np.tile([5.0, 0.0], (len(contacts), 1)))
    joint = response.joints()
    assert joint["initial"].tolist() == [0]
    assert joint["normal_force"][0] == pytest.approx(5.0 * len(response.path[0].contacts))
    np.testing.assert_allclose(np.sort(joint.points[:, :2], axis=0), [[0, 1], [1, 1]], atol=1e-12)


def test_frames_of_a_fall_have_no_forces():
    response = arch_response()
    fall = response.joints(len(response.increments) - 1)
    assert str(fall.field_data["status"][0]) == "falling"
    assert not fall["normal_force"].any()
    assert not fall["shear_force"].any()
    points = response.contacts(len(response.increments) - 1)
    assert response.increments[-1].forces.any(), "the solver has forces there"
    for name in ("force", "normal_force", "shear_force"):
        assert not np.any(points[name])
    assert response.contacts(len(response.path) - 1)["normal_force"].any()


@pytest.mark.parametrize("shape", ["moved", "undeformed"])
def test_the_first_warp_leads_on_and_never_back(shape):
    response = arch_response()
    moved = mechanics.moved_vertices(response.assembly, response.path[-1].pose)
    drawn = response.assembly.vertices
    mesh = response.mesh(len(response.path) - 1, shape=shape)
    np.testing.assert_allclose(mesh.points[:, :2], moved if shape == "moved" else drawn, atol=1e-12)
    warped, supports = mesh.warp_by_vector().points[:, :2], ~response.assembly.free[response.assembly.block_of_vertex]
    if shape == "undeformed":
        np.testing.assert_allclose(warped, moved, atol=1e-12)
    else:
        # On along the mechanism, by a tenth of the arch; a velocity of the blocks to first order.
        ahead = np.linalg.norm(warped - moved, axis=1)[~supports]
        assert ahead.max() == pytest.approx(0.1 * np.ptp(moved[~supports], axis=0).max())
        np.testing.assert_allclose(mesh.warp_by_vector("to_reference").points[:, :2], drawn, atol=1e-12)
    np.testing.assert_allclose(mesh["reference"][:, :2], drawn, atol=1e-12)
    joints = response.joints(len(response.path) - 1, shape=shape)
    assert joints.warp_by_vector().n_points == joints.n_points
    if shape == "undeformed":
        np.testing.assert_allclose(joints["reference"], joints.points)


def test_units_are_in_the_files(arch_folder):
    blocks, joints = (pv.read(arch_folder / "increments" / f"{part}_00003.vtu") for part in ("blocks", "joints"))
    assert "displacement [m]" in list(blocks.field_data["units"])
    assert {"opening [m]", "slip [m]", "normal_force [N]", "shear_force [N]"} <= set(joints.field_data["units"])
    assert (arch_folder / "joints.pvd").read_text(encoding="utf-8").count("joints_") == len(arch_response().path)


@pytest.mark.slow
def test_files_tell_the_units_of_their_phase(tmp_path):
    """Of a rotation the parameter is an angle, its reaction a moment; the mechanism of a collapse is per m."""
    (tmp_path / "case.toml").write_text(
        '[geometry]\nlayout = "arch"\n[analysis]\nfalling_frames = 1\n'
        "[[settlement]]\ndirection = [1, 0]\nincrement = 0.01\nlimit = 0.01\n"
        "[[settlement]]\nrotation_centre = [1.0, 0.0]\nrotation = -1.0\nincrement = 0.05\nlimit = 0.5\n",
        encoding="utf-8",
    )
    run = blockvis.run_case(tmp_path / "case.toml", tmp_path / "out", outputs=())
    last, about = len(run.response.path) - 1, ("settlement", "reaction", "mechanism_velocity", "mechanism_rotation")
    for k, units in {
        0: ("m", "N", "m/m", "rad/m"),
        last - 1: ("rad", "N·m", "m/rad", "rad/rad"),
        last: ("rad", "N·m", "m/m", "rad/m"),
        last + 1: ("rad", "N·m"),
    }.items():
        file = pv.read(run.folder / "increments" / f"blocks_{k:05d}.vtu")
        told = [f"{name} [{unit}]" for name, unit in zip(about, units, strict=False)]
        for grid in (file, run.response.mesh(k)):
            assert [unit for unit in grid.field_data["units"] if unit.startswith(about)] == [*told[2:], *told[:2]]
    assert "settlement [rad]" in list(run.response.joints(last).field_data["units"])


@pytest.mark.slow
def test_the_last_equilibrium_before_a_phase_that_falls_at_once_keeps_the_units_of_its_own_motion(tmp_path):
    (tmp_path / "case.toml").write_text(
        '[geometry]\nlayout = "arch"\nparameters = { voussoirs = 5 }\n[analysis]\nfalling_frames = 1\n'
        "[[settlement]]\nrotation_centre = [1.0, 0.0]\nrotation = -1.0\nincrement = 0.01\nlimit = 0.01\n"
        "[[settlement]]\ndirection = [1, 0]\nincrement = 0.01\nlimit = 0.01\n"
        '[[remove]]\nphase = 2\nblocks = ["voussoir 3"]\n',
        encoding="utf-8",
    )
    run = blockvis.run_case(tmp_path / "case.toml", tmp_path / "out", outputs=())
    last = len(run.response.path) - 1
    assert (run.response.path[-1].phase, run.response.collapse.reaction) == (0, None)
    for grid in (pv.read(run.folder / "increments" / f"blocks_{last:05d}.vtu"), run.response.mesh(last)):
        assert {"mechanism_velocity [m/rad]", "mechanism_rotation [rad/rad]"} <= set(grid.field_data["units"])
        assert grid["falls"].any()


@pytest.mark.thorough
def test_files_have_the_place_of_a_load_that_moves(tmp_path):
    (tmp_path / "case.toml").write_text(
        '[geometry]\nlayout = "arch"\n[analysis]\nkind = "limit load"\n'
        '[[loads]]\nkind = "live"\nforce = [0, -1]\npositions = [-0.5, 0.5, 3]\n',
        encoding="utf-8",
    )
    run = blockvis.run_case(tmp_path / "case.toml", tmp_path / "out", outputs=())
    for part in ("blocks", "joints", "contacts"):
        for k, place in enumerate([-0.5, 0.0, 0.5]):
            numbers = pv.read(run.folder / "increments" / f"{part}_{k:05d}.vtu").field_data
            assert numbers["load_position"][0] == place
            assert "load_position [m]" in list(numbers["units"])


def test_a_case_chooses_the_undeformed_shape_and_files_that_meshio_reads(tmp_path):
    text = (
        '[geometry]\nlayout = "arch"\n[settlement]\ndirection = [1, 0]\nincrement = 0.05\nlimit = 0.05\n'
        '[analysis]\nfalling_frames = 0\n[output]\nanimation = false\nvtu = "undeformed"\nvtu_strings = false\n'
    )
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    run = blockvis.run_case(tmp_path / "case.toml", tmp_path / "out", outputs=())
    for what in ("contacts", "joints", "blocks"):
        file = sorted((run.folder / "increments").glob(f"{what}_*.vtu"))[-1]
        numbers = meshio.read(file)
        assert {"displacement", "reference"} <= set(numbers.point_data)
        assert "displacement [m]" in bytes(numbers.field_data["units"]).decode().splitlines()
    names = bytes(numbers.field_data["name"]).decode().splitlines()
    assert names == list(run.response.assembly.names)
    mesh = pv.read(file)
    np.testing.assert_allclose(mesh.points[:, :2], run.response.assembly.vertices, atol=1e-12)
    assert np.abs(mesh["displacement"]).max() > 0.04
    (tmp_path / "case.toml").write_text(text.replace("undeformed", "deformed"), encoding="utf-8")
    with pytest.raises(ValueError, match=r"\[output\] vtu is 'deformed'.*moved, undeformed"):
        blockvis.read_case(tmp_path / "case.toml")


@pytest.mark.thorough
def test_meshio_gives_polyhedra_their_own_data(tmp_path):
    """It puts polyhedra together by their numbers of corners, and their data by the order of these numbers."""
    l_shaped = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=float)
    slab = rectangle(-1, -1, 3, 3)
    solids = [prism(l_shaped, 0.0, 1.0), prism(slab, -1.0, 0.0), prism(rectangle(1, 1, 2, 2), 0.0, 1.0)]
    solids.append(prism(l_shaped, 1.0, 2.0))
    roles = ["free", "moving", "free", "free"]
    blockvis.save_layout(solver.Assembly.from_solids(solids, roles=roles), tmp_path / "stones.json")
    text = (
        '[geometry]\nfile = "stones.json"\n[settlement]\ndirection = [0, 0, -1]\nincrement = 0.1\nlimit = 0.1\n'
        "[output]\nanimation = false\nvtu_strings = false\n"
    )
    (tmp_path / "case.toml").write_text(text, encoding="utf-8")
    run = blockvis.run_case(tmp_path / "case.toml", tmp_path / "out", outputs=())
    assembly, file = run.response.assembly, run.folder / "increments" / "blocks_00000.vtu"
    numbers, mesh = meshio.read(file), pv.read(file)
    assert [len(cells.data) for cells in numbers.cells] == [2, 2]
    for cells, blocks in zip(numbers.cells, numbers.cell_data["block_id"], strict=True):
        for cell, block in zip(cells.data, blocks, strict=True):
            assert (assembly.block_of_vertex[np.unique(np.concatenate(cell))] == block).all()
    assert bytes(numbers.field_data["name"]).decode().splitlines() == list(assembly.names)
    for k, block in enumerate(mesh["block_id"]):
        n = int((assembly.block_of_vertex == block).sum())
        assert (mesh.get_cell(k).n_points, mesh.get_cell(k).n_faces) == (n, n // 2 + 2)


def test_joints_csv_names_the_widest_crack_first(arch_folder):
    response = arch_response()
    rows = list(csv.DictReader((arch_folder / "joints.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == response.assembly.n_blocks - 1
    assert rows[0]["joint"] == "voussoir 6 | voussoir 7"
    widest = max(response.joints(k)["opening"].max() for k in range(len(response.path)))
    assert float(rows[0]["largest opening [m]"]) == pytest.approx(widest, rel=1e-5)
    assert float(rows[0]["settlement at largest opening [m]"]) == pytest.approx(response.path[-1].parameter, rel=1e-5)
    assert float(rows[0]["length [m]"]) == pytest.approx(0.15, rel=0.02)
    assert float(rows[0]["y [m]"]) == pytest.approx(1.0, rel=0.02)
    openings = [float(row["largest opening [m]"]) for row in rows]
    assert openings == sorted(openings, reverse=True)
    assert openings[3] == 0.0, "what a step leaves is no opening"


@pytest.mark.thorough
def test_joints_csv_has_no_opening_of_a_joint_that_is_pressed_together(tmp_path):
    outlines = [[[0, y], [1, y], [1, y + 1], [0, y + 1]] for y in range(3)]
    assembly = solver.Assembly.from_outlines(outlines, roles=["moving", "free", "free"])
    soft = solver.Interfaces(solver.InterfaceLaw(0.6, normal_stiffness=1e6))
    dead = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, -2e4, 0.0]])
    response = solver.Structure(assembly, soft).settle(
        [solver.Settlement([0.0, -1.0], increment=1e-3, limit=1e-3)] * 2, changes=[solver.PhaseChange(1, dead=dead)]
    )
    assert response.joints(-1)["opening"] == pytest.approx([-0.02, -0.02], rel=1e-3)
    out = blockvis.write(response, tmp_path / "out")
    rows = csv.DictReader((out / "joints.csv").read_text(encoding="utf-8").splitlines())
    assert [row["largest opening [m]"] for row in rows] == ["0", "0"]


@pytest.mark.thorough
def test_joints_csv_tells_the_phase_of_places_in_m_and_in_rad(tmp_path):
    response = moved_and_turned()
    out = blockvis.write(response, tmp_path / "out")
    rows = list(csv.DictReader((out / "joints.csv").read_text(encoding="utf-8").splitlines()))
    widest = max(range(len(response.path)), key=lambda k: response.joints(k)["opening"].max())
    found = [float(rows[0][f"{what} at largest opening"]) for what in ("settlement", "phase")]
    assert found == [response.path[widest].parameter, response.path[widest].phase]
    assert {row["phase at largest opening"] for row in rows} == {"0", "1"}


def taken_away_before_a_settlement(dimension):
    """Two stones side by side, the right one with a third on it until that is taken away, on a support that sinks."""
    places = [(-1, -0.5, 1, 0), (1, -0.5, 3, 0), (-1, 0, 1, 0.5), (1, 0, 3, 0.5), (2, 0.5, 3, 1)]
    given = {"names": ["L", "R", "l", "r", "x"], "roles": ["fixed", "moving", "free", "free", "free"]}
    assembly = in_either(dimension, [rectangle(*place) for place in places], **given)
    settlement = solver.Settlement([0.0] * (dimension - 1) + [-1.0], increment=0.05, limit=0.05)
    change = solver.PhaseChange(1, removed=[False] * 4 + [True])
    return solver.Structure(assembly, solver.Interfaces(solver.InterfaceLaw(0.6))).settle(
        [settlement] * 2, changes=[change]
    )


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.slow
def test_joints_of_a_stone_that_is_taken_away_have_no_opening(tmp_path, dimension):
    response = taken_away_before_a_settlement(dimension)
    last = response.path[-1]
    assert last.pose.positions[3, -1] < response.path[0].pose.positions[3, -1] - 0.09, "r has gone down by itself"
    for name in ("opening", "normal_force", "shear_force"):
        assert np.abs(response.joints(-1)[name][response.joints(-1)["joint"] == "r | x"]).max() < 1e-9
    out = blockvis.write(response, tmp_path / "out")
    rows = csv.DictReader((out / "joints.csv").read_text(encoding="utf-8").splitlines())
    assert {row["joint"]: float(row["largest opening [m]"]) for row in rows}["r | x"] < 1e-9
    page = report_of(response)
    if dimension == 3:
        assert float(re.search(r'"widest_crack":([\d.e-]+)', page).group(1)) < 1e-6
    assert '"gone":[4]' in page


@pytest.mark.slow
def test_joints_of_a_stone_that_is_lost_open_no_more(tmp_path):
    response = dropped_brick(0.05)
    lost = response.losses[0].settlement
    assert lost < response.path[-1].parameter
    out = blockvis.write(response, tmp_path / "out")
    table = csv.DictReader((out / "joints.csv").read_text(encoding="utf-8").splitlines())
    rows = [row for row in table if "brick" in row["joint"]]
    assert len(rows) == 2
    for row in rows:
        assert float(row["settlement at largest slip [m]"]) <= lost


@pytest.mark.thorough
def test_a_joint_that_slips_far_stands_behind_those_that_are_open_also_of_reopened_results(tmp_path):
    out = blockvis.write(parted(wall(6, 4), 6, 2), tmp_path / "out")
    again = blockvis.write(blockvis.open_results(out), tmp_path / "again")
    table = (out / "joints.csv").read_text(encoding="utf-8")
    assert (again / "joints.csv").read_text(encoding="utf-8") == table
    rows = list(csv.DictReader(table.splitlines()))
    openings, slips = (np.array([float(row[f"largest {what} [m]"]) for row in rows]) for what in ("opening", "slip"))
    assert slips.max() > openings.min()
    assert (np.diff(openings) <= 0.0).all()
    assert openings[0] + slips[0] >= 0.1
