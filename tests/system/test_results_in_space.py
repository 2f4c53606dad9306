"""Results, pictures and the page of blocks in space, by what is in them."""

import csv
import json
import re
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import pyvista as pv
from PIL import Image
from structures import alike, arch_response, box, pixels, same, upright, vault_response
from test_paraview import PVPYTHON, READ, told_by
from test_report import browser, visited

import blockvis
import solver
from blockvis import animate, draw_mechanism, draw_still, generators, write_report
from blockvis.cli import main
from blockvis.pictures import palette
from blockvis.pictures.drawer import Drawer, Look
from blockvis.pictures.frame import framed
from blockvis.pictures.marks import marks_of
from blockvis.pictures.solid_view import View, chosen_view
from blockvis.pictures.surface import sharp_edges, triangles_of
from blockvis.pictures.swing import swing_of
from blockvis.results.datasets import block_grid, contact_grid, joint_grid
from blockvis.results.joints import initial_joints, joint_states
from blockvis.system.vtk_files import write_vtu
from solver import mechanics

SMALL = (640, 360)

CASE = """
[geometry]
layout = "extruded arch"
parameters = { voussoirs = 6, thickness_ratio = 0.2 }
[material]
friction_coefficient = 1.0
[settlement]
direction = [1, 0, 0]
increment = 0.1
limit = 0.8
tolerance = 0.05
[output]
animation = "collapse.mp4"
"""

#: An L of unit thickness: its faces at both ends have a re-entrant corner.
ELL = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 3], [0, 3]], dtype=float)


@pytest.mark.slow
def test_polyhedra_come_back_through_pyvista(tmp_path):
    response = vault_response()
    last, volumes = response.path[-1], response.assembly.shapes.volumes
    file = write_vtu(block_grid(response.assembly, last), tmp_path / "blocks.vtu")
    back = pv.read(file)
    np.testing.assert_array_equal(back.points, mechanics.moved_vertices(response.assembly, last.pose))
    np.testing.assert_allclose(back.compute_cell_sizes()["Volume"], volumes, rtol=1e-12)
    assert [str(name) for name in back.cell_data["name"]] == list(response.assembly.names)
    np.testing.assert_allclose(
        back.point_data["to_reference"], response.assembly.vertices - back.points, rtol=0, atol=1e-15
    )
    np.testing.assert_array_equal(back.cell_data["rotation"], last.pose.rotations)
    # Programs of before VTK 9.4 know no other arrays of faces.
    assert b'Name="faceoffsets"' in file.read_bytes()


@pytest.mark.parametrize(
    "response", [arch_response, pytest.param(vault_response, marks=pytest.mark.slow)], ids=["plane", "space"]
)
def test_results_reach_meshio_as_the_manual_says(response, tmp_path, monkeypatch):
    """Numbers, cells and, beside them, names: of polygons and of polyhedra, which meshio sorts by their corners."""
    pytest.importorskip("meshio")
    manual = (Path(__file__).parents[2] / "docs" / "results.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(import meshio\nimport pyvista.*?)```", manual, re.S)
    assembly, increment = response().assembly, response().path[-1]
    monkeypatch.chdir(tmp_path)
    write_vtu(block_grid(assembly, increment), tmp_path / "out" / "increments" / "blocks_00000.vtu")
    read = {}
    exec(code, read)
    mesh = read["mesh"]
    np.testing.assert_array_equal(
        mesh.points[:, : assembly.dimension], mechanics.moved_vertices(assembly, increment.pose)
    )
    assert sum(len(cells.data) for cells in mesh.cells) == assembly.n_blocks
    numbers = np.concatenate(mesh.cell_data["block_id"])
    assert [read["names"][k] for k in numbers] == [assembly.names[k] for k in numbers]
    moved = np.concatenate(mesh.cell_data["translation"])[np.argsort(numbers), : assembly.dimension]
    np.testing.assert_allclose(moved, increment.pose.positions - assembly.centroids, atol=1e-15)


@pytest.mark.slow
def test_faces_of_joints_are_those_of_the_voussoirs():
    response = vault_response()
    joints = initial_joints(response.assembly)
    # Six voussoirs between two springers: seven joints of 0.2 m × 0.5 m.
    np.testing.assert_allclose(joints.rings.areas(), np.full(7, 0.1), rtol=1e-9)
    between = response.assembly.centroids[joints.block_a] - response.assembly.centroids[joints.block_b]
    assert ((between * joints.normals).sum(axis=1) > 0).all()


