"""What changes between settlements: blocks that are taken away, and loads that begin to act."""

from __future__ import annotations

import dataclasses
import html
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from structures import assembly_of, case_from, rectangle, report_of

import blockvis
import solver
from blockvis.cli import main
from blockvis.generators import build
from solver import mechanics

DOWN = solver.Settlement([0.0, -1.0], increment=1e-3, limit=1e-3)


def beam_on_a_prop() -> solver.Structure:
    """A beam with a load on its middle, over two piers, of which the right one settles, and a prop between."""
    blocks = {
        "left": ("fixed", rectangle(-0.2, 0.0, 0.2, 1.0)),
        "ground": ("fixed", rectangle(0.8, -0.2, 1.2, 0.0)),
        "right": ("moving", rectangle(1.8, 0.0, 2.2, 1.0)),
        "prop": ("free", rectangle(0.9, 0.0, 1.1, 1.0)),
        "beam": ("free", rectangle(-0.2, 1.0, 2.2, 1.2)),
        "load": ("free", rectangle(0.5, 1.2, 1.5, 1.5)),
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
    before, after = response.path[1], response.path[2]
    assert (before.phase, after.phase, before.reaction) == (0, 1, 0.0)
    # The beam slopes to the right: from the inner end of the left pier to the outer end of the right one.
    assert after.reaction == pytest.approx(0.4 * weight_above(structure), rel=2e-3)
    assert not before.removed.any()
    assert [name for name, gone in zip(structure.assembly.names, after.removed, strict=True) if gone] == ["prop"]
    assert response.losses == ()
    assert any("'prop' taken away before settlement 2" in note for note in response.notes)


@pytest.mark.slow
def test_a_support_that_is_taken_away_weighs_nothing_in_note_and_summary(tmp_path: Path) -> None:
    """As it is no part of the total weight; its thickness nobody has to give."""
    structure = beam_on_a_prop()
    roles = np.where(np.array(structure.assembly.names) == "prop", "fixed", structure.assembly.roles)
    structure = solver.Structure(structure.assembly.with_roles(roles), friction_coefficient=0.6)
    response = structure.settle([DOWN, DOWN], changes=[taken_away(structure, 1, "prop")])
    summary = json.loads((blockvis.write(response, tmp_path / "out") / "summary.json").read_text(encoding="utf-8"))
    assert summary["removed"] == [{"phase": 2, "blocks": ["prop"], "ties": [], "weight": 0.0}]
    assert any("block 'prop' taken away before settlement 2, 0 N" in note for note in summary["notes"])


@pytest.mark.thorough
def test_what_changes_before_a_settlement_is_told_where_the_structure_falls_of_it() -> None:
    """A tie goes, and a load pushes the load off: report and command line named neither."""
    structure = beam_on_a_prop()
    tie = solver.Tie("iron", (0, 4), ((0.0, 0.5), (0.0, 1.1)), 1e5)
    structure = dataclasses.replace(structure, ties=[tie])
    push = np.zeros((6, 3))
    push[5, 0] = 2.0 * weight_above(structure)
    change = solver.PhaseChange(1, dead=push, ties=("iron",))
    response = structure.settle([DOWN, DOWN], changes=[change], controls=solver.Controls(falling_frames=1))
    assert response.collapse is not None
    page = report_of(response)
    assert "before settlement 2" in page
    assert "taken away, dead load changed" in page


@pytest.mark.slow
def test_many_changes_are_told_in_a_few_words_and_forces_of_rounding_have_no_curve(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    structure = beam_on_a_prop()
    ties = [solver.Tie(f"t{k}", (0, 4), ((0.0, 0.5), (0.0, 1.1)), 1e5, phase=2) for k in range(6)]
    gone = [taken_away(structure, 2, name, ties=tuple(tie.name for tie in ties)) for name in ("prop", "load")]
    response = dataclasses.replace(structure, ties=ties).settle([DOWN] * 3, changes=gone)
    page = html.unescape(report_of(response))
    assert "'t0', 't1', 't2', 't3' and 2 more installed" in page
    away = r"blocks 'prop', 'load' taken away, [\d.]+ k?N, 't0', 't1', 't2', 't3' and 2 more taken away"
    assert re.search(away, page)
    curve = []
    for size in (1e-9, 1e-3):
        carried = mechanics.TieForces(np.full(6, size * response.total_weight), states=np.full(6, mechanics.ELASTIC))
        monkeypatch.setattr(solver.Increment, "ties", carried)
        curve.append(blockvis.draw_curve(response, tmp_path / "curve.svg").read_text("utf-8"))
    assert ["force of ties" in text for text in curve] == [False, True]


def test_what_has_been_taken_away_stays_where_it_was() -> None:
    structure = beam_on_a_prop()
    sinking = solver.Settlement([0.0, -1.0], increment=0.01, limit=0.02)
    response = structure.settle([sinking], changes=[taken_away(structure, 0, "prop")])
    prop, last = structure.assembly.index("prop"), response.path[-1]
    assert not last.velocity[prop].any()
    np.testing.assert_allclose(last.pose.positions[prop], structure.assembly.centroids[prop], atol=1e-12)
    assert mechanics.rigid_parts(structure.assembly, last)[prop] == -1


@pytest.mark.parametrize("role", ["free", "fixed"])
@pytest.mark.slow
def test_what_was_taken_away_is_no_part_of_the_weight_that_a_loss_is_measured_by(role: str) -> None:
    stones = {f"stone {k}": ("free", rectangle(0.5 * k, 0.0, 0.5 * (k + 1), 0.5)) for k in range(4)}
    blocks = {
        **stones,
        "loose": ("free", rectangle(2.05, -0.02, 2.3, 0.48)),
        "prop": (role, rectangle(2.05, -3.0, 8.0, -0.02)),
        "ground": ("fixed", rectangle(-1.0, -0.5, 2.05, 0.0)),
        "base": ("fixed", rectangle(2.0, -3.5, 9.0, -3.0)),
        "far": ("moving", rectangle(20.0, -0.5, 21.0, 0.0)),
    }
    outlines, roles = [outline for _, outline in blocks.values()], [role for role, _ in blocks.values()]
    assembly = solver.Assembly.from_outlines(outlines, names=list(blocks), roles=roles)
    structure = solver.Structure(assembly, friction_coefficient=0.6)
    controls = solver.Controls(local_loss=0.2, falling_frames=1)
    response = structure.settle([DOWN, DOWN], changes=[taken_away(structure, 1, "prop")], controls=controls)
    (loss,) = response.losses
    assert (loss.blocks, loss.share) == (("loose",), pytest.approx(0.125 / 1.125))
    assert "11 % of the weight" in " ".join(response.notes)
    # A ninth of what stands is more than may go, though little beside the prop.
    response = structure.settle([DOWN, DOWN], changes=[taken_away(structure, 1, "prop")])
    assert response.stop is solver.Status.COLLAPSED


@pytest.mark.thorough
def test_a_tie_goes_with_the_block_that_it_ends_on() -> None:
    structure = beam_on_a_prop()
    ends = structure.assembly.index("prop"), structure.assembly.index("left")
    tie = solver.Tie("rod", ends, ((1.0, 0.5), (0.0, 0.5)), stiffness=1e6, prestress=10.0)
    tied = solver.Structure(structure.assembly, friction_coefficient=0.6, ties=[tie])
    response = tied.settle([DOWN, DOWN], changes=[taken_away(structure, 1, "prop")])
    assert any("N, and with it 'rod'" in note for note in response.notes)
    assert [mechanics.ABSENT in i.ties.states for i in response.path] == [i.phase == 1 for i in response.path]
    assert np.isnan(response.path[-1].ties.elongations).all()


@pytest.mark.thorough
def test_a_phase_that_changes_nothing_begins_with_the_equilibrium_at_the_end_of_the_one_before() -> None:
    # One long increment: viscosity retards joints that close, and what is reported has come to rest.
    phase = solver.Settlement([-0.75, 0.67], increment=0.02, limit=0.02)
    response = solver.Structure(build("portal", {}), friction_coefficient=0.67).settle([phase, phase])
    assert response.stop is solver.Status.LIMIT_REACHED
    _, end, begin, _ = response.path
    assert (end.phase, begin.phase, begin.parameter) == (0, 1, 0.0)
    assert begin.reaction == pytest.approx(end.reaction, rel=1e-6)


@pytest.mark.parametrize("law", [solver.InterfaceLaw(0.6, normal_stiffness=2e6), solver.InterfaceLaw(0.6)])
@pytest.mark.slow
def test_springs_keep_what_has_compressed_them_when_something_apart_is_taken_away(law: solver.InterfaceLaw) -> None:
    pads = [rectangle(x - 0.05, -0.3, x + 0.05, 0.0) for x in (-1.0, 0.0, 1.0)]
    apart = [rectangle(3.0, 0.0, 3.4, 0.4), rectangle(3.0, -0.3, 3.4, 0.0)]
    assembly = solver.Assembly.from_outlines(
        [rectangle(-1.2, 0.0, 1.2, 0.4), *pads, *apart], roles=["free", "fixed", "fixed", "moving", "free", "fixed"]
    )
    structure = solver.Structure(assembly, solver.Interfaces(law))
    phases = [solver.Settlement([0.0, -1.0], increment=5e-3, limit=5e-3)] * 2
    change = solver.PhaseChange(1, np.arange(6) == 4)
    found = [structure.settle(phases, changes=changes).path[-1].reaction for changes in ([], [change])]
    assert found[1] == pytest.approx(found[0], abs=1e-4 * mechanics.total_weight(assembly))


@pytest.mark.slow
def test_the_capacity_of_a_pose_is_that_of_the_blocks_that_are_left() -> None:
    """A tower against a buttress, pushed with 10 kN at mid-height; without it, it tips at W b/2 = α F h/2."""
    outlines = [rectangle(0, -1, 9, 0), rectangle(2, 0, 3, 3), rectangle(3, 0, 5, 3), rectangle(9, -1, 10, 0)]
    assembly = solver.Assembly.from_outlines(
        [*outlines, rectangle(9, 0, 10, 1)],
        roles=["fixed", "free", "free", "moving", "free"],
        names=["ground", "tower", "buttress", "pad", "stone"],
    )
    prop = solver.Tie("prop", (1, 2), ((2.5, 2.9), (4.0, 2.9)), stiffness=1e8, kind="prop")
    structure = solver.Structure(assembly, friction_coefficient=0.6, ties=[prop])
    last = structure.settle(DOWN, changes=[taken_away(structure, 0, "buttress")]).path[-1]
    assert last.fallen.tolist() == [False, False, True, False, False]
    # What acts at a point of a block that is gone acts no more, however it has turned.
    ends = solver.PointForces([1, 2], [[1e4, 0.0], [1e4, 0.0]], [[2.5, 1.5], [5.0, 3.0]])
    pushed = structure.with_live(ends)
    left, alone = {"pose": last.pose, "fallen": last.fallen}, assembly.masses[1] * solver.GRAVITY * 0.5 / (1e4 * 1.5)
    limit = pushed.limit_load(**left)
    assert limit.multiplier == pytest.approx(alone, rel=1e-9)
    assert limit.increment.fallen.tolist() == last.fallen.tolist()
    assert pushed.limit_load(pose=last.pose).multiplier > 2.0 * alone
    control = solver.ControlDisplacement("tower", increment=0.01, limit=0.01)
    turned = last.pose.rotations + np.array([[0.0], [0.0], [1.0], [0.0], [0.0]])
    left["pose"] = solver.Pose(last.pose.positions, turned)
    response = pushed.pushover(control, **left, ties_at=last.ties)
    assert response.path[0].load_multiplier == pytest.approx(alone, rel=1e-6)
    assert all(increment.fallen[2] for increment in response.path)
    with pytest.raises(ValueError, match="control block 'buttress' has left the structure; name a free block"):
        pushed.pushover(solver.ControlDisplacement("buttress"), **left)
    with pytest.raises(ValueError, match=r"fallen is .*; give a bool for each of the 5 blocks"):
        pushed.limit_load(pose=last.pose, fallen=np.array([2]))


def test_a_load_acts_from_its_phase_on() -> None:
    structure = beam_on_a_prop()
    dead = np.zeros((6, 3))
    dead[5, 1] = -1000.0
    changes = [taken_away(structure, 0, "prop"), solver.PhaseChange(1, dead=dead)]
    response = structure.settle([DOWN, DOWN], changes=changes)
    sums = [-increment.support_forces[:, 1].sum() for increment in response.path]
    assert sums == pytest.approx([weight_above(structure)] * 2 + [weight_above(structure) + 1000.0] * 2, rel=1e-8)


@pytest.mark.thorough
def test_a_load_elsewhere_leaves_the_forces_of_joints_as_they_are() -> None:
    arch = build("arch")
    x = float(arch.vertices[:, 0].max()) + 5.0
    apart = [rectangle(x, -1.0, x + 1.0, 0.0), rectangle(x, 0.0, x + 1.0, 1.0)]
    assembly = solver.Assembly.from_outlines(
        [*(arch.outline(k) for k in range(arch.n_blocks)), *apart],
        roles=[*("free" if free else "fixed" for free in arch.free), "moving", "free"],
    )
    dead = np.zeros((assembly.n_blocks, 3))
    dead[-1, 1] = -20.0 * mechanics.total_weight(assembly)
    changes = [solver.PhaseChange(1, dead=dead)]
    response = solver.Structure(assembly, friction_coefficient=0.7).settle([DOWN, DOWN], changes=changes)
    springer = np.flatnonzero(~arch.free)[-1]
    thrusts = [float(increment.support_forces[springer, 0]) for increment in response.path]
    assert thrusts[0] != 0.0
    assert thrusts[2] == pytest.approx(thrusts[1], rel=1e-4)


@pytest.mark.thorough
def test_springs_have_moved_before_a_settlement_begins() -> None:
    footing, on_it = rectangle(0.0, 0.0, 1.5, 0.5), rectangle(0.3, 0.5, 0.8, 2.5)
    assembly = solver.Assembly.from_outlines(
        [rectangle(-1.0, -0.5, 3.0, 0.0), footing, on_it], roles=["moving", "free", "free"]
    )
    structure = solver.Structure(assembly, solver.Interfaces(solver.InterfaceLaw(0.6, normal_stiffness=1e7)))
    response = structure.settle([DOWN, DOWN], changes=[solver.PhaseChange(1, np.arange(3) == 2)])
    end, begin = response.path[1], response.path[2]
    assert (end.phase, begin.phase, begin.parameter) == (0, 1, 0.0)
    weight = float(assembly.masses[2] * solver.GRAVITY)
    # Half of the springs, k b t, is at either end: N / (k b t), and N e / (k b t (b / 2)²) where N has the arm e.
    base = 1.5 * 1e7
    heave, turn = weight / base, weight * 0.2 / (base * 0.75**2)
    moved = end.pose.movement_to(begin.pose)[1]
    assert moved[1] == pytest.approx(heave, rel=1e-3)
    assert moved[2] == pytest.approx(-turn, rel=1e-2)


def test_a_structure_that_stands_no_more_collapses_before_the_settlement() -> None:
    structure = beam_on_a_prop()
    controls = solver.Controls(falling_frames=1)
    response = structure.settle([DOWN, DOWN], changes=[taken_away(structure, 1, "prop", "left")], controls=controls)
    assert response.stop is solver.Status.COLLAPSED
    assert response.collapse is not None
    assert response.collapse.bracket == (0.0, 0.0)
    assert "'left', 'prop' taken away before settlement 2" in response.message
    assert {increment.phase for increment in response.path} == {0}


@pytest.mark.slow
def test_what_only_springs_back_when_a_stone_is_taken_away_does_not_fall(tmp_path: Path) -> None:
    structure = solver.Structure(build("arch on piers", {}), friction_coefficient=0.6)
    aside = solver.Settlement([1.0, 0.0], increment=1e-3, limit=1e-3)
    lost, collapsed = (
        structure.settle(
            [aside, aside],
            changes=[taken_away(structure, 1, "voussoir 4")],
            controls=solver.Controls(local_loss=local_loss, falling_frames=1),
        )
        for local_loss in (0.9, 0.05)
    )
    (loss,) = lost.losses
    assert loss.blocks == tuple(f"voussoir {k}" for k in range(5, 11))
    assert collapsed.collapse is not None
    assert collapsed.collapse.words == "1 macro-block; hinge at voussoir 10 | voussoir 11"
    summary = json.loads((blockvis.write(collapsed, tmp_path / "out") / "summary.json").read_text(encoding="utf-8"))
    assert summary["falling_weight"] == pytest.approx(loss.weight)
    assert summary["mechanism"] == collapsed.collapse.words
    for response in (collapsed, blockvis.open_results(tmp_path / "out")):
        falls = response.mesh(-1).cell_data["falls"].astype(bool)
        assert tuple(np.array(structure.assembly.names)[falls]) == loss.blocks
        # Before it is taken away, the stone stands.
        assert not response.path[-1].removed.any()


@pytest.mark.slow
def test_what_falls_at_once_is_told_as_a_loss(tmp_path: Path) -> None:
    structure = beam_on_a_prop()
    # Without the beam its load falls; another block stands.
    stone = solver.Assembly.from_outlines(
        [*(structure.assembly.outline(k) for k in range(6)), rectangle(0.9, -0.0, 1.1, 1.0) + np.array([4.0, 0.0]),
         rectangle(4.5, -0.2, 5.5, 0.0)],
        names=[*structure.assembly.names, "stone", "rock"],
        roles=[*structure.assembly.roles, "free", "fixed"],
    )  # fmt: skip
    wider = solver.Structure(stone, friction_coefficient=0.6)
    controls = solver.Controls(local_loss=0.7)
    response = wider.settle([DOWN, DOWN], changes=[taken_away(wider, 1, "prop", "beam")], controls=controls)
    assert response.stop is solver.Status.LIMIT_REACHED
    assert [(loss.blocks, loss.phase) for loss in response.losses] == [(("load",), 1)]
    assert any(note.startswith("at 0 m in phase 2: ") for note in response.notes)
    assert "load at 0 m in phase 2, " in report_of(response)
    blockvis.write(response, tmp_path / "out")
    (told,) = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))["losses"]
    assert (told["settlement"], told["phase"]) == (0.0, 2)


