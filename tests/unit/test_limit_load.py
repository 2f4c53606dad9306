import dataclasses
from decimal import Decimal
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from structures import in_either, prism, rectangle

import solver
from blockvis import generators
from solver import Structure, limit_load, mechanics

GROUND = [[-2, -1], [3, -1], [3, 0], [-2, 0]]


def block(width=1.0, height=1.0, scale=1.0, density=2000.0):
    outline = scale * np.array([[0, 0], [width, 0], [width, height], [0, height]], dtype=float)
    ground = scale * np.array(GROUND, dtype=float)
    return solver.Assembly.from_outlines(
        [outline, ground], roles=["free", "fixed"], names=["block", "ground"], density=density
    )


def pushed(assembly, live):
    return solver.Loads(solver.self_weight(assembly).dead, live)


@pytest.mark.parametrize("flow", ["associative", "non-associative"])
@pytest.mark.parametrize(("friction", "height", "force"), [(0.3, 1.0, 0.3), (0.6, 2.0, 0.25), (0.6, 1.0, 0.5)])
def test_a_block_pushed_at_its_top_slides_or_overturns(flow, friction, height, force):
    assembly = block(1.0, height)
    weight = mechanics.total_weight(assembly)
    live = solver.point_load(assembly, 0, (1.0, 0.0), point=(0.0, height))
    limit = limit_load(assembly, loads=pushed(assembly, live), friction_coefficient=friction, flow=flow)
    assert limit.status is solver.LimitStatus.FOUND
    assert limit.multiplier == pytest.approx(min(force, friction) * weight, rel=1e-6)
    assert limit.bounds[0] == limit.multiplier
    assert limit.bounds[1] == pytest.approx(limit.multiplier, rel=1e-6)
    assert limit.increment.reaction == pytest.approx(limit.multiplier)
    assert "1 block moving" in str(limit)
    lifts = limit.mechanism[0, 1] / limit.mechanism[0, 0]
    if friction < force + 1e-9:
        assert lifts == pytest.approx(friction if flow == "associative" else 0.0, abs=1e-6)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_units_do_not_matter(scale):
    assembly = block(1.0, 2.0, scale=scale, density=2000.0 / scale)
    live = solver.weight_fraction(assembly, (1.0, 0.0), np.array([0]))
    limit = limit_load(assembly, loads=pushed(assembly, 1e4 * live), friction_coefficient=0.6)
    assert limit.multiplier == pytest.approx(0.5e-4, rel=1e-9)


def test_a_load_that_presses_on_the_ground_has_no_limit():
    assembly = block()
    live = solver.point_load(assembly, 0, (0.1, -1.0))
    limit = limit_load(assembly, loads=pushed(assembly, live), friction_coefficient=0.6)
    assert limit.status is solver.LimitStatus.UNBOUNDED
    assert limit.multiplier == np.inf
    assert str(limit).startswith("unbounded")
    assert not limit.mechanism.any()


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("friction", [pytest.param(0.37, marks=pytest.mark.slow), 0.6, 3.0])
@pytest.mark.slow
def test_without_dilatancy_a_block_on_a_slope_carries_any_weight_below_its_angle_of_friction(dimension, friction):
    """W tan 20° = 0.364 W slides at any W or at none: what locks itself has no limit in either flow."""
    angle = np.radians(20.0)
    along, out = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
    shapes = [[along * x + out * y for x, y in corners] for corners in (rectangle(0.0, 0.0, 1.0, 0.4), GROUND)]
    assembly = in_either(dimension, shapes, prism, roles=["free", "fixed"])
    down = solver.weight_fraction(assembly, (0.0, -1.0, 0.0)[:dimension], np.array([0]))
    for flow in ("associative", "non-associative"):
        limit = limit_load(assembly, loads=solver.Loads(down, down), friction_coefficient=friction, flow=flow)
        assert limit.status is solver.LimitStatus.UNBOUNDED
        assert limit.multiplier == np.inf