@pytest.mark.slow
def test_joints_open_on_one_side_and_carry_the_weight():
    response = vault_response()
    assembly, last = response.assembly, response.path[-1]
    states = joint_states(assembly, initial_joints(assembly), last)
    total = np.zeros((assembly.n_blocks, 3))
    np.add.at(total, states.block_a, states.force)
    np.subtract.at(total, states.block_b, states.force)
    weight = assembly.masses * solver.GRAVITY
    np.testing.assert_allclose(total[assembly.free, 2], weight[assembly.free], rtol=1e-6)
    hinges = mechanics.mechanism_of(assembly, last).hinges
    pairs = np.sort(np.stack([states.block_a, states.block_b], axis=1), axis=1).tolist()
    opened = 0
    for pair in hinges.tolist():
        here = states.gaps[states.rings.ring == pairs.index(pair)]
        # Closed along the line about which it turns, open by the chord of thickness and angle on the other side.
        assert np.sort(np.abs(here))[:2].max() < 1e-6
        a, b = (last.pose.rotations[block, 1] for block in pair)
        opened = max(opened, here.max())
        assert here.max() == pytest.approx(0.4 * np.sin(abs(a - b) / 2.0), abs=1e-4)
    assert opened > 0.05


@pytest.mark.slow
def test_contact_points_have_forces_and_slip_as_vectors():
    response = vault_response()
    assembly, last = response.assembly, response.path[-1]
    grid = pv.UnstructuredGrid(contact_grid(assembly, last))
    total = np.zeros((assembly.n_blocks, 3))
    np.add.at(total, grid.point_data["block_a"], grid.point_data["force"])
    np.subtract.at(total, grid.point_data["block_b"], grid.point_data["force"])
    np.testing.assert_allclose(total[assembly.free, 2], (assembly.masses * solver.GRAVITY)[assembly.free], rtol=1e-6)
    pushed = grid.point_data["normal"] * grid.point_data["normal_force"][:, None]
    np.testing.assert_allclose(grid.point_data["force"], pushed + grid.point_data["shear"], atol=1e-9)
    # Slips are along what is half-way between the faces, as those of the joints.
    joints = pv.UnstructuredGrid(joint_grid(assembly, last))
    apart = np.abs(np.einsum("ki,ji->kj", grid.point_data["slip"], joints.cell_data["normal"])).min(axis=1)
    np.testing.assert_allclose(apart, 0.0, atol=1e-12)


@pytest.mark.slow
def test_slip_is_what_one_block_has_moved_along_another():
    plate, brick = [[0, 0], [4, 0], [4, 1], [0, 1]], [[1, 1], [2, 1], [2, 2], [1, 2]]
    two = solver.Assembly.from_solids([upright(plate, 0.0, 1.0), upright(brick, 0.0, 1.0)], roles=["fixed", "free"])
    start = solver.Pose.initial(two)
    pose = solver.Pose(start.positions + np.array([[0, 0, 0], [0.3, 0.1, 0]]), start.rotations)
    contacts = mechanics.find_contacts(two, mechanics.moved_vertices(two, pose), 0.01)
    nothing = np.zeros((len(contacts), 3))
    increment = vault_response().path[0].with_arrays(
        pose=pose, contacts=contacts, forces=nothing, displacements=nothing, friction=np.ones(len(contacts)),
        velocity=np.zeros((2, 6)), support_forces=np.zeros((2, 6)),
    )  # fmt: skip
    side = np.where(contacts.block_a == 1, 1.0, -1.0)[:, None]
    np.testing.assert_allclose(
        pv.UnstructuredGrid(contact_grid(two, increment))["slip"] * side, np.tile([0.3, 0.1, 0.0], (4, 1)), atol=1e-12
    )
    joint = pv.UnstructuredGrid(joint_grid(two, increment))
    assert joint.cell_data["slip"][0] == pytest.approx(np.hypot(0.3, 0.1))
    assert joint.cell_data["area"][0] == pytest.approx(1.0)


@pytest.mark.slow
def test_results_come_back_bit_for_bit(tmp_path):
    response = vault_response()
    folder = blockvis.write(response, tmp_path / "out")
    back = blockvis.open_results(folder)
    assert same(back.assembly, response.assembly)
    assert len(back.increments) == len(response.increments)
    for one, other in zip(back.increments, response.increments, strict=True):
        assert same(one.state, other.state)
        assert (one.parameter, one.reaction, one.status) == (other.parameter, other.reaction, other.status)
    assert back.collapse.mechanism.shape == (8, 6)
    assert back.settlements[0].direction == pytest.approx((1, 0, 0))
    rows = list(csv.DictReader((folder / "joints.csv").open(encoding="utf-8")))
    assert {row["joint"] for row in rows} >= {"voussoir 3 | voussoir 4"}
    crown = next(row for row in rows if row["joint"] == "voussoir 3 | voussoir 4")
    np.testing.assert_allclose([float(crown[name]) for name in ("x [m]", "y [m]", "area [m²]")], [0, 0, 0.1], atol=1e-6)
    assert float(crown["largest opening [m]"]) > 0.05
    assert (folder / "increments" / "joints_00000.vtu").is_file()


def test_bent_faces_are_cut_into_triangles_that_cover_them():
    ell = solver.Assembly.from_solids([upright(ELL, 0.0, 1.0)]).polyhedra
    triangles, blocks = triangles_of(ell)
    a, b, c = np.moveaxis(ell.vertices[triangles], 1, 0)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2.0
    assert areas.sum() == pytest.approx(ell.surfaces[0])
    # Each is turned outwards: together they hold the volume.
    assert (a * np.cross(b, c)).sum() / 6.0 == pytest.approx(4.0)
    assert (blocks == 0).all()
    assert len(sharp_edges(ell)) == 18


