"""Films: their frames, between increments too; what is drawn of a run; what is left where one cannot be written."""

import re
import subprocess
import sys
import weakref
from dataclasses import replace
from itertools import chain, pairwise, repeat
from types import SimpleNamespace

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image
from structures import (
    alike,
    arch_response,
    box,
    brick,
    case_from,
    dropped_brick,
    film_frames,
    pixels,
    posed,
    rectangle,
)

import blockvis
import solver
from blockvis import animate
from blockvis.pictures import video
from blockvis.pictures.acting_loads import LoadArrows
from blockvis.pictures.drawer import Drawer, Look
from blockvis.pictures.film import film_of, state_at
from blockvis.pictures.solid_view import chosen_view
from blockvis.pictures.video import write_film
from blockvis.results.folder import VIDEO_SUFFIXES
from blockvis.runs.outputs import Drawing
from solver import mechanics

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


def told_by_film(response, seconds):
    """What is drawn in each frame: its state and the words upon it."""
    drawer = Drawer(response, Look(forces="none"), SIZE, response.path)
    told = []
    drawer.picture = lambda state, badge=None: told.append((state, badge))
    list(film_of(drawer, 10.0, seconds))
    return told


@pytest.mark.parametrize(("seconds", "frames"), [(4.0, [10, 20, 10]), (1.0, [10, 10, 10]), (0.5, [5, 5, 5])])
@pytest.mark.slow
def test_a_short_phase_takes_a_second_of_the_film(seconds, frames):
    path = arch_response().path
    phases = [[replace(i, phase=k, parameter=part * i.parameter) for i in path] for k, part in enumerate((1e-3, 1, 0))]
    response = replace(arch_response(), increments=tuple(chain(*phases)), collapse=None)
    drawer = Drawer(response, Look(forces="none"), SIZE, response.path)
    shown = []
    drawer.picture = lambda state, badge=None: shown.append((state.phase, state.parameter))
    film = list(film_of(drawer, 10.0, seconds))
    assert len(film) == sum(frames) + 8
    # The last frame of a phase is where the next begins.
    counts = [sum(phase == k for phase, _ in shown[: sum(frames)]) for k in range(3)]
    assert np.abs(np.subtract(counts, frames)).max() <= 1, counts
    assert shown[0] == (0, 0.0)


@pytest.mark.slow
def test_a_film_tells_what_is_lost_and_goes_on():
    response = dropped_brick(0.05)
    told = [(state.parameter, badge, bool(state.fallen.any())) for state, badge in told_by_film(response, 3.0)]
    gone = response.losses[0].settlement
    named = [parameter for parameter, badge, _ in told if badge == "LOST · brick"]
    assert len(named) == 10
    assert gone < named[0] < gone + 0.1
    assert told[-1][0] == pytest.approx(1.0)
    assert [badge for parameter, badge, _ in told if parameter < gone] == [None] * sum(p < gone for p, *_ in told)
    assert all(lost for parameter, _, lost in told if parameter >= named[0])


@pytest.mark.thorough
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
    told = [(badge, bool(state.removed.any())) for state, badge in told_by_film(response, 4.0)]
    first = next(k for k, (badge, _) in enumerate(told) if badge)
    assert told[first : first + 10] == [(f"TAKEN AWAY · {assembly.names[3]}", True)] * 10
    assert {badge for badge, _ in told[:first] + told[first + 10 :]} == {None}
    assert not any(gone for _, gone in told[:first])


@pytest.mark.thorough
def test_a_film_tells_what_is_taken_away_apart_from_what_falls_with_it():
    """A stone that is taken away from under two others, which are lost before the settlement begins."""
    outlines = [
        rectangle(0.0, -1.0, 2.0, 0.0),
        rectangle(2.0, -1.0, 4.0, 0.0),
        brick(0.0, 0.0, 3.0, 2.0),
        *(brick(3.5, y, 0.1, height) for y, height in ((0.0, 1.8), (1.8, 0.1), (1.9, 0.1))),
    ]
    assembly = solver.Assembly.from_outlines(outlines, roles=["fixed", "moving", *["free"] * 4])
    down = solver.Settlement((0, -1), increment=0.01, limit=0.01)
    change = solver.PhaseChange(1, np.arange(6) == 3)
    response = solver.Structure(assembly, friction_coefficient=0.6).settle([down, down], changes=[change])
    assert response.path[-1].fallen.sum() == 3
    assert {badge for _, badge in told_by_film(response, 4.0)} == {
        None,
        f"TAKEN AWAY · {assembly.names[3]}; LOST · 2 blocks",
    }


