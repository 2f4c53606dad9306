"""Profiles of settlement: each support its own motion, troughs and tables of points, and the ground cut under them."""

import json
from itertools import pairwise

import numpy as np
import pytest
import structures
from structures import assembly_of, case_from, run_command

import blockvis
import solver
from blockvis import cli
from solver import mechanics

NO_FALL = solver.Controls(falling_frames=0)

PORTAL = """
[geometry]
layout = "portal"
[geometry.parameters]
column_blocks = 2
[settlement]
increment = 0.005
limit = 0.01
"""

WALL = """
[geometry]
layout = "wall"
[geometry.parameters]
bricks = 3
courses = 2
settling = [0.0, 0.75]
depth = 0.3
[settlement]
increment = 0.002
limit = 0.004
"""

ON_OWN_GROUND = """
[geometry]
file = "wall.json"
ignore = ["ground*"]
[[supports]]
name = "earth"
role = "moving"
outline = [[-0.1, -DEPTH], [0.85, -DEPTH], [0.85, 0.0], [-0.1, 0.0]]
[settlement]
increment = 0.002
limit = 0.002
"""


def case_of(text, profile, *more):
    text = text.replace("[settlement]", "\n".join(["[settlement]", f"profile = {profile}", *more]))
    return case_from(text)


def openings(response):
    joints = response.joints(len(response.path) - 1)
    return joints["opening"][joints["initial"] == 1]


@pytest.mark.slow
def test_a_translation_by_a_profile_is_the_ordinary_settlement():
    arch = structures.arch_response().assembly
    steps = {"increment": 0.01, "limit": 0.03}
    plain = solver.settle(arch, solver.Settlement(direction=(1, 0), **steps), controls=NO_FALL)
    profile = {"right springer": (2.5, 0.0, 0.0)}
    same = solver.settle(arch, solver.Settlement(profile=profile, **steps), controls=NO_FALL)
    assert [i.parameter for i in same.path] == [i.parameter for i in plain.path]
    np.testing.assert_allclose([i.reaction for i in same.path], [i.reaction for i in plain.path], rtol=1e-9)
    np.testing.assert_allclose(same.path[-1].pose.positions, plain.path[-1].pose.positions, atol=1e-10)


@pytest.mark.slow
def test_two_springers_that_part_by_half_each_open_the_arch_like_one_that_goes_all_the_way():
    arch = structures.arch_response().assembly
    one = solver.settle(arch, solver.Settlement(direction=(1, 0), increment=0.01, limit=0.04), controls=NO_FALL)
    both = arch.with_roles(["free" if role == "free" else "moving" for role in arch.roles])
    parting = {"left springer": (-1.0, 0.0, 0.0), "right springer": (1.0, 0.0, 0.0)}
    apart = solver.settle(both, solver.Settlement(profile=parting, increment=0.005, limit=0.02), controls=NO_FALL)
    np.testing.assert_allclose(openings(apart), openings(one), atol=2e-5)


def test_a_pure_rotation_is_measured_in_rad_and_turns_a_support_about_its_centroid():
    motion = solver.Settlement(profile={"right springer": (0.0, 0.0, -0.5)})
    assert motion.unit == "rad"
    arch = structures.arch_response().assembly
    start = solver.Pose.initial(arch)
    moved = motion.displaced(arch, start, 0.1).displacements(arch)
    springer = arch.index("right springer")
    np.testing.assert_allclose(moved[springer], [0.0, 0.0, -0.1], atol=1e-15)
    assert not np.delete(moved, springer, axis=0).any()


def test_s_is_the_largest_displacement_of_a_support():
    motion = solver.Settlement(profile={"a": (0.0, -0.5, 0.1), "b": (3.0, 4.0, 0.0)})
    assert motion.profile["b"] == pytest.approx((0.6, 0.8, 0.0))
    assert motion.profile["a"] == pytest.approx((0.0, -0.1, 0.02))
    assert solver.Settlement(profile=motion.profile) == motion


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"profile": {"a": (0.0, 0.0, 0.0)}}, "moves no support"),
        ({"profile": {}}, "moves no support"),
        ({"profile": {"a": (1.0, 0.0)}}, r"profile of 'a' is \[1.0, 0.0\]; give \[dx, dy, rotation\]"),
        ({"profile": {"a": (np.nan, 0.0, 0.0)}}, "profile of 'a'"),
        ({"profile": {"a": (1.0, 0.0, 0.0)}, "direction": (1, 0)}, "give no direction"),
        ({"profile": {"a": (1.0, 0.0, 0.0)}, "profile_arms": {"b": (0.0, 1.0)}}, "profile_arms of 'b'"),
        ({"profile": {"a": (1.0, 0.0, 0.0)}, "profile_arms": {"a": (0.0, 1.0, 0.0)}}, "give 2 numbers"),
        ({"direction": (0, -1), "profile_arms": {"a": (0.0, 1.0)}}, "with a profile"),
        ({"profile_arms": {"a": (0.0, 1.0)}}, "moves no support"),
    ],
)
def test_profiles_that_are_none_and_arms_without_their_support_are_refused(keys, words):
    with pytest.raises(ValueError, match=words):
        solver.Settlement(**keys)


