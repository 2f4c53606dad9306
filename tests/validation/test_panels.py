"""Table C of the reference values: running-bond panels at the onset of settlement.

Reference: the smallest vertical reaction over all statically admissible states, from static programs in other
formulations, as fractions where they are rational; two or three codes agree to eight digits.
"""

from itertools import pairwise

import numpy as np
import pytest

import solver
from solver import mechanics

pytestmark = pytest.mark.path

#: Bricks along the panel, courses, where the settling base begins, R/W for μ = 0.3, 0.6, 0.75.
PANELS = [
    (3, 4, 3.0, (25 / 218, 25 / 272, 2 / 25)),
    (4, 3, 4.0, (75 / 218, 75 / 272, 6 / 25)),
    (5, 6, 5.0, (0.169916245, 25 / 204, 8 / 75)),
    (5, 6, 20 / 3, (5 / 109, 5 / 136, 4 / 125)),
    (6, 5, 6.0, (100 / 327, 25 / 102, 16 / 75)),
]

#: Of the two smallest panels one friction coefficient, the others among what is thorough.
ROWS = [
    pytest.param(nb, nc, start, mu, ratio, marks=() if mu == 0.6 and nb < 5 else pytest.mark.thorough)
    for nb, nc, start, ratios in PANELS
    for mu, ratio in zip((0.3, 0.6, 0.75), ratios, strict=True)
]


def panel(bricks, courses, start, scale=1.0):
    """Bricks 2 × 1 in running bond; the base settles to the right of ``start``."""
    end, outlines = 2 * bricks, []
    for course in range(courses):
        joints = [0, *range(1, end, 2), end] if course % 2 else range(0, end + 1, 2)
        for left, right in pairwise(joints):
            outlines.append([[left, course], [right, course], [right, course + 1], [left, course + 1]])
    free = len(outlines)
    outlines.append([[-1, -1], [start, -1], [start, 0], [-1, 0]])
    outlines.append([[start, -1], [end + 1, -1], [end + 1, 0], [start, 0]])
    return solver.Assembly.from_outlines(
        [scale * np.asarray(outline, dtype=float) for outline in outlines], roles=["free"] * free + ["fixed", "moving"]
    )


def onset(assembly, friction_coefficient, increment=0.02):
    sink = solver.Settlement(direction=(0, -1), increment=increment, limit=increment)
    controls = solver.Controls(falling_frames=0)
    return solver.settle(assembly, sink, friction_coefficient=friction_coefficient, controls=controls)


@pytest.mark.parametrize(("bricks", "courses", "start", "friction_coefficient", "ratio"), ROWS)
def test_onset(bricks, courses, start, friction_coefficient, ratio):
    response = onset(panel(bricks, courses, start), friction_coefficient)
    assert response.stop is solver.Status.LIMIT_REACHED
    assert response.initial_reaction / response.total_weight == pytest.approx(ratio, abs=1e-6)


@pytest.mark.parametrize("increment", [1e-4, pytest.param(0.1, marks=pytest.mark.thorough)])
def test_onset_does_not_depend_on_the_increment(increment):
    response = onset(panel(5, 6, 5.0), 0.3, increment)
    assert response.initial_reaction / response.total_weight == pytest.approx(0.169916245, abs=1e-6)


@pytest.mark.parametrize(
    "friction_coefficient",
    [pytest.param(0.0, marks=pytest.mark.thorough), 0.3, 0.6, pytest.param(0.75, marks=pytest.mark.thorough), 2.0],
)
def test_column_that_drops_along_a_head_joint(friction_coefficient):
    """R = W_m / (1 + μ²): the flow rule is associative, so that the column moves away at μ times what it drops.

    With μ above 1 it would rather lean on the wall and tip: R = W_m / 2, since the smallest reaction has the largest
    rate of work among the mechanisms.
    """
    outlines = [
        [[0, 0], [1, 0], [1, 1], [0, 1]],
        [[0, 1], [1, 1], [1, 2], [0, 2]],
        [[-2, -1], [0, -1], [0, 3], [-2, 3]],
        [[0, -1], [3, -1], [3, 0], [0, 0]],
    ]
    assembly = solver.Assembly.from_outlines(outlines, roles=["free", "free", "fixed", "moving"])
    reaction = onset(assembly, friction_coefficient).initial_reaction / mechanics.total_weight(assembly)
    assert reaction == pytest.approx(max(1 / (1 + friction_coefficient**2), 0.5), abs=1e-6)
