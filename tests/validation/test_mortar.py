"""Mortar along a path, and ground that gives: what statics says by hand of the point model."""

import numpy as np
import pytest
from structures import rectangle

import solver
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


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_a_block_hangs_by_the_tension_of_its_bed(share):
    """W = t A, on a centred bed joint above it."""
    weight = 61.3125
    strength = share * weight / (WIDTH * THICKNESS)
    shapes = [
        rectangle(0.0, HEIGHT, WIDTH, 0.3),
        rectangle(0.0, 0.0, WIDTH, HEIGHT),
        rectangle(0.05, -0.1, WIDTH - 0.05, 0.0),
    ]
    response, _ = held(
        shapes, ["fixed", "free", "moving"], solver.InterfaceLaw(0.6, strength, tensile_strength=strength)
    )
    last = response.increments[-1]
    assert last.reaction == pytest.approx(0.0 if share > 1.0 else weight, abs=1e-5 * weight)
    assert holds(last)


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


def test_a_pushed_block_breaks_loose_at_its_cohesion_and_slides_at_friction():
    """A pushover at the base: α W = μ W + c A at first, μ W once the joint has slipped."""
    cohesion = 3e3
    assembly = solver.Assembly.from_outlines(
        [rectangle(0.0, 0.0, 0.8, 0.5), rectangle(-1.0, -1.0, 2.0, 0.0)],
        roles=["free", "fixed"], names=["block", "ground"], thickness=0.3,
    )  # fmt: skip
    weight = mechanics.total_weight(assembly)
    loads = solver.Loads(
        solver.self_weight(assembly).dead, solver.point_load(assembly, 0, (weight, 0.0), point=(0.0, 0.0))
    )
    structure = solver.Structure(assembly, solver.Interfaces(solver.InterfaceLaw(0.3, cohesion)), loads)
    control = solver.ControlDisplacement("block", (1.0, 0.0), limit=0.004, increment=0.002)
    response = structure.pushover(control)
    found = [increment.load_multiplier for increment in response.increments]
    assert found[0] == pytest.approx(0.3 + cohesion * 0.24 / weight, rel=1e-6)
    assert found[1:3] == pytest.approx([0.3, 0.3], rel=1e-6)


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


def test_crushing_is_not_followed():
    shapes = [rectangle(0.0, 0.0, WIDTH, HEIGHT), rectangle(0.0, -0.1, WIDTH, 0.0)]
    with pytest.raises(ValueError, match="crushing along the path of a settlement is not followed"):
        held(shapes, ["free", "moving"], solver.InterfaceLaw(0.6, 0.0, 1e6))
    assert np.isinf(solver.InterfaceLaw().compressive_strength)