SETTLEMENT = """
[[settlement]]
direction = [0, -1]
increment = 0.001
limit = 0.001
"""
CASE = f"""
[geometry]
layout = "wall"
parameters = {{ bricks = 3, courses = 3, settling = [0.375, 0.75], brick_length = 0.25 }}
{SETTLEMENT}
{SETTLEMENT}
"""
REMOVED = '[[remove]]\nphase = 2\nblocks = "brick 3-3"\n'


def test_a_path_goes_on_across_a_removal_bit_for_bit() -> None:
    structure = beam_on_a_prop()
    phases, change = [DOWN, DOWN], taken_away(structure, 1, "prop")

    def followed(resume: mechanics.PathState | None = None) -> list[solver.Increment]:
        of = {"interfaces": structure.interfaces, "loads": structure.loads, "changes": [change], "resume": resume}
        return list(mechanics.settlement_increments(structure.assembly, phases, **of))

    increments = followed()
    for k in (1, 2):
        for one, other in zip(increments[k + 1 :], followed(increments[k].checkpoint), strict=True):
            assert one.reaction == other.reaction
            assert np.array_equal(one.pose.positions, other.pose.positions)
            assert np.array_equal(one.removed, other.removed)
            assert one.removed.sum() == 1


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (REMOVED.replace("2", "3", 1), r"\[remove\] phase is 3; the case has 2 \[\[settlement\]\]"),
        (REMOVED.replace("brick", "brik"), r"\[remove\] blocks: no block and no material is named 'brik 3-3'"),
        ("[[remove]]\nphase = 2\n", r"\[remove\] blocks is missing"),
        ('[[remove]]\nphase = 2\nties = "tie"\n', r"\[remove\] ties: no tie is named 'tie'; the case has no ties"),
        (
            REMOVED.replace("brick 3-3", "ground*"),
            r"case\.toml: settlement phase 2 moves only supports that have been taken away",
        ),
        (
            '[[ties]]\nname = "iron"\nfrom = [0.1, 0.1]\nto = [0.6, 0.2]\nstiffness = 1e5\nphase = 2\n'
            '[[remove]]\nphase = 2\nties = "iron"\n',
            r"case\.toml: \[remove\] ties: 'iron' is installed before settlement 2, .*; give phase = 3 or later",
        ),
        ("[[loads]]\nforce = [0, -1]\nphase = 3\n", r"\[loads 1\] phase is 3; the case has 2 \[\[settlement\]\]"),
        ('[[loads]]\nkind = "live"\nforce = [0, -1]\nphase = 2\n', "a live load acts after all settlements"),
        (
            REMOVED + '[analysis]\nkind = "limit load"\n[[loads]]\nkind = "live"\nweight_fraction = [1, 0]\n',
            r"\[\[remove\]\] belongs to \[analysis\] kind = \"settlement\"",
        ),
        (
            REMOVED + '[analysis]\nincrements = "linear program"\n',
            r"case\.toml: increments = 'linear program' knows one structure under loads that stay as they are",
        ),
    ],
)
def test_a_change_that_cannot_be_is_refused_in_one_line(more: str, words: str) -> None:
    def run() -> None:
        assembly_of(case_from(CASE + more))

    with pytest.raises(ValueError, match=words) as error:
        run()
    assert "\n" not in str(error.value)