@pytest.mark.thorough
def test_of_a_photograph_what_is_taken_away_is_left_pale():
    outlines = [rectangle(-1.0, -0.5, 3.0, 0.0), *(brick(x, 0.0, 0.4, 0.5) for x in (0.0, 1.0, 2.0))]
    assembly = solver.Assembly.from_outlines(outlines, roles=["moving", *["free"] * 3])
    aside = solver.Settlement((1, 0), increment=0.05, limit=0.05)
    gone = np.arange(4) == 3
    structure = solver.Structure(assembly, friction_coefficient=0.6)
    response = structure.settle([aside, aside], changes=[solver.PhaseChange(1, gone)])
    green = SimpleNamespace(seen=lambda low, pixel, size: np.full((*size[::-1], 3), (30, 120, 30), np.uint8))
    last = response.path[-1]
    drawer = Drawer(response, Look(forces="none"), SIZE, (last,), underlay=green)
    picture, inside = np.asarray(drawer.picture(last)).astype(int), drawer.sheet.inside[:2]
    stone, missing, beside = drawer.scene.at_pixel([*last.pose.positions[2:], (1.8, 0.25)]).astype(int) + inside
    assert alike(picture[missing[1], missing[0]], picture[beside[1], beside[0]])
    assert not alike(picture[stone[1], stone[0]], picture[beside[1], beside[0]])


def test_what_a_limit_load_is_without_bears_no_load():
    outlines = [rectangle(-1.0, -0.5, 3.0, 0.0), brick(-1.0, 0.0, 2.0, 0.5), brick(1.0, 0.0, 2.0, 0.5)]
    assembly = solver.Assembly.from_outlines([*outlines, brick(2.0, 0.5, 1.0, 0.5)], roles=["fixed", *["free"] * 3])
    live = np.zeros((4, 3))
    live[2, 0] = 1000.0
    limit = solver.Structure(assembly, friction_coefficient=0.6).with_live(live).limit_load(fallen=np.arange(4) == 3)
    state = limit.response.path[0]
    tails, tips = LoadArrows(limit.response, [state], 3.0).arrows(state, state.pose)
    assert len(tips) == 1
    assert tips[0, 1] == tails[0, 1]
    # Where hardly any load is left what is out of balance is none, here a thousandth of it on each block.
    amount = 1e-3 * limit.multiplier * 1000.0
    forces = state.state.forces.copy()
    forces[1, 1] += amount
    rough = replace(state, parameter=1.0, held=replace(state.state, forces=forces))
    assert len(LoadArrows(limit.response, [rough], 3.0).arrows(rough, rough.pose)[1]) == 2
    residual = 2.0 * amount / mechanics.total_weight(assembly)
    rough = replace(rough, certificate=replace(state.certificate, equilibrium_residual=residual))
    assert len(LoadArrows(limit.response, [rough], 3.0).arrows(rough, rough.pose)[1]) == 1


def test_pressure_is_drawn_on_the_face_that_it_meets():
    """Through the centroid of its block, an arrow ended there, as that of an acceleration does."""
    outlines = [rectangle(-1.0, -0.5, 3.0, 0.0), rectangle(0.0, 0.0, 1.0, 1.0)]
    assembly = solver.Assembly.from_outlines(outlines, roles=["fixed", "free"])
    weight = solver.self_weight(assembly)
    pressure = weight.with_forces(assembly, solver.surface_forces(assembly, 1000.0, (1.0, 0.0)), "live")
    for loads, x in ((pressure, 0.0), (weight.with_acceleration(assembly, (1.0, 0.0)), 0.5)):
        limit = solver.Structure(assembly, friction_coefficient=0.6, loads=loads).limit_load()
        (tip,) = LoadArrows(limit.response, limit.response.path, 3.0).arrows(limit.response.path[0], limit.state.pose)[
            1
        ]
        np.testing.assert_allclose(tip, [x, 0.5], atol=1e-9)


