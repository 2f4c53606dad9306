"""Loads at the centroids, and the motion of the supports."""

import dataclasses
from functools import partial

import numpy as np
import pytest

import solver

OUTLINES = [[[0, 0], [2, 0], [2, 1], [0, 1]], [[0, -1], [3, -1], [3, 0], [0, 0]], [[5, 0], [6, 0], [6, 1], [5, 1]]]
ASSEMBLY = solver.Assembly.from_outlines(OUTLINES, names=["brick", "base", "pier"], roles=["free", "moving", "moving"])
PUSH = solver.Settlement(direction=(1, 0))
START = solver.Pose.initial(ASSEMBLY)

WITHOUT_FILL = dataclasses.replace(solver.self_weight(ASSEMBLY), fills=["fill"])

MOTIONS = {
    "translation": {"direction": (3, -4)},
    "rotation": {"rotation_centre": (2, 7), "rotation": -1},
    "both": {"direction": (0, -1), "rotation_centre": (1, 1), "rotation": 0.4},
}


def test_self_weight():
    loads = solver.self_weight(ASSEMBLY)
    assert loads.dead[:, 1] == pytest.approx(-2000 * 9.81 * np.array([2, 3, 1]))
    assert (loads.dead[:, [0, 2]] == 0).all()
    assert (loads.live == 0).all()


def test_weight_fraction_of_all_blocks():
    assert solver.weight_fraction(ASSEMBLY, (0.1, -0.2))[:, 1] == pytest.approx(-0.2 * ASSEMBLY.masses * 9.81)


def test_point_load_has_the_moment_of_its_arm():
    """Force (3, 5) at (2, 1), one right and half up of the centroid (1, 0.5): moment 1 · 5 - 0.5 · 3."""
    load = solver.point_load(ASSEMBLY, 0, (3, 5), point=(2, 1), moment=10)
    assert load[0] == pytest.approx([3, 5, 10 + 1 * 5 - 0.5 * 3])
    assert (load[1:] == 0).all()
    assert solver.point_load(ASSEMBLY, 0, (3, 5))[0].tolist() == [3, 5, 0]


@pytest.mark.parametrize(
    ("force", "point", "message"),
    [
        ((1, 0), (1.5,), r"a point is 1.5; give 2 numbers per block, one per axis"),
        ((1, 0), 1.5, r"a point is 1.5; give 2 numbers"),
        ((5,), None, r"a force is 5.0; give 2 numbers"),
        ((1, 0, 0), (0, 0), r"a force is \[1.0, 0.0, 0.0\]; give 2 numbers"),
    ],
)
def test_a_force_and_its_point_have_a_number_per_axis(force, point, message):
    """One number was the point (1.5, 1.5)."""
    with pytest.raises(ValueError, match=message):
        solver.point_load(ASSEMBLY, 0, force, point=point)


@pytest.mark.parametrize("s", [0.0, 0.3, 2.0])
def test_rotation_follows_the_true_arc(s):
    settlement = solver.Settlement(rotation_centre=(2, 7), rotation=-5)
    pose = settlement.displaced(ASSEMBLY, START, s)
    arms = [p.positions[1:] - [2, 7] for p in (START, pose)]
    assert np.hypot(*arms[1].T) == pytest.approx(np.hypot(*arms[0].T), rel=1e-14)
    turned = np.angle((arms[1] @ [1, 1j]) / (arms[0] @ [1, 1j]))
    assert turned == pytest.approx([-s, -s], abs=1e-14)
    assert pose.rotations[:, 0].tolist() == pytest.approx([0, -s, -s])
    assert (pose.positions[0] == START.positions[0]).all()


def test_centre_travels_with_the_translation():
    settlement = solver.Settlement(direction=(0, -2), rotation_centre=(1.5, -0.5), rotation=0.4)
    pose = settlement.displaced(ASSEMBLY, START, 0.5)
    assert settlement.unit == "m"
    # The base is centred on the point it turns about.
    assert pose.positions[1] == pytest.approx([1.5, -1.0])
    assert pose.rotations[1, 0] == pytest.approx(0.2)


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("s", [0.0, 0.7])
def test_rate_is_the_derivative_of_the_displacement(motion, s):
    settlement = solver.Settlement(**MOTIONS[motion])
    step = 1e-5
    ahead, behind = (settlement.displaced(ASSEMBLY, START, s + sign * step) for sign in (1, -1))
    slope = (ahead.displacements(ASSEMBLY) - behind.displacements(ASSEMBLY)) / (2 * step)
    assert np.abs(settlement.rate(ASSEMBLY, START, s) - slope).max() < 1e-9