COLUMNS = f"""
[geometry]
file = "columns.json"
{SETTLEMENT}
{SETTLEMENT}
[[remove]]
phase = 2
blocks = "left"
"""


def columns(folder: Path, more: str) -> solver.Response:
    """Two columns on a ground that sinks, of which the left one is taken away before the second settlement."""
    outlines = {"left": rectangle(0.5, 0.0, 1.0, 1.0), "right": rectangle(2.0, 0.0, 2.5, 1.0)}
    blocks: list[dict[str, Any]] = [{"name": name, "outline": ring.tolist()} for name, ring in outlines.items()]
    blocks.append({"name": "ground", "role": "moving", "outline": rectangle(0.0, -0.5, 4.0, 0.0).tolist()})
    (folder / "columns.json").write_text(json.dumps({"blocks": blocks}), encoding="utf-8")
    return blockvis.run_case(case_from(COLUMNS + more, folder), folder / "out", outputs=()).response


@pytest.mark.parametrize("blocks", ["", 'blocks = "right"'])
@pytest.mark.slow
def test_what_has_been_taken_away_shields_nothing_from_a_later_pressure(tmp_path: Path, blocks: str) -> None:
    # 100 kN push on a column of 9.8 kN.
    found = columns(tmp_path, f"[[loads]]\npressure = 1e5\ndirection = [1, 0]\nphase = 2\n{blocks}\n")
    assert found.stop is solver.Status.COLLAPSED
    assert [increment.phase for increment in found.path] == [0, 0]


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('[[loads]]\nblocks = "left"\nforce = [5e4, 0]\nphase = 2\n', "loads 1] blocks 'left' matches only what [[re"),
        (
            '[[loads]]\nblocks = "right"\npressure = 1e5\ndirection = [1, 0]\n',
            "loads 1] pressure along [1.0, 0.0] meets none",
        ),
        ("[[loads]]\npoint = [0.7, 0.5]\nforce = [5e4, 0]\nphase = 2\n", "(0.7, 0.5) m lies in 'left', which [[remo"),
        (
            '[[ties]]\nname = "t"\nstiffness = 1e7\nkind = "bar"\nphase = 2\nfrom = [1, 0.7]\nto = [2, 0.7]\n',
            "[ties] 't' from (1, 0.7) m lies in 'left', which [[remove]] has taken away",
        ),
        (
            '[[ties]]\nname = "t"\nstiffness = 1e7\nphase = 2\nto = [2, 0.7]\n'
            'from = { block = "left", point = [1, 0.7] }\n',
            "[ties] 't' from: [[remove]] has taken 'left' away before settlement 2",
        ),
    ],
)
def test_what_would_act_on_blocks_that_have_been_taken_away_is_refused(tmp_path: Path, more: str, words: str) -> None:
    with pytest.raises(ValueError, match=re.escape(words)) as error:
        columns(tmp_path, more)
    assert "\n" not in str(error.value)