def test_a_trough_goes_down_by_a_bell_and_both_ends_of_what_bears_follow_it():
    (trough,) = case_of(PORTAL, '{ kind = "gaussian", centre = 1.0, inflection = 0.5 }').profiles
    assert trough.value(np.array([1.0, 1.5])) == pytest.approx([1.0, np.exp(-0.5)])
    ends = np.array([[-1.0, 0.5], [0.5, 0.7], [0.7, 2.0]])
    along, down, tilt = trough.motions(ends, (0.0, -1.0)).T
    assert not along.any()
    for end, sense in ((ends[:, 0], -0.5), (ends[:, 1], 0.5)):
        np.testing.assert_allclose(-(down + sense * tilt * np.ptp(ends, axis=1)), trough.value(end), atol=1e-12)


def test_points_are_joined_by_straight_lines_and_level_beyond():
    (table,) = case_of(PORTAL, "{ points = [[0.0, 0.0], [2.0, 1.0]] }").profiles
    np.testing.assert_allclose(table.value(np.array([-1.0, 0.5, 3.0])), [0.0, 0.25, 1.0])


def test_a_ground_of_one_block_is_cut_under_the_joints_of_the_first_course():
    case = case_of(WALL, '{ kind = "gaussian", centre = 0.5, inflection = 0.2 }')
    with pytest.warns(UserWarning, match="cut under the joints of the first course, 'ground' into 5 pieces"):
        assembly = assembly_of(case)
    pieces = [i for i in range(assembly.n_blocks) if not assembly.free[i]]
    assert [assembly.names[i] for i in pieces] == [f"ground {k}" for k in range(1, 6)]
    edges = [assembly.outline(i)[:, 0] for i in pieces]
    assert [x.min() for x in edges[1:]] == pytest.approx([0.0, 0.25, 0.5, 0.75])
    whole = assembly_of(case_of(WALL, "{ points = [[-9.0, 0.0], [9.0, 1.0]] }"))
    assert "ground" in whole.names, "a straight profile tilts the ground as it is"
    assert assembly.areas[pieces].sum() == pytest.approx(whole.areas[whole.index("ground")])


@pytest.mark.slow
def test_how_deep_the_ground_is_drawn_counts_for_nothing(tmp_path):
    found = []
    cli.main(["layout", "wall", "bricks=3", "courses=2", "-o", str(tmp_path / "wall.json")])
    for depth in (0.1, 1.0):
        case = case_of(
            ON_OWN_GROUND.replace("wall.json", (tmp_path / "wall.json").as_posix()).replace("DEPTH", f"{depth}"),
            '{ kind = "gaussian", centre = 0.3, inflection = 0.3, depth = -1 }',
        )
        with pytest.warns(UserWarning, match="into 5 pieces"):
            response = blockvis.run_case(case, tmp_path / f"{depth}", outputs=()).response
        assembly, last = response.assembly, blockvis.open_results(tmp_path / f"{depth}").path[-1]
        under = ~assembly.free[assembly.block_of_vertex] & np.isclose(assembly.vertices[:, 1], 0.0, atol=1e-12)
        found.append((mechanics.moved_vertices(assembly, last.pose)[under], openings(response), last.reaction))
        # Both ends of what a brick stands on go by the bell, however wide the ground is drawn.
        settlement, piece = response.settlements[0], assembly.index("earth 2")
        ends = assembly.outline(piece)[:, 0].min(), assembly.outline(piece)[:, 0].max()
        drawn = solver.Pose.initial(assembly)
        after, top = settlement.displaced(assembly, drawn, 0.002), np.array([[x, 0.0] for x in ends])
        goes = mechanics.carried(top, np.array([piece, piece]), drawn, after)[:, 1]
        np.testing.assert_allclose(goes, [0.002 * np.exp(-0.5 * ((x - 0.3) / 0.3) ** 2) for x in ends], atol=1e-6)
    np.testing.assert_allclose(found[0][0], found[1][0], atol=1e-12)
    # Bricks slide: 5 % of the settlement, as between two step tolerances.
    np.testing.assert_allclose(found[0][1], found[1][1], atol=1e-4)
    assert found[0][2] == pytest.approx(found[1][2], rel=5e-3)


