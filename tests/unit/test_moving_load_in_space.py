"""A load that moves over blocks in space."""

import json

import numpy as np
import pytest
from structures import case_from, report_of, run_command

import blockvis
from blockvis import run_case

CASE = """
[geometry]
layout = "arch"
dimension = {d}
[geometry.parameters]
voussoirs = 3
[analysis]
kind = "limit load"
[[loads]]
kind = "live"
force = {force}
positions = [-0.6, 0.5, 2]
{y}
"""


PLANE, SPACE = {"d": 2, "force": "[0, -1000]", "y": ""}, {"d": 3, "force": "[0, 0, -1000]", "y": "y = 0.0"}


def limit_loads(folder, keys, more=""):
    case = case_from(CASE.format(**keys) + more, folder)
    return run_case(case, folder / "out", overwrite=True, pictures=False, film=False, outputs=()).response.limits


@pytest.mark.slow
def test_over_an_arch_it_finds_the_limit_loads_of_the_plane(tmp_path):
    plane, space, beside = (limit_loads(tmp_path, keys) for keys in (PLANE, SPACE, SPACE | {"y": "y = 0.25"}))
    multipliers = [[limit.multiplier for limit in limits] for limits in (plane, space)]
    assert len(multipliers[1]) == 2
    assert multipliers[1] == pytest.approx(multipliers[0], rel=1e-5)
    # Beside the middle of the vault it turns the blocks about x.
    np.testing.assert_allclose([limit.response.loads.live[:, 3].sum() for limit in beside], -250.0)


@pytest.mark.slow
def test_neither_depth_nor_dimension_decides_which_joints_of_a_settled_arch_may_close(tmp_path):
    text = CASE.replace('"arch"', '"segmental arch"').replace("voussoirs = 3", "voussoirs = 11\nspan = 4.0\nrise = 1.0")
    text += "[settlement]\nincrement = 0.005\nlimit = 0.005\ndirection = "
    found = []
    for keys, direction in ((PLANE, "[1, 0]"), (SPACE, "[1, 0, 0]")):
        case = case_from(text.format(**keys).replace("-0.6, 0.5", "-0.9, 0.0") + direction, tmp_path)
        found.append(run_case(case, tmp_path / "out", overwrite=True, outputs=()).response)
    multipliers = [response.load_multiplier for response in found]
    assert multipliers[1] == pytest.approx(multipliers[0], rel=1e-3)


@pytest.mark.slow
def test_that_it_moves_over_a_settled_structure_is_told_everywhere(tmp_path, capsys):
    settled = "[[settlement]]\ndirection = [1, 0]\nincrement = 0.002\nlimit = 0.002\n"
    (tmp_path / "case.toml").write_text(CASE.format(**PLANE) + settled + settled.replace("2", "1"), encoding="utf-8")
    assert run_command(tmp_path / "case.toml", "-o", tmp_path / "out") == 0
    told, summary = "after settlements of 0.002 m, 0.001 m", json.loads((tmp_path / "out/summary.json").read_text())
    assert f"\n{told}\n" in capsys.readouterr().out
    assert [settlement["limit"] for settlement in summary["settlements"]] == [0.002, 0.001]
    assert summary["last_settlement"] == 0.001
    response = blockvis.open_results(tmp_path / "out")
    assert [settlement.limit for settlement in response.settlements] == [0.002, 0.001]
    assert told in blockvis.draw_curve(response, tmp_path / "curve.svg").read_text("utf-8")
    assert f"m {told}</title>" in (page := report_of(response))
    assert "phase 1" not in page


@pytest.mark.parametrize(
    ("keys", "more", "message"),
    [
        (SPACE | {"y": ""}, "", r"positions: the blocks are in space; add the line's y = "),
        (PLANE | {"y": "y = 0.0"}, "", "y is that of positions in space: leave it out, or take the blocks into space"),
        (SPACE | {"y": "y = 3.0"}, "", r"positions: nothing is below a load at x = -0.6, y = 3 m; .* y = -0.5"),
        (SPACE, "[roles]\n'voussoir *' = 'fixed'\n", r"x = -0.6, y = 0 m stands on the support 'voussoir"),
    ],
)
def test_places_that_cannot_be_loaded_are_refused(tmp_path, keys, more, message):
    with pytest.raises(ValueError, match=message):
        limit_loads(tmp_path, keys, more)