PILE = """
[geometry]
file = "pile.json"
[[remove]]
phase = 2
blocks = "prop"
[[settlement]]
direction = [0, -1]
increment = 0.01
limit = 0.02
[[settlement]]
rotation_centre = [-3, 0]
rotation = 1
increment = 0.01
limit = 0.02
"""
BLOCKS = {
    "ground": [[-1, -1], [2, -1], [2, 0], [-1, 0]],
    "prop": [[0, 0], [1, 0], [1, 3], [0, 3]],
    "stone": [[0, 3], [1, 3], [1, 3.6], [0, 3.6]],
}


@pytest.mark.slow
def test_the_last_reaction_before_a_fall_at_once_is_that_of_the_phase_before(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    blocks = [{"name": name, "outline": outline} for name, outline in BLOCKS.items()]
    blocks[0]["role"] = "moving"
    layout = {"format": "blockvis layout", "version": 1, "unit": "m", "blocks": blocks}
    (tmp_path / "pile.json").write_text(json.dumps(layout), encoding="utf-8")
    said, summary = run_told(tmp_path, PILE, capsys)
    assert re.search(r"last reaction +70632 N   1\.000000 W in phase 1\n", said)
    assert summary["collapse_reaction"] is None
    assert "reaction" not in summary["message"]
    assert summary["mechanism"] == "1 macro-block"
    assert summary["message"].endswith(", 1 macro-block")
    response = blockvis.open_results(tmp_path / "out")
    assert response.collapse is not None
    assert response.collapse.reaction is None
    assert "1.0000 W in phase 1<" in report_of(response)


ARCH = """
[geometry]
layout = "arch"
parameters = { voussoirs = 5 }
[material]
friction_coefficient = 0.8
"""
SPREADING = "[[settlement]]\ndirection = [1, 0]\nincrement = 0.05\nlimit = 0.1\ntolerance = 1e-3\n"


def run_told(folder: Path, case: str, capsys: pytest.CaptureFixture[str]) -> tuple[str, dict[str, Any]]:
    """Run a case without pictures; returns what it says and its summary."""
    (folder / "case.toml").write_text(case, encoding="utf-8")
    capsys.readouterr()
    assert main(["run", str(folder / "case.toml"), "-o", str(folder / "out"), "--no-check-steps"], outputs=()) == 0
    return capsys.readouterr().out, json.loads((folder / "out" / "summary.json").read_text(encoding="utf-8"))


@pytest.mark.slow
def test_a_tie_without_which_a_structure_falls_is_told_as_taken_away(tmp_path: Path) -> None:
    """A beam overhangs and is tied down behind the edge; before a settlement that is not reached a wire goes."""
    outlines = [rectangle(0.5, 0.0, 1.0, 1.0), rectangle(0.4, 1.0, 2.4, 1.4)]
    assembly = solver.Assembly.from_outlines(outlines, names=["pier", "beam"], roles=["moving", "free"])
    ends = (1, None), ((0.4, 1.2), (0.4, -1.0))
    ties = [solver.Tie("hold", *ends, 1e6, prestress=12e3), solver.Tie("wire", *ends, 1e7, strength=100.0)]
    up = solver.Settlement([0.0, 1.0], increment=5e-4, limit=1e-3)
    changes = [solver.PhaseChange(1, ties=("hold",)), solver.PhaseChange(2, ties=("wire",))]
    structure = solver.Structure(assembly, friction_coefficient=0.6, ties=ties)
    response = structure.settle([up] * 3, changes=changes, controls=solver.Controls(falling_frames=0))
    blockvis.write(response, tmp_path / "out")
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert [(one["phase"], one["ties"]) for one in summary["removed"]] == [(2, ["hold"])]
    page = blockvis.write_report(response, tmp_path / "report.html").read_text(encoding="utf-8")
    held = "13 kN tension at 0.001 m in phase 1", "taken away before settlement 2"
    for told in (*held, "100 N tension at 0.0005 m in phase 1", "yields at 0.0005 m in phase 1 or before"):
        assert told in page
    curve = blockvis.draw_curve(response, tmp_path / "curve.svg")
    assert "phase 2 from 1 mm: 'hold' taken away" in curve.read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_tie_that_is_named_twice_is_taken_away_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    iron = '[[ties]]\nname = "iron"\nfrom = { block = "left springer", point = [-1, 0] }\n'
    iron += 'to = { block = "right springer", point = [1, 0] }\nstiffness = 1e5\n'
    steps = SPREADING.replace("increment = 0.05\nlimit = 0.1", "increment = 0.002\nlimit = 0.002")
    away = '[[remove]]\nphase = 2\nties = ["iron", "i*"]\n[[remove]]\nphase = 2\nties = "iron"\n'
    away += '[[remove]]\nphase = 3\nties = "iron"\n'
    _, summary = run_told(tmp_path, ARCH + 3 * steps + iron + away, capsys)
    assert summary["removed"] == [{"phase": 2, "blocks": [], "ties": ["iron"], "weight": 0.0}]
    again = blockvis.open_results(tmp_path / "out")
    assert {change.phase for change in again.changes if "iron" in change.ties} == {1, 2}
    curve = blockvis.draw_curve(again, tmp_path / "curve.svg")
    assert curve.read_text(encoding="utf-8").count("'iron' taken away") == 1
    assert main(["report", str(tmp_path / "out")]) == 0


@pytest.mark.thorough
def test_a_block_named_twice_is_taken_away_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    column = (
        '[geometry]\nlayout = "column"\nparameters = { blocks = 4, width = 0.6, block_height = 0.5, depth = 0.5 }\n'
    )
    away = '[[remove]]\nphase = 3\nblocks = ["block 4", "block 3"]\n[[remove]]\nphase = 2\nblocks = "block 4"\n'
    _, summary = run_told(tmp_path, column + 3 * SETTLEMENT + away, capsys)
    told = [(entry["phase"], entry["blocks"], entry["weight"]) for entry in summary["removed"]]
    assert told == [(2, ["block 4"], pytest.approx(2943.0)), (3, ["block 3"], pytest.approx(2943.0))]
    assert "block 'block 3' taken away before settlement 3, 2943 N" in summary["notes"][-1]


@pytest.mark.slow
@pytest.mark.parametrize("ranged", ["", "[analysis]\nrange = true\n"])
def test_what_falls_before_anything_moves_is_a_collapse_at_no_settlement(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], ranged: str
) -> None:
    removed = '[[remove]]\nphase = 1\nblocks = "voussoir 3"\n'
    said, summary = run_told(tmp_path, ARCH + SPREADING + removed + ranged, capsys)
    assert "collapse displacement           0 m   between 0 and 0\n" in said
    assert "last reaction" not in said
    assert "before settlement 1: block 'voussoir 3' taken away, " in said
    assert (summary["status"], summary["collapse_displacement"]) == ("collapsed", 0.0)
    # Both neighbours of the stone fall, of the four that are left and weigh alike.
    assert summary["falling_share"] == pytest.approx(0.5)
    with pytest.raises(ValueError, match=r"begins at an equilibrium, and none is told: .* a settlement of 1e-6 m"):
        blockvis.open_results(tmp_path / "out").fall(0.1)
    assert main(["run", str(tmp_path / "case.toml"), "-o", str(tmp_path / "out"), "--force", "--no-pictures"]) == 0
    assert "begins at an equilibrium, and none is told" in capsys.readouterr().err
    assert main(["report", str(tmp_path / "out")]) == 0


