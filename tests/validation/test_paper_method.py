"""The linear programs of Portioli & Cascini (2017) on their structures, and on those whose path has a closed form.

Arches: the references of ``test_arches``; panels: those of ``test_panels``; the rest in the docstring of each test.
"""

import numpy as np
import pytest
from structures import rectangle, same
from test_closed_forms import flat_arch
from test_panels import panel

import solver
from blockvis import generators
from solver.mechanics import settlement_increments

pytestmark = pytest.mark.path

PAPER = solver.Controls(increments="linear program", falling_frames=0)


def settle(assembly, friction_coefficient, controls=PAPER, **settlement):
    sinks = solver.Settlement(**({"direction": (0, -1)} | settlement))
    return solver.settle(assembly, sinks, friction_coefficient=friction_coefficient, controls=controls)


def opening():
    """Panel with a door under a lintel, of ``examples/panel_with_opening.toml``."""
    door = {"x": 0.8, "y": 0.0, "width": 0.8, "height": 1.0, "head": "lintel", "bearing": 0.2, "depth": 0.2}
    size = {"bricks": 6, "courses": 8, "brick_length": 0.4, "brick_height": 0.2, "bond": "running", "depth": 0.4}
    return generators.build("wall", {**size, "settling": [1.2, 2.4], "openings": [door]})


@pytest.mark.slow
@pytest.mark.parametrize(("increment", "error"), [(0.02, 3e-4), pytest.param(0.005, 1e-4, marks=pytest.mark.thorough)])
def test_semicircular_arch_on_spreading_supports(increment, error):
    """Collapse at d/R = 0.14104982; thrust H/W 0.1771150 at first and 0.2420193 at last."""
    arch = generators.arch(thickness_ratio=0.15, voussoirs=12)
    response = settle(arch, 2.0, direction=(1, 0), increment=increment, limit=1.0, tolerance=1e-5)
    assert response.stop is solver.Status.COLLAPSED
    assert response.collapse.displacement == pytest.approx(0.14104982, rel=error)
    low, high = response.collapse.bracket
    assert high - low <= 1.001e-5
    thrust = response.reaction / response.total_weight
    assert thrust[0] == pytest.approx(0.1771150, abs=1e-6)
    assert thrust[-1] == pytest.approx(0.2420193, rel=1e-3)
    assert response.increments[-1].status is solver.Status.FALLING
    assert "hinges at" in response.collapse.words


@pytest.mark.thorough
def test_a_hinge_jumps_to_the_next_joint():
    """At d = 0.12885 a hinge of this arch moves to another joint; it falls at 0.14352524."""
    arch = generators.arch(embrace=120, thickness_ratio=0.10, voussoirs=13)
    response = settle(arch, 2.0, direction=(1, 0), increment=0.01, limit=1.0, tolerance=1e-5)
    assert response.collapse.displacement == pytest.approx(0.14352524, rel=2e-3)


@pytest.mark.thorough
def test_arch_on_a_sinking_support():
    """Collapse at v/R = 0.33003942; vertical reaction 0.487901 W at first and 0.559286 W at last."""
    response = settle(generators.arch(thickness_ratio=0.15, voussoirs=12), 2.0, increment=0.02, limit=1, tolerance=1e-5)
    assert response.collapse.displacement == pytest.approx(0.33003942, rel=2e-4)
    assert response.reaction[0] / response.total_weight == pytest.approx(0.487901, abs=1e-6)
    assert response.collapse.reaction / response.total_weight == pytest.approx(0.559286, rel=1e-4)


@pytest.mark.thorough
def test_portal_frame():
    """The lintel tilts on its bearings until it slides off; 6/13 W stand on the right foot at first."""
    portal = generators.portal(span=2.0, height=2.4, column_width=0.5, column_blocks=4, lintel_height=0.5)
    response = settle(portal, 0.6, increment=0.04, limit=2.5, tolerance=1e-3)
    assert response.stop is solver.Status.COLLAPSED
    assert response.reaction[0] / response.total_weight == pytest.approx(6 / 13, abs=1e-6)
    # The path of Coulomb friction, which is another method, falls at 1.7815 m.
    assert response.collapse.displacement == pytest.approx(1.7815, rel=1e-3)


