"""Mortar along a path, and ground that gives: what statics says by hand of the point model."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from structures import box, brick, rectangle, wall

import solver
from blockvis import generators
from solver import mechanics

WIDTH, HEIGHT, THICKNESS = 0.25, 0.125, 0.1


def held(shapes, roles, law, dry=("support",), limit=0.002, increment=0.001, **settle):
    """Blocks whose joints with supports named in ``dry`` have no mortar, through a settlement."""
    materials = ["support" if role == "moving" else "stone" for role in roles]
    assembly = solver.Assembly.from_outlines(shapes, roles=roles, materials=materials, thickness=THICKNESS)
    pairs = {(name, "stone"): solver.InterfaceLaw(law.friction_coefficient) for name in dry}
    structure = solver.Structure(assembly, solver.Interfaces(law, pairs))
    settlement = solver.Settlement(direction=(0.0, -1.0), increment=increment, limit=limit)
    return structure.settle(settlement, **settle), mechanics.total_weight(assembly)


def holds(increment):
    """The increment proves itself."""
    c = increment.certificate
    return max(c.equilibrium_residual, c.friction_excess, c.carrying_gap, c.largest_penetration) < 1e-6


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_a_block_between_two_others_hangs_by_their_cohesion(share):
    """W = 2 c A: below it slips and rests on the support again; above it stays when the support goes."""
    area, weight = HEIGHT * THICKNESS, 61.3125
    law = solver.InterfaceLaw(0.6, share * weight / (2.0 * area))
    shapes = [
        rectangle(-0.2, 0.0, 0.0, HEIGHT),
        rectangle(0.0, 0.0, WIDTH, HEIGHT),
        rectangle(WIDTH, 0.0, WIDTH + 0.2, HEIGHT),
        rectangle(0.05, -0.1, WIDTH - 0.05, 0.0),
    ]
    response, total = held(shapes, ["fixed", "free", "fixed", "moving"], law)
    assert total == pytest.approx(weight)
    last = response.increments[-1]
    # What is left of a thrust between the two holds it by friction.
    assert last.reaction == pytest.approx(0.0 if share > 1.0 else weight, abs=(1e-5 if share > 1.0 else 1e-2) * weight)
    assert holds(last)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.98, 1.02])
@pytest.mark.parametrize("bed", [WIDTH, 0.05])
def test_a_block_hangs_by_the_tension_of_its_bed(share, bed):
    """W = t A, on a centred bed joint above it; faces that part by 5 degrees beside a smaller one have no mortar."""
    low, high = (WIDTH - bed) / 2.0, (WIDTH + bed) / 2.0
    fall = 0.09 * low
    block = [(0.0, 0.0), (WIDTH, 0.0), (WIDTH, HEIGHT - fall), (high, HEIGHT), (low, HEIGHT), (0.0, HEIGHT - fall)]
    shapes = [
        rectangle(0.0, HEIGHT, WIDTH, 0.3),
        block if fall else rectangle(0.0, 0.0, WIDTH, HEIGHT),
        rectangle(0.05, -0.1, WIDTH - 0.05, 0.0),
    ]
    weight = mechanics.total_weight(solver.Assembly.from_outlines(shapes[1:2], thickness=THICKNESS))
    strength = share * weight / (bed * THICKNESS)
    response, _ = held(
        shapes, ["fixed", "free", "moving"], solver.InterfaceLaw(0.6, strength, tensile_strength=strength)
    )
    last = response.increments[-1]
    assert last.reaction == pytest.approx(0.0 if share > 1.0 else weight, abs=1e-5 * weight)
    assert holds(last)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.98, 1.02])
def test_a_block_glued_to_a_wall_opens_at_its_upper_edge(share):
    """W b/2 = (t A / 2) h about the lower end of the joint, whose upper half hangs on its end."""
    weight = 61.3125
    strength = share * weight * WIDTH / (HEIGHT * HEIGHT * THICKNESS)
    law = solver.InterfaceLaw(0.6, 3.0 * strength, tensile_strength=strength)
    shapes = [
        rectangle(-0.3, 0.0, 0.0, HEIGHT),
        rectangle(0.0, 0.0, WIDTH, HEIGHT),
        rectangle(0.1, -0.1, WIDTH + 0.1, 0.0),
    ]
    response, _ = held(shapes, ["fixed", "free", "moving"], law)
    reaction = response.increments[-1].reaction
    if share > 1.0:
        assert reaction == pytest.approx(0.0, abs=1e-5 * weight)
    else:
        # It turns about the lower end of the joint, and lies on the support with its far corner.
        assert reaction == pytest.approx(weight / 2.0, rel=1e-2)
    assert holds(response.increments[-1])


def test_a_pulled_couplet_has_its_weight_and_tension_as_limit_load():
    assembly = solver.Assembly.from_outlines(
        [rectangle(0.0, 0.0, 0.8, 0.5), rectangle(-1.0, -1.0, 2.0, 0.0)], roles=["free", "fixed"], thickness=0.3
    )
    weight = mechanics.total_weight(assembly)
    interfaces = solver.Interfaces(solver.InterfaceLaw(0.3, 1e4, tensile_strength=2e4))
    for flow in ("associative", "non-associative"):
        loads = solver.Loads(solver.self_weight(assembly).dead, solver.point_load(assembly, 0, (0.0, weight)))
        found = solver.limit_load(assembly, loads=loads, interfaces=interfaces, flow=flow)
        assert found.multiplier == pytest.approx(1.0 + 2e4 * 0.24 / weight, rel=1e-6)
        assert found.forces[:, 0] == pytest.approx([-2e4 * 0.12] * 2, rel=1e-6)


def wedge_on_a_slope(cohesion, slope, friction=0.6):
    """A wedge with its apex over the middle of a base of 1 m, its live load its weight out of the slope; A and W."""
    middle = np.array([np.cos(slope), np.sin(slope)]) / 2.0
    wedge = [np.zeros(2), 2.0 * middle, np.add(middle, (0.0, 0.5))]
    ground = [(-1.0, -1.0), (2.0, -1.0), 4.0 * middle, -2.0 * middle]
    assembly = solver.Assembly.from_outlines(
        [np.array(wedge), np.array(ground)], roles=["free", "fixed"], names=["wedge", "ground"], thickness=THICKNESS
    )
    dead, live = solver.self_weight(assembly).dead, solver.weight_fraction(assembly, (-1.0, 0.0), assembly.free)
    law = solver.InterfaceLaw(friction, cohesion)
    structure = solver.Structure(assembly, solver.Interfaces(law), solver.Loads(dead, live))
    return structure, THICKNESS, mechanics.total_weight(assembly)


@pytest.mark.parametrize("cohesion", [0.0, 4e3])
def test_a_wedge_on_a_slope_has_the_limit_load_of_limit_equilibrium(cohesion):
    """Plane failure: α W cos ψ + W sin ψ = c A + μ (W cos ψ - α W sin ψ).

    Hoek & Bray (1981), Rock Slope Engineering, 3rd ed., chapter 7, without water; α along the horizontal.
    """
    slope, friction = np.radians(20.0), 0.6
    structure, area, weight = wedge_on_a_slope(cohesion, slope, friction)
    resists = cohesion * area / weight + friction * np.cos(slope) - np.sin(slope)
    expected = resists / (np.cos(slope) + friction * np.sin(slope))
    for flow in ("associative", "non-associative"):
        assert structure.limit_load(flow=flow).multiplier == pytest.approx(expected, rel=1e-6)


@pytest.mark.slow
def test_a_wedge_that_has_slipped_on_its_slope_keeps_friction():
    slope, cohesion = np.radians(20.0), 2e3
    structure, area, weight = wedge_on_a_slope(cohesion, slope)
    down = (-np.cos(slope), -np.sin(slope))
    response = structure.pushover(solver.ControlDisplacement("wedge", down, limit=0.002, increment=0.001))
    found = [increment.load_multiplier for increment in response.increments]
    along = np.cos(slope) + 0.6 * np.sin(slope)
    dry = (0.6 * np.cos(slope) - np.sin(slope)) / along
    assert found[0] == pytest.approx(dry + cohesion * area / weight / along, rel=1e-6)
    assert found[1:3] == pytest.approx([dry, dry], rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("stiffness", [np.inf, 1e10])
def test_what_a_settlement_has_torn_off_is_missing_from_limit_load_and_pushover(stiffness):
    """A block on a bed and glued to a wall at its side, which sinks: pulled off it, μ W + c A of the bed is left."""
    cohesion, tension, friction = 2e4, 1e4, 0.6
    assembly = solver.Assembly.from_outlines(
        [rectangle(0.0, 0.0, 0.5, 0.25), rectangle(-0.5, -0.5, 0.5, 0.0), rectangle(0.5, 0.0, 0.7, 0.25)],
        roles=["free", "fixed", "moving"], names=["block", "ground", "wall"], thickness=0.4,
    )  # fmt: skip
    weight = mechanics.total_weight(assembly)
    give = {"normal_stiffness": stiffness, "shear_stiffness": stiffness}
    interfaces = solver.Interfaces(solver.InterfaceLaw(friction, cohesion, tensile_strength=tension, **give))
    bed, side = 0.5 * 0.4, 0.25 * 0.4
    live = solver.point_load(assembly, 0, (-weight, 0.0), point=(0.0, 0.0))
    structure = solver.Structure(assembly, interfaces, solver.Loads(solver.self_weight(assembly).dead, live))
    sunk = structure.settle(solver.Settlement(direction=(0.0, -1.0), increment=1e-3, limit=1e-3)).increments[-1]
    left = friction + cohesion * bed / weight
    # As drawn the wall holds it, too; the lower end of its side more than the upper one, on which the block turns.
    assert structure.limit_load().multiplier > left + 0.5 * tension * side / weight
    found = structure.limit_load(pose=sunk.pose, bonds_at=sunk.bonds)
    assert found.multiplier == pytest.approx(left, rel=1e-5)
    control = solver.ControlDisplacement("block", (-1.0, 0.0), limit=1e-3, increment=1e-3)
    with pytest.raises(ValueError, match="of which a pose does not tell what"):
        structure.pushover(control, pose=sunk.pose)
    pushed = structure.pushover(control, pose=sunk.pose, bonds_at=sunk.bonds)
    assert pushed.values[0] == pytest.approx(left, rel=1e-5)
    assert pushed.values[-1] == pytest.approx(friction, rel=1e-3)


@pytest.mark.parametrize("stiffness", [np.inf, 1e8])
@pytest.mark.parametrize("displacement", [0.0, 1e-4])
@pytest.mark.slow
def test_an_open_joint_with_a_rest_of_its_strength_does_not_push(stiffness, displacement):
    """A block on ground that has sunk by 1 mm, glued to what is above it, is lifted by its weight; in a phase, too."""
    give = {"normal_stiffness": stiffness, "fracture_opening": 2e-3, "fracture_slip": 4e-3}
    mortar = solver.Interfaces(
        solver.InterfaceLaw(0.6, 5e3, tensile_strength=4e3, **give), {("ground", "stone"): solver.InterfaceLaw(0.6)}
    )
    assembly = solver.Assembly.from_outlines(
        [rectangle(0, 0, 0.5, 0.5), rectangle(0, -0.5, 0.5, 0), rectangle(0, 0.5, 0.5, 1)],
        roles=["free", "moving", "fixed"], materials=["stone", "ground", "stone"], names=["block", "ground", "above"],
    )  # fmt: skip
    weight = mechanics.total_weight(assembly)
    lift = solver.Loads(solver.self_weight(assembly).dead, solver.weight_fraction(assembly, (0.0, 1.0), np.array([0])))
    structure = solver.Structure(assembly, mortar, lift)
    sinks = solver.Settlement(direction=(0.0, -1.0), increment=1e-3, limit=1e-3)
    sunk = structure.settle(sinks).increments[-1]
    is_open = sunk.contacts.gaps > 0.9e-3
    assert (sunk.state.intact[is_open] > 0.1).all()
    found = structure.limit_load(pose=sunk.pose, bonds_at=sunk.bonds, displacement=displacement)
    assert found.multiplier == pytest.approx(1.0, rel=1e-6)
    # Nothing wedges the block, so that the ground carries its weight at most.
    assert sunk.largest == pytest.approx(weight, rel=1e-6)
    force = np.zeros_like(lift.dead)
    force[0, 1] = 2.0 * weight
    lifted = solver.Structure(assembly, mortar).settle([sinks, sinks], changes=[solver.PhaseChange(1, dead=force)])
    first = next(increment for increment in lifted.path if increment.phase == 1)
    risen = first.pose.positions[0, 1] - sunk.pose.positions[0, 1]
    assert risen == pytest.approx(1e-3 + weight / (0.5 * stiffness), rel=0.01)
    assert holds(first)


def block_on_two_springs(interfaces, sunk=5e-4):
    """A block of 1 x 1.5 m, pushed to the right at mid height by its weight, on pads of which the right one sinks."""
    assembly = solver.Assembly.from_outlines(
        [rectangle(-0.5, 0.0, 0.5, 1.5), rectangle(-0.45, -0.3, -0.35, 0.0), rectangle(0.35, -0.3, 0.45, 0.0)],
        roles=["free", "fixed", "moving"], names=["block", "left", "right"], thickness=0.5,
    )  # fmt: skip
    live = solver.point_load(assembly, 0, (mechanics.total_weight(assembly), 0.0), point=(0.0, 0.75))
    structure = solver.Structure(assembly, interfaces, solver.Loads(solver.self_weight(assembly).dead, live))
    settlement = solver.Settlement(direction=(0.0, -1.0), increment=sunk, limit=sunk)
    return structure, structure.settle(settlement).increments[-1]


@pytest.mark.parametrize(
    "interfaces",
    [
        solver.Interfaces(solver.InterfaceLaw(2.0, normal_stiffness=5e7, shear_stiffness=2e7)),
        solver.Interfaces(
            solver.InterfaceLaw(2.0, 1e4, tensile_strength=5e3, normal_stiffness=5e7, shear_stiffness=2e7)
        ),
        solver.Interfaces(solver.InterfaceLaw(2.0), ground={"left": 5e7, "right": 5e7}),
    ],
    ids=["joints", "mortar", "ground"],
)
@pytest.mark.slow
def test_a_block_that_leans_on_springs_tips_about_its_edge(interfaces):
    """α W y = W x about the outer edge of the right pad, from which the centroid is at (-x, y) at rest.

    Mortar adds what pulls at the other three ends of pads: t A/2 each, 0.1, 0.8 and 0.9 m away.
    """
    structure, sunk = block_on_two_springs(interfaces)
    leaning = -sunk.pose.rotations[0, 0]
    assert 4e-4 < leaning < 7e-4
    x, y = 0.45 - sunk.pose.positions[0, 0], 5e-4 + sunk.pose.positions[0, 1]
    tension, weight = interfaces.default.tensile_strength, mechanics.total_weight(structure.assembly)
    expected = (x + tension * 0.025 * 1.8 / weight) / y
    for more in ({}, {"flow": "non-associative"}, {"displacement": 1e-3}):
        found = structure.limit_load(pose=sunk.pose, bonds_at=sunk.bonds, **more)
        assert found.multiplier == pytest.approx(expected, rel=1e-6)
        assert holds(found)
    control = solver.ControlDisplacement("block", (1.0, 0.0), point=(0.0, 1.5), limit=2e-3, increment=1e-3)
    # The bounds of the path, with the live load for their objective, are the same program.
    pushed = structure.pushover(control, pose=sunk.pose, bonds_at=sunk.bonds)
    assert pushed.values[0] == pytest.approx(expected, rel=1e-6)
    # Then springs give.
    assert 0.0 < pushed.values[1] < pushed.values[2] < expected
    for analysis in (structure.limit_load, lambda **at: structure.pushover(control, **at)):
        with pytest.raises(ValueError, match="joints are elastic, of which a pose does not tell what compresses them"):
            analysis(pose=sunk.pose)


@pytest.mark.thorough
def test_capacities_with_stiff_joints_are_those_with_rigid_ones():
    """Of an arch that has spread; with a stiffness of 1e10 Pa/m they are 0.1 % less."""
    arch = generators.build("arch", {"voussoirs": 11})
    loads = solver.Loads(solver.self_weight(arch).dead, solver.weight_fraction(arch, (1.0, 0.0), arch.free))
    settlement = solver.Settlement(direction=(1.0, 0.0), increment=0.01, limit=0.01)
    found = []
    for stiffness in (np.inf, 1e14, 1e10):
        law = solver.InterfaceLaw(0.9, normal_stiffness=stiffness, shear_stiffness=stiffness)
        structure = solver.Structure(arch, solver.Interfaces(law), loads)
        last = structure.settle(settlement).increments[-1]
        found.append(structure.limit_load(pose=last.pose, bonds_at=last.bonds).multiplier)
        assert (last.bonds is None) == (stiffness == np.inf)
    rigid, stiff, soft = found
    assert stiff == pytest.approx(rigid, rel=1e-6)
    assert soft == pytest.approx(rigid, rel=2e-3)
    assert abs(soft / rigid - 1.0) > 1e-4


@pytest.mark.parametrize(
    ("law", "message"),
    [
        ({"cohesion": 1e3, "tensile_strength": 1e4}, "tensile_strength is 10000 Pa, above cohesion / "),
        ({"tensile_strength": -1.0}, "tensile_strength is -1 Pa; it must be a finite number of at least 0"),
        ({"normal_stiffness": -1.0}, "normal_stiffness is -1 Pa/m; it must be positive"),
        ({"fracture_slip": 1e-4}, "fracture_slip is 0.0001 m, but there is no strength to lose"),
    ],
)  # fmt: skip
def test_a_joint_law_that_cannot_be_is_refused(law, message):
    with pytest.raises(ValueError, match=message):
        solver.InterfaceLaw(0.6, **law)


@pytest.mark.slow
def test_a_footing_that_settles_tilts_the_beam_on_springs():
    """Three footings with K = k A each, the right one's ground settles by s: v = s/3, θ = s / (2 ℓ + 3 w²/(4 ℓ)).

    A footing of width w carries at its two ends.
    """
    arm, width, stiffness, settlement = 1.0, 0.1, 2e6, 0.02
    pads = [rectangle(x - width / 2, -0.3, x + width / 2, 0.0) for x in (-arm, 0.0, arm)]
    names = ["left", "middle", "right"]
    assembly = solver.Assembly.from_outlines(
        [rectangle(-1.2, 0.0, 1.2, 0.4), *pads],
        roles=["free", "fixed", "fixed", "moving"], names=["beam", *names], thickness=0.5,
    )  # fmt: skip
    interfaces = solver.Interfaces(ground=dict.fromkeys(names, stiffness))
    response = solver.Structure(assembly, interfaces).settle(
        solver.Settlement(direction=(0.0, -1.0), increment=0.01, limit=settlement)
    )
    first, last = response.increments[0], response.increments[-1]
    weight, spring = mechanics.total_weight(assembly), stiffness * width * 0.5
    assert first.support_forces[1:, 1] == pytest.approx([-weight / 3.0] * 3, rel=1e-6)
    tilt = settlement * arm / (2.0 * arm**2 + 3.0 * width**2 / 4.0)
    assert -last.pose.rotations[0, 0] == pytest.approx(tilt, rel=3e-3)
    assert 0.2 - last.pose.positions[0, 1] == pytest.approx(settlement / 3.0, rel=3e-3)
    assert -last.support_forces[2, 1] == pytest.approx(weight / 3.0 + spring * settlement / 3.0, rel=0.01)
    assert last.certificate.equilibrium_residual < 1e-6


def tower(courses, stiffness, friction=0.05):
    """A tower 1 m wide and 3 m high on one piece of ground."""
    height = 3.0 / courses
    shapes = [rectangle(0.0, k * height, 1.0, (k + 1) * height) for k in range(courses)]
    assembly = solver.Assembly.from_outlines(
        [*shapes, rectangle(-1.0, -1.0, 2.0, 0.0)],
        roles=["free"] * courses + ["moving"], names=[*(f"course {k}" for k in range(courses)), "ground"],
    )  # fmt: skip
    return assembly, solver.Interfaces(solver.InterfaceLaw(friction), ground={"ground": stiffness})


def tilts(courses, times, increment, limit, friction=0.05):
    """Tilt over tilt of the ground; it resists so many times what its weight gains as it leans."""
    assembly, _ = tower(courses, 1.0)
    weight = mechanics.total_weight(assembly)
    assembly, interfaces = tower(courses, times * weight * 1.5 * 4.0, friction)
    turns = solver.Settlement(rotation_centre=(0.5, 0.0), rotation=-1, increment=increment, limit=limit)
    response = solver.Structure(assembly, interfaces).settle(turns, controls=solver.Controls(falling_frames=0))
    lean = [-i.pose.rotations[0, 0] / i.settlement for i in response.path[1:]]
    return response, lean


@pytest.mark.parametrize(
    ("courses", "times", "within"), [(1, 4.0, 2e-3), (10, 4.0, 2e-3), (30, 10.0, 2e-3), (1, 2.0, 0.01)]
)
@pytest.mark.slow
def test_a_tower_on_ground_that_tilts_leans_by_more(courses, times, within):
    """θ = φ / (1 - 1/F), F = k b³/4 / (W h/2): however many courses, and whatever retards them on the path."""
    _, lean = tilts(courses, times, increment=0.001, limit=0.002)
    assert lean == pytest.approx([1.0 / (1.0 - 1.0 / times)] * 2, rel=within)


@pytest.mark.slow
@pytest.mark.parametrize("courses", [1, 10])
def test_a_tower_falls_when_its_weight_is_over_the_edge_however_deep_that_is_pressed(courses):
    """tan θ = b/h: the edge of a course of 0.3 m is 42 mm deep in the ground by then."""
    response, _ = tilts(courses, 4.0, increment=0.05, limit=0.3, friction=0.7)
    assert response.collapse is not None
    assert response.collapse.displacement == pytest.approx(0.2407, rel=1e-3)
    assert -response.path[-1].pose.rotations[0, 0] == pytest.approx(np.arctan(1.0 / 3.0), rel=5e-3)


def test_a_block_that_is_drawn_leaning_comes_to_lie_flat_on_the_ground_that_gives():
    """One corner touches in the drawing, which has no area alone: it gives as the face that opens there."""
    outlines = [rectangle(-1.0, -1.0, 2.0, 0.0), np.array([(0.0, 0.0), (1.0, 2e-3), (1.0, 1.0), (0.0, 1.0)])]
    outlines += [rectangle(5.0, -1.0, 6.0, 0.0), rectangle(5.0, 0.0, 6.0, 1.0)]
    roles, names = ["fixed", "free", "moving", "free"], ["ground", "block", "support", "other"]
    assembly = solver.Assembly.from_outlines(outlines, roles=roles, names=names)
    structure = solver.Structure(assembly, solver.Interfaces(ground={"ground": 5e6}))
    first = structure.settle(solver.Settlement((0, -1), increment=1e-4, limit=1e-4)).increments[0]
    assert first.pose.rotations[1] == pytest.approx(-2e-3, rel=0.01)


@pytest.mark.slow
def test_ground_does_not_pull():
    """Where its ground has settled by more than W / K the footing has left it."""
    assembly = solver.Assembly.from_outlines(
        [rectangle(0.0, 0.0, 1.0, 0.2), rectangle(0.0, -0.2, 0.7, 0.0), rectangle(0.9, -0.2, 1.0, 0.0)],
        roles=["free", "fixed", "moving"], names=["beam", "left", "right"],
    )  # fmt: skip
    interfaces = solver.Interfaces(solver.InterfaceLaw(0.6, 1e4, tensile_strength=1e4), ground={"right": 1e8})
    settlement = solver.Settlement(direction=(0.0, -1.0), increment=0.01, limit=0.01)
    last = solver.Structure(assembly, interfaces).settle(settlement).increments[-1]
    assert last.reaction == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("fracture", [pytest.param(0.0, marks=pytest.mark.slow), 5e-4])
def test_a_slip_takes_the_cohesion_at_once_or_over_its_length(fracture):
    """α W = μ W + c A at first; slipped by 0.25 mm, of a fracture slip of 0.5 mm, it has half of its cohesion left."""
    cohesion = 3e3
    assembly = solver.Assembly.from_outlines(
        [rectangle(0.0, 0.0, 0.8, 0.5), rectangle(-1.0, -1.0, 2.0, 0.0)],
        roles=["free", "fixed"], names=["block", "ground"], thickness=0.3,
    )  # fmt: skip
    weight = mechanics.total_weight(assembly)
    live = solver.point_load(assembly, 0, (weight, 0.0), point=(0.0, 0.0))
    loads = solver.Loads(solver.self_weight(assembly).dead, live)
    law = solver.InterfaceLaw(0.3, cohesion, fracture_slip=fracture)
    structure = solver.Structure(assembly, solver.Interfaces(law), loads)
    response = structure.pushover(solver.ControlDisplacement("block", (1.0, 0.0), limit=2.5e-4, increment=1.25e-4))
    first, *_, last = (increment.load_multiplier for increment in response.increments)
    assert first == pytest.approx(0.3 + cohesion * 0.24 / weight, rel=1e-6)
    left, within = (0.5, 0.02) if fracture else (0.0, 1e-6)
    assert last == pytest.approx(0.3 + left * cohesion * 0.24 / weight, rel=within)


def dry_and_weak(assembly, settlement, friction, strength):
    """The path of dry joints, and that of next to no strength and next to no give."""
    law = solver.InterfaceLaw(
        friction, strength, tensile_strength=strength, normal_stiffness=1e22, shear_stiffness=1e22
    )
    paths = [
        solver.Structure(assembly, solver.Interfaces(one)).settle(settlement)
        for one in (solver.InterfaceLaw(friction), law)
    ]
    return zip(paths[0].path, paths[1].path, strict=True)


@pytest.mark.parametrize("tensile_strength", [1e5, 0.0])
@pytest.mark.parametrize("elastic", [{}, {"normal_stiffness": 1e10, "shear_stiffness": 1e10}])
@pytest.mark.slow
def test_mortar_fills_the_gap_that_is_accepted_of_a_drawing(elastic, tensile_strength):
    """Two blocks glued to each other, one support of which sinks: the same with a head joint off as drawn."""

    def settled(gap):
        # No block may reach the support of the other, by however little: it would stand on it.
        shapes = [rectangle(0, 0, 0.99, 1), rectangle(1.01, 0, 2, 1)]
        shapes += [rectangle(0.5, 1, 1 - gap / 2, 1.5), rectangle(1 + gap / 2, 1, 1.5, 1.5)]
        assembly = solver.Assembly.from_outlines(shapes, roles=["fixed", "moving", "free", "free"])
        law = solver.InterfaceLaw(0.6, cohesion=2e5, tensile_strength=tensile_strength, **elastic)
        structure = solver.Structure(assembly, solver.Interfaces(law))
        response = structure.settle(solver.Settlement(direction=(0.0, -1.0), increment=1e-3, limit=1e-3))
        last = response.increments[-1]
        assert holds(last)
        pulled = structure.with_live(solver.weight_fraction(assembly, (1.0, 0.0)))
        left = pulled.limit_load(pose=last.pose, bonds_at=last.bonds)
        return [last.measured / response.total_weight, left.multiplier]

    whole = settled(0.0)
    assert whole == pytest.approx([0.25, 10.95] if tensile_strength else [0.495, 1.99], rel=0.02)
    for gap in (2e-6, 1e-5, 1e-4, -1e-5, -1e-4):
        assert settled(gap) == pytest.approx(whole, rel=2e-3)


@pytest.mark.slow
@settings(max_examples=4, deadline=None)
@given(voussoirs=st.integers(7, 15), strength=st.floats(1e-9, 1e-6), spread=st.floats(0.0, 1.0))
def test_weak_mortar_on_stiff_joints_is_a_dry_arch(voussoirs, strength, spread):
    assembly = generators.build("arch", {"voussoirs": voussoirs})
    weight = mechanics.total_weight(assembly)
    settlement = solver.Settlement(direction=(spread, spread - 1.0), increment=5e-3, limit=1e-2)
    for one, other in dry_and_weak(assembly, settlement, 0.9, strength):
        assert other.reaction == pytest.approx(one.reaction, abs=1e-6 * weight)
        assert other.pose.positions == pytest.approx(one.pose.positions, abs=1e-6)


@pytest.mark.slow
@settings(max_examples=4, deadline=None)
@given(friction=st.floats(0.3, 0.9), courses=st.integers(2, 4), strength=st.floats(1e-9, 1e-6))
def test_weak_mortar_on_stiff_joints_is_a_dry_wall(friction, courses, strength):
    """Where joints slide, a change of the dry wall's friction by 1e-9 changes reactions by 2e-4 of the weight, too."""
    assembly = wall(3, courses)
    weight = mechanics.total_weight(assembly)
    settlement = solver.Settlement(direction=(0.0, -1.0), increment=2e-3, limit=4e-3)
    for one, other in dry_and_weak(assembly, settlement, friction, strength):
        assert [other.least, other.largest] == pytest.approx([one.least, one.largest], abs=1e-6 * weight)
        assert other.reaction == pytest.approx(one.reaction, abs=1e-3 * weight)
        assert other.pose.positions == pytest.approx(one.pose.positions, abs=3e-5)