@pytest.mark.slow
def test_places_along_several_settlements_are_told_with_their_phase(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    ties = "".join(
        f'[[ties]]\nname = "{name}"\nkind = "{kind}"\nfrom = {{ block = "left springer", point = [-1, 0] }}\n'
        f'to = {{ block = "right springer", point = [1, 0] }}\nstiffness = 1e5\nphase = {phase}\n{strength}'
        for name, kind, phase, strength in (("iron", "tie", 1, "strength = 6000\n"), ("shore", "prop", 2, ""))
    )
    said, summary = run_told(tmp_path, ARCH + SPREADING + SPREADING.replace("0.1", "0.5") + ties, capsys)
    place = f"{summary['collapse_displacement']:.6g} m in phase 2   between"
    assert f"collapse displacement{place:>{len(place) + 12 - len(place.split()[0])}}" in said
    assert summary["collapse_phase"] == 2
    iron, shore = summary["ties"]
    assert f"iron (tie): 6 kN tension at {iron['largest_force_at']:.4g} m in phase {iron['phase']}: yields at " in said
    assert f"yields at {iron['yields_at']:.4g} m in phase {iron['yields_in_phase']} or before" in said
    # It carries nothing, as its ends part, and is there from the second settlement on.
    assert (shore["largest_force"], shore["largest_force_at"], shore["phase"]) == (0.0, 0.0, 2)
    response = blockvis.open_results(tmp_path / "out")
    assert " m in phase 2" in blockvis.draw_curve(response, tmp_path / "curve.svg").read_text(encoding="utf-8")
    assert re.search(r"collapse displacement.{1,40} m in phase 2<", report_of(response))


@pytest.mark.slow
@pytest.mark.parametrize(
    "asked", ["", '[analysis]\nkind = "limit load"\n[[loads]]\nkind = "live"\nweight_fraction = [0, -1]\n']
)
def test_a_collapse_before_the_supports_turn_is_read_back_in_metres(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], asked: str
) -> None:
    turning = "[[settlement]]\nrotation_centre = [1, 0]\nrotation = 1\nincrement = 0.01\nlimit = 0.01\n"
    _, summary = run_told(tmp_path, ARCH + SPREADING.replace("0.1", "0.5") + turning + asked, capsys)
    assert (summary["status"], summary["collapse_phase"]) == ("collapsed", 1)
    told = report_of(blockvis.open_results(tmp_path / "out"))
    assert f"{summary['collapse_displacement']:.6g} m in phase 1" in told


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"dead": np.zeros((6, 3)), "dead_arms": np.zeros((5, 2, 2))},
            r"dead_arms loads have shape \(5, 2, 2\); give \(6, 2, 2\)",
        ),
        ({"dead": np.full((6, 3), np.nan)}, "dead load on block 'left' is .*; not finite"),
        ({"dead": np.zeros((6, 2))}, r"dead loads have shape \(6, 2\); give \(6, 3\)"),
        ({"phase": 0.5}, "phase of a change is 0.5; give a whole number, 0 to 1"),
        ({"phase": 2}, "phase of a change is 2; give a whole number, 0 to 1"),
        ({"removed": np.array([3])}, r"removed is array\(\[3\]\); give a bool for each of the 6 blocks"),
        ({"removed": np.arange(6)}, r"removed is .*; give a bool for each of the 6 blocks"),
    ],
)
def test_changes_that_do_not_fit_the_blocks_are_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        beam_on_a_prop().settle([DOWN, DOWN], changes=[solver.PhaseChange(**{"phase": 1, **change})])