def test_a_support_moves_and_turns_at_the_end_of_its_arm():
    arch = structures.arch_response().assembly
    arms = {"right springer": (0.2, -0.1)}
    motion = solver.Settlement(profile={"right springer": (1.0, 0.0, 2.0)}, profile_arms=arms)
    assert solver.Settlement(profile=motion.profile, profile_arms=motion.profile_arms) == motion
    start, springer = solver.Pose.initial(arch), arch.index("right springer")
    point = arch.centroids[[springer]] + arms["right springer"]
    halfway, after = (motion.displaced(arch, start, s) for s in (0.05, 0.1))
    there = mechanics.carried(point, np.array([springer]), start, after)
    np.testing.assert_allclose(there, point + np.array([0.1, 0.0]), atol=1e-14)
    assert after.rotations[springer] == pytest.approx(0.2)
    # From where it is already turned, the arm has turned with it.
    again = motion.displaced(arch, halfway, 0.05)
    np.testing.assert_allclose(again.positions, after.positions, atol=1e-14)
    step = 1e-6
    by_difference = (motion.displaced(arch, start, 0.1 + step).positions - after.positions)[springer] / step
    np.testing.assert_allclose(motion.rate(arch, start, 0.1)[springer, :2], by_difference, atol=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("blocks", "moved"), [('"ground"', {1, 2, 3, 4, 5}), ('["ground 1", "ground 2"]', {1, 2}), ('"rock"', None)]
)
def test_ground_that_was_cut_is_named_by_its_name_or_its_pieces(tmp_path, blocks, moved):
    profile = 'profile = { kind = "gaussian", centre = 0.5, inflection = 0.2 }\n'
    first, then = WALL.replace("limit = 0.004", "limit = 0.002").split("[settlement]")
    text = f"{first}[[settlement]]\n{profile}{then}[[settlement]]\ndirection = [0, -1]\nblocks = {blocks}{then}"
    if moved is None:
        with pytest.raises(ValueError, match=r"\[settlement 2\] blocks: no block is named 'rock'.* ground 1, ground 2"):
            assembly_of(case_from(text))
        return
    response = blockvis.run_case(case_from(text), tmp_path / "out", outputs=()).response
    assert response.settlements[1].blocks == tuple(f"ground {k}" for k in sorted(moved))
    assert response.path[-1].phase == 1
    (tmp_path / "out" / "summary.json").unlink()
    assert blockvis.open_results(tmp_path / "out").settlements == response.settlements, "as of a run that was killed"


@pytest.mark.slow
def test_a_trough_and_its_mirror_open_the_wall_alike(tmp_path):
    # One increment: at the second a brick slips, and comes to rest a little earlier in the one than in the other. What
    # a program leaves of the step grows to a ten-thousandth of a brick.
    short, found = WALL.replace("limit = 0.004", "limit = 0.002"), []
    for centre in (0.15, 0.6):
        run = blockvis.run_case(
            case_of(short, f'{{ kind = "gaussian", centre = {centre}, inflection = 0.2 }}'),
            tmp_path / str(centre),
            outputs=(),
        )
        found.append(np.sort(openings(run.response)))
    np.testing.assert_allclose(found[0], found[1], atol=2e-5)
    stored = json.loads((tmp_path / "0.6" / "summary.json").read_text(encoding="utf-8"))
    assert blockvis.open_results(tmp_path / "0.6").settlements[0].profile.keys() == {f"ground {k}" for k in range(1, 6)}
    deepest = -0.5 * sum(np.exp(-0.5 * ((x - 0.6) / 0.2) ** 2) for x in (0.5, 0.75))
    assert stored["settlements"][0]["profile"]["ground 4"][1] == pytest.approx(deepest)