@pytest.mark.parametrize(("mu", "share"), [(0.3, 0.169916245), (0.6, 25 / 204), (0.75, 8 / 75)])
def test_panel_at_the_onset(mu, share):
    response = settle(panel(5, 6, 5.0), mu, increment=0.02, limit=0.02)
    assert response.reaction[0] / response.total_weight == pytest.approx(share, abs=1e-6)


@pytest.mark.slow
def test_panel_with_opening():
    """The reaction at first is the least that equilibrium allows, which the path of Coulomb friction reports, too."""
    response = settle(opening(), 0.6, increment=0.01, limit=0.03)
    assert response.stop is solver.Status.LIMIT_REACHED
    assert response.settlement == pytest.approx([0.0, 0.01, 0.02, 0.03], abs=1e-12)
    assert response.reaction[0] / response.total_weight == pytest.approx(0.4202916, abs=1e-6)
    coulomb = settle(opening(), 0.6, solver.Controls(increments="coulomb"), increment=0.01, limit=0.01)
    assert response.reaction[0] == pytest.approx(coulomb.path[0].least, rel=1e-6)
    # Gaps that sliding leaves are within a hundredth of the increment.
    assert max(i.certificate.largest_penetration for i in response.path) <= 1e-4


def test_increments_prove_themselves():
    response = settle(generators.arch(thickness_ratio=0.15, voussoirs=12), 2.0, increment=0.02, limit=0.1)
    for increment in response.path:
        certificate = increment.certificate
        assert certificate.equilibrium_residual <= 2e-9
        assert max(certificate.duality_gap, certificate.friction_excess, certificate.kinematic_violation) <= 1e-8
        assert certificate.largest_penetration <= 1e-8
        assert increment.least == increment.measured


@pytest.mark.thorough
@pytest.mark.parametrize("height", [0.25, 0.5])
def test_flat_arch(height):
    """Two blocks 1 × h between abutments: collapse where the rise √(1 + h² - (1 + d/2)²) is used up."""
    response = flat_arch(height, increments="linear program")
    assert response.collapse.displacement == pytest.approx(2 * (np.hypot(1, height) - 1), rel=1e-3)
    half = 1 + response.settlement[:4] / 2
    thrust = half / (4 * np.sqrt(1 + height**2 - half**2))
    assert response.reaction[:4] / response.total_weight == pytest.approx(thrust, rel=1e-4)


@pytest.mark.parametrize(("width", "height", "mu"), [(1, 2, 0.7), (1, 1, 0.4)])
@pytest.mark.slow
def test_block_on_a_tilting_support(width, height, mu):
    """Overturns or slides at θ = atan(min(μ, b/h))."""
    outlines = [rectangle(0, 0, width, height), rectangle(-1, -1, width + 1, 0)]
    block = solver.Assembly.from_outlines(outlines, roles=["free", "moving"])
    turn = {"direction": None, "rotation_centre": (0.3, -0.5), "rotation": 1, "tolerance": 1e-5}
    response = settle(block, mu, increment=0.02, limit=1.0, **turn)
    assert response.collapse.displacement == pytest.approx(np.arctan(min(mu, width / height)), abs=2e-5)
    assert response.collapse.unit == "rad"


def keystone(degrees):
    slope = np.tan(np.radians(degrees))
    near, far, top = 0.5 - 0.6 * slope, 1.5 + 1.6 * slope, 0.5 + 1.6 * slope
    side = [[[x * near, -0.6], [x * far, -0.6], [x * far, 1.6], [x * top, 1.6]] for x in (-1, 1)]
    key = [[-0.5, 0], [0.5, 0], [0.5 + slope, 1], [-0.5 - slope, 1]]
    return solver.Assembly.from_outlines([key, *side], roles=["free", "fixed", "moving"])