def test_only_named_supports_take_part():
    settlement = solver.Settlement(direction=(1, 0), blocks=("pier", "brick"))
    assert settlement.taking_part(ASSEMBLY).tolist() == [False, False, True]
    moved = settlement.displaced(ASSEMBLY, START, 0.5).positions - START.positions
    assert moved.tolist() == [[0, 0], [0, 0], [0.5, 0]]
    with pytest.raises(ValueError, match="'pillar'"):
        solver.Settlement(direction=(1, 0), blocks=("pillar",)).taking_part(ASSEMBLY)


def test_direction_counts_as_a_direction_only():
    assert solver.Settlement(direction=(0, -7)).direction == (0, -1)
    assert solver.Settlement(direction=(1, 0), increment=0.02).tolerance == pytest.approx(2e-4)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "needs a direction"),
        ({"direction": (0, 0)}, "direction"),
        ({"direction": (1, np.nan)}, "two finite numbers"),
        ({"direction": (1, 0, 0, 0)}, "two finite numbers"),
        ({"rotation_centre": (0, 0)}, "must not be zero"),
        ({"rotation_centre": (0, np.inf), "rotation": 1}, "two finite numbers"),
        ({"direction": (1, 0), "rotation": 1}, "no rotation_centre"),
        ({"direction": (1, 0), "increment": 0}, "increment"),
        ({"direction": (1, 0), "increment": -0.1}, "increment"),
        ({"direction": (1, 0), "limit": np.nan}, "limit"),
        ({"direction": (1, 0), "tolerance": -1e-4}, "tolerance"),
        ({"direction": (1, "down")}, r"direction is \(1, 'down'\); give a sequence of numbers"),
        ({"direction": (1, 0), "stops": 0.1}, "stops is 0.1; give a sequence of numbers"),
        ({"direction": (1, 0), "stops": ["a"]}, r"stops is \['a'\]; give a sequence of numbers"),
        ({"profile": [1.0]}, r"profile is \[1.0\]; give a mapping, by names"),
        ({"profile": {"base": "down"}}, "settlement profile of 'base' is 'down'; give numbers"),
        (
            {"profile": {"base": (0, -1, 0), "pier": (0, 0, -1, 0, 0, 0)}},
            r"settlement profile of 'pier' is \[.*\]; give \[dx, dy, rotation\], in space",
        ),
        ({"direction": (1, 0), "limit": 0.5, "stops": (0.1, 0.6)}, r"stop 0.6 is not between 0 and the limit of 0.5"),
    ],
)
def test_refused_settlements(given, message):
    with pytest.raises(ValueError, match=message):
        solver.Settlement(**given)


@pytest.mark.parametrize(
    "make",
    [
        lambda: solver.InterfaceLaw(cohesion="0.6"),
        lambda: solver.Settlement(direction=(1, 0), limit="0.6"),
        lambda: solver.Controls(local_loss="0.6"),
        lambda: solver.ControlDisplacement("brick", limit="0.6"),
        lambda: solver.Structure(ASSEMBLY, friction_coefficient="0.6"),
        lambda: solver.settle(ASSEMBLY, solver.Settlement(direction=(1, 0)), friction_coefficient="0.6"),
    ],
)
def test_text_in_place_of_a_number_is_named(make):
    with pytest.raises(
        TypeError, match=r"(cohesion|limit|local_loss|friction_coefficient) is the text '0\.6'; give a number"
    ):
        make()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"falling_frames": None}, "falling_frames is None; give a whole number"),
        ({"falling_frames": -1}, "falling_frames is -1; it is a number of at least 0"),
        ({"falling_frames": 2.5}, "falling_frames is 2.5; give a whole number"),
        ({"overlap_tolerance": np.nan}, "overlap_tolerance is nan; give a number"),
        ({"local_loss": 1.5}, "local_loss is 1.5; it is a number from 0 to 1, a share of the weight"),
        ({"step_tolerance": 0.0}, "step_tolerance is 0; it is a number between 0 and 1"),
    ],
)
def test_refused_controls(given, message):
    with pytest.raises(ValueError, match=message):
        solver.Controls(**given)