def thrust_of_the_broken_arch(arch, tension):
    """Thrust once three joints have broken, one after the other, of an arch on elastic joints: the force method.

    Of its right half: the two point forces of the crown's joint are unknown, those of the others follow from statics.
    """
    half = np.flatnonzero(arch.free & (arch.centroids[:, 0] > 0.0))
    half = half[np.argsort(arch.centroids[half, 0])]
    radii, angles = np.array([0.925, 1.075]), np.linspace(0.0, np.pi / 2.0, len(half) + 1)
    weights = solver.GRAVITY * arch.masses[half]
    above, moment = (np.append(0.0, np.cumsum(w)) for w in (weights, weights * arch.centroids[half, 0]))
    # Joints carry (H, -above), whose moment about the centre is that of their two points alone.
    of_points = np.linalg.inv(np.array([np.ones(2), radii]))
    influence = np.array([of_points @ np.array([[np.cos(a)] * 2, radii]) for a in angles]).reshape(-1, 2)
    loads = np.array([of_points @ pair for pair in zip(above * np.sin(angles), moment, strict=True)]).ravel()
    give = np.repeat(np.append(0.5, np.ones(len(half))), 2)  # half of the crown's joint belongs to the other side
    normal = influence.T @ (give[:, None] * influence)
    rest = loads - influence @ np.linalg.solve(normal, influence.T @ (give * loads))
    broken: list[int] = []
    while len(broken) < 2:
        # Forces that give least, without those of broken points, as they are and for a unit of spreading.
        ends, zero = influence[broken], np.zeros((len(broken), len(broken)))
        system = np.block([[normal, ends.T], [ends, zero]])
        still = np.append(influence.T @ (give * (rest - loads)), -loads[broken])
        spreading = np.append([-1.0, -1.0], np.zeros(len(broken)))
        now, rate = (influence @ np.linalg.solve(system, side)[:2] for side in (still, spreading))
        now += loads
        left = np.where(rate < -1e-12, (now + tension * 0.075) / -np.minimum(rate, -1e-12), np.inf)
        left[broken] = np.inf
        broken.append(int(left.argmin()))
    return float(np.linalg.solve(influence[broken], -loads[broken]).sum()), [point // 2 for point in broken]


@pytest.mark.slow
@pytest.mark.parametrize(("tension", "joint"), [(2e4, 4), (5e4, 5), (1e5, 6)])
def test_an_arch_of_mortar_breaks_where_elastic_joints_do(tension, joint):
    """Brittle joints: the crown first, then one that is the further from it the stronger the mortar."""
    arch = generators.arch()
    thrust, broken = thrust_of_the_broken_arch(arch, tension)
    assert broken == [0, joint]
    law = solver.InterfaceLaw(0.6, 10.0 * tension, tensile_strength=tension)
    settlement = solver.Settlement(direction=(1.0, 0.0), increment=5e-5, limit=1e-4)
    response = solver.Structure(arch, solver.Interfaces(law)).settle(settlement)
    assert response.increments[-1].reaction == pytest.approx(thrust, rel=1e-3)
    assert (response.increments[-1].bonds.left < 1.0).sum() == 3


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.98, 1.02])
def test_a_stone_in_space_hangs_by_the_tension_of_its_bed(share):
    """W = t A, four contact points with a quarter each."""
    assembly = solver.Assembly.from_solids(
        [
            box((0.0, 0.0, 0.125), (0.25, 0.25, 0.3)),
            box((0.0, 0.0, 0.0), (0.25, 0.25, 0.125)),
            box((0.05, 0.05, -0.1), (0.2, 0.2, 0.0)),
        ],
        roles=["fixed", "free", "moving"], materials=["stone", "stone", "support"],
    )  # fmt: skip
    weight = mechanics.total_weight(assembly)
    strength = share * weight / 0.0625
    law = solver.InterfaceLaw(0.6, strength, tensile_strength=strength)
    interfaces = solver.Interfaces(law, {("support", "stone"): solver.InterfaceLaw(0.6)})
    settlement = solver.Settlement(direction=(0.0, 0.0, -1.0), increment=1e-3, limit=2e-3)
    last = solver.Structure(assembly, interfaces).settle(settlement).increments[-1]
    assert last.reaction == pytest.approx(0.0 if share > 1.0 else weight, abs=1e-6 * weight)
    assert set(last.state.intact) == ({0.0, 1.0} if share > 1.0 else {0.0})
    assert holds(last)


