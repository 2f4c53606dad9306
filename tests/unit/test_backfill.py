"""Fill over blocks: which of their edges and faces carry it, and what is refused."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from structures import alike, assembly_of, box, case_from, in_either, pixels, rectangle, report_of

import solver
from blockvis import draw_still, lay_backfill, run_case

WEIGHT = 10.0


def lay(assembly: solver.Assembly, over: str | list[str], surface: float, coefficient: float = 0.0) -> solver.Backfill:
    return lay_backfill(assembly, over, surface, WEIGHT, coefficient)


def down(assembly: solver.Assembly, over: str | list[str], surface: float) -> np.ndarray:
    """Vertical load of the fill on each block."""
    fill = lay(assembly, over, surface)
    return -fill.load(assembly, solver.Pose.initial(assembly))[:, assembly.dimension - 1]


@pytest.mark.parametrize("dimension", [2, 3])
def test_only_what_sees_the_surface_carries_fill(dimension: int) -> None:
    """A slab under a pier that goes through the surface, and under a beam above it, which hides nothing."""
    boxes = {"slab": (0.0, 0.0, 4.0, 1.0), "pier": (1.0, 1.0, 2.0, 3.0), "beam": (1.0, 3.0, 4.0, 3.5)}
    assembly = in_either(dimension, [rectangle(*one) for one in boxes.values()], names=list(boxes))
    assert down(assembly, "slab", 2.0) == pytest.approx([3.0 * WEIGHT, 0.0, 0.0])


def test_a_pier_on_a_slab_in_space_leaves_a_ring() -> None:
    solids = [box([0, 0, 0], [4, 4, 1]), box([1, 1, 1], [2, 3, 3])]
    assembly = solver.Assembly.from_solids(solids, names=["slab", "pier"])
    fill = lay(assembly, "slab", 2.0)
    load = fill.load(assembly, solver.Pose.initial(assembly))[0]
    # What is missing is 2 m² at x = 1.5, y = 2 m, 0.5 m to the left of the middle.
    assert load == pytest.approx([0.0, 0.0, -14.0 * WEIGHT, 0.0, 0.5 * 2.0 * WEIGHT, 0.0], abs=1e-9)


def test_fill_presses_sideways_on_the_projected_height() -> None:
    ramp = solver.Assembly.from_outlines([[[0, 0], [2, 0], [2, 1]]], thickness=0.5)
    fill = lay(ramp, "*", 2.0, 0.4)
    force = fill.load(ramp, solver.Pose.initial(ramp))[0, :2]
    # Depth 2 m at the left end, 1 m at the right one.
    assert force == pytest.approx([0.4 * WEIGHT * 1.5 * 1.0 * 0.5, -WEIGHT * 1.5 * 2.0 * 0.5])


def test_the_load_is_the_column_over_the_place_where_the_block_is() -> None:
    block = solver.Assembly.from_outlines([rectangle(0.0, 0.0, 1.0, 1.0)])
    fill = lay(block, "*", 3.0)
    sunk = solver.Pose(block.centroids - [0.3, 0.5], np.zeros((1, 1)))
    assert fill.load(block, sunk)[0] == pytest.approx([0.0, -2.5 * WEIGHT, 0.0])
    upside_down = solver.Pose(block.centroids, np.full((1, 1), np.pi))
    assert fill.load(block, upside_down)[0] == pytest.approx([0.0, 0.0, 0.0])
    risen = solver.Pose(block.centroids - [0.0, -2.5], np.zeros((1, 1)))
    assert fill.load(block, risen)[0] == pytest.approx([0.0, 0.0, 0.0])


@pytest.mark.parametrize("dimension", [2, 3])
def test_of_a_face_that_rises_through_the_surface_what_is_below_carries_fill(dimension: int) -> None:
    """A slab of 4 × 1 m that turns about its centroid until the right end of its top is above the fill."""
    turn, surface = 0.5, 1.2
    slab = in_either(dimension, [rectangle(0.0, 0.0, 4.0, 1.0)])
    turned = solver.Pose(slab.centroids, np.array([[turn] if dimension == 2 else [0.0, -turn, 0.0]]))
    load = lay(slab, "*", surface).load(slab, turned)[0]
    left, depth = -2.0 * np.cos(turn) - 0.5 * np.sin(turn), surface - 0.5 + 2.0 * np.sin(turn) - 0.5 * np.cos(turn)
    width = depth / np.tan(turn)
    assert 0.0 < width < 4.0 * np.cos(turn)
    down = WEIGHT * width * depth / 2.0
    moment = (left + width / 3.0) * down
    expected = [0.0, -down, -moment] if dimension == 2 else [0.0, 0.0, -down, 0.0, moment, 0.0]
    assert load == pytest.approx(expected, abs=1e-12)


CASE = """
[geometry]
layout = "segmental arch"
parameters = { span = 4.0, rise = 1.0, voussoirs = 5 }
[roles]
"right springer" = "moving"
[settlement]
direction = [1, 0]
"""
SHORT = "increment = 0.001\nlimit = 0.001\n"
FILL = {"over": '"voussoir *"', "surface": "2.0", "unit_weight": "18000.0"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"over": '"vousoir 3"'}, r"\[backfill\] over: no block and no material is named 'vousoir 3' \(did you mean"),
        ({"over": "[]"}, r"\[backfill\] over is empty"),
        ({"over": '"left springer"'}, "'left springer' are supports only; fill loads free blocks"),
        ({"surface": "1.0"}, r"surface is 1 m, below the extrados of block 'voussoir 2', which reaches 1.20"),
        ({"surface": "inf"}, r"surface is inf.*a finite number"),
        ({"unit_weight": "-18000.0"}, r"\[backfill\] unit_weight is -18000"),
        ({"pressure_coefficient": "-0.1"}, r"\[backfill\] pressure_coefficient is -0.1"),
    ],
)
def test_fill_that_cannot_be_is_refused_in_one_line(change: dict[str, str], words: str) -> None:
    keys = "\n".join(f"{key} = {value}" for key, value in (FILL | change).items())
    with pytest.raises(ValueError, match=words) as error:
        assembly_of(case_from(f"{CASE}[[backfill]]\n{keys}\n"))
    assert "\n" not in str(error.value)


@pytest.mark.slow
def test_fills_over_the_same_blocks_lie_one_on_another(tmp_path: Path) -> None:
    def filled(*tables: dict[str, str]) -> tuple[solver.Assembly, solver.Loads]:
        texts = ["\n".join(f"{key} = {value}" for key, value in (FILL | table).items()) for table in tables]
        case = case_from(CASE + SHORT + "".join(f"[[backfill]]\n{text}\n" for text in texts))
        response = run_case(case, tmp_path, overwrite=True, outputs=[]).response
        return response.assembly, response.loads

    pressing = {"pressure_coefficient": "0.3"}
    assembly, whole = filled(pressing)
    start = solver.Pose.initial(assembly)
    sunk = solver.Pose(start.positions - [0.02, 0.05], start.rotations + 0.1)
    for layers in ((pressing | {"surface": "1.4"}, {}), ({}, pressing | {"surface": "1.4"})):
        loads = filled(*layers)[1]
        for pose in (start, sunk):
            pushed = [of.with_acceleration(assembly, (1.0, 0.0)).live_at(assembly, pose) for of in (loads, whole)]
            np.testing.assert_allclose(loads.dead_at(assembly, pose), whole.dead_at(assembly, pose), atol=1e-9)
            np.testing.assert_allclose(*pushed, atol=1e-9)
    heavy, light = (fill.weight(assembly) for fill in filled({"surface": "1.4"}, {"unit_weight": "9000.0"})[1].fills)
    (low,) = (fill.weight(assembly) for fill in filled({"surface": "1.4"})[1].fills)
    (all_light,) = (fill.weight(assembly) for fill in filled({"unit_weight": "9000.0"})[1].fills)
    assert (heavy, heavy + light) == pytest.approx((low, all_light + low / 2))


def test_fills_up_to_the_same_surface_over_a_block_are_refused() -> None:
    text = "".join("[[backfill]]\n" + "\n".join(f"{key} = {value}" for key, value in FILL.items()) + "\n" for _ in "ab")
    with pytest.raises(
        ValueError, match=r"\[backfill 1\] and \[backfill 2\] both fill up to 2 m over block 'voussoir 1'"
    ):
        assembly_of(case_from(CASE + text))


def test_fill_over_covered_blocks_is_refused() -> None:
    boxes = [rectangle(0, 0, 1, 1), rectangle(0, 1, 1, 2)]
    assembly = solver.Assembly.from_outlines(boxes, names=["below", "above"])
    with pytest.raises(ValueError, match="none of 'below' looks up to the surface"):
        down(assembly, "below", 3.0)
    with pytest.warns(UserWarning, match="no fill lies on 'below': no free block .* name the topmost blocks"):
        down(assembly, ["above", "below"], 3.0)


def test_a_linear_program_per_increment_has_no_fill() -> None:
    assembly = assembly_of(case_from(CASE))
    weight = solver.self_weight(assembly)
    loads = solver.Loads(weight.dead, weight.live, (lay(assembly, "voussoir *", 2.0),))
    structure = solver.Structure(assembly, loads=loads, friction_coefficient=0.7)
    with pytest.raises(ValueError, match="under loads that stay as they are"):
        structure.settle([1.0, 0.0], controls=solver.Controls(increments="linear program"))


@pytest.mark.slow
def test_fill_is_drawn_up_to_its_surface(tmp_path: Path) -> None:
    blocks = [rectangle(0.0, 0.0, 1.0, 1.0), rectangle(-1.0, -1.0, 2.0, 0.0)]
    assembly = solver.Assembly.from_outlines(blocks, names=["block", "ground"], roles=["free", "moving"])
    weight = solver.self_weight(assembly)
    shown = {}
    for name, fills in (("bare", ()), ("filled", (lay(assembly, "block", 3.0),))):
        loads = solver.Loads(weight.dead, weight.live, fills)
        structure = solver.Structure(assembly, loads=loads, friction_coefficient=0.7)
        response = structure.settle(solver.Settlement([0.0, -1.0], increment=0.1, limit=0.1))
        drawn = draw_still(response, -1, tmp_path / f"{name}.png", size=(640, 360))
        shown[name] = alike(pixels(drawn), (150, 128, 92), 30).sum()
    # The line of its surface is as long as the block is wide.
    assert shown["filled"] > shown["bare"] + 40


def test_of_fill_on_fill_the_report_draws_the_load_that_it_has() -> None:
    assembly = assembly_of(case_from(CASE))
    low = lay(assembly, "voussoir *", 2.0)
    high = replace(lay(assembly, "voussoir *", 3.0), base=2.0)
    weight = solver.self_weight(assembly)
    loads = solver.Loads(weight.dead, weight.live, (low, high))
    settlement = solver.Settlement([1.0, 0.0], increment=1e-3, limit=1e-3)
    response = solver.Structure(assembly, loads=loads, friction_coefficient=0.7).settle(settlement)
    drawn = json.loads(re.findall(r'<script id="model" type="application/json">(.*?)</script>', report_of(response))[0])
    # A piece has block, ends, surface, base, weight of a metre and coefficient; the load is of what is above both.
    found = [
        (x0 - x1) * w * max(0.0, surface - max(base, (y0 + y1) / 2.0))
        for _, x0, y0, x1, y1, surface, base, w, _ in drawn["fill"]["pieces"]
    ]
    assert sum(found) == pytest.approx(sum(fill.weight(assembly) for fill in (low, high)), rel=1e-4)


def test_fill_of_lists_is_that_of_arrays() -> None:
    assembly = solver.Assembly.from_outlines([rectangle(0.0, 0.0, 4.0, 1.0)], names=["slab"])
    fill, pose = lay(assembly, "slab", 2.0), solver.Pose.initial(assembly)
    assert fill.thickness is not None
    listed = solver.Backfill(
        fill.pieces.tolist(),
        fill.block.tolist(),
        2.0,
        WEIGHT,
        thickness=fill.thickness.tolist(),  # type: ignore[arg-type]
    )
    assert listed.load(assembly, pose).tolist() == fill.load(assembly, pose).tolist()
    with pytest.raises(ValueError, match="a fill has the thickness of its pieces in the plane"):
        solver.Backfill(fill.pieces, fill.block, 2.0, WEIGHT)


@pytest.mark.parametrize("dimension", [2, 3])
def test_an_acceleration_acts_on_the_fill_in_the_middle_of_its_columns(dimension: int) -> None:
    """1 m² or m³ over a block that turned: half of it, as high on average, stands on each half of its top."""
    block = in_either(dimension, [rectangle(0.0, 0.0, 1.0, 1.0)])
    loads = replace(solver.self_weight(block), fills=(lay(block, "*", 2.0, 0.4),))
    along = np.eye(dimension)[0]
    loads = loads.with_acceleration(block, 0.5 * along).with_acceleration(block, -2.0 * along, "dead")
    start = solver.Pose.initial(block)
    own = solver.weight_fraction(block, along)[0, 0]
    pushed, alone = loads.live_at(block, start)[0], solver.self_weight(block).dead
    turning = 2 if dimension == 2 else 4
    assert pushed[0] == pytest.approx(0.5 * (own + WEIGHT))
    # 1 m above the centroid, clockwise in the plane.
    assert abs(pushed[turning]) == pytest.approx(0.5 * WEIGHT)
    given = loads.dead_at(block, start) - replace(loads, dead=alone, dead_acceleration=None).dead_at(block, start)
    np.testing.assert_allclose(given, -4.0 * loads.live_at(block, start), atol=1e-9)
    # Sunk by 0.2 m, under 1.2 m.
    sunk = solver.Pose(start.positions - 0.2 * np.eye(dimension)[-1], start.rotations)
    assert loads.live_at(block, sunk)[0, 0] == pytest.approx(0.5 * (own + 1.2 * WEIGHT))
    assert abs(loads.live_at(block, sunk)[0, turning]) == pytest.approx(0.5 * 1.2 * WEIGHT * 1.1)


DRAWN, MOVED = CASE.split("[settlement]")
FILLED = "[[backfill]]\n" + "\n".join(f"{key} = {value}" for key, value in FILL.items()) + "\n"
PUSHED = f'{DRAWN}{FILLED}[analysis]\nkind = "limit load"\n[[loads]]\nkind = "live"\nweight_fraction = [0.5, 0.0]\n'


@pytest.mark.slow
def test_a_weight_fraction_is_one_of_the_fill_over_its_blocks_too(tmp_path: Path) -> None:
    response = run_case(case_from(f'{PUSHED}blocks = "voussoir 3"\n'), tmp_path, outputs=[]).response
    assembly, start = response.assembly, solver.Pose.initial(response.assembly)
    third = np.arange(assembly.n_blocks) == assembly.index("voussoir 3")
    weights = -response.loads.dead_at(assembly, start)[:, 1]
    np.testing.assert_allclose(response.loads.live_at(assembly, start)[:, 0], 0.5 * weights * third)
    assert response.limits[0].live_force == pytest.approx(0.5 * weights[third].sum())


@pytest.mark.thorough
def test_a_weight_fraction_that_begins_with_a_settlement_is_one_of_the_fill(tmp_path: Path) -> None:
    phases = f"[[settlement]]{MOVED}{SHORT}[[settlement]]{MOVED}{SHORT}"
    later = "[[loads]]\nweight_fraction = [0.01, 0.0]\nphase = 2\n"
    response = run_case(case_from(DRAWN + FILLED + phases + later), tmp_path, outputs=[]).response
    dead = response.dead_at(response.path[-1])
    np.testing.assert_allclose(dead[:, 0], -0.01 * dead[:, 1] * response.assembly.free, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("beside", ["", '[[loads]]\nkind = "live"\nforce = [2000.0, 0.0]\nblocks = "voussoir 3"\n'])
def test_dead_loads_that_an_acceleration_leaves_alone_are_told(
    beside: str, tmp_path: Path, recwarn: pytest.WarningsRecorder
) -> None:
    dead = '[[loads]]\nforce = [0.0, -2000.0]\nblocks = "voussoir 3"\n'
    run_case(case_from(PUSHED + dead + beside), tmp_path, outputs=[])
    told = [str(one.message) for one in recwarn if "have no mass" in str(one.message)]
    assert len(told) == (not beside)
    assert all("2000 N of other dead loads" in one for one in told)
