"""Case files in space: two numbers or three, supports, generators by name, blockvis new."""

import json

import numpy as np
import pytest
from structures import assembly_of, begun, box, case_from, drawn, layout_of, rectangle, run_command

import blockvis
import solver
from blockvis import generators, read, save_layout, write_layout
from blockvis.cli import main
from solver import mechanics

DOME = '[geometry]\nlayout = "dome"\nparameters = {lunes = 4, courses = 1}\n'
ARCH = '[geometry]\nlayout = "arch"\nparameters = {voussoirs = 5}\n'
DOWN = "[settlement]\ndirection = [0, 0, -1]\n"


def case(text, tmp_path):
    return case_from(text, tmp_path)


def test_a_layout_in_space_by_its_name(tmp_path):
    found = case(DOME + "[settlement]\nradial_from = [0, 0]\n", tmp_path)
    assert found.settlements == (solver.Settlement(radial_from=(0.0, 0.0)),)
    assembly = assembly_of(found)
    assert assembly.dimension == 3
    assert assembly.n_blocks == 9
    corner = assembly_of(case('[geometry]\nlayout = "L-corner"\n' + DOWN, tmp_path))
    assert corner.n_blocks == generators.l_corner().n_blocks


def test_the_density_of_the_case_replaces_that_of_a_layout(tmp_path):
    assembly = assembly_of(case(DOME + DOWN + "[material]\ndensity = 2400\n", tmp_path))
    assert (assembly.density == 2400.0).all()


@pytest.mark.filterwarnings("ignore:.*was extruded")
def test_a_layout_of_the_plane_in_space(tmp_path):
    deep = assembly_of(case(ARCH.replace("\n", "\ndimension = 3\nthickness = 0.4\n", 1) + DOWN, tmp_path))
    assert deep.shapes.volumes == pytest.approx(0.4 * generators.arch(voussoirs=5).areas)


@pytest.mark.parametrize(
    ("own", "says"),
    [
        ({}, "0.5 m"),
        ({"thickness": [0.3, 0.3]}, "2 of 2 blocks have of their own, 0.3 m; 0.5 m is that of blocks without"),
        ({"thickness": [0.3, None]}, "1 of 2 blocks have of their own, 0.3 m; 0.5 m is that of blocks without"),
    ],
)
def test_a_drawing_of_the_plane_in_space_says_which_thickness_it_has(own, says, tmp_path):
    blocks = [rectangle(0, y, 1, y + 0.5) for y in (0.0, 0.5)]
    drawn(tmp_path / "wall.json", blocks, role=["moving", "free"], **own)
    settles = "[settlement]\ndirection = [0, 0, -1]\nincrement = 0.001\nlimit = 0.001\n"
    given = case(f'[geometry]\nfile = "wall.json"\ndimension = 3\nthickness = 0.5\n{settles}', tmp_path)
    with pytest.warns(UserWarning, match=f"was extruded along y by .*{says}$"):
        assembly_of(given)


