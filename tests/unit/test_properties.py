"""What must not change the answer: frame, units, mirror image, order of the blocks, distance from the origin."""

from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import Phase, example, given, settings
from hypothesis import strategies as st

import solver
from blockvis import generators
from solver import mechanics

pytestmark = pytest.mark.path

few = settings(max_examples=4, deadline=None, derandomize=True, database=None, phases=[Phase.explicit, Phase.generate])


@dataclass(frozen=True)
class Case:
    """A structure with its settlement and the direction of gravity."""

    outlines: tuple[np.ndarray, ...]
    roles: tuple[str, ...]
    friction_coefficient: float
    direction: np.ndarray
    increment: float
    limit: float
    gravity: np.ndarray
    density: float = 2000.0

    def settle(self):
        assembly = solver.Assembly.from_outlines(self.outlines, roles=self.roles, density=self.density)
        dead = np.zeros((assembly.n_blocks, 3))
        dead[:, :2] = self.gravity * (assembly.masses * solver.GRAVITY)[:, None]
        return solver.settle(
            assembly,
            solver.Settlement(direction=self.direction, increment=self.increment, limit=self.limit),
            friction_coefficient=self.friction_coefficient,
            loads=solver.Loads(dead, np.zeros_like(dead)),
            controls=solver.Controls(falling_frames=0),
        )

    def mapped(self, matrix, shift=(0.0, 0.0)):
        """The case with everything, gravity and settlement included, under a rotation or reflection."""
        return replace(
            self,
            outlines=tuple(outline @ matrix.T + shift for outline in self.outlines),
            direction=matrix @ self.direction,
            gravity=matrix @ self.gravity,
        )


def _case(assembly, friction_coefficient, direction, increment, limit):
    outlines = tuple(assembly.outline(i) for i in range(assembly.n_blocks))
    down = np.array([0.0, -1.0])
    direction = np.array(direction, dtype=float)
    return Case(outlines, tuple(assembly.roles.tolist()), friction_coefficient, direction, increment, limit, down)


def _wall():
    """Running bond 3 × 3 with slightly odd lengths, on a base in two parts."""
    outlines: list[list[list[float]]] = []
    for course, joints in enumerate(([0, 2, 4.1, 6], [0, 1, 3.05, 5, 6], [0, 2, 4.1, 6])):
        outlines += [
            [[left, course], [right, course], [right, course + 1], [left, course + 1]]
            for left, right in pairwise(joints)
        ]
    roles = ["free"] * len(outlines) + ["fixed", "moving"]
    outlines += [[[-1, -1], [3.3, -1], [3.3, 0], [-1, 0]], [[3.3, -1], [7, -1], [7, 0], [3.3, 0]]]
    return solver.Assembly.from_outlines(outlines, roles=roles)


CASES = {
    "hinging arch": _case(generators.arch(embrace=140, thickness_ratio=0.12, voussoirs=8), 2.0, (1, 0), 0.02, 0.5),
    "sliding arch": _case(generators.arch(thickness_ratio=0.3, voussoirs=7), 0.35, (1, 0), 0.02, 0.5),
    "sinking wall": _case(_wall(), 0.5, (0.0, -1.0), 0.05, 0.05),
}


def all_but(*names):
    """Each case, these among what is thorough: the default set has one case or another for each property."""
    marks = {name: [pytest.mark.thorough] for name in names}
    return pytest.mark.parametrize("name", [pytest.param(name, marks=marks.get(name, ())) for name in CASES])


SLIDING_THOROUGHLY = all_but("sliding arch")
ARCHES_THOROUGHLY = all_but("hinging arch", "sliding arch")


@cache
def original(name):
    return CASES[name].settle()


def assert_same(name, response, length=1.0, force=1.0):
    """The same reaction at the start, the same end, the same curve between; lengths and forces in other units."""
    before = original(name)
    assert response.stop is before.stop
    assert response.initial_reaction / force == pytest.approx(before.initial_reaction, rel=1e-6)
    if before.collapse is None:
        return
    # Where joints slide, where an increment happens to be divided shows in the third digit.
    width = np.ptp(before.collapse.bracket) + (3e-3 * before.collapse.displacement if name == "sliding arch" else 0.0)
    assert abs(response.collapse.displacement / length - before.collapse.displacement) <= 1.5 * width
    s = before.settlement[before.settlement <= 0.9 * before.collapse.displacement]
    ours = np.interp(s, response.settlement / length, response.reaction / force)
    assert ours == pytest.approx(before.reaction[: len(s)], rel=2e-2)


