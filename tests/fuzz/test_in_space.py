"""Random structures of the plane, extruded: blocks in space that have to go the plane's way.

Where friction leaves the forces of a structure open, give and drag choose among them, and twice as many contact points
choose another way by a little; what equilibrium bounds is the same, and so is what it leaves no choice.
"""

from dataclasses import replace

import pytest
from rubble import trial
from structures import upright

import solver

pytestmark = pytest.mark.path

#: Of the weight: what two programs may differ by, and below which bounds leave no choice.
SAME, NO_CHOICE = 1e-5, 1e-2

CONTROLS = solver.Controls(falling_frames=1)


def in_space_of(assembly):
    """Extrude blocks along y by their size, the plane's y upwards."""
    solids = [upright(assembly.outline(block), 0.0, assembly.block_size) for block in range(assembly.n_blocks)]
    roles, names = list(assembly.roles), assembly.names
    return solver.Assembly.from_solids(solids, roles=roles, names=names, density=assembly.density)


@pytest.mark.parametrize(
    ("kind", "seed"),
    [
        ("arch", 1002),
        ("courses", 1002),
        ("courses", 1105),
        ("cuts", 1003),
        ("layout", 1004),
        ("stack", 1017),
        pytest.param("stack", 1023, marks=pytest.mark.thorough),
        ("voronoi", 1002),
        pytest.param("voronoi", 1006, marks=pytest.mark.slow),
    ],
)
@pytest.mark.slow
def test_extruded_structures_go_the_way_of_the_plane(kind, seed):
    given = trial(kind, seed)
    x, up = given.settlement.direction
    in_space = in_space_of(given.assembly)
    flat = solver.settle(given.assembly, given.settlement, friction_coefficient=given.friction, controls=CONTROLS)
    settlement = replace(given.settlement, direction=(x, 0.0, up))
    solid = solver.settle(in_space, settlement, friction_coefficient=given.friction, controls=CONTROLS)
    assert solid.stop is flat.stop
    first, other = flat.path[0], solid.path[0]
    for one, same in ((first.least, other.least), (first.largest, other.largest)):
        assert same / solid.total_weight == pytest.approx(one / flat.total_weight, abs=SAME, rel=SAME)
    there = {i.parameter: i for i in solid.path}
    for one in flat.path:
        same = there.get(one.parameter)
        if same is not None and one.largest - one.least < NO_CHOICE * flat.total_weight:
            assert same.measured / solid.total_weight == pytest.approx(one.measured / flat.total_weight, abs=NO_CHOICE)
    if flat.collapse is not None:
        assert solid.collapse.displacement == pytest.approx(flat.collapse.displacement, rel=1e-2)
