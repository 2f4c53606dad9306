"""A light piece that falls and is caught: the path goes on; what nothing catches is a collapse."""

import importlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import solver
from blockvis import generators
from solver.mechanics import settlement_increments

pytestmark = pytest.mark.path

WIDTH, HEIGHT, SLOT = 0.1, 0.2, 0.02

#: What joints give along themselves, in block sizes.
SLIP = 5e-6


def _bench(*, wall=True):
    """A small block flush with the end of a bench that tilts, a slot and a wall beside it; elsewhere a big block."""
    outlines = {
        "pebble": [[-WIDTH, 0], [0, 0], [0, HEIGHT], [-WIDTH, HEIGHT]],
        "tower": [[-6, 0], [-4, 0], [-4, 2], [-6, 2]],
        "bench": [[-2, -1], [0, -1], [0, 0], [-2, 0]],
        "ground": [[-7, -1], [-3, -1], [-3, 0], [-7, 0]],
    }
    roles = ["free", "free", "moving", "fixed"]
    if wall:
        outlines["wall"] = [[SLOT, -1], [1, -1], [1, 0.5], [SLOT, 0.5]]
        roles.append("moving")
    return solver.Assembly.from_outlines(
        list(outlines.values()),
        names=list(outlines),
        roles=roles,
    )


TILT = solver.Settlement(rotation_centre=(0.0, 0.0), rotation=-1.0, increment=0.05, limit=0.6)
PAPER = solver.Controls(increments="linear program")
BOTH = pytest.mark.parametrize(
    "controls",
    [solver.Controls(), pytest.param(PAPER, marks=pytest.mark.thorough)],
    ids=lambda controls: controls.increments,
)


@pytest.mark.thorough
def test_a_pebble_that_tips_leans_on_the_wall_beside():
    assembly = _bench()
    response = solver.settle(assembly, TILT, friction_coefficient=1.0)
    assert response.stop is solver.Status.LIMIT_REACHED
    tips, turn = np.arctan2(WIDTH, HEIGHT), np.arcsin(SLOT / HEIGHT)
    # Where it lands its foot may be off by what joints give along themselves.
    near = SLIP * assembly.block_size / HEIGHT
    for increment in response.path:
        leans = increment.settlement + (turn if increment.settlement > tips else 0.0)
        assert increment.pose.rotations[0, 0] == pytest.approx(-leans, abs=near)


@BOTH
@pytest.mark.slow
def test_a_pebble_that_nothing_catches_is_a_collapse(controls):
    response = solver.settle(
        _bench(wall=False), TILT, friction_coefficient=1.0, controls=replace(controls, local_loss=0.0)
    )
    assert response.stop is solver.Status.COLLAPSED
    assert response.notes == ()
    assert response.collapse.displacement == pytest.approx(np.arctan2(WIDTH, HEIGHT), abs=2 * TILT.tolerance)
    low, high = response.collapse.bracket
    assert high - low <= TILT.tolerance * (1 + 1e-6)


@pytest.mark.thorough
@BOTH
def test_an_arch_collapses_though_its_fall_would_jam(controls):
    """The mechanism of an arch is no light piece, and a pebble on a bench beside it changes nothing about it."""
    arch = generators.arch(radius=1.0, thickness_ratio=0.15, embrace=180.0, voussoirs=12)
    spread = solver.Settlement(direction=(1.0, 0.0), increment=0.01, limit=0.2)
    response = solver.settle(arch, spread, friction_coefficient=2.0, controls=controls)
    assert response.collapse.displacement == pytest.approx(0.14104982, rel=1e-3)
    assert response.notes == ()


@pytest.mark.slow
def test_a_run_resumes_from_a_checkpoint_before_or_after_a_snap():
    assembly = _bench()
    given = {
        "interfaces": solver.Interfaces(solver.InterfaceLaw(1.0)),
        "loads": solver.self_weight(assembly),
    }
    whole = list(settlement_increments(assembly, (TILT,), **given))
    fell = next(k for k, i in enumerate(whole) if -i.pose.rotations[0, 0] > i.settlement + 0.05)
    for k in (fell - 1, fell):
        rest = list(settlement_increments(assembly, (TILT,), resume=whole[k].checkpoint, **given))
        assert [i.notes for i in rest] == [i.notes for i in whole[k + 1 :]]
        assert [i.pose.rotations.tobytes() for i in rest] == [i.pose.rotations.tobytes() for i in whole[k + 1 :]]


@pytest.mark.slow
def test_friction_that_has_yet_to_follow_holds_nothing_up(monkeypatch):
    """Stones that friction bounds hold back come to rest a hundredth of their size farther on, and do not fall."""
    monkeypatch.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
    wall = importlib.import_module("convergence_walls").WALLS["rubble 160"]()
    response = solver.settle(
        wall.assembly,
        replace(wall.settlement, increment=wall.settlement.increment / 4.0),
        interfaces=solver.Interfaces(solver.InterfaceLaw(wall.friction)),
        loads=wall.loads,
        controls=solver.Controls(falling_frames=0),
    )
    assert response.stop is solver.Status.LIMIT_REACHED