def test_edges_between_faces_in_one_plane_are_not_drawn():
    square = np.array([[0, 0], [1, 0], [2, 0], [2, 1], [0, 1]], dtype=float)
    flat = solver.Assembly.from_solids([upright(square, 0.0, 1.0)]).polyhedra
    assert len(sharp_edges(flat)) in (12, 14)
    ends = flat.vertices[sharp_edges(flat)]
    across = (ends[:, :, 0] == 1.0).all(axis=1) & (ends[:, 0, 1] != ends[:, 1, 1])
    assert not across.any()


@pytest.mark.parametrize(("sides", "edges"), [(24, 48), (20, 60)])
def test_chords_of_a_curved_face_are_not_drawn(sides, edges):
    around = 2.0 * np.pi * np.arange(sides) / sides
    drum = solver.Assembly.from_solids([upright(np.stack([np.cos(around), np.sin(around)], axis=1), 0.0, 1.0)])
    assert len(sharp_edges(drum.polyhedra)) == edges


@pytest.mark.slow
def test_the_view_shows_the_motion_across_it():
    response = vault_response()
    n = response.assembly.n_blocks
    along_x, along_y = np.tile([1.0, 0.0, 0.0], (n, 1)), np.tile([0.0, 1.0, 0.0], (n, 1))
    made = response.path[:0]
    still = solver.Response(
        response.assembly, (), response.interfaces, response.loads, made, solver.Status.LIMIT_REACHED
    )
    for motion in (along_x, along_y):
        seen = np.linalg.norm(motion[0] @ chosen_view(still, motion).axes[:2].T)
        assert seen > 0.85
    axes = View(-60.0, 24.0).axes
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)


@pytest.mark.slow
def test_what_is_where():
    """Hinge, crack, moving support and paper stand at their places, in their colours."""
    response = vault_response()
    assembly, last = response.assembly, response.path[-1]
    drawer = Drawer(response, Look(), (1280, 720), (last,))
    picture = np.asarray(drawer.picture(last)).astype(int)
    left, top = drawer.sheet.inside[:2]

    def colour_at(point):
        x, y = drawer.scene.at_pixel(np.array([point]))[0].round().astype(int)
        return picture[top + y, left + x]

    found = marks_of(assembly, drawer.joints, last, last.pose)
    crown = found.hinges[found.hinges[:, 0, 2].argmax()]
    for share in (0.3, 0.5, 0.7):
        assert alike(colour_at(crown[0] + share * (crown[1] - crown[0])), palette.HINGE, 30)
    # The crack at the crown is widest below: its rims have one colour, and between them is air.
    front = found.cracks.mean(axis=1)
    under = np.flatnonzero((np.abs(front[:, 0] - crown[0, 0]) < 0.1) & (front[:, 1] < -0.2))
    wide = under[found.openings[under].max(axis=1).argmax()]
    crack = found.cracks[wide]
    inside = crack[[0, 3]] if found.openings[wide, 0] > found.openings[wide, 1] else crack[[1, 2]]
    assert alike(colour_at(0.9 * inside.mean(axis=0) + 0.1 * crack.mean(axis=0)), palette.PAPER)
    for rim in (crack[[0, 1]], crack[[3, 2]]):
        x, y = drawer.scene.at_pixel(rim.mean(axis=0)[None])[0].round().astype(int)
        assert alike(picture[top + y - 1 : top + y + 2, left + x - 1 : left + x + 2], palette.OPEN, 40).any()
    support = np.flatnonzero(assembly.moving)[0]
    corner = mechanics.moved_vertices(assembly, last.pose)[assembly.block_of_vertex == support]
    face = corner[corner[:, 1] < 0].mean(axis=0)
    shade = colour_at(face) / np.array(palette.MOVING)
    assert np.ptp(shade) < 0.05
    assert 0.5 < shade.mean() <= 1.05
    assert alike(colour_at([0.0, 0.0, 0.2]), palette.PAPER)


def drawn_vault(tmp_path, **seen_from):
    """Pixels of the picture of the vault's last equilibrium."""
    response = vault_response()
    path = draw_still(response, -1, tmp_path / "still.png", size=SMALL, **seen_from)
    return pixels(path)[57:320]


def ink_in(picture):
    """(rows, columns): where the paper is covered, of a picture without its words."""
    return np.nonzero((picture < 235).any(axis=2))


@pytest.mark.slow
def test_a_vault_is_seen_from_both_sides_and_fills_the_picture(tmp_path):
    """By default the intrados stands beside the extrados; each view alone has the whole width."""
    both = drawn_vault(tmp_path)
    middle = both[:, 305:335]
    assert (middle == 255).all(axis=2).mean() > 0.9
    for half in (both[:, :320], both[:, 320:]):
        rows, columns = ink_in(half)
        assert np.ptp(columns) > 0.85 * 320 or np.ptp(rows) > 0.85 * len(half)
    # Both are of the same stones, from other sides.
    assert (np.abs(both[:, :320] - both[:, 320:]).max(axis=2) > 60).mean() > 0.1