@pytest.mark.thorough
def test_without_dilatancy_a_wall_has_the_limit_load_of_its_mirror_image_and_of_any_order_of_its_blocks():
    # Many forces carry alike: of two corners on one stone either may press.
    rows, found = [[0.0, 1.0, 2.0], [0.0, 0.5, 1.5, 2.0], [0.0, 1.0, 2.0]], []
    bricks = [rectangle(0.4 * a, 0.2 * k, 0.4 * b, 0.2 * (k + 1)) for k, x in enumerate(rows) for a, b in pairwise(x)]
    outlines, n = [*bricks, rectangle(-1.0, -0.5, 1.8, 0.0)], len(bricks)
    for sense, order in ((1.0, range(n)), (-1.0, range(n)), (1.0, range(n)[::-1]), (1.0, (3, 0, 6, 2, 5, 1, 4))):
        drawn = [np.multiply(outlines[k], [sense, 1.0])[:: int(sense)] for k in (*order, n)]
        assembly = solver.Assembly.from_outlines(drawn, roles=["free"] * n + ["fixed"])
        loads = pushed(assembly, solver.weight_fraction(assembly, (0.5 * sense, 0.47), np.arange(n)))
        found.append(limit_load(assembly, loads=loads, friction_coefficient=0.85, flow="non-associative").multiplier)
    assert found == pytest.approx([found[0]] * 4, rel=1e-6)


def test_what_the_dead_load_brings_down_carries_nothing():
    assembly = solver.Assembly.from_outlines(
        [[[2.4, 0], [4.4, 0], [4.4, 1], [2.4, 1]], GROUND], roles=["free", "fixed"]
    )
    live = solver.weight_fraction(assembly, (1.0, 0.0), np.array([0]))
    limit = limit_load(assembly, loads=pushed(assembly, live))
    assert limit.status is solver.LimitStatus.NO_EQUILIBRIUM
    assert np.isnan(limit.multiplier)
    assert limit.mechanism[0, 2] < 0.0
    # Its weight of 39.24 kN acts 0.4 m beyond the ground.
    assert "1 block falls ('block 0'), and would stand with 1.57e+04 N·m about z at 'block 0';" in str(limit)


def test_an_open_joint_carries_nothing():
    assembly = block(1.0, 2.0)
    turn = -0.01
    # Turned about its lower right corner: the left one is 1 cm above the ground.
    arm = solver.Pose.initial(assembly).positions[0] - [1.0, 0.0]
    turned = [arm[0] * np.cos(turn) - arm[1] * np.sin(turn), arm[0] * np.sin(turn) + arm[1] * np.cos(turn)]
    initial = solver.Pose.initial(assembly)
    pose = solver.Pose(np.array([np.add(turned, [1.0, 0.0]), initial.positions[1]]), np.array([[turn], [0.0]]))
    loads = pushed(assembly, solver.weight_fraction(assembly, (1.0, 0.0), np.array([0])))
    limit = limit_load(assembly, loads=loads, pose=pose)
    assert limit.multiplier == pytest.approx(np.tan(np.arctan(0.5) - 0.01))
    # Let go, it would rock back.
    assert limit.status is solver.LimitStatus.HELD
    assert "held by the live load" in str(limit)
    assert limit_load(assembly, loads=loads).status is solver.LimitStatus.FOUND
    assert len(limit.contacts) == 1
    assert len(limit_load(assembly, loads=loads, pose=pose, closed_gap=0.05).contacts) == 2


@pytest.mark.parametrize("flow", ["associative", "non-associative"])
def test_a_joint_that_is_open_by_less_than_the_displacement_counts_by_its_gap(flow):
    """A brick a hair away from a heavy stop: free of it, it slides at μ; with it, it has to push it by part of δ.

    In the program α = μ + Σ g N / w, and the stop slides at μ of its own weight, which the brick then carries too.
    """
    mu, gap = 0.5, 1e-3
    outlines = [[[0, 0], [1, 0], [1, 0.5], [0, 0.5]], [[1 + gap, 0], [3 + gap, 0], [3 + gap, 0.5], [1 + gap, 0.5]]]
    assembly = solver.Assembly.from_outlines(
        [*outlines, [[-1, -1], [5, -1], [5, 0], [-1, 0]]], roles=["free", "free", "fixed"]
    )
    brick = mechanics.total_weight(assembly) / 3.0
    live = solver.point_load(assembly, 0, (brick, 0.0))
    options = {"loads": pushed(assembly, live), "friction_coefficient": mu, "pose": solver.Pose.initial(assembly)}
    strict = limit_load(assembly, flow=flow, **options)
    assert strict.multiplier == pytest.approx(mu, rel=1e-6)
    # N of the stop costs N · g / (δ · brick); up to 2 μ brick of it gains N / brick: worth it once δ exceeds the gap.
    short = limit_load(assembly, displacement=0.5 * gap, flow=flow, **options)
    assert short.multiplier == pytest.approx(mu, rel=1e-6)
    # A force moves by what its point does, however it turns the block.
    low = pushed(assembly, solver.point_load(assembly, 0, (brick, 0.0), point=(0.5, 0.1)))
    short = limit_load(assembly, displacement=0.75 * gap, flow=flow, **options | {"loads": low})
    assert short.multiplier == pytest.approx(mu, rel=1e-6)
    long = limit_load(assembly, displacement=2.0 * gap, flow=flow, **options)
    assert long.multiplier == pytest.approx(3.0 * mu, rel=1e-6)
    if flow == "associative":
        assert abs(long.gap) < 1e-9
        assert long.certificate.kinematic_violation < 1e-9
    with pytest.raises(ValueError, match=r"displacement is -1 m; it must be a finite number of at least 0"):
        limit_load(assembly, displacement=-1.0, **options)


