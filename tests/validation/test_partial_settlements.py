"""Structures of which only a part is tilted or settles, against statics and against the same with rigid parts."""

import numpy as np
import pytest
from structures import brick

import solver
from solver import mechanics

#: A pier of six drums, 1 m wide and 6 m high, on a footing that turns about the middle of its top.
PIER = [brick(-1.0, -1.0, 3.0, 1.0), *(brick(0.0, k, 1.0, 1.0) for k in range(6))]
TILTS = solver.Settlement(rotation_centre=(0.5, 0.0), rotation=-1, increment=0.01, limit=0.2, tolerance=1e-5)


@pytest.mark.parametrize(
    ("beside", "roles", "gone", "farthest"),
    [
        ([], [], [], (0.5, 6.0)),
        # Another pier that stands on its own; a support that carried only what has been taken away.
        ([brick(9.0, -1.0, 2.0, 1.0), brick(9.5, 0.0, 1.0, 1.0)], ["fixed", "free"], [], (0.5, 6.0)),
        ([brick(1.0, 2.0, 1.0, 2.0), brick(0.0, 6.0, 2.0, 1.0)], ["fixed", "free"], [8], (0.5, 6.0)),
        # A beam to another support does not turn with the pier, whose drums do; once that is gone it does.
        ([brick(1.5, 1.0, 0.5, 5.0), brick(0.0, 6.0, 1.8, 1.0)], ["fixed", "free"], [], (0.5, 6.0)),
        ([brick(1.5, 1.0, 0.5, 5.0), brick(0.0, 6.0, 1.8, 1.0)], ["fixed", "free"], [7], (1.3, 7.0)),
    ],
)
def test_the_lever_of_a_tilt_is_the_farthest_block_that_rests_on_it_alone(beside, roles, gone, farthest):
    assembly = solver.Assembly.from_outlines([*PIER, *beside], roles=["moving", *["free"] * 6, *roles])
    change = solver.PhaseChange(0, removed=np.isin(np.arange(assembly.n_blocks), gone))
    options = {"interfaces": solver.Interfaces(), "loads": solver.self_weight(assembly)}
    first = next(iter(mechanics.settlement_increments(assembly, [TILTS], changes=[change], **options)))
    # The first step is a hundred-thousandth of a block size of its farthest point.
    assert 1e-5 * assembly.block_size / first.checkpoint.step == pytest.approx(np.hypot(*farthest))


@pytest.mark.slow
def test_no_energy_is_lost_where_a_block_is_lifted_over_its_support_and_lowered_again():
    """Work that cancels made all that was left of it the residual: 1 where the net work came to zero."""
    turn = solver.Settlement(rotation_centre=(0.4, 0.0), rotation=1, increment=0.05, limit=0.2)
    assembly = solver.Assembly.from_outlines([brick(0, 0, 1, 2), brick(-1, -1, 3, 1)], roles=["free", "moving"])
    path = solver.settle(assembly, turn, friction_coefficient=0.7).path
    assert path[1].reaction < 0.0 < path[-1].reaction
    assert max(increment.certificate.energy_residual for increment in path) < 0.02


def arcade(rigid_pier=False):
    """Two semicircular arches, 3 m wide, on fixed abutments and a pier of twelve drums, 0.8 × 6 m, and its footing.

    Voussoirs of one size would have a hinge on either side of the key, of which statics prefers neither.
    """
    angles, corners = np.pi * (1.0 - np.linspace(0.0, 1.0, 12) ** 1.05), []
    for centre in (0.0, 3.8):
        inner, outer = (
            np.array([centre, 6.0]) + radius * np.column_stack([np.cos(angles), np.sin(angles)])
            for radius in (1.5, 1.9)
        )
        corners += [[inner[k], inner[k + 1], outer[k + 1], outer[k]] for k in range(11)]
    drums = [brick(1.5, 0.5 * k, 0.8, 0.5) for k in range(12)]
    supports = [brick(1.0, -1.0, 1.8, 1.0), brick(-2.3, -1.0, 0.8, 7.0), brick(5.3, -1.0, 0.8, 7.0)]
    pier = ["moving" if rigid_pier else "free"] * 12
    roles = ["free"] * 22 + pier + ["moving", "fixed", "fixed"]
    return solver.Assembly.from_outlines([*corners, *drums, *supports], roles=roles, density=2000.0)


@pytest.mark.slow
def test_a_pier_of_drums_turns_with_its_footing_under_two_arches_as_a_rigid_one_does():
    """Held to the speed of the footing, the pier lagged behind, and the arcade fell late.

    By hand: the moment on the footing is that of the arches on a rigid pier and of the pier's weight, whose base turns
    about its toe where that comes to half its width times what stands on it.
    """
    turn = solver.Settlement(rotation_centre=(1.9, 0.0), rotation=-1, increment=0.02, limit=0.2, tolerance=1e-5)
    drums, rigid = (solver.Structure(arcade(rigid), friction_coefficient=0.7).settle(turn) for rigid in (False, True))
    pier = 12 * 0.8 * 0.5 * 2000.0 * 9.81
    for increment, other in zip(drums.path[1:4], rigid.path[1:4], strict=True):
        by_hand = other.reaction + pier * 3.0 * np.sin(increment.settlement)
        assert increment.reaction == pytest.approx(by_hand, rel=1e-3)
    assert max(increment.certificate.energy_residual for increment in drums.path) < 0.02
    # The left arch snaps at 0.06693 rad; what it then thrusts turns the pier over.
    assert rigid.notes[0].startswith("at 0.0669")
    assert drums.collapse.displacement == pytest.approx(0.06693, abs=2e-5)
    last = drums.path[-1]
    pressed = -last.support_forces[34, 1]
    assert last.reaction == pytest.approx(0.4 * pressed, rel=0.05)
    assert last.reaction < 0.4 * pressed
