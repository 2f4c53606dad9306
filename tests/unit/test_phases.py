"""What changes between settlements: blocks that are taken away, and loads that begin to act."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import solver
from blockvis.case_files.read import case_of
from blockvis.cases.build import case_assembly
from blockvis.runs.plan import planned

DOWN = solver.Settlement([0.0, -1.0], increment=1e-3, limit=2e-3)


def box(x0: float, y0: float, x1: float, y1: float) -> list[list[float]]:
    return [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]


def beam_on_a_prop() -> solver.Structure:
    """A beam with a load on its middle, over two piers, of which the right one settles, and a prop between."""
    blocks = {
        "left": ("fixed", box(-0.2, 0.0, 0.2, 1.0)),
        "ground": ("fixed", box(0.8, -0.2, 1.2, 0.0)),
        "right": ("moving", box(1.8, 0.0, 2.2, 1.0)),
        "prop": ("free", box(0.9, 0.0, 1.1, 1.0)),
        "beam": ("free", box(-0.2, 1.0, 2.2, 1.2)),
        "load": ("free", box(0.5, 1.2, 1.5, 1.5)),
    }
    outlines, roles = [outline for _, outline in blocks.values()], [role for role, _ in blocks.values()]
    assembly = solver.Assembly.from_outlines(outlines, names=list(blocks), roles=roles)
    return solver.Structure(assembly, friction_coefficient=0.6)


def taken_away(structure: solver.Structure, phase: int, *names: str, **more: Any) -> solver.PhaseChange:
    return solver.PhaseChange(phase, np.isin(structure.assembly.names, names), **more)


def weight_above(structure: solver.Structure) -> float:
    return float(structure.assembly.masses[-2:].sum() * solver.GRAVITY)


def test_what_a_prop_carried_goes_to_the_piers_when_it_is_taken_away() -> None:
    structure = beam_on_a_prop()
    response = structure.settle([DOWN, DOWN], changes=[taken_away(structure, 1, "prop")])
    before, after = response.path[2], response.path[3]
    assert (before.phase, after.phase, before.reaction) == (0, 1, 0.0)
    # The beam slopes to the right: from the inner end of the left pier to the outer end of the right one.
    assert after.reaction == pytest.approx(0.4 * weight_above(structure), rel=2e-3)
    assert not before.removed.any()
    assert [name for name, gone in zip(structure.assembly.names, after.removed, strict=True) if gone] == ["prop"]
    assert response.losses == ()
    assert any("'prop' taken away before settlement 2" in note for note in response.notes)


def test_a_load_acts_from_its_phase_on() -> None:
    structure = beam_on_a_prop()
    dead = np.zeros((6, 3))
    dead[5, 1] = -1000.0
    changes = [taken_away(structure, 0, "prop"), solver.PhaseChange(1, dead=dead)]
    response = structure.settle([DOWN, DOWN], changes=changes)
    sums = [-increment.support_forces[:, 1].sum() for increment in response.path]
    assert sums == pytest.approx([weight_above(structure)] * 3 + [weight_above(structure) + 1000.0] * 3, rel=1e-8)


def test_a_structure_that_stands_no_more_collapses_before_the_settlement() -> None:
    structure = beam_on_a_prop()
    response = structure.settle([DOWN, DOWN], changes=[taken_away(structure, 1, "prop", "left")])
    assert response.stop is solver.Status.COLLAPSED
    assert response.collapse is not None
    assert response.collapse.bracket == (0.0, 0.0)
    assert "'left', 'prop' taken away before settlement 2" in response.message
    assert {increment.phase for increment in response.path} == {0}


def test_what_falls_at_once_is_told_as_a_loss() -> None:
    structure = beam_on_a_prop()
    # Without the beam its load falls; another block stands.
    stone = solver.Assembly.from_outlines(
        [*(structure.assembly.outline(k) for k in range(6)), box(0.9, -0.0, 1.1, 1.0) + np.array([4.0, 0.0]),
         box(4.5, -0.2, 5.5, 0.0)],
        names=[*structure.assembly.names, "stone", "rock"],
        roles=[*structure.assembly.roles, "free", "fixed"],
    )  # fmt: skip
    wider = solver.Structure(stone, friction_coefficient=0.6)
    controls = solver.Controls(local_loss=0.5)
    response = wider.settle([DOWN, DOWN], changes=[taken_away(wider, 1, "prop", "beam")], controls=controls)
    assert response.stop is solver.Status.LIMIT_REACHED
    assert [loss.blocks for loss in response.losses] == [("load",)]


CASE: dict[str, Any] = {
    "geometry": {
        "layout": "wall",
        "parameters": {"bricks": 3, "courses": 3, "settling": [0.375, 0.75], "brick_length": 0.25},
    },
    "settlement": [{"direction": [0, -1], "increment": 0.001, "limit": 0.001}] * 2,
}


def test_a_run_goes_on_across_a_removal_bit_for_bit() -> None:
    case = case_of(CASE | {"remove": [{"phase": 2, "blocks": "brick 3-3"}]}, Path("case.toml"))
    assembly = case_assembly(case)
    increments = list(planned(case, assembly).steps)
    for k in (1, 2):
        others = list(planned(case, assembly, increments[k].checkpoint, increments[: k + 1]).steps)
        assert len(others) == len(increments) - k - 1
        for one, other in zip(increments[k + 1 :], others, strict=True):
            assert one.reaction == other.reaction
            assert np.array_equal(one.pose.positions, other.pose.positions)
            assert np.array_equal(one.removed, other.removed)
            assert one.removed.sum() == 1


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (
            {"remove": [{"phase": 3, "blocks": "brick 3-3"}]},
            r"\[remove\] phase is 3; the case has 2 \[\[settlement\]\]",
        ),
        ({"remove": [{"phase": 2, "blocks": "brik 3-3"}]}, r"\[remove\] blocks: no block is named 'brik 3-3'"),
        ({"remove": [{"phase": 2}]}, r"\[remove\] blocks is missing"),
        ({"remove": [{"phase": 2, "ties": "tie"}]}, r"\[remove\] ties names 'tie', but the case has no ties"),
        ({"remove": [{"phase": 2, "blocks": "ground*"}]}, "phase 2 moves only supports that have been taken away"),
        ({"loads": [{"force": [0, -1], "phase": 3}]}, r"\[loads 1\] phase is 3; the case has 2 \[\[settlement\]\]"),
        ({"loads": [{"kind": "live", "force": [0, -1], "phase": 2}]}, "a live load acts after all settlements"),
        (
            {
                "remove": [{"phase": 2, "blocks": "brick 3-3"}],
                "analysis": {"kind": "limit load"},
                "loads": [{"kind": "live", "weight_fraction": [1, 0]}],
            },
            r"\[\[remove\]\] belongs to \[analysis\] kind = \"settlement\"",
        ),
        (
            {"remove": [{"phase": 2, "blocks": "brick 3-3"}], "analysis": {"increments": "linear program"}},
            "knows one structure under loads that stay as they are",
        ),
    ],
)
def test_a_change_that_cannot_be_is_refused_in_one_line(more: dict[str, Any], words: str) -> None:
    def run() -> None:
        case = case_of(CASE | more, Path("case.toml"))
        planned(case, case_assembly(case))

    with pytest.raises(ValueError, match=words) as error:
        run()
    assert "\n" not in str(error.value)