def test_friction_given_in_degrees_warns():
    with pytest.warns(UserWarning, match=r"friction_coefficient = 60 is .* give its tangent, 1\.73"):
        solver.Structure(ASSEMBLY, friction_coefficient=60)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: solver.Settlement((1, 0), limit=None), "limit is None; give a number"),
        (lambda: solver.Settlement((1, 0), rotation=None), "rotation is None; give a number"),
        (lambda: solver.InterfaceLaw(None), "friction_coefficient is None; give a number"),
        (lambda: solver.InterfaceLaw([0.5]), r"friction_coefficient is \[0\.5\]; give a number"),
        (lambda: solver.InterfaceLaw(1e8), r"friction_coefficient is 1e\+08; nothing slides by 10000, give"),
        (lambda: solver.settle(ASSEMBLY, (1, 0), friction_coefficient=None), "friction_coefficient is None"),
        (lambda: solver.Settlement((1, 0), blocks="pier"), "blocks is the text 'pier'; give a sequence of names"),
        (lambda: solver.Structure(ASSEMBLY, 0.5), r"interfaces are 0\.5; .* or friction_coefficient by its name"),
        (lambda: solver.Structure("a.json", friction_coefficient=1), r"assembly is 'a\.json'; give solver\.Assembly"),
        (lambda: solver.Structure(ASSEMBLY, friction_coefficient=""), "friction_coefficient is the text ''"),
        (lambda: solver.Structure(ASSEMBLY, friction_coefficient=[]), r"friction_coefficient is \[\]; give a number"),
        (lambda: solver.Interfaces(0.5), r"default law of interfaces is 0\.5; give solver\.InterfaceLaw"),
        (
            lambda: solver.Interfaces(pairs={("a", "b"): 0.3}),
            r"law of the interface of .* is 0\.3; give solver",
        ),
        (lambda: solver.Interfaces(pairs={"ab": solver.InterfaceLaw()}), "a law for 'ab'; give it for two materials"),
        (lambda: solver.Interfaces(ground={"g": "x"}), "stiffness of the ground under 'g' is the text 'x'"),
        (
            lambda: solver.Structure(ASSEMBLY, friction_coefficient=1, loads=WITHOUT_FILL),
            "one of the fills is 'fill'; give solver.Backfill",
        ),
        (lambda: solver.Interfaces(scatter=0.1), r"scatter of interfaces is 0\.1; give solver\.JointScatter"),
        (lambda: solver.settle(ASSEMBLY, [PUSH, 1.0]), r"one of the settlements is 1\.0; give solver\.Settlement"),
        (lambda: solver.settle(ASSEMBLY, None), r"direction is \(None,\); give a sequence of numbers"),
        (
            lambda: solver.settle(ASSEMBLY, (1, 0), friction_coefficient=0.3, interfaces=solver.Interfaces()),
            "either a friction_coefficient or interfaces; give one of them",
        ),
        (
            lambda: solver.PointForces([0, 1], [[0, 1]], [[0, 0]]).load(ASSEMBLY),
            r"a force is \[0, 1\]; give 2 numbers per block",
        ),
        (lambda: solver.self_weight(ASSEMBLY).with_forces(ASSEMBLY, np.zeros((3, 3))), "give solver.PointForces"),
        (lambda: solver.edge_pressure(ASSEMBLY, 0, 1.5, 1.0), "edge is 1.5; give a whole number"),
        (lambda: solver.JointScatter(2.5, np.sqrt), "seed is 2.5; give a whole number"),
        (lambda: solver.JointScatter(-1, np.sqrt), "seed is -1; give a whole number of at least 0"),
        (lambda: solver.Tie("t", (0, 1), ((0, 0), (1, 1)), 1e6, brittle="no"), "brittle is the text 'no'; give True"),
        (lambda: solver.Structure(ASSEMBLY, friction_coefficient=1, ties=["a"]), "one of the ties is 'a'; give solver"),
        (lambda: solver.Structure(ASSEMBLY, solver.Interfaces(), [1.0]), r"loads is \[1\.0\]; give solver\.Loads"),
        (lambda: solver.point_load(ASSEMBLY, 0, "x"), r"force is \['x'\]; give numbers"),
        (lambda: solver.edge_pressure(ASSEMBLY, 0, 0, "x"), "pressure is the text 'x'; give a number"),
        (lambda: solver.settle(ASSEMBLY, PUSH, controls={"local_loss": 0}), r"controls is {.*}; give solver\.Controls"),
        (lambda: solver.settle(ASSEMBLY, PUSH, controls=0), r"controls is 0; give solver\.Controls"),
        (lambda: solver.limit_load(ASSEMBLY, acceleration=(1, 0), closed_gap="x"), "closed_gap is the text 'x'"),
        (
            lambda: solver.limit_load(ASSEMBLY, acceleration=(1, 0), displacement=[]),
            r"displacement is \[\]; give a",
        ),
        (
            lambda: solver.limit_load(ASSEMBLY, acceleration=(1, 0), ties_at=(1,)),
            r"ties_at is \(1,\); give solver\.TieForces",
        ),
        (lambda: solver.limit_load(ASSEMBLY, acceleration=(1, 0), ties_at=()), r"ties_at is \(\); give solver"),
        (
            lambda: solver.limit_load(ASSEMBLY, acceleration=(1, 0), bonds_at=np.zeros(2)),
            r"bonds_at is array\(\[0\., 0\.\]\); give solver\.Bonds",
        ),
        (lambda: solver.limit_load(ASSEMBLY, acceleration=(1, 0), bonds_at=1), r"bonds_at is 1; give solver\.Bonds"),
        (lambda: solver.surface_pressure(ASSEMBLY, (1, 0, 0)), r"pressure is \(1, 0, 0\); give a number"),
        (lambda: solver.edge_pressure(ASSEMBLY, 0, 0, np.nan), "pressure is nan; give a number"),
        (lambda: solver.force_on_top(ASSEMBLY, "a"), "x is the text 'a'; give a number"),
        (
            lambda: solver.Structure(ASSEMBLY, friction_coefficient=1).settle(PUSH, changes=[1]),
            r"one of the changes is 1; give solver\.PhaseChange",
        ),
        (
            lambda: solver.limit_load(ASSEMBLY, acceleration=(1, 0), pose=ASSEMBLY),
            r"pose is <.*>; give solver\.Pose",
        ),
    ],
)
def test_what_is_no_number_is_refused_by_its_name(make, message):
    with pytest.raises((TypeError, ValueError), match=message):
        make()


