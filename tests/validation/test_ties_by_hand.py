"""Ties, props and bars against statics by hand."""

from functools import partial

import numpy as np
import pytest
from structures import rectangle, upright

import solver
from solver import Tie, mechanics


def _structure(outlines, roles, friction, ties, weight=1000.0):
    """Blocks of a weight per area [N/m²]."""
    assembly = solver.Assembly.from_outlines(outlines, roles=roles, density=weight / solver.GRAVITY)
    return solver.Structure(assembly, friction_coefficient=friction, ties=ties)


def _hung(**kwargs):
    """A block of 1000 N on a support that goes down, on a rope of 1 MN/m."""
    outlines = [rectangle(0, 0, 1, 0.2), rectangle(0, 0.2, 1, 1.2)]
    rope = Tie("rope", (1, None), ((0.5, 1.0), (0.5, 3.0)), 1e6, **kwargs)
    return _structure(outlines, ["moving", "free"], 0.6, [rope])


def _settled(structure, limit=0.002, direction=(0, -1)):
    return structure.settle(solver.Settlement(direction, increment=0.0005, limit=limit))


def test_a_rope_takes_what_its_elongation_says_until_the_block_hangs():
    response = _settled(_hung())
    force = np.array([i.ties.forces[0] for i in response.increments])
    np.testing.assert_allclose(force, [0.0, 500.0, 1000.0, 1000.0, 1000.0], atol=1.0)
    np.testing.assert_allclose(response.reaction + force, 1000.0, rtol=1e-5)
    assert response.increments[-1].ties.elongations[0] == pytest.approx(0.001, rel=1e-4)


@pytest.mark.parametrize("space", [False, True])
@pytest.mark.parametrize("direction", [(0.0, -1.0), (0.3, -1.0)])
@pytest.mark.slow
def test_what_its_support_has_left_hangs_on_its_ties(space, direction):
    """A lintel of 1000 N whose ropes are 0.7 and 0.5 m from its middle; they turn with it, as pendulums do."""
    ends = [((x, 0.5), (x, 1.5)) for x in (0.3, 1.5)]
    outlines, roles = [rectangle(0, 0, 2, 0.5), rectangle(0, -0.2, 2, 0)], ["free", "moving"]
    if space:
        direction = (direction[0], 0.0, direction[1])
        ends = [tuple((x, 0.2, z) for x, z in both) for both in ends]
        solids = [upright(outline, 0.0, 0.4) for outline in outlines]
        assembly = solver.Assembly.from_solids(solids, roles=roles, density=2500.0 / solver.GRAVITY)
    else:
        assembly = solver.Assembly.from_outlines(outlines, roles=roles, density=1000.0 / solver.GRAVITY)
    ropes = [Tie(f"rope {k}", (0, None), both, 1e6) for k, both in enumerate(ends)]
    structure = solver.Structure(assembly, friction_coefficient=0.6, ties=ropes)
    response = structure.settle(solver.Settlement(direction, increment=0.001, limit=0.004))
    assert response.stop == solver.Status.LIMIT_REACHED
    np.testing.assert_allclose(response.increments[-1].ties.forces, [1000 * 0.5 / 1.2, 1000 * 0.7 / 1.2], rtol=2e-3)
    assert response.reaction[-1] == pytest.approx(0.0, abs=1e-3)


@pytest.mark.thorough
def test_a_rope_that_yields_leaves_the_rest_to_the_support_and_one_that_breaks_all_of_it():
    yielding, brittle = _settled(_hung(strength=600.0)), _settled(_hung(strength=600.0, brittle=True))
    assert yielding.reaction[-1] == pytest.approx(400.0, rel=1e-4)
    assert yielding.increments[-1].ties.elongations[0] == pytest.approx(0.002, rel=1e-4)
    assert brittle.reaction[-1] == pytest.approx(1000.0, rel=1e-4)
    assert np.isnan(brittle.increments[-1].ties.rest[0])


