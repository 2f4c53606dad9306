"""Films between increments and at states that stand by themselves, and what of a run is drawn."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from structures import arch_response, box, brick, case_from, dropped_brick, pixels, posed, rectangle

import solver
from blockvis import animate
from blockvis.pictures.drawer import Drawer, Look
from blockvis.pictures.film import film_of, state_at
from blockvis.pictures.live_load import LiveLoads
from blockvis.pictures.solid_view import chosen_view
from blockvis.runs.outputs import Drawing

SIZE = (320, 180)

LIMIT_LOAD = """
[analysis]
kind = "limit load"
[[loads]]
kind = "live"
weight_fraction = [1.0, 0.0]
"""


def sideways_block(steps=3):
    """Give the response of a block that is pushed over: its increments have live loads."""
    assembly = solver.Assembly.from_outlines(
        [[[0, 0], [0.2, 0], [0.2, 1], [0, 1]], [[0, -1], [0.2, -1], [0.2, 0], [0, 0]]],
        roles=["free", "fixed"],
        names=["block", "ground"],
    )
    live = solver.weight_fraction(assembly, (1.0, 0.0), np.array([0]))
    loads = solver.Loads(solver.self_weight(assembly).dead, live)
    control = solver.ControlDisplacement("block", (1, 0), increment=0.02, limit=0.02 * steps)
    return solver.pushover(assembly, control, loads=loads, friction_coefficient=2.0)


def test_a_film_tells_what_is_lost_and_goes_on():
    response = dropped_brick(0.05)
    shown = response.path
    drawer = Drawer(response, Look(forces="none"), SIZE, shown)
    told = []
    drawer.picture = lambda state, badge=None: told.append((state.parameter, badge, bool(state.fallen.any())))
    list(film_of(drawer, 10.0, 3.0)[1])
    gone = response.losses[0].settlement
    named = [parameter for parameter, badge, _ in told if badge == "LOST · brick"]
    assert len(named) == 10
    assert gone < named[0] < gone + 0.1
    assert told[-1][0] == pytest.approx(1.0)
    assert [badge for parameter, badge, _ in told if parameter < gone] == [None] * sum(p < gone for p, *_ in told)
    assert all(lost for parameter, _, lost in told if parameter >= named[0])


def test_a_film_tells_what_is_taken_away_between_settlements():
    outlines = [
        rectangle(0.0, -1.0, 2.0, 0.0),
        rectangle(2.0, -1.0, 4.0, 0.0),
        *(brick(x, 0.0, 1.0, 0.5) for x in (0, 1)),
    ]
    assembly = solver.Assembly.from_outlines(outlines, roles=["fixed", "moving", "free", "free"])
    down = solver.Settlement((0, -1), increment=0.01, limit=0.01)
    change = solver.PhaseChange(1, np.array([False, False, False, True]))
    response = solver.Structure(assembly, friction_coefficient=0.6).settle([down, down], changes=[change])
    drawer = Drawer(response, Look(forces="none"), SIZE, response.path)
    told = []
    drawer.picture = lambda state, badge=None: told.append((badge, bool(state.removed.any())))
    list(film_of(drawer, 10.0, 4.0)[1])
    first = next(k for k, (badge, _) in enumerate(told) if badge)
    assert told[first : first + 10] == [(f"TAKEN AWAY · {assembly.names[3]}", True)] * 10
    assert {badge for badge, _ in told[:first] + told[first + 10 :]} == {None}
    assert not any(gone for _, gone in told[:first])


def test_loads_grow_with_their_multiplier_between_increments(tmp_path):
    response = sideways_block()
    loads = LiveLoads(response, response.path, 1.0)
    before, after = response.path[:2]
    state = state_at(response, (before.parameter + after.parameter) / 2.0)
    lengths = [
        np.linalg.norm(np.subtract(*loads.arrows(one, one.pose)), axis=1)[0] / one.load_multiplier
        for one in (before, state, after)
    ]
    assert lengths == pytest.approx([lengths[0]] * 3)
    assert state.load_multiplier == pytest.approx((before.load_multiplier + after.load_multiplier) / 2.0)
    assert len(list(animate(response, tmp_path / "frames", size=SIZE, fps=5, seconds=1.0).iterdir())) == 5 + 4


@pytest.mark.slow
def test_a_poster_is_where_the_fall_is_fastest(tmp_path):
    frames = animate(
        arch_response(), tmp_path / "frames", size=SIZE, fps=25, seconds=0.1, poster=tmp_path / "poster.png"
    )
    pictures, poster = [pixels(frame)[45:140] for frame in sorted(frames.iterdir())], pixels(tmp_path / "poster.png")
    chosen = [k for k, picture in enumerate(pictures) if (picture == poster[45:140]).all()]
    # What is drawn anew, of a fall that takes a second or two behind half a second of rest.
    changes = [np.abs(after - before).sum() for before, after in pairwise(pictures)]
    assert len(chosen) == 1
    assert 20 < chosen[0] < 60
    assert changes[chosen[0] - 1] > 0.7 * max(changes[5:])


def test_the_poster_of_what_does_not_fall_is_its_end(tmp_path):
    poster = tmp_path / "poster.png"
    frames = animate(sideways_block(), tmp_path / "frames", size=SIZE, fps=5, seconds=1.0, poster=poster)
    assert poster.read_bytes() == max(frames.iterdir()).read_bytes()


def test_what_falls_is_not_hidden_by_what_stands():
    """A small block that slides along x behind a tall one is seen from behind it, where from the front it is not."""
    assembly = solver.Assembly.from_solids([box((0, 0, 0), (2, 0.3, 2)), box((0.8, 0.4, 0), (1.2, 0.8, 0.4))])
    motion = np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]])
    response = replace(posed(assembly, solver.Pose.initial(assembly)), increments=())
    assert chosen_view(response, motion).axes[2, 1] > 0.0
    alone = solver.Assembly.from_solids([box((0.8, 0.4, 0), (1.2, 0.8, 0.4))])
    alone = replace(posed(alone, solver.Pose.initial(alone)), increments=())
    assert chosen_view(alone, motion[1:]).axes[2, 1] < 0.0


@pytest.mark.parametrize("settles", [True, False])
def test_a_run_is_drawn_whole_with_its_cracks_where_there_may_be_any(tmp_path, settles):
    ending = "[settlement]\ndirection = [0, -1]\nincrement = 0.1\nlimit = 0.1\n" if settles else LIMIT_LOAD
    case = case_from('[geometry]\nlayout = "arch"\n[material]\nfriction_coefficient = 0.6\n' + ending)
    for name in ("report.html", "mechanism.png", "collapse.mp4"):
        (tmp_path / name).touch()
    assert Drawing().is_written(case, tmp_path) is not settles
    (tmp_path / "cracks.png").touch()
    assert Drawing().is_written(case, tmp_path)