@pytest.mark.parametrize("direction", [(np.nan, 0), (0, 0), (0, 0, -1)])
def test_a_pressure_needs_its_direction(direction):
    with pytest.raises(ValueError, match=r"pressure direction is \[.*\]; give the direction in which it pushes"):
        solver.surface_pressure(ASSEMBLY, 1e3, direction)


def test_a_moment_in_space_is_three_numbers():
    """One number would act about all three axes."""
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    faces = [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)]
    cube = solver.Assembly.from_solids([(corners, faces)])
    with pytest.raises(ValueError, match=r"moment in space is 5\.0; give three numbers"):
        solver.point_load(cube, 0, moment=5.0)
    assert solver.point_load(cube, 0, moment=(1, 2, 3))[0].tolist() == [0, 0, 0, 1, 2, 3]
    for moment in (None, np.inf, (1, 0)):
        with pytest.raises(ValueError, match=r"a moment in the plane is .*; give one number"):
            solver.point_load(ASSEMBLY, 0, moment=moment)


def test_blocks_may_be_any_sequence_of_their_numbers():
    """A tuple was an index per axis: its blocks were not there, and an empty one was all of them."""
    for load in (partial(solver.weight_fraction, ASSEMBLY, (1, 0)), partial(solver.surface_pressure, ASSEMBLY, 1.0)):
        one, two = load(blocks=[1]), load(blocks=[1, 2])
        assert np.array_equal(load(blocks=(1, 2)), two)
        assert np.array_equal(load(blocks=(1,)), one)
        assert not load(blocks=()).any()
    with pytest.raises(ValueError, match=r"block is \(1,\); give a whole number"):
        solver.point_load(ASSEMBLY, (1,), (0, -1))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            {"direction": (0, -1), "rotation_centre": (0, 0, 0), "rotation_axis": (0, 0, 1), "rotation": 0.1},
            r"settlement rotation_centre is \[0.0, 0.0, 0.0\], and the blocks are in the plane: give \[x, y\]",
        ),
        ({"direction": (0, 0, -1)}, r"settlement direction is \[0.0, 0.0, -1.0\], and the blocks are in the plane"),
        ({"radial_from": (0, 0)}, "settlement has radial_from, and the blocks are in the plane"),
        (
            {"profile": {"base": (0, 0, -1, 0, 0, 0)}},
            r"settlement profile of 'base' is \[.*\], and the blocks are in the plane: give \[dx, dy, rotation\]",
        ),
    ],
)
def test_what_of_a_settlement_is_for_space_is_named_in_the_plane(given, message):
    structure = solver.Structure(ASSEMBLY, friction_coefficient=0.7)
    with pytest.raises(ValueError, match=message):
        structure.settle(solver.Settlement(**given))