def test_input_is_refused_with_a_remedy():
    assembly = block()
    dead = solver.self_weight(assembly)
    with pytest.raises(ValueError, match="no live load acts on any free block"):
        limit_load(assembly, loads=dead)
    on_support = np.zeros((2, 3))
    on_support[1, 0] = 1.0
    with pytest.raises(ValueError, match="no live load acts"):
        limit_load(assembly, loads=dataclasses.replace(dead, live=on_support))
    loads = pushed(assembly, solver.point_load(assembly, 0, (1.0, 0.0)))
    with pytest.raises(ValueError, match="'associative' or 'non-associative'"):
        limit_load(assembly, loads=loads, flow="plastic")
    with pytest.raises(ValueError, match="at least one must be free"):
        limit_load(assembly.with_roles(["fixed", "fixed"]), loads=loads)
    sunk = solver.Assembly.from_outlines(
        [[[0, -0.1], [1, -0.1], [1, 1], [0, 1]], GROUND], roles=["free", "fixed"], names=["a", "g"]
    )
    with pytest.raises(ValueError, match=r"\('a'\) overlaps block 1 \('g'\) by 0.1 m"):
        limit_load(sunk, loads=loads)


def test_envelope_of_a_load_that_moves_over_an_arch():
    arch = generators.arch()
    structure = Structure(arch, friction_coefficient=2.0)
    x = np.linspace(-0.9, 0.9, 13)
    envelope = structure.envelope(x, lambda at: solver.load_on_top(arch, at, (0.0, -1000.0)))
    assert envelope.multipliers == pytest.approx(envelope.multipliers[::-1], rel=1e-6)
    assert envelope.multipliers[envelope.worst] == envelope.multipliers.min()
    assert abs(x[envelope.worst]) < 0.7
    with pytest.raises(ValueError, match="at least one number"):
        structure.envelope([], lambda at: structure.loads.dead)


def test_pressure_acts_on_what_it_meets_first():
    wall = solver.Assembly.from_outlines(
        [
            [[0, 0], [2, 0], [2, 1], [0, 1]],
            [[0, 1], [1, 1], [1, 2], [0, 1.5]],
            GROUND,
        ],
        roles=["free", "free", "fixed"],
        thickness=[0.5, 0.5, 0.5],
    )
    down = solver.surface_pressure(wall, 1000.0)
    # Upper block: 1 m in plan; lower block: what the upper one leaves, a metre on the right, 0.5 m off its centroid.
    assert down[0] == pytest.approx([0.0, -500.0, -250.0])
    assert down[1, 1] == pytest.approx(-500.0)
    assert not down[2].any()
    wind = solver.surface_pressure(wall, 1000.0, (1.0, 0.0))
    assert wind[0] == pytest.approx([500.0, 0.0, 0.0])
    assert wind[1, 0] == pytest.approx(500.0)
    only = solver.surface_pressure(wall, 1000.0, blocks=np.array([1]))
    assert not only[0].any()
    assert only[1] == pytest.approx(down[1])


def test_pressure_on_an_edge_pushes_into_the_block():
    assembly = block(2.0, 1.0)
    assert solver.edge_pressure(assembly, 0, 2, 1000.0)[0] == pytest.approx([0.0, -2000.0, 0.0])
    assert solver.edge_pressure(assembly, 0, 1, 1000.0)[0] == pytest.approx([-1000.0, 0.0, 0.0])
    total = sum(solver.edge_pressure(assembly, 0, edge, 1000.0) for edge in range(4))
    assert total == pytest.approx(np.zeros((2, 3)))
    with pytest.raises(ValueError, match="edge 4 is none of them"):
        solver.edge_pressure(assembly, 0, 4, 1.0)


