"""Table B of the reference values: structures of a few blocks whose whole path has a closed form.

Reference: statics and three-hinge kinematics by hand, in the docstring of each test.
"""

import numpy as np
import pytest
from structures import rectangle

import solver
from blockvis import generators
from solver import mechanics

pytestmark = pytest.mark.path


def settle(outlines, roles, settlement, friction_coefficient, **controls):
    return solver.settle(
        solver.Assembly.from_outlines(outlines, roles=roles),
        settlement,
        friction_coefficient=friction_coefficient,
        controls=solver.Controls(falling_frames=0, **controls),
    )


def flat_arch(height, friction_coefficient=3.0, **controls):
    """Two blocks 1 × height side by side between vertical abutments, the right one moving out."""
    outlines = [
        rectangle(0, 0, 1, height),
        rectangle(1, 0, 2, height),
        rectangle(-1, -1, 0, height + 1),
        rectangle(2, -1, 3, height + 1),
    ]
    spread = solver.Settlement(direction=(1, 0), increment=0.01)
    return settle(outlines, ["free", "free", "fixed", "moving"], spread, friction_coefficient, **controls)


@pytest.mark.parametrize("height", [0.25, pytest.param(0.5, marks=pytest.mark.thorough)])
@pytest.mark.parametrize("friction_coefficient", [1.001, pytest.param(3.0, marks=pytest.mark.thorough)])
def test_flat_arch(height, friction_coefficient):
    """Hinges at the lower corners of the abutments and the upper corner of the middle joint.

    Rise r = √(a² + h² - (a + d/2)²), thrust W_block (a + d/2) / (2 r), collapse where the rise is used up,
    d = 2 (√(a² + h²) - a). Friction is not used up as long as μ ≥ 2 h / a at the start and grows with the thrust.
    """
    response = flat_arch(height, friction_coefficient)
    span = np.hypot(1.0, height)
    exact = 2 * (span - 1)
    assert response.stop is solver.Status.COLLAPSED
    # Where friction only just suffices it lags the thrust, which grows without bound: 1.7e-3 of the collapse, with a
    # quarter of the step tolerance 1.0e-3. Otherwise joints give under a thrust without limit.
    lag = (2e-3 if friction_coefficient < 2.0 else 2.5e-4) * exact
    assert response.collapse.displacement == pytest.approx(exact, abs=max(1e-3 * exact, lag))
    low, high = response.collapse.bracket
    # Just before the snap blocks move a hundred times as fast as the support, and the viscosity holds them a little.
    assert low - 2e-5 <= exact <= high + lag
    assert high - low <= 1e-4
    half = 1 + response.settlement / 2
    rise = np.sqrt(span**2 - half**2)
    thrust = response.total_weight / 2 * half / (2 * rise)
    assert response.initial_reaction == pytest.approx(thrust[0], rel=1e-6)
    # The thrust grows without limit: what the joints give under it lowers a rise of a hundredth by 4e-6.
    # At a height of 0.5 friction of 1.001 is a thousandth more than is needed at the start: bounds that follow lack it.
    scarce = friction_coefficient < 2.0 and height == 0.5
    high_enough = rise > (0.2 if scarce else 0.01)
    high_enough[0] = False  # at rest
    assert response.reaction[high_enough] == pytest.approx(thrust[high_enough], rel=1e-2 if scarce else 5e-4)


#: Width, height, μ.
BLOCKS = [(1, 2, 0.7), (1, 1, 0.4), (0.4, 2, 0.6), (1, 1, 0.99), (1, 1, 1.01)]


@pytest.mark.parametrize(
    ("width", "height", "friction_coefficient", "sense"),
    [
        *((1, 2, 0.7, 1), (1, 1, 0.4, -1)),
        *(
            pytest.param(*block, sense, marks=pytest.mark.thorough)
            for block in BLOCKS
            for sense in (1, -1)
            if (*block, sense) not in ((1, 2, 0.7, 1), (1, 1, 0.4, -1))
        ),
    ],
)
@pytest.mark.slow
def test_block_on_a_tilting_support(width, height, friction_coefficient, sense):
    """Overturns or slides at θ = atan(min(μ, b/h)), wherever the support turns about."""
    turn = solver.Settlement(rotation_centre=(0.3, -0.5), rotation=sense, increment=0.02, limit=1, tolerance=1e-5)
    outlines = [rectangle(0, 0, width, height), rectangle(-1, -1, width + 1, 0)]
    response = settle(outlines, ["free", "moving"], turn, friction_coefficient)
    exact = np.arctan(min(friction_coefficient, width / height))
    assert response.stop is solver.Status.COLLAPSED
    assert response.collapse.displacement == pytest.approx(exact, abs=2e-5)
    assert response.collapse.unit == "rad"
    # Nothing moves on the support before: the reaction is the moment of the weight about the turning point.
    lever = _lever(response, width, height, sense)
    # The block creeps by half a ten-thousandth of its size in the first increment, see below.
    assert response.reaction == pytest.approx(-sense * response.total_weight * lever, abs=1e-4 * response.total_weight)


