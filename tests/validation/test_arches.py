"""Table A of the reference values: circular arches that hinge only (friction coefficient 2).

Reference: exact three-hinge kinematics with exact thrust lines, and energy descent, computed independently of this
code; two or three codes agree to eight digits. Minimum thickness: Milankovitch (1907).
"""

import numpy as np
import pytest
from structures import rectangle

import solver
from blockvis import generators

pytestmark = pytest.mark.path

THOROUGH = {"marks": pytest.mark.thorough}

#: embrace [degrees], t/R, n, d_c/R, H/W at the start, H/W at collapse.
SPREADING = [
    (180, 0.15, 12, 0.14104982, 0.1771150, 0.2420193),
    pytest.param(180, 0.15, 13, 0.15910759, 0.1741342, 0.2459914, **THOROUGH),
    pytest.param(180, 0.15, 24, 0.14034471, 0.175998, 0.240540, **THOROUGH),
    pytest.param(180, 0.20, 16, 0.23555602, 0.153952, 0.278566, **THOROUGH),
    pytest.param(120, 0.10, 12, 0.15286859, 0.302630, 0.556513, **THOROUGH),
    pytest.param(120, 0.10, 13, 0.14352524, 0.301427, 0.596130, **THOROUGH),
    pytest.param(140, 0.10, 12, 0.11619552, 0.259409, 0.418360, **THOROUGH),
]

#: embrace, t/R, n, v_c/R, VR/W start, VR/W collapse, H/W start, H/W collapse.
SINKING = [
    (180, 0.15, 12, 0.33003942, 0.487901, 0.559286, 0.192939, 0.201949),
    pytest.param(140, 0.10, 12, 0.35254631, 0.478934, 0.580438, 0.297661, 0.337135, **THOROUGH),
]


def _settle(embrace, ratio, n, direction, increment=0.01):
    arch = generators.arch(embrace=embrace, thickness_ratio=ratio, voussoirs=n)
    settlement = solver.Settlement(direction=direction, increment=increment, limit=1.0, tolerance=increment / 1000)
    return solver.settle(arch, settlement, friction_coefficient=2.0, controls=solver.Controls(falling_frames=0))


