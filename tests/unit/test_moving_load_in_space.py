"""A load that moves over blocks in space."""

import numpy as np
import pytest
from structures import assembly_of, case_from

from blockvis import run_case
from blockvis.cases.loads import moving_loads

CASE = """
[geometry]
layout = "arch"
dimension = {d}
[geometry.parameters]
voussoirs = 7
[analysis]
kind = "limit load"
[[loads]]
kind = "live"
force = {force}
positions = [-0.6, 0.5, 3]
{y}
"""


PLANE, SPACE = {"d": 2, "force": "[0, -1000]", "y": ""}, {"d": 3, "force": "[0, 0, -1000]", "y": "y = 0.0"}


def loads_at_places(tmp_path, keys, more=""):
    case = case_from(CASE.format(**keys) + more, tmp_path)
    places, live = moving_loads(case.loads, assembly_of(case), case.source)
    return np.array([live(k) for k in range(len(places))])


def test_it_stands_where_it_stands_in_the_plane(tmp_path):
    plane, space = (loads_at_places(tmp_path, keys) for keys in (PLANE, SPACE))
    np.testing.assert_allclose(space[:, :, [0, 2]], plane[:, :, :2], atol=1e-9)
    # Turning from x to z is turning against the axis y.
    np.testing.assert_allclose(-space[:, :, 4], plane[:, :, 2], atol=1e-6)
    beside = loads_at_places(tmp_path, SPACE | {"y": "y = 0.25"})
    np.testing.assert_allclose(beside[:, :, 3].sum(axis=1), -250.0)


@pytest.mark.slow
def test_over_an_arch_it_finds_the_limit_loads_of_the_plane(tmp_path):
    found = []
    for keys in (PLANE, SPACE):
        case = case_from(CASE.format(**keys), tmp_path)
        run = run_case(case, tmp_path / f"out{keys['d']}", pictures=False, film=False, outputs=())
        found.append([limit.multiplier for limit in run.response.limits])
    assert len(found[1]) == 3
    assert found[1] == pytest.approx(found[0], rel=1e-5)


@pytest.mark.parametrize(
    ("keys", "more", "message"),
    [
        (SPACE | {"y": ""}, "", r"positions: the blocks are in space; add the line's y = "),
        (PLANE | {"y": "y = 0.0"}, "", "y is that of positions in space; the blocks are in the plane"),
        (SPACE | {"y": "y = 3.0"}, "", r"positions: nothing is below a load at x = -0.6, y = 3 m; .* y = -0.5"),
        (SPACE, "[roles]\n'voussoir *' = 'fixed'\n", r"x = -0.6, y = 0 m stands on the support 'voussoir"),
    ],
)
def test_places_that_cannot_be_loaded_are_refused(tmp_path, keys, more, message):
    with pytest.raises(ValueError, match=message):
        loads_at_places(tmp_path, keys, more)
