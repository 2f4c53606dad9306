"""A force with a point acts on the block that holds it."""

import json

import numpy as np
import pytest
from structures import begun, box, case_from, drawn, rectangle

import blockvis
import solver
from blockvis.cli import main

CASE = """[geometry]
layout = "wall"
[geometry.parameters]
bricks = 4
courses = 4
settling = [0.5, 1.0]
[settlement]
direction = [0, -1]
increment = 0.01
limit = 0.01
[output]
animation = false
[[loads]]
force = {force}
{more}
"""


def loads_of(more, force="[0, -500]"):
    return loads_in(CASE.format(force=force, more=more))


def loads_in(text, folder=None):
    """The assembly of a case, and its dead loads beside self-weight."""
    response = begun(case_from(text, folder))
    return response.assembly, response.loads.dead - solver.self_weight(response.assembly).dead


def test_the_sum_is_the_force_however_many_blocks_are_named():
    assembly, loads = loads_of("point = [0.3, 0.25]")
    assert np.flatnonzero(loads.any(axis=1)).size == 1
    np.testing.assert_allclose(loads[:, :2].sum(axis=0), [0.0, -500.0])
    (block,) = np.flatnonzero(loads.any(axis=1))
    assert loads[block, 2] == pytest.approx(-500.0 * (0.3 - assembly.centroids[block, 0]))


def test_a_point_far_outside_the_one_block_that_is_named_is_told():
    with pytest.warns(UserWarning, match=r"point \(0.3, 50\) lies 49\.\d m outside block 'brick 4-2'.*is it in m"):
        loads_of('blocks = "brick 4-2"\npoint = [0.3, 50]')


@pytest.mark.thorough
def test_axles_move_together_and_are_told_by_the_first(tmp_path):
    """A block that overhangs its ground, and tips about x = 0 as its weight says, 0.25 m behind that edge."""
    blocks = [
        {"name": "ground", "role": "fixed", "outline": [[-1.5, -0.5], [0, -0.5], [0, 0], [-1.5, 0]]},
        {"name": "block", "density": 2000, "outline": [[-1.5, 0], [1, 0], [1, 0.5], [-1.5, 0.5]]},
    ]
    (tmp_path / "a.json").write_text(json.dumps({"unit": "m", "blocks": blocks}), encoding="utf-8")
    axle = '[[loads]]\nkind = "live"\nforce = [0, {}]\npositions = {}\n'
    axles = axle.format(-1000, [0.2, 0.6, 3]) + axle.format(-500, [0.5, 0.9, 3])
    case = tmp_path / "a.toml"
    case.write_text(f'[geometry]\nfile = "a.json"\n[analysis]\nkind = "limit load"\n{axles}', encoding="utf-8")
    found = blockvis.run_case(case, tmp_path / "out", outputs=()).response
    x, weight = np.array([0.2, 0.4, 0.6]), 2000 * 1.25 * solver.GRAVITY
    by_hand = 0.25 * weight / (1000 * x + 500 * (x + 0.3))
    assert [limit.multiplier for limit in found.limits] == pytest.approx(by_hand, rel=1e-9)
    assert [increment.parameter for increment in found.path] == pytest.approx(x)
    # Read again the lowest place has all of them.
    assert blockvis.open_results(tmp_path / "out").loads.live.sum(axis=0)[1] == pytest.approx(-1500.0)


@pytest.mark.parametrize(("sense", "end"), [(1, "the last"), pytest.param(-1, "the first", marks=pytest.mark.thorough)])
def test_a_lowest_load_at_an_end_and_what_its_picture_leaves_out_are_told(tmp_path, capsys, sense, end):
    """A block that overhangs its ground by 1 m carries the less the farther out the load is."""
    near, far = sorted([-1.5 * sense, 0.0]), sorted([-1.5 * sense, 1.0 * sense])
    outlines = [rectangle(near[0], -0.5, near[1], 0.0), rectangle(far[0], 0.0, far[1], 0.5)]
    first, last = sorted([0.02 * sense, 0.62 * sense])
    drawn(tmp_path / "a.json", outlines, ["ground", "block"], role=["fixed", None])
    case = tmp_path / "a.toml"
    case.write_text(
        '[geometry]\nfile = "a.json"\n[analysis]\nkind = "limit load"\n[output]\nanimation = false\n'
        f'[[loads]]\nkind = "live"\nforce = [0, -1000]\npositions = [{first}, {last}, 4]\n',
        encoding="utf-8",
    )
    assert main(["run", str(case), "-o", str(tmp_path / "out")]) == 0
    assert f"load at x = {0.62 * sense:g} m, {end} of them: it may be lower beyond" in capsys.readouterr().out
    most = 0.25 * 2000 * 1.25 * solver.GRAVITY / (1000 * 0.02)
    svg = blockvis.draw_curve(blockvis.open_results(tmp_path / "out"), tmp_path / "curve.svg").read_text("utf-8")
    assert f"above this picture: up to {most:.4g} at x = {0.02 * sense:g} m" in svg