def test_rotations_and_loads_have_three_numbers(tmp_path):
    text = DOME + (
        "[settlement]\nrotation_centre = [1, 0, 0]\nrotation_axis = [0, 2, 0]\nrotation = -1\n"
        '[[loads]]\nblocks = "cap"\nforce = [0, 0, -500]\npoint = [0.1, 0, 1]\nmoment = [1, 2, 3]\n'
    )
    found = case(text, tmp_path)
    assert found.settlements[0].rotation_axis == (0.0, 1.0, 0.0)
    response = begun(found)
    assembly = response.assembly
    load = response.loads.dead[assembly.index("cap")]
    weight = assembly.masses[assembly.index("cap")] * solver.GRAVITY
    assert load == pytest.approx([0, 0, -500 - weight, 1, 2 + 50, 3])


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (DOME + "[settlement]\ndirection = [0, -1]", r"\[settlement\] direction has 2 numbers, but the blocks are in "
         r"space; give three numbers \[x, y, z\]"),
        (ARCH + DOWN, r"\[settlement\] direction has 3 numbers, but the blocks are in the plane; give two numbers "
         r"\[x, y\], or take the blocks into space by dimension = 3"),
        (ARCH + "[settlement]\nradial_from = [0, 0]", r"radial_from belongs to blocks in space: leave it out, or take"),
        (DOME + "[settlement]\ndirection = [0]", r"is \[0\]; give two numbers \[x, y\], or in space three \[x, y, z\]"),
        (DOME + "[settlement]\nrotation_axis = [0, 1]", r"rotation_axis is \[0, 1\]; give three numbers \[x, y, z\]"),
        (DOME + "[settlement]\nrotation_centre = [0, 1, 0]", r"in space a rotation needs .* rotation_axis"),
        (DOME + DOWN + "[[loads]]\nforce = [1, 0]", r"\[loads\] force has 2 numbers"),
        (DOME + DOWN + "[[loads]]\nmoment = 3.0", r"\[loads\] moment: the blocks are in space; give three numbers"),
        (ARCH + DOWN.replace("0, 0", "0") + "[[loads]]\nmoment = [1, 2, 3]",
         r"are in the plane; give one number, or take the blocks into space by dimension = 3 under \[geometry\]"),
        (DOME + DOWN + "[[loads]]\npressure = 3.0", r"pressure belongs to blocks in the plane; in space give forces"),
        (DOME.replace("\n", "\ndimension = 2\n", 1) + DOWN, r"dimension is 2, but the layout 'dome' is in space"),
        (DOME.replace("\n", "\ndimension = 4\n", 1) + DOWN, r'dimension is 4; give 2, 3 or "auto"'),
        (DOME.replace("\n", "\nthickness = 0.7\n", 1) + DOWN, r"thickness belongs to outlines in the plane"),
        (DOME.replace("\n", '\nclosing = "faces"\n', 1) + DOWN, r"closing belongs to outlines in the plane"),
        (DOME + DOWN + '[[imperfections]]\nkind = "vertices"\ndistribution = "normal"\nmean = 0\ndeviation = 0.01\n',
         r"kind 'vertices' belongs to blocks in the plane"),
        (DOME + DOWN + '[[supports]]\noutline = [[0, 0], [1, 0], [1, 1]]\n',
         r"case\.toml: \[\[supports\]\] .* levels = \[bottom, top\] in m"),
        (DOME + DOWN + '[[supports]]\nname = "g"\noutline = [[0, 0], [1, 0], [1, 1]]\nlevels = [0, -0.3]\n',
         r"case\.toml: \[\[supports\]\] support 'g': levels is \[0, -0\.3\]; give the lower first, in m"),
        (ARCH + DOWN.replace("0, 0", "0") + '[[supports]]\noutline = [[0, 0], [1, 0], [1, 1]]\nlevels = [0, 1]\n',
         r"case\.toml: \[\[supports\]\] .* 'levels', which no support in the plane has; leave it out, "
         r"or give \[geometry\] dimension = 3 if the blocks are in space"),
        (DOME + "[settlement]\nprofile = { points = [[0, 0], [4, 1]] }", r"\[settlement\] profile belongs to blocks in "
         r"the plane; in space give a direction, or the motion of each of its supports, \[dx, dy, dz, rx, ry, rz\]"),
        (DOME + "[settlement]\nprofile = { supports = { g = [0, -1] } }", r"profile belongs to blocks in the plane"),
        (ARCH + '[settlement]\nprofile = { supports = { "right springer" = [0, 0, -1, 0, 0, 0] } }',
         r"profile belongs to blocks in space; in the plane the motion of a support is \[dx, dy, rotation\]"),
        (DOME + DOWN + '[roles]\n"sprinter 1" = "fixed"\n', r"roles: 'sprinter 1' matches no block"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named(text, reason, tmp_path):
    with pytest.raises(ValueError, match=reason):
        assembly_of(case(text, tmp_path))


@pytest.mark.thorough
def test_a_support_in_space_moves_as_its_six_numbers_say(tmp_path):
    text = (
        DOME + '[settlement]\nincrement = 1e-3\nlimit = 1e-3\nprofile.supports."springer 1" = [0, 2, -2, 0, 0, 0.5]\n'
    )
    run = blockvis.run_case(case(text, tmp_path), tmp_path / "out", outputs=())
    moved = run.response.path[-1].pose.displacements(run.response.assembly)[run.response.assembly.index("springer 1")]
    root = 0.5**0.5
    np.testing.assert_allclose(moved, 1e-3 * np.array([0, root, -root, 0, 0, root / 4]), atol=1e-12)


@pytest.mark.parametrize(("key", "end"), [("from", "[0, 5]"), ("to", "{ fixed = [2.0, 0.3] }")])
def test_ends_of_ties_have_three_numbers(key, end, tmp_path):
    ends = {"from": "[0, 0, 5]", "to": "{ fixed = [2.0, 0.0, 0.3] }"} | {key: end}
    tie = '[[ties]]\nname = "iron"\nstiffness = 1e7\n' + "".join(f"{which} = {at}\n" for which, at in ends.items())
    with pytest.raises(ValueError, match=rf"case\.toml: \[ties 'iron'\] {key} has 2 numbers, .* give three numbers"):
        blockvis.run_case(case(DOME + DOWN + tie, tmp_path), tmp_path / "out", outputs=())


def test_supports_of_a_drawing_without_them(tmp_path):
    bricks = generators.l_corner(bricks=2, across=2, courses=1)
    write_layout(layout_of(bricks).chosen(np.flatnonzero(bricks.free)), tmp_path / "a.obj")
    text = f"""
[geometry]
file = "a.obj"
dimension = 3
[[supports]]
name = "ground"
outline = [[-1, -1], [1, -1], [1, 1], [-1, 1]]
levels = [-0.2, 0]
role = "moving"
{DOWN}"""
    assembly = assembly_of(case(text, tmp_path))
    assert assembly.names[-1] == "ground"
    assert assembly.shapes.volumes[-1] == pytest.approx(0.8)
    assert assembly.moving.tolist() == [False] * 4 + [True]


def test_stones_that_overlap_are_refused_with_the_place(tmp_path):
    path = drawn(tmp_path / "a.json", [box((0, 0, 0), (1, 1, 1)), box((0, 0, 0.9), (1, 1, 2))], ("low", "high"))
    with pytest.raises(
        ValueError,
        match=r"block 0 \('low'\) overlaps block 1 \('high'\) by 0.1 m near \(0.5, 0.5, 0.95\); move them apart",
    ):
        read(path)
    with pytest.warns(UserWarning, match="overlapping by up to 0.1 m"):
        faced = read(path, overlap_tolerance=0.11)
    assert faced.vertices[:8, 2].max() == pytest.approx(0.95)


@pytest.mark.thorough
def test_a_small_overlap_that_facing_leaves_is_a_contact_with_a_note(tmp_path):
    (points, faces), low = box((0, 0, 0.995), (1, 1, 2)), box((0, 0, 0), (1, 1, 1))
    # Too steep for a joint of two faces: it touches along an edge, 5 mm too deep.
    steep = np.where(points[:, 2:] < 1, points + np.array([[0.0, 0.0, 0.2]]) * points[:, :1], points)
    prop = box((0.9, 0, 1), (1, 1, 1.178))  # 3 mm too deep, beside it
    drawn(tmp_path / "a.json", [low, (steep, faces), prop], ("low", "high", "prop"))
    text = '[geometry]\nfile = "a.json"\ndimension = 3\n[roles]\nlow = "moving"\n'
    found = case(text + DOWN + "limit = 0.01\n", tmp_path)
    with pytest.warns(UserWarning, match=r"2 pairs of blocks overlap by up to 0.0049\d* m .*, taken as in contact"):
        assembly = assembly_of(found)
    down = solver.Settlement(direction=(0, 0, -1), increment=0.01, limit=0.01)
    with pytest.raises(ValueError, match="overlaps block"):
        solver.settle(assembly, down, friction_coefficient=0.6)
    assert blockvis.run_case(found, tmp_path / "out", outputs=()).response.path[0].notes == ()
    with pytest.raises(ValueError, match=r"raise overlap_tolerance \(0.001 m\)"):
        assembly_of(case(text.replace("[roles]", "overlap_tolerance = 0.001\n[roles]") + DOWN, tmp_path))


@pytest.mark.slow
def test_a_face_that_folds_back_on_itself_is_drawn(tmp_path):
    """As of a stone of `bridge.json` of compas_cra: of its upper edge a part is run along twice."""
    ring = [(-1.04, 1.53), (-0.96, 1.53), (-2.08, 1.53), (-1.97, 1.45), (-1.45, 1.45), (-1.40, 1.49), (-1.37, 1.46)]
    n = len(ring)
    points = np.array([(x, y, z) for y in (0.0, 1.0) for x, z in ring])
    sides = [[k, n + k, n + (k + 1) % n, (k + 1) % n] for k in range(n)]
    faces = [list(range(n)), list(range(n, 2 * n))[::-1], *sides]
    path = drawn(tmp_path / "a.json", [(points, faces), box((-2.0, 0.0, 1.0), (-1.0, 1.0, 1.45))], ("folded", "low"))
    assert main(["new", str(path), "-o", str(tmp_path / "a.toml")]) == 0
    assert (tmp_path / "a.supports.png").exists()


def test_new_writes_a_case_in_space(tmp_path, capsys):
    bricks = generators.build("L corner", {"bricks": 2, "across": 2, "courses": 2})
    write_layout(layout_of(bricks).chosen(np.flatnonzero(bricks.free)), tmp_path / "corner.obj")
    assert main(["new", str(tmp_path / "corner.obj"), "-o", str(tmp_path / "corner.toml")], outputs=()) == 0
    assert "refuses it" not in capsys.readouterr().err
    text = (tmp_path / "corner.toml").read_text(encoding="utf-8")
    assert "dimension = 3" in text
    assert "direction = [0.0, 0.0, -1.0]" in text
    assert "8 blocks in space" in text
    assembly = assembly_of(case_from(text, tmp_path))
    assert assembly.names[-2:] == ("ground left", "ground right")
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 1e-9)
    assert (contacts.block_b == assembly.index("ground right")).any() or (
        contacts.block_a == assembly.index("ground right")
    ).any()


