"""Fill over arches: reactions and thrusts by hand, of the columns of fill over the extrados where it then is."""

from __future__ import annotations

import numpy as np
import pytest
from structures import box, in_either

import solver
from blockvis import generators, lay_backfill

DENSITY, UNIT_WEIGHT, SURFACE, COEFFICIENT = 2000.0, 18000.0, 2.5, 0.2
#: Places, half the weight each, at which a quadratic is summed exactly.
GAUSS = 0.5 + np.array([-1.0, 1.0]) / np.sqrt(12.0)
#: Left half of an arch of two blocks: springing on the ground from x = -2 to -1.6, upright joint at the crown.
HALF = np.array([[-2.0, 0.0], [-1.6, 0.0], [0.0, 1.6], [0.0, 2.0]])
GROUND = np.array([[-2.1, -0.3], [-1.5, -0.3], [-1.5, 0.0], [-2.1, 0.0]])


def mirrored(outline: np.ndarray) -> np.ndarray:
    return (outline * [-1.0, 1.0])[::-1]


def two_block_arch(dimension: int) -> solver.Assembly:
    outlines = [HALF, mirrored(HALF), GROUND, mirrored(GROUND)]
    labels = {"names": ["left half", "right half", "ground", "moving"], "roles": ["free", "free", "fixed", "moving"]}
    return in_either(dimension, outlines, density=DENSITY, **labels)


def under(assembly: solver.Assembly, fill: solver.Backfill) -> solver.Loads:
    weight = solver.self_weight(assembly)
    return solver.Loads(weight.dead, weight.live, (fill,))


def with_fill(assembly: solver.Assembly) -> solver.Structure:
    loads = under(assembly, lay_backfill(assembly, "* half", SURFACE, UNIT_WEIGHT, COEFFICIENT))
    return solver.Structure(assembly, loads=loads, friction_coefficient=3.0)


def thrust_by_hand(spread: float) -> float:
    """At the springing, of three hinges: at the inner ends of the springings and at the top of the crown."""
    hinge, crown = HALF[1], HALF[3]
    before, after = crown - hinge, np.array([spread / 2.0 + 1.6, 0.0])
    after[1] = np.sqrt(before @ before - after[0] ** 2)
    angle = np.arctan2(after[1], after[0]) - np.arctan2(before[1], before[0])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    centroid = solver.Assembly.from_outlines([HALF]).centroids[0]
    weight = 0.72 * DENSITY * solver.GRAVITY
    moment = weight * (turn @ (centroid - hinge))[0]
    # Over the straight extrados from crown to springing: p = γ (s - y), down p |dx|, inwards k p |dy|.
    low, high = (turn @ (point - hinge) for point in (HALF[0], crown))
    push, (width, height) = 0.0, high - low
    for share in GAUSS:
        place = low + share * (high - low)
        pressure = UNIT_WEIGHT * (SURFACE - place[1]) / 2.0
        push += COEFFICIENT * pressure * height
        moment += pressure * width * place[0] + COEFFICIENT * pressure * height * place[1]
    return float(moment / after[1] - push)


@pytest.mark.parametrize("dimension", [pytest.param(2, marks=pytest.mark.thorough), 3])
def test_thrust_of_a_filled_arch_of_two_blocks_is_that_of_three_hinges(dimension: int) -> None:
    settlement = solver.Settlement(np.eye(dimension)[0], increment=0.1, limit=0.1)
    response = with_fill(two_block_arch(dimension)).settle(settlement)
    # Over each half a trapezoid of fill, 0.5 and 2.5 m high and 2 m wide.
    weights = 2.0 * (0.72 * DENSITY * solver.GRAVITY + 3.0 * UNIT_WEIGHT)
    assert -response.path[0].support_forces[:, dimension - 1].sum() == pytest.approx(weights, rel=1e-9)
    assert response.path[0].least == pytest.approx(thrust_by_hand(0.0), rel=1e-7)
    for increment in response.path[1:]:
        assert increment.reaction == pytest.approx(thrust_by_hand(increment.parameter), rel=1e-5)