def test_between_two_blocks_the_force_goes_into_the_one_it_pushes():
    course = float(np.ptp(blockvis.generators.wall(bricks=4, courses=4).outline(2)[:, 1]))
    blocks = {}
    for force in ("[0, -500]", "[0, 500]"):
        assembly, loads = loads_of(f"point = [0.3, {2 * course}]", force)
        (block,) = np.flatnonzero(loads.any(axis=1))
        blocks[force] = assembly.centroids[block, 1]
    assert blocks["[0, -500]"] < 2 * course < blocks["[0, 500]"]


@pytest.mark.parametrize("sense", [1, -1])
def test_edges_are_counted_from_the_first_corner_in_whichever_sense_it_is_drawn(tmp_path, sense):
    """Edge 2 of a trapezoid that begins at its lower left corner is its right flank, a metre high."""
    trapezoid = np.array([[0, 0], [1, 0], [1, 1], [0.2, 1]])
    stone = trapezoid if sense > 0 else np.roll(trapezoid[::-1], 1, axis=0)
    drawn(tmp_path / "stone.json", [stone, rectangle(0, -1, 1, 0)], ["stone", "ground"], role=[None, "fixed"])
    text = '[geometry]\nfile = "stone.json"\n[analysis]\nkind = "limit load"\n'
    text += '[[loads]]\nkind = "live"\npressure = 1000.0\nblocks = "stone"\nedge = 2\n'
    np.testing.assert_allclose(begun(case_from(text, tmp_path)).loads.live[0, :2], [-1000.0, 0.0])


def test_in_space_the_block_is_found_by_its_faces():
    corner = blockvis.generators.build("L corner", {})
    chosen = np.flatnonzero(corner.free)[::3]
    text = '[geometry]\nlayout = "L corner"\n[settlement]\ndirection = [0, 0, -1]\n'
    for block in chosen:
        text += f"[[loads]]\nforce = [0, 0, {-1e-3 * (block + 1)}]\npoint = {corner.centroids[block].tolist()}\n"
    expected = np.zeros(corner.n_blocks)
    expected[chosen] = -1e-3 * (chosen + 1)
    np.testing.assert_allclose(loads_in(text)[1][:, 2], expected, atol=1e-9)


def test_a_moment_in_space_acts_on_one_of_the_blocks_that_meet_at_its_point(tmp_path):
    boxes = [box((0, 0, z), (1, 1, z + 1)) for z in (-1, 0, 1)]
    drawn(tmp_path / "pile.json", boxes, role=["moving", None, None])
    text = '[geometry]\nfile = "pile.json"\n[settlement]\ndirection = [0, 0, -1]\n'
    _, added = loads_in(text + "[[loads]]\nmoment = [0, 100, 0]\npoint = [0.5, 0.5, 1]\n", tmp_path)
    np.testing.assert_allclose(added[1:].sum(axis=0), [0.0, 0.0, 0.0, 0.0, 100.0, 0.0], atol=1e-9)


def test_a_point_in_no_block_names_the_nearest(tmp_path, capsys):
    path = tmp_path / "case.toml"
    path.write_text(CASE.format(force="[0, -500]", more="point = [0.3, 5.0]"), encoding="utf-8")
    assert main(["run", str(path), "-o", str(tmp_path / "out"), "--no-pictures"]) == 2
    message = capsys.readouterr().err
    assert "[loads 1] point (0.3, 5) m lies in none of the blocks meant; the nearest is 'brick 4-" in message
    assert "m away" in message
    assert message.count("\n") == 1


def test_a_force_on_many_blocks_is_told_with_its_sum():
    with pytest.warns(UserWarning, match=r"acts on each of 18 blocks that blocks = '\*' names, 9 kN in all"):
        _, loads = loads_of("")
    np.testing.assert_allclose(loads[:, :2].sum(axis=0), [0.0, -9000.0])


@pytest.mark.thorough
def test_notes_of_reopened_results_name_the_file_of_the_case(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(CASE.format(force="[0, -500]", more=""), encoding="utf-8")
    with pytest.warns(UserWarning, match="acts on each of 18 blocks"):
        blockvis.run_case(path, tmp_path / "out", outputs=())
    with pytest.warns(UserWarning, match="acts on each of 18 blocks") as noted:
        blockvis.open_results(tmp_path / "out")
    assert {str(note.message).partition(": [loads 1]")[0] for note in noted} == {str(tmp_path / "case.toml")}