def test_a_load_on_top_stands_on_the_surface():
    assembly = solver.Assembly.from_outlines([[[0, 0], [2, 0], [2, 2], [0, 1]], GROUND], roles=["free", "fixed"])
    load = solver.load_on_top(assembly, 1.5, (10.0, -1.0))
    expected = solver.point_load(assembly, 0, (10.0, -1.0), point=(1.5, 1.75))
    assert load == pytest.approx(expected)
    # At its ends it is above the ground beside it, and above a lower block on its left.
    assert solver.load_on_top(assembly, 2.0) == pytest.approx(
        solver.point_load(assembly, 0, (0.0, -1.0), point=(2.0, 2.0))
    )
    step = [[[-1, 0], [0, 0], [0, 0.5], [-1, 0.5]], [[0, 0], [1, 0], [1, 1], [0, 1]], [[1, 0], [2, 0], [2, 1], [1, 1]]]
    stepped = solver.Assembly.from_outlines([*step, GROUND], roles=["free", "free", "free", "fixed"])
    carry = [np.flatnonzero(solver.load_on_top(stepped, x)[:, 1]).tolist() for x in (-1.0, 0.0, 1.0, 2.0)]
    assert carry == [[0], [1], [1], [2]]
    with pytest.raises(ValueError, match="stands on the support"):
        solver.load_on_top(assembly, 2.5)
    with pytest.raises(ValueError, match="nothing is below"):
        solver.load_on_top(assembly, 9.0)


@pytest.mark.parametrize("flow", ["associative", pytest.param("non-associative", marks=pytest.mark.thorough)])
@pytest.mark.parametrize("dimension", [2, 3])
def test_supports_carry_the_loads_of_the_limit_state(dimension, flow):
    assembly = generators.arch() if dimension == 2 else generators.l_corner(bricks=2, across=2, courses=3)
    loads = pushed(assembly, solver.weight_fraction(assembly, (1.0, 0.0, 0.0)[:dimension]))
    limit = limit_load(assembly, loads=loads, friction_coefficient=0.7, flow=flow)
    free, forces = assembly.free, limit.increment.support_forces
    carried = (loads.dead + limit.multiplier * loads.live)[free]
    weight = float(np.abs(carried).sum())
    assert limit.multiplier > 0.1
    assert not forces[free].any()
    assert forces[:, :dimension].sum(axis=0) == pytest.approx(carried[:, :dimension].sum(axis=0), abs=1e-6 * weight)
    # Moments about the origin.
    beyond = ((0, 0), (0, 3 - dimension))
    arms, pushes = (np.pad(rows[:, :dimension], beyond) for rows in (assembly.centroids, np.vstack([forces, carried])))
    turned = np.cross(arms, pushes[: len(arms)]).sum(axis=0) - np.cross(arms[free], pushes[len(arms) :]).sum(axis=0)
    own = forces[:, dimension:].sum(axis=0) - carried[:, dimension:].sum(axis=0)
    assert turned[-len(own) :] == pytest.approx(-own, abs=1e-6 * weight)


@pytest.mark.parametrize("name", ["closed_gap", "overlap_tolerance", "displacement"])
@pytest.mark.parametrize("value", [np.nan, -1.0])
def test_lengths_that_are_none_are_refused(name, value):
    structure = Structure(block(), friction_coefficient=0.5)
    with pytest.raises(ValueError, match=f"{name} is {value:g}(; give a number| m; it must be .*at least 0)"):
        structure.limit_load(acceleration=(1, 0), **{name: value})


def test_an_acceleration_alone_is_a_load_in_one_call():
    found = limit_load(block(), friction_coefficient=0.5, acceleration=(1, 0))
    assert found.multiplier == pytest.approx(0.5)
    with pytest.raises(ValueError, match="no live load acts on any free block"):
        limit_load(block())


def test_of_equal_positions_the_first_governs():
    """Symmetric places of an arch differ by rounding alone, which is another with other processors."""
    arch = generators.arch()
    structure = solver.Structure(arch, friction_coefficient=2.0)
    x = np.array([-0.4, 0.4, -0.4])
    for places in (x, x[::-1], x[1:], x[1::-1]):
        assert structure.envelope(places, lambda at: solver.force_on_top(arch, at, (0.0, -1000.0))).worst == 0