def test_the_supports_of_a_voussoir_arch_carry_its_weight_and_that_of_its_fill() -> None:
    n, radius = 15, 2.5 + 0.3
    roles = {"right springer": "moving"}
    arch = generators.segmental_arch(span=4.0, rise=1.0, thickness=0.3, voussoirs=n)
    assembly = arch.with_roles([roles.get(name, role) for name, role in zip(arch.names, arch.roles, strict=True)])
    loads = under(assembly, lay_backfill(assembly, "voussoir *", 1.6, UNIT_WEIGHT, 0.3))
    structure = solver.Structure(assembly, loads=loads, friction_coefficient=0.7)
    first = structure.settle(solver.Settlement([1.0, 0.0], increment=1e-4, limit=1e-4)).path[0]
    angles = np.pi / 2.0 + np.arcsin(2.0 / 2.5) * np.linspace(-1.0, 1.0, n + 1)
    x, y = radius * np.cos(angles), radius * np.sin(angles) - 1.5
    columns = UNIT_WEIGHT * float(assembly.thickness[0]) * np.sum((1.6 - (y[1:] + y[:-1]) / 2.0) * (x[:-1] - x[1:]))
    weights = assembly.masses[assembly.free].sum() * solver.GRAVITY + columns
    assert -first.support_forces[:, 1].sum() == pytest.approx(weights, rel=1e-9)


#: A block 1 m wide and 2 m high under 1 m of fill, that overturns about its right lower corner.
CORNER, OWN = np.array([1.0, 0.0]), 4000.0 * solver.GRAVITY


def filled_block() -> solver.Structure:
    block, ground = [[0, 0], [1, 0], [1, 2], [0, 2]], [[-1, -1], [2, -1], [2, 0], [-1, 0]]
    assembly = solver.Assembly.from_outlines([block, ground], names=["block", "ground"], roles=["free", "fixed"])
    loads = under(assembly, lay_backfill(assembly, "block", 3.0, UNIT_WEIGHT))
    structure = solver.Structure(assembly, loads=loads, friction_coefficient=5.0)
    return structure.with_live(acceleration=[1.0, 0.0])


def turned_by(lean: float, point: list[float]) -> np.ndarray:
    """From the corner to a point of the block once it leans to the right."""
    turn = np.array([[np.cos(lean), np.sin(lean)], [-np.sin(lean), np.cos(lean)]])
    return turn @ (np.array(point) - CORNER)


def multiplier_by_hand(lean: float) -> float:
    """Of the acceleration of block and fill: this is deeper over the lower end of its top, and up to 3 m."""
    a, b, centroid = (turned_by(lean, point) for point in ([0.0, 2.0], [1.0, 2.0], [0.5, 1.0]))
    moment, pushing = -OWN * centroid[0], OWN * centroid[1]
    for share in GAUSS:
        place = a + share * (b - a)
        column = UNIT_WEIGHT * (3.0 - place[1]) * (b - a)[0] / 2.0
        moment -= column * place[0]
        pushing += column * (3.0 + place[1]) / 2.0
    return float(moment / pushing)


def test_limit_loads_under_fill_are_those_of_a_block_by_hand() -> None:
    structure = filled_block()
    assert structure.limit_load().multiplier == pytest.approx(
        (OWN + UNIT_WEIGHT) * 0.5 / (OWN + UNIT_WEIGHT * 2.5), rel=1e-9
    )
    lean = solver.Pose(np.array([CORNER + turned_by(0.1, [0.5, 1.0]), [0.5, -0.5]]), np.array([[-0.1], [0.0]]))
    assert structure.limit_load(pose=lean).multiplier == pytest.approx(multiplier_by_hand(0.1), rel=1e-7)
    resultant = structure.limit_load().live_force
    assert resultant == pytest.approx(OWN + UNIT_WEIGHT, rel=1e-12)


@pytest.mark.slow
def test_in_space_an_acceleration_acts_on_the_fill_along_a_pushover() -> None:
    """The same block, 1 m deep, which overturns along y: the limit load, and what is left of it as it leans."""
    solids = [box([0, 0, 0], [1, 1, 2]), box([-1, -1, -1], [2, 2, 0])]
    assembly = solver.Assembly.from_solids(solids, names=["block", "ground"], roles=["free", "fixed"])
    loads = under(assembly, lay_backfill(assembly, "block", 3.0, UNIT_WEIGHT))
    structure = solver.Structure(assembly, loads=loads, friction_coefficient=2.0).with_live(acceleration=(0, 1, 0))
    assert structure.limit_load().multiplier == pytest.approx(multiplier_by_hand(0.0), rel=1e-7)
    control = solver.ControlDisplacement("block", (0, 1, 0), point=(0.5, 0.5, 1.0), increment=0.1, limit=0.1)
    for increment in structure.pushover(control).path:
        lean = -float(increment.pose.rotations[0, 0])
        assert increment.measured == pytest.approx(multiplier_by_hand(lean), abs=1e-5)