@pytest.mark.slow
def test_a_view_alone_has_the_whole_picture(tmp_path):
    above, below = (drawn_vault(tmp_path, view=view) for view in ("above", "below"))
    for alone in (above, below):
        rows, columns = ink_in(alone)
        assert np.ptp(columns) > 0.8 * 640 or np.ptp(rows) > 0.8 * len(alone)
    assert (np.abs(above - below).max(axis=2) > 60).mean() > 0.1


@pytest.mark.slow
def test_a_wall_has_no_intrados_to_be_seen(tmp_path):
    wall = solver.Assembly.from_solids(
        [box((0, 0, k), (2, 0.5, k + 1)) for k in range(3)], roles=["moving", "free", "free"]
    )
    down = solver.Settlement(direction=(0, 0, -1), increment=0.1, limit=0.1)
    response = solver.settle(wall, down, friction_coefficient=0.6)
    default, above = (
        pixels(draw_still(response, -1, tmp_path / "still.png", size=SMALL, **of)) for of in ({}, {"view": "above"})
    )
    np.testing.assert_array_equal(default, above)


@pytest.mark.slow
def test_a_section_leaves_out_what_lies_before_it_and_closes_the_stones(tmp_path):
    """From the front, cut along the span: half the depth is gone, and no hollow stone shows its inside."""
    front = {"view": "front"}
    whole, cut = drawn_vault(tmp_path, **front), drawn_vault(tmp_path, **front, section="y")
    aside = drawn_vault(tmp_path, view={"azimuth": 0, "elevation": 90})
    half = drawn_vault(tmp_path, view={"azimuth": 0, "elevation": 90}, section={"normal": (0, 1, 0)})
    assert (whole < 235).any(axis=2).mean() == pytest.approx((cut < 235).any(axis=2).mean(), rel=0.1)
    proportions = [np.ptp(columns) / np.ptp(rows) for rows, columns in map(ink_in, (aside, half))]
    assert proportions[1] == pytest.approx(proportions[0] / 2.0, rel=0.25)


@pytest.mark.slow
def test_a_section_in_a_joint_closes_the_stones_behind_it(tmp_path):
    """In the joint between two rows as little beside it, whatever rounding says of the corners that lie there."""
    row = [box((k, y, 0), (k + 1, y + 1, 1)) for y in (0, 1) for k in range(3)]
    assembly = solver.Assembly.from_solids([*row, box((0, 0, -1), (3, 2.5, 0))], roles=["free"] * 6 + ["moving"])
    east = solver.Settlement(direction=(0.6, 0.0, -0.8), increment=0.1, limit=0.1)
    response = solver.settle(assembly, east, friction_coefficient=0.8)
    eye = {"azimuth": -70, "elevation": 20}
    cuts = [{"normal": (0, 1, 0), "point": (0, y, 0)} for y in (1.0, 1.0 + 1e-6)]
    drawn = [
        draw_still(response, -1, tmp_path / f"{k}.png", size=SMALL, view=eye, section=s) for k, s in enumerate(cuts)
    ]
    joint, beside = map(pixels, drawn)
    assert (np.abs(joint - beside).max(axis=2) > 40).mean() < 1e-3


def piers_on_slabs(reach, thick=0.5):
    """Two piers on slabs that reach ``reach`` [m] to both sides, under a lintel; the right slab sinks."""
    slabs = [box((x, -reach, -thick), (x + 3, reach, 0)) for x in (0, 3)]
    piers = [box((x, -0.5, 0), (x + 1, 0.5, 2)) for x in (1, 4)]
    lintel = box((1.2, -0.5, 2), (4.8, 0.5, 2.5))
    return solver.Assembly.from_solids([*slabs, *piers, lintel], roles=["fixed", "moving", *["free"] * 3])


def settled_piers(reach):
    down = solver.Settlement(direction=(0, 0, -1), increment=0.1, limit=0.1)
    return solver.settle(piers_on_slabs(reach), down, friction_coefficient=0.6)


@pytest.mark.slow
def test_cracks_are_drawn_on_the_half_behind_a_section_and_the_legend_names_what_is_left(tmp_path):
    """From the east the slab that sinks, east of the section, is left out; from the west all is there but its end."""
    response, out = settled_piers(1.0), tmp_path / "out"
    blockvis.write(response, out)
    for azimuth, sinks in ((20, False), (160, True)):
        assert main(["render", str(out), "--cracks", "-1", "--section", "x = 2.5", "--view", f"{azimuth},20"]) == 0
        drawn = pixels(out / "cracks.png").astype(int)
        # Pale as it is, the slab is greener than red.
        assert ((drawn[..., 1] - drawn[..., 0] > 5).sum() > 1000) == sinks
        eye = {"azimuth": azimuth, "elevation": 20}
        still = pixels(draw_still(response, -1, tmp_path / "still.png", view=eye, section="x = 2.5", size=SMALL))
        assert alike(still, palette.MOVING).any() == sinks


