"""Blocks that leave for good while the structure stands: a pier that is tilted, and a slender brick at its edge."""

import math

import numpy as np
import pytest

import solver

#: Names and outlines, width over height of pier and brick: they turn over at angles with these tangents.
BLOCKS = {
    "ground": [[-2, -1], [2, -1], [2, 0], [-2, 0]],
    "pier": [[-0.5, 0], [0.5, 0], [0.5, 1.5], [-0.5, 1.5]],
    "brick": [[0.4, 1.5], [0.5, 1.5], [0.5, 1.9], [0.4, 1.9]],
}
PIER, BRICK = math.atan(1.0 / 1.5), math.atan(0.1 / 0.4)


def tilted(order=(0, 1, 2), mirrored=False, local_loss=0.05):
    """The pier on ground that turns about its middle, so that the brick is at the lower edge."""
    names = [list(BLOCKS)[k] for k in order]
    sense = -1.0 if mirrored else 1.0
    outlines = [[[sense * x, y] for x, y in BLOCKS[name]] for name in names]
    assembly = solver.Assembly.from_outlines(
        outlines, names=names, roles=["moving" if name == "ground" else "free" for name in names]
    )
    turn = solver.Settlement(rotation_centre=(0.0, 0.0), rotation=-sense, increment=0.05, limit=1.0, tolerance=1e-5)
    controls = solver.Controls(local_loss=local_loss, falling_frames=1)
    return solver.settle(assembly, turn, friction_coefficient=0.9, controls=controls)


@pytest.mark.parametrize(
    ("order", "mirrored"),
    [
        pytest.param((0, 1, 2), False, id="drawn", marks=pytest.mark.thorough),
        pytest.param((2, 0, 1), False, id="shuffled", marks=pytest.mark.thorough),
        pytest.param((1, 2, 0), True, id="mirror and shuffled", marks=pytest.mark.slow),
    ],
)
def test_the_path_continues_to_the_collapse_of_the_structure(order, mirrored):
    response = tilted(order, mirrored)
    assert response.stop is solver.Status.COLLAPSED
    assert response.collapse.displacement == pytest.approx(PIER, abs=2e-4)
    (loss,) = response.losses
    assert loss.blocks == ("brick",)
    assert loss.settlement == pytest.approx(BRICK, abs=2e-4)
    assert loss.share == pytest.approx(0.04 / 1.54)
    assert loss.weight == pytest.approx(0.04 * 2000.0 * solver.GRAVITY)
    fallen = np.array([i.fallen[response.assembly.index("brick")] for i in response.path])
    assert np.array_equal(fallen, response.settlement > loss.settlement + 1e-9)
    assert max(i.certificate.equilibrium_residual for i in response.path) < 1e-9
    assert sum("brick' falls" in note for note in response.notes) == 1


@pytest.mark.parametrize("local_loss", [0.0, pytest.param(0.02, marks=pytest.mark.thorough)])
@pytest.mark.slow
def test_the_first_loss_ends_it_where_that_is_asked_for(local_loss):
    response = tilted(local_loss=local_loss)
    assert response.stop is solver.Status.COLLAPSED
    assert response.collapse.displacement == pytest.approx(BRICK, abs=2e-4)
    assert response.losses == ()


@pytest.mark.parametrize("share", [1.5, -0.1])
def test_a_share_is_from_0_to_1(share):
    with pytest.raises(ValueError, match=rf"local_loss is {share:g}; it is a number from 0 to 1"):
        solver.Controls(local_loss=share)
