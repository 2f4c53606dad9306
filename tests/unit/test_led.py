"""A step in the plane that is followed from its start: what it finds is a solution, also where the structure snaps."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

import solver
from blockvis.generators import catalogue
from solver.program import coulomb, led
from solver.program.states import in_states
from solver.program.step import Moved, NotSolved, Pattern, Step, paired

Followed = list[tuple[Step, np.ndarray, Moved]]


@pytest.fixture(scope="module")
def followed() -> Followed:
    """Steps of a panel whose support sinks, at which Newton's method on the states had gone round."""
    steps: Followed = []

    def kept(step: Step, pattern: Pattern, gone: np.ndarray, start: Moved) -> Moved:
        steps.append((step, gone, start))
        return led.led(step, pattern, gone, start)

    panel = catalogue.build("panel", {"nb": 5, "nc": 6, "block_height": 0.1})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(coulomb, "led", kept)
        solver.settle(panel, solver.Settlement([0.0, -1.0], increment=0.004, limit=0.08), friction_coefficient=0.3)
    return steps


def test_what_is_found_is_a_solution(followed: Followed) -> None:
    """Balance, and the conditions of contact and of friction without lift, from their definition."""
    solved = 0
    for step, gone, start in followed:
        pattern = Pattern(step)
        try:
            found = in_states(step, pattern, gone, led.led(step, pattern, gone, start))
        except NotSolved:
            continue
        assert found is not None
        solved += 1
        relative = (step.matrix[step.free].T @ found.motion).reshape(-1, 2)
        across, along = step.give
        gap = step.gap + relative[:, 0] + across * (found.normal - step.normal)
        slip = (step.slip + relative[:, 1:] + along * (found.shear - step.shear))[:, 0]
        normal, shear = found.normal, found.shear[:, 0]
        near = 1e-7 * (step.size + along)
        assert np.abs(
            step.load + step.matrix[step.free] @ paired(normal, found.shear) - step.drag * (gone + found.motion)
        ).max() == pytest.approx(0.0, abs=1e-8)
        assert normal.min() >= 0.0
        assert gap.min() >= -near
        assert np.abs(normal * gap).max() <= near * normal.max()
        assert (np.abs(shear) <= step.friction * normal + 1e-8 * normal.max()).all()
        # What slips has used up its friction, and is held back by it.
        slips = (np.abs(slip) > near) & (normal > 1e-6)
        assert shear[slips] == pytest.approx(-np.sign(slip[slips]) * (step.friction * normal)[slips], abs=1e-6)
    assert solved > 0.7 * len(followed)
    assert solved > 10


def snapping(load: float) -> tuple[Step, np.ndarray, Moved]:
    """A block whose only contact point, as it slides, pushes it off with half of its normal force.

    It moves by q along x; its point opens by q and slips by -3 q, with μ = 0.5, give 1, N⁰ = 1 and drag 0.01. Stuck it
    takes the load -1 + 10.01 q up to q = 1/7; sliding 0.01 q + (1 - q) / 2, which falls; open, from q = 1 on, 0.01 q.
    """
    arms = np.array([[1.0, 0.0, 0.0], [-3.0, 0.0, 0.0]])
    columns = np.hstack([arms, -arms])
    matrix = sp.csc_array((columns.ravel(), np.tile(np.arange(6), 2), np.array([0, 6, 12])), shape=(6, 2))
    none = np.zeros(1)
    step = Step(
        matrix=matrix,
        free=np.arange(6) < 3,
        load=np.array([load, 0.0, 0.0]),
        drag=np.full(3, 0.01),
        gap=none,
        slip=none[:, None],
        normal=np.ones(1),
        shear=none[:, None],
        friction=np.full(1, 0.5),
        give=(1.0, 1.0),
        size=1.0,
    )
    start = Moved(np.zeros(3), step.normal, step.shear, 0.0, 0, np.array([[1.0], [0.0]]), np.zeros((3, 1)))
    return step, np.zeros(3), start


@pytest.mark.parametrize(("load", "movement"), [(0.3, 1.3 / 10.01), (0.6, 60.0)])
def test_the_way_goes_on_through_a_snap(load: float, movement: float) -> None:
    """Beyond the largest load that the stuck point takes, 0.43, the open one is found."""
    step, gone, start = snapping(load)
    pattern = Pattern(step)
    found = in_states(step, pattern, gone, led.led(step, pattern, gone, start))
    assert found is not None
    assert found.motion == pytest.approx([movement, 0.0, 0.0], rel=1e-9)


def test_where_the_start_leads_nowhere_it_says_how_far() -> None:
    """A drag that drives: an open point has no state that the load could go on with."""
    step, gone, start = snapping(0.6)
    with pytest.raises(NotSolved, match="leads no further than"):
        led.led(replace(step, drag=np.full(3, -0.01)), Pattern(replace(step, drag=np.full(3, -0.01))), gone, start)