@pytest.mark.slow
def test_a_rope_that_has_yielded_is_as_long_as_it_gave_when_it_is_loaded_again():
    phases = [solver.Settlement((0, -s), increment=0.0005, limit=0.001) for s in (1, -1, 1)]
    first, back, again = (
        [i for i in _hung(strength=600.0).settle(phases).increments if i.phase == k][-1] for k in range(3)
    )
    assert first.ties.forces[0] == pytest.approx(600.0, rel=1e-4)
    assert back.ties.forces[0] == pytest.approx(0.0, abs=1.0)
    # It gave 0.4 mm for good, so that 1 mm are 0.6 mm again.
    assert again.ties.rest[0] == pytest.approx(2.0 + 0.0004, abs=2e-6)
    assert again.ties.forces[0] == pytest.approx(600.0, rel=1e-3)


@pytest.mark.thorough
def test_prestress_is_there_from_the_start_and_a_prop_carries_no_tension():
    assert _settled(_hung(prestress=200.0)).reaction[0] == pytest.approx(800.0, rel=1e-4)
    np.testing.assert_allclose(_settled(_hung(kind="prop")).reaction, 1000.0, rtol=1e-6)


def _rafters(ties, friction=0.1):
    """Two blocks that lean on each other, their feet on supports of which the right one moves out."""
    left = np.array([[0, 0.3], [0.5, 0.3], [2, 1.8], [2, 2.3]])
    foot = np.array(rectangle(-0.5, 0, 1, 0.3))
    mirrored = [np.column_stack([4 - p[:, 0], p[:, 1]])[::-1] for p in (foot, left)]
    return _structure([foot, mirrored[0], left, mirrored[1]], ["fixed", "moving", "free", "free"], friction, ties)


def _thrust(structure, increment):
    """Thrust by hand: moments about the ridge, of half the structure, its foot where it stands on an edge."""
    contacts, weight = increment.contacts, structure.assembly.masses[2] * solver.GRAVITY
    foot = np.isin(contacts.block_a, (0, 2)) & np.isin(contacts.block_b, (0, 2))
    ridge = np.isin(contacts.block_a, (2, 3)) & np.isin(contacts.block_b, (2, 3))
    normal = increment.forces[:, 0]
    x_foot, y_foot = np.average(contacts.points[foot], axis=0, weights=normal[foot])
    x, y = np.average(contacts.points[ridge], axis=0, weights=normal[ridge])
    x_centre = increment.pose.positions[2, 0]
    return weight * ((x - x_foot) - (x - x_centre)), x, y, y_foot