@pytest.mark.parametrize(("degrees", "mu"), [(20, 0.3), pytest.param(15, 0.6, marks=pytest.mark.thorough)])
def test_gap_functions_take_the_lift_of_sliding_joints_back(degrees, mu):
    """A keystone between spreading supports sinks by d/(2 tan β) at H = (W/2) cot(β + φ)."""
    response = settle(keystone(degrees), mu, direction=(1, 0), increment=0.02, limit=0.1)
    beta = np.radians(degrees)
    assert response.reaction / response.total_weight == pytest.approx(0.5 / np.tan(beta + np.arctan(mu)), abs=1e-6)
    sunk = -response.path[-1].pose.displacements(response.assembly)[0, 1]
    assert sunk == pytest.approx(0.1 / (2 * np.tan(beta)), rel=1e-3)


def test_keystone_locked_between_approaching_supports():
    response = settle(keystone(15), 0.6, direction=(-1, 0), increment=0.01, limit=0.1)
    assert response.stop is solver.Status.LOCKED
    assert "1 block is wedged ('block 0')" in response.message
    assert len(response.path) == 1


def test_no_equilibrium_before_any_settlement():
    still = {"direction": (1, 0), "increment": 1e-3, "limit": 1e-3}
    response = settle(generators.arch(thickness_ratio=0.09, voussoirs=24), 2.0, **still)
    assert response.stop is solver.Status.NO_INITIAL_EQUILIBRIUM
    assert "blocks fall" in response.message
    in_the_air = [rectangle(0, 5, 1, 6), rectangle(-1, -1, 2, 0)]
    response = settle(solver.Assembly.from_outlines(in_the_air, roles=["free", "moving"]), 0.6, **still)
    assert response.stop is solver.Status.NO_INITIAL_EQUILIBRIUM


def test_stops_are_reported():
    arch = generators.arch(thickness_ratio=0.15, voussoirs=12)
    response = settle(arch, 2.0, direction=(1, 0), increment=0.02, limit=0.05, stops=(0.013,))
    assert response.settlement.tolist() == [0.0, 0.013, 0.02, 0.04, 0.05]


@pytest.mark.parametrize("increments", ["linear program", pytest.param("coulomb", marks=pytest.mark.thorough)])
def test_a_multiple_that_is_the_limit_but_for_rounding_is_the_limit(increments):
    arch = generators.arch(thickness_ratio=0.15, voussoirs=12)
    response = settle(arch, 2.0, solver.Controls(increments=increments), direction=(1, 0), increment=0.009, limit=0.027)
    assert response.settlement.tolist() == [0.0, 0.009, 0.018, 0.027]


@pytest.mark.slow
def test_goes_on_from_a_checkpoint_bit_for_bit():
    arch = generators.arch(thickness_ratio=0.15, voussoirs=12)
    spread = solver.Settlement(direction=(1, 0), increment=0.02, limit=0.05)
    sink = solver.Settlement(direction=(0, -1), increment=0.03, limit=0.5)
    given = {
        "interfaces": solver.Interfaces(solver.InterfaceLaw(2.0)),
        "loads": solver.self_weight(arch),
        "controls": PAPER,
    }
    whole = list(settlement_increments(arch, (spread, sink), **given))
    assert {increment.phase for increment in whole} == {0, 1}
    for k in (0, 2, 3, 4, len(whole) - 2):
        rest = list(settlement_increments(arch, (spread, sink), resume=whole[k].checkpoint, **given))
        assert len(rest) == len(whole) - k - 1
        for one, other in zip(rest, whole[k + 1 :], strict=True):
            for name in ("parameter", "phase", "reaction", "status", "programs", "velocity", "forces", "displacements"):
                assert same(getattr(one, name), getattr(other, name)), (k, name)
            assert same(one.pose, other.pose)


def test_a_checkpoint_of_the_other_method_is_refused():
    arch = generators.arch(thickness_ratio=0.15, voussoirs=12)
    spread = (solver.Settlement(direction=(1, 0), increment=0.02, limit=0.04),)
    given = {"interfaces": solver.Interfaces(solver.InterfaceLaw(2.0)), "loads": solver.self_weight(arch)}
    checkpoint = list(settlement_increments(arch, spread, controls=PAPER, **given))[1].checkpoint
    with pytest.raises(ValueError, match="found in another way"):
        next(settlement_increments(arch, spread, resume=checkpoint, **given))