@pytest.mark.parametrize(
    ("profile", "words"),
    [
        ("3", r"\[settlement\] profile is 3; give \{ kind"),
        ('{ kind = "gauss", centre = 1 }', "did you mean 'gaussian'"),
        ('{ kind = "gaussian", inflection = 1 }', r"\[settlement.profile\] centre is missing"),
        ('{ kind = "gaussian", centre = 1 }', r"\[settlement.profile\] inflection is missing"),
        ('{ kind = "gaussian", centre = 1, inflection = -1 }', "inflection is -1; give a number above 0"),
        (
            "{ centre = 1, inflection = 1, points = [[0, 1], [1, 0]] }",
            "points is of kind 'points'",
        ),
        ('{ kind = "gaussian", centre = 1, inflection = 1, depth = 0.02 }', "depth is 0.02; give 1, or -1 for a heave"),
        ("{ points = [[0, 1]] }", "give at least two pairs"),
        ("{ points = [[0, 1], [0, 2]] }", "two values at x = 0"),
        ("{ points = [[0, 0], [1, 0]] }", "are all 0"),
        ("{ supports = { a = 1 } }", r"supports\] a is 1; give \[dx, dy\]"),
        ("{ supports = {} }", "give {"),
        (
            "{ points = [[0, 1], [1, 2]], supports = { a = [1, 0] } }",
            "supports is of kind .* give one kind",
        ),
    ],
)
def test_profiles_of_case_files_are_checked(profile, words):
    with pytest.raises(ValueError, match=words):
        case_of(PORTAL, profile)


def test_a_profile_that_names_no_support_says_which_there_are(tmp_path, capsys):
    (tmp_path / "case.toml").write_text(
        PORTAL.replace("[settlement]", '[settlement]\nprofile = { supports = { "grounds right" = [0, -1] } }')
    )
    assert run_command(tmp_path / "case.toml", "-o", tmp_path / "out") == cli.BAD_INPUT
    said = capsys.readouterr().err
    assert "'grounds right' is no block (did you mean" in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("motion", "reaction", "is_work"),
    [
        ("direction = [0, -1]", 19620.0, False),
        pytest.param(
            "direction = [0, -1]\nrotation_centre = [3, 0]\nrotation = -0.2", 7848.0, True, marks=pytest.mark.thorough
        ),
        pytest.param("profile = { supports = { base = [0, -1, 0.1] } }", 19620.0, True, marks=pytest.mark.thorough),
    ],
)
def test_where_supports_turn_as_they_sink_the_reaction_is_told_as_work(tmp_path, capsys, motion, reaction, is_work):
    base, column = ([[x, z], [-x, z], [-x, z - h], [x, z - h]] for x, z, h in ((-1, 0, 0.5), (-0.25, 2, 2)))
    blocks = [{"name": "base", "role": "moving", "outline": base}, {"name": "column", "outline": column}]
    (tmp_path / "a.json").write_text(json.dumps({"blocks": blocks}), encoding="utf-8")
    case = f'[geometry]\nfile = "a.json"\n[settlement]\n{motion}\nlimit = 0.01\n'
    (tmp_path / "a.toml").write_text(case, encoding="utf-8")
    assert run_command(tmp_path / "a.toml", "-o", tmp_path / "out") == 0
    out = capsys.readouterr().out
    assert float(out.split("first reaction")[1].split()[0]) == pytest.approx(reaction, rel=1e-4)
    assert ("reactions are the work on the supports over s" in out) == is_work


def test_a_profile_that_moves_a_fixed_support_says_how_to_let_it_move():
    with pytest.raises(ValueError, match="'ground left' is fixed; give it the role \"moving\""):
        assembly_of(case_of(PORTAL, '{ supports = { "ground left" = [0, -1] } }'))


def drawn(tmp_path, ground):
    """A wall of eight bricks half a metre long on pieces of ground that move, {name: (low, high)}, in a file."""
    shapes = [structures.rectangle(0.5 * k, 0.0, 0.5 * (k + 1), 0.25) for k in range(8)]
    names = [f"brick {k}" for k in range(8)]
    shapes += [structures.rectangle(low, -0.5, top, 0.0) for low, top in ground.values()]
    roles = ["free"] * len(names) + ["moving"] * len(ground)
    assembly = solver.Assembly.from_outlines(shapes, names=[*names, *ground], roles=roles)
    blockvis.save_layout(assembly, tmp_path / "drawn.json")
    return '[geometry]\nfile = "drawn.json"\n[settlement]\nincrement = 1e-4\nlimit = 1e-4\n'


def profile_of(text, profile, tmp_path, *more):
    """The assembly of a case with a profile, and the settlement that comes of it."""
    path = tmp_path / "case.toml"
    path.write_text(text.replace("[settlement]", "\n".join(["[settlement]", f"profile = {profile}", *more])))
    response = blockvis.run_case(path, tmp_path / "out", outputs=(), overwrite=True).response
    return response.assembly, response.settlements[0]