def test_a_tie_between_the_feet_of_two_rafters_and_friction_share_their_thrust():
    tie = Tie("tie", (2, 3), ((0.25, 0.35), (3.75, 0.35)), 1e7)
    structure = _rafters([tie])
    weight = structure.assembly.masses[2] * solver.GRAVITY
    last = structure.settle(solver.Settlement((1, 0), increment=0.05, limit=0.05)).increments[-1]
    moment, _, y, y_foot = _thrust(structure, last)
    # The foot slides outwards no more: friction pulls it in by as much as the supports drag, 0.1 W.
    y_tie = last.ties.ends[0, 0, 1]
    friction = -0.1 * weight
    expected = (moment - friction * (y - y_foot)) / (y - y_tie)
    assert last.ties.forces[0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.slow
def test_rafters_fall_where_their_thrust_exceeds_what_tie_and_friction_hold():
    tie = Tie("tie", (2, 3), ((0.25, 0.35), (3.75, 0.35)), 1e7, strength=200.0)
    structure = _rafters([tie])
    weight = structure.assembly.masses[2] * solver.GRAVITY
    response = structure.settle(solver.Settlement((1, 0), increment=0.02, limit=0.15))
    assert response.collapse is not None
    last = response.path[-1]
    moment, _, y, y_foot = _thrust(structure, last)
    y_tie = last.ties.ends[0, 0, 1]
    assert 200.0 * (y - y_tie) + 0.1 * weight * (y - y_foot) == pytest.approx(moment, rel=2e-3)
    without = _rafters([]).settle(solver.Settlement((1, 0), increment=0.02, limit=0.15))
    assert without.stop == solver.Status.NO_INITIAL_EQUILIBRIUM


def test_a_leaning_block_is_held_by_a_prop_with_the_force_of_its_geometry():
    angle = np.radians(20.0)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    # It leans to the left, on its lower left corner, and friction keeps it from sliding.
    block = np.array(rectangle(0, 0, 0.5, 2)) @ turn.T
    floor = rectangle(-1, -1, 1, 0)
    top = turn @ np.array([0.0, 1.5])
    prop = Tie("prop", (1, None), (tuple(top), (top[0] - 1.0, 0.0)), 1e8, kind="prop")
    structure = _structure([floor, block], ["moving", "free"], 2.0, [prop])
    first = structure.settle(solver.Settlement((0, -1), increment=1e-5, limit=1e-5)).increments[0]
    pose, end = first.pose, first.ties.ends[0]
    along = (end[1] - end[0]) / np.linalg.norm(end[1] - end[0])
    corner = first.contacts.points[np.argmax(first.forces[:, 0])]
    weight = structure.assembly.masses[1] * solver.GRAVITY
    arm = end[0] - corner
    by_prop = -(arm[0] * along[1] - arm[1] * along[0])
    by_hand = weight * (pose.positions[1, 0] - corner[0]) / by_prop
    assert -first.ties.forces[0] == pytest.approx(by_hand, rel=1e-5)
    assert -first.ties.forces[0] > 0.05 * weight


@pytest.mark.thorough
def test_a_tie_adds_its_strength_times_its_arm_to_the_acceleration_that_overturns():
    for strength in (500.0, 250.0):
        tie = Tie("tie", (1, None), ((0, 2.5), (-2, 2.5)), 1e6, strength=strength)
        structure = _structure([rectangle(-2, -0.2, 3, 0), rectangle(0, 0, 1, 3)], ["fixed", "free"], 2.0, [tie])
        found = structure.limit_load(acceleration=(1, 0))
        assert found.multiplier == pytest.approx((3000.0 * 0.5 + strength * 2.5) / (3000.0 * 1.5), rel=1e-9)
        assert found.state.ties.forces[0] == pytest.approx(strength)
        pushed = structure.with_live(acceleration=(1, 0)).pushover(
            solver.ControlDisplacement("block 1", increment=0.05, limit=0.1)
        )
        # By then it yields, and the block has turned a little.
        assert pushed.increments[1].ties.forces[0] == pytest.approx(strength, rel=1e-3)
        assert found.multiplier - 0.05 < pushed.increments[1].load_multiplier < found.multiplier


@pytest.mark.thorough
@pytest.mark.parametrize("flow", [pytest.param("associative", marks=pytest.mark.thorough), "non-associative"])
def test_what_a_settlement_has_left_slack_carries_within_the_displacement_only(flow):
    """A block with a prop behind it, whose buttress has moved away by 0.1 m."""
    outlines = [rectangle(-1, -0.5, 1, 0), rectangle(0, 0, 0.4, 1.2), rectangle(1.2, -0.5, 2, 1.5)]
    prop = Tie("prop", (1, 2), ((0.4, 1.0), (1.2, 1.0)), 1e7, kind="prop", strength=100.0)
    structure = _structure(outlines, ["fixed", "free", "moving"], 2.0, [prop])
    end = structure.settle(solver.Settlement((1, 0), increment=0.1, limit=0.1)).path[-1]
    load = partial(structure.limit_load, acceleration=(1, 0), flow=flow)
    bare, held = (pytest.approx((0.2 * 480.0 + held) / (480.0 * 0.6), rel=1e-9) for held in (0.0, 100.0))
    assert load().multiplier == held
    # It is worth S h / (W h / 2) of the load, and costs S g / (W δ): from a displacement δ of 0.06 m on it is reached.
    for displacement in (0.0, 0.059):
        found = load(pose=end.pose, ties_at=end.ties, displacement=displacement)
        assert (found.multiplier, found.state.ties.states.tolist()) == (bare, [mechanics.SLACK])
        assert found.state.ties.elongations == pytest.approx([0.1])
    assert load(pose=end.pose, ties_at=end.ties, displacement=0.061).multiplier == held


def test_a_bar_is_never_slack():
    bar = Tie("bar", (1, None), ((0, 1.0), (-1, 1.0)), 1e4, kind="bar", strength=100.0)
    structure = _structure([rectangle(-1, -0.5, 1, 0), rectangle(0, 0, 0.4, 1.2)], ["moving", "free"], 2.0, [bar])
    for way in (1, -1):
        end = structure.settle(solver.Settlement((way, 0), increment=5e-3, limit=5e-3)).path[-1]
        assert end.ties.forces == pytest.approx([way * 50.0], rel=1e-3)
        found = structure.limit_load(acceleration=(1, 0), pose=end.pose, ties_at=end.ties)
        assert found.multiplier == pytest.approx((0.2 * 480.0 + 100.0) / (480.0 * 0.6), rel=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"stiffness": -1.0}, "must be positive"),
        ({"strength": -1.0}, "must be positive"),
        ({"kind": "rope"}, "kinds are tie, prop, bar"),
        ({"points": ((0.5, 1.0), (0.5, 1.0))}, "has no length"),
        ({"blocks": (1, 1)}, "both ends in block 1"),
        ({"prestress": 5.0, "strength": 4.0}, "below its strength"),
        ({"blocks": (1, 7)}, "block 7"),
        ({"phase": 2}, "1 settlements"),
    ],
)
def test_impossible_ties_are_refused_in_a_line_that_names_them(change, words):
    given = {"name": "rope", "blocks": (1, None), "points": ((0.5, 1.0), (0.5, 3.0)), "stiffness": 1e6} | change
    with pytest.raises(ValueError, match=words) as refused:
        _settled(
            _structure([rectangle(0, 0, 1, 0.2), rectangle(0, 0.2, 1, 1.2)], ["moving", "free"], 0.6, [Tie(**given)])
        )
    assert "rope" in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("stiffness", [2e5, 3e5, 4e5])
