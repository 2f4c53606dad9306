"""Light pieces that fall and are caught: the path goes on; what falls on, or is heavy, is a collapse.

The paper's linear programs tell of every fall; the path of Coulomb friction ends in the same place.
"""

import json

import numpy as np
import pytest

import blockvis
import solver
from blockvis import generators
from solver.analysis.settlement import settlement_increments

pytestmark = pytest.mark.path

WIDTH, HEIGHT, SLOT = 0.1, 0.2, 0.02


def _bench(*, wall=True, density=2000.0):
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
        density=[density, *[2000.0] * (len(outlines) - 1)],
    )


TILT = solver.Settlement(rotation_centre=(0.0, 0.0), rotation=-1.0, increment=0.05, limit=0.6)
PAPER = solver.Controls(increments="linear program")
BOTH = pytest.mark.parametrize(
    "controls",
    [solver.Controls(), pytest.param(PAPER, marks=pytest.mark.thorough)],
    ids=lambda controls: controls.increments,
)


def test_a_pebble_that_tips_over_a_corner_is_caught_by_the_wall_beside():
    assembly = _bench()
    response = solver.settle(assembly, TILT, friction_coefficient=1.0, controls=PAPER)
    assert response.stop is solver.Status.LIMIT_REACHED
    (note,) = response.notes
    tells = next(i for i in response.path if i.notes)
    # It tips at atan(b / h), as on any support that tilts, about its lower corner until the upper one meets the wall;
    # the path comes by in steps of an eighth of the increment.
    tips, turn = np.arctan2(WIDTH, HEIGHT), np.arcsin(SLOT / HEIGHT)
    assert 0.0 <= tells.settlement - tips <= TILT.increment / 8
    assert tells.pose.rotations[0, 0] == pytest.approx(-tells.settlement - turn, abs=1e-5)
    fall = 2.0 * np.hypot(WIDTH, HEIGHT) * np.sin(turn / 2.0)
    assert f"block 'pebble' fell {fall:.2g} m until block 'wall' caught it" in note
    # At the end the moments about the lower corner, of the weight and of the wall's push on the upper one, balance.
    last = response.path[-1]
    assert last.settlement == pytest.approx(TILT.limit)
    assert last.pose.rotations[0, 0] == pytest.approx(-TILT.limit - turn, abs=1e-5)
    lean = TILT.limit + turn
    arm = (HEIGHT * np.sin(lean) - WIDTH * np.cos(lean)) / 2.0
    push, along = np.abs(last.forces[(last.contacts.block_b == 4) & (last.forces[:, 0] > 0.0)][0])
    moment = HEIGHT * (np.cos(turn) * push + np.sin(turn) * along)
    assert moment == pytest.approx(assembly.masses[0] * solver.GRAVITY * arm, rel=1e-4)
    assert last.pose.displacements(assembly)[1] == pytest.approx(np.zeros(3), abs=1e-9)


def test_a_pebble_leans_on_the_wall_beside_on_the_path_of_coulomb_friction():
    assembly = _bench()
    response = solver.settle(assembly, TILT, friction_coefficient=1.0)
    assert response.stop is solver.Status.LIMIT_REACHED
    tips, turn = np.arctan2(WIDTH, HEIGHT), np.arcsin(SLOT / HEIGHT)
    for increment in response.path:
        leans = increment.settlement + (turn if increment.settlement > tips else 0.0)
        assert increment.pose.rotations[0, 0] == pytest.approx(-leans, abs=1e-5)


@pytest.mark.parametrize("falling_frames", [0, 3])
def test_a_fall_that_cannot_be_followed_far_is_told(monkeypatch, falling_frames):
    monkeypatch.setattr("solver.analysis.falling.SETTLING_STEPS", 1)
    controls = solver.Controls(falling_frames=falling_frames)
    response = solver.settle(_bench(wall=False), TILT, friction_coefficient=1.0, controls=controls)
    assert response.stop is solver.Status.COLLAPSED
    assert "what falls could be followed by" in response.message
    assert all(response.message.endswith(note) for note in response.notes)
    assert len(response.notes) == min(falling_frames, 1)


@BOTH
def test_a_pebble_that_nothing_catches_is_a_collapse(controls):
    response = solver.settle(_bench(wall=False), TILT, friction_coefficient=1.0, controls=controls)
    assert response.stop is solver.Status.COLLAPSED
    assert response.notes == ()
    assert response.collapse.displacement == pytest.approx(np.arctan2(WIDTH, HEIGHT), abs=2 * TILT.tolerance)
    low, high = response.collapse.bracket
    assert high - low <= TILT.tolerance * (1 + 1e-6)


def test_much_of_the_weight_does_not_snap():
    # Six times as dense it is 3 % of the weight; it still finds the wall, and the response says what that means.
    response = solver.settle(_bench(density=12000.0), TILT, friction_coefficient=1.0, controls=PAPER)
    (note,) = response.notes
    assert "block 'pebble' moved by up to 0.022 m at once" in note
    assert "not followed" in note


@pytest.mark.thorough
@BOTH
def test_an_arch_collapses_though_its_fall_would_jam(controls):
    """The mechanism of an arch is no light piece, and a pebble on a bench beside it changes nothing about it."""
    arch = generators.arch(radius=1.0, thickness_ratio=0.15, embrace=180.0, voussoirs=12)
    spread = solver.Settlement(direction=(1.0, 0.0), increment=0.01, limit=0.2)
    response = solver.settle(arch, spread, friction_coefficient=2.0, controls=controls)
    assert response.collapse.displacement == pytest.approx(0.14104982, rel=1e-3)
    assert response.notes == ()


def test_a_run_goes_on_from_a_checkpoint_before_or_after_a_snap():
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


def test_the_results_folder_tells_of_a_snap(tmp_path):
    response = solver.settle(_bench(), TILT, friction_coefficient=1.0, controls=PAPER)
    folder = blockvis.write(response, tmp_path / "out")
    assert json.loads((folder / "summary.json").read_text(encoding="utf-8"))["notes"] == list(response.notes)
    assert blockvis.open_results(folder).notes == response.notes