@pytest.mark.parametrize(
    ("mirrored", "shift"),
    [
        (False, 0.0),
        (True, 1234.5),
        *(pytest.param(*of, marks=pytest.mark.thorough) for of in ((False, 1234.5), (True, 0.0))),
    ],
)
def test_what_locks_by_friction_is_unbounded_however_it_is_described(mirrored, shift):
    """Forces on two stones of a column lie within the friction cone of all joints below."""
    drawn = generators.portal()
    outlines = [drawn.outline(i) * [-1 if mirrored else 1, 1] + [shift, 0.0] for i in range(drawn.n_blocks)]
    assembly = solver.Assembly.from_outlines(outlines, roles=list(drawn.roles))
    live = np.zeros((drawn.n_blocks, 3))
    share = np.array([[0.31132182489449, -1.7939726613146754], [0.30339219459932365, -1.5667741211586759]])
    live[2:4, :2] = assembly.masses[2:4, None] * solver.GRAVITY * share * [-1 if mirrored else 1, 1]
    found = solver.limit_load(
        assembly, loads=pushed(assembly, live), friction_coefficient=0.37225340327463124, flow="non-associative"
    )
    assert found.status is solver.LimitStatus.UNBOUNDED


@pytest.mark.parametrize("mirror", [1, -1])
@pytest.mark.parametrize("in_space", [False, True])
@pytest.mark.parametrize(
    ("stones", "forces", "friction"),
    [
        ([(0, 0, 0.8, 0.2), (0, 0.2, 0.8, 0.7), (-0.1, 0.7, 0.5, 1.4)], [(-800, -5200), (0, 0), (0, 0)], 0.25),
        ([(-0.07, 0, 0.41, 0.33), (0.09, 0.33, 0.8, 0.98)], [(1320, -4440), (-652, -1621)], 0.43),
    ],
)
@pytest.mark.slow
def test_what_locks_slowly_is_unbounded(stones, forces, friction, in_space, mirror):
    """Resultants on every joint of a column are within its friction and its middle third; forces grow by a third."""
    outlines = [rectangle(-1.0, -0.2, 2.0, 0.0), *(rectangle(*stone) for stone in stones)]
    outlines = [(np.array(outline) * [mirror, 1])[::mirror] for outline in outlines]
    roles = ["fixed"] + ["free"] * len(stones)
    assembly = in_either(3 if in_space else 2, outlines, roles=roles)
    live = np.zeros((assembly.n_blocks, 6 if in_space else 3))
    live[1:, [0, 2 if in_space else 1]] = np.array(forces) * [mirror, 1]
    found = solver.limit_load(
        assembly, loads=pushed(assembly, live), friction_coefficient=friction, flow="non-associative"
    )
    assert found.status is solver.LimitStatus.UNBOUNDED


@pytest.mark.parametrize("strength", [1e8, 1e11])
def test_what_locks_and_crushes_has_the_limit_load_of_associative_flow(strength):
    outlines = [rectangle(-1.0, -0.2, 2.0, 0.0), rectangle(0.0, 0.0, 1.0, 0.5), rectangle(0.0, 0.5, 1.0, 1.0)]
    assembly = solver.Assembly.from_outlines(outlines, roles=["fixed", "free", "free"], density=100.0)
    live = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [200.0, -1000.0, 0.0]])
    law = solver.Interfaces(solver.InterfaceLaw(0.6, compressive_strength=strength))
    one, other = (
        solver.limit_load(assembly, loads=pushed(assembly, live), interfaces=law, flow=flow)
        for flow in ("associative", "non-associative")
    )
    assert one.status is other.status is solver.LimitStatus.FOUND
    assert other.multiplier == pytest.approx(one.multiplier, rel=1e-9)


@pytest.mark.parametrize("kind", [Decimal, Fraction, lambda text: np.array(float(text))])
def test_lengths_may_be_decimals_and_fractions(kind):
    """They were checked as numbers, and computed with as they were given."""
    pushing = pushed(block(), solver.weight_fraction(block(), (1.0, 0.0)))
    lengths = {"displacement": "0.01", "closed_gap": "0.001", "overlap_tolerance": "0.001"}
    given = {name: kind(value) for name, value in lengths.items()}
    assert limit_load(block(), loads=pushing, friction_coefficient=0.6, **given).multiplier == pytest.approx(0.6)