def test_what_a_section_leaves_out_takes_no_room():
    """Above a plane, east of one, and below one that leaves no free block."""
    assembly, plan = piers_on_slabs(1.0), np.array([[1.0, 0, 0], [0, 0, 1.0]])
    for point, normal, low, high in (
        ((0, 0, 1.0), (0, 0, 1.0), [1.0, 1.0], [5.0, 2.5]),
        ((2.5, 0, 0), (1.0, 0, 0), [2.5, -0.5], [6.0, 2.5]),
        ((0, 0, -0.2), (0, 0, -1.0), [0.0, -0.5], [6.0, -0.2]),
    ):
        frame = framed(assembly, [solver.Pose.initial(assembly)], 0.0, 9.0, plan, 9.0, np.array([point, normal]))
        assert [*frame.low, *frame.high] == pytest.approx([*low, *high], abs=1e-12)


@pytest.mark.slow
def test_a_crack_is_labelled_in_the_view_that_shows_most_of_it(tmp_path, monkeypatch):
    """Of the far side of a dome an eye above it sees the rim of the crown, where cracks are narrow."""
    dome = blockvis.generators.dome(lunes=8, courses=4, thickness_ratio=0.12)
    spread = solver.Settlement(radial_from=(0.0, 0.0), increment=0.02, limit=0.02)
    blockvis.write(solver.settle(dome, spread, friction_coefficient=0.6), tmp_path / "out")
    written = []
    monkeypatch.setattr("blockvis.pictures.cracks_in_space.write_labels", lambda *given: written.append(given[1:3]))
    assert main(["render", str(tmp_path / "out"), "--cracks", "-1"]) == 0
    ((places, words),) = written
    wide = [word.endswith("15 mm") for word in words]
    assert sum(wide) > 3
    assert places[wide, 1].min() > 200.0, "at the springing, not at the crown"


@pytest.mark.slow
def test_a_section_from_below_closes_supports_and_shows_which_moves_and_where_to(tmp_path):
    """Supports that hide the structure are drawn by their edges: those of the cut, too, and in their colours."""
    # The middle of the support lies in the half that is left out.
    response, seen = settled_piers(1.0), {"section": "y = 0.2", "size": (960, 540)}
    below = pixels(draw_still(response, -1, tmp_path / "below.png", view="below", **seen))[60:480]
    assert alike(below, palette.MOVING).sum() > 100
    assert alike(below, palette.SETTLEMENT).sum() > 30, "the arrow of the support"
    upwards = pixels(draw_still(response, -1, tmp_path / "up.png", view="bottom", **seen))[60:480]
    columns = ink_in(upwards)[1]
    across = (upwards.max(axis=2) < 150).any(axis=0)[columns.min() : columns.max()]
    assert across.mean() > 0.95, "the cut is closed from end to end"


@pytest.mark.slow
def test_supports_that_go_beyond_the_picture_fade_there(tmp_path):
    picture = pixels(draw_still(settled_piers(20.0), -1, tmp_path / "still.png", size=(960, 540), view="above"))
    assert alike(picture[:, [0, -1]], palette.PAPER).all()
    assert not alike(picture[:, 30], palette.PAPER).all(), "they reach there"
    # However wide they are: plane faces have one colour.
    face = picture[100:440, 40:920]
    grain = np.abs(np.diff(face, axis=0)).max(axis=2)
    assert ((grain > 1) & (grain < 12)).mean() < 0.1


@pytest.mark.slow
def test_an_arrow_that_is_seen_from_its_end_is_a_dot_or_a_cross(tmp_path):
    """Of a slab that sinks: from above or below there was none."""
    response, marks = settled_piers(1.0), []
    for view in ("bottom", "top"):
        picture = pixels(draw_still(response, -1, tmp_path / f"{view}.png", size=(960, 540), view=view))
        rows, columns = np.nonzero(alike(picture[60:480], palette.SETTLEMENT))
        assert 5 < np.ptp(rows) == pytest.approx(np.ptp(columns), abs=2)
        marks.append((rows, columns))
    # A point along the bars of the cross, of which the dot and its ring leave it free.
    at = [
        np.hypot(rows - rows.min() - 0.32 * np.ptp(rows), columns - columns.min() - 0.32 * np.ptp(columns)).min()
        for rows, columns in marks
    ]
    assert at[1] < 1.0 < at[0]