@pytest.mark.parametrize(
    ("make", "numbers"),
    [
        (lambda: solver.weight_fraction(ASSEMBLY, (1, 0), ["brick"]), r"\['brick'\]"),
        (lambda: solver.surface_forces(ASSEMBLY, 1.0, blocks=[5]), r"\[5\]"),
        (lambda: solver.edge_force(ASSEMBLY, 7, 0, 1.0), "7"),
        (lambda: solver.point_load(ASSEMBLY, 7, (0, -1)), "7"),
        (lambda: solver.PointForces([3], [[1, 0]], [[1, 1]]).load(ASSEMBLY), r"\[3\]"),
    ],
)
def test_blocks_that_are_not_there_are_told_from_those_that_are(make, numbers):
    with pytest.raises(ValueError, match=f"there are no blocks {numbers}; give numbers from 0 to 2, assembly.index"):
        make()


@pytest.mark.parametrize("kind", ["Dead", "Live", None])
def test_loads_are_dead_or_live(kind):
    """Another word was taken for live, and a settlement leaves live loads out."""
    with pytest.raises(ValueError, match=f"kind of the load is {kind!r}; it is 'dead' or 'live'"):
        solver.self_weight(ASSEMBLY).with_forces(ASSEMBLY, solver.PointForces.at(0, (0, -1), (1, 1)), kind)
    with pytest.raises(ValueError, match=f"kind of the load is {kind!r}"):
        solver.self_weight(ASSEMBLY).with_acceleration(ASSEMBLY, (1, 0), kind)


def test_forces_at_points_take_lists():
    forces = solver.PointForces([0, 0], [[3, 5], [0, -1]], [[2, 1], [1, 1]])
    loads = solver.self_weight(ASSEMBLY).with_forces(ASSEMBLY, forces, "live")
    assert loads.live[0] == pytest.approx([3, 4, 1 * 5 - 0.5 * 3])


@pytest.mark.parametrize("missing", ["dead", "live"])
def test_loads_that_are_none_are_refused_by_their_name(missing):
    """An attribute of None was asked for, far from here."""
    loads = dataclasses.replace(solver.self_weight(ASSEMBLY), **{missing: None})
    with pytest.raises(ValueError, match=rf"^{missing} loads are None; give \(\d+, 3\): fx, fy, moment"):
        solver.limit_load(ASSEMBLY, loads=loads, friction_coefficient=0.6)


@pytest.mark.parametrize(
    "path", [partial(solver.Settlement, direction=(1, 0)), partial(solver.ControlDisplacement, "a")]
)
def test_a_tolerance_below_the_rounding_of_the_limit_is_refused(path):
    """Steps came to nothing by rounding, and the words asked for the case to be sent to the developers."""
    said = "tolerance is 1e-17, less than 1e-12 of its limit of 1; give at least 1.1e-12$"
    with pytest.raises(ValueError, match=said):
        path(tolerance=1e-17)
    assert path(tolerance=1.1e-12).tolerance == 1.1e-12
    assert path(limit=1e12).tolerance == 1e-4, "a tolerance that nobody gave was refused"


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: solver.weight_fraction(ASSEMBLY, (1, 1j)), r"a fraction of the weight is \(1, 1j\); give numbers"),
        (
            lambda: ASSEMBLY.from_outlines([[[0, 0], [1, 0], [1, 1j]]]),
            r"the outline of block 'block 0' is .*1j.*; give",
        ),
        (lambda: solver.PointForces([0], [[1j, 0]], [[0, 0]]), r"force is \[\[1j, 0\]\]; give an array of numbers"),
        (lambda: solver.InterfaceLaw(np.complex128(0.5 + 1j)), r"friction_coefficient is \(0.5\+1j\); give a number"),
        (
            lambda: solver.Settlement((1, 0), stops=np.array([1j])),
            r"stops is \[0\.\+1\.j\]; give a sequence of numbers",
        ),
    ],
)
def test_complex_numbers_are_refused_by_their_name(make, said):
    """Numpy drops what is imaginary, with a warning or without."""
    with pytest.raises(ValueError, match=said):
        make()