def _lever(response, width, height, sense):
    centroid = np.array([width / 2 - 0.3, height / 2 + 0.5])
    theta = sense * response.settlement
    return centroid[0] * np.cos(theta) - centroid[1] * np.sin(theta)


def test_block_that_sticks_does_not_creep():
    turn = solver.Settlement(rotation_centre=(0.3, -0.5), rotation=1, increment=0.02, limit=0.1)
    response = settle([rectangle(0, 0, 1, 1), rectangle(-1, -1, 2, 0)], ["free", "moving"], turn, 0.4)
    lever = _lever(response, 1, 1, 1)
    assert response.reaction == pytest.approx(-response.total_weight * lever, rel=1e-5)


@pytest.mark.parametrize(
    ("blocks", "friction_coefficient"),
    [(4, 0.45), *(pytest.param(*stack, marks=pytest.mark.thorough) for stack in ((2, 0.9), (4, 0.7), (6, 0.5)))],
)
@pytest.mark.slow
def test_stack_on_a_tilting_support(blocks, friction_coefficient):
    """A stack of n blocks b × h overturns as one, or slides, at θ = atan(min(μ, b/(n h)))."""
    turn = solver.Settlement(rotation_centre=(0.3, -0.5), rotation=-1, increment=0.02, limit=1, tolerance=1e-5)
    outlines = [rectangle(0, 0.5 * i, 1, 0.5 * i + 0.5) for i in range(blocks)] + [rectangle(-1, -1, 2, 0)]
    response = settle(outlines, ["free"] * blocks + ["moving"], turn, friction_coefficient)
    exact = np.arctan(min(friction_coefficient, 1 / (blocks * 0.5)))
    assert response.collapse.displacement == pytest.approx(exact, abs=2e-5)


#: Where the slip of the lintel moves from its right bearing to its left, and where it loses the left, in m.
CHANGE, END = 0.465431629, 1.80461259


@pytest.mark.thorough
def test_a_lintel_turns_slips_and_loses_its_left_bearing():
    """Lintel 4 × 0.5 on two piers, 0.4 on the left one, whose inner face is undercut; the right one sinks.

    V_right/W = 1 - L/(2 c) while it turns about the corner of the left pier; it slips on the right first.
    """
    outlines = [rectangle(0, 0, 4, 0.5), [[-1, -0.3], [0.4, 0], [-1, 0]], rectangle(3.5, -4, 6, 0)]
    sink = solver.Settlement(direction=(0, -1), increment=0.1, limit=2.5, stops=(CHANGE,))
    lintel = settle(outlines, ["free", "fixed", "moving"], sink, 0.6)
    assert lintel.initial_reaction / lintel.total_weight == pytest.approx(1 - 4 / (2 * 3.6), abs=1e-6)
    before, after = lintel.settlement < CHANGE * (1.0 - 1e-9), lintel.settlement > CHANGE * (1.0 + 1e-9)
    left = np.array([slides(i, 1) for i in lintel.path])
    right = np.array([slides(i, 2) for i in lintel.path])
    # At the very start the lintel merely turns and slips to second order; the last place is at the verge.
    assert not left[before].any()
    assert right[before][1:].all()
    assert left[after][:-1].all()
    assert not right[after][:-1].any()
    at_change = np.interp(CHANGE, lintel.settlement, lintel.reaction / lintel.total_weight)
    assert at_change == pytest.approx(0.420596, rel=1e-3)
    assert lintel.stop is solver.Status.COLLAPSED
    assert lintel.collapse.displacement == pytest.approx(END, rel=1e-3)
    # On the last hundredth of a millimetre its corner stands on the pier, and bears upright.
    assert lintel.path[-2].reaction / lintel.total_weight == pytest.approx(0.513778, abs=1e-3)