@pytest.mark.parametrize(("embrace", "ratio", "n", "collapse", "first", "last"), SPREADING)
def test_spreading(embrace, ratio, n, collapse, first, last):
    response = _settle(embrace, ratio, n, (1, 0))
    assert response.stop is solver.Status.COLLAPSED
    assert response.collapse.displacement == pytest.approx(collapse, rel=1e-3)
    low, high = response.collapse.bracket
    assert high - low <= 1.001e-5
    assert response.initial_reaction / response.total_weight == pytest.approx(first, abs=1e-6)
    assert response.collapse.reaction / response.total_weight == pytest.approx(last, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(("embrace", "ratio", "n", "collapse", "first", "last", "h_first", "h_last"), SINKING)
def test_sinking(embrace, ratio, n, collapse, first, last, h_first, h_last):
    response = _settle(embrace, ratio, n, (0, -1))
    assert response.collapse.displacement == pytest.approx(collapse, rel=1e-3)
    weight = response.total_weight
    assert response.initial_reaction / weight == pytest.approx(first, abs=1e-6)
    springer = response.assembly.index("right springer")
    for increment, v, h, tolerance in (
        (response.path[1], first, h_first, 2e-2),
        (response.path[-1], last, h_last, 1e-3),
    ):
        assert -increment.support_forces[springer, 1] / weight == pytest.approx(v, abs=tolerance)
        assert increment.reaction / weight == pytest.approx(v, abs=tolerance)
        assert increment.support_forces[springer, 0] / weight == pytest.approx(h, abs=tolerance)


@pytest.mark.parametrize(
    "increment",
    [*(pytest.param(h, **THOROUGH) for h in (0.02, 0.01)), pytest.param(0.0025, marks=pytest.mark.slow)],
)
def test_collapse_does_not_depend_on_the_increment(increment):
    """The bracket's width is what remains, and 1e-4 that the joints' compliance and viscosity leave."""
    reference = 0.14104982
    response = _settle(180, 0.15, 12, (1, 0), increment)
    assert abs(response.collapse.displacement - reference) < increment / 1000 + 2e-5


@pytest.mark.parametrize(
    "increment", [0.01, pytest.param(0.02, **THOROUGH), pytest.param(0.0025, marks=pytest.mark.slow)]
)
@pytest.mark.slow
def test_relocating_hinge_is_met_at_every_increment(increment):
    """A hinge jumps to the next joint at d = 0.12885; the structure finds its new equilibrium and goes on."""
    response = _settle(120, 0.10, 13, (1, 0), increment)
    assert response.collapse.displacement == pytest.approx(0.14352524, rel=5e-4)
    jump = np.argmax(np.diff(response.reaction) / np.diff(response.settlement))
    assert response.settlement[jump] <= 0.12885 + 1e-6
    assert response.settlement[jump + 1] >= 0.12885 - 1e-4


@pytest.mark.thorough
def test_odd_number_of_voussoirs_follows_the_stable_asymmetric_path():
    response = _settle(180, 0.15, 13, (1, 0))
    assert response.collapse.displacement < 0.17  # the symmetric, unstable path would last to 0.177339
    turned = response.path[3].pose.rotations[:13, 0]
    assert np.abs(turned + turned[::-1]).max() > 1e-4


@pytest.mark.parametrize(("n", "thinnest"), [(24, 0.107478), pytest.param(48, 0.107478, marks=pytest.mark.thorough)])
def test_minimum_thickness_of_the_semicircle(n, thinnest):
    """Below Milankovitch's thickness no equilibrium exists; with few voussoirs a little less is enough."""
    still = solver.Settlement(direction=(1, 0), increment=1e-4, limit=1e-4)

    def stands(ratio):
        arch = generators.arch(thickness_ratio=ratio, voussoirs=n)
        return solver.settle(arch, still, friction_coefficient=2.0).stop is not solver.Status.NO_INITIAL_EQUILIBRIUM

    assert stands(thinnest * 1.005)
    assert not stands(thinnest * 0.97)


@pytest.mark.slow
def test_pointed_arch_keeps_the_hinge_at_its_apex():
    """As engines and long increments do; a step that was too long ended on an equilibrium afar, at 0.26 m."""
    arch = generators.pointed_arch()
    spread = solver.Settlement(direction=(1, 0), increment=0.02, limit=0.28)
    response = solver.settle(arch, spread, friction_coefficient=0.7)
    assert not response.notes
    rotations = response.path[-1].pose.rotations[arch.free, 0]
    assert rotations == pytest.approx(-rotations[::-1], abs=1e-3)
    assert rotations.min() == pytest.approx(-0.1192, abs=1e-3)


def on_a_buttress_that_leans():
    """An arch of ten voussoirs on a fixed springer and on a buttress, 0.8 × 3 m, with the ground under it."""
    inner, outer, angles = 0.875, 1.125, np.linspace(np.pi, 0.0, 11)
    rings = [radius * np.column_stack([np.cos(angles), np.sin(angles)]) for radius in (inner, outer)]
    outlines = [np.array([rings[0][k + 1], rings[1][k + 1], rings[1][k], rings[0][k]]) for k in range(10)]
    outlines += [rectangle(inner, -3.0, inner + 0.8, 0.0), rectangle(-outer, -0.3, -inner, 0.0)]
    outlines += [rectangle(inner - 0.5, -3.3, inner + 0.8, -3.0)]
    return solver.Assembly.from_outlines(outlines, roles=["free"] * 11 + ["fixed", "moving"])


@pytest.mark.parametrize("increment", [0.02, pytest.param(0.01, **THOROUGH), pytest.param(0.005, **THOROUGH)])
@pytest.mark.slow
def test_an_arch_on_a_buttress_that_leans_begins_on_hinges_that_have_an_equilibrium(increment):
    """The buttress turns about its outer toe; the hinges next to them have none up to 0.00606 rad, and end at 0.1089.

    Reference: exact three-hinge kinematics with the thrust inside all other joints, which leaves the tenth at the end.
    """
    leans = solver.Settlement(
        rotation_centre=(1.675, -3.0), rotation=-1, increment=increment, limit=1.0, tolerance=1e-5
    )
    controls = solver.Controls(falling_frames=0)
    response = solver.settle(on_a_buttress_that_leans(), leans, friction_coefficient=0.8, controls=controls)
    assert response.collapse.displacement == pytest.approx(0.0758507, rel=2e-4)
    if increment == 0.01:
        assert response.reaction[1] == pytest.approx(-16833.91, rel=1e-5)
