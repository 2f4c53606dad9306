"""A load that moves over blocks in space."""

import numpy as np
import pytest
from structures import case_from

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