def slides(increment, support):
    """Whether the lintel slides on a support, by its velocity there and not by its forces."""
    contacts = increment.contacts
    here = (contacts.block_a == support) | (contacts.block_b == support)
    carrying = here & (increment.forces[:, 0] > 0)
    return np.abs(increment.displacements[carrying, 1]).max(initial=0.0) > 1e-3


@pytest.mark.thorough
@pytest.mark.parametrize(
    "direction",
    [(0.6, -0.8), *(pytest.param(d, marks=pytest.mark.thorough) for d in ((0, -1), (1, 0)))],
)
def test_stack_that_only_travels(direction):
    """No relative motion but the give of the joints while the stack gets going, base reaction (0, W), no collapse."""
    outlines = [rectangle(0, 0.5 * i, 1, 0.5 * i + 0.5) for i in range(4)] + [rectangle(-1, -1, 2, 0)]
    travel = solver.Settlement(direction=direction, increment=0.2, limit=3)
    response = settle(outlines, ["free"] * 4 + ["moving"], travel, 0.7)
    assert response.stop is solver.Status.LIMIT_REACHED
    assert response.path[-1].settlement == pytest.approx(3, rel=1e-12)
    for increment in response.path:
        moved = increment.pose.displacements(response.assembly)
        assert np.abs(moved - increment.settlement * np.array([*direction, 0])).max() < 5e-7
        force = increment.support_forces[4, :2] / response.total_weight
        assert force == pytest.approx([0, -1], abs=2e-8)


def keystone(half_angle, friction_coefficient, direction, increment=0.01, **controls):
    """A keystone between side blocks that are the supports, joints at ``half_angle`` from the vertical."""
    slope = np.tan(half_angle)

    def side(sense):
        near, far, top = 0.5 - 0.6 * slope, 1.5 + 1.6 * slope, 0.5 + 1.6 * slope
        return [[sense * near, -0.6], [sense * far, -0.6], [sense * far, 1.6], [sense * top, 1.6]]

    key = [[-0.5, 0], [0.5, 0], [0.5 + slope, 1], [-0.5 - slope, 1]]
    move = solver.Settlement(direction=direction, increment=increment, limit=0.1)
    response = settle([key, side(-1), side(1)], ["free", "fixed", "moving"], move, friction_coefficient, **controls)
    sunk = -response.path[-1].pose.displacements(response.assembly)[0, 1]
    return response, sunk


#: Half angle [degrees], μ, H/W while the supports spread.
KEYSTONES = [(20, 0.3, 0.6708199), (30, 0.3, 0.4711886), (15, 0.6, 0.4834560)]


@pytest.mark.parametrize(("degrees", "friction_coefficient", "thrust"), KEYSTONES)
@pytest.mark.parametrize("increment", [0.01, 0.05])
@pytest.mark.slow
def test_keystone_between_spreading_supports(degrees, friction_coefficient, thrust, increment):
    """Slides down at H = (W/2) cot(β + φ), constant, and sinks d/(2 tan β): Coulomb friction, no dilation."""
    beta, phi = np.radians(degrees), np.arctan(friction_coefficient)
    response, sunk = keystone(beta, friction_coefficient, (1, 0), increment)
    assert response.stop is solver.Status.LIMIT_REACHED
    ours = response.reaction / response.total_weight
    assert response.initial_reaction / response.total_weight == pytest.approx(thrust, abs=1e-6)
    # The friction bounds follow the normal force within the step tolerance.
    assert ours[1:] == pytest.approx(np.full(len(ours) - 1, thrust), rel=2e-3)
    assert thrust == pytest.approx(0.5 / np.tan(beta + phi), abs=1e-7)
    assert sunk == pytest.approx(0.1 / (2 * np.tan(beta)), rel=0.01)
    # Far from what associated flow without gap correction would give.
    assert abs(sunk / (0.1 / (2 * np.tan(beta + phi))) - 1) > 0.3


@pytest.mark.parametrize(
    ("degrees", "friction_coefficient"), [pytest.param(20, 0.3, marks=pytest.mark.thorough), (30, 0.3)]
)
@pytest.mark.slow
def test_keystone_between_approaching_supports(degrees, friction_coefficient):
    """Slides up at (W/2) cot(β - φ) where β > φ, once friction has followed the thrust that it makes grow."""
    beta, phi = np.radians(degrees), np.arctan(friction_coefficient)
    response, sunk = keystone(beta, friction_coefficient, (-1, 0), step_tolerance=2e-4)
    assert response.stop is solver.Status.LIMIT_REACHED
    ours, exact = response.reaction / response.total_weight, -0.5 / np.tan(beta - phi)
    assert (np.diff(ours) <= 1e-6).all()
    assert ours[-1] == pytest.approx(exact, rel=0.03)
    assert response.path[0].least / response.total_weight == pytest.approx(exact, rel=1e-6)
    assert sunk == pytest.approx(-0.1 / (2 * np.tan(beta)), rel=0.01)