@pytest.mark.thorough
def test_new_names_the_supports_of_a_drawing(tmp_path):
    save_layout(generators.dome(lunes=4, courses=1), tmp_path / "dome.stl")
    assert main(["new", str(tmp_path / "dome.stl"), "-o", str(tmp_path / "dome.toml")], outputs=()) == 0
    text = (tmp_path / "dome.toml").read_text(encoding="utf-8")
    found = assembly_of(case_from(text, tmp_path))
    assert int((~found.free).sum()) == 4


@pytest.mark.slow
def test_a_pushover_counts_along_x_by_default(tmp_path):
    """A block of 0.4 by 0.4 by 1 m, pushed along x, tips when α is its slenderness."""
    solids = [box((-1, -1, -0.5), (2, 2, 0)), box((0, 0, 0), (0.4, 0.4, 1))]
    blocks = solver.Assembly.from_solids(solids, names=["ground", "block"], roles=["fixed", "free"])
    save_layout(blocks, tmp_path / "block.obj")
    (tmp_path / "case.toml").write_text(
        '[geometry]\nfile = "block.obj"\nunit = "m"\ndimension = 3\n[roles]\nground = "fixed"\n'
        '[analysis]\nkind = "pushover"\n[material]\nfriction_coefficient = 0.9\n'
        '[[loads]]\nblocks = "block"\nkind = "live"\nweight_fraction = [1, 0, 0]\n'
        '[control]\nblock = "block"\nincrement = 0.05\nlimit = 0.05\n',
        encoding="utf-8",
    )
    assert run_command(tmp_path / "case.toml", "--no-pictures", "-o", tmp_path / "out") == 0
    assert json.loads((tmp_path / "out" / "summary.json").read_bytes())["limit_load_multiplier"] == pytest.approx(0.4)


def test_a_tie_end_in_no_block_is_led_to_the_nearest_by_its_distance(tmp_path):
    # Off the edge of the first by (0.3, 0.3), off the face of the second by 0.35.
    blocks = [box((0, 0, 0), (1, 1, 1)), box((1.3, 1.65, 0), (2.3, 2.65, 1)), box((0, 0, -1), (3, 3, 0))]
    assembly = solver.Assembly.from_solids(blocks, names=["edge", "face", "ground"], roles=["free", "free", "moving"])
    save_layout(assembly, tmp_path / "blocks.json")
    tie = '[[ties]]\nname = "iron"\nfrom = [1.3, 1.3, 0.5]\nto = [0.5, 0.5, 0.5]\nstiffness = 1e7\n'
    with pytest.raises(ValueError, match=r"lies in no block; the nearest is 'face', 0\.35 m away"):
        blockvis.run_case(case('[geometry]\nfile = "blocks.json"\n' + DOWN + tie, tmp_path), tmp_path / "out")