def tops(assembly, settlement, s):
    """How far the upper corners of each support go, {name: (left, right)}, along x and upright."""
    start = solver.Pose.initial(assembly)
    goes = mechanics.moved_vertices(assembly, settlement.displaced(assembly, start, s)) - assembly.vertices
    found = {}
    for i in np.flatnonzero(~assembly.free):
        mine = np.flatnonzero((assembly.block_of_vertex == i) & np.isclose(assembly.vertices[:, 1], 0.0))
        found[assembly.names[i]] = goes[mine[np.argsort(assembly.vertices[mine, 0])]]
    return found


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:the ground follows")
def test_how_wide_the_ground_is_drawn_counts_for_nothing(tmp_path):
    found = []
    for width in (4.0, 6.0, 12.0):
        text = drawn(tmp_path, {"ground": (-1.0, width)})
        assembly, trough = profile_of(text, '{ kind = "gaussian", centre = 8.0, inflection = 2.0 }', tmp_path)
        ends = tops(assembly, trough, 1e-3)
        found.append(ends["ground 9"][:, 1])
        pieces = [ends[f"ground {k}"][:, 1] for k in range(1, 10)]
        steps = [right[0] - left[1] for left, right in pairwise(pieces)]
        np.testing.assert_allclose(steps, 0.0, atol=1e-9)
    expected = [-1e-3 * np.exp(-0.5 * ((x - 8.0) / 2.0) ** 2) for x in (3.5, 4.0)]
    np.testing.assert_allclose(found, [expected] * 3, atol=1e-9)


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:the ground follows")
def test_a_straight_profile_along_x_strains_the_ground(tmp_path):
    text = drawn(tmp_path, {"ground": (0.0, 4.0)})
    assembly, strain = profile_of(text, "{ points = [[0.0, -1.0], [4.0, 1.0]] }", tmp_path, "direction = [1.0, 0.0]")
    ends = tops(assembly, strain, 1e-3)
    np.testing.assert_allclose(
        [ends[f"ground {k}"][0, 0] for k in range(1, 9)], 1e-3 * (np.arange(8) - 3.5) / 4.0, atol=1e-12
    )
    for motion in ("direction = [0.0, -1.0]", "direction = [1e-17, -1.0]"):
        # What cos(90°) leaves of a direction strains nothing.
        assembly, _ = profile_of(text, "{ points = [[0.0, 0.0], [4.0, 1.0]] }", tmp_path, motion)
        assert "ground" in assembly.names


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore:the ground follows")
def test_pieces_turn_about_the_centroid_of_what_was_drawn_as_one(tmp_path):
    text = drawn(tmp_path, {"ground": (0.0, 4.0)})
    turning = "[[settlement]]\nprofile = { supports = { ground = [0, 0, 1] } }\nincrement = 1e-4\nlimit = 1e-4\n"
    trough = 'profile = { kind = "gaussian", centre = 2.0, inflection = 0.8 }\n'
    path = tmp_path / "two.toml"
    path.write_text(text.replace("[settlement]\n", "[[settlement]]\n" + trough) + turning)
    response = blockvis.run_case(path, tmp_path / "out", outputs=()).response
    assembly, (_, second) = response.assembly, response.settlements
    ends = tops(assembly, second, 1e-3)
    for name, goes in ends.items():
        x = np.sort(assembly.outline(assembly.index(name))[:, 0])[[0, -1]]
        np.testing.assert_allclose(goes[:, 1], 1e-3 * (x - 2.0), atol=2e-6)


def test_what_touches_a_support_from_the_side_does_not_stand_on_it(tmp_path):
    boxes = {"a": (0, 0, 2, 1), "b": (2, 1, 4, 2), "low": (0, -2, 2, 0), "high": (2, -2, 4, 1)}
    assembly = solver.Assembly.from_outlines(
        [structures.rectangle(*box) for box in boxes.values()],
        names=list(boxes),
        roles=["free", "free", "moving", "moving"],
    )
    blockvis.save_layout(assembly, tmp_path / "drawn.json")
    text = '[geometry]\nfile = "drawn.json"\n[settlement]\nincrement = 1e-4\nlimit = 1e-4\n'
    _, slope = profile_of(text, "{ points = [[0.0, 1.0], [4.0, 0.0]] }", tmp_path)
    assert slope.profile["high"] == pytest.approx((0.0, -0.25, 0.25))
    assert slope.profile_arms["high"] == pytest.approx((0.0, 1.5))


def test_a_piece_that_has_the_name_of_another_support_is_refused(tmp_path):
    text = drawn(tmp_path, {"ground": (0.0, 2.0), "ground 2": (2.0, 4.0)})
    with pytest.raises(ValueError, match="'ground' is cut for a profile, and its piece 'ground 2' has the name of"):
        profile_of(text, '{ kind = "gaussian", centre = 2.0, inflection = 0.8 }', tmp_path)