@pytest.mark.parametrize(
    ("degrees", "friction_coefficient"), [(15, 0.6), pytest.param(10, 0.3, marks=pytest.mark.thorough)]
)
def test_keystone_locked_between_approaching_supports(degrees, friction_coefficient):
    response, sunk = keystone(np.radians(degrees), friction_coefficient, (-1, 0))
    assert response.stop is solver.Status.LOCKED
    assert "block 0" in response.message
    assert response.collapse is None
    assert sunk == pytest.approx(0, abs=1e-8)


@pytest.mark.parametrize(
    ("friction_coefficient", "clearance", "limit"),
    [
        (0.2, 1e-3, 2.0),
        (0.6, 1e-6, 0.6),
        pytest.param(0.6, 0.0, 0.6, marks=pytest.mark.thorough),
        pytest.param(1.2, 1e-2, 0.6, marks=pytest.mark.thorough),
    ],
)
@pytest.mark.slow
def test_brick_in_a_tray_that_turns(friction_coefficient, clearance, limit):
    """Brick between the walls of its support: it turns with it, and slides out along a wall at 90° + atan μ."""
    brick, tray = rectangle(0, 0, 1, 1), rectangle(-1, -1, 2, 2).tolist()
    left, right = -clearance, 1 + clearance
    tray[3:3] = [[right, 2], [right, 0], [left, 0], [left, 2]]
    slides_out = np.pi / 2.0 + np.arctan(friction_coefficient)
    turn = solver.Settlement(rotation_centre=(0.5, 0), rotation=1.0, increment=0.2, limit=limit)
    response = settle([brick, tray], ["free", "moving"], turn, friction_coefficient)
    if limit > slides_out:
        low, high = response.collapse.bracket
        assert low <= slides_out <= high
        assert high - low <= 0.002 + 1e-9
    else:
        assert response.stop is solver.Status.LIMIT_REACHED
        assert response.settlement == pytest.approx([0.0, 0.2, 0.4, 0.6])
    turned = [increment.pose.rotations[0, 0] for increment in response.path]
    assert turned == pytest.approx(response.settlement, abs=1.5 * clearance + 1e-5)
    # Walls that only hold the brick do not squeeze it.
    weight = mechanics.total_weight(response.assembly)
    assert max(increment.forces[:, 0].max() for increment in response.path) < 2.0 * weight


@pytest.mark.slow
@pytest.mark.parametrize("increment", [0.02, 0.01])
def test_a_block_on_a_corner_and_a_support_that_moves_off_turns_by_their_hinges(increment):
    """Its right face slides on the corner of the moving support, with a snap as that passes the block's own corner."""
    outlines = [rectangle(3, 0, 5, 1), rectangle(2.2, -4, 3.8, 0), rectangle(4.4, -4, 6.5, 0)]
    assembly = solver.Assembly.from_outlines(outlines, roles=["free", "fixed", "moving"])
    motion = solver.Settlement((1, 0), increment=increment, limit=0.66)
    response = solver.Structure(assembly, friction_coefficient=0.6).settle(motion)
    turned = [abs(float(i.pose.rotations[0, 0])) for i in response.path if i.parameter > 0.63]
    by_hand = np.arccos(1.2 / (0.6 + response.settlement[response.settlement > 0.63]))
    assert turned == pytest.approx(by_hand.tolist(), rel=0.02)


@pytest.mark.thorough
@pytest.mark.parametrize("stones", [5, pytest.param(25, marks=pytest.mark.thorough)])
def test_a_column_that_tips_is_one_body_about_one_hinge(stones):
    """It overturns at atan(b/h), however many stones it has and whatever its joints give."""
    column = generators.column(blocks=stones, width=1.0, block_height=10.0 / stones)
    turn = solver.Settlement(rotation_centre=(0.5, 0.0), rotation=1, increment=0.02, limit=0.5)
    response = solver.settle(column, turn, friction_coefficient=0.6, controls=solver.Controls(falling_frames=0))
    assert response.collapse.displacement == pytest.approx(np.arctan(0.1), rel=1e-3)
    assert "1 macro-block; hinge at block 1 | ground" in str(response.collapse)