@pytest.mark.slow
def test_a_wall_with_mortar_goes_on_from_its_checkpoint_bit_for_bit():
    assembly = wall(3, 3)
    interfaces = solver.Interfaces(solver.InterfaceLaw(0.6, 3e3, tensile_strength=1e3, normal_stiffness=1e10))
    phases, loads = (
        (solver.Settlement(direction=(0.0, -1.0), increment=1e-3, limit=3e-3),),
        solver.self_weight(assembly),
    )
    whole = list(mechanics.settlement_increments(assembly, phases, interfaces=interfaces, loads=loads))
    stored = whole[1].checkpoint
    again = list(mechanics.settlement_increments(assembly, phases, interfaces=interfaces, loads=loads, resume=stored))
    assert [one.reaction for one in again] == [one.reaction for one in whole[2:]]
    assert (again[-1].pose.positions == whole[-1].pose.positions).all()


@pytest.mark.path
@pytest.mark.parametrize("settlement", [2e-4, pytest.param(2e-3, marks=pytest.mark.thorough)])
def test_a_block_on_two_elastic_joints_tilts_as_on_springs(settlement):
    """Four springs k A / 4 under a block of weight W: the right pair sinks, and the weight leans with the tilt."""
    outlines = [rectangle(-1.0, -1.0, 0.5, 0.0), rectangle(0.5, -1.0, 2.0, 0.0), rectangle(0.0, 0.0, 1.0, 1.0)]
    assembly = solver.Assembly.from_outlines(outlines, roles=["fixed", "moving", "free"])
    joints = solver.Interfaces(solver.InterfaceLaw(0.6, normal_stiffness=1e7, shear_stiffness=1e7))
    down = solver.Settlement(direction=(0.0, -1.0), increment=2e-4, limit=settlement)
    response = solver.settle(assembly, down, interfaces=joints)
    weight, spring = response.total_weight, 0.25e7
    tilt = settlement / (1.0 - weight / spring)
    last = response.path[-1]
    assert -last.pose.rotations[2, 0] == pytest.approx(tilt, rel=0.01)
    assert last.reaction == pytest.approx(weight / 2.0 - spring * (settlement - tilt / 2.0), rel=3e-4)


