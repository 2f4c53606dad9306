"""Ties, props and bars in the fall: they hold, yield and break as along the path, and energy only falls."""

import numpy as np
import pytest

import solver
from blockvis.dynamics.engine import Engine
from blockvis.dynamics.ground import on_ground
from solver import mechanics

#: Weight of the block [N].
WEIGHT = 2000.0 * solver.GRAVITY


def hung(tie, rest, at=(0.0, 5.0)):
    """A block of 1 m, its middle at a place [m], on a tie, above a ground far below."""
    corners = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]]) + at
    assembly = solver.Assembly.from_outlines([corners], roles=["free"], density=2000.0)
    whole, pose = on_ground(assembly, solver.Pose.initial(assembly), -20.0)
    loads = np.append(solver.self_weight(assembly).dead, np.zeros((1, 3)), axis=0)
    laws = solver.Interfaces(solver.InterfaceLaw(0.5))
    return Engine(whole, loads, laws, pose, np.zeros((2, 3)), ties=[tie], rest=np.array([rest]))


def tie_of(points, **values):
    return solver.Tie("iron", (None, 0), points, **{"stiffness": 1e7, **values})


def length_of(engine):
    return float(mechanics.tie_lengths(mechanics.tie_ends(engine.ties, engine.assembly, engine.pose))[0])


def test_a_block_hangs_on_a_tie_by_its_weight():
    engine = hung(tie_of(((0.0, 8.0), (0.0, 5.0))), 3.0)
    engine.advance(1.0)
    assert length_of(engine) == pytest.approx(3.0 + WEIGHT / 1e7, abs=1e-5)
    assert engine.tensions[0] == pytest.approx(WEIGHT, rel=1e-3)
    assert engine.fastest < 1e-3


@pytest.mark.parametrize(("brittle", "slower"), [(True, 0.0), (False, 0.6)])
def test_a_block_falls_freely_from_a_tie_that_breaks_and_slower_from_one_that_yields(brittle, slower):
    """With a strength of 0.6 of the weight the rest accelerates the block, by 0.4 g."""
    engine = hung(tie_of(((0.0, 8.0), (0.0, 5.0)), strength=0.6 * WEIGHT, brittle=brittle), 3.0)
    engine.advance(0.2)
    before, fallen = engine.velocity[0, 1] / engine.unit * engine.length, length_of(engine)
    engine.advance(0.2)
    after = engine.velocity[0, 1] / engine.unit * engine.length
    assert (after - before) / 0.2 == pytest.approx(-(1.0 - slower) * solver.GRAVITY, rel=1e-6)
    if brittle:
        assert np.isnan(engine.rest[0])
        assert engine.tensions[0] == 0.0
    else:
        # What it has given is its length without force from then on.
        assert engine.rest[0] == pytest.approx(length_of(engine) - 0.6 * WEIGHT / 1e7, abs=1e-9)
        assert engine.rest[0] > fallen
        assert engine.tensions[0] == pytest.approx(0.6 * WEIGHT, rel=1e-9)


@pytest.mark.parametrize("stiffness", [1e5, 1e7, 1e12])
def test_a_block_on_a_tie_swings_at_its_length_and_energy_only_falls(stiffness):
    engine = hung(tie_of(((3.0, 5.0), (0.0, 5.0)), stiffness=stiffness), 3.0)
    energies, lengths, places = [engine.energies.sum()], [], []
    for _ in range(50):
        engine.advance(0.04)
        energies.append(engine.energies.sum())
        lengths.append(length_of(engine))
        places.append(engine.pose.positions[0, 0])
    scale = WEIGHT * 3.0
    print(stiffness, np.diff(energies).max() / scale, min(lengths), max(lengths), energies[-1] - energies[0], max(places), engine.steps, engine.programs)