@pytest.mark.slow
def test_a_wall_that_hangs_on_its_tie_is_pushed_back_and_over(stiffness):
    """It hinges where it carries no live load before the tie gives: whether that was below zero was rounding."""
    outlines = [rectangle(0.0, 0.0, 0.8, 6.0), rectangle(-3.0, -0.5, 3.0, 0.0)]
    assembly = solver.Assembly.from_outlines(outlines, names=["wall", "ground"], roles=["free", "moving"])
    anchor = np.array([4.8, 5.0])
    tie = solver.Tie("rod", (0, None), ((0.8, 5.0), anchor), stiffness=stiffness, strength=20e3, prestress=5e3)
    structure = solver.Structure(assembly, friction_coefficient=0.7, ties=[tie])
    turning = solver.Settlement(rotation_centre=(0.0, 0.0), rotation=1.0, increment=0.02, limit=0.02)
    hanging = structure.settle(turning).path[-1]
    control = solver.ControlDisplacement("wall", (-1.0, 0.0), increment=0.3, limit=0.3)
    pushed = structure.with_live(acceleration=(-1.0, 0.0))
    path = pushed.pushover(control, pose=hanging.pose, ties_at=hanging.ties).path
    start, end = path[0], path[-1]
    assert start.load_multiplier == pytest.approx(0.0, abs=1e-6)
    assert start.ties.forces[0] == pytest.approx(hanging.ties.forces[0], rel=1e-5)
    # About the left toe, which has not moved, under its weight and the tie that yields.
    lean = float(end.pose.rotations[0, 0])
    turn = np.array([[np.cos(lean), -np.sin(lean)], [np.sin(lean), np.cos(lean)]])
    centroid, held = turn @ [0.4, 3.0], turn @ [0.8, 5.0]
    pull = 20e3 * (anchor - held) / np.linalg.norm(anchor - held)
    weight = assembly.masses[0] * solver.GRAVITY
    stays = weight * centroid[0] + held[1] * pull[0] - held[0] * pull[1]
    assert end.load_multiplier == pytest.approx(stays / (weight * centroid[1]), rel=1e-5)