@pytest.mark.parametrize(("factor", "status"), [(0.9, "no initial equilibrium"), (1.05, "limit reached")])
@pytest.mark.parametrize("n_drums", [1, pytest.param(5, marks=pytest.mark.thorough)])
def test_a_tower_on_soft_ground_stands_as_long_as_it_is_stable(factor, status, n_drums):
    """By hand it leans ever farther below k A b²/4 = W h/2; upright it is in equilibrium on any ground."""
    height, weight = 10.0, 10.0 * 2000.0 * solver.GRAVITY
    drums = [brick(-0.5, k * height / n_drums, 1.0, height / n_drums) for k in range(n_drums)]
    roles = ["moving", *["free"] * n_drums]
    names = ["ground", *(f"drum {k + 1}" for k in range(n_drums))]
    outlines = [brick(-1.0, -1.0, 2.0, 1.0), *drums]
    tower = solver.Assembly.from_outlines(outlines, names=names, roles=roles, density=2000.0)
    springs = solver.Interfaces(solver.InterfaceLaw(0.6), ground={"ground": factor * 2.0 * weight * height})
    sinks = solver.Settlement(direction=(0.0, -1.0), increment=0.002, limit=0.004)
    response = solver.settle(tower, sinks, interfaces=springs)
    assert response.stop == status
    assert ("no stable equilibrium" in response.message) is (factor < 1.0)