@pytest.mark.slow
def test_what_a_section_leaves_out_throws_no_shadow(tmp_path):
    """Seen along the span: under a light from above shadows are as wide as the halves that are left."""
    down = solver.Settlement(direction=(0, 0, -1), increment=0.1, limit=2.0)
    response = solver.settle(piers_on_slabs(1.0, thick=0.2), down, friction_coefficient=0.2)
    seen = {"view": {"azimuth": 0, "elevation": 20}, "section": {"normal": (0, 1, 0)}}
    frames = animate(response, tmp_path / "frames", size=(960, 540), fps=2, seconds=1.0, **seen)
    last = pixels(max(frames.iterdir()))[60:480]
    blocks = np.flatnonzero((last.max(axis=2) < 120).sum(axis=0) > 1)
    shadows = np.flatnonzero(alike(last, palette.SHADOW).sum(axis=0) > 1)
    assert len(shadows) > 20
    assert blocks.min() - 4 <= shadows.min() <= shadows.max() <= blocks.max() + 4


@pytest.mark.slow
def test_supports_reach_down_to_the_ground_of_a_fall_which_has_no_end(tmp_path):
    """A lintel slides off when the right slab has sunk by more than the left one is thick."""
    down = solver.Settlement(direction=(0, 0, -1), increment=0.1, limit=2.0)
    response = solver.settle(piers_on_slabs(1.0, thick=0.2), down, friction_coefficient=0.2)
    assert response.collapse.displacement > 0.4
    eye = {"azimuth": -90, "elevation": 20}
    frames = animate(response, tmp_path / "frames", size=(960, 540), fps=2, seconds=1.0, view=eye)
    first, last = (pixels(frame)[60:480] for frame in (min(frames.iterdir()), max(frames.iterdir())))
    dark = (first < 215).any(axis=2)
    columns = np.flatnonzero(dark.any(axis=0))
    left, right = columns.min() + 10, columns.max() - 10
    foot = [np.flatnonzero(dark[:, column]).max() for column in (left, right)]
    assert foot[0] == pytest.approx(foot[1], abs=2), "both stand on the ground"
    for picture in (first, last):
        assert np.abs(np.diff(picture[:, :40], axis=0)).max() < 12, "the ground has no edge"


@pytest.mark.thorough
def test_corners_of_a_still_lie_in_shade(tmp_path):
    """Where two faces meet at a hollow corner both are darker than away from it."""
    step = [box((0, 0, 0), (4, 4, 1)), box((0, 2, 1), (4, 4, 3))]
    structure = solver.Structure(solver.Assembly.from_solids(step, roles=["fixed", "free"]), friction_coefficient=0.6)
    response = structure.limit_load(acceleration=(0, 1, 0)).response
    eye = {"azimuth": -90, "elevation": 60}
    picture = pixels(
        draw_still(response, -1, tmp_path / "still.png", size=SMALL, view=eye, forces="none", joints=False)
    )
    column = picture[:, 320].sum(axis=1)
    rows = np.flatnonzero(column < 700)
    lower = column[rows.min() : rows.max()]
    tread = lower[np.abs(lower - np.median(lower)) < 200]
    assert tread.max() - tread.min() > 40


@pytest.mark.slow
def test_views_that_cannot_be_are_refused_with_the_remedy(tmp_path):
    response, path = vault_response(), tmp_path / "still.png"
    for of, words in (
        ({"view": "belwo"}, r"view is 'belwo' \(did you mean 'below'\?\); choose from above, below"),
        ({"view": {"azimut": 3}}, r"view has 'azimut' \(did you mean 'azimuth'\?\)"),
        ({"view": {"elevation": 91}}, r"view has elevation = 91; give degrees from -90 to 90"),
        ({"section": "w = 1"}, r"section is 'w = 1'; give \"x\", \"y\" or \"z\""),
        ({"section": {"normal": (0, 0, 0)}}, r"section has a normal of length 0"),
        ({"section": "z = 50"}, r"section: the plane through \(0, 0, 50\) m misses the blocks"),
    ):
        with pytest.raises(ValueError, match=words):
            draw_still(response, -1, path, **of)
    with pytest.raises(ValueError, match="view and section are of blocks in space"):
        draw_still(arch_response(), -1, path, view="below")
    assert not path.exists()


@pytest.mark.slow
def test_nothing_leaves_the_picture_and_all_frames_look_the_same_way(tmp_path):
    response = vault_response()
    drawer = Drawer(response, Look(colour_by="mechanism"), SMALL, response.increments)
    low, high = np.zeros(2), np.array(drawer.scene.size)
    for increment in response.increments:
        corners = mechanics.moved_vertices(response.assembly, increment.pose)
        free = response.assembly.free[response.assembly.block_of_vertex]
        pixels = drawer.scene.at_pixel(corners[free])
        assert (pixels > low).all()
        assert (pixels < high).all()
    first, second = (np.asarray(drawer.picture(response.path[k])).astype(int) for k in (0, -1))
    fixed = response.assembly.centroids[response.assembly.roles == "fixed"]
    x, y = drawer.scene.at_pixel(fixed)[0].astype(int) + drawer.sheet.inside[:2]
    window = np.s_[y - 3 : y + 4, x - 3 : x + 4]
    np.testing.assert_array_equal(first[window], second[window])
    assert (first != second).any(axis=2).mean() > 0.02