def rotation(angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]])


@pytest.mark.slow
def test_cases_collapse_slide_and_settle():
    assert original("hinging arch").stop is solver.Status.COLLAPSED
    assert original("sliding arch").stop is solver.Status.COLLAPSED
    assert any((i.states == mechanics.ContactState.SLIDING).any() for i in original("sliding arch").path)
    wall = original("sinking wall")
    assert wall.stop is solver.Status.LIMIT_REACHED
    assert 0.05 < wall.initial_reaction / wall.total_weight < 0.6


@pytest.mark.thorough
@ARCHES_THOROUGHLY
@few
@given(angle=st.floats(-np.pi, np.pi))
@example(angle=np.pi / 2)
@example(angle=np.pi)
def test_frame(name, angle):
    assert_same(name, CASES[name].mapped(rotation(angle)).settle())


@pytest.mark.thorough
@ARCHES_THOROUGHLY
@few
@given(exponent=st.floats(-3, 3), heavier=st.floats(-3, 3))
def test_units(name, exponent, heavier):
    """Lengths in millimetres or kilometres, forces in kilonewtons or millinewtons."""
    case, length, density = CASES[name], 10.0**exponent, 10.0**heavier
    scaled = replace(
        case,
        outlines=tuple(length * outline for outline in case.outlines),
        increment=length * case.increment,
        limit=length * case.limit,
        density=density * case.density,
    )
    assert_same(name, scaled.settle(), length, density * length**2)


@ARCHES_THOROUGHLY
def test_mirror_image(name):
    assert_same(name, CASES[name].mapped(np.diag([-1.0, 1.0])).settle())


@pytest.mark.thorough
@ARCHES_THOROUGHLY
@few
@given(random=st.randoms(use_true_random=False))
def test_order_of_the_blocks(name, random):
    case = CASES[name]
    order = list(range(len(case.roles)))
    random.shuffle(order)
    # Each outline starts at another corner too.
    outlines = tuple(np.roll(case.outlines[i], random.randrange(4), axis=0) for i in order)
    shuffled = replace(case, outlines=outlines, roles=tuple(case.roles[i] for i in order))
    assert_same(name, shuffled.settle())


@ARCHES_THOROUGHLY
@pytest.mark.parametrize("shift", [(5e5, 5e6), pytest.param((-3e3, 1e4), marks=pytest.mark.thorough)])
def test_far_from_the_origin(name, shift):
    """In map coordinates, UTM, metres are left with nine digits after the point."""
    assert_same(name, CASES[name].mapped(np.eye(2), np.array(shift)).settle())


@pytest.mark.thorough
@pytest.mark.parametrize("scale", [1.0, pytest.param(10.0**1.25, marks=pytest.mark.thorough)])
def test_blocks_that_sink_along_a_head_joint_do_not_move_sideways(scale):
    """Nothing pushes them. The block above, whose centroid lies beyond its bearing, follows and turns about it."""
    case = CASES["sinking wall"]
    response = replace(
        case,
        outlines=tuple(scale * outline for outline in case.outlines),
        increment=scale * 0.05,
        limit=scale * 0.1,
    ).settle()
    for increment in response.path:
        moved = increment.pose.displacements(response.assembly)
        assert np.abs(moved[[2, 6], 0]).max() < 1e-6 * scale
        assert moved[9, 2] == pytest.approx(-np.arctan(increment.settlement / scale), abs=5e-4)


@pytest.mark.thorough
def test_frame_of_a_stack_bond():
    """Four corners meet at each crossing of the joints: whether diagonal neighbours touch is up to rounding."""
    outlines = [[[2 * i, j], [2 * i + 2, j], [2 * i + 2, j + 1], [2 * i, j + 1]] for j in range(3) for i in range(4)]
    outlines += [[[-1, -1], [4, -1], [4, 0], [-1, 0]], [[4, -1], [9, -1], [9, 0], [4, 0]]]
    assembly = solver.Assembly.from_outlines(outlines, roles=["free"] * 12 + ["fixed", "moving"])
    case = _case(assembly, 0.6, (0.0, -1.0), 0.01, 0.01)
    straight = case.settle().initial_reaction
    assert [case.mapped(rotation(angle)).settle().initial_reaction for angle in (0.3, 1.0, 2.0)] == pytest.approx(
        [straight] * 3, rel=1e-6
    )