@pytest.mark.slow
def test_walls_and_what_is_left_of_a_tower_stand_on_soft_ground():
    """A lean lets friction go, so that bricks shift by more than it; what was taken away leans, and goes nowhere."""
    law = solver.InterfaceLaw(0.6)
    sinks = solver.Settlement(direction=(0.0, -1.0), increment=0.001, limit=0.002)
    uneven = wall(8, 6)
    left, right = (uneven.names[k] for k in np.flatnonzero(~uneven.free))
    springs = {left: 1e7, right: 2e6}
    assert solver.settle(uneven, sinks, interfaces=solver.Interfaces(law, ground=springs)).stop == "limit reached"
    drums = [brick(1.0, 1.25 * k, 1.0, 1.25) for k in range(4)]
    names, roles = ["ground", "one", "two", "three", "four"], ["moving", *["free"] * 4]
    outlines = [brick(0.0, -1.0, 3.0, 1.0), *drums]
    tower = solver.Assembly.from_outlines(outlines, names=names, roles=roles, density=2000.0)
    interfaces = solver.Interfaces(law, ground={"ground": 5.0 * 2.0 * 25.0 * 2000.0 * solver.GRAVITY})
    change = solver.PhaseChange(0, removed=np.arange(5) == 4)
    assert solver.Structure(tower, interfaces).settle(sinks, changes=[change]).stop == "limit reached"


def test_a_tower_that_leans_on_by_itself_carries_no_live_load():
    """The control displacement held it upright: a multiplier of 0.1 was told."""
    tower = solver.Assembly.from_outlines(
        [brick(-1.0, -1.0, 3.0, 1.0), brick(0.0, 0.0, 1.0, 10.0)], roles=["fixed", "free"], density=2000.0
    )
    weight = 10.0 * 2000.0 * solver.GRAVITY
    springs = solver.Interfaces(solver.InterfaceLaw(0.6), ground={tower.names[0]: 0.5 * 2.0 * weight * 10.0})
    live = solver.weight_fraction(tower, (1.0, 0.0))
    structure = solver.Structure(tower, springs, solver.Loads(solver.self_weight(tower).dead, live))
    response = structure.pushover(solver.ControlDisplacement(tower.names[1], (1.0, 0.0), increment=0.02, limit=0.1))
    assert response.stop == "no initial equilibrium"