@pytest.mark.slow
def test_loads_grow_with_their_multiplier_between_increments(tmp_path):
    response = sideways_block()
    loads = LoadArrows(response, response.path, 1.0)
    before, after = response.path[:2]
    state = state_at(response.path, response.parameters, (before.parameter + after.parameter) / 2.0)
    lengths = [
        np.linalg.norm(np.subtract(*loads.arrows(one, one.pose)), axis=1)[0] / one.load_multiplier
        for one in (before, state, after)
    ]
    assert lengths == pytest.approx([lengths[0]] * 3)
    assert state.load_multiplier == pytest.approx((before.load_multiplier + after.load_multiplier) / 2.0)
    assert len(list(animate(response, tmp_path / "frames", size=SIZE, fps=5, seconds=1.0).iterdir())) == 5 + 4


@pytest.mark.parametrize("kind", ["tie", "prop", "bar"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_forces_of_ties_are_no_live_load(kind, dimension):
    roles, names = ["free", "fixed"], ["pier", "ground"]
    if dimension == 2:
        outlines = [rectangle(0.0, 0.0, 0.5, 2.0), rectangle(-3.0, -0.5, 3.0, 0.0)]
        assembly = solver.Assembly.from_outlines(outlines, roles=roles, names=names)
    else:
        solids = [box((0.0, -0.5, 0.0), (0.5, 0.5, 2.0)), box((-3.0, -1.0, -0.5), (3.0, 1.0, 0.0))]
        assembly = solver.Assembly.from_solids(solids, roles=roles, names=names)
    ends = np.zeros((2, dimension))
    ends[:, 0], ends[:, -1] = (0.25, 1.5 if kind == "prop" else -1.5), 1.2
    tie = solver.Tie("it", (0, None), ends, 1e7, kind=kind, strength=500.0)
    structure = solver.Structure(assembly, friction_coefficient=1.0, ties=[tie])
    limit = structure.limit_load(acceleration=np.eye(dimension)[0])
    assert np.abs(limit.state.ties.forces) == pytest.approx([500.0])
    loads = LoadArrows(limit.response, limit.response.path, 3.0)
    assert loads.largest == pytest.approx(limit.multiplier * mechanics.total_weight(assembly))
    (tip,) = loads.arrows(limit.response.path[0], limit.state.pose)[1]
    assert tip[-1] == pytest.approx(1.0)


def row_of(number, dimension, forces):
    """Stones that stand beside each other, a metre apart, pushed along x by forces [N]; the limit load they have."""
    low, high = (np.zeros((number, dimension)) for _ in range(2))
    low[:, 0] = np.arange(number)
    high[:] = low + 0.5
    ground = np.full(dimension, -1.0), np.full(dimension, 1.0)
    ground[1][0], ground[1][-1] = number, 0.0
    boxes = [ground, *zip(low, high, strict=True)]
    roles = ["fixed", *["free"] * number]
    if dimension == 2:
        assembly = solver.Assembly.from_outlines([rectangle(*a, *b) for a, b in boxes], roles=roles)
    else:
        assembly = solver.Assembly.from_solids([box(a, b) for a, b in boxes], roles=roles)
    live = np.zeros((number + 1, 3 * dimension - 3))
    live[1:, 0] = forces
    return solver.Structure(assembly, friction_coefficient=0.6).with_live(live).limit_load()


@pytest.mark.parametrize("dimension", [2, 3])
def test_each_of_few_loads_has_an_arrow_of_its_own(dimension):
    """From 25 on neighbours were one arrow in the plane, and in space some had none, the largest among them."""
    forces = np.where(np.arange(27) == 20, 900.0, 300.0)
    forces[3] = 1.0
    limit = row_of(27, dimension, forces)
    loads = LoadArrows(limit.response, limit.response.path, 27.0)
    tails, tips = loads.arrows(limit.response.path[0], limit.state.pose)
    lengths = (tips - tails)[:, 0]
    np.testing.assert_allclose(lengths / lengths.max(), np.maximum(forces / 900.0, 0.125), rtol=1e-4)
    assert loads.largest == pytest.approx(900.0 * limit.multiplier)
    assert "loads" not in loads.words
    assert "neighbours" not in loads.words


@pytest.mark.parametrize(
    ("view", "cut", "tips"),
    [("right", 2.95, [0.0, 1.0, 2.0]), pytest.param("left", 2.25, [2.25, 3.0, 4.0, 5.0], marks=pytest.mark.thorough)],
)
def test_a_section_shows_the_loads_of_blocks_that_it_leaves(monkeypatch, tmp_path, view, cut, tips):
    """An arrow was drawn where it began in what is left: beside a stone that is cut away, or not at one that stays."""
    drawn = []
    monkeypatch.setattr("blockvis.pictures.solid_scene._Arrows", lambda *arrows: drawn.append(arrows))
    monkeypatch.setattr("blockvis.pictures.solid_scene.SolidScene._shapes", lambda self, arrows: iter(()))
    limit = row_of(6, 3, np.ones(6))
    blockvis.draw_still(limit.response, 0, tmp_path / "cut.png", section=f"x = {cut}", view=view, size=SIZE)
    ((_, ends, *_),) = drawn
    np.testing.assert_allclose(np.sort(ends[:, 0]), tips, atol=1e-6)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_legend_tells_where_not_each_load_has_an_arrow(dimension):
    forces = np.where(np.arange(120) == 77, 150.0, 100.0)
    limit = row_of(120, dimension, forces)
    loads = LoadArrows(limit.response, limit.response.path, 120.0)
    tails, tips = loads.arrows(limit.response.path[0], limit.state.pose)
    if dimension == 2:
        assert "resultants of neighbours, longest arrow" in loads.words
        assert len(tips) == 9
        return
    assert "100 of 120 loads" in loads.words
    lengths, places = (tips - tails)[:, 0], tips[:, 0].round()
    assert len(tips) == 100
    assert places[lengths.argmax()] == 77
    assert np.diff(places).max() <= 2.0, "what is left out of loads that are alike lies apart"


@pytest.mark.slow
def test_forces_between_increments_are_those_of_the_reaction_that_the_title_tells():
    response = arch_response()
    moving = int(np.flatnonzero(response.assembly.moving)[0])
    for before, after in list(pairwise(response.path))[1:]:
        at = before.parameter + 0.75 * (after.parameter - before.parameter)
        state = state_at(response.path, response.parameters, at)
        assert state.reaction == pytest.approx(0.25 * before.reaction + 0.75 * after.reaction)
        push = mechanics.block_forces(state.contacts, state.pose, state.forces)[moving, 0]
        assert push == pytest.approx(state.reaction, rel=0.02)
        assert push != pytest.approx(before.reaction, rel=1e-4)
        joints = [one.contacts[one.forces[:, 0] > 0.0].joints()[0] for one in (state, before)]
        np.testing.assert_array_equal(*joints)


def test_ties_between_increments_carry_what_lies_between_theirs():
    """A block rises off its prop, and sinks back upon it."""
    outlines = [rectangle(0, -1, 1, 0), rectangle(0, 0, 1, 1)]
    assembly = solver.Assembly.from_outlines(outlines, roles=["moving", "free"])
    prop = solver.Tie("shore", (1, None), ((0.5, 0.9), (0.5, 0.0)), stiffness=1e6, kind=mechanics.PROP)
    up, down = (solver.Settlement((0, way), increment=0.008, limit=limit) for way, limit in ((1, 0.004), (-1, 0.008)))
    response = solver.Structure(assembly, friction_coefficient=0.6, ties=[prop]).settle([up, down])
    before, after = response.path[-2:]
    assert before.ties.states[0] == mechanics.SLACK
    assert after.ties.states[0] == mechanics.ELASTIC
    ties = state_at(response.path, response.parameters, response.parameters[-2] + 0.25 * after.parameter).ties
    assert ties.forces[0] == pytest.approx(0.25 * after.ties.forces[0])
    stretched = 0.75 * before.ties.elongations[0] + 0.25 * after.ties.elongations[0]
    assert ties.elongations[0] == pytest.approx(stretched)
    assert ties.states[0] == mechanics.ELASTIC


@pytest.mark.slow
def test_a_poster_is_where_the_fall_is_fastest(tmp_path):
    frames = animate(
        arch_response(), tmp_path / "frames", size=SIZE, fps=25, seconds=0.1, poster=tmp_path / "poster.png"
    )
    pictures, poster = [pixels(frame)[61:125] for frame in sorted(frames.iterdir())], pixels(tmp_path / "poster.png")
    chosen = [k for k, picture in enumerate(pictures) if (picture == poster[61:125]).all()]
    # What is drawn anew, of a fall that takes a second or two behind half a second of rest.
    changes = [np.abs(after - before).sum() for before, after in pairwise(pictures)]
    assert len(chosen) == 1
    assert 20 < chosen[0] < 60
    assert changes[chosen[0] - 1] > 0.7 * max(changes[5:])


@pytest.mark.slow
def test_the_poster_of_what_does_not_fall_is_its_end(tmp_path):
    poster = tmp_path / "poster.png"
    frames = animate(sideways_block(), tmp_path / "frames", size=SIZE, fps=5, seconds=1.0, poster=poster)
    assert poster.read_bytes() == max(frames.iterdir()).read_bytes()


@pytest.mark.slow
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
    names = ["report.html", "mechanism.png", "curve.png", "collapse.mp4", "poster.png"]
    for name in (*names, *(["cracks.png"] if settles else [])):
        assert not Drawing().is_written(case, tmp_path)
        (tmp_path / name).touch()
    assert Drawing().is_written(case, tmp_path)


SMALL = (128, 72)

#: The colours of the frames, one after another.
COLOURS = [(250, 250, 250), (200, 30, 30), (30, 160, 60), (40, 60, 200), (10, 10, 10)]


def frames(seen=None):
    for colour in COLOURS:
        picture = Image.new("RGB", SMALL, colour)
        if seen is not None:
            seen.append(weakref.ref(picture))
        yield picture


@pytest.mark.parametrize("suffix", VIDEO_SUFFIXES)
def test_a_film_holds_its_frames_in_order(tmp_path, suffix):
    path = write_film(frames(), tmp_path / f"film{suffix}", size=SMALL, fps=10.0)
    found = film_frames(path)
    assert len(found) == len(COLOURS)
    for frame, colour in zip(found, COLOURS, strict=True):
        assert frame.shape == (SMALL[1], SMALL[0], 3)
        # mp4 and webp keep brightness and colour apart, rounded each.
        assert np.abs(frame.astype(int) - colour).max() <= 6, colour
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.parametrize("suffix", VIDEO_SUFFIXES)
def test_frames_are_forgotten_when_they_are_written(tmp_path, suffix):
    seen, alive = [], []

    def watched():
        for picture in frames(seen):
            alive.append(sum(ref() is not None for ref in seen))
            yield picture

    write_film(watched(), tmp_path / f"film{suffix}", size=SMALL, fps=10.0)
    assert len(alive) == len(COLOURS)
    assert max(alive) <= 2, alive


@pytest.mark.parametrize("suffix", VIDEO_SUFFIXES)
def test_a_film_without_its_end_is_not_kept(tmp_path, monkeypatch, suffix):
    """Of an encoder that the system ends, or that finds the disk full at the end."""

    class Ended(subprocess.Popen):
        def wait(self, *given, **named):
            self.kill()
            return super().wait(*given, **named)

    (tmp_path / f"film{suffix}").write_bytes(b"the film before")
    monkeypatch.setattr(video, "Popen", Ended)
    with pytest.raises(OSError, match=r"could not be written: the encoder stopped before its end"):
        write_film(frames(), tmp_path / f"film{suffix}", size=SMALL, fps=10.0)
    monkeypatch.setattr(video, "FULL_DISK", float("inf"))
    with pytest.raises(OSError, match=r"No space left on device"):
        write_film(frames(), tmp_path / f"film{suffix}", size=SMALL, fps=10.0)
    assert [p.read_bytes() for p in tmp_path.iterdir()] == [b"the film before"]


def test_what_the_encoder_says_is_told(tmp_path, monkeypatch):
    monkeypatch.setitem(video._ENCODERS, ".mp4", ("no codec", "yuv420p", "-f mp4"))
    with pytest.raises(OSError, match=r"film\.mp4' could not be written: .*codec"):
        write_film(frames(), tmp_path / "film.mp4", size=SMALL, fps=10.0)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("code", [0, 1])
def test_what_the_encoder_says_after_it_takes_no_more_is_told(tmp_path, monkeypatch, code):
    program = f"import os, time; os.close(0); time.sleep(0.2); os.write(2, b'no room'); os._exit({code})"

    def refusing(command, **named):
        return subprocess.Popen([sys.executable, "-S", "-c", program], **named)

    monkeypatch.setattr(video, "Popen", refusing)
    with pytest.raises(OSError, match=r"film\.mp4' could not be written: no room"):
        write_film(repeat(Image.new("RGB", SMALL)), tmp_path / "film.mp4", size=SMALL, fps=10.0)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", VIDEO_SUFFIXES)
def test_what_fails_while_drawing_leaves_no_half_film(tmp_path, suffix):
    def failing():
        yield from frames()
        raise ValueError("this frame cannot be drawn")

    with pytest.raises(ValueError, match="this frame cannot be drawn"):
        write_film(failing(), tmp_path / f"film{suffix}", size=SMALL, fps=10.0)
    assert not list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written_is_told_before_anything_is_drawn(tmp_path):
    (tmp_path / "file").write_text("kept", encoding="utf-8")
    drawn = []
    with pytest.raises(OSError, match=r"film\.mp4' cannot be written \(.+\); choose another place for the film"):
        write_film(map(drawn.append, frames()), tmp_path / "file" / "film.mp4", size=SMALL, fps=10.0)
    assert not drawn
    assert [path.read_text(encoding="utf-8") for path in tmp_path.iterdir()] == ["kept"]


@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_the_rate_is_constant(tmp_path, suffix):
    path = write_film(frames(), tmp_path / f"film{suffix}", size=SMALL, fps=10.0)
    told = subprocess.run(
        [imageio_ffmpeg.get_ffmpeg_exe(), "-i", str(path), "-vf", "showinfo", "-f", "null", "-"],
        capture_output=True, text=True, check=True,
    ).stderr  # fmt: skip
    times = [float(time) for time in re.findall(r"pts_time:([0-9.]+)", told)]
    np.testing.assert_allclose(times, np.arange(len(list(frames()))) / 10.0)
    assert "10 fps" in told


def test_frames_are_written_as_pictures_into_a_folder(tmp_path):
    folder = write_film(frames(), tmp_path / "frames", size=SMALL, fps=10.0)
    names = [f"frame_{k:05d}.png" for k in range(len(list(frames())))]
    assert sorted(path.name for path in folder.iterdir()) == names
    assert [path.name for path in tmp_path.iterdir()] == ["frames"]
    write_film(list(frames())[:2], folder, size=SMALL, fps=10.0)
    assert sorted(path.name for path in folder.iterdir()) == names[:2]
    with Image.open(folder / names[0]) as first:
        np.testing.assert_array_equal(np.asarray(first), np.asarray(next(iter(frames()))))
    (folder / "notes.txt").write_text("kept", encoding="utf-8")
    with pytest.raises(ValueError, match="holds what is no frame of a film"):
        write_film(frames(), folder, size=SMALL, fps=10.0)
    assert (folder / "notes.txt").read_text(encoding="utf-8") == "kept"


@pytest.mark.parametrize(
    ("load", "point", "places"),
    [
        ("force = [0, 0, -1000]\npositions = [-0.5, 0.5, 2]\ny = 1.8", (0.0, 1.8), (-0.5, 0.5)),
        ("force = [0, 1000, -1000]\nblocks = 'stone 3-1'\npoint = [0.1, -1.7, 1.0]", (0.1, -0.7), (0.1,)),
    ],
)
@pytest.mark.slow
def test_loads_in_space_are_drawn_where_they_act(load, point, places, tmp_path):
    """Not over the middle of the stone, as long as the vault, and a slanted one on its line."""
    text = """
[geometry]
layout = "barrel vault"
parameters = {voussoirs = 5, length = 4.0, stones = 1, thickness_ratio = 0.3}
[material]
friction_coefficient = 0.7
[analysis]
kind = "limit load"
[[loads]]
kind = "live"
"""
    response = blockvis.run_case(case_from(text + load), tmp_path / "out", outputs=()).response
    loads = LoadArrows(response, response.path, 4.0)
    for one, x in zip(response.path, places, strict=True):
        (tail,), (tip,) = loads.arrows(one, one.pose)
        along = (tip - tail) / np.linalg.norm(tip - tail)
        y = point[1] if abs(along[1]) < 1e-6 else point[1] - tip[2]
        np.testing.assert_allclose(tip[:2], [x, y], atol=1e-6)
        assert tip[2] > 0.9


@pytest.mark.slow
def test_a_section_in_faces_leaves_nothing_of_the_blocks_before_it(tmp_path):
    """A block that ends in the plane, with nothing behind it, was left as a sheet."""
    images = []
    for high in (1, 2):
        boxes = [box((0, -1, 0), (1, 0, high)), box((0, 0, 0), (1, 1, 1)), box((-1, -3, -1), (2, 2, 0))]
        assembly = solver.Assembly.from_solids(boxes, roles=["free", "free", "fixed"])
        response = replace(posed(assembly, solver.Pose.initial(assembly)), settlements=())
        path = blockvis.draw_still(
            response, -1, tmp_path / "cut.png", section="y = 0", view={"azimuth": -60, "elevation": 20}, size=SIZE
        )
        images.append(pixels(path)[60:150].astype(int))
    # Corners are shaded over a part of the whole, which is higher.
    assert np.abs(images[0] - images[1]).max() < 30