@pytest.mark.slow
def test_mechanism_is_tinted_and_shows_where_it_goes(tmp_path):
    response = vault_response()
    picture = np.asarray(Image.open(draw_mechanism(response, tmp_path / "mechanism.png", size=SMALL))).astype(int)
    parts = int(swing_of(response).parts.max()) + 1
    assert parts >= 3
    assert (np.abs(picture - palette.SETTLEMENT).max(axis=2) <= 8).sum() > 60
    tints = palette.part_colours(np.repeat(palette.STONES[:1], parts, axis=0), np.arange(parts))
    blocks = picture[60:300]
    for tint in tints:
        # A tint in any of the lights that its faces are seen in.
        hue = blocks / np.maximum(blocks.sum(axis=2, keepdims=True), 1)
        near = np.abs(hue - tint / tint.sum()).max(axis=2) < 0.012
        assert near.sum() > 2000


def torn(assembly, swing):
    """How far the sides of the hinges of a mechanism are drawn apart."""
    before, contacts = swing.increment.pose, swing.increment.contacts
    hinges = contacts[mechanics.mechanism_of(assembly, swing.increment).hinge_points]
    a, b = (
        mechanics.carried(hinges.points, block, before, swing.displaced) for block in (hinges.block_a, hinges.block_b)
    )
    return np.linalg.norm(a - b, axis=1).max()


@pytest.mark.thorough
def test_a_mechanism_swings_as_far_on_the_page_as_if_its_hinges_might_part(tmp_path, monkeypatch):
    """Where the analysis of the fall ends at once: 1.2 times as far as goes with its arrows."""
    motions, response = [], vault_response()
    monkeypatch.setattr(
        "blockvis.pictures.swing.swung_increment", lambda increment, motion: (motions.append(motion), increment)[1]
    )
    write_report(replace(response, increments=response.path), tmp_path / "report.html")
    swing = swing_of(response)
    np.testing.assert_allclose(motions[-1], 1.2 / swing.share * swing.motion, atol=1e-9)


@pytest.mark.thorough
def test_the_mechanism_of_what_never_stood_is_drawn_with_closed_hinges():
    """No forces say there where they are."""
    arch = generators.extruded_arch(voussoirs=8, thickness_ratio=0.05)
    response = solver.settle(arch, solver.Settlement((1, 0, 0)), friction_coefficient=2.0)
    assert not response.path
    swing = swing_of(response)
    size = framed(arch, [swing.increment.pose]).size.max()
    assert 1e-5 * size < torn(arch, swing) < 2.5e-3 * size
    assert 0.3 < swing.share < 0.8


@pytest.mark.thorough
def test_a_mechanism_is_drawn_with_closed_hinges(tmp_path, monkeypatch):
    """On arcs of their own parts tear their hinges, by 34 mm here if a corner goes 5 % of the picture; arrows do."""
    response = vault_response()
    swing = swing_of(response)
    size = framed(response.assembly, [swing.increment.pose]).size.max()
    assert 1e-5 * size < torn(response.assembly, swing) < 2.5e-3 * size
    assert 0.3 < swing.share < 0.8
    drawn = []
    monkeypatch.setattr(
        "blockvis.pictures.solid_scene.SolidScene.show_motion",
        lambda scene, swing, tails, tips: drawn.append(tips - tails),
    )
    draw_mechanism(response, tmp_path / "mechanism.png", size=SMALL)
    # The longest is that of a part, whose middle goes less far than its fastest corner.
    assert 0.02 * size < np.linalg.norm(drawn[0], axis=1).max() <= 0.05 * size


@pytest.mark.slow
def test_the_film_has_the_path_and_the_fall(tmp_path):
    told = []
    film = animate(
        vault_response(),
        tmp_path / "collapse.gif",
        size=SMALL,
        fps=10,
        seconds=1.0,
        progress=lambda *of: told.append(of),
    )
    assert Image.open(film).n_frames >= 4
    assert told[-1][0] == told[-1][1] == len(told)


@pytest.mark.thorough
def test_page_has_what_its_script_draws(tmp_path):
    response = vault_response()
    text = write_report(response, tmp_path / "report.html").read_text(encoding="utf-8")
    model = json.loads(text.split('<script id="model" type="application/json">')[1].split("</script>")[0])
    assert model["space"]
    assert model["packed"]["triangles"]["rows"] == 8 * 12
    assert model["packed"]["edges"]["rows"] == 8 * 12
    assert model["packed"]["joint_blocks"]["rows"] == 7
    assert len(model["arrows"][0]) == 1
    assert model["arrows"][0][0][4:] == [1.0, 0.0, 0.0]
    assert "http" not in text.replace("http-equiv", "").replace("http://www.w3.org/2000/svg", "")


@browser
def test_page_unpacks_every_frame_as_it_was(tmp_path):
    response = vault_response()
    page = write_report(response, tmp_path / "report.html")
    k = len(response.path) - 1
    # WebGL in software writes to the console that it is slow.
    text = visited(page, tmp_path, "--dump-dom", anchor=f"#frame={k}", quiet=False)
    attributes = dict(re.findall(r'data-([a-z]+)="([^"]*)"', re.search(r"<body[^>]*>", text).group()))
    assert attributes["ready"] == "1"
    poses = [solver.Pose.initial(response.assembly), *(i.pose for i in response.increments)]
    frame = framed(response.assembly, poses, margin=0.0, supports=0.25)
    corners = mechanics.moved_vertices(response.assembly, response.increments[k].pose) - np.round(frame.low, 3)
    expected = float(corners.ravel() @ (np.arange(corners.size) % 97 + 1))
    assert float(attributes["corners"]) == pytest.approx(expected, abs=0.02)


@browser
@pytest.mark.slow
def test_page_draws_blocks_cracks_and_supports(tmp_path):
    page, shot = write_report(vault_response(), tmp_path / "report.html"), tmp_path / "shot.png"
    options = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", f"--screenshot={shot}")
    visited(page, tmp_path, *options, anchor="#frame=4", quiet=False)
    stage = pixels(shot)[110:700, 20:780]
    hue = stage / np.maximum(stage.sum(axis=2, keepdims=True), 1)
    for colour, least in ((palette.MOVING, 4000), (palette.STONES[0], 20_000), (palette.OPEN, 150)):
        assert (np.abs(hue - np.array(colour) / sum(colour)).max(axis=2) < 0.02).sum() > least
    assert (stage.max(axis=2) < 40).sum() > 200


@pytest.mark.paraview
@pytest.mark.skipif(PVPYTHON is None, reason="pvpython is not installed (Debian: python3-paraview)")
def test_paraview_reads_polyhedra_faces_and_contacts(tmp_path):
    response = vault_response()
    folder = blockvis.write(response, tmp_path / "out")
    told = told_by(READ, folder, tmp_path)
    for part, dataset in (("blocks", block_grid), ("contacts", contact_grid), ("joints", joint_grid)):
        for (_, cells, names), increment in zip(told[part], response.path, strict=True):
            ours = pv.UnstructuredGrid(dataset(response.assembly, increment))
            assert cells == ours.n_cells
            assert set(names["Point"]) == set(ours.point_data.keys())
            assert set(names["Cell"]) == set(ours.cell_data.keys())


@pytest.mark.slow
def test_one_command_from_case_to_pictures_and_again(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arch.toml").write_text(CASE, encoding="utf-8")
    assert main(["run", "arch.toml", "-o", "out", "--no-check-steps"]) == 0
    out = tmp_path / "out"
    for name in ("mechanism.png", "curve.png", "collapse.mp4", "report.html", "paraview_colours.py", "summary.json"):
        assert (out / name).stat().st_size > 1000
    summary = json.loads((out / "summary.json").read_text(encoding="utf-8"))
    assert summary["status"] == "collapsed"
    widest = summary["cracks"][0]
    assert widest["width_mm"] > 1.0
    assert len(widest["at"]) == len(widest["to"]) == 3
    assert widest["widest_joint"] in (out / "report.html").read_text(encoding="utf-8")
    capsys.readouterr()
    again = ["render", "out", "--animation", "none", "--size", "960x540"]
    assert main([*again, "--colour-by", "displacement", "--forces", "thrust"]) == 0
    assert (out / "last.png").stat().st_size > 1000
    # A picture from another side; the case says from which where the command line does not.
    before = pixels(out / "mechanism.png")
    assert main([*again, "--view", "30,-20", "--section", "y = 0.1"]) == 0
    assert (pixels(out / "mechanism.png") != before).any(axis=2).mean() > 0.05
    # A run that was stopped goes on to the same end.
    (out / "summary.json").unlink()
    before = (out / "response.csv").read_text(encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert main(["run", "--resume", "out", "--no-pictures", "--no-check-steps"]) == 0
    assert [row.rsplit(",", 1)[0] for row in (out / "response.csv").read_text(encoding="utf-8").splitlines()] == [
        row.rsplit(",", 1)[0] for row in before.splitlines()
    ]


@pytest.mark.slow
def test_what_a_layout_in_space_holds_is_drawn(tmp_path, capsys):
    file = tmp_path / "arch.obj"
    blockvis.save_layout(vault_response().assembly, file)
    assert main(["info", str(file), "--picture", str(tmp_path / "arch.png"), "--dimension", "3"]) == 0
    picture = pixels(tmp_path / "arch.png")
    hue = picture / np.maximum(picture.sum(axis=2, keepdims=True), 1)
    for colour in (palette.MOVING, palette.SUPPORT):
        assert (np.abs(hue - np.array(colour) / sum(colour)).max(axis=2) < 0.012).sum() > 3000
    # Names are written in ink.
    assert (picture[120:900].max(axis=2) < 60).sum() > 300


@pytest.mark.thorough
def test_notebooks_show_blocks_in_space():
    written = vault_response().assembly._repr_html_()
    assert 'src="data:image/png;base64,' in written
    assert "2.4 m × 0.5 m × 1.375 m" in written or " m × 0.5 m × " in written
